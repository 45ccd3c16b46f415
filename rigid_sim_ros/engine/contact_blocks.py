# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contact manifolds in blocks of eight: what a sweep of the sequential solver reads and writes.

The wrench that one manifold exerts on body B, taken about a common point c of both bodies, has six
components, and so has the twist of B relative to A at c. With the normal n and the tangents t1, t2
= n x t1 they are sorted in two triples,

    N: force along n, torque about t1, torque about t2   (what normal impulses make)
    T: force along t1, force along t2, torque about n    (what friction makes)

A normal impulse at the point c + s t1 + t t2 is the column g = (1, t, -s) of N, and the normal
velocity there is g . twist_N. The response of the twist to a wrench is the symmetric 6 x 6 matrix
K, the sum over both bodies of

    [ 1/m - [c] J [c]   -[c] J ]
    [ J [c]              J     ]      [c] the matrix of c x, J the inverse inertia, axes n, t1, t2.

So a manifold is solved with six numbers for its state, whatever the number of its points; the
bodies are read once and written once. The impulse on A is the opposite at the same point of the
world: P and L of the pair change by nothing but rounding.

Eight manifolds that share no moving body make a block: one flat array of rows of eight numbers.
All lane loops run over range(8), without branches, with constant distances in that array: only so
does the compiler make vector instructions of them.
"""

from rigid_sim_ros.engine.arrays import Array, Vector
from rigid_sim_ros.engine.kernel import inlined, kernel
from rigid_sim_ros.engine.solver_bodies import LANES
from rigid_sim_ros.engine.vector import add, cross, dot, norm, subtract

# Rows of a block.
NORMAL = 0  # n, world axes
TANGENT = 3  # t1
ARM_A = 6  # c from the centre of mass of A [m], world axes
ARM_B = 9  # c from the centre of mass of B; before `prepare_block`: x_A - x_B
J_A = 12  # inverse inertia of A, world axes: xx, xy, xz, yy, yz, zz
J_B = 18
INV_M_A = 24
INV_M_B = 25
K_NN = 26  # 00, 01, 02, 11, 12, 22
K_TN = 32  # by rows
K_TT = 41  # 00, 01, 02, 11, 12, 22
INV_TT = 47  # inverse of the force part of K_TT: 00, 01, 11
INV_SPIN = 50  # 1 / K_TT22
SLIDE = 51  # 1 / a bound of the largest eigenvalue of the force part of K_TT
ROLL_STEP = 52  # the same for the torque part of K_NN
MU = 53  # friction coefficient
SPIN_LEVER = 54  # [m] torque about n per normal force
ROLL_LEVER = 55  # [m] torque about t1, t2 per normal force
PAIR = 56  # 1: both bodies move
FRICTION = 57  # impulses along t1, t2 [N s], about n [N m s], of this substep
ROLL = 60  # about t1, t2 [N m s]
MOVED = 62  # displacement of x_B - x_A since the start of the step [m], world axes
TORSION = 65  # angular momentum that the pair gained by it [N m s], world axes
RESIDUAL = 68  # largest change of velocity that this sweep made [m/s]
TOTAL_T = 69  # whole step: along t1, t2, about n
POINT = 72  # rows of the first point
POINT_ROWS = 7
# Of a point: TOTAL is the impulse of the whole step, SPEED the normal velocity after its last
# visit.
S, T, MASS, GAP, IMPULSE, TOTAL, SPEED = range(7)
MOTION_A = POINT + 4 * POINT_ROWS  # v, L of A: copies, for the lanes
MOTION_B = MOTION_A + 6
TWIST = MOTION_B + 6  # of B relative to A at c, N and then T
WRENCH = TWIST + 6  # what this visit added to the impulses, N and then T
SHOVE = WRENCH + 6  # impulse along n of the push that displaces [N s]
OVERLAP = SHOVE + 1  # scratch
ROWS = OVERLAP + 1
BLOCK_SIZE = ROWS * LANES
ABSENT = 1e30  # the gap of a point that is not there [m]


@inlined
def three(b: Array, row: int, i: int) -> Vector:
    """Return three rows of lane i."""
    return (b[row * LANES + i], b[(row + 1) * LANES + i], b[(row + 2) * LANES + i])


@inlined
def put_three(b: Array, row: int, i: int, v: Vector) -> None:
    """Write three rows of lane i."""
    b[row * LANES + i] = v[0]
    b[(row + 1) * LANES + i] = v[1]
    b[(row + 2) * LANES + i] = v[2]


@inlined
def symmetric(b: Array, row: int, i: int, v: Vector) -> Vector:
    """Return the product of a symmetric matrix in six rows (00, 01, 02, 11, 12, 22) with v."""
    o = row * LANES + i
    return (b[o] * v[0] + b[o + LANES] * v[1] + b[o + 2 * LANES] * v[2],
            b[o + LANES] * v[0] + b[o + 3 * LANES] * v[1] + b[o + 4 * LANES] * v[2],
            b[o + 2 * LANES] * v[0] + b[o + 4 * LANES] * v[1] + b[o + 5 * LANES] * v[2])


@kernel
def prepare_block(b: Array, points: int) -> None:
    """
    Work out frames, arms and responses of the eight manifolds of a block.

    Filled in before: NORMAL, x_A - x_B in ARM_B, J_A .. INV_M_B, MU .. PAIR, the friction impulse
    as a world vector in MOVED, FRICTION + 2, and for each of four points GAP, IMPULSE and in S, T,
    MASS where it is from the centre of mass of A [m], world axes. A point that is not there has
    the gap ABSENT, and so have all but the first in a block of one point.
    """
    _make_basis(b)
    _place_centre(b)
    _place_point(b, POINT)
    if points > 1:
        _place_point(b, POINT + POINT_ROWS)
        _place_point(b, POINT + 2 * POINT_ROWS)
        _place_point(b, POINT + 3 * POINT_ROWS)
    _add_response(b, ARM_A, J_A, INV_M_A, 0.0)
    _add_response(b, ARM_B, J_B, INV_M_B, 1.0)
    _invert(b)
    _respond_at(b, POINT)
    if points > 1:
        _respond_at(b, POINT + POINT_ROWS)
        _respond_at(b, POINT + 2 * POINT_ROWS)
        _respond_at(b, POINT + 3 * POINT_ROWS)


@kernel
def _make_basis(b: Array) -> None:
    """Choose t1 without a branch (Duff et al., J. Computer Graphics Techniques 6 (2017))."""
    for i in range(LANES):
        n = three(b, NORMAL, i)
        sign = 1.0 if n[2] >= 0.0 else -1.0
        k = -1.0 / (sign + n[2])
        t1 = (1.0 + sign * n[0] * n[0] * k, sign * n[0] * n[1] * k, -sign * n[0])
        put_three(b, TANGENT, i, t1)
        friction = three(b, MOVED, i)
        b[FRICTION * LANES + i] = dot(friction, t1)
        b[(FRICTION + 1) * LANES + i] = dot(friction, cross(n, t1))
        b[ROLL * LANES + i] = 0.0
        b[(ROLL + 1) * LANES + i] = 0.0
        put_three(b, MOVED, i, (0.0, 0.0, 0.0))
        put_three(b, TORSION, i, (0.0, 0.0, 0.0))
        put_three(b, TOTAL_T, i, (0.0, 0.0, 0.0))
        b[RESIDUAL * LANES + i] = 0.0


# Gap at which a point counts half for the centre of its manifold [m]. Smaller: friction acts where
# the bodies touch already; larger: in the middle of what is about to touch. The pressure would be
# the better weight, but where it swings to and fro the centre would swing with it, and friction
# would feed the motion.
_NEAR = 1e-4


@inlined
def _weight(b: Array, point: int, i: int) -> float:
    """Return what a point counts for the centre of its manifold."""
    gap = max(b[(point + GAP) * LANES + i], 0.0)
    return _NEAR * _NEAR / (_NEAR * _NEAR + gap * gap)


@kernel
def _place_centre(b: Array) -> None:
    """Put c amid the nearest points; friction has their mean distance as lever."""
    p0, p1, p2, p3 = POINT, POINT + POINT_ROWS, POINT + 2 * POINT_ROWS, POINT + 3 * POINT_ROWS
    for i in range(LANES):
        w0, w1, w2, w3 = _weight(b, p0, i), _weight(b, p1, i), _weight(b, p2, i), _weight(b, p3, i)
        total = w0 + w1 + w2 + w3
        inverse = 1.0 / total if total > 0.0 else 0.0
        q0, q1, q2, q3 = three(b, p0, i), three(b, p1, i), three(b, p2, i), three(b, p3, i)
        c = (inverse * (w0 * q0[0] + w1 * q1[0] + w2 * q2[0] + w3 * q3[0]),
             inverse * (w0 * q0[1] + w1 * q1[1] + w2 * q2[1] + w3 * q3[1]),
             inverse * (w0 * q0[2] + w1 * q1[2] + w2 * q2[2] + w3 * q3[2]))
        lever = (w0 * norm(subtract(q0, c)) + w1 * norm(subtract(q1, c))
                 + w2 * norm(subtract(q2, c)) + w3 * norm(subtract(q3, c)))
        put_three(b, ARM_A, i, c)
        put_three(b, ARM_B, i, add(c, three(b, ARM_B, i)))
        b[SPIN_LEVER * LANES + i] += b[MU * LANES + i] * (lever * inverse)


@inlined
def _place_point(b: Array, point: int) -> None:
    for i in range(LANES):
        n, t1 = three(b, NORMAL, i), three(b, TANGENT, i)
        r = subtract(three(b, point, i), three(b, ARM_A, i))
        b[(point + S) * LANES + i] = dot(r, t1)
        b[(point + T) * LANES + i] = dot(r, cross(n, t1))
        b[(point + TOTAL) * LANES + i] = 0.0


@inlined
def _add_response(b: Array, arm: int, inertia: int, inv_m: int, keep: float) -> None:
    """Add one body's part to `keep` K."""
    for i in range(LANES):
        n, t1, c_W = three(b, NORMAL, i), three(b, TANGENT, i), three(b, arm, i)
        t2 = cross(n, t1)
        Jn, J1 = symmetric(b, inertia, i, n), symmetric(b, inertia, i, t1)
        J2 = symmetric(b, inertia, i, t2)
        j00, j01, j02 = dot(n, Jn), dot(n, J1), dot(n, J2)
        j11, j12, j22 = dot(t1, J1), dot(t1, J2), dot(t2, J2)
        cn, c1, c2 = dot(c_W, n), dot(c_W, t1), dot(c_W, t2)
        # M = [c] J, rows and columns in the order n, t1, t2; then K_la = -M and K_ll = 1/m + M
        # [c]^T.
        m00, m01, m02 = c1 * j02 - c2 * j01, c1 * j12 - c2 * j11, c1 * j22 - c2 * j12
        m10, m11, m12 = c2 * j00 - cn * j02, c2 * j01 - cn * j12, c2 * j02 - cn * j22
        m20, m21, m22 = cn * j01 - c1 * j00, cn * j11 - c1 * j01, cn * j12 - c1 * j02
        w = b[inv_m * LANES + i]
        o = i + K_NN * LANES
        b[o] = keep * b[o] + (w + c1 * m02 - c2 * m01)
        b[o + LANES] = keep * b[o + LANES] - m01
        b[o + 2 * LANES] = keep * b[o + 2 * LANES] - m02
        b[o + 3 * LANES] = keep * b[o + 3 * LANES] + j11
        b[o + 4 * LANES] = keep * b[o + 4 * LANES] + j12
        b[o + 5 * LANES] = keep * b[o + 5 * LANES] + j22
        o = i + K_TN * LANES
        b[o] = keep * b[o] + (c1 * m12 - c2 * m11)
        b[o + LANES] = keep * b[o + LANES] - m11
        b[o + 2 * LANES] = keep * b[o + 2 * LANES] - m12
        b[o + 3 * LANES] = keep * b[o + 3 * LANES] + (c1 * m22 - c2 * m21)
        b[o + 4 * LANES] = keep * b[o + 4 * LANES] - m21
        b[o + 5 * LANES] = keep * b[o + 5 * LANES] - m22
        b[o + 6 * LANES] = keep * b[o + 6 * LANES] - m00
        b[o + 7 * LANES] = keep * b[o + 7 * LANES] + j01
        b[o + 8 * LANES] = keep * b[o + 8 * LANES] + j02
        o = i + K_TT * LANES
        b[o] = keep * b[o] + (w + c2 * m10 - cn * m12)
        b[o + LANES] = keep * b[o + LANES] + (cn * m11 - c1 * m10)
        b[o + 2 * LANES] = keep * b[o + 2 * LANES] - m10
        b[o + 3 * LANES] = keep * b[o + 3 * LANES] + (w + cn * m21 - c1 * m20)
        b[o + 4 * LANES] = keep * b[o + 4 * LANES] - m20
        b[o + 5 * LANES] = keep * b[o + 5 * LANES] + j00


