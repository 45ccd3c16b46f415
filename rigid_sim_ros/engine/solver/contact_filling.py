# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way of manifolds into the blocks of the sequential solver."""

from rigid_sim_ros.engine.constraints.contact_blocks import (
    ABSENT, APPROACH, ARM_A, ARM_B, axes, combine, friction_of, GAP, IMPULSE, INV_I_A, INV_I_B,
    LEVER_A, LEVER_B, load_three, Motion, MU, NORMAL, normal_sum, POINT, POINT_ROWS, prepare_block,
    pushed, ROLL, ROLL_LEVER, S, SIZE, smallest_gap, SPIN, SPIN_LEVER, store_three, T, Three,
    TORSION, TOTAL_T, TURN)
from rigid_sim_ros.engine.constraints.contact_prediction import AFTERWARDS, AHEAD, Prediction
from rigid_sim_ros.engine.constraints.contact_rules import SKIN
from rigid_sim_ros.engine.contact.impact_offsets import displacement, gap_now, has_collided
from rigid_sim_ros.engine.detection.manifolds import (
    DORMANT, first_row, LEFT_OUT, Manifolds, POINTS, rows_in_use)
from rigid_sim_ros.engine.maths.vector import row, subtract
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.solver.coloring import (
    are_balls, BALLS, BETWEEN, Blocks, CACHED, Coloring, fetch_block, first_block, is_small,
    lanes_of, numbers_of, PIECE, points_in, QUIET, QUIET_BALLS)
from rigid_sim_ros.engine.solver.partition import ACROSS, is_by_number, SECOND, Sides
from rigid_sim_ros.engine.solver.solver_bodies import (
    INV_I, INV_M, moves_by_twist, SolverBodies, still_slot, STRIDE)
from rigid_sim_ros.engine.solver.sphere_sweep import prepare_balls, warm_balls
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.bits import fetch
from rigid_sim_ros.kernels.eight import (
    any_of, bits_of, both, Eight, gather, gather_integers, gather_rows_1, gather_rows_3,
    LANES, largest_of, load, Mask, scatter, select, store)
from rigid_sim_ros.kernels.kernel import INDEX, kernel, part

# What is noted of a region: the deepest overlap [m], and whether any manifold touches without an
# impulse to begin with.
DEEPEST, NEW = range(2)


@kernel
def choose_manifolds(region: int, manifolds: Manifolds, sides: Sides, activity: IntArray,
                     work: Coloring) -> None:
    """
    List the manifolds of a half that are solved: neither left out, nor of two bodies at rest.

    With those of the first half also those across. Where numbers cut, the manifolds of the second
    half are those from its first shape on, and whatever else has a body there is across.
    activity (c,) tells which take part.
    """
    found, across, wanted, side = 0, 0, region + 1, sides.of_body
    begin, count = rows_in_use(manifolds)
    end, by_number = begin + count, is_by_number(sides.cut)
    if by_number:
        middle = first_row(manifolds, sides.middle[1])
        begin, end = (middle, end) if region == 1 else (begin, middle)
    for place in range(begin, end):
        r = place & INDEX
        if activity[r] != LEFT_OUT:
            at = side[manifolds.body_a[r] & INDEX] | side[manifolds.body_b[r] & INDEX]
            if at == wanted:
                work.member[region, found] = r
                found += 1
            elif region == 0 and (at == ACROSS or (at == SECOND and by_number)):
                work.member[BETWEEN, across] = r
                across += 1
    work.members[region] = found
    if region == 0:
        work.members[BETWEEN] = across


