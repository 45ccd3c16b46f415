# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One file of a bag for playing it: MCAP or SQLite, as it is or compressed as a whole.

Every call opens the file anew, so that one thread may read ahead while another seeks.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Set as AbstractSet
from contextlib import closing, contextmanager
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

from rigid_sim_ros.bag.errors import Damaged
from rigid_sim_ros.bag.files import (
    Budget, LARGEST, open_regular, size_of, unpacked, Unpacker, ZSTD)
from rigid_sim_ros.bag.mcap_index import Block, read_block, read_index
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.sqlite_index import SqliteIndex

Message: TypeAlias = tuple[int, str, bytes]     # time [ns], topic, CDR
TIME: Callable[[Message], int] = itemgetter(0)
_Unpack: TypeAlias = Callable[[bytes], bytes]
_STAMP: Callable[[tuple[int, int, bytes]], int] = itemgetter(1)     # of (channel, time, data)

# [bytes] Blocks whose times overlap are sorted together up to this. Recorders write almost in
# order, so a block or two are enough; a file that was rearranged could make us hold all of it,
# and is played out of order instead.
_MOST_SORTED = 256 << 20


class RecordedTopic(NamedTuple):
    """What a bag says of a topic."""

    name: str
    type: str
    encoding: str       # of its messages, 'cdr'
    profiles: object    # QoS of its publishers, as it stands in the bag
    type_hash: str      # of the definition of its type, '' if unknown


class PlayableFile(Protocol):
    """One file of a bag; its times are 0 if it has no messages."""

    topics: Mapping[str, RecordedTopic]
    first_ns: int
    last_ns: int

    def messages(self, start_ns: int, names: AbstractSet[str]) -> Iterator[list[Message]]:
        """Give the messages of some topics from a time on, in groups sorted by time."""

    def last(self, until_ns: int, counts: Mapping[str, int]) -> list[Message]:
        """Return the last messages of topics up to a time and with it, so many of each."""


def open_file(
    path: Path, by_message: bool, topics: Mapping[str, RecordedTopic],
    times: tuple[int, int] | None,
) -> PlayableFile:
    """
    Open a file of a bag; Damaged if it is not what was written, OSError if it cannot be read.

    `topics` and `times` are what the metadata tell: a compressed file is not opened for them.
    """
    if path.suffix == ZSTD:
        return PackedPlayback(path, by_message, topics, times)
    return (SqlitePlayback if path.suffix == '.db3' else McapPlayback)(path, by_message)


class McapPlayback:
    """An MCAP file."""

    def __init__(self, path: Path, by_message: bool) -> None:
        """Read the index."""
        scan, blocks = read_index(path)
        self._path = path
        self._by_message = by_message
        self._scan = scan
        self._blocks = [block for block in blocks if block.last_ns]
        self.first_ns = min((block.first_ns for block in self._blocks), default=0)
        self.last_ns = max((block.last_ns for block in self._blocks), default=0)
        self.topics: Mapping[str, RecordedTopic] = {
            name: RecordedTopic(
                name, kind, scan.channels[number].message_encoding,
                scan.channels[number].metadata.get('offered_qos_profiles', ''),
                scan.channels[number].metadata.get('topic_type_hash', ''))
            for number, (name, kind) in scan.topics.items()}

    def messages(self, start_ns: int, names: AbstractSet[str]) -> Iterator[list[Message]]:
        """Give the messages of some topics from a time on, in groups sorted by time."""
        numbers = self._numbers(names)
        blocks = [block for block in self._blocks
                  if block.last_ns >= start_ns and _has(block, numbers.keys())]
        ends = [*(block.first_ns for block in blocks[1:]), 2 ** 64]
        # By the place of their block: of one time, what was written first comes first.
        pending: dict[int, list[Message]] = {}
        with self._reading() as (read, unpack):
            for block, end in zip(blocks, ends, strict=False):
                pending[block.offset] = [
                    message for message in read(block, numbers) if message[0] >= start_ns]
                group = [each for offset in sorted(pending) for each in pending[offset]]
                group.sort(key=TIME)
                # What is later than the next block begins may belong among its messages.
                cut = bisect_left(group, end, key=TIME)
                if sum(len(data) for _, _, data in group[cut:]) > _MOST_SORTED:
                    cut = len(group)
                pending = {} if cut == len(group) else {
                    offset: [each for each in messages if each[0] >= end]
                    for offset, messages in pending.items()}
                yield from _in_groups(group[:cut], unpack)

    def last(self, until_ns: int, counts: Mapping[str, int]) -> list[Message]:
        """Return the last messages of topics up to a time and with it, so many of each."""
        found: dict[str, list[Message]] = {name: [] for name in counts}
        by_name = {name: self._numbers({name}) for name in counts}
        with self._reading() as (read, unpack):
            for block in sorted(self._blocks, key=lambda each: each.last_ns, reverse=True):
                if block.first_ns > until_ns:
                    continue
                # All blocks from here on end no later than this one.
                open_names = [name for name, count in counts.items()
                              if len(found[name]) < count or found[name][0][0] < block.last_ns]
                numbers = {number: name for name in open_names
                           for number in by_name[name]}
                if not numbers or not _has(block, numbers.keys()):
                    continue
                for message in read(block, numbers):
                    if message[0] <= until_ns:
                        found[message[1]].append(message)
                for name in open_names:
                    found[name] = sorted(found[name], key=TIME)[-counts[name]:]
            return [(stamp, name, unpack(data)) for messages in found.values()
                    for stamp, name, data in messages]

    def _numbers(self, names: AbstractSet[str]) -> dict[int, str]:
        return {number: name for number, (name, _) in self._scan.topics.items() if name in names}

    @contextmanager
    def _reading(self) -> Iterator[tuple[
            Callable[[Block, Mapping[int, str]], list[Message]], _Unpack]]:
        """Give what returns the messages of some channels in a block, and what unpacks them."""
        with open_regular(self._path) as file, closing(McapScan(self._path)) as scan:
            scan.schemas, scan.topics = dict(self._scan.schemas), dict(self._scan.topics)

            def read(block: Block, numbers: Mapping[int, str]) -> list[Message]:
                found = scan.messages_in(read_block(file, block, scan))
                if found and not (block.first_ns <= min(map(_STAMP, found))
                                  and max(map(_STAMP, found)) <= block.last_ns):
                    raise Damaged(f'{self._path.name}: the block at byte {block.offset} holds '
                                  'messages of other times than its index says')
                return [(stamp, numbers[number], data)
                        for number, stamp, data in found if number in numbers]

            yield read, _unpacker(self._path, self._by_message)


