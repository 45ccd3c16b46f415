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

    [ 1/m - [c] inv_I_W [c]   -[c] inv_I_W ]
    [ inv_I_W [c]              inv_I_W     ]      [c] the matrix of c x, axes n, t1, t2.

So a manifold is solved with six numbers for its state, whatever the number of its points; the
bodies are read once and written once. The impulse on A is the opposite at the same point of the
world: P and L of the pair change by nothing but rounding.

Eight manifolds that share no moving body make a block: one flat array of rows of eight numbers,
which are worked on side by side.
"""

from typing import TypeAlias

from rigid_sim_ros.engine.maths.vector import add, cross, dot, scale, subtract, symmetric_times
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.eight import Eight, LANES, load, root, select, store
from rigid_sim_ros.kernels.kernel import part

Two: TypeAlias = tuple[Eight, Eight]
Three: TypeAlias = tuple[Eight, Eight, Eight]
Six: TypeAlias = tuple[Eight, Eight, Eight, Eight, Eight, Eight]
Nine: TypeAlias = tuple[Eight, Eight, Eight, Eight, Eight, Eight, Eight, Eight, Eight]
# v [m/s] and L [kg m^2/s] of the bodies of a block, world axes, and what SolverBodies.motion holds
# besides: the inverse mass and, of a ball, the inverse inertia.
Motion: TypeAlias = tuple[Eight, Eight, Eight, Eight, Eight, Eight, Eight, Eight]

# Rows of a block. Balls do without the first of them, see BALLS_BEGIN:
ARM_A = 0  # c from the centre of mass of A [m], world axes
ARM_B = 3  # c from the centre of mass of B; before `prepare_block`: x_A - x_B
INV_I_A = 6  # inverse inertia of A, world axes: xx, xy, xz, yy, yz, zz
INV_I_B = 12
INV_TT = 18  # inverse of the force part of K_TT: 00, 01, 11
K_SPIN = 21  # K_TT02 and K_TT12: how a torque about n makes a pair slide
INV_SPIN = 23  # 1 / K_TT22
SPIN_LEVER = 24  # [m] torque about n per normal force
PER_LEVER = 25  # [1/m] friction force per torque about n, each at its limit
SPIN_SLIDE = 26  # SLIDE / PER_LEVER^2
SPIN = 27  # impulse about n of this substep [N m s]
SPIN_ASIDE = 28  # see IMPULSE_ASIDE
# All blocks have these:
SHOVE = 29  # impulse along n of the push that displaces [N s]; means nothing unless SHOVED
NORMAL = 30  # n, world axes
BASIS = 33  # a number from which t1 follows, see `make_basis`
MU = 34  # friction coefficient
SLIDE = 35  # how long the steps of sliding friction may be, see `_prepare_friction` [kg]
FRICTION = 36  # impulses along t1, t2 of this substep [N s]
TORSION = 38  # a part of the angular momentum that the pair gained by having moved [N m s]
TOTAL_T = 41  # friction of the substeps before, along t1, t2 [N s]
FRICTION_ASIDE = 43  # see IMPULSE_ASIDE, along t1, t2
SIZE = 45  # [m] of the smaller shape: all lengths that are tolerances are parts of it
TURN_T = 46  # see TURN, along t1, t2
POINT = 48  # rows of the first point
POINT_ROWS = 9
# Of a point: TOTAL is the impulse of the substeps before, SPEED the normal velocity after its last
# visit, of balls only where one overlaps. IMPULSE_ASIDE is its impulse of the last substep while
# an impact is solved, which has impulses of its own. When that is over, the same row is APPROACH:
# how fast the point still approaches [m/s], where the visits to an impact came to their limit.
# TURN [m/s] is how much the geometry of the contact alone changes the normal velocity in a step,
# see contact_prediction.py.
S, T, MASS, GAP, IMPULSE, TOTAL, SPEED, IMPULSE_ASIDE, TURN = range(9)
APPROACH = IMPULSE_ASIDE
# A small block, of manifolds that have one point and do not resist rolling, ends with this:
K_N = POINT + POINT_ROWS  # response along n, t1, t2 and about n to the normal impulse
SMALL_ROWS = K_N + 4
# Balls: c lies on the normal through both centres, inertia is a number, and nothing resists
# spinning. Instead of S, T they have the way from the centres of mass along n to c [m], and in
# place of a bound 1 / K_TT00, which is 1 / K_TT11 too. Only what overlaps needs their first row
# and their last.
LEVER_A, LEVER_B = POINT + S, POINT + T
STICK = SLIDE
BALLS_BEGIN, BALLS_END = SHOVE, POINT + POINT_ROWS
# The others have four points instead, and the rest of K.
K_NN = POINT + 4 * POINT_ROWS  # 00, 01, 02, 11, 12, 22
K_TN = K_NN + 6  # by rows
ROLL = K_TN + 9  # impulses about t1, t2 [N m s]
ROLL_ASIDE = ROLL + 2  # see IMPULSE_ASIDE
ROLL_STEP = ROLL_ASIDE + 2  # 1 / the largest eigenvalue of the torque part of K_NN
ROLL_LEVER = ROLL_STEP + 1  # [m] torque about t1, t2 per normal force
SHOVE_TURN = ROLL_LEVER + 1  # of small islands: impulses about t1, t2 of the push [N m s]
PRESSED = SHOVE_TURN + 2  # the centre of pressure of the last step, from c along t1, t2 [m]
ROWS = PRESSED + 2
BLOCK_SIZE = ROWS * LANES
SMALL_SIZE = SMALL_ROWS * LANES
BALLS_SIZE = (BALLS_END - BALLS_BEGIN) * LANES
ABSENT = 1e30  # the gap of a point that is not there [m]


@part
def load_two(b: Array, row: int) -> Two:
    """Return two rows."""
    return (load(b, row), load(b, row + 1))


@part
def load_three(b: Array, row: int) -> Three:
    """Return three rows."""
    return (load(b, row), load(b, row + 1), load(b, row + 2))


@part
def store_two(b: Array, row: int, v: Two) -> None:
    """Write two rows."""
    store(b, row, v[0])
    store(b, row + 1, v[1])


@part
def store_three(b: Array, row: int, v: Three) -> None:
    """Write three rows."""
    store(b, row, v[0])
    store(b, row + 1, v[1])
    store(b, row + 2, v[2])


@part
def symmetric(b: Array, row: int, v: Three) -> Three:
    """Return the product of a symmetric matrix in six rows (00, 01, 02, 11, 12, 22) with v."""
    return symmetric_times(load_three(b, row), load_three(b, row + 3), v)


@part
def friction_of(b: Array) -> Three:
    """Return the impulses of friction in this substep, as far as not only balls have them."""
    return (load(b, FRICTION), load(b, FRICTION + 1), load(b, SPIN))


@part
def keep_friction(b: Array, impulse: Three) -> None:
    """Write what `friction_of` returns."""
    store(b, FRICTION, impulse[0])
    store(b, FRICTION + 1, impulse[1])
    store(b, SPIN, impulse[2])


@part
def normal_sum(b: Array, points: int) -> Eight:
    """Return the sum of the normal impulses [N s]."""
    total = load(b, POINT + IMPULSE)
    for p in range(1, 4 if points > 1 else 1):
        total = total + load(b, POINT + p * POINT_ROWS + IMPULSE)
    return total


@part
def begin_sums(b: Array, points: int) -> None:
    """Let no substep have been yet."""
    store_three(b, TORSION, (0.0, 0.0, 0.0))
    store_two(b, TOTAL_T, (0.0, 0.0))
    for p in range(4 if points > 1 else 1):
        store(b, POINT + p * POINT_ROWS + TOTAL, 0.0)


@part
def total_of(b: Array, points: int, share: float) -> Three:
    """Return the impulses of the substeps before and a share of this one's along n, t1, t2."""
    along = load(b, POINT + TOTAL) + share * load(b, POINT + IMPULSE)
    for p in range(1, 4 if points > 1 else 1):
        point = POINT + p * POINT_ROWS
        along = along + (load(b, point + TOTAL) + share * load(b, point + IMPULSE))
    return (along, load(b, TOTAL_T) + share * load(b, FRICTION),
            load(b, TOTAL_T + 1) + share * load(b, FRICTION + 1))


