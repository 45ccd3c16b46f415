# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What can be had of a file of a bag that is not whole: rows, and what it says of its topics.

Of MCAP the chunks whose checksums fit, also beyond damage in the middle; of SQLite the rows that
can be read. What tells of the session must be what was written too: it carries digests, and no
command reads a bag in which one does not fit.
"""

from collections import Counter
from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import shutil
import sqlite3

from mcap.opcode import Opcode

from rigid_sim_ros.bag import decode, events, session, topics as kinds
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.files import Budget, open_regular, size_of, Unpacker
from rigid_sim_ros.bag.metadata import FileFacts
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.sqlite_file import COMPANIONS, open_database
from rigid_sim_ros.bag.topics import Topic

_LEAST_ROW = 8          # [bytes] of a row of SQLite besides its message
_ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_INDEX = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.DATA_END, Opcode.MESSAGE_INDEX,
          Opcode.CHUNK_INDEX, Opcode.STATISTICS, Opcode.SUMMARY_OFFSET, Opcode.FOOTER}

Row = tuple[int, int, bytes]    # channel, time [ns], CDR

# What a file says of a channel: name, type, and whether it is latched.
Description = tuple[str, str, bool]

# What a recording adds by itself, without the name of its node.
_OWN = tuple(own for own in kinds.own_topics('') if own.kind != kinds.SCENE)


class SalvagedFile:
    """
    What can be had of one file of a bag: fills while `rows` goes through it.

    `described` holds all that is said of each channel, `news` the channels of which something was
    said since `rows` looked at that, and `topics` what was made of it; `counts` the messages by
    channel. A file `is_damaged` where more is wrong than that it breaks off.
    """

    def __init__(self, path: Path, work: Path | None = None) -> None:
        """Begin with a file; copies of it go to the folder `work`."""
        self.path = path
        self.work = work
        self.packed = False         # whether its messages are compressed one by one
        self.begins_with_gap = False
        self.described: dict[int, list[Description]] = {}
        self.news: set[int] = set()
        self.topics: dict[int, Topic] = {}
        self.is_whole = True
        self.lost_bytes = 0
        self.lost_places = 0
        self.is_damaged = False
        self.counts: Counter[int] = Counter()
        self.first_ns = self.last_ns = 0

    def describe(self, channel: int, description: Description) -> None:
        """Note what the file says of a channel."""
        known = self.described.setdefault(channel, [])
        if description not in known:
            known.append(description)
            self.news.add(channel)

    def count(self, channel: int, stamp: int) -> None:
        """Note a message that can be had."""
        self.counts[channel] += 1
        self.first_ns = min(self.first_ns or stamp, stamp)
        self.last_ns = max(self.last_ns, stamp)

    def lose(self, size: int) -> None:
        """Note so many bytes that cannot be had, in one place."""
        self.is_whole = False
        if size:
            self.lost_bytes += size
            self.lost_places += 1

    def facts(self, topics: list[Topic]) -> FileFacts:
        """Return what the metadata tell of the file."""
        by_name: Counter[str] = Counter()
        for channel, count in self.counts.items():
            by_name[self.topics[channel].name] += count
        return FileFacts(self.path.name, self.first_ns, self.last_ns,
                         tuple(by_name[topic.name] for topic in topics))


def rows(file: SalvagedFile) -> Iterator[Row]:
    """Give every message that can be had of a file, and learn about the file."""
    unpack = Unpacker(Budget(size_of(file.path)))
    telling: dict[int, Topic] = {}      # channels that tell of a session, if it is one of ours
    own: dict[int, Topic] = {}          # those that do
    for channel, stamp, data in (
            _sqlite_rows if file.path.suffix == '.db3' else _mcap_rows)(file):
        if file.news:
            own = _of_sessions(file, telling)
        if channel in own and not _is_as_written(own[channel], data, unpack):
            file.is_damaged = True
            file.lose(len(data))
        else:
            yield channel, stamp, data


def _of_sessions(file: SalvagedFile, telling: dict[int, Topic]) -> dict[int, Topic]:
    """
    Return the channels with the descriptions and the events of sessions.

    Brings up to date which channels look like that: a bag may have tens of thousands of others.
    """
    for channel in file.news:
        topic = topic_of(*file.described[channel][-1])
        if topic.kind in (kinds.SESSION, kinds.EVENT):
            telling[channel] = topic
        else:
            telling.pop(channel, None)
    file.news.clear()
    nodes = {_node(topic) for topic in telling.values() if topic.kind == kinds.SESSION}
    return {channel: topic for channel, topic in telling.items() if _node(topic) in nodes}


def _node(topic: Topic) -> str:
    return topic.name.rpartition('/bag/')[0]


def _is_as_written(topic: Topic, data: bytes, unpack: Unpacker) -> bool:
    """Return whether an event or the description of a session can be read, digest and all."""
    try:
        plain = unpack(data) if is_packed(data) else data
        if topic.kind == kinds.EVENT:
            events.decode(decode.string(plain))
        else:
            session.read(topic.name, plain)
    except ValueError as error:
        # What another version wrote is not damaged.
        return isinstance(error, BagError) and not isinstance(error, Damaged)
    return True


def topic_of(name: str, message_type: str, latched: bool) -> Topic:
    """Return a topic; what a recording adds by itself is known by the end of its name."""
    for own in _OWN:
        if own.type == message_type and name.endswith(own.name):
            return own._replace(name=name)
    return Topic(name, message_type, latched=latched)


def is_chunk_compressed(path: Path) -> bool:
    """Return whether the chunks of an MCAP file are compressed."""
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


# --- MCAP ---------------------------------------------------------------------------------------

def _mcap_rows(file: SalvagedFile) -> Iterator[Row]:
    scan = McapScan(file.path, must_begin=False)
    try:
        yield from _salvage(file, scan)
    finally:
        scan.close()


def _salvage(file: SalvagedFile, scan: McapScan) -> Iterator[Row]:
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
                        found = scan.messages_in(content.raw, of_any_channel=True)
                        _learn(file, scan)
                        yield from found
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


def _learn(file: SalvagedFile, scan: McapScan) -> None:
    """Note what the file says of its channels by now."""
    for channel, (name, message_type) in scan.topics.items():
        profiles = scan.channels[channel].metadata.get('offered_qos_profiles', '')
        file.describe(channel, (name, message_type, (
            'transient_local' in profiles or 'durability: 1' in profiles)))
    scan.topics.clear()
    scan.channels.clear()       # tens of thousands of them take room


# --- SQLite -------------------------------------------------------------------------------------

def _sqlite_rows(file: SalvagedFile) -> Iterator[Row]:
    try:
        path = _restored(file)
        left = size_of(path)
        unpack = Unpacker(Budget(left))
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
                    file.packed = file.packed or is_packed(data)
                    yield channel, stamp, data
                else:
                    file.is_damaged = True
                    file.lose(len(data))
    except (sqlite3.Error, UnicodeDecodeError, ValueError, AttributeError, TypeError,
            OverflowError, MemoryError):
        # How many rows follow is not known any more: a page at least.
        file.is_damaged = True
        file.lose(4096)


def is_packed(data: bytes) -> bool:
    """Return whether a message is compressed by itself, which no CDR looks like."""
    return data[:4] == _ZSTD_MAGIC


def _is_readable(data: bytes, unpack: Unpacker) -> bool:
    try:
        return not is_packed(data) or bool(unpack(data))
    except ValueError:
        return False


def _restored(file: SalvagedFile) -> Path:
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
