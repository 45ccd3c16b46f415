# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write one MCAP file that is safe against being cut off.

The records are those of the `mcap` library, except for channels, messages and their index, which
are packed here: 0.5 us a message instead of 3.6 (benchmarks/recording.py), and it is this thread's
turn at the interpreter that the step loop would wait for. For the same reason a chunk that is not
compressed is never put together in memory: to copy a megabyte holds the GIL for up to a
millisecond. What is flushed has left the process: whole chunks, each with a checksum, that
`recover` finds without an index.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
import os
from pathlib import Path
import struct
import zlib

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    ChunkIndex, DataEnd, Footer, Header, McapRecord, Schema, Statistics, SummaryOffset)
import zstandard

from rigid_sim_ros import __version__
from rigid_sim_ros.bag.files import LARGEST
from rigid_sim_ros.bag.metadata import FileFacts, profiles_text
from rigid_sim_ros.bag.topics import definition, Topic

MAGIC = b'\x89MCAP0\r\n'
MESSAGE = struct.Struct('<BQHIQQ')      # opcode, length, channel, sequence, log and publish time
MESSAGE_FIELDS = MESSAGE.size - 9       # what the length counts besides the data
_INDEX = struct.Struct('<BQHI')

# [bytes] A chunk goes out when it has grown to this, or with a flush. Larger ones compress a
# little better; rosbag2 and rosbags end theirs at 0.8 and 1 MB.
_CHUNK = 1 << 20
# Buffers in one call of the system: IOV_MAX of Linux.
_BUFFERS = 1024