@part
def end_substep(b: Array, points: int) -> None:
    """Add the impulses of a substep to those of the step."""
    store(b, TOTAL_T, load(b, TOTAL_T) + load(b, FRICTION))
    store(b, TOTAL_T + 1, load(b, TOTAL_T + 1) + load(b, FRICTION + 1))
    for p in range(4 if points > 1 else 1):
        point = POINT + p * POINT_ROWS
        store(b, point + TOTAL, load(b, point + TOTAL) + load(b, point + IMPULSE))


@part
def drift_together(b: Array, points: int, shoved: bool, v: Three, h: float) -> None:
    """
    End a substep, in which B moved with the mean velocity v relative to A for h [s].

    Impulses act where c was when the manifold was found, while the pair moves: with the impulse
    F_i of a substep, half way through it, and the way d_i of it, the pair gains the angular
    momentum

        sum_i (sum_{j < i} d_j + d_i / 2) x F_i
            = (sum_j d_j) x (sum_i F_i) + sum_j (sum_{i < j} F_i + F_j / 2) x d_j,

    the first part of which `gain_of` adds at the end, when both sums are known. The push, too,
    displaces momenta.
    """
    n, t1, t2 = axes(b)
    along, slide_1, slide_2 = total_of(b, points, 0.5)
    if shoved:
        along = along + load(b, SHOVE)
    F = combine(n, t1, t2, (h * along, h * slide_1, h * slide_2))
    store_three(b, TORSION, add(load_three(b, TORSION), cross(F, v)))
    end_substep(b, points)


