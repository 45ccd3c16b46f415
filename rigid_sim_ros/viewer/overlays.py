# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can be switched on over the bodies: arrows, axes, names and trails."""
from collections.abc import Mapping, Sequence

import numpy as np
from rosbags.serde import SerdeError
import viser

from rigid_sim_ros.bag.topics import typestore
from rigid_sim_ros.engine.maths.rotation_in_python import rotate_arrays
from rigid_sim_ros.viewer.grip import Grip, held_point, Masses
from rigid_sim_ros.viewer.motion import Array, Motion
from rigid_sim_ros.viewer.simulation import Applied
from rigid_sim_ros.viewer.springs import Springs
from rigid_sim_ros.viewer.stage import Stage

VELOCITY, WRENCHES, CONTACTS = 'velocities', 'wrenches', 'contacts'
AXES, NAMES, TRAILS, SPRINGS = 'body axes', 'names', 'trails', 'springs'

_COLORS = {VELOCITY: (0, 114, 178), WRENCHES: (213, 94, 0), CONTACTS: (150, 0, 110)}
_GRIP = (213, 94, 0)
_NS = 1e-9
# [s] A velocity arrow shows where the body would be after this time.
_AHEAD = 0.25
# [points] of all trails together, and at most of one.
_TRAIL_POINTS, _LONGEST_TRAIL = 12_000, 240
_TRAIL_PERIOD = 0.05    # s of wall time between two of its points
_JUMP = 20.0            # body sizes: a step of this length is no motion
_EARTH = 9.81           # m/s^2
# [body widths] Arrows of forces end here: an impact is a hundred weights, off the picture.
_LONGEST_FORCE = 3.0
_FORGET = 0.6           # s of simulation time that the arrow of a wrench stays


class Arrows:
    """One node with as many arrows as are wanted."""

    def __init__(self, scene: viser.SceneApi, name: str, size: float,
                 color: tuple[int, int, int]) -> None:
        self._color = np.array(color, dtype=np.uint8)
        self._count = 0
        self._handle = scene.add_arrows(
            name, np.zeros((1, 2, 3)), color, shaft_radius=0.03 * size, head_radius=0.08 * size,
            head_length=0.2 * size, visible=False)

    def show(self, start: Array, end: Array) -> None:
        """Draw arrows from (k, 3) to (k, 3) [m], in the place of those before."""
        count = len(start)
        if count:
            self._handle.points = np.stack([start, end], axis=1).astype(np.float32)
        if bool(count) != bool(self._count):
            self._handle.visible = bool(count)
        self._count = count

    def remove(self) -> None:
        """Take them out of the page."""
        self._handle.remove()


class Overlays:
    """The overlays of one scene."""

    def __init__(self, server: viser.ViserServer, stage: Stage) -> None:
        scene, size = server.scene, stage.size
        self._scene = scene
        self._stage = stage
        self._masses = Masses(stage.scene)
        self._index = {name: k for k, name in enumerate(stage.scene.names)}
        self._frames = stage.scene.spec.all_frames()
        self._wanted: dict[str, bool] = {}
        self._shown: frozenset[str] = frozenset()
        self._arrows = {kind: Arrows(scene, f'/arrows/{kind}', size, color)
                        for kind, color in _COLORS.items()}
        self._grips = Arrows(scene, '/arrows/grips', size, _GRIP)
        self._labels: list[viser.LabelHandle] = []
        self._axes: viser.BatchedAxesHandle | None = None
        self._trails = Trails(scene, stage)
        self._springs = Springs(scene, stage)
        # [m/N] The weight of a common body is as long as the body is wide.
        self._per_newton = 2.0 * size / _common_force(stage)
        self._longest = _LONGEST_FORCE * 2.0 * size     # m

    def switch(self, kind: str, wanted: bool) -> None:
        """Show a kind of overlay from the next motion on, or no longer; any thread may call."""
        self._wanted[kind] = wanted

    def move(self, motion: Motion, now: float) -> None:
        """Follow the bodies; now [s] is wall time."""
        wanted = frozenset(kind for kind, is_on in list(self._wanted.items()) if is_on)
        for kind in self._shown - wanted:
            self._hide(kind)
        self._shown = wanted
        moving = self._stage.moving
        if VELOCITY in self._shown:
            start = motion.position[moving]
            self._arrows[VELOCITY].show(start, start + _AHEAD * motion.linear[moving])
        if AXES in self._shown:
            self._move_axes(motion)
        if NAMES in self._shown:
            self._move_names(motion)
        if TRAILS in self._shown:
            self._trails.follow(motion.position, now)
        if SPRINGS in self._shown:
            self._springs.follow(motion)

    def _hide(self, kind: str) -> None:
        if kind in self._arrows:
            self._arrows[kind].show(np.empty((0, 3)), np.empty((0, 3)))
        elif kind == TRAILS:
            self._trails.clear()
        elif kind == SPRINGS:
            self._springs.clear()
        elif kind == NAMES:
            for label in self._labels:
                label.remove()
            self._labels = []
        elif self._axes is not None:
            self._axes.remove()
            self._axes = None

    def show_wrenches(self, motion: Motion, applied: Mapping[str, Applied]) -> None:
        """Draw the forces that act on the bodies."""
        if WRENCHES not in self._shown:
            return
        starts, ends = [], []
        rotation = motion.rotation
        for body, wrench in list(applied.items()):
            age = _NS * (motion.t_ns - wrench.t_ns)
            if body not in self._index or not -_FORGET < age < _FORGET:
                continue
            k = self._index[body]
            owner, _ = self._frames.get(wrench.frame, (-1, None))
            force = np.array(wrench.force)
            if owner >= 0:
                force = rotation[owner].apply(self._in_body(wrench.frame, force))
            start = self._masses.centre(k, motion)
            if owner == k:
                start = motion.position[k] + rotation[k].apply(self._origin(wrench.frame))
            starts.append(start)
            ends.append(start + shortened(self._per_newton * force, self._longest))
        self._arrows[WRENCHES].show(np.reshape(starts, (-1, 3)), np.reshape(ends, (-1, 3)))

    def _in_body(self, name: str, force: Array) -> Array:
        return rotate_arrays(np.array(self._frames[name][1].orientation), force)

    def _origin(self, name: str) -> Array:
        return np.array(self._frames[name][1].position)

    def show_contacts(self, lines: Array) -> None:
        """Draw the contact forces: lines (k, 2, 3) [m]."""
        if CONTACTS in self._shown:
            start = lines[:, 0]
            self._arrows[CONTACTS].show(
                start, start + shortened(lines[:, 1] - start, self._longest))

    def show_grips(self, motion: Motion, grips: Sequence[Grip]) -> None:
        """Draw a line from each held point to the mouse that pulls it."""
        starts = np.array([held_point(hand, motion) for hand in grips]).reshape(-1, 3)
        self._grips.show(starts, np.array([hand.target for hand in grips]).reshape(-1, 3))

    def remove(self) -> None:
        """Take everything out of the page."""
        for kind in self._shown & {AXES, NAMES}:
            self._hide(kind)
        for arrows in (*self._arrows.values(), self._grips):
            arrows.remove()
        self._trails.remove()
        self._springs.remove()

    def _move_axes(self, motion: Motion) -> None:
        wxyzs = motion.orientation[:, [3, 0, 1, 2]]
        if self._axes is None:
            length = 1.5 * self._stage.size
            self._axes = self._scene.add_batched_axes(
                '/axes', wxyzs, motion.position, axes_length=length, axes_radius=0.03 * length)
        self._axes.batched_positions = motion.position.astype(np.float32)
        self._axes.batched_wxyzs = wxyzs.astype(np.float32)

    def _move_names(self, motion: Motion) -> None:
        moving = self._stage.moving
        if not self._labels:
            # What has a slash in its name would move with what is named before it.
            self._labels = [self._scene.add_label(f'/names/{name.replace("/", ".")}', name,
                                                  anchor='bottom-center')
                            for name in (self._stage.scene.names[k] for k in moving)]
        for label, p in zip(self._labels, motion.position[moving], strict=True):
            label.position = p


