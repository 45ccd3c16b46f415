# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can be done to a world between two steps, as a value: to record it, and to do it again."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

# Names of the methods of World that change it.
KINDS = frozenset({'add', 'apply_impulse', 'apply_wrench', 'cancel_wrenches',
                   'follow_trajectory', 'remove', 'reset', 'set_joint_command',
                   'set_joint_commands', 'set_joint_state', 'set_pose', 'set_twist'})
# What may be said of a command besides the arguments of its method: how the message that brought a
# wrench named its frame, for the world's may have another name outside.
FRAME_ID = 'frame_id'


class Command(NamedTuple):
    """A call of one of the methods KINDS."""

    kind: str
    arguments: Mapping[str, Any]  # by name

    @property
    def given(self) -> dict[str, Any]:
        """The arguments of the method."""
        return {name: value for name, value in self.arguments.items() if name != FRAME_ID}


# Takes World.step_index as it was before a command, and the command.
Observer = Callable[[int, Command], None]
