# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a bag holds, and whether it is whole: for any bag, with more for one of our own."""

from collections import Counter
import os
from typing import NamedTuple

from rigid_sim_ros.bag import decode, events, session as sessions, topics as kinds
from rigid_sim_ros.bag.errors import Damaged
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.problems import counted


class Info(NamedTuple):
    """A bag as a whole."""

    topics: dict[str, tuple[str, int]]  # name: type and number of messages
    messages: int
    first_ns: int                       # times of the first message and the last
    last_ns: int
    files: int
    size: int                           # bytes
    note: str                           # of a recovery, '' if there was none
    # Of a recording by rigid_sim_ros, else None and empty:
    session: Session | None
    happened: dict[str, int]            # number of events by kind
    gaps: tuple[str, ...]
    snapshots: int
    is_closed: bool                     # the recording came to its end


def info(path: str | os.PathLike[str]) -> Info:
    """
    Read a bag from beginning to end; BagError if it cannot be, or is not what was written.

    That takes 1 us a message, and tells what no index can: that every byte is there.
    """
    reader = BagReader(path)
    counts: Counter[str] = Counter()
    own: dict[str, str] = {}        # kind of the topics that tell of the session
    session: Session | None = None
    happened: Counter[str] = Counter()
    gaps: list[str] = []
    first_ns, last_ns = 2 ** 63, 0
    for topic, stamp, data in reader.messages():
        counts[topic] += 1
        first_ns, last_ns = min(first_ns, stamp), max(last_ns, stamp)
        if session is None and sessions.is_session(topic):
            session = sessions.read(topic, data)
            own = {each.name: each.kind for each in session.topics if each.kind == kinds.EVENT}
        elif topic in own:
            event = events.decode(decode.string(data))
            happened[event.kind] += event.kind != events.WRITTEN
            if event.kind == events.GAP:
                gaps.append(_described(event))
    _check(reader)
    custom = (reader.metadata or {}).get('custom_data') or {}
    return Info(
        {name: (kind, counts[name]) for name, kind in sorted(reader.types.items())},
        sum(counts.values()), first_ns if counts else 0, last_ns, len(reader.files),
        sum(file.stat().st_size for file in reader.files), str(custom.get('recovered', '')),
        session, dict(+happened), tuple(gaps),
        counts[f'{session.node}/bag/snapshot'] if session else 0, bool(happened[events.END]))


def _check(reader: BagReader) -> None:
    if reader.faults:
        more = len(reader.faults) - 1
        raise Damaged(f'{reader.path}: {reader.faults[0]}' + (
            f', and {counted(more, "more fault")}' if more else '')
            + f': `rigid_sim recover {reader.path}` keeps what is whole')


def _described(event: events.Event) -> str:
    lost = event.arguments
    if lost['events'] is None:
        return f'after step {event.step}: an unknown number of messages and events (damaged)'
    return (f'steps {lost["since_step"]} to {event.step}: {counted(lost["messages"], "message")}, '
            f'{counted(lost["events"], "event")}')