class SqlitePlayback:
    """A SQLite file."""

    def __init__(self, path: Path, by_message: bool) -> None:
        """Check the file and read its topics."""
        self._path = path
        self._by_message = by_message
        self._index = SqliteIndex(path)
        self.first_ns, self.last_ns = self._index.first_ns, self._index.last_ns
        self._names = {each.number: each.name for each in self._index.topics}
        self.topics: Mapping[str, RecordedTopic] = {
            each.name: RecordedTopic(
                each.name, each.type, each.encoding, each.profiles, each.type_hash)
            for each in self._index.topics}

    def messages(self, start_ns: int, names: AbstractSet[str]) -> Iterator[list[Message]]:
        """Give the messages of some topics from a time on, in groups sorted by time."""
        numbers = [number for number, name in self._names.items() if name in names]
        unpack = _unpacker(self._path, self._by_message)
        for group in self._index.messages(start_ns, numbers):
            yield from _in_groups(
                [(stamp, self._names[number], data) for number, stamp, data in group], unpack)

    def last(self, until_ns: int, counts: Mapping[str, int]) -> list[Message]:
        """Return the last messages of topics up to a time and with it, so many of each."""
        unpack = _unpacker(self._path, self._by_message)
        return [(stamp, name, unpack(data))
                for number, name in self._names.items() if name in counts
                for _, stamp, data in self._index.last(number, until_ns, counts[name])]


class PackedPlayback:
    """A file that is compressed as a whole: it is unpacked for as long as it is read."""

    def __init__(self, path: Path, by_message: bool, topics: Mapping[str, RecordedTopic],
                 times: tuple[int, int] | None) -> None:
        """Take what the metadata tell, or unpack the file to learn it."""
        self._path = path
        self._open = partial(open_file, by_message=by_message, topics={}, times=None)
        if times is None or not topics:
            with self._plain() as plain:
                self.topics: Mapping[str, RecordedTopic] = plain.topics
                self.first_ns, self.last_ns = plain.first_ns, plain.last_ns
        else:
            self.topics = topics
            self.first_ns, self.last_ns = times

    def messages(self, start_ns: int, names: AbstractSet[str]) -> Iterator[list[Message]]:
        """Give the messages of some topics from a time on, in groups sorted by time."""
        with self._plain() as plain:
            yield from plain.messages(start_ns, names)

    def last(self, until_ns: int, counts: Mapping[str, int]) -> list[Message]:
        """Return the last messages of topics up to a time and with it, so many of each."""
        with self._plain() as plain:
            return plain.last(until_ns, counts)

    @contextmanager
    def _plain(self) -> Iterator[PlayableFile]:
        with unpacked(self._path) as plain:
            yield self._open(plain)


def _in_groups(messages: list[Message], unpack: _Unpack) -> Iterator[list[Message]]:
    """Give messages unpacked, in groups none of which takes much more memory than its last."""
    group, size = [], 0
    for stamp, name, data in messages:
        group.append((stamp, name, unpack(data)))
        size += len(group[-1][2])
        if size > LARGEST:
            yield group
            group, size = [], 0
    if group:
        yield group


def _unpacker(path: Path, by_message: bool) -> _Unpack:
    """Return what unpacks the messages of a file, if they are packed; it is for one thread."""
    if not by_message:
        return bytes
    decompress = Unpacker(Budget(size_of(path)))

    def unpack(data: bytes) -> bytes:
        try:
            return decompress(data)
        except ValueError as error:
            raise Damaged(f'{path.name} is damaged ({error})') from None

    return unpack


def _has(block: Block, numbers: AbstractSet[int]) -> bool:
    return block.channels is None or not block.channels.isdisjoint(numbers)


def metadata_topics(metadata: Mapping[str, Any]) -> dict[str, RecordedTopic]:
    """Return what metadata.yaml says of the topics; empty where it makes no sense."""
    try:
        told = [entry['topic_metadata'] for entry in metadata['topics_with_message_count']]
        return {each['name']: RecordedTopic(
            str(each['name']), str(each['type']), str(each['serialization_format']),
            each.get('offered_qos_profiles', ''), str(each.get('type_description_hash', '')))
            for each in told}
    except (KeyError, TypeError, AttributeError):
        return {}


def metadata_times(metadata: Mapping[str, Any]) -> dict[str, tuple[int, int]]:
    """Return first and last time of each file that metadata.yaml tells of."""
    try:
        return {Path(each['path']).name: (start, start + int(each['duration']['nanoseconds']))
                for each in metadata['files']
                for start in [int(each['starting_time']['nanoseconds_since_epoch'])]}
    except (KeyError, TypeError, AttributeError, ValueError):
        return {}
