# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Restore a bag that was not closed, or that is damaged.

Every file that is not whole is written anew from the chunks whose checksums fit (for SQLite: from
the rows that can be read), with an index, and the metadata are made from what the files hold.
Where something is lost in the middle an event says so, and `verify` goes on from the next
snapshot. The damaged file is kept beside the new one; one that only breaks off is not, for all
that was whole is in the new one.

A bag is whole when `reader.py` says so, as for all other commands. Nothing outside of the folder
is touched: files are read as files.py opens them, and all that is written goes to a new folder
within it, out of which whole files are moved into their places.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
import contextlib
import errno
import fcntl
import os
from pathlib import Path
import re
import shutil
import sqlite3
import stat
import tempfile
from typing import Any, NamedTuple

from mcap.opcode import Opcode
import zstandard

from rigid_sim_ros.bag import events, metadata as metadata_file, topics as kinds
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.files import (
    bag_files, is_bag_file, open_regular, size_of, SUFFIXES, Unpacker)
from rigid_sim_ros.bag.mcap_file import McapFile
from rigid_sim_ros.bag.metadata import FileFacts
from rigid_sim_ros.bag.reader import BagReader, file_is_whole
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.sqlite_file import COMPANIONS, open_database, SqliteFile
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.bag.writer import RESERVE
from rigid_sim_ros.messages import decode
from rigid_sim_ros.messages.codec import encode_string

_PART = '.part'
_DAMAGED = '.damaged'
_WORK = '.recover-'     # the beginning of the name of the folder in which new files grow
_LEAST_ROW = 8          # [bytes] of a row of SQLite besides its message
_ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'

_INDEX = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.DATA_END, Opcode.MESSAGE_INDEX,
          Opcode.CHUNK_INDEX, Opcode.STATISTICS, Opcode.SUMMARY_OFFSET, Opcode.FOOTER}

Row = tuple[int, int, bytes]    # channel, time [ns], CDR

# What a file says of a channel: name, type, and whether it is latched.
Description = tuple[str, str, bool]


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


class _File:
    """What can be had of one file."""

    def __init__(self, path: Path, work: Path | None = None) -> None:
        self.path = path
        self.work = work            # where copies and new files go
        self.packed = False         # whether its messages are compressed one by one
        self.begins_with_gap = False
        self.described: dict[int, list[Description]] = {}   # all that is said of each channel
        self.topics: dict[int, Topic] = {}      # what was made of that
        self.is_whole = True
        self.lost_bytes = 0
        self.lost_places = 0
        self.is_damaged = False     # in the middle: more than that it breaks off
        self.counts: Counter[int] = Counter()   # messages by channel
        self.first_ns = self.last_ns = 0

    def describe(self, channel: int, description: Description) -> None:
        known = self.described.setdefault(channel, [])
        if description not in known:
            known.append(description)

    def count(self, channel: int, stamp: int) -> None:
        self.counts[channel] += 1
        self.first_ns = min(self.first_ns or stamp, stamp)
        self.last_ns = max(self.last_ns, stamp)

    def lose(self, size: int) -> None:
        self.is_whole = False
        if size:
            self.lost_bytes += size
            self.lost_places += 1

    def facts(self, topics: list[Topic]) -> FileFacts:
        by_name: Counter[str] = Counter()
        for channel, count in self.counts.items():
            by_name[self.topics[channel].name] += count
        return FileFacts(self.path.name, self.first_ns, self.last_ns,
                         tuple(by_name[topic.name] for topic in topics))


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
        name = path.name.removesuffix(_PART)
        if path.name.startswith(_WORK) and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif name != path.name and (is_bag_file(name) or name == f'.{metadata_file.NAME}'):
            path.unlink()


def _whole(folder: Path) -> Recovery | None:
    """Return what there is to say of a bag that all commands read as it is, None of others."""
    first_ns, last_ns, count = 2 ** 63, 0, 0
    try:
        reader = BagReader(folder)
        for _, stamp, _ in reader.messages():
            count += 1
            first_ns, last_ns = min(first_ns, stamp), max(last_ns, stamp)
    except BagError:
        return None
    if reader.faults:
        return None
    return Recovery(count, (last_ns - first_ns) / 1e9 if count else 0.0, len(reader.files), (), 0,
                    0, ())


