# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read a bag, our own or that of `ros2 bag record`, message by message."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path, PurePath
import shutil
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import zstandard

from rigid_sim_ros.bag import metadata as metadata_file
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.sqlite_file import SqliteReader

SUFFIXES = ('.mcap', '.db3')
ZSTD = '.zstd'


# A message as it was recorded: its topic, the time [ns], and the CDR.
Message: TypeAlias = tuple[str, int, bytes]


class BagReader:
    """
    A bag that can be read from the beginning.

    `faults` lists what was found on the way that does not fit although the messages could be
    read: wrong checksums, a file that was not closed.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Find the files of a bag; BagError if there is none, or a part of it is missing."""
        self.path = Path(path)
        self.faults: list[str] = []
        self._types: dict[str, str] = {}
        self._storage: SqliteReader | McapScan | None = None
        self.metadata: dict[str, Any] | None = None
        self._mode = ''
        if not self.path.exists():
            raise BagError(f'{path} does not exist, must be the folder of a bag')
        if not self.path.is_dir():
            if self.path.suffix not in SUFFIXES:
                raise BagError(f'{path} is no bag, must be a folder with metadata.yaml, or a file '
                               'that ends in .mcap or .db3')
            self.files = [self.path]
            return
        self.metadata = metadata_file.read(self.path)
        if self.metadata is None:
            raise BagError(_without_metadata(self.path))
        # Names only: a bag must not make us read what lies outside its folder.
        self.files = [self.path / PurePath(name).name
                      for name in self.metadata['relative_file_paths']]
        mode = self.metadata.get('compression_mode')
        self._mode = '' if mode in (None, 'none', 'NONE') else str(mode).lower()
        if self._mode not in ('', 'message', 'file'):
            raise BagError(f'{path}: compression mode {self._mode!r}, must be message or file')
        missing = [file.name for file in self.files if not file.is_file()]
        if missing:
            raise BagError(f'{path}: {missing[0]} is missing, which metadata.yaml names: '
                           f'`rigid_sim recover {path}` makes do with what is there')
        more = [file.name for file in bag_files(self.path) if file not in self.files]
        if more:
            raise BagError(f'{path} was not closed, metadata.yaml does not know {more[0]}: '
                           f'`rigid_sim recover {path}` takes it in')

    @property
    def types(self) -> dict[str, str]:
        """The types of the topics as far as they were met: of every message that was given."""
        if self._storage is not None:
            self._types.update(self._storage.topics.values())
        return self._types

    def messages(self) -> Iterator[Message]:
        """
        Give every message in the order of recording.

        BagError where the bag cannot be read any further.
        """
        try:
            for file in self.files:
                yield from self._messages_of(file)
        except OSError as error:
            raise BagError(f'{error.filename or self.path}: {error.strerror or error}') from None

    def _messages_of(self, file: Path) -> Iterator[Message]:
        with self._plain(file) as plain:
            if plain.suffix == '.db3':
                storage: SqliteReader | McapScan = SqliteReader(plain, self._mode == 'message')
                decompress = None
            else:
                storage = McapScan(plain)
                decompress = self._mode == 'message' and zstandard.ZstdDecompressor().decompress
            try:
                topics, self._storage = storage.topics, storage
                for channel, stamp, data in storage.messages():
                    yield topics[channel][0], stamp, decompress(data) if decompress else data
            except zstandard.ZstdError as error:
                raise Damaged(f'{file.name} is damaged ({error})') from None
            finally:
                storage.close()
                self._types, self._storage = self.types, None
                if isinstance(storage, McapScan):
                    self.faults += storage.faults

    @contextmanager
    def _plain(self, file: Path) -> Iterator[Path]:
        """Give the file, uncompressed if it is compressed as a whole."""
        if self._mode != 'file' or file.suffix != ZSTD:
            yield file
            return
        with TemporaryDirectory() as folder:
            plain = Path(folder, file.stem)
            try:
                with file.open('rb') as packed, plain.open('wb') as unpacked:
                    zstandard.ZstdDecompressor().copy_stream(packed, unpacked)
            except zstandard.ZstdError as error:
                raise Damaged(f'{file.name} is damaged ({error})') from None
            yield plain


def bag_files(folder: Path) -> list[Path]:
    """Return the files in a folder that look as if they belonged to a bag, in their order."""
    found = [path for path in folder.iterdir()
             if path.suffix in SUFFIXES or path.name.endswith(tuple(s + ZSTD for s in SUFFIXES))]
    return sorted(found, key=lambda path: (_number(path), path.name))


def free_space_error(error: OSError, path: Path) -> str:
    """Return one line about a disk that does not take more."""
    try:
        left = shutil.disk_usage(path.parent).free
    except OSError:
        return f'{path}: {error.strerror or error}'
    return f'{path}: {error.strerror or error} ({left / 1e6:.1f} MB free)'


def _number(path: Path) -> int:
    """Return 12 for session_12.mcap; files are numbered as they were written."""
    tail = path.name.split('.')[0].rpartition('_')[2]
    return int(tail) if tail.isascii() and tail.isdecimal() else -1


def _without_metadata(folder: Path) -> str:
    if bag_files(folder):
        return (f'{folder} was not closed, its metadata.yaml is missing: `rigid_sim recover '
                f'{folder}` restores it')
    return f'{folder} is no bag: it has neither metadata.yaml nor files of one'
