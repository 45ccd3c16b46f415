# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Restore a bag that was not closed, or that is damaged.

Every file that is not whole is written anew from the chunks whose checksums fit (for SQLite: from
the rows that can be read), with an index, and the metadata are made from what the files hold.
Where something is lost in the middle an event says so, and `verify` goes on from the next
snapshot. The damaged file is kept beside the new one; one that only breaks off is not, for all
that was whole is in the new one.

A bag is whole when `info` says so. Nothing outside of the folder is touched: files are read as
files.py opens them, and all that is written goes to a new folder within it, out of which whole
files are moved into their places. What can be had of a file is in salvage.py, how it is written
anew in rewrite.py.
"""

from collections.abc import Iterator, Mapping
import contextlib
import errno
import fcntl
import os
from pathlib import Path
import re
import shutil
import stat
import tempfile
from typing import Any, NamedTuple

from rigid_sim_ros.bag import metadata as metadata_file, topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.files import bag_files, is_bag_file, SUFFIXES
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.reader import file_is_whole
from rigid_sim_ros.bag.rewrite import PART, rewrite
from rigid_sim_ros.bag.salvage import Description, rows, SalvagedFile, topic_of
from rigid_sim_ros.bag.writer import RESERVE

_WORK = '.recover-'     # the beginning of the name of the folder in which new files grow


class Recovery(NamedTuple):
    """What was restored."""

    messages: int               # in the bag as it is now
    seconds: float              # from the first to the last of them
    files: int
    rewritten: tuple[str, ...]  # files that were not whole
    lost_bytes: int             # of those, that could not be used
    lost_places: int
    kept_aside: tuple[str, ...]     # damaged files, as they were
    missing: tuple[str, ...] = ()   # what the metadata told of and no file holds, in words

    @property
    def is_whole(self) -> bool:
        """Whether nothing was wrong with the files."""
        return not (self.rewritten or self.missing)

    @property
    def loss(self) -> str:
        """What is lost, in words."""
        places = '1 place' if self.lost_places == 1 else f'{self.lost_places} places'
        lost = [*self.missing]
        if self.lost_bytes:
            lost.append(f'{self.lost_bytes} bytes in {places}')
        if not lost:
            return 'nothing was lost of what had reached the files'
        return f'lost: {"; ".join(lost)}'


def recover(path: str | os.PathLike[str]) -> Recovery:
    """Restore the bag in a folder; BagError if there is none, or nothing is left of it."""
    folder = Path(path)
    try:
        with _alone(folder):
            _tidy(folder)
            return _whole(folder) or _recover(folder)
    except OSError as error:
        raise BagError(f'{error.filename or folder}: {error.strerror or error}') from None


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the lock of a bag; BagError if it is being recorded."""
    if not folder.is_dir():
        raise BagError(f'{folder} is no folder, must be that of a bag')
    if not bag_files(folder):
        raise BagError(f'{folder} is no bag: no file in it ends in {" or ".join(SUFFIXES)}')
    lock = folder / RESERVE
    try:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
            raise BagError(f'{lock} is not a regular file, must be one: remove it') from None
        raise
    try:
        facts = os.fstat(handle)
        if not stat.S_ISREG(facts.st_mode):
            raise BagError(f'{lock} is not a regular file, must be one: remove it')
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if facts.st_nlink == 1:     # what has another name may be somebody's file
            os.ftruncate(handle, 0)     # the room is needed now
        yield
    except BlockingIOError:
        raise BagError(f'{folder} is being recorded: stop that first') from None
    else:
        lock.unlink()
    finally:
        os.close(handle)


def _tidy(folder: Path) -> None:
    """Remove what a recording or a recovery that was killed has left half written."""
    for path in folder.iterdir():
        name = path.name.removesuffix(PART)
        if path.name.startswith(_WORK) and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif name != path.name and (is_bag_file(name) or name == f'.{metadata_file.NAME}'):
            path.unlink()


def _whole(folder: Path) -> Recovery | None:
    """Return what there is to say of a bag that all commands read as it is, None of others."""
    try:
        found = info(folder)
    except BagError:
        return None
    return Recovery(found.messages, (found.last_ns - found.first_ns) / 1e9, found.files, (), 0, 0,
                    ())