@part
def gain_of(b: Array, acted: Three, moved: Three) -> Three:
    """
    Return what L a pair gained by having `moved` in all substeps; see above.

    `acted` are the impulses of all substeps along n, t1, t2.
    """
    n, t1, t2 = axes(b)
    return add(load_three(b, TORSION), cross(moved, combine(n, t1, t2, acted)))


@part
def smallest_gap(b: Array, points: int) -> Eight:
    """Return how near the nearest points are [m]."""
    least = load(b, POINT + GAP)
    for p in range(1, 4 if points > 1 else 1):
        least = min(least, load(b, POINT + p * POINT_ROWS + GAP))
    return least


@part
def axes(b: Array) -> tuple[Three, Three, Three]:
    """
    Return n, t1 and t2.

    t1 without a branch (Duff et al., J. Computer Graphics Techniques 6 (2017)), given k: to work
    it out takes less time than to read three rows more of what does not fit into the cache.
    """
    n, k = load_three(b, NORMAL), load(b, BASIS)
    sign = select(n[2] >= 0.0, 1.0, -1.0)
    t1 = (1.0 + sign * n[0] * n[0] * k, sign * n[0] * n[1] * k, -sign * n[0])
    return n, t1, cross(n, t1)


@part
def pushed(motion: Motion, inv_m: Eight, arm: Three, F: Three, torque: Three,
           sign: float) -> Motion:
    """Return the motion after an impulse at c, `sign` times F and the torque."""
    w, moves = sign * inv_m, select(inv_m > 0.0, sign, 0.0)
    turn = add(cross(arm, F), torque)
    return (motion[0] + w * F[0], motion[1] + w * F[1], motion[2] + w * F[2],
            motion[3] + moves * turn[0], motion[4] + moves * turn[1], motion[5] + moves * turn[2],
            motion[6], motion[7])


@part
def combine(n: Three, t1: Three, t2: Three, c: Three) -> Three:
    """Return c0 n + c1 t1 + c2 t2."""
    return (c[0] * n[0] + c[1] * t1[0] + c[2] * t2[0], c[0] * n[1] + c[1] * t1[1] + c[2] * t2[1],
            c[0] * n[2] + c[1] * t1[2] + c[2] * t2[2])