def _recover(folder: Path) -> Recovery:
    files = [_File(path) for path in bag_files(folder)]
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
            for channel, stamp, _ in _rows(file):
                file.count(channel, stamp)
        packed = any(file.packed for file in files)
        for file in files:
            if not file_is_whole(file.path, packed):
                file.is_whole = False
            _resolve(file, [other for other in files if other is not file])
        missing = _missing(before, files)
        _owe_gaps(before, files)
        topics = list({
            topic.name: topic for file in files for topic in file.topics.values()}.values())
        if not any(file.counts for file in files):
            raise BagError(f'{folder}: no message can be read any more')
        aside, facts = [], []
        for k, file in enumerate(files):
            if not file.is_whole:
                aside += _rewrite(file, topics, packed, is_last=k == len(files) - 1)
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


def _missing(before: Mapping[str, Any] | None, files: list[_File]) -> tuple[str, ...]:
    """Return what the metadata told of and no file holds."""
    there = {file.path.name: file.counts.total() for file in files}
    lost = []
    for name, count in _told(before).items():
        if name not in there:
            lost.append(f'{name} with {count} messages, which is not there')
        elif there[name] < count:
            lost.append(f'{count - there[name]} of {count} messages of {name}')
    return tuple(lost)


def _owe_gaps(before: Mapping[str, Any] | None, files: list[_File]) -> None:
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


def _resolve(file: _File, others: list[_File]) -> None:
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
            file.topics[channel] = _topic(*mine[-1])
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


def _rewrite(file: _File, topics: list[Topic], packed: bool, *, is_last: bool) -> list[str]:
    """Write a file anew; return the name under which the damaged one is kept, if it is."""
    path = file.path
    assert file.work is not None
    part = file.work / (path.name + _PART)
    index = {topic.name: k + 1 for k, topic in enumerate(topics)}
    kind = SqliteFile if path.suffix == '.db3' else McapFile
    writer = kind(part, topics, compressed=path.suffix == '.mcap' and _is_chunk_compressed(path))
    source = _File(path, file.work)
    unpack = Unpacker()
    stamp = step = lost = 0
    owes = file.begins_with_gap
    event = next((index[t.name] for t in topics if t.kind == kinds.EVENT), 0)
    for channel, stamp, data in _rows(source):
        topic = file.topics.get(channel)
        if topic is None or packed != _is_packed(data):
            continue
        # What tells of the session comes first in a file.
        if (source.lost_places > lost or owes) and event and topic.kind != kinds.SESSION and (
                not topic.name.endswith('/scene')):
            lost, owes = source.lost_places, False
            writer.write((event,), stamp - 1, (_gap(step, packed),))
        if topic.kind == kinds.STEP:
            with contextlib.suppress(BagError):
                step = decode.uint64(unpack(data) if packed else data)
        writer.write((index[topic.name],), stamp, (data,))
    if source.lost_places > lost and event and stamp and not is_last:
        writer.write((event,), stamp + 1, (_gap(step, packed),))
    # Counted by the channels of the new file from now on.
    written = writer.close()
    file.topics = {k + 1: topic for k, topic in enumerate(topics)}
    file.counts = Counter({k + 1: n for k, n in enumerate(written.counts) if n})
    file.first_ns, file.last_ns = written.first_ns, written.last_ns
    aside = []
    if file.is_damaged:
        kept = _free_name(path.with_name(path.name + _DAMAGED))
        path.replace(kept)
        aside.append(kept.name)
    part.replace(path)
    # Of these SQLite would believe that they belong to the new file.
    for companion in COMPANIONS if path.suffix == '.db3' else ():
        path.with_name(path.name + companion).unlink(missing_ok=True)
    return aside


def _free_name(path: Path) -> Path:
    """Return the path, with a number if there is something already."""
    k = 1
    free = path
    while os.path.lexists(free):
        k += 1
        free = path.with_name(f'{path.name}_{k}')
    return free


def _gap(step: int, packed: bool) -> bytes:
    data = encode_string(Event(None, step, events.GAP, {
        'since_step': step, 'messages': None, 'events': None}).encode())
    return zstandard.ZstdCompressor(level=1).compress(data) if packed else data


def _rows(file: _File) -> Iterator[Row]:
    """Give every message that can be had of a file, and learn about the file."""
    return _sqlite_rows(file) if file.path.suffix == '.db3' else _mcap_rows(file)


# --- MCAP ---------------------------------------------------------------------------------------

def _mcap_rows(file: _File) -> Iterator[Row]:
    scan = McapScan(file.path, must_begin=False)
    try:
        yield from _salvage(file, scan)
    finally:
        scan.close()


