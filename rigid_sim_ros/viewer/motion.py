# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How all bodies move at one time: what the page shows, wherever it comes from."""
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from rigid_sim_ros.messages.decode import Malformed, multi_dof_state
from rigid_sim_ros.times import SECOND

Array = npt.NDArray[np.float64]


class Motion(NamedTuple):
    """Poses and twists of the body frames, a row for each body, in world axes."""

    t_ns: int           # simulation time
    position: Array     # (n, 3) [m]
    orientation: Array  # (n, 4) x, y, z, w
    linear: Array       # (n, 3) [m/s] of the body frame's origin
    angular: Array      # (n, 3) [rad/s]

    @property
    def rotation(self) -> Rotation:
        """The orientations as rotations from body to world axes."""
        return Rotation.from_quat(self.orientation)


class MotionDecoder:
    """Reads sensor_msgs/MultiDOFJointState of the bodies of one scene."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self._head = b''            # of a message that was read in full, behind its stamp
        self._poses = self._twists = 0

    def read(self, data: bytes) -> Motion | None:
        """Return the motion, or None if the message is of other bodies or damaged."""
        is_known = self._head and data[_STAMP:_STAMP + len(self._head)] == self._head
        if not (is_known or self._learn(data)):
            return None
        n = len(self.names)
        try:
            pose = np.frombuffer(data, '<f8', 7 * n, self._poses).reshape(n, 7)
            twist = np.frombuffer(data, '<f8', 6 * n, self._twists).reshape(n, 6)
        except ValueError:
            return None
        sec, nanosec = np.frombuffer(data, '<u4', 2, 4).tolist()
        return Motion(sec * SECOND + nanosec, pose[:, :3], pose[:, 3:], twist[:, :3],
                      twist[:, 3:])

    def _learn(self, data: bytes) -> bool:
        """Find where the numbers stand; the strings before them stay the same."""
        try:
            _, _, names, numbers = multi_dof_state(data)
        except Malformed:
            return False
        if tuple(names) != self.names or np.isnan(numbers).any():
            return False
        # Behind the names: a count, the poses, a count, the twists, a count of no wrenches.
        n = len(names)
        tail = 6 * 8 * n + 4
        self._twists = len(data) - tail
        self._poses = self._twists - 8 - 7 * 8 * n
        again = np.frombuffer(data, '<f8', 7 * n, self._poses).reshape(n, 7)
        if not np.array_equal(again, numbers[:, :7]):
            return False
        self._head = data[_STAMP:self._poses]
        return True


# [m] Where bodies are shown that are not there: far out of every picture, and yet a number.
_AWAY = np.array([0.0, 0.0, -1e7])


def among(motion: Motion, place: npt.NDArray[np.intp], count: int) -> Motion:
    """Return the motion of `count` bodies, of which these have some places; the rest is nan."""
    rows = []
    for array in motion[1:]:
        wide = np.full((count, array.shape[1]), np.nan)
        wide[place] = array
        rows.append(wide)
    return Motion(motion.t_ns, *rows)


def without_absent(motion: Motion) -> Motion:
    """Return a motion that can be shown: bodies that are not there are far away, and at rest."""
    there = np.isfinite(motion.position[:, :1])
    if there.all():
        return motion
    return Motion(motion.t_ns, np.where(there, motion.position, _AWAY),
                  np.where(there, motion.orientation, (0.0, 0.0, 0.0, 1.0)),
                  np.where(there, motion.linear, 0.0), np.where(there, motion.angular, 0.0))


_STAMP = 12     # bytes of a message before the frame: encapsulation header and stamp