@part
def prepare_block(b: Array, points: int, small: bool, inv_m_A: Eight, inv_m_B: Eight) -> None:
    """
    Work out frames, arms and responses of the eight manifolds of a block.

    Filled in before: NORMAL, x_A - x_B in ARM_B, INV_I_A, INV_I_B, MU, SPIN_LEVER, the friction
    impulse as a world vector in TORSION, SPIN, that against rolling as one from ROLL on, and for
    each of four points GAP, IMPULSE and in S, T, MASS where it is from the centre of mass of A
    [m], world axes. A point that is not there has the gap ABSENT, and so have all but the first in
    a block of one point.
    """
    count = 4 if points > 1 else 1
    make_basis(b)
    _place_centre(b, count)
    _, t1, t2 = axes(b)
    for p in range(count):
        point = POINT + p * POINT_ROWS
        r = subtract(load_three(b, point), load_three(b, ARM_A))
        store(b, point + S, dot(r, t1))
        store(b, point + T, dot(r, t2))
    nn_A, tn_A, tt_A = _response(b, ARM_A, INV_I_A, inv_m_A)
    nn_B, tn_B, tt_B = _response(b, ARM_B, INV_I_B, inv_m_B)
    _prepare_friction(b, tt_A, tt_B, _place_friction(b, count))
    if small:
        # The point is c, and its column g is (1, 0, 0).
        k = nn_A[0] + nn_B[0]
        store(b, K_N, k)
        store(b, K_N + 1, tn_A[0] + tn_B[0])
        store(b, K_N + 2, tn_A[3] + tn_B[3])
        store(b, K_N + 3, tn_A[6] + tn_B[6])
        store(b, POINT + MASS, select(load(b, POINT + GAP) < ABSENT, inverse_of(k), 0.0))
        return
    for k in range(6):
        store(b, K_NN + k, nn_A[k] + nn_B[k])
    for k in range(9):
        store(b, K_TN + k, tn_A[k] + tn_B[k])
    _prepare_rolling(b)
    for p in range(count):
        point = POINT + p * POINT_ROWS
        # The mass that a normal impulse at a point moves; 0 for an absent one.
        g = (1.0, load(b, point + T), -load(b, point + S))
        mass = inverse_of(dot(g, symmetric(b, K_NN, g)))
        store(b, point + MASS, select(load(b, point + GAP) < ABSENT, mass, 0.0))


@part
def make_basis(b: Array) -> None:
    """
    Choose the tangents, see `axes`, and turn vectors into their parts.

    The friction in TORSION, and what `_copy_turns` wrote from TOTAL_T on.
    """
    z = load(b, NORMAL + 2)
    store(b, BASIS, -1.0 / (select(z >= 0.0, 1.0, -1.0) + z))
    _, t1, t2 = axes(b)
    friction = load_three(b, TORSION)
    store(b, FRICTION, dot(friction, t1))
    store(b, FRICTION + 1, dot(friction, t2))
    turn = load_three(b, TOTAL_T)
    store_two(b, TURN_T, (dot(turn, t1), dot(turn, t2)))


# Gap, of the size of the smaller shape, at which a point counts half for the centre of a manifold.
# Smaller: friction acts where the bodies touch already; larger: in the middle of what is about to
# touch. The pressure would be the better weight, but where it swings to and fro the centre would
# swing with it, and friction would feed the motion.
_NEAR = 1e-4


@part
def _weight(b: Array, point: int) -> Eight:
    """Return what a point counts for the centre of its manifold."""
    gap, near = max(load(b, point + GAP), 0.0), _NEAR * load(b, SIZE)
    return near * near / (near * near + gap * gap)


@part
def _place_centre(b: Array, count: int) -> None:
    """Put c amid the nearest points; friction has their mean distance as lever."""
    q = load_three(b, POINT)
    if count == 1:
        store_three(b, ARM_A, q)
        store_three(b, ARM_B, add(q, load_three(b, ARM_B)))
        return
    w = _weight(b, POINT)
    total, c = w, (w * q[0], w * q[1], w * q[2])
    for p in range(1, count):
        point = POINT + p * POINT_ROWS
        w, q = _weight(b, point), load_three(b, point)
        total, c = total + w, (c[0] + w * q[0], c[1] + w * q[1], c[2] + w * q[2])
    inverse = inverse_of(total)
    c = (inverse * c[0], inverse * c[1], inverse * c[2])
    lever = 0.0 * total
    for p in range(count):
        point = POINT + p * POINT_ROWS
        r = subtract(load_three(b, point), c)
        lever = lever + _weight(b, point) * root(dot(r, r))
    store_three(b, ARM_A, c)
    store_three(b, ARM_B, add(c, load_three(b, ARM_B)))
    store(b, SPIN_LEVER, load(b, SPIN_LEVER) + load(b, MU) * (lever * inverse))


