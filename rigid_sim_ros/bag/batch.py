# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a scene offline, as fast as possible, into the bag that the node would have recorded."""

from collections.abc import Callable
import math
import os
import time
from typing import Any

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.events import INPUTS
from rigid_sim_ros.bag.outputs import joint_topics, Outputs, state_topics
from rigid_sim_ros.bag.recorder import Recorder, Status
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.world import World
from rigid_sim_ros.world.commands import Command

# What msg_config/default.yaml sets for the node.
PUBLISH_RATE = 100.0    # [Hz] of simulation time
HASH_INTERVAL = 1000    # steps


class Batch:
    """
    A world whose steps are recorded at the pace of its own clock.

    For programs: what is done to the world between two calls of `run` is recorded.
    """

    def __init__(self, world: World, output: str | os.PathLike[str], *,
                 publish_rate: float = PUBLISH_RATE, hash_interval: int = HASH_INTERVAL,
                 storage: str = 'mcap', compression: str = 'none', node: str = '/rigid_sim',
                 **options: Any) -> None:
        """
        Create the bag; BagError if that cannot be done.

        States are recorded `publish_rate` times a second [Hz] of simulation time and hashes every
        `hash_interval` steps, 0: never. ValueError for less than 0.
        """
        if not 0.0 <= publish_rate < math.inf:
            raise ValueError(f'publish_rate {publish_rate!r} Hz, must be finite and >= 0')
        if hash_interval < 0:
            raise ValueError(f'hash_interval {hash_interval!r}, must be >= 0')
        self.world = world
        self._publish_interval = max(1, round(
            SECOND / (publish_rate * world.step_ns))) if publish_rate else 0
        self._hash_interval = hash_interval
        self._ticks = 0         # steps taken, which a reset does not set back
        self._start_ns = time.time_ns()
        topics = [*state_topics(node, world.names), *joint_topics(node, world)]
        self.recorder = Recorder(
            output, world, topics, node=node, storage=storage, compression=compression,
            waits=True, clock=self._now, parameters={
                'publish_rate': publish_rate, 'hash_interval': hash_interval,
                'real_time_factor': 0.0, 'frame_id': 'world', 'bodies': ['*']}, **options)
        self._topics = topics
        self._outputs = Outputs(world, topics, 'world')
        self.recorder.snapshot(world)
        world.observe(self._note)
        self._record(kinds.ROBOT_DESCRIPTION)
        self.publish()

    def _now(self) -> int:
        return self._start_ns + self._ticks * self.world.step_ns

    def tell(self, kind: str, **arguments: Any) -> None:
        """
        Do something to the world and record it: the name of its method, and the arguments.

        The notes of events.py, such as 'pause', are recorded and do nothing. ValueError, and
        nothing is recorded, if the world refuses.
        """
        if kind in INPUTS:
            self.world.apply(Command(kind, arguments))
        else:
            self.recorder.event(self.world.step_index, kind, **arguments)

    def _note(self, step: int, command: Command) -> None:
        self.recorder.event(step, command.kind, **command.arguments)
        if command.kind in ('add', 'remove'):
            self._outputs = Outputs(self.world, self._topics, 'world')

    def publish(self) -> None:
        """Record what the node would publish now."""
        index = self.world.step_index
        if self._publish_interval and index % self._publish_interval == 0:
            self._record(kinds.CLOCK, kinds.POSE, kinds.TWIST, kinds.STATE, kinds.JOINT_STATES)
        if self._hash_interval and index % self._hash_interval == 0:
            self._record(kinds.STATE_HASH)

    def run(self, steps: int, progress: Callable[[int], None] | None = None) -> None:
        """Make steps and record what comes of them; BagError if the disk takes no more."""
        intervals = [n for n in (self._publish_interval, self._hash_interval) if n]
        while steps > 0:
            index = self.world.step_index
            count = min([steps, *(n - index % n for n in intervals)])
            self.world.step(count)
            self._ticks += count
            steps -= count
            self.publish()
            if self.recorder.wants_snapshot:
                self.recorder.snapshot(self.world)
            if self.recorder.error:
                raise BagError(self.recorder.error)
            if progress is not None:
                progress(count)

    def close(self) -> Status:
        """End the bag; BagError if it could not be written to its end."""
        self.world.forget(self._note)
        self.recorder.close(self.world)
        if self.recorder.error:
            raise BagError(self.recorder.error)
        return self.recorder.status()

    def _record(self, *chosen: str) -> None:
        pairs = [pair for kind in chosen for pair in self._outputs.encode(kind)]
        if pairs:
            self.recorder.publish(
                self.world.step_index, [self.recorder.channel(name) for name, _ in pairs],
                [data for _, data in pairs])