@kernel
def classify_blocks(region: int, material: IntArray, materials: Materials,
                    round_shapes: IntArray, shifts: Array, shifted: bool, manifolds: Manifolds,
                    bodies: SolverBodies, work: Coloring) -> None:
    """
    Write the class of each manifold of a region.

    What collisions shifted since its normal was found is no pair of balls: its point is not on
    the line of the centres. Nor is what has a body that moves by its twist. `shifts` are those of
    the bodies if anything was `shifted`.
    """
    for k in range(work.members[region]):
        r = work.member[region, k] & INDEX
        a, b = manifolds.shape_a[r] & INDEX, manifolds.shape_b[r] & INDEX
        points = manifolds.points[r]
        first, second = material[a] & INDEX, material[b] & INDEX
        rolling, spinning = materials.rolling[first, second], materials.spinning[first, second]
        i, j = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        balls = points == 1 and round_shapes[a] + round_shapes[b] == 2 and (
            spinning == 0.0) and not (moves_by_twist(bodies, i) or moves_by_twist(bodies, j))
        if balls and shifted:
            balls = not (has_collided(shifts[i]) or has_collided(shifts[j]))
        quiet = points == 1 and manifolds.impulse[0, r] == 0.0
        if rolling > 0.0:
            work.kind[region, k] = min(points - 1, 2) + 3
        elif balls:
            work.kind[region, k] = QUIET_BALLS if quiet else BALLS
        else:
            work.kind[region, k] = QUIET if quiet else min(points - 1, 2)


@kernel
def place_lanes(region: int, begin: int, end: int, block: int, manifolds: Manifolds,
                bodies: SolverBodies, work: Coloring, blocks: Blocks) -> None:
    """
    Write the manifold of every lane of a piece, -1 for none, and where its bodies stand.

    The piece has the blocks of its region from `block` on. What they will be filled with is asked
    for on the way, while it is met in order: later it is met colour by colour.
    """
    many, still = work.members[region] > PIECE, STRIDE * still_slot(bodies.used, region)
    lane = block * LANES & INDEX
    last = (first_block(blocks, region) + blocks.count[region]) * LANES & INDEX
    blocks.row[lane:last] = -1
    blocks.at_A[lane:last] = still
    blocks.at_B[lane:last] = still
    for k in range(begin, end):
        r = work.member[region, k] & INDEX
        a = bodies.slot[manifolds.body_a[r] & INDEX]
        b = bodies.slot[manifolds.body_b[r] & INDEX]
        to = work.lane[region, k] & INDEX
        blocks.row[to] = r
        blocks.at_A[to] = a * STRIDE if a > 0 else still
        blocks.at_B[to] = b * STRIDE if b > 0 else still
        if many:
            balls = are_balls(work.kind[region, k])
            _fetch_sources(r, balls, manifolds)
            _fetch_body(a * STRIDE, balls, bodies)
            _fetch_body(b * STRIDE, balls, bodies)


@kernel
def _fetch_sources(r: int, balls: bool, manifolds: Manifolds) -> None:
    """Ask for what `fill_blocks` reads of a manifold, but for what `place_lanes` has read."""
    fetch(manifolds.normal, 3 * r)
    fetch(manifolds.friction, 3 * r)
    fetch(manifolds.gap, r)
    fetch(manifolds.impulse, r)
    if not balls:
        fetch(manifolds.r_A, 3 * r)


@kernel
def _fetch_body(at: int, balls: bool, bodies: SolverBodies) -> None:
    """Ask for what it reads and writes of a body."""
    fetch(bodies.base, at)
    if balls:
        fetch(bodies.motion, at)
    else:
        fetch(bodies.mass, at)


