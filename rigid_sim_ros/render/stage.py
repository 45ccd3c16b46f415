# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A stage without a display: bodies, ground, light, shadows and a camera.

The shadow on a plane is the mesh of the bodies, pushed flat along the light. VTK's shadow maps
cost five times as much and leave light where a body touches the ground.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import pyvista
from scipy.spatial.transform import Rotation

from rigid_sim_ros.bag.motion import Array
from rigid_sim_ros.render.solids import Bodies, Plane, planes
from rigid_sim_ros.scene import Scene

_BACKGROUND = np.array([0.965, 0.975, 0.985])
_VIEW_ANGLE = 30.0                              # [deg] of the height of the picture
_FROM = np.array([0.62, -0.72, 0.42])           # where the camera stands, seen from the middle
_SUN = np.array([0.45, 0.30, -1.0])             # where the light goes
_SHADOW = 0.80                                  # of the brightness of a plane
_LINE = 0.82                                    # the same of the lines of its grid
_REACH = 14.0                                   # of a plane, in radii of what is to be seen
_LIFT = 4e-4                                    # of shadow and grid, in distances of the camera
_MANY = 8                                       # bodies of which each counts for the camera
_LEFT_OUT = 2.0                                 # [%] of their places on each side, if more
_MARGIN = 1.10                                  # around them
_LEAST_RADIUS = 1e-3                            # [m]


class View(NamedTuple):
    """Where the camera stands and looks, and how much there is to be seen."""

    eye: Array          # [m]
    target: Array       # [m]
    radius: float       # [m] of a ball about the target that holds what moves


class Stage:
    """Draws a scene with its bodies at given poses."""

    def __init__(self, scene: Scene, view: View, size: tuple[int, int]) -> None:
        """Prepare pictures of size width, height in pixels."""
        self._bodies = Bodies(scene)
        self._planes = list(planes(scene))
        self._shadows: list[Any] = [None] * len(self._planes)
        self._floors: list[Any] = []
        self._plotter: Any = pyvista.Plotter(
            off_screen=True, window_size=list(size), lighting='none')
        plotter: Any = self._plotter
        plotter.set_background(tuple(_BACKGROUND))
        plotter.add_light(pyvista.Light(position=-10 * _SUN, light_type='scene light',
                                        intensity=0.85))
        plotter.add_light(pyvista.Light(light_type='headlight', intensity=0.25))
        plotter.camera.position = tuple(view.eye)
        plotter.camera.focal_point = tuple(view.target)
        plotter.camera.up = _up(view)
        plotter.camera.view_angle = _VIEW_ANGLE
        if self._bodies.mesh.n_points:
            actor = plotter.add_mesh(
                self._bodies.mesh, scalars='color', rgb=True, show_scalar_bar=False, ambient=0.3,
                diffuse=0.8, specular=0.12, specular_power=25)
            actor.prop.interpolation = 'Phong'
        self._lift = _LIFT * float(np.linalg.norm(view.eye - view.target))
        for plane in self._planes:
            self._add_plane(plane, view)
        plotter.enable_anti_aliasing('ssaa')
        self._is_open = False

    def picture(self, p_WB: Array, q_WB: Array) -> Any:
        """
        Return the picture of the bodies at these poses, (height, width, 3) bytes.

        p_WB is (n, 3) in m, q_WB (n, 4) as x, y, z, w.
        """
        self._bodies.move(p_WB, q_WB)
        for k, plane in enumerate(self._planes):
            self._cast(k, plane, p_WB, q_WB)
        if not self._is_open:
            self._plotter.camera.reset_clipping_range()
            self._plotter.show(auto_close=False)
            self._is_open = True
        self._plotter.renderer.ResetCameraClippingRange()
        self._plotter.render()
        return self._plotter.screenshot(return_img=True)

    def close(self) -> None:
        """Give back what the graphics library holds."""
        self._plotter.close()

    def _add_plane(self, plane: Plane, view: View) -> None:
        """Draw a plane about the place that lies before the camera; it fades into the distance."""
        turn = Rotation.from_quat(plane.orientation)
        n = turn.apply(plane.normal)
        height = n @ (view.target - plane.position) - plane.offset
        middle = view.target - height * n
        color = 0.5 + 0.5 * np.array(plane.color)       # lighter: it fills the picture
        if n[2] < 0.9:
            reach = 1.5 * view.radius
            self._plotter.add_mesh(pyvista.Plane(
                center=middle, direction=n, i_size=2 * reach, j_size=2 * reach),
                color=color, ambient=0.4, diffuse=0.6, opacity=0.6)
            return
        reach = _REACH * view.radius
        disc = pyvista.Disc(center=middle, normal=n, inner=0.0, outer=reach, r_res=24, c_res=90)
        self._add_faded(disc, middle, reach, color)
        grid = _grid(middle, n, reach, _spacing(view.radius))
        grid.points = (grid.points + 2 * self._lift * n).astype('f4')
        self._add_faded(grid, middle, reach, _LINE * color, line_width=1.5)

    def _add_faded(self, surface: Any, middle: Array, reach: float, color: Array,
                   **options: Any) -> None:
        """Draw a surface whose colour becomes that of the background at some distance."""
        far = np.linalg.norm(surface.points - middle, axis=1)[:, None] / reach
        share = np.clip(far, 0.0, 1.0) ** 0.7
        surface.point_data['color'] = np.rint(
            255 * (color + (_BACKGROUND - color) * share)).astype(np.uint8)
        self._plotter.add_mesh(surface, scalars='color', rgb=True, lighting=False,
                               show_scalar_bar=False, **options)

    def _cast(self, k: int, plane: Plane, p_WB: Array, q_WB: Array) -> None:
        """Let the bodies throw their shadow on a plane that faces the light."""
        n = Rotation.from_quat(q_WB[plane.body]).apply(plane.normal)
        down = float(n @ _SUN)
        points = np.asarray(self._bodies.mesh.points, dtype=np.float64)
        if down >= 0.0 or not len(points) or n[2] < 0.9:
            return
        height = np.maximum((points - p_WB[plane.body]) @ n - plane.offset, 0.0)
        flat = points - (height / down)[:, None] * _SUN
        # What is below the plane throws none.
        flat += (self._lift - np.minimum(
            (points - p_WB[plane.body]) @ n - plane.offset, 0.0))[:, None] * n
        if self._shadows[k] is None:
            self._shadows[k] = pyvista.PolyData(flat.astype('f4'), self._bodies.mesh.faces)
            self._plotter.add_mesh(self._shadows[k], lighting=False, show_edges=False,
                                   color=_SHADOW * (0.5 + 0.5 * np.array(plane.color)))
        else:
            self._shadows[k].points = flat.astype('f4')


