# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What joints have to do with sleep, besides that they tie bodies together (sleeping.py).

What a drive is told otherwise than before ends the rest of its articulation: a goal that moves
along a trajectory, a command, and the end of one. A drive that is told to turn lets nothing rest.
"""

from rigid_sim_ros.engine.joints.buffers import Drives, JointMotion, VELOCITY
from rigid_sim_ros.engine.model.joints import JointTable, NONE
from rigid_sim_ros.engine.solver.sleeping import Rest
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

# Rows of what was told: the fields of `Drives` but for the last, and the position of the joint,
# which somebody may have put a whole turn on.
TOLD = 7


@kernel
def mark_told(table: JointTable, motion: JointMotion, told: Array, rest: Rest) -> None:
    """
    Let bodies begin to rest anew whose drives are told otherwise than `told` (TOLD, k) says.

    It says then what they are told now. -1 is for `wake_disturbed` to see it.
    """
    for i in range(table.body.shape[0]):
        body = table.body[i]
        for k in range(table.first_axis[i], table.first_axis[i + 1]):
            j = table.axis_joint[k]
            position = 0.0 if j == NONE else motion.position[j]
            if (_differs(motion.drives, k, told) or _turns(motion.drives, k)
                    or (rest.asleep[body] == 1 and told[TOLD - 1, k] != position)):
                rest.steps[body] = -1
            _note(motion.drives, k, position, told)


@kernel
def _differs(drives: Drives, k: int, told: Array) -> bool:
    return (told[0, k] != drives.mode[k] or told[1, k] != drives.stiffness[k]
            or told[2, k] != drives.damping[k] or told[3, k] != drives.position[k]
            or told[4, k] != drives.velocity[k] or told[5, k] != drives.effort[k])


@kernel
def _turns(drives: Drives, k: int) -> bool:
    return drives.mode[k] == VELOCITY and drives.velocity[k] != 0.0


@kernel
def _note(drives: Drives, k: int, position: float, told: Array) -> None:
    told[0, k], told[1, k], told[2, k] = drives.mode[k], drives.stiffness[k], drives.damping[k]
    told[3, k], told[4, k], told[5, k] = drives.position[k], drives.velocity[k], drives.effort[k]
    told[TOLD - 1, k] = position