class McapFile:
    """An MCAP file that is being written; channel k + 1 carries topic k."""

    suffix = '.mcap'

    def __init__(self, path: Path, topics: Sequence[Topic], compressed: bool) -> None:
        """Create the file and describe its topics; OSError if that cannot be done."""
        self.path = path
        self.counts = [0] * len(topics)
        self.first_ns = 0       # log times of the first message and the last
        self.last_ns = 0
        self.size = 0           # [bytes] that the system has taken over
        self._crc = 0
        self._compress = zstandard.ZstdCompressor(level=1).compress if compressed else None
        self._topics = topics
        self._schemas = {name: k + 1 for k, name in enumerate(
            dict.fromkeys(topic.type for topic in topics))}
        self._chunks: list[ChunkIndex] = []
        self._parts: list[bytes] = []           # of the chunk that is growing, one a `write`
        self._parts_crc = 0
        self._index: dict[int, list[int]] = {}  # channel: time and place of each message
        self._position = 0
        self._first: int | None = None
        self._last = 0
        self._file = path.open('xb', buffering=0)
        # A channel is described in the chunk in which it has its first message, as other writers
        # have it and tools expect; and at the head of the file too, for a file that was cut off
        # and whose first chunk is damaged.
        schemas = self._schema_records()
        self._to_describe = set(range(1, len(topics) + 1))
        self._schemas_to_describe = {schema.id: schema for schema in schemas}
        described = [_bytes(schemas), *self._channel_records()]
        self._described_size = sum(map(len, described))
        try:
            self._put([MAGIC, _bytes([Header('ros2', f'rigid_sim_ros {__version__}')]),
                       *described])
        except OSError:
            self._file.close()
            path.unlink()
            raise
        self._whole = self.size, self._crc      # up to the last whole chunk

    def write(self, channels: Iterable[int], first_ns: int, messages: Iterable[bytes]) -> None:
        """
        Append messages, one a channel, in the order given.

        Their times are a nanosecond apart from `first_ns` on, which must be later than any time
        before: so every reader gives them back in the order in which they were written.
        """
        parts: list[bytes] = []
        index, position, stamp, pack = self._index, self._position, first_ns, MESSAGE.pack
        for channel, data in zip(channels, messages, strict=True):
            size = len(data)
            if channel in self._to_describe:
                parts.append(self._description(channel))
                position += len(parts[-1])
            parts.append(pack(5, size + MESSAGE_FIELDS, channel, 0, stamp, stamp))
            parts.append(data)
            entry = index.get(channel)
            if entry is None:
                entry = index[channel] = []
            entry.append(stamp)
            entry.append(position)
            position += size + 31       # MESSAGE.size
            stamp += 1
        together = b''.join(parts)
        self._parts.append(together)
        self._parts_crc = zlib.crc32(together, self._parts_crc)
        if self._first is None:
            self._first = first_ns
        self._last = stamp - 1
        self._position = position
        if position >= _CHUNK:
            self._end_chunk()

    @property
    def written(self) -> tuple[int, ...]:
        """How many messages each topic has, those included that wait for a flush."""
        return tuple(count + len(self._index.get(k, ())) // 2
                     for k, count in enumerate(self.counts, start=1))

    def flush(self) -> None:
        """Hand all that was written to the system, which keeps it when this process dies."""
        if self._position:
            self._end_chunk()

    def sync_handle(self) -> int:
        """Return a new file descriptor, to be synchronised and closed by another thread."""
        return os.dup(self._file.fileno())

    def cut_back(self) -> None:
        """Drop what a write that failed has left behind the last whole chunk."""
        self.size, self._crc = self._whole
        self._file.truncate(self.size)
        self._file.seek(self.size)
        self._begin_chunk()

    def closing_size(self) -> int:
        """Return how many bytes `close` will need at most."""
        per_chunk = 100 + 10 * len(self._topics)
        return 4096 + (len(self._chunks) + 1) * per_chunk + self._described_size

    def close(self) -> FileFacts:
        """Write the index and let the file go; OSError if there is no room."""
        self.flush()
        self._put([_bytes([DataEnd(self._crc)])])
        start = self.size
        statistics = Statistics(
            attachment_count=0, channel_count=len(self._topics),
            channel_message_counts={k + 1: n for k, n in enumerate(self.counts)},
            chunk_count=len(self._chunks), message_count=sum(self.counts),
            message_start_time=self.first_ns, message_end_time=self.last_ns, metadata_count=0,
            schema_count=len(self._schemas))
        self._crc = 0       # the next checksum covers the summary
        offsets = []
        for opcode, group in (
                (Opcode.SCHEMA, _bytes(self._schema_records())),
                (Opcode.CHANNEL, b''.join(self._channel_records())),
                (Opcode.STATISTICS, _bytes([statistics])),
                (Opcode.CHUNK_INDEX, _bytes(self._chunks))):
            if group:
                offsets.append(SummaryOffset(opcode, self.size, len(group)))
                self._put([group])
        offsets_start = self.size
        # The checksum covers the footer too, up to where itself stands.
        self._put([_bytes(offsets), _bytes([Footer(start, offsets_start, 0)])[:-4]])
        self._put([struct.pack('<I', self._crc), MAGIC])
        os.fsync(self._file.fileno())
        self._file.close()
        return self.facts()

    def abandon(self) -> None:
        """Let the file go as it is."""
        self._file.close()

    def facts(self) -> FileFacts:
        """Return what the metadata says of this file."""
        return FileFacts(self.path.name, self.first_ns, self.last_ns, tuple(self.counts))

    def _begin_chunk(self) -> None:
        self._parts, self._parts_crc, self._index, self._position = [], 0, {}, 0
        self._first, self._last = None, 0

    def _end_chunk(self) -> None:
        # What grows beyond all measure no reader should trust, see files.py: ours does not.
        packs = self._compress if self._position <= LARGEST else None
        data = [packs(b''.join(self._parts))] if packs else self._parts
        data_size = sum(map(len, data))
        compression = 'zstd' if packs else ''
        head = self._chunk_head(data_size, compression)
        chunk_size = len(head) + data_size
        parts, offsets, position = [head, *data], {}, self.size + chunk_size
        for channel, entry in self._index.items():
            size = 8 * len(entry)
            offsets[channel] = position
            parts.append(_INDEX.pack(Opcode.MESSAGE_INDEX, size + 6, channel, size))
            parts.append(struct.pack(f'<{len(entry)}Q', *entry))
            position += _INDEX.size + size
        assert self._first is not None
        index = ChunkIndex(
            chunk_length=chunk_size, chunk_start_offset=self.size,
            compression=compression, compressed_size=data_size,
            message_end_time=self._last, message_start_time=self._first,
            message_index_length=position - self.size - chunk_size,
            message_index_offsets=offsets, uncompressed_size=self._position)
        self._put(parts)
        # Only now does it count: a chunk that did not fit on the disk is cut off again.
        self._whole = self.size, self._crc
        self._chunks.append(index)
        for channel, entry in self._index.items():
            self.counts[channel - 1] += len(entry) // 2
        self.first_ns = self.first_ns or self._first
        self.last_ns = self._last
        self._begin_chunk()

    def _chunk_head(self, data_size: int, compression: str) -> bytes:
        """Return the record of the chunk up to its data, which the library would copy twice."""
        assert self._first is not None
        name = compression.encode()
        rest = struct.pack(f'<QQQII{len(name)}sQ', self._first, self._last, self._position,
                           self._parts_crc, len(name), name, data_size)
        return struct.pack('<BQ', Opcode.CHUNK, len(rest) + data_size) + rest

    def _put(self, parts: Sequence[bytes]) -> None:
        """Write pieces one after the other without joining them."""
        rest: list[bytes | memoryview] = list(parts)
        while rest:
            written = os.writev(self._file.fileno(), rest[:_BUFFERS])
            done = 0
            while done < len(rest) and written >= len(rest[done]):
                written -= len(rest[done])
                done += 1
            del rest[:done]
            if written:
                rest[0] = memoryview(rest[0])[written:]
        self.size += sum(map(len, parts))
        for part in parts:
            self._crc = zlib.crc32(part, self._crc)

    def _schema_records(self) -> list[Schema]:
        return [Schema(id=k, name=name, encoding='ros2msg', data=definition(name)[0].encode())
                for name, k in self._schemas.items()]

    def _description(self, number: int) -> bytes:
        """Return the record of a channel that had no message yet, and of its type if need be."""
        self._to_describe.remove(number)
        schema = self._schemas_to_describe.pop(self._schemas[self._topics[number - 1].type], None)
        return _bytes([schema] if schema else []) + self._channel_record(number)

    def _channel_records(self) -> Iterator[bytes]:
        return map(self._channel_record, range(1, len(self._topics) + 1))

    def _channel_record(self, number: int) -> bytes:
        topic = self._topics[number - 1]
        rest = (struct.pack('<HH', number, self._schemas[topic.type]) + _text(topic.name)
                + _text('cdr') + _channel_metadata(topic.type, topic.latched))
        return struct.pack('<BQ', Opcode.CHANNEL, len(rest)) + rest


@cache
def _channel_metadata(message_type: str, latched: bool) -> bytes:
    """Return what many channels have in common: a map of texts."""
    texts = b''.join(map(_text, (
        'offered_qos_profiles', profiles_text(latched),
        'topic_type_hash', definition(message_type)[1])))
    return struct.pack('<I', len(texts)) + texts


def _text(text: str) -> bytes:
    """Return a text as it stands in a record."""
    data = text.encode()
    return struct.pack('<I', len(data)) + data


def _bytes(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
