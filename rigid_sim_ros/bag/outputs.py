# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a world says at a step, as the bytes on its topics: for `batch`, which records it first."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.joint_messages import JointMessages
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.messages.codec import (
    encode_clock, encode_uint64, PoseEncoder, StateEncoder, TransformsEncoder, TwistEncoder)
from rigid_sim_ros.world import World


def state_topics(node: str, names: Iterable[str]) -> list[Topic]:
    """Return the topics of a simulation that show the motion of bodies."""
    names = list(names)
    return [
        kinds.published(kinds.CLOCK, node),
        *(kinds.published(kind, node, name) for kind in (kinds.POSE, kinds.TWIST)
          for name in names),
        kinds.published(kinds.STATE, node),
        kinds.published(kinds.STATE_HASH, node),
    ]


def joint_topics(node: str, world: World) -> list[Topic]:
    """Return the topics of a simulation that show the motion of joints, and their models."""
    joints = JointMessages(world)
    return [kinds.published(kind, node, model)
            for kind in (kinds.JOINT_STATES, kinds.ROBOT_DESCRIPTION)
            for model in joints.owners(kind)]


class Outputs:
    """Encodes what is said on the topics of a world, whichever of them there are."""

    def __init__(self, world: World, topics: Sequence[Topic], frame_id: str) -> None:
        """Prepare messages for these topics; those of what is not there are silent."""
        index = {name: k for k, name in enumerate(world.names)}
        joints = JointMessages(world)
        there = {**dict.fromkeys(kinds.OF_BODIES, world.names),
                 **{kind: joints.owners(kind) for kind in kinds.OF_JOINTS}}
        topics = [topic for topic in topics
                  if topic.kind not in there or topic.body in there[topic.kind]]
        self._world = world
        self._names = {kind: [topic.name for topic in topics if topic.kind == kind]
                       for kind in kinds.TYPES}
        poses = [index[t.body] for t in topics if t.kind == kinds.POSE]
        twists = [index[t.body] for t in topics if t.kind == kinds.TWIST]
        self._of_pose, self._of_twist = np.array(poses, int), np.array(twists, int)
        self._poses = PoseEncoder(frame_id, len(poses))
        self._twists = TwistEncoder(frame_id, len(twists))
        self._state = StateEncoder(frame_id, world.names)
        self._transforms = TransformsEncoder(frame_id, world.names)
        self._encode: dict[str, Callable[[], list[bytes]]] = {
            **{kind: partial(joints.encode, kind, [t.body for t in topics if t.kind == kind])
               for kind in kinds.OF_JOINTS},
            kinds.CLOCK: self._clock, kinds.POSE: self._pose, kinds.TWIST: self._twist,
            kinds.STATE: self._whole_state, kinds.TRANSFORMS: self._transform,
            kinds.STATE_HASH: self._hash}

    def encode(self, kind: str) -> Iterator[tuple[str, bytes]]:
        """Give name and message of each topic of a kind, as the world is now."""
        names = self._names[kind]
        return zip(names, self._encode[kind]() if names else [], strict=True)

    def _clock(self) -> list[bytes]:
        return [encode_clock(self._world.time_ns)] * len(self._names[kinds.CLOCK])

    def _pose(self) -> list[bytes]:
        w, chosen = self._world, self._of_pose
        return self._poses.encode(w.time_ns, w.position[chosen], w.orientation[chosen])

    def _twist(self) -> list[bytes]:
        w, chosen = self._world, self._of_twist
        return self._twists.encode(
            w.time_ns, w.linear_velocity[chosen], w.angular_velocity[chosen])

    def _whole_state(self) -> list[bytes]:
        w = self._world
        return [self._state.encode(w.time_ns, w.position, w.orientation, w.linear_velocity,
                                   w.angular_velocity)] * len(self._names[kinds.STATE])

    def _transform(self) -> list[bytes]:
        w = self._world
        data = self._transforms.encode(w.time_ns, w.position, w.orientation)
        return [data] * len(self._names[kinds.TRANSFORMS])

    def _hash(self) -> list[bytes]:
        return [encode_uint64(self._world.state_hash())] * len(self._names[kinds.STATE_HASH])