def shortened(vectors: Array, most: float) -> Array:
    """Return vectors (..., 3) of the same directions, none of them longer than `most`."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors * (most / np.maximum(length, most)))


def _common_force(stage: Stage) -> float:
    """Return the weight [N] of a common body; where nothing weighs, what speeds it up by 1 g."""
    model = stage.scene.model
    masses = model.m[stage.moving]
    gravity = float(np.linalg.norm(model.gravity)) or _EARTH
    return float(np.median(masses)) * gravity if len(masses) else 1.0


class Trails:
    """Where the bodies came along lately: all of them in one node of line segments."""

    def __init__(self, scene: viser.SceneApi, stage: Stage) -> None:
        self._bodies = stage.moving
        self._jump = _JUMP * stage.size
        self._length = min(_LONGEST_TRAIL, max(2, _TRAIL_POINTS // max(1, len(self._bodies))))
        self._points: list[Array] = []      # (bodies, 3) each
        self._due = 0.0
        self._colors = np.round(255 * stage.colors[self._bodies]).astype(np.uint8)
        # Colours for each end from the beginning: viser draws white what gets them later.
        self._handle = scene.add_line_segments(
            '/trails', np.zeros((1, 2, 3)), np.zeros((1, 2, 3), np.uint8), thickness=2.0,
            thickness_units='screen', visible=False)

    def follow(self, position: Array, now: float) -> None:
        """Add a point to each trail, unless the last one is only just there."""
        if now < self._due or not len(self._bodies):
            return
        self._due = now + _TRAIL_PERIOD
        p = position[self._bodies]
        if self._points and np.abs(p - self._points[-1]).max() > self._jump:
            self._points = []       # a reset, or a body that was put elsewhere
        self._points = [*self._points[-(self._length - 1):], p]
        if len(self._points) < 2:
            return
        line = np.stack(self._points)
        segments = np.stack([line[:-1], line[1:]], axis=2).reshape(-1, 2, 3)
        colors = np.tile(self._colors, (len(line) - 1, 1))
        self._handle.points = segments.astype(np.float32)
        self._handle.colors = np.repeat(colors[:, None], 2, axis=1)
        self._handle.visible = True

    def clear(self) -> None:
        """Forget the way so far."""
        self._points = []
        self._handle.visible = False

    def remove(self) -> None:
        """Take them out of the page."""
        self._handle.remove()


def contact_lines(data: bytes) -> Array | None:
    """
    Return the lines of the contact forces in a MarkerArray, (k, 2, 3) [m].

    None if the message does not tell of contacts.
    """
    if _CONTACT_FORCES not in data:
        return None
    try:
        array = typestore().deserialize_cdr(data, 'visualization_msgs/msg/MarkerArray')
    except (SerdeError, ValueError, IndexError):
        return None
    by_name = {marker.ns: marker.points for marker in array.markers}
    # The shafts of the arrows come first, one for each contact point, then their barbs.
    count = len(by_name.get('contact_points', ()))
    ends = by_name.get('contact_forces', ())[:2 * count]
    return np.array([(p.x, p.y, p.z) for p in ends]).reshape(-1, 2, 3)


_CONTACT_FORCES = b'contact_forces\0'