def _salvage(file: _File, scan: McapScan) -> Iterator[Row]:
    size = size_of(file.path)
    while True:
        good = scan.position
        faults = len(scan.faults)
        try:
            for record in scan.records():
                if record.opcode == Opcode.CHUNK:
                    content = scan.content(record)
                    if len(scan.faults) > faults:
                        faults = len(scan.faults)
                        file.is_damaged = True
                        file.lose(record.end - record.offset)
                    else:
                        yield from scan.messages_in(content.raw, of_any_channel=True)
                else:
                    scan.describe(record)
                _learn(file, scan)
                good = record.end
        except Damaged:
            if scan.skip_damage(good + 1):
                file.is_damaged = True
                file.lose(scan.position - good)
                continue
            # Index records hold nothing that is not made anew.
            file.lose(size - good if scan.opcode_at(good) not in _INDEX else 0)
        if scan.faults:
            file.is_whole = False
        return


def _learn(file: _File, scan: McapScan) -> None:
    """Note what the file says of its channels by now."""
    for channel, (name, message_type) in scan.topics.items():
        profiles = scan.channels[channel].metadata.get('offered_qos_profiles', '')
        file.describe(channel, (name, message_type, (
            'transient_local' in profiles or 'durability: 1' in profiles)))
    scan.topics.clear()


def _is_chunk_compressed(path: Path) -> bool:
    scan = McapScan(path, must_begin=False)
    try:
        for record in scan.records():
            if record.opcode == Opcode.CHUNK:
                return b'zstd' in record.payload[:40]
    except Damaged:
        pass
    finally:
        scan.close()
    return False


def _topic(name: str, message_type: str, latched: bool) -> Topic:
    """Return a topic; what a recording adds by itself is known by the end of its name."""
    for own in kinds.own_topics(''):
        if own.type == message_type and own.kind != kinds.SCENE and name.endswith(own.name):
            return own._replace(name=name)
    return Topic(name, message_type, latched=latched)


# --- SQLite -------------------------------------------------------------------------------------

def _sqlite_rows(file: _File) -> Iterator[Row]:
    unpack = Unpacker()
    try:
        path = _restored(file)
        left = size_of(path)
        with contextlib.closing(open_database(path)) as database:
            for k, name, kind, profiles in database.execute(
                    'SELECT id, name, type, offered_qos_profiles FROM topics'):
                file.describe(int(k), (name.decode(), kind.decode(), (
                    b'transient_local' in profiles or b'durability: 1' in profiles)))
            if database.execute('PRAGMA quick_check(1)').fetchone()[0] != b'ok':
                file.is_damaged = True
                file.lose(0)
            for channel, stamp, data in database.execute(
                    'SELECT topic_id, timestamp, data FROM messages ORDER BY id'):
                if not (type(channel) is type(stamp) is int and type(data) is bytes and stamp > 0):
                    raise TypeError
                # Damaged pages may lead in circles.
                left -= len(data) + _LEAST_ROW
                if left < 0:
                    raise ValueError
                if _is_readable(data, unpack):
                    file.packed = file.packed or _is_packed(data)
                    yield channel, stamp, data
                else:
                    file.is_damaged = True
                    file.lose(len(data))
    except (sqlite3.Error, UnicodeDecodeError, ValueError, AttributeError, TypeError,
            OverflowError, MemoryError):
        # How many rows follow is not known any more: a page at least.
        file.is_damaged = True
        file.lose(4096)


def _is_packed(data: bytes) -> bool:
    """Return whether a message is compressed by itself, which no CDR looks like."""
    return data[:4] == _ZSTD_MAGIC


def _is_readable(data: bytes, unpack: Unpacker) -> bool:
    try:
        return not _is_packed(data) or bool(unpack(data))
    except ValueError:
        return False


def _restored(file: _File) -> Path:
    """
    Return the file, or a copy in which SQLite has undone what was cut off.

    It uses the journal beside a file for that, which may name further files that SQLite would
    then remove. Their names stand at the end of a journal, where one more byte hides them.
    """
    there = [name for name in COMPANIONS[:2]
             if os.path.lexists(file.path.with_name(file.path.name + name))]
    if not there:
        return file.path
    assert file.work is not None
    copy = file.work / file.path.name
    for name in ('', *there):
        target = copy.with_name(copy.name + name)
        with open_regular(file.path.with_name(file.path.name + name)) as source, (
                target.open('wb')) as written:
            shutil.copyfileobj(source, written)
            if name == '-journal':
                written.write(b'\0')
    with contextlib.closing(sqlite3.connect(copy)) as database:
        database.execute('PRAGMA journal_mode = DELETE').fetchone()
    for name in there:
        copy.with_name(copy.name + name).unlink(missing_ok=True)
    return copy