@part
def fill_blocks(region: int, first: int, manifolds: Manifolds, prediction: Prediction, x: Array,
                activity: IntArray, shapes: Shapes, materials: Materials, shifts: Array,
                shifted: bool, share: float, bodies: SolverBodies, blocks: Blocks,
                fresh: IntArray, notes: Array) -> None:
    """
    Bring manifolds of a region into its blocks, from the `first` on, and note how they are.

    `share` is the part of a step that a substep is. fresh (blocks,) become the bits of the lanes
    that touch without an impulse to begin with.
    """
    deepest, new = 0.0, 0
    for block in range(first, first_block(blocks, region) + blocks.count[region]):
        lanes = lanes_of(block)
        b, rows = numbers_of(blocks, block), blocks.row[lanes]
        points, small = points_in(blocks.kind[block]), is_small(blocks.kind[block])
        balls = are_balls(blocks.kind[block])
        if blocks.count[region] > CACHED:
            fetch_block(blocks, block + 1)
        at_A, at_B = blocks.at_A[lanes], blocks.at_B[lanes]
        _copy_normal_and_friction(b, rows, manifolds, share)
        _copy_sizes(b, rows, manifolds, shapes.bound)
        blocks.dormant[block], blocks.direct[block] = _dormant_lanes(rows, activity), 0
        blocks.held[block] = 0
        if balls:
            A, B = gather(bodies.motion, at_A), gather(bodies.motion, at_B)
            _copy_balls(b, rows, manifolds, prediction, shapes, materials, share)
        else:
            A, B = gather(bodies.mass, at_A), gather(bodies.mass, at_B)
            _copy_shapes(b, rows, small, manifolds, shapes.material, materials)
            _copy_places(b, rows, manifolds, prediction, x)
            _copy_inertia(b, A, B)
            _copy_points(b, rows, points, small, manifolds, prediction, share)
        least = smallest_gap(b, points)
        touches = least < SKIN * load(b, SIZE)
        fresh[block] = bits_of(both(touches, normal_sum(b, points) == 0.0))
        new |= fresh[block]
        deepest = max(deepest, largest_of(-least))
        if shifted:
            for i in range(LANES):
                if rows[i] >= 0:
                    _shift_lane(manifolds, prediction, rows[i] & INDEX, shifts, b, i)
        _copy_turns(b, rows, points, manifolds, prediction, shifts, shifted)
        if balls:
            prepare_balls(b, A[INV_M], B[INV_M], A[INV_I], B[INV_I])
            warm_balls(b, bodies.base, at_A, at_B, A[INV_M], B[INV_M])
        else:
            prepare_block(b, points, small, A[INV_M], B[INV_M])
            _warm_start(b, points, small, bodies.base, at_A, at_B, A[INV_M], B[INV_M])
    notes[DEEPEST] = max(notes[DEEPEST], deepest)
    notes[NEW] = 1.0 if new != 0 else notes[NEW]


@part
def _dormant_lanes(rows: IntArray, activity: IntArray) -> int:
    """Return the bits of the lanes that take no part before an impact reaches them."""
    bits = 0
    for i in range(LANES):
        if rows[i] >= 0 and activity[rows[i] & INDEX] == DORMANT:
            bits |= 1 << i
    return bits


@part
def _copy_shapes(b: Array, rows: IntArray, small: bool, manifolds: Manifolds,
                 material: IntArray, materials: Materials) -> None:
    """
    Write the friction and the levers of the resistances.

    Number by number, as the shapes of a manifold lead to them: no copy of them is worth its
    memory. An empty lane gets zeros, and reads what the first one does, which is never empty:
    that is at hand.
    """
    for i in range(LANES):
        there = rows[i] >= 0
        r = (rows[i] if there else rows[0]) & INDEX
        first = material[manifolds.shape_a[r] & INDEX] & INDEX
        second = material[manifolds.shape_b[r] & INDEX] & INDEX
        b[MU * LANES + i] = materials.friction[first, second] if there else 0.0
        b[SPIN_LEVER * LANES + i] = materials.spinning[first, second] if there else 0.0
        if not small:
            b[ROLL_LEVER * LANES + i] = materials.rolling[first, second] if there else 0.0