@part
def _response(b: Array, arm: int, inertia: int, inv_m: Eight) -> tuple[Six, Nine, Six]:
    """Return one body's part of K: the rows of K_NN, of K_TN and of K_TT."""
    n, t1, t2 = axes(b)
    c_W, turns = load_three(b, arm), select(inv_m > 0.0, 1.0, 0.0)
    w_n, w_1 = symmetric(b, inertia, scale(turns, n)), symmetric(b, inertia, scale(turns, t1))
    w_2 = symmetric(b, inertia, scale(turns, t2))
    # inv_I_W in these axes
    i00, i01, i02 = dot(n, w_n), dot(n, w_1), dot(n, w_2)
    i11, i12, i22 = dot(t1, w_1), dot(t1, w_2), dot(t2, w_2)
    cn, c1, c2 = dot(c_W, n), dot(c_W, t1), dot(c_W, t2)
    # M = [c] inv_I_W, rows and columns in the order n, t1, t2; then K_la = -M and K_ll = 1/m + M
    # [c]^T.
    m00, m01, m02 = c1 * i02 - c2 * i01, c1 * i12 - c2 * i11, c1 * i22 - c2 * i12
    m10, m11, m12 = c2 * i00 - cn * i02, c2 * i01 - cn * i12, c2 * i02 - cn * i22
    m20, m21, m22 = cn * i01 - c1 * i00, cn * i11 - c1 * i01, cn * i12 - c1 * i02
    return ((inv_m + c1 * m02 - c2 * m01, -m01, -m02, i11, i12, i22),
            (c1 * m12 - c2 * m11, -m11, -m12, c1 * m22 - c2 * m21, -m21, -m22, -m00, i01, i02),
            (inv_m + c2 * m10 - cn * m12, cn * m11 - c1 * m10, -m10, inv_m + cn * m21 - c1 * m20,
             -m20, i00))


@part
def inverse_of(x: Eight) -> Eight:
    """Return 1 / x, and 0 where x is not above 0."""
    return select(x > 0.0, 1.0 / x, 0.0)


@part
def _place_friction(b: Array, count: int) -> Two:
    """Return the centre of pressure of the impulses to begin with; c, if there are none."""
    if count == 1:
        zero = 0.0 * load(b, MU)
        return zero, zero
    along_1 = along_2 = 0.0 * load(b, MU)
    for p in range(count):
        point = POINT + p * POINT_ROWS
        f = load(b, point + IMPULSE)
        along_1, along_2 = along_1 + f * load(b, point + S), along_2 + f * load(b, point + T)
    inverse = inverse_of(normal_sum(b, count))
    store_two(b, PRESSED, (inverse * along_1, inverse * along_2))
    return inverse * along_1, inverse * along_2


@part
def _prepare_friction(b: Array, A: Six, B: Six, d: Two) -> None:
    """
    Invert what friction divides by, given both parts of K_TT; an empty lane gets 0.

    The steps of what slides are for impulses at the point d from c, and about n there divided by
    the lever SPIN_LEVER / MU: at most the inverse of the largest eigenvalue of K for these three,
    which is not more than those of its parts together.
    """
    k00, k01, k11, k02, k12 = A[0] + B[0], A[1] + B[1], A[3] + B[3], A[2] + B[2], A[4] + B[4]
    spin, inverse = A[5] + B[5], inverse_of(k00 * k11 - k01 * k01)
    store_three(b, INV_TT, (k11 * inverse, -k01 * inverse, k00 * inverse))
    store(b, INV_SPIN, inverse_of(spin))
    store_two(b, K_SPIN, (k02, k12))
    lever = load(b, SPIN_LEVER) * inverse_of(load(b, MU))
    largest = lever * lever * spin + _largest_eigenvalue(
        k00 + d[1] * (d[1] * spin - 2.0 * k02), k01 + d[0] * k02 - d[1] * (k12 + d[0] * spin),
        k11 + d[0] * (d[0] * spin + 2.0 * k12))
    step = inverse_of(largest)
    store(b, SLIDE, step)
    store(b, SPIN_SLIDE, step * lever * lever)
    store(b, PER_LEVER, inverse_of(lever))


@part
def _largest_eigenvalue(k00: Eight, k01: Eight, k11: Eight) -> Eight:
    """Return that of a symmetric matrix of two rows: it is the same for any pair of tangents."""
    half = 0.5 * (k00 - k11)
    return 0.5 * (k00 + k11) + root(half * half + k01 * k01)


@part
def _prepare_rolling(b: Array) -> None:
    """Turn the impulse against rolling into its parts, and how long its steps may be."""
    _, t1, t2 = axes(b)
    roll = load_three(b, ROLL)
    store_two(b, ROLL, (dot(roll, t1), dot(roll, t2)))
    k11, k12, k22 = load(b, K_NN + 3), load(b, K_NN + 4), load(b, K_NN + 5)
    store(b, ROLL_STEP, inverse_of(_largest_eigenvalue(k11, k12, k22)))
