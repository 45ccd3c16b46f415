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
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.topics import Topic

# Grows when a bag of before cannot be verified any more.
FORMAT = 1


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
        return json.dumps(fields, default=str)

    @property
    def by_name(self) -> dict[str, Topic]:
        """The topics by their names."""
        return {topic.name: topic for topic in self.topics}


def new_session(node: str, scene: str, bodies: Sequence[str], step_ns: int, frame_id: str,
                parameters: Mapping[str, Any], topics: Sequence[Topic]) -> Session:
    """Return the session of this software."""
    software = {
        'rigid_sim_ros': __version__, 'numpy': np.__version__, 'numba': numba.__version__,
        'python': platform.python_version(), 'machine': platform.machine()}
    return Session(FORMAT, software, node, scene, tuple(bodies), step_ns, frame_id,
                   dict(parameters), tuple(topics))


def decode(text: str) -> Session:
    """Return the session of some JSON; BagError if it is none that this version knows."""
    try:
        fields = json.loads(text)
        if fields['format'] != FORMAT:
            raise BagError(f'the bag has format {fields["format"]!r}, must be {FORMAT}: read it '
                           'with the version of rigid_sim_ros that recorded it')
        fields['topics'] = tuple(Topic(**topic) for topic in fields['topics'])
        fields['bodies'] = tuple(fields['bodies'])
        session = Session(**fields)
        if not isinstance(session.step_ns, int) or session.step_ns < 1:
            raise ValueError(f'step_ns {session.step_ns!r}')
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, BagError):
            raise
        raise BagError(f'the description of the session is damaged ({error})') from None
    return session
