# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write a bag: a folder with one file after another, and metadata.yaml.

All of this runs in one thread, the recorder's. Every failure of the disk is an OSError.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
import contextlib
import fcntl
import os
from pathlib import Path
import shutil
import threading

from rigid_sim_ros.bag import metadata as metadata_file
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.mcap_file import McapFile
from rigid_sim_ros.bag.metadata import FileFacts
from rigid_sim_ros.bag.sqlite_file import SqliteFile
from rigid_sim_ros.bag.topics import definition, Topic

STORAGES: dict[str, type[McapFile] | type[SqliteFile]] = {'mcap': McapFile, 'sqlite3': SqliteFile}
COMPRESSIONS = ('none', 'zstd')

# A file that takes room on the disk, given back when the disk is full: index and metadata need it.
# It is locked as long as the bag is being written.
RESERVE = '.reserve'
_RESERVE_MARGIN = 1 << 16       # bytes, for metadata.yaml and what a file system adds


def check_path(path: str | os.PathLike[str]) -> None:
    """Raise a BagError if no bag can be made there, as far as that can be told without trying."""
    path = Path(path)
    if os.path.lexists(path):
        raise BagError(f'{path} exists already: choose another folder, or remove it')
    above = path.absolute().parent
    while not above.exists():
        above = above.parent
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise BagError(f'{path} cannot be made ({above} may not be written): choose another '
                       'folder')


class BagWriter:
    """A bag that is being written."""

    def __init__(self, path: Path, topics: Sequence[Topic], storage: str = 'mcap',
                 compression: str = 'none', custom: Mapping[str, str] | None = None) -> None:
        """Make the folder and the first file; BagError if that cannot be done."""
        if storage not in STORAGES:
            raise BagError(f'storage {storage!r}, must be {" or ".join(STORAGES)}')
        if compression not in COMPRESSIONS:
            raise BagError(f'compression {compression!r}, must be {" or ".join(COMPRESSIONS)}')
        self.path = path
        self._topics = tuple(topics)
        self._storage = storage
        self._compressed = compression == 'zstd'
        # MCAP compresses its chunks and says so in the file, SQLite knows nothing of it.
        self._mode = 'message' if self._compressed and storage == 'sqlite3' else ''
        self._custom = dict(custom or {})
        self._done: list[FileFacts] = []
        self.stamp = 0      # [ns] of the last message
        self.size = 0       # [bytes] of all files, as of the last flush
        self._done_size = 0
        for each in self._topics:
            definition(each.type)       # a type that is not known is found before any file is made
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            raise BagError(f'{path} exists already: choose another folder, or remove it') from None
        except OSError as error:
            raise BagError(f'{path} cannot be made ({error.strerror}): choose another '
                           'folder') from None
        self._syncing = _Syncing()
        try:
            self._reserve = (path / RESERVE).open('xb', buffering=0)
            fcntl.flock(self._reserve, fcntl.LOCK_EX)
            self._file: McapFile | SqliteFile | None = self._new_file()
            self._keep_reserve()
        except OSError as error:
            self._syncing.stop()
            shutil.rmtree(path, ignore_errors=True)
            raise BagError(f'{path} cannot be written ({error.strerror or error}): choose another '
                           'folder') from None

    @property
    def files(self) -> int:
        """How many files there are so far."""
        return len(self._done) + (self._file is not None)

    @property
    def counts(self) -> list[int]:
        """How many messages each topic has so far."""
        files = [facts.counts for facts in self._done]
        if self._file is not None:
            files.append(self._file.written)
        return [sum(column) for column in zip(*files, strict=True)]

    def write(self, channels: Iterable[int], stamp: int, messages: Sequence[bytes]) -> None:
        """
        Append messages, one a channel (topic k is channel k + 1), that were sent at a time [ns].

        Where the clock stands still or goes back the times go on by a nanosecond a message, so
        that times alone give the order in which all was written.
        """
        first = max(stamp, self.stamp + 1)
        self.stamp = first + len(messages) - 1
        assert self._file is not None
        self._file.write(channels, first, messages)

    def flush(self) -> None:
        """Hand all that was written to the system, and let it reach the disk meanwhile."""
        assert self._file is not None
        self._file.flush()
        self.size = self._done_size + self._file.path.stat().st_size
        self._keep_reserve()
        self._syncing.request(self._file.sync_handle)

    def next_file(self) -> None:
        """Close the file and begin another."""
        self._end_file()
        self._write_metadata()
        self._file = self._new_file()

    def close(self) -> None:
        """Close the last file and write the metadata; after an OSError comes `stop`."""
        self._end_file()
        self._write_metadata()
        self._let_go()

    def stop(self) -> bool:
        """
        Close after a failed write; return whether the bag can be read as it is.

        What did not fit is cut off. The reserve makes room for index and metadata.
        """
        try:
            self._reserve.truncate(0)
            if self._file is not None:
                self._file.cut_back()
                self._end_file()
            self._write_metadata()
        except OSError:
            return False
        finally:
            if self._file is not None:
                self._file.abandon()
            self._let_go()
        return True

    def _end_file(self) -> None:
        assert self._file is not None
        path = self._file.path
        self._done.append(self._file.close())
        self._done_size += path.stat().st_size
        self.size = self._done_size
        self._file = None

    def _new_file(self) -> McapFile | SqliteFile:
        kind = STORAGES[self._storage]
        name = f'{self.path.name}_{len(self._done)}{kind.suffix}'
        return kind(self.path / name, self._topics, self._compressed)

    def _keep_reserve(self) -> None:
        assert self._file is not None
        # A description of a topic in the metadata takes 700 bytes.
        needed = self._file.closing_size() + _RESERVE_MARGIN + 1024 * len(self._topics) + (
            256 * len(self._done))
        if os.fstat(self._reserve.fileno()).st_size < needed:
            # Twice as much, so that this is seldom; and the old size is still enough to close
            # with when this fails.
            os.posix_fallocate(self._reserve.fileno(), 0, 2 * needed)

    def _write_metadata(self) -> None:
        metadata_file.write(self.path, metadata_file.build(
            self._topics, self._done, self._storage, self._mode, self._custom))

    def _let_go(self) -> None:
        self._syncing.stop()
        with contextlib.suppress(OSError):
            (self.path / RESERVE).unlink()
        self._reserve.close()


class _Syncing:
    """
    A thread that brings what was written from the system to the disk.

    A disk can take seconds over that; who writes must not wait for it, or more than a second would
    be lost when the process is killed.
    """

    def __init__(self) -> None:
        self._handle: int | None = None
        self._wanted = threading.Condition()
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name='bag sync', daemon=True)
        self._thread.start()

    def request(self, handle: Callable[[], int]) -> None:
        """Synchronise a file soon, unless that is just going on."""
        with self._wanted:
            if self._handle is None:
                self._handle = handle()
                self._wanted.notify()

    def stop(self) -> None:
        """End the thread; a synchronisation that hangs is left alone."""
        with self._wanted:
            self._stopped = True
            self._wanted.notify()
        self._thread.join(timeout=1.0)

    def _run(self) -> None:
        while True:
            with self._wanted:
                self._wanted.wait_for(lambda: self._stopped or self._handle is not None)
                handle = self._handle
                if handle is None:
                    return
            try:
                # A disk that fails here fails the next write too, which reports it.
                with contextlib.suppress(OSError):
                    os.fdatasync(handle)
            finally:
                os.close(handle)
            with self._wanted:
                self._handle = None