@part
def _copy_balls(b: Array, rows: IntArray, manifolds: Manifolds, prediction: Prediction,
                shapes: Shapes, materials: Materials, share: float) -> None:
    """
    Write the friction of balls, their point, and how far it is from both middles.

    It lies half way between the surfaces where they were found: the radius and half of the gap
    away. That of what does not move, which may be no ball, is multiplied by 0.
    """
    for i in range(LANES):
        there = rows[i] >= 0
        r = (rows[i] if there else rows[0]) & INDEX
        one, other = manifolds.shape_a[r] & INDEX, manifolds.shape_b[r] & INDEX
        first, second = shapes.material[one] & INDEX, shapes.material[other] & INDEX
        half = 0.5 * (prediction.gap[0, r] if prediction.given[r] != 0 else manifolds.gap[0, r])
        b[MU * LANES + i] = materials.friction[first, second] if there else 0.0
        b[LEVER_A * LANES + i] = shapes.size[one, 0] + half if there else 0.0
        b[LEVER_B * LANES + i] = -(shapes.size[other, 0] + half) if there else 0.0
    (gap,) = gather_rows_1(manifolds.gap, rows, 1, 0)
    (impulse,) = gather_rows_1(manifolds.impulse, rows, 1, 0)
    there = gather_integers(manifolds.points, rows) > 0.0
    store(b, POINT + GAP, select(there, gap, ABSENT))
    store(b, POINT + IMPULSE, select(there, share * impulse, 0.0))
    store(b, POINT + APPROACH, 0.0)


@part
def _copy_places(b: Array, rows: IntArray, manifolds: Manifolds, prediction: Prediction,
                 x: Array) -> None:
    """Write x_A - x_B where the manifold was found; of an empty lane something."""
    for i in range(LANES):
        r = (rows[i] if rows[i] >= 0 else rows[0]) & INDEX
        body_a, body_b = manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX
        for k in range(3):
            moved = prediction.moved[r, k] if prediction.given[r] != 0 else 0.0
            b[(ARM_B + k) * LANES + i] = x[k, body_a] - x[k, body_b] - moved


@part
def _copy_inertia(b: Array, A: Motion, B: Motion) -> None:
    store_three(b, INV_I_A, (A[0], A[1], A[2]))
    store_three(b, INV_I_A + 3, (A[3], A[4], A[5]))
    store_three(b, INV_I_B, (B[0], B[1], B[2]))
    store_three(b, INV_I_B + 3, (B[3], B[4], B[5]))


@part
def _copy_normal_and_friction(b: Array, rows: IntArray, manifolds: Manifolds,
                              share: float) -> None:
    """Write the normal, and the friction as a vector where `make_basis` looks for it."""
    store_three(b, NORMAL, gather_rows_3(manifolds.normal, rows, 3, 0))
    friction = gather_rows_3(manifolds.friction, rows, 3, 0)
    store_three(b, TORSION, (share * friction[0], share * friction[1], share * friction[2]))


@part
def _copy_turns(b: Array, rows: IntArray, points: int, manifolds: Manifolds,
                prediction: Prediction, shifts: Array, shifted: bool) -> None:
    """
    Write what the geometry of contacts does to their velocities in the step.

    Along the tangents as a world vector, where `make_basis` looks for it. With the velocities
    that a collision has left it would be another number, see `end_impact`.
    """
    for i in range(LANES):
        r = rows[i] & INDEX
        given = rows[i] >= 0 and prediction.given[r] == AHEAD
        if given and shifted:
            given = not (has_collided(shifts[manifolds.body_a[r]])
                         or has_collided(shifts[manifolds.body_b[r]]))
        for p in range(POINTS if points > 1 else 1):
            turn = prediction.turn[p, r] if given else 0.0
            b[(POINT + p * POINT_ROWS + TURN) * LANES + i] = turn
        for k in range(3):
            b[(TOTAL_T + k) * LANES + i] = prediction.turn_t[r, k] if given else 0.0


@part
def _copy_sizes(b: Array, rows: IntArray, manifolds: Manifolds, bound: Array) -> None:
    """Write the size of the smaller shape, of which tolerances are parts."""
    for i in range(LANES):
        r = (rows[i] if rows[i] >= 0 else rows[0]) & INDEX
        b[SIZE * LANES + i] = min(bound[manifolds.shape_a[r] & INDEX],
                                  bound[manifolds.shape_b[r] & INDEX])


