# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a bag says of its session: who recorded it, with what, and what is on which topic."""

from collections.abc import Mapping, Sequence
import json
import platform
from typing import Any, NamedTuple

import numba
import numpy as np

from rigid_sim_ros import __version__
from rigid_sim_ros.bag.decode import string
from rigid_sim_ros.bag.digests import digest_of
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.world.version import source_digest

# Grows when a bag of before cannot be verified any more.
FORMAT = 2

_NAME = '/bag/session'      # how the topic ends


class Session(NamedTuple):
    """The JSON of the topic ~/bag/session."""

    format: int
    software: Mapping[str, str]     # what the last bit of a number may depend on, and its version
    node: str                       # fully qualified
    scene: str                      # name of the scene; its text is on ~/scene
    bodies: tuple[str, ...]
    step_ns: int
    frame_id: str                   # of the messages
    parameters: Mapping[str, Any]
    topics: tuple[Topic, ...]

    def encode(self) -> str:
        """Return the session as JSON."""
        fields = self._asdict()
        fields['topics'] = [topic._asdict() for topic in self.topics]
        text = json.dumps(fields, default=str)
        return f'{text[:-1]}, "digest": "{digest_of(text)}"}}'

    @property
    def by_name(self) -> dict[str, Topic]:
        """The topics by their names."""
        return {topic.name: topic for topic in self.topics}


def new_session(node: str, scene: str, bodies: Sequence[str], step_ns: int, frame_id: str,
                parameters: Mapping[str, Any], topics: Sequence[Topic]) -> Session:
    """Return the session of this software."""
    software = {
        'rigid_sim_ros': __version__, 'source': source_digest(), 'numpy': np.__version__,
        'numba': numba.__version__, 'python': platform.python_version(),
        'machine': platform.machine()}
    return Session(FORMAT, software, node, scene, tuple(bodies), step_ns, frame_id,
                   dict(parameters), tuple(topics))


def is_session(topic: str) -> bool:
    """Return whether a topic of a bag tells of a session."""
    return topic.endswith(_NAME)


def read(topic: str, data: bytes) -> Session:
    """Return the session of a message; Damaged if it is none, BagError if of another version."""
    session = decode(string(data))
    if topic != session.node + _NAME:
        raise Damaged(f'the session on {topic} is that of another node, {session.node!r}')
    return session


def decode(text: str) -> Session:
    """Return the session of some JSON; Damaged if it is none, BagError if of another version."""
    try:
        fields = json.loads(text)
        if fields['format'] != FORMAT:
            raise BagError(f'the bag has format {fields["format"]!r:.40}, must be {FORMAT}: read '
                           'it with the version of rigid_sim_ros that recorded it')
        body, _, _ = text.rpartition(', "digest": "')
        if fields.pop('digest') != digest_of(body + '}'):
            raise Damaged('the description of the session was changed after it was recorded')
        fields['topics'] = tuple(Topic(**topic) for topic in fields['topics'])
        fields['bodies'] = tuple(fields['bodies'])
        session = Session(**fields)
        _check(session)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        if isinstance(error, BagError):
            raise
        raise Damaged(f'the description of the session is damaged ({error})') from None
    return session


def _check(session: Session) -> None:
    """Raise ValueError unless all fields are of their types."""
    if type(session.step_ns) is not int or not 0 < session.step_ns < 2 ** 63:
        raise ValueError(f'step_ns {session.step_ns!r}')
    texts = [session.node, session.scene, session.frame_id, *session.bodies,
             *(text for topic in session.topics for text in topic[:-1])]
    if not all(isinstance(text, str) for text in texts):
        raise ValueError('a name is no text')
    for what in (session.software, session.parameters):
        if not isinstance(what, dict):
            raise ValueError(f'{what!r:.40} is no mapping')
