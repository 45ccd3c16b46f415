# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What stands between the page and a running simulation.

A node fills an `Inbox` with what the simulation says, from its own thread, and does what the page
asks of its `Driver`.
"""
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol

from rigid_sim_ros.viewer.motion import Array

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# Called with a text for the user, and whether all is well.
Answer = Callable[[str, bool], None]


class BodyWrench(NamedTuple):
    """A wrench on a body about its centre of mass, in world axes."""

    body: str
    force: Vector       # N
    torque: Vector      # Nm


class Applied(NamedTuple):
    """The echo of a wrench that the simulation has accepted."""

    t_ns: int           # simulation time from which it acts
    frame: str          # whose axes these are; for a frame of the body itself also where it acts
    force: Vector
    torque: Vector


class Report(NamedTuple):
    """One part of /diagnostics."""

    level: int
    message: str
    values: Mapping[str, str]


class Inbox:
    """The latest of everything that was heard: each attribute is replaced as a whole."""

    def __init__(self) -> None:
        self.node = ''                              # fully qualified, '' while none was found
        self.scene = ''                             # YAML
        self.scene_name = ''                        # as the reports have it
        self.state = b''                            # CDR of ~/state
        self.state_at = 0.0                         # [s] steady time of its arrival
        self.contacts = b''                         # CDR of ~/markers
        self.reports: Mapping[str, Report] = {}     # by part: pace, physics, ...
        self.reported = 0                           # how many there were
        self.reported_at = 0.0                      # [s] when the last came
        self.joints: dict[str, bytes] = {}          # CDR of the joint states, by model
        self.applied: dict[str, Applied] = {}       # the last on each body
        self.heard_state: Callable[[bytes], None] | None = None

    def is_silent(self, now: float, seconds: float) -> bool:
        """Return whether nothing was heard for some time; now is steady wall time [s]."""
        return now - max(self.state_at, self.reported_at) > seconds


class Driver(Protocol):
    """What a page may want of a simulation; answers come in any thread."""

    def pause(self, paused: bool, answer: Answer) -> None:
        """Pause or go on."""

    def trigger(self, service: str, answer: Answer) -> None:
        """Call step, reset, start_recording or stop_recording."""

    def set_speed(self, factor: float, answer: Answer) -> None:
        """Simulate this many seconds a second; 0: as fast as possible."""

    def set_pose(self, body: str, position: Vector, orientation: Quaternion,
                 answer: Answer) -> None:
        """Put a body somewhere."""

    def lead_joint(self, joint: str, position: float, answer: Answer) -> None:
        """Let the drive of a joint bring it to a position [rad or m], and hold it there."""

    def put_joint(self, joint: str, position: float, answer: Answer) -> None:
        """Put a joint at a position [rad or m], at rest."""

    def apply(self, wrenches: Sequence[BodyWrench]) -> None:
        """Apply these in the place of those before."""

    def listen(self, what: str, wanted: bool) -> None:
        """Hear `contacts` or `wrenches`, or no longer."""


def triple(vector: Array) -> Vector:
    """Return a vector as three numbers."""
    x, y, z = vector.tolist()
    return x, y, z
