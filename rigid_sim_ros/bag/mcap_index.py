# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where in an MCAP file which messages lie, so that reading can begin anywhere.

A block is a chunk, or a stretch of messages outside of chunks: what is read in one go. Blocks are
found in the index at the end of the file, or, where a writer has left that out, by going from
record to record without looking into them.
"""

from collections.abc import Iterator
import io
import os
from pathlib import Path
import struct
from typing import NamedTuple
import zlib

from mcap.opcode import Opcode

from rigid_sim_ros.bag.errors import Damaged
from rigid_sim_ros.bag.files import open_regular
from rigid_sim_ros.bag.mcap_file import MAGIC
from rigid_sim_ros.bag.scan import McapScan, Record

_RECORD = struct.Struct('<BQ')
_FOOTER = struct.Struct('<BQQQI')           # opcode, length, summary, its offsets, checksum
_DATA_END = _RECORD.pack(Opcode.DATA_END, 4)    # and a checksum
_CHUNK_INDEX = struct.Struct('<QQQQI')      # times, offset, length, size of the map that follows
_CHUNK_TIMES = struct.Struct('<QQ')
_MESSAGE_HEAD = struct.Struct('<HIQ')       # channel, sequence, log time
_CHANNEL = struct.Struct('<H')
_OFFSET = struct.Struct('<HQ')              # of the messages of a channel
_STATISTICS = struct.Struct('<QHIIII')      # counts: messages, ..., chunks last

# [bytes] What is looked at of a record: its head, and the head of a message or a chunk.
_HEAD = _RECORD.size + max(_MESSAGE_HEAD.size, _CHUNK_TIMES.size)

# [bytes] What claims to be larger is damaged.
_LARGEST_DESCRIPTION = 16 << 20

# [bytes] Messages outside of chunks are read in stretches of this size.
_STRETCH = 1 << 20


class Block(NamedTuple):
    """A part of a file that is read in one go."""

    offset: int
    length: int
    first_ns: int
    last_ns: int
    channels: frozenset[int] | None     # that have messages in it, None if that is not known
    is_chunk: bool


class McapIndex(NamedTuple):
    """What a file holds, by its index."""

    scan: McapScan              # knows schemas and channels; its file is closed
    blocks: tuple[Block, ...]   # in the order of their first messages


def read_index(path: Path) -> McapIndex:
    """Return the index of a file; Damaged where it has no end or no sense."""
    scan = McapScan(path)
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            blocks = _summary(file, size, scan)
            if blocks is None:
                blocks = _described(file, list(_skimmed(file, size, scan)), scan)
    except struct.error as error:
        raise Damaged(f'{path.name}: the index is damaged ({error})') from None
    finally:
        scan.close()
    return McapIndex(scan, tuple(sorted(blocks, key=lambda block: block.first_ns)))


def read_block(file: io.BufferedReader, block: Block, scan: McapScan) -> bytes:
    """Return the records in a block, uncompressed; Damaged if they are not what was written."""
    if block.length > os.fstat(file.fileno()).st_size:
        raise Damaged(f'{scan.path.name}: the chunk at byte {block.offset} is damaged '
                      f'({block.length} bytes)')
    file.seek(block.offset)
    data = file.read(block.length)
    if not block.is_chunk:
        if len(data) != block.length:
            raise Damaged(f'{scan.path.name} breaks off at byte {block.offset + len(data)}')
        return data
    opcode, length = _RECORD.unpack_from(data) if len(data) > _RECORD.size else (0, 0)
    if opcode != Opcode.CHUNK or length + _RECORD.size != len(data) != block.length:
        raise Damaged(f'{scan.path.name}: there is no chunk at byte {block.offset}')
    faults = len(scan.faults)
    content = scan.content(Record(opcode, block.offset, data[_RECORD.size:]))
    if len(scan.faults) > faults:
        raise Damaged(scan.faults[-1])
    return content.raw


def _summary(file: io.BufferedReader, size: int, scan: McapScan) -> list[Block] | None:
    """Return the chunks that the index lists; None if it does not list all that there is."""
    name, tail = scan.path.name, _FOOTER.size + len(MAGIC)
    file.seek(max(0, size - tail))
    end = file.read(tail)
    if len(end) < tail or end[-len(MAGIC):] != MAGIC:
        raise Damaged(f'{name} has no end: it breaks off at byte {size}')
    opcode, length, start, _, checksum = _FOOTER.unpack_from(end)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _RECORD.size or start > size - tail:
        raise Damaged(f'{name}: the footer is damaged')
    if not start:
        return None
    # What is before says whether that is the place: a wrong one could be all of the file.
    file.seek(max(0, start - len(_DATA_END) - 4))
    if file.read(len(_DATA_END)) != _DATA_END:
        raise Damaged(f'{name}: the footer is damaged')
    file.seek(start)
    summary = file.read(size - tail - start)
    if checksum and checksum != zlib.crc32(end[:_FOOTER.size - 4], zlib.crc32(summary)):
        raise Damaged(f'{name}: the index is not what was written (its checksum does not fit)')
    return _listed(summary, start, scan)


def _listed(summary: bytes, start: int, scan: McapScan) -> list[Block] | None:
    blocks, chunks = [], -1
    for record in _records(summary, start, scan):
        if record.opcode == Opcode.CHUNK_INDEX:
            blocks.append(_chunk(record.payload, start, scan))
        elif record.opcode == Opcode.STATISTICS:
            messages, *_, chunks = _STATISTICS.unpack_from(record.payload)
            if messages and not chunks:
                return None         # all messages lie outside of chunks
        else:
            scan.describe(record)
    described = all(block.channels is None or block.channels <= scan.topics.keys()
                    for block in blocks)
    return blocks if described and chunks == len(blocks) else None


def _records(data: bytes, offset: int, scan: McapScan) -> Iterator[Record]:
    position = 0
    while position < len(data):
        opcode, length = _RECORD.unpack_from(data, position)
        stop = position + _RECORD.size + length
        if opcode == 0 or stop > len(data):
            raise Damaged(f'{scan.path.name} is damaged at byte {offset + position}')
        yield Record(opcode, offset + position, data[position + _RECORD.size:stop])
        position = stop


def _chunk(payload: bytes, end: int, scan: McapScan) -> Block:
    first, last, offset, length, size = _CHUNK_INDEX.unpack_from(payload)
    if not len(MAGIC) <= offset <= end - length or size % _OFFSET.size or last < first:
        raise Damaged(f'{scan.path.name}: the index is damaged (a chunk at byte {offset})')
    begin = _CHUNK_INDEX.size
    # An empty map may also be that of a writer that leaves the index of messages out.
    channels = frozenset(
        channel for channel, _ in _OFFSET.iter_unpack(payload[begin:begin + size])) or None
    return Block(offset, length, first, last, channels, True)


def _skimmed(file: io.BufferedReader, size: int, scan: McapScan) -> Iterator[Block]:
    """Give the blocks of a file whose index does not tell."""
    stretch: Block | None = None
    chunk: Block | None = None
    position = len(MAGIC)
    while True:
        file.seek(position)
        head = file.read(_HEAD)     # at once: who takes a block moves the file
        opcode, length = _RECORD.unpack_from(head) if len(head) >= _RECORD.size else (0, 0)
        stop = position + _RECORD.size + length
        if opcode == 0 or stop > size or (
                opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and length > _LARGEST_DESCRIPTION):
            raise Damaged(f'{scan.path.name} breaks off or is damaged at byte {position}')
        if stretch and (opcode != Opcode.MESSAGE or stretch.length >= _STRETCH):
            yield stretch
            stretch = None
        if chunk and opcode != Opcode.MESSAGE_INDEX:
            yield chunk
            chunk = None
        if opcode == Opcode.MESSAGE:
            channel, _, stamp = _MESSAGE_HEAD.unpack_from(head, _RECORD.size)
            stretch = _longer(stretch, position, stop, stamp, channel)
        elif opcode == Opcode.CHUNK:
            first, last = _CHUNK_TIMES.unpack_from(head, _RECORD.size)
            chunk = Block(position, stop - position, first, last, None, True)
        elif opcode == Opcode.MESSAGE_INDEX and chunk:
            channel, = _CHANNEL.unpack_from(head, _RECORD.size)
            chunk = chunk._replace(channels=(chunk.channels or frozenset()) | {channel})
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            file.seek(position + _RECORD.size)
            scan.describe(Record(opcode, position, file.read(length)))
        elif opcode == Opcode.DATA_END:
            return
        position = stop


def _described(file: io.BufferedReader, blocks: list[Block], scan: McapScan) -> list[Block]:
    """Return blocks with their channels, which may be described nowhere but in one of them."""
    if all(block.channels is not None and block.channels <= scan.topics.keys()
           for block in blocks):
        return blocks
    return [block._replace(channels=frozenset(channel for channel, _, _ in scan.messages_in(
        read_block(file, block, scan), of_any_channel=True))) for block in blocks]


def _longer(block: Block | None, start: int, stop: int, stamp: int, channel: int) -> Block:
    """Return a stretch of messages with one more."""
    if block is None:
        return Block(start, stop - start, stamp, stamp, frozenset({channel}), False)
    channels = block.channels or frozenset()
    return block._replace(
        length=stop - block.offset, first_ns=min(block.first_ns, stamp),
        last_ns=max(block.last_ns, stamp),
        channels=channels if channel in channels else channels | {channel})
