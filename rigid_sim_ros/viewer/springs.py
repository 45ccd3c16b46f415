# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The springs of a scene: lines between the points that they pull at."""
import numpy as np
from scipy.spatial.transform import Rotation
import viser

from rigid_sim_ros.scene import Scene
from rigid_sim_ros.viewer.motion import Array, Motion
from rigid_sim_ros.viewer.stage import Stage

# The forces that act between two points; of the others no line would say anything.
_TYPES = ('spring', 'hold_point')
_COLOR = (0, 158, 115)
_WIDTH = 3.0    # px
_WORLD = -1


class Ends:
    """One end of each spring: a point of a body, or of the world."""

    def __init__(self, bodies: list[int], points: list[Array]) -> None:
        self._bodies = np.array(bodies, dtype=np.intp)
        self._moves = self._bodies != _WORLD
        self._points = np.reshape(points, (-1, 3))      # [m] in the axes of the body

    def places(self, motion: Motion) -> Array:
        """Return where the ends are in the world, (k, 3) [m]."""
        p = self._points.copy()
        rows = self._bodies[self._moves]
        if len(rows):
            p[self._moves] = motion.position[rows] + motion.rotation[rows].apply(p[self._moves])
        return p


class Springs:
    """All springs of a scene in one node of line segments."""

    def __init__(self, scene: viser.SceneApi, stage: Stage) -> None:
        self._ends = spring_ends(stage.scene)
        self._handle = scene.add_line_segments(
            '/springs', np.zeros((1, 2, 3)), _COLOR, thickness=_WIDTH, thickness_units='screen',
            visible=False)
        self._is_shown = False

    def follow(self, motion: Motion) -> None:
        """Draw the springs where they are now."""
        lines = np.stack([ends.places(motion) for ends in self._ends], axis=1)
        if len(lines):
            self._handle.points = lines.astype(np.float32)
            self._show(True)

    def clear(self) -> None:
        """Draw them no longer."""
        self._show(False)

    def remove(self) -> None:
        """Take them out of the page."""
        self._handle.remove()

    def _show(self, wanted: bool) -> None:
        if wanted != self._is_shown:
            self._is_shown = wanted
            self._handle.visible = wanted


def spring_ends(scene: Scene) -> tuple[Ends, Ends]:
    """Return both ends of all springs, in the order of the scene."""
    frames = scene.spec.all_frames()

    def resolve(frame: str, point: Array) -> tuple[int, Array]:
        if frame not in frames:
            return _WORLD, point
        k, pose = frames[frame]
        return k, pose.position + Rotation.from_quat(pose.orientation).apply(point)

    springs = [force for force in scene.spec.forces if force.type in _TYPES]
    a = [resolve(force.a, np.zeros(3)) for force in springs]
    b = [resolve(force.b, np.array(force.anchor)) for force in springs]
    first, second = (Ends([k for k, _ in end], [p for _, p in end]) for end in (a, b))
    return first, second
