# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Shapes on a plane: the corners, ends and rim points that lie lowest.

The plane is A of the manifold here; who calls turns the result over where it is B.
"""

from rigid_sim_ros.engine.detection.narrow_phase.reduce import reduce_to_four
from rigid_sim_ros.engine.maths.pose import axis, origin
from rigid_sim_ros.engine.model.kinds.table import on_plane
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def plane_shape(pose: Array, shapes: Shapes, plane: int, s: int, margin: float, points: Array,
                ids: IntArray) -> int:
    """Find the points of shape s, no sphere, within the margin of a plane; return their number."""
    n, p = axis(pose, plane, 2), origin(pose, plane)
    count = on_plane(shapes.kind[s], pose, shapes.size, s, shapes.hulls, shapes.hull[s], n, p,
                     margin, points, ids)
    return reduce_to_four(points, ids, count, n, shapes.half_width[s])
