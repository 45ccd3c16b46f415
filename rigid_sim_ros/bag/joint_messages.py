# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a world says of its joints, as bytes: for the node, which publishes it, and for bags."""

from collections.abc import Iterable

import numpy as np

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.messages.codec import encode_string, encode_wrench, JointStateEncoder
from rigid_sim_ros.scene.joint_groups import all_joints, joint_groups
from rigid_sim_ros.world import World


class JointMessages:
    """The messages of the joints of one world, as it is now."""

    def __init__(self, world: World) -> None:
        """Prepare the messages."""
        self._world = world
        groups = joint_groups(world.scene.spec.joints)
        self.models = [group.model for group in groups]
        self.joints = list(world.joint_names)
        whole = all_joints(groups)
        self._groups = {(kinds.JOINT_STATES, group.model): group for group in groups}
        self._groups[kinds.ALL_JOINT_STATES, ''] = whole
        self._encoders = {key: JointStateEncoder(group.names)
                          for key, group in self._groups.items()}
        self._index = {key: np.array(group.places, int) for key, group in self._groups.items()}

    def owners(self, kind: str) -> list[str]:
        """Return the models or joints that have a topic of a kind; '' is the node itself."""
        return {kinds.JOINT_STATES: self.models, kinds.ALL_JOINT_STATES: [''],
                kinds.JOINT_WRENCH: self.joints,
                kinds.ROBOT_DESCRIPTION: list(self._world.scene.descriptions)}[kind]

    def encode(self, kind: str, owners: Iterable[str]) -> list[bytes]:
        """Return a message of a kind for each of these models or joints."""
        world = self._world
        if kind == kinds.JOINT_WRENCH:
            return [self._wrench(joint) for joint in owners]
        if kind == kinds.ROBOT_DESCRIPTION:
            return [encode_string(world.scene.descriptions[model]) for model in owners]
        motion = world.joint_position, world.joint_velocity, world.joint_effort
        return [self._encoders[key].encode(world.time_ns, *(a[self._index[key]] for a in motion))
                for key in ((kind, owner) for owner in owners)]

    def _wrench(self, joint: str) -> bytes:
        wrench = self._world.joint_wrench(joint)
        return encode_wrench(self._world.time_ns, joint, wrench[:3], wrench[3:])
