# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Vectors and shape poses for the narrow phase, as real calls.

The functions of `vector` are pasted into their callers, which lets loops over bodies vectorise.
The narrow phase branches at every turn and would not vectorise anyway; calls compile four times as
fast and LLVM inlines them just as well.
"""

import math

from rigid_sim_ros.engine import vector
from rigid_sim_ros.engine.arrays import Array, IntArray, Vector
from rigid_sim_ros.engine.kernel import kernel

dot = kernel(vector.dot.py_func)  # type: ignore[attr-defined]
cross = kernel(vector.cross.py_func)  # type: ignore[attr-defined]
add = kernel(vector.add.py_func)  # type: ignore[attr-defined]
subtract = kernel(vector.subtract.py_func)  # type: ignore[attr-defined]
scale = kernel(vector.scale.py_func)  # type: ignore[attr-defined]
add_scaled = kernel(vector.add_scaled.py_func)  # type: ignore[attr-defined]
norm = kernel(vector.norm.py_func)  # type: ignore[attr-defined]


@kernel
def origin(pose: Array, s: int) -> Vector:
    """Return the origin of shape s [m, world axes]."""
    return (pose[s, 0], pose[s, 1], pose[s, 2])


@kernel
def axis(pose: Array, s: int, k: int) -> Vector:
    """Return axis k of the frame of shape s, world axes: column k of its rotation matrix."""
    return (pose[s, 3 + k], pose[s, 6 + k], pose[s, 9 + k])


@kernel
def to_world(pose: Array, s: int, v: Vector) -> Vector:
    """Return R v: a direction of frame S in world axes."""
    return (pose[s, 3] * v[0] + pose[s, 4] * v[1] + pose[s, 5] * v[2],
            pose[s, 6] * v[0] + pose[s, 7] * v[1] + pose[s, 8] * v[2],
            pose[s, 9] * v[0] + pose[s, 10] * v[1] + pose[s, 11] * v[2])


@kernel
def to_shape(pose: Array, s: int, v: Vector) -> Vector:
    """Return R^T v: a direction of the world in axes of S."""
    return (pose[s, 3] * v[0] + pose[s, 6] * v[1] + pose[s, 9] * v[2],
            pose[s, 4] * v[0] + pose[s, 7] * v[1] + pose[s, 10] * v[2],
            pose[s, 5] * v[0] + pose[s, 8] * v[1] + pose[s, 11] * v[2])


@kernel
def point_to_world(pose: Array, s: int, p: Vector) -> Vector:
    """Return the point p of frame S [m] in the world."""
    return add(origin(pose, s), to_world(pose, s, p))


@kernel
def point_to_shape(pose: Array, s: int, p: Vector) -> Vector:
    """Return the point p of the world [m] in frame S."""
    return to_shape(pose, s, subtract(p, origin(pose, s)))


@kernel
def clamp(value: float, low: float, high: float) -> float:
    """Return the nearest number of [low, high]."""
    return min(max(value, low), high)


@kernel
def perpendicular(v: Vector) -> Vector:
    """Return a unit vector at right angles to the unit vector v."""
    # Crossed with the axis that v is farthest from: the result is never short.
    w = (0.0, v[2], -v[1]) if abs(v[0]) < 0.6 else (-v[2], 0.0, v[0])
    return scale(1.0 / math.sqrt(dot(w, w)), w)


@kernel
def put(points: Array, ids: IntArray, k: int, p: Vector, gap: float, feature: int) -> None:
    """Write candidate k of a manifold: the point on A [m, world axes], gap [m], feature."""
    points[k, 0] = p[0]
    points[k, 1] = p[1]
    points[k, 2] = p[2]
    points[k, 3] = gap
    ids[k] = feature
