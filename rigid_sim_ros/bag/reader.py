# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read a bag, our own or that of `ros2 bag record`, message by message."""

from collections import Counter
from collections.abc import Iterator
from contextlib import nullcontext
import os
from pathlib import Path, PurePath
import shutil
from typing import Any, TypeAlias

from rigid_sim_ros.bag import metadata as metadata_file
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.files import bag_files, Budget, size_of, SUFFIXES, unpacked, Unpacker, ZSTD
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.sqlite_file import SqliteReader
from rigid_sim_ros.problems import counted

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
        if not os.path.exists(path):    # also for a name that is too long to exist
            raise BagError(f'{path} does not exist, must be the folder of a bag')
        if not self.path.is_dir():
            if self.path.suffix not in SUFFIXES:
                raise BagError(f'{path} is no bag, must be a folder with metadata.yaml, or a file '
                               'that ends in .mcap or .db3')
            # A link that the user names is followed; those within a bag are not.
            self.files = [self.path.resolve()]
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

    @property
    def may_have_lost(self) -> bool:
        """Whether the bag was recovered, as far as its metadata tell."""
        return self.metadata is None or 'recovered' in (self.metadata.get('custom_data') or {})

    def messages(self) -> Iterator[Message]:
        """
        Give every message in the order of recording.

        BagError where the bag cannot be read any further.
        """
        counts: Counter[str] = Counter()
        try:
            for file in self.files:
                for message in self._messages_of(file):
                    counts[message[0]] += 1
                    yield message
        except OSError as error:
            raise BagError(f'{error.filename or self.path}: {error.strerror or error}') from None
        self._check_counts(counts)

    def _messages_of(self, file: Path) -> Iterator[Message]:
        is_packed = self._mode == 'file' and file.suffix == ZSTD
        with unpacked(file) if is_packed else nullcontext(file) as plain:
            storage: SqliteReader | McapScan
            decompress = None
            if plain.suffix == '.db3':
                storage = SqliteReader(plain, self._mode == 'message')
            else:
                storage = McapScan(plain)
                decompress = (Unpacker(Budget(size_of(plain)))
                              if self._mode == 'message' else None)
            try:
                topics, self._storage = storage.topics, storage
                for channel, stamp, data in storage.messages():
                    yield topics[channel][0], stamp, decompress(data) if decompress else data
            except ValueError as error:
                if isinstance(error, BagError):
                    raise
                raise Damaged(f'{file.name} is damaged ({error})') from None
            finally:
                storage.close()
                self._types, self._storage = self.types, None
                if isinstance(storage, McapScan):
                    self.faults += storage.faults

    def _check_counts(self, counts: Counter[str]) -> None:
        """Note where the files do not hold what the metadata tell of."""
        told: Counter[str] = Counter()
        for each in (self.metadata or {}).get('topics_with_message_count') or ():
            told[each['topic_metadata']['name']] += each['message_count']
        total = (self.metadata or {}).get('message_count')
        names = sorted(name for name in {*told, *counts} if told[name] != counts[name])
        if told and names:
            self.faults.append(
                f'metadata.yaml tells of {told[names[0]]} messages on {names[0]}, the files hold '
                f'{counts[names[0]]}' + (', and ' + counted(
                    len(names) - 1, 'more topic differs', 'more topics differ')
                    if names[1:] else ''))
        elif total not in (None, counts.total()):
            self.faults.append(f'metadata.yaml tells of {total} messages, the files hold '
                               f'{counts.total()}')


def file_is_whole(path: Path, by_message: bool) -> bool:
    """Return whether a file that is not compressed as a whole can be read to its end."""
    storage: SqliteReader | McapScan | None = None
    try:
        storage = SqliteReader(path, by_message) if path.suffix == '.db3' else McapScan(path)
        for _ in storage.messages():
            pass
    except BagError:
        return False
    finally:
        if storage is not None:
            storage.close()
    return not (isinstance(storage, McapScan) and storage.faults)


def free_space_error(error: OSError, path: Path) -> str:
    """Return one line about a disk that does not take more."""
    try:
        left = shutil.disk_usage(path.parent).free
    except OSError:
        return f'{path}: {error.strerror or error}'
    return f'{path}: {error.strerror or error} ({left / 1e6:.1f} MB free)'


def _without_metadata(folder: Path) -> str:
    if bag_files(folder):
        return (f'{folder} was not closed, its metadata.yaml is missing: `rigid_sim recover '
                f'{folder}` restores it')
    return f'{folder} is no bag: it has neither metadata.yaml nor files of one'
