# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The face of a shape that meets another shape, as a polygon.

Two corners are the line along which a cylinder or a capsule lies, none means that the witness
point alone will do.
"""

import math

from rigid_sim_ros.engine.maths.algebra import scale
from rigid_sim_ros.engine.maths.pose import axis, point_to_world, to_shape, to_world
from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.shapes import BOX, CAPSULE, CYLINDER, HULL, Shapes
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

RIM = 8  # corners that stand for the rim of a cylinder
# A cap within this angle [rad] of the contact plane touches with corners fixed in its rim; beyond
# it one corner is turned to the lowest point of the rim, so that a cylinder rolls on its rim
# smoothly. Between two fixed corners the rim is lower by 0.08 of angle and radius: 1e-2 would let
# it sink in by a thousandth of the radius.
UPRIGHT = 1e-5


@kernel
def outline(pose: Array, size: Array, kind: int, s: int, hulls: HullTable, hull: int, n_W: Vector,
            corners: Array) -> tuple[int, int]:
    """Write the k corners of the face of s that looks along n; return k and its name."""
    n = to_shape(pose, s, n_W)
    if kind == BOX:
        return _box_face(pose, size, s, n, corners)
    if kind == CAPSULE:
        r, half = size[s, 0], size[s, 1]
        _write(pose, s, (r * n[0], r * n[1], -half + r * n[2]), corners, 0)
        _write(pose, s, (r * n[0], r * n[1], half + r * n[2]), corners, 1)
        return 2, 0
    if kind == CYLINDER:
        return _cylinder_face(pose, size, s, n, corners)
    if kind == HULL:
        return _hull_face(pose, s, hulls, hull, n, corners)
    return 0, 0


@kernel
def _write(pose: Array, s: int, p: Vector, corners: Array, k: int) -> None:
    q = point_to_world(pose, s, p)
    corners[k, 0], corners[k, 1], corners[k, 2] = q


@kernel
def _box_face(pose: Array, size: Array, s: int, n: Vector, corners: Array) -> tuple[int, int]:
    x, y, z = size[s, 0], size[s, 1], size[s, 2]
    ax, ay, az = abs(n[0]), abs(n[1]), abs(n[2])
    for k in range(4):
        u = 1.0 if k == 1 or k == 2 else -1.0
        v = 1.0 if k >= 2 else -1.0
        # Anticlockwise from outside: the order turns over with the side.
        if ax >= ay and ax >= az:
            e = math.copysign(1.0, n[0])
            p, name = (e * x, u * y, e * v * z), 0
        elif ay >= az:
            e = math.copysign(1.0, n[1])
            p, name = (e * v * x, e * y, u * z), 2
        else:
            e = math.copysign(1.0, n[2])
            p, name = (u * x, e * v * y, e * z), 4
        _write(pose, s, p, corners, k)
    return 4, name + (1 if e > 0.0 else 0)


@kernel
def _cylinder_face(pose: Array, size: Array, s: int, n: Vector,
                   corners: Array) -> tuple[int, int]:
    r, half = size[s, 0], size[s, 1]
    across = math.sqrt(n[0] * n[0] + n[1] * n[1])
    if across > abs(n[2]):
        x, y = r * n[0] / across, r * n[1] / across
        _write(pose, s, (x, y, -half), corners, 0)
        _write(pose, s, (x, y, half), corners, 1)
        return 2, 0
    e = math.copysign(1.0, n[2])
    x, y = (n[0] / across, n[1] / across) if across > UPRIGHT else (1.0, 0.0)
    for k in range(RIM):
        angle = e * 2.0 * math.pi * k / RIM
        c, d = r * math.cos(angle), r * math.sin(angle)
        _write(pose, s, (c * x - d * y, c * y + d * x, e * half), corners, k)
    return RIM, (2 if across > UPRIGHT else 4) + (1 if e > 0.0 else 0)


@kernel
def face_normal_along(pose: Array, shapes: Shapes, s: int, n_W: Vector) -> Vector:
    """Return the normal of the flat face of s that looks along n; n itself where it has none."""
    kind = shapes.kind[s]
    if kind not in (BOX, CYLINDER, HULL):
        return n_W
    n = to_shape(pose, s, n_W)
    if kind == HULL:
        f = _face_along(shapes.hulls, shapes.hull[s], n)
        normals = shapes.hulls.normals
        return to_world(pose, s, (normals[f, 0], normals[f, 1], normals[f, 2]))
    along = 2
    if kind == BOX:
        along = 0 if abs(n[0]) >= abs(n[1]) else 1
        along = along if abs(n[along]) >= abs(n[2]) else 2
    return scale(math.copysign(1.0, n[along]), axis(pose, s, along))


@kernel
def _face_along(hulls: HullTable, hull: int, n: Vector) -> int:
    """Return the face of a hull that looks along n, in the axes of the shape."""
    best, most = 0, -math.inf
    start = hulls.first_face[hull]
    for f in range(start, start + hulls.face_count[hull]):
        along = (hulls.normals[f, 0] * n[0] + hulls.normals[f, 1] * n[1]
                 + hulls.normals[f, 2] * n[2])
        # Rounding must not change the choice between two faces from step to step.
        if along > most + 1e-6:
            best, most = f, along
    return best


@kernel
def _hull_face(pose: Array, s: int, hulls: HullTable, hull: int, n: Vector,
               corners: Array) -> tuple[int, int]:
    best = _face_along(hulls, hull, n)
    for k in range(hulls.corner_count[best]):
        v = hulls.corners[hulls.first_corner[best] + k]
        _write(pose, s, (hulls.vertices[v, 0], hulls.vertices[v, 1], hulls.vertices[v, 2]),
               corners, k)
    return hulls.corner_count[best], best - hulls.first_face[hull]
