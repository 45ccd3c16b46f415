# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Vectors and rotations as real calls, for code that branches.

The functions of `vector` and `rotation` are pasted into their callers, which lets loops over
bodies vectorise. Code that branches at every turn would not vectorise anyway; calls compile four
times as fast, and LLVM inlines them just as well.
"""

import math

from rigid_sim_ros.engine.maths import rotation, vector
from rigid_sim_ros.kernels.arrays import Vector
from rigid_sim_ros.kernels.kernel import kernel

dot = kernel(vector.dot.py_func)  # type: ignore[attr-defined]
cross = kernel(vector.cross.py_func)  # type: ignore[attr-defined]
add = kernel(vector.add.py_func)  # type: ignore[attr-defined]
subtract = kernel(vector.subtract.py_func)  # type: ignore[attr-defined]
scale = kernel(vector.scale.py_func)  # type: ignore[attr-defined]
add_scaled = kernel(vector.add_scaled.py_func)  # type: ignore[attr-defined]
norm = kernel(vector.norm.py_func)  # type: ignore[attr-defined]
row = kernel(vector.row.py_func)  # type: ignore[attr-defined]
column = kernel(vector.column.py_func)  # type: ignore[attr-defined]
quaternion = kernel(rotation.quaternion.py_func)  # type: ignore[attr-defined]
rotate = kernel(rotation.rotate.py_func)  # type: ignore[attr-defined]


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