def _recover(folder: Path) -> Recovery:
    files = [SalvagedFile(path) for path in bag_files(folder)]
    if any(file.path.suffix not in SUFFIXES for file in files):
        raise BagError(f'{folder} holds files that are compressed as a whole: unpack them with '
                       '`zstd -d` first')
    try:
        before = metadata_file.read(folder)
    except BagError:
        before = None
    with tempfile.TemporaryDirectory(prefix=_WORK, dir=folder) as work:
        for file in files:
            file.work = Path(work)
            for channel, stamp, _ in rows(file):
                file.count(channel, stamp)
        packed = any(file.packed for file in files)
        for file in files:
            file.is_whole = file.is_whole and file_is_whole(file.path, packed)
            _resolve(file, [other for other in files if other is not file])
        for file in files:
            file.described.clear()      # of tens of thousands of topics it takes room
        missing = _missing(before, files)
        _owe_gaps(before, files)
        topics = list({
            topic.name: topic for file in files for topic in file.topics.values()}.values())
        if not any(file.counts for file in files):
            raise BagError(f'{folder}: no message can be read any more')
        aside, facts = [], []
        for k, file in enumerate(files):
            if not file.is_whole:
                aside += rewrite(file, topics, packed, is_last=k == len(files) - 1)
            facts.append(file.facts(topics))
    result = Recovery(
        sum(sum(each.counts) for each in facts),
        (max(each.last_ns for each in facts) - min(each.first_ns for each in facts
                                                   if any(each.counts))) / 1e9,
        len(files), tuple(file.path.name for file in files if not file.is_whole),
        sum(file.lost_bytes for file in files), sum(file.lost_places for file in files),
        tuple(aside), missing)
    custom = dict((before or {}).get('custom_data') or {})
    if not result.is_whole:
        custom['recovered'] = f'{len(result.rewritten)} of {result.files} files; {result.loss}'
    metadata_file.write(folder, metadata_file.build(
        topics, facts, 'sqlite3' if files[0].path.suffix == '.db3' else 'mcap',
        'message' if packed else '', custom))
    return result


def _told(before: Mapping[str, Any] | None) -> dict[str, int]:
    """Return how many messages each file had, by what the metadata told."""
    return {Path(each['path']).name: each['message_count']
            for each in (before or {}).get('files') or ()}


def _missing(before: Mapping[str, Any] | None, files: list[SalvagedFile]) -> tuple[str, ...]:
    """Return what the metadata told of and no file holds."""
    there = {file.path.name: file.counts.total() for file in files}
    lost = []
    for name, count in _told(before).items():
        if name not in there:
            lost.append(f'{name} with {count} messages, which is not there')
        elif there[name] < count:
            lost.append(f'{count - there[name]} of {count} messages of {name}')
    return tuple(lost)


def _owe_gaps(before: Mapping[str, Any] | None, files: list[SalvagedFile]) -> None:
    """Let a file that follows one that is lost as a whole begin with a gap."""
    order = [Path(name).name for name in (before or {}).get('relative_file_paths') or ()]
    by_name = {file.path.name: file for file in files}
    if not set(by_name) & set(order):
        order = []
    order += [file.path.name for file in files if file.path.name not in order]
    owes = False
    for name in order:
        file = by_name.get(name)
        if file is None or not file.counts:
            owes = True
        elif owes:
            file.begins_with_gap, file.is_whole, owes = True, False, False


def _resolve(file: SalvagedFile, others: list[SalvagedFile]) -> None:
    """
    Decide which topic each channel of a file is.

    A description that was damaged is not taken for a topic: it must be of a known type, and one
    that a neighbour has too counts more than one that stands alone.
    """
    shared = {each for other in others for known in other.described.values() for each in known}
    for channel in sorted({*file.counts, *file.described}):
        mine = file.described.get(channel, [])
        if not file.is_whole:
            neighbours = [each for other in others for each in other.described.get(channel, [])]
            mine = [each for each in mine if _is_plausible(each)]
            # Where nothing is confirmed the last word is that of the index at the end.
            mine = [each for each in mine if each in shared] or neighbours or mine
        if mine:
            file.topics[channel] = topic_of(*mine[-1])
        elif channel in file.counts:
            file.is_damaged = True
            file.lose(file.counts.pop(channel))


def _is_plausible(description: Description) -> bool:
    name, message_type, _ = description
    try:
        kinds.definition(message_type)
    except BagError:
        return False
    return re.fullmatch(r'(/[A-Za-z_][A-Za-z0-9_]*)+', name) is not None