def automatic_view(positions: Array, extents: Array, aspect: float) -> View:
    """
    Return a view of bodies at all their positions, (t, n, 3), each as large as its extent (n,).

    Of many bodies some may leave the picture.
    """
    share = 0.0 if positions.shape[1] <= _MANY else _LEFT_OUT
    is_there = np.isfinite(positions).all(axis=2)      # not so before a body came
    if not is_there.any():
        positions, is_there = np.zeros_like(positions), np.ones_like(is_there)
    reach = np.broadcast_to(extents, is_there.shape)[is_there]
    positions = positions[is_there]
    low = np.percentile(positions - reach[:, None], share, axis=0)
    high = np.percentile(positions + reach[:, None], 100.0 - share, axis=0)
    target = 0.5 * (low + high)
    radius = max(0.5 * float(np.linalg.norm(high - low)), _LEAST_RADIUS)
    back = _FROM / np.linalg.norm(_FROM)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    # A ball of radius e at (x, y) beside the line of sight and z towards the eye is in the picture
    # of half angle a if the eye is at least z + (|x| + e / cos a) / tan a away.
    from_target = positions - target
    half = math.tan(math.radians(_VIEW_ANGLE) / 2)
    distance = radius
    for axis, slope in ((right, half * aspect), (np.cross(back, right), half)):
        beside = np.abs(from_target @ axis) + reach * math.hypot(1.0, slope)
        needed = from_target @ back + beside / slope
        distance = max(distance, float(np.percentile(needed, 100.0 - share)))
    return View(target + _MARGIN * distance * back, target, radius)


def at_hand(view: View) -> View:
    """Return a view that holds what its camera sees about its target, and no more."""
    distance = float(np.linalg.norm(view.eye - view.target))
    return view._replace(radius=distance * math.sin(math.radians(_VIEW_ANGLE) / 2))


def _up(view: View) -> tuple[float, float, float]:
    """Return what is up in the picture: z, unless the camera looks along it."""
    line = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    return (0.0, 0.0, 1.0) if abs(line[2]) < 0.999 else (0.0, 1.0, 0.0)


def _spacing(radius: float) -> float:
    """Return 1, 2 or 5 times a power of ten [m], so that some ten lines cross what is seen."""
    rough = radius / 3.0
    power = 10.0 ** math.floor(math.log10(rough))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= rough)


def _grid(middle: Array, normal: Array, reach: float, spacing: float) -> Any:
    """Return the lines of a grid on a plane, at whole multiples of the spacing."""
    turn, _ = Rotation.align_vectors(normal[None], [[0.0, 0.0, 1.0]])
    u, v, _ = turn.as_matrix().T
    count = int(reach / spacing)
    pieces = 24     # of a line, so that its colour can change along it
    lines = []
    for along, across in ((u, v), (v, u)):
        at = np.round(middle @ across / spacing)
        for k in range(-count, count + 1):
            offset = (at + k) * spacing - middle @ across
            half = math.sqrt(max(reach ** 2 - offset ** 2, 0.0))
            center = middle + offset * across
            if half:
                lines.append(pyvista.Line(
                    center - half * along, center + half * along, resolution=pieces))
    return pyvista.merge(lines, merge_points=False)