@part
def _copy_points(b: Array, rows: IntArray, points: int, small: bool, manifolds: Manifolds,
                 prediction: Prediction, share: float) -> None:
    """Write the points of manifolds that are not of balls."""
    n, present = load_three(b, NORMAL), gather_integers(manifolds.points, rows)
    given = gather_integers(prediction.given, rows) > 0.0
    (spin,) = gather_rows_1(manifolds.spin, rows, 1, 0)
    store(b, SPIN, share * spin)
    if not small:
        roll = gather_rows_3(manifolds.roll, rows, 3, 0)
        store_three(b, ROLL, (share * roll[0], share * roll[1], share * roll[2]))
    for p in range(POINTS if points > 1 else 1):
        _copy_point(b, p, n, rows, manifolds, prediction, present, given, share)


@part
def _copy_point(b: Array, p: int, n: Three, rows: IntArray, manifolds: Manifolds,
                prediction: Prediction, present: Eight, given: Mask, share: float) -> None:
    """
    Write one point, half way between the surfaces where these were found.

    Where there is none it is far away.
    """
    first = p * manifolds.gap.shape[1]
    r_A = gather_rows_3(manifolds.r_A, rows, 3, 3 * first)
    (gap,) = gather_rows_1(manifolds.gap, rows, 1, first)
    # There may be more room for predictions than for manifolds.
    (then,) = gather_rows_1(prediction.gap, rows, 1, p * prediction.gap.shape[1])
    (impulse,) = gather_rows_1(manifolds.impulse, rows, 1, first)
    there, point = present > p, POINT + p * POINT_ROWS
    half = select(there, 0.5 * select(given, then, gap), 0.0)
    store_three(b, point, (select(there, r_A[0], 0.0) + half * n[0],
                           select(there, r_A[1], 0.0) + half * n[1],
                           select(there, r_A[2], 0.0) + half * n[2]))
    store(b, point + GAP, select(there, gap, ABSENT))
    store(b, point + IMPULSE, select(there, share * impulse, 0.0))
    store(b, point + APPROACH, 0.0)


@kernel
def _shift_lane(manifolds: Manifolds, prediction: Prediction, r: int, shifts: Array, b: Array,
                i: int) -> None:
    """Move lane i by what collisions shifted since the points of its manifold were found."""
    # The common point stays; the centre of mass of A moved.
    moved = displacement(shifts[manifolds.body_a[r]])
    if prediction.given[r] == AFTERWARDS:
        moved = subtract(moved, row(prediction.shift, r))
    for p in range(manifolds.points[r]):
        o = (POINT + p * POINT_ROWS) * LANES + i
        b[o + GAP * LANES] = gap_now(manifolds, shifts, r, p)
        for k in range(3):
            b[o + k * LANES] -= moved[k]


@part
def _warm_start(b: Array, points: int, small: bool, warm: Array, at_A: IntArray, at_B: IntArray,
                inv_m_A: Eight, inv_m_B: Eight) -> None:
    """Let the impulses of a block act at the start of the first substep."""
    n, t1, t2 = axes(b)
    along = load(b, POINT + IMPULSE)
    about_1, about_2 = load(b, POINT + T) * along, -load(b, POINT + S) * along
    for p in range(1, POINTS if points > 1 else 1):
        point = POINT + p * POINT_ROWS
        impulse = load(b, point + IMPULSE)
        along = along + impulse
        about_1, about_2 = (about_1 + load(b, point + T) * impulse,
                            about_2 - load(b, point + S) * impulse)
    if not small:
        about_1, about_2 = about_1 + load(b, ROLL), about_2 + load(b, ROLL + 1)
    slide_1, slide_2, spin = friction_of(b)
    if not any_of(along + abs(slide_1) + abs(slide_2) + abs(spin) > 0.0):
        return
    F = combine(n, t1, t2, (along, slide_1, slide_2))
    torque = combine(n, t1, t2, (spin, about_1, about_2))
    A, B = gather(warm, at_A), gather(warm, at_B)
    scatter(warm, at_A, pushed(A, inv_m_A, load_three(b, ARM_A), F, torque, -1.0))
    scatter(warm, at_B, pushed(B, inv_m_B, load_three(b, ARM_B), F, torque, 1.0))
