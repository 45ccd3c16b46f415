# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The quality of service of a recorded topic, as its publishers offered it.

Bags keep a list with one profile for each publisher: in metadata.yaml as a list (version 9) or as
YAML in a string (before), in MCAP and SQLite files as YAML in a string; with words (since Jazzy)
or with the numbers of rmw's enumerations (before).
"""

from collections.abc import Mapping, Sequence
from functools import cache
import json
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from rigid_sim_ros.times import SECOND

RELIABLE, BEST_EFFORT = 'reliable', 'best_effort'
VOLATILE, TRANSIENT_LOCAL = 'volatile', 'transient_local'
AUTOMATIC, MANUAL_BY_TOPIC = 'automatic', 'manual_by_topic'

# What the numbers of rmw/types.h mean; all others, and other words, mean that it is not known.
_RELIABILITY = {1: RELIABLE, 2: BEST_EFFORT}
_DURABILITY = {1: TRANSIENT_LOCAL, 2: VOLATILE}
_LIVELINESS = {1: AUTOMATIC, 3: MANUAL_BY_TOPIC}

# [s] Durations from here on are infinite, in the notations of DDS and of rmw.
_INFINITE_S = 2 ** 31 - 1

# Messages that a latched topic keeps at most, whatever a bag says of its publishers' depth.
_MOST_KEPT = 1000


class OfferedQos(NamedTuple):
    """What the publishers of a topic offered together; '' and None: not known or not limited."""

    reliability: str = ''
    durability: str = ''
    depth: int = 0                      # of all publishers together; 0: not known
    deadline_ns: int | None = None
    lifespan_ns: int | None = None
    liveliness: str = ''
    lease_ns: int | None = None
    ignores_ros_names: bool = False     # the topic has no prefix in DDS

    @property
    def is_latched(self) -> bool:
        """Whether subscribers that come late get the last messages."""
        return self.durability == TRANSIENT_LOCAL

    @property
    def kept(self) -> int:
        """How many messages a subscriber that comes late gets."""
        return min(max(1, self.depth), _MOST_KEPT) if self.is_latched else 0


def parse(profiles: object) -> OfferedQos:
    """
    Return the QoS of a list of profiles, or of a text with one; ValueError if it is neither.

    One publisher has to stand in for all: it offers the most that any of them did (whoever could
    hear one of them can hear it), keeps as many messages as all of them together, and has time
    limits only where all had the same.
    """
    found = _from_text(profiles) if isinstance(profiles, str) else profiles
    if not found:
        return OfferedQos()
    if not isinstance(found, Sequence) or not all(isinstance(each, Mapping) for each in found):
        raise ValueError(f'{str(found)[:40]!r} is no list of QoS profiles')
    return _together([_profile(each) for each in found])


@cache
def _from_text(text: str) -> Any:
    try:
        return json.loads(text) if text else []     # a hundred times faster, where it works
    except ValueError:
        pass
    try:
        return YAML(typ='safe').load(text)
    except (YAMLError, RecursionError, ValueError) as error:
        raise ValueError(f'{text[:40]!r} is no YAML ({type(error).__name__})') from None


def _profile(fields: Mapping[str, Any]) -> OfferedQos:
    depth = fields.get('depth', 0)
    return OfferedQos(
        _word(fields.get('reliability'), _RELIABILITY),
        _word(fields.get('durability'), _DURABILITY),
        depth if isinstance(depth, int) and depth > 0 else 0,
        _duration(fields.get('deadline')),
        _duration(fields.get('lifespan')),
        _word(fields.get('liveliness'), _LIVELINESS),
        _duration(fields.get('liveliness_lease_duration')),
        fields.get('avoid_ros_namespace_conventions') is True)


def _together(profiles: Sequence[OfferedQos]) -> OfferedQos:
    first = profiles[0]
    if len(profiles) == 1:
        return first
    alike = all(each[3:] == first[3:] for each in profiles)
    return OfferedQos(
        _strongest([each.reliability for each in profiles], RELIABLE),
        _strongest([each.durability for each in profiles], TRANSIENT_LOCAL),
        sum(max(1, each.depth) for each in profiles),
        *(first[3:] if alike else OfferedQos()[3:]))


def _strongest(words: Sequence[str], best: str) -> str:
    return best if best in words else max(words)


def _word(value: object, names: Mapping[int, str]) -> str:
    if isinstance(value, str):
        return value if value in names.values() else ''
    return names.get(value, '') if isinstance(value, int) else ''


def _duration(value: object) -> int | None:
    """Return nanoseconds; None where there is no limit."""
    if not isinstance(value, Mapping):
        return None
    seconds, rest = value.get('sec', 0), value.get('nsec', 0)
    if not isinstance(seconds, int) or not isinstance(rest, int):
        return None
    span = seconds * SECOND + rest
    return span if span > 0 and seconds < _INFINITE_S else None
