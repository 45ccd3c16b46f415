# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Restore a bag that was not closed, or that is damaged.

Every file that is not whole is written anew from the chunks whose checksums fit (for SQLite: from
the rows that can be read), with an index, and the metadata are made from what the files hold.
Where something is lost in the middle an event says so, and `verify` goes on from the next
snapshot. The damaged file is kept beside the new one; one that only breaks off is not, for all
that was whole is in the new one.
"""

from collections import Counter
from collections.abc import Iterator
import contextlib
import fcntl
import os
from pathlib import Path
import re
import sqlite3
from typing import NamedTuple

from mcap.opcode import Opcode

from rigid_sim_ros.bag import decode, events, metadata as metadata_file, topics as kinds
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.mcap_file import McapFile
from rigid_sim_ros.bag.metadata import FileFacts
from rigid_sim_ros.bag.reader import bag_files, SUFFIXES
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.sqlite_file import SqliteFile
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.bag.writer import RESERVE
from rigid_sim_ros.codec import encode_string

_PART = '.part'
_DAMAGED = '.damaged'
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

    @property
    def is_whole(self) -> bool:
        """Whether nothing was wrong with the files."""
        return not self.rewritten

    @property
    def loss(self) -> str:
        """What is lost, in words."""
        if not self.lost_bytes:
            return 'nothing was lost of what had reached the files'
        places = '1 place' if self.lost_places == 1 else f'{self.lost_places} places'
        return f'lost: {self.lost_bytes} bytes in {places}'


class _File:
    """What can be had of one file."""

    def __init__(self, path: Path) -> None:
        self.path = path
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
            return _recover(folder)
    except OSError as error:
        raise BagError(f'{error.filename or folder}: {error.strerror or error}') from None


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the lock of a bag; BagError if it is being recorded."""
    if not folder.is_dir():
        raise BagError(f'{folder} is no folder, must be that of a bag')
    if not bag_files(folder):
        raise BagError(f'{folder} is no bag: no file in it ends in {" or ".join(SUFFIXES)}')
    handle = os.open(folder / RESERVE, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.ftruncate(handle, 0)     # the room is needed now
        yield
    except BlockingIOError:
        raise BagError(f'{folder} is being recorded: stop that first') from None
    else:
        (folder / RESERVE).unlink()
    finally:
        os.close(handle)


def _recover(folder: Path) -> Recovery:
    for stale in folder.glob(f'*{_PART}'):      # hidden files too, unlike in a shell
        stale.unlink()
    files = [_File(path) for path in bag_files(folder)]
    if any(file.path.suffix not in SUFFIXES for file in files):
        raise BagError(f'{folder} holds files that are compressed as a whole: unpack them with '
                       '`zstd -d` first')
    for file in files:
        for channel, stamp, _ in _rows(file):
            file.count(channel, stamp)
    for file in files:
        _resolve(file, [other for other in files if other is not file])
    topics = list({topic.name: topic for file in files for topic in file.topics.values()}.values())
    if not any(file.counts for file in files):
        raise BagError(f'{folder}: no message can be read any more')
    is_zstd = _is_message_compressed(files[0].path)
    aside, facts = [], []
    for k, file in enumerate(files):
        if not file.is_whole:
            aside += _rewrite(file, topics, is_last=k == len(files) - 1)
        facts.append(file.facts(topics))
    result = Recovery(
        sum(sum(each.counts) for each in facts),
        (max(each.last_ns for each in facts) - min(each.first_ns for each in facts
                                                   if any(each.counts))) / 1e9,
        len(files), tuple(file.path.name for file in files if not file.is_whole),
        sum(file.lost_bytes for file in files), sum(file.lost_places for file in files),
        tuple(aside))
    storage = 'sqlite3' if files[0].path.suffix == '.db3' else 'mcap'
    _write_metadata(folder, topics, facts, storage, is_zstd, result)
    return result


def _write_metadata(folder: Path, topics: list[Topic], facts: list[FileFacts], storage: str,
                    is_zstd: bool, result: Recovery) -> None:
    try:
        before = metadata_file.read(folder)
    except BagError:
        before = None
    custom = dict((before or {}).get('custom_data') or {})
    if not result.is_whole:
        custom['recovered'] = f'{len(result.rewritten)} of {result.files} files; {result.loss}'
    metadata_file.write(folder, metadata_file.build(
        topics, facts, storage, 'message' if is_zstd else '', custom))


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


def _rewrite(file: _File, topics: list[Topic], *, is_last: bool) -> list[str]:
    """Write a file anew; return the name under which the damaged one is kept, if it is."""
    path = file.path
    part = path.with_name(path.name + _PART)
    index = {topic.name: k + 1 for k, topic in enumerate(topics)}
    kind = SqliteFile if path.suffix == '.db3' else McapFile
    writer = kind(part, topics, compressed=path.suffix == '.mcap' and _is_chunk_compressed(path))
    source = _File(path)
    stamp = step = lost = 0
    event = next((index[t.name] for t in topics if t.kind == kinds.EVENT), 0)
    for channel, stamp, data in _rows(source):
        topic = file.topics.get(channel)
        if topic is None:
            continue
        if source.lost_places > lost and event:
            lost = source.lost_places
            writer.write((event,), stamp - 1, (_gap(step),))
        if topic.kind == kinds.STEP:
            with contextlib.suppress(BagError):
                step = decode.uint64(data)
        writer.write((index[topic.name],), stamp, (data,))
    if source.lost_places > lost and event and stamp and not is_last:
        writer.write((event,), stamp + 1, (_gap(step),))
    # Counted by the channels of the new file from now on.
    written = writer.close()
    file.topics = {k + 1: topic for k, topic in enumerate(topics)}
    file.counts = Counter({k + 1: n for k, n in enumerate(written.counts) if n})
    file.first_ns, file.last_ns = written.first_ns, written.last_ns
    aside = []
    if file.is_damaged:
        kept = path.with_name(path.name + _DAMAGED)
        path.replace(kept)
        aside.append(kept.name)
    part.replace(path)
    return aside


def _gap(step: int) -> bytes:
    return encode_string(Event(None, step, events.GAP, {
        'since_step': step, 'messages': None, 'events': None}).encode())


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
    size = file.path.stat().st_size
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
    try:
        database = sqlite3.connect(file.path)       # undoes what was cut off
        database.text_factory = bytes
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
            yield channel, stamp, data
    except (sqlite3.Error, UnicodeDecodeError, ValueError, AttributeError, TypeError):
        # How many rows follow is not known any more: a page at least.
        file.is_damaged = True
        file.lose(4096)
    finally:
        with contextlib.suppress(UnboundLocalError):
            database.close()
        # SQLite has used it by now, unless it holds nothing to undo.
        file.path.with_name(file.path.name + '-journal').unlink(missing_ok=True)


def _is_message_compressed(path: Path) -> bool:
    """Return whether the messages of a SQLite file are compressed one by one."""
    if path.suffix != '.db3':
        return False
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(path)) as database:
        row = database.execute('SELECT data FROM messages LIMIT 1').fetchone()
        # A damaged page may hold anything in the place of the bytes.
        return row is not None and isinstance(row[0], bytes) and row[0][:4] == _ZSTD_MAGIC
    return False
