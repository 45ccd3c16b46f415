# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the bodies of a scene are drawn with.

All spheres, boxes and cylinders of a scene are one unit sphere, box and cylinder, scaled: the
page draws those of one form in one go, however many they are. A capsule is a tube and two domes.
A mesh is a form of its own, shared by the bodies that have the same one. Planes are not here: they
are drawn as grids.
"""
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import trimesh

from rigid_sim_ros.scene import Scene
from rigid_sim_ros.scene.appearance import body_color
from rigid_sim_ros.viewer.motion import Array

SPHERE, BOX, CYLINDER, DOME, TUBE = 'sphere', 'box', 'cylinder', 'dome', 'tube'

_PARTICLE_SHARE = 0.04      # diameter of a particle as a share of the extent of its body
_LEAST_PARTICLE = 1e-3      # m
# How round a ball is: its rings from pole to pole, and the sides of each ring. Scenes of many
# round bodies take the next coarser ones: without a graphics card a thousand triangles are a
# millisecond.
_ROUNDNESS = ((16, 24), (12, 18), (8, 12), (6, 10))
_TRIANGLES = 12_000
# [rad] Edges where faces meet at less than this are shaded round.
_ROUND = 0.6


class Surface(NamedTuple):
    """The triangles of a form."""

    vertices: Array     # (v, 3)
    faces: Array        # (f, 3) indices of vertices


class Solid(NamedTuple):
    """One form at a place of a body."""

    body: int
    form: str
    scale: Sequence[float]                                  # m, along the axes of the form
    position: Sequence[float] = (0.0, 0.0, 0.0)             # m, in the body frame
    orientation: Sequence[float] = (0.0, 0.0, 0.0, 1.0)     # form to body, x, y, z, w


class Plane(NamedTuple):
    """A plane of a fixed body."""

    body: int
    position: Sequence[float]       # m, in the body frame
    orientation: Sequence[float]    # turns z to the normal, x, y, z, w


class Shapes:
    """The solids of a scene, the surfaces that they refer to, and the colours of the bodies."""

    def __init__(self, scene: Scene) -> None:
        self.solids: list[Solid] = []
        self.planes: list[Plane] = []
        self.surfaces: dict[str, Surface] = {}
        self._meshes: dict[Any, str] = {}
        for index, body in enumerate(scene.spec.bodies):
            for _, part in body.parts():
                if part.type == 'plane':
                    self.planes.append(_plane(index, part))
                elif part.type == 'mesh':
                    self.solids.append(self._mesh(index, part))
                else:
                    self.solids += _SOLIDS[part.type](index, part)
        rings, sides = _roundness(self.solids)
        for form in sorted({solid.form for solid in self.solids} - set(self.surfaces)):
            self.surfaces[form] = _shaded(_UNITS[form](rings, sides))
        self.colors = [body_color(scene.spec, k) for k in range(len(scene.spec.bodies))]

    def _mesh(self, index: int, part: Any) -> Solid:
        key = part.vertices, part.faces
        if key not in self._meshes:
            name = self._meshes[key] = f'mesh_{len(self._meshes)}'
            self.surfaces[name] = _shaded(
                trimesh.Trimesh(np.array(part.vertices), np.array(part.faces)))
        return Solid(index, self._meshes[key], part.scale, *_place(part))


def _place(part: Any) -> tuple[Sequence[float], Sequence[float]]:
    return part.pose.position, part.pose.orientation


def _sphere(body: int, part: Any) -> Iterable[Solid]:
    yield Solid(body, SPHERE, (2 * part.radius,) * 3, *_place(part))


def _box(body: int, part: Any) -> Iterable[Solid]:
    yield Solid(body, BOX, part.size, *_place(part))


def _cylinder(body: int, part: Any) -> Iterable[Solid]:
    yield Solid(body, CYLINDER, (2 * part.radius, 2 * part.radius, part.length), *_place(part))


def _capsule(body: int, part: Any) -> Iterable[Solid]:
    p, q = _place(part)
    width = 2 * part.radius
    yield Solid(body, TUBE, (width, width, part.length), p, q)
    x, y, z, w = q
    for end, turn in ((0.5, q), (-0.5, (w, z, -y, -x))):    # the latter: half a turn about x first
        tip = _turned(q, (0.0, 0.0, end * part.length)) + p
        yield Solid(body, DOME, (width,) * 3, tip.tolist(), turn)


def _points(body: int, part: Any) -> Iterable[Solid]:
    extent = float(np.ptp(np.array(part.positions), axis=0).max())
    diameter = max(_PARTICLE_SHARE * extent, _LEAST_PARTICLE)
    p, q = _place(part)
    for point in part.positions:
        yield Solid(body, SPHERE, (diameter,) * 3, (_turned(q, point) + p).tolist())


def _plane(body: int, part: Any) -> Plane:
    normal = np.array(part.normal) / np.linalg.norm(part.normal)
    x, y, z = normal
    # The shortest turn from the z axis to the normal: axis z x n, half angle from 1 + cos. It is
    # not defined for n = -z, where half a turn about x does.
    turn = np.array([-y, x, 0.0, 1.0 + z]) if z > -1.0 + 1e-9 else np.array([1.0, 0.0, 0.0, 0.0])
    return Plane(body, part.offset * normal, turn / np.linalg.norm(turn))


def _turned(q: Sequence[float], v: Sequence[float]) -> Array:
    axis, r = np.array(q[:3]), np.array(v)
    t = 2.0 * np.cross(axis, r)
    return np.asarray(r + q[3] * t + np.cross(axis, t))


_SOLIDS: dict[str, Callable[[int, Any], Iterable[Solid]]] = {
    'box': _box,
    'capsule': _capsule,
    'cylinder': _cylinder,
    'points': _points,
    'sphere': _sphere,
}


def _shaded(mesh: trimesh.Trimesh) -> Surface:
    """Give the faces on both sides of a sharp edge vertices, and so normals, of their own."""
    smooth = trimesh.graph.smooth_shade(mesh, angle=_ROUND)
    return Surface(np.array(smooth.vertices), np.array(smooth.faces))


def _roundness(solids: Sequence[Solid]) -> tuple[int, int]:
    """Return rings and sides of a ball that such a number of round solids can afford."""
    share = {SPHERE: 1.0, DOME: 0.5}
    balls = sum(share.get(solid.form, 0.0) for solid in solids)
    for rings, sides in _ROUNDNESS:
        if 2 * rings * sides * balls <= _TRIANGLES:
            break
    return rings, sides


def _turned_profile(profile: Sequence[tuple[float, float]], sides: int) -> trimesh.Trimesh:
    """Turn a line of points (radius, height) about the z axis."""
    return trimesh.creation.revolve(np.array(profile), sections=sides)


def _arc(rings: int, lowest: float) -> list[tuple[float, float]]:
    angles = np.linspace(lowest, np.pi / 2, rings + 1)
    points = np.column_stack([0.5 * np.cos(angles), 0.5 * np.sin(angles)])
    points[-1, 0] = 0.0     # a pole is one point, also after rounding
    if lowest < 0.0:
        points[0, 0] = 0.0
    return [(x, y) for x, y in points.tolist()]


# Each takes the rings and the sides of a ball; diameters and lengths are 1 m.
_UNITS: dict[str, Callable[[int, int], trimesh.Trimesh]] = {
    SPHERE: lambda rings, sides: _turned_profile(_arc(rings, -np.pi / 2), sides),
    DOME: lambda rings, sides: _turned_profile(_arc(rings // 2, 0.0), sides),
    BOX: lambda rings, sides: trimesh.creation.box((1.0, 1.0, 1.0)),
    CYLINDER: lambda rings, sides: _turned_profile(
        [(0.0, -0.5), (0.5, -0.5), (0.5, 0.5), (0.0, 0.5)], sides),
    TUBE: lambda rings, sides: _turned_profile([(0.5, -0.5), (0.5, 0.5)], sides),
}
