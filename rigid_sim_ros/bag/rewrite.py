# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Write a file of a bag anew, from what can be had of it, and say in it what is lost."""

from collections import Counter
import contextlib
import os
from pathlib import Path

import zstandard

from rigid_sim_ros.bag import decode, events, topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.files import Budget, size_of, Unpacker
from rigid_sim_ros.bag.mcap_file import McapFile
from rigid_sim_ros.bag.salvage import is_chunk_compressed, is_packed, rows, SalvagedFile
from rigid_sim_ros.bag.sqlite_file import COMPANIONS, SqliteFile
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.messages.codec import encode_string

PART = '.part'      # the end of the name of a file while it grows
_DAMAGED = '.damaged'


def rewrite(file: SalvagedFile, topics: list[Topic], packed: bool, *, is_last: bool) -> list[str]:
    """Write a file anew; return the name under which the damaged one is kept, if it is."""
    path = file.path
    assert file.work is not None
    part = file.work / (path.name + PART)
    index = {topic.name: k + 1 for k, topic in enumerate(topics)}
    kind = SqliteFile if path.suffix == '.db3' else McapFile
    writer = kind(part, topics, compressed=path.suffix == '.mcap' and is_chunk_compressed(path))
    source = SalvagedFile(path, file.work)
    unpack = Unpacker(Budget(size_of(path)))
    stamp = step = lost = 0
    owes = file.begins_with_gap
    event = next((index[t.name] for t in topics if t.kind == kinds.EVENT), 0)
    for channel, stamp, data in rows(source):
        topic = file.topics.get(channel)
        if topic is None or packed != is_packed(data):
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
