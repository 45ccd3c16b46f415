# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Read an MCAP file from its beginning, and trust no byte of it.

The index at the end is not used: files without one, cut off or damaged, are read the same way as
whole ones, and every checksum on the way is looked at. That takes 1 us a message, where the
readers of rosbags and mcap take 5 and 3 and stop at a file that has no end.
"""

from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
import io
import mmap
import os
from pathlib import Path
import re
import struct
from typing import Any, NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, Schema

from rigid_sim_ros.bag.errors import Damaged
from rigid_sim_ros.bag.files import Budget, most_unpacked, open_regular, Unpacker
from rigid_sim_ros.bag.mcap_file import MAGIC, MESSAGE, MESSAGE_FIELDS

_RECORD = struct.Struct('<BQ')
_CHUNK = struct.Struct('<QQQII')    # times, size and checksum of the contents; length of a name

# What looks like a chunk is looked into until this many times the size of the file was read: bytes
# may be laid out so that everything looks like the beginning of a chunk.
_SEARCHES = 4
# How a chunk below 4 GB begins: opcode and length, two times, size, checksum, name of compression.
_CHUNK_HEAD = re.compile(
    rb'(?=\x06.{4}\0{4}.{16}.{4}\0{4}.{4}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd))', re.DOTALL)


class Record(NamedTuple):
    """A record of a file."""

    opcode: int
    offset: int         # of its first byte in the file
    payload: bytes      # without opcode and length

    @property
    def end(self) -> int:
        """The offset behind its last byte."""
        return self.offset + _RECORD.size + len(self.payload)


class Content(NamedTuple):
    """What a chunk holds."""

    raw: bytes
    first_ns: int
    last_ns: int
    is_checked: bool    # there is a checksum, and it fits


class McapScan:
    """One MCAP file, read front to back; `faults` fills with what does not fit on the way."""

    def __init__(self, path: Path, *, must_begin: bool = True) -> None:
        """
        Open the file; Damaged if it is no MCAP file, OSError if it cannot be opened.

        Unless it `must_begin` as one, so that what follows a damaged beginning can be had.
        """
        self.path = path
        self.faults: list[str] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.topics: dict[int, tuple[str, str]] = {}    # channel: name and type
        self._file = open_regular(path)
        self._size = os.fstat(self._file.fileno()).st_size
        self._crc = 0
        budget = Budget(self._size)
        self._decompress: dict[str, Callable[[bytes, int], bytes]] = {
            '': lambda data, _: data, 'zstd': Unpacker(budget), 'lz4': partial(_lz4, budget)}
        self._searched = 0      # [bytes] of what looked like chunks
        self._knows_all = False     # whether what is said of topics anywhere is known
        start = self._read(len(MAGIC))
        if start != MAGIC and must_begin:
            self.close()
            raise Damaged(f'{path.name} ' + (
                'is empty' if not start else 'does not begin as an MCAP file'))

    def close(self) -> None:
        """Let the file go."""
        self._file.close()

    @property
    def position(self) -> int:
        """The offset of the next byte that is read."""
        return self._file.tell()

    def opcode_at(self, offset: int) -> int:
        """Return the byte at an offset, 0 behind the end."""
        self._file.seek(offset)
        return ord(self._file.read(1) or b'\0')

    def records(self) -> Iterator[Record]:
        """Give every record up to the footer; Damaged where the file breaks off."""
        while True:
            offset = self._file.tell()
            crc = self._crc
            head = self._read(_RECORD.size)
            if len(head) < _RECORD.size:
                raise Damaged(f'{self.path.name} breaks off at byte {self._size}')
            opcode, length = _RECORD.unpack(head)
            if opcode == 0 or length > self._size - offset - _RECORD.size:
                raise Damaged(f'{self.path.name} breaks off or is damaged at byte {offset}')
            record = Record(opcode, offset, self._read(length))
            if opcode == Opcode.DATA_END:
                self._check(self._parsed(DataEnd, record).data_section_crc, crc, 'data', offset)
                self._crc = 0       # the next checksum covers the summary
            elif opcode == Opcode.FOOTER:
                self._check_footer(self._parsed(Footer, record), crc, record)
                yield record
                return
            yield record

    def skip_damage(self, offset: int) -> bool:
        """
        Go on with the next whole chunk behind an offset; return whether there is one.

        The checksum over all data is lost by that.
        """
        if offset >= self._size:
            return False
        with mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
            for match in _CHUNK_HEAD.finditer(raw, offset):
                start = match.start()
                length, = struct.unpack_from('<Q', raw, start + 1)
                if length > self._size - start - _RECORD.size:
                    continue
                self._searched += length
                if self._searched > _SEARCHES * self._size:
                    return False
                begin = start + _RECORD.size
                if self._is_whole(raw[begin:begin + length]):
                    self._file.seek(start)
                    return True
        return False

    def _is_whole(self, payload: bytes) -> bool:
        faults = list(self.faults)
        try:
            content = self.content(Record(Opcode.CHUNK, 0, payload))
        except Damaged:
            return False
        finally:
            self.faults = faults
        return content.is_checked

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Give channel, time and bytes of every message in the order of the file."""
        for record in self.records():
            if record.opcode == Opcode.CHUNK:
                content = self.content(record)
                yield from self.messages_in(content.raw)
            elif record.opcode == Opcode.MESSAGE:
                yield from self.messages_in(
                    _RECORD.pack(record.opcode, len(record.payload)) + record.payload)
            else:
                self.describe(record)

    def messages_in(
        self, raw: bytes, *, of_any_channel: bool = False,
    ) -> list[tuple[int, int, bytes]]:
        """Return the messages of an uncompressed chunk, and learn the channels in it."""
        unpack, topics = MESSAGE.unpack_from, self.topics
        found: list[tuple[int, int, bytes]] = []
        position, end = 0, len(raw)
        while position < end:
            if end - position < MESSAGE.size:
                opcode, length, channel, stamp = self._short(raw[position:])
            else:
                opcode, length, channel, _, stamp, _ = unpack(raw, position)
            stop = position + 9 + length
            if stop > end or opcode == 0:
                raise Damaged(f'{self.path.name}: a chunk is damaged')
            if opcode == 5:     # Opcode.MESSAGE
                if length < MESSAGE_FIELDS or not (
                        channel in topics or of_any_channel or self._learn(channel)):
                    raise Damaged(f'{self.path.name}: a message in a chunk is damaged')
                found.append((channel, stamp, raw[position + 31:stop]))
            else:
                self.describe(Record(opcode, position, raw[position + 9:stop]))
            position = stop
        return found

    def content(self, record: Record) -> Content:
        """Return what a chunk holds; a wrong checksum is noted, Damaged if it cannot be had."""
        where = f'{self.path.name}: the chunk at byte {record.offset}'
        payload = record.payload
        try:
            first_ns, last_ns, size, crc, name_length = _CHUNK.unpack_from(payload)
            position = _CHUNK.size + name_length
            compression = payload[_CHUNK.size:position].decode()
            length, = struct.unpack_from('<Q', payload, position)
            data = payload[position + 8:position + 8 + length]
            if len(data) != length or (compression and size > most_unpacked(length)):
                raise ValueError(f'{len(data)} of {length} bytes, to become {size}')
            raw = self._decompress[compression](data, size)
            if len(raw) != size:
                raise ValueError(f'{len(raw)} of {size} bytes')
        except (KeyError, ValueError, struct.error, RuntimeError, EOFError, MemoryError) as error:
            raise Damaged(f'{where} is damaged ({error})') from None
        fits = zlib.crc32(raw) == crc
        if crc and not fits:
            self.faults.append(f'{where} is damaged (its checksum does not fit)')
        return Content(raw, first_ns, last_ns, bool(crc) and fits)

    def describe(self, record: Record) -> None:
        """Take up what a record says of the topics."""
        if record.opcode == Opcode.HEADER:
            self._parsed(Header, record)
        elif record.opcode == Opcode.SCHEMA:
            schema = self._parsed(Schema, record)
            self.schemas[schema.id] = schema
        elif record.opcode == Opcode.CHANNEL:
            channel = self._parsed(Channel, record)
            known = self.schemas.get(channel.schema_id)
            self.channels[channel.id] = channel
            self.topics[channel.id] = channel.topic, known.name if known else ''

    def _learn(self, channel: int) -> bool:
        """
        Look for a channel that is described later, and return whether there is one.

        Writers describe channels first; tools that cut and join files may leave that to the index.
        """
        if not self._knows_all:
            self._knows_all = True
            with closing(McapScan(self.path)) as scan:
                for record in scan.records():
                    if record.opcode == Opcode.CHUNK:
                        scan.messages_in(scan.content(record).raw, of_any_channel=True)
                    else:
                        scan.describe(record)
            for k in scan.topics.keys() - self.topics.keys():
                self.channels[k], self.topics[k] = scan.channels[k], scan.topics[k]
        return channel in self.topics

    def _read(self, length: int) -> bytes:
        data = self._file.read(length)
        self._crc = zlib.crc32(data, self._crc)
        return data

    def _short(self, raw: bytes) -> tuple[int, int, int, int]:
        if len(raw) < _RECORD.size or raw[0] == Opcode.MESSAGE:
            raise Damaged(f'{self.path.name}: a chunk breaks off')
        opcode, length = _RECORD.unpack_from(raw)
        return opcode, length, 0, 0

    def _parsed(self, kind: Any, record: Record) -> Any:
        try:
            return kind.read(ReadDataStream(io.BytesIO(record.payload)))
        except (McapError, EOFError, struct.error, UnicodeDecodeError, ValueError) as error:
            raise Damaged(f'{self.path.name}: the {kind.__name__.lower()} at byte {record.offset} '
                          f'is damaged ({error})') from None

    def _check_footer(self, footer: Any, crc: int, record: Record) -> None:
        head = _RECORD.pack(record.opcode, len(record.payload)) + record.payload[:-4]
        self._check(footer.summary_crc, zlib.crc32(head, crc), 'index', record.offset)
        if self._file.read() != MAGIC:
            self.faults.append(f'{self.path.name} does not end as an MCAP file')

    def _check(self, expected: int, found: int, what: str, offset: int) -> None:
        if expected and expected != found:
            self.faults.append(f'{self.path.name}: the {what} before byte {offset} are not what '
                               'was written (their checksum does not fit)')


def _lz4(budget: Budget, data: bytes, size: int) -> bytes:
    budget.spend(size)
    raw = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    return bytes(raw)
