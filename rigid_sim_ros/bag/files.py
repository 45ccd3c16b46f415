# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Open files of a bag as what they are: somebody else's.

A bag may come from anybody, so what looks like one of its files may be a pipe that never ends, a
device, or a link to something that is not part of the bag. Only regular files are opened, and none
through a link; and what is compressed may grow to so much and no more.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import errno
import io
import os
from pathlib import Path, PurePath
import stat
from tempfile import TemporaryDirectory

import zstandard

from rigid_sim_ros.bag.errors import BagError, Damaged

SUFFIXES = ('.mcap', '.db3')
ZSTD = '.zstd'

# [bytes] What is compressed may grow to LARGEST, or to _GROWTH times its size: a chunk is some
# MB, and states that repeat shrink to a tenth. A few kB that grow to a GB are meant to harm.
LARGEST = 32 << 20
_GROWTH = 16
# The same of all pieces of a file together, and of a file that is compressed as a whole: what is
# read piece by piece takes time, and room on the disk, but no memory.
_LARGEST_FILE = 8 * LARGEST
_FILE_GROWTH = 64

_PIECE = 1 << 20


def open_regular(path: Path) -> io.BufferedReader:
    """
    Open a file to be read; BagError if it is none or a link, OSError if it cannot be opened.

    The last part of the path must not be a link: a link in a bag leads out of it.
    """
    try:
        # Without O_NONBLOCK a pipe would wait for somebody to write into it.
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise BagError(f'{path} is a link, must be a file of the bag: copy the bag with '
                           '`cp -rL`') from None
        raise
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise BagError(f'{path} is not a regular file, must be one: remove it from the bag')
    return open(handle, 'rb')


def size_of(path: Path) -> int:
    """Return the size of a regular file [bytes]; errors as in `open_regular`."""
    with open_regular(path) as file:
        return os.fstat(file.fileno()).st_size


def bag_files(folder: Path) -> list[Path]:
    """Return the files in a folder that look as if they belonged to a bag, in their order."""
    found = [path for path in folder.iterdir() if is_bag_file(path.name)]
    return sorted(found, key=lambda path: (_number(path), path.name))


def is_bag_file(name: str) -> bool:
    """Return whether a file of this name belongs to a bag."""
    return PurePath(name.removesuffix(ZSTD)).suffix in SUFFIXES


def most_unpacked(packed: int) -> int:
    """Return how many bytes may come of so many compressed ones."""
    return max(LARGEST, _GROWTH * packed)


class Budget:
    """How much may become of a file whose pieces are read one after the other."""

    def __init__(self, packed: int) -> None:
        """Begin with a file of so many bytes."""
        self.most = self.left = max(_LARGEST_FILE, _FILE_GROWTH * packed)

    def spend(self, size: int) -> None:
        """Take so many bytes away; ValueError if there are not so many left."""
        self.left -= size
        if self.left < 0:
            raise ValueError(f'all that is in the file grows beyond {self.most} bytes')


class Unpacker:
    """Unpacks frames of zstd out of one file for one thread."""

    def __init__(self, budget: Budget) -> None:
        """Make room for it; all frames together may grow as far as the budget says."""
        self._budget = budget
        self._decompress = zstandard.ZstdDecompressor().decompress

    def __call__(self, data: bytes, size: int | None = None) -> bytes:
        """
        Return what a frame holds; ValueError if it is none or grows beyond all measure.

        `size` is what it must come to, if that is known.
        """
        try:
            told = zstandard.frame_content_size(data)
            if size is not None and told not in (-1, size):
                raise ValueError(f'{told} bytes, must be {size}')
            wanted, most = max(told, size or 0), most_unpacked(len(data))
            if wanted > most:
                raise ValueError(f'{len(data)} bytes that grow to {wanted}')
            self._budget.spend(wanted)
            # Where the size is not known the limit is how far it may grow.
            raw: bytes = self._decompress(data, max_output_size=wanted or most)
            self._budget.spend(len(raw) - wanted)
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from None
        return raw


@contextmanager
def unpacked(file: Path) -> Iterator[Path]:
    """Give a file that is compressed as a whole as it is without that, in a temporary folder."""
    with TemporaryDirectory(prefix='rigid_sim_ros_') as folder:
        plain = Path(folder, file.name.removesuffix(ZSTD))
        with open_regular(file) as packed, plain.open('xb') as target:
            budget = Budget(os.fstat(packed.fileno()).st_size)
            try:
                with zstandard.ZstdDecompressor().stream_reader(
                        packed, read_across_frames=True) as pieces:
                    while piece := pieces.read(_PIECE):
                        budget.spend(len(piece))
                        target.write(piece)
            except (zstandard.ZstdError, ValueError) as error:
                raise Damaged(f'{file.name} is damaged ({error})') from None
        yield plain


def _number(path: Path) -> int:
    """Return 12 for session_12.mcap; files are numbered as they were written."""
    tail = path.name.split('.')[0].rpartition('_')[2]
    return int(tail) if tail.isascii() and tail.isdecimal() and len(tail) < 20 else -1
