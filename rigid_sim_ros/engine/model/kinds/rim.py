# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rim of a disc that is a flat face of a shape: its corners, and the points near a plane."""

import math

from rigid_sim_ros.engine.maths.algebra import add_scaled, cross, dot, scale
from rigid_sim_ros.engine.maths.pose import axis, origin, point_to_world
from rigid_sim_ros.engine.model.kinds.points import put_near_plane, write_corner
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

RIM = 8  # corners that stand for the rim of a disc
# A disc within this angle [rad] of the contact plane touches with points fixed in its rim; beyond
# it one of them is turned to the lowest point of the rim, so that what stands on the rim rolls on
# it smoothly. 0 would let the points of a cylinder at rest wander around. Between two fixed
# corners the rim is lower by 0.08 of angle and radius: 1e-2 would let it sink in by a thousandth
# of the radius.
UPRIGHT = 1e-5


@kernel
def rim_corners(pose: Array, s: int, r: float, z: float, n: Vector, e: float,
                corners: Array) -> tuple[int, int]:
    """
    Write the corners of the rim of a disc of radius r at z [m] of frame S; return how many.

    Anticlockwise seen from outside, which is along e = 1 or -1 times the axis z. One of them is
    turned towards n, in S. Returns the name of the face too.
    """
    across = math.sqrt(n[0] * n[0] + n[1] * n[1])
    x, y = (n[0] / across, n[1] / across) if across > UPRIGHT else (1.0, 0.0)
    for k in range(RIM):
        angle = e * 2.0 * math.pi * k / RIM
        c, d = r * math.cos(angle), r * math.sin(angle)
        write_corner(corners, k, point_to_world(pose, s, (c * x - d * y, c * y + d * x, z)))
    return RIM, (2 if across > UPRIGHT else 4) + (1 if e > 0.0 else 0)


@kernel
def down_the_rim(pose: Array, s: int, n: Vector) -> tuple[Vector, int]:
    """
    Return the direction, world axes, from the middle of a disc to the lowest point of its rim.

    And the feature of that point: 8, or 0 where the disc is upright on the plane with the normal
    n and the direction is the axis x of S.
    """
    Z = axis(pose, s, 2)
    rising = dot(n, Z)
    down = add_scaled(scale(rising, Z), -1.0, n)
    sine = math.sqrt(dot(down, down))
    if sine > UPRIGHT:
        return scale(1.0 / sine, down), 8
    return axis(pose, s, 0), 0


@kernel
def put_rim(pose: Array, s: int, r: float, z: float, X: Vector, first: int, n: Vector, p: Vector,
            margin: float, points: Array, ids: IntArray) -> int:
    """Take four points around the rim of a disc at z [m], from X on; return their number."""
    Z = axis(pose, s, 2)
    Y = cross(Z, X)
    cap = add_scaled(origin(pose, s), z, Z)
    count = put_near_plane(points, ids, 0, n, p, add_scaled(cap, r, X), first, margin)
    count = put_near_plane(points, ids, count, n, p, add_scaled(cap, r, Y), first + 1, margin)
    count = put_near_plane(points, ids, count, n, p, add_scaled(cap, -r, X), first + 2, margin)
    return put_near_plane(points, ids, count, n, p, add_scaled(cap, -r, Y), first + 3, margin)