@inlined
def _inverse(x: float) -> float:
    return 1.0 / x if x > 0.0 else 0.0


@kernel
def _invert(b: Array) -> None:
    """Invert what friction and rolling resistance divide by; an empty lane gets 0."""
    for i in range(LANES):
        o = i + K_TT * LANES
        k00, k01, k11 = b[o], b[o + LANES], b[o + 3 * LANES]
        inverse = _inverse(k00 * k11 - k01 * k01)
        put_three(b, INV_TT, i, (k11 * inverse, -k01 * inverse, k00 * inverse))
        b[INV_SPIN * LANES + i] = _inverse(b[o + 5 * LANES])
        # Gershgorin's bound of the largest eigenvalue.
        b[SLIDE * LANES + i] = _inverse(max(k00, k11) + abs(k01))
        o = i + K_NN * LANES
        k11, k12, k22 = b[o + 3 * LANES], b[o + 4 * LANES], b[o + 5 * LANES]
        b[ROLL_STEP * LANES + i] = _inverse(max(k11, k22) + abs(k12))


@inlined
def _respond_at(b: Array, point: int) -> None:
    """Write the mass that a normal impulse at a point moves; 0 for an absent one."""
    for i in range(LANES):
        g = (1.0, b[(point + T) * LANES + i], -b[(point + S) * LANES + i])
        there = b[(point + GAP) * LANES + i] < ABSENT
        mass = _inverse(dot(g, symmetric(b, K_NN, i, g)))
        b[(point + MASS) * LANES + i] = mass if there else 0.0
