# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `rotation.py` has for kernels, as Python runs it: for the numbers a scene is built of."""

from typing import Any

import numpy as np

from rigid_sim_ros.engine.maths import rotation, vector
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import in_python

add = in_python(vector.add)
cross = in_python(vector.cross)
from_matrix = in_python(rotation.from_matrix)
multiply = in_python(rotation.multiply)
rotate = in_python(rotation.rotate)
to_matrix = in_python(rotation.to_matrix)


def multiply_arrays(a: Array, b: Array) -> Array:
    """Return the products of quaternions, (..., 4) each: first the rotations b, then a."""
    return np.stack(multiply(_parts(a), _parts(b)), axis=-1)


def rotate_arrays(q: Array, v: Array) -> Array:
    """Return q v q* of vectors v, (..., 3), and unit quaternions q, (..., 4)."""
    return np.stack(rotate(_parts(q), _parts(v)), axis=-1)


def _parts(a: Array) -> Any:
    """Return the components along the last axis, arrays that the formulas take for numbers."""
    return np.moveaxis(a, -1, 0)
