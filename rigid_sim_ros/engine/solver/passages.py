# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What is fast ends its way before it gets through what nothing pushes.

The solver knows the pairs that are near as a step begins, by where they would meet if nothing
changed their way. What an impact turns may meet another point of the ground in the same step, and
what it throws goes farther than its pairs were sought. So the ways that the solver leaves are
looked at before they are gone. A body stops where it would get deeper into something fixed or
kinematic by `deepest`, and goes with that from there on: on a ship that flies past as on land. The
rest of its step is lost, with what forces did in it and contacts left, or what falls would gain
speed without falling. Velocities that contacts gave stay, and the next step finds the pair.

Of a pair that overlapped already as its way began, contacts did not stop what they should: of
what turns by radians a step they act at an attitude to which it does not come. Such a pair
collides where it was stopped, at the attitude that it has there, without restitution and friction.

Two bodies that can both be pushed are not asked: what is lost of a way that an impulse turned
would change their angular momentum, which is kept where nothing fixed takes it.

Only what moves farther than half of that depth is asked. Most steps end with one test a body.
"""

import math

from rigid_sim_ros.engine.contact.impact_offsets import displacement, has_collided, SHIFT
from rigid_sim_ros.engine.detection.backtrack import DEEPER, pair_gap, passage
from rigid_sim_ros.engine.detection.broad_phase import may_collide
from rigid_sim_ros.engine.detection.grid import boxes_overlap
from rigid_sim_ros.engine.detection.manifolds import current, rows_in_use
from rigid_sim_ros.engine.detection.margins import standard_of_rest
from rigid_sim_ros.engine.detection.motion_ahead import place_ahead
from rigid_sim_ros.engine.detection.narrow_phase.collide import collide
from rigid_sim_ros.engine.dynamics.free_rotation import turn_fast
from rigid_sim_ros.engine.dynamics.kinematic import prescribed_spin, prescribed_velocity
from rigid_sim_ros.engine.maths.rotation import exponential, multiply, quaternion, set_quaternion
from rigid_sim_ros.engine.maths.vector import (
    add, add_scaled, add_to_column, column, cross, dot, norm, row, scale, set_column, subtract)
from rigid_sim_ros.engine.solver.arguments import Arguments
from rigid_sim_ros.engine.solver.solver_bodies import STRIDE, TOUCHED
from rigid_sim_ros.engine.state.rates import (
    angular_momentum, fastest_turning, spin_of, velocity_at)
from rigid_sim_ros.engine.state.state import add_impulse_with_lever, copy_body, State
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import INDEX, inlined, kernel


@kernel
def is_any_fast(c: Arguments) -> bool:
    """Return whether any body may go so far in this step that it gets through something."""
    least = 0.5 * DEEPER * c.work.ways.thinnest[0] / c.model.h
    rest = standard_of_rest(c.model, c.state, c.shapes.body)
    for i in range(c.model.m.shape[0]):
        v, L = _mean_motion(c, i)
        speed = norm(subtract(v, rest)) if _moves(c, i) else 0.0
        if not speed + _turning(c, i, c.state, L) <= least:
            return True
    return False


@inlined
def _moves(c: Arguments, i: int) -> bool:
    """Return whether a body moves by its momenta in this step: it can be pushed, and is awake."""
    bodies = c.work.solver.bodies
    return bool(c.model.inv_m[i] > 0.0
                and ((bodies.slot[i] & INDEX) > 0 or bodies.flies[i] == 1))


@kernel
def _mean_motion(c: Arguments, i: int) -> tuple[Vector, Vector]:
    """Return v [m/s] and L [kg m^2/s] with which a body that can be pushed moves in this step."""
    bodies, state, loads = c.work.solver.bodies, c.state, c.work.loads
    slot, inv_m, share = bodies.slot[i] & INDEX, c.model.inv_m[i], 0.5 * c.model.h
    if not _moves(c, i):
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if slot == 0:
        return (scale(inv_m, add_scaled(column(state.P, i), share, column(loads.F, i))),
                add_scaled(column(state.L, i), share, column(loads.tau, i)))
    at, share = slot * STRIDE, 1.0 / c.settings.sequential.substeps
    total = bodies.total
    return (scale(share, (total[at], total[at + 1], total[at + 2])),
            scale(share, (total[at + 3], total[at + 4], total[at + 5])))


@kernel
def _turning(c: Arguments, i: int, at: State, L: Vector) -> float:
    """Return a bound of how fast turning moves points of a body [m/s]; balls look the same."""
    return fastest_turning(quaternion(at.q, i), L, column(c.model.inv_I_C, i),
                           c.work.radius[i] * c.shapes.turning[i], c.shapes.mobility[i])


@kernel
def end_ways(c: Arguments) -> None:
    """Let bodies stop where they would get through something that nothing pushes."""
    _write_ways(c)
    ways, shapes, memory = c.work.ways, c.shapes, c.memory
    for k in range(memory.pair_count[0]):
        a, b = memory.pair[k, 0] & INDEX, memory.pair[k, 1] & INDEX
        if shapes.still[a] + shapes.still[b] == 1 and boxes_overlap(memory.box, a, b):
            _end_at_passage(c, a, b)
    least = 0.5 * DEEPER * ways.thinnest[0]
    for a in range(shapes.body.shape[0]):
        if ways.length[shapes.body[a] & INDEX] > max(memory.margin[a], least):
            _end_at_any(c, a)
    for i in range(c.model.m.shape[0]):
        if ways.part[i] < 1.0:
            _stop(c, i)


@kernel
def _write_ways(c: Arguments) -> None:
    """
    Write the motions at constant P and L that bring bodies to where the solver lets them go.

    Of what bounced and then flies, from its last collision on: before, it was on other ways. Where
    the solver pushed it besides, straight from where it was before.
    """
    ways, h = c.work.ways, c.model.h
    path = ways.path
    for i in range(c.model.m.shape[0]):
        copy_body(path, c.state, i)
        v, L = _mean_motion(c, i)
        set_column(path.P, i, scale(c.model.m[i], v))
        set_column(path.L, i, L)
        ways.begin[i] = 0.0
    manifolds = current(c.memory)
    first, count = rows_in_use(manifolds)
    for k in range(count if c.work.solver.shifted[0] == 1 else 0):
        r = (first + k) & INDEX
        for i in (manifolds.body_a[r] & INDEX, manifolds.body_b[r] & INDEX):
            if has_collided(c.work.collision.body[i]) and c.model.inv_m[i] > 0.0:
                if c.work.solver.bodies.slot[i] == 0:
                    ways.begin[i] = c.work.collision.last[i]
                else:
                    _begin_before(c, i, c.work.collision.body[i])
    rest = standard_of_rest(c.model, c.state, c.shapes.body)
    for i in range(c.model.m.shape[0]):
        ways.part[i] = 1.0
        v = scale(c.model.inv_m[i], column(path.P, i))
        speed = norm(subtract(v, rest)) if _moves(c, i) else 0.0
        ways.length[i] = h * (speed + _turning(c, i, path, column(path.L, i)))


@kernel
def _begin_before(c: Arguments, i: int, line: Array) -> None:
    """Let a way begin where a body was before collisions shifted it."""
    path, moved, h = c.work.ways.path, displacement(line), c.model.h
    angle = (line[SHIFT + 3], line[SHIFT + 4], line[SHIFT + 5])
    v, L = _mean_motion(c, i)
    q = multiply(exponential(scale(-1.0, angle)), quaternion(c.state.q, i))
    set_column(path.x, i, subtract(column(c.state.x, i), moved))
    set_quaternion(path.q, i, q)
    set_column(path.P, i, scale(c.model.m[i], add_scaled(v, 1.0 / h, moved)))
    set_column(path.L, i, add(L, angular_momentum(
        q, scale(1.0 / h, angle), column(c.model.I_C, i))))


@kernel
def _end_at_any(c: Arguments, a: int) -> None:
    """End the way of a shape that goes farther than its pairs were sought."""
    shapes, pose, reach = c.shapes, c.memory.pose, c.work.ways.length[c.shapes.body[a] & INDEX]
    for b in range(shapes.body.shape[0]):
        apart = norm((pose[a, 0] - pose[b, 0], pose[a, 1] - pose[b, 1], pose[a, 2] - pose[b, 2]))
        near = apart <= shapes.bound[a] + reach + c.memory.margin[b] + shapes.bound[b]
        if shapes.still[b] == 1 and near and may_collide(shapes, c.model.m.shape[0], a, b):
            _end_at_passage(c, min(a, b), max(a, b))


@kernel
def _end_at_passage(c: Arguments, a: int, b: int) -> None:
    """End the way of a shape where it would get through one that nothing pushes."""
    ways, shapes, h = c.work.ways, c.shapes, c.model.h
    i, k = shapes.body[a] & INDEX, shapes.body[b] & INDEX
    if shapes.still[a] == 1:
        i, k = k, i
    if ways.length[i] > 0.5 * DEEPER * min(shapes.half_width[a], shapes.half_width[b]):
        t = passage(c.model, ways.path, c.work.prediction.no_loads, shapes, a, b, ways.begin[i], h,
                    c.work.prediction.pose, c.memory.scratch)
        if t / h < ways.part[i]:
            ways.part[i] = t / h
            ways.met[i, 0], ways.met[i, 1] = a, b
            gap, _ = pair_gap(c.model, ways.path, c.work.prediction.no_loads, shapes, a, b,
                              ways.begin[i], c.work.prediction.pose, c.memory.scratch)
            ways.sank[i] = 1 if gap < 0.0 else 0
            arm = subtract(column(ways.path.x, i), column(ways.path.x, k))
            set_column(ways.carried, i, velocity_at(
                prescribed_velocity(ways.path, k), prescribed_spin(ways.path, k), arm))


@kernel
def _stop(c: Arguments, i: int) -> None:
    """Put a body to the end of its way, and take back what forces did in the rest of its step."""
    ways, bodies, loads, h = c.work.ways, c.work.solver.bodies, c.work.loads, c.model.h
    path, slot, until = ways.path, bodies.slot[i] & INDEX, ways.part[i] * h
    lost = h - until
    q = turn_fast(quaternion(path.q, i), column(path.L, i), column(c.model.inv_I_C, i), until)
    met = add_scaled(column(path.x, i), until * c.model.inv_m[i], column(path.P, i))
    set_column(c.state.x, i, add_scaled(met, lost, column(ways.carried, i)))
    set_quaternion(c.state.q, i, q)
    F, m, inv_m = column(loads.F, i), c.model.m[i], c.model.inv_m[i]
    # What forces did on the way that is lost, seen from what it goes with.
    lost_way = scale(lost, subtract(scale(inv_m, column(path.P, i)), column(ways.carried, i)))
    work = dot(F, lost_way)
    if slot == 0:
        bodies.flies[i] = 0
        v = scale(inv_m, add_scaled(column(c.state.P, i), h, F))
        v = _without_work(v, F, inv_m, work, column(ways.carried, i))
        set_column(c.state.P, i, scale(m, v))
        add_to_column(c.state.L, i, scale(until, column(loads.tau, i)))
        return
    at, motion = slot * STRIDE, bodies.motion
    v = _without_work((motion[at], motion[at + 1], motion[at + 2]), F, inv_m, work,
                      column(ways.carried, i))
    motion[at], motion[at + 1], motion[at + 2] = v
    _take_turn(motion, at + 3, scale(lost, column(loads.tau, i)))
    bodies.total[at:at + STRIDE] = 0.0
    bodies.drifted[at + TOUCHED] = 1.0


@kernel
def hit_what_stopped(c: Arguments) -> None:
    """
    Let bodies collide with what stopped them, at the end of a step that began in an overlap.

    And forget who was stopped.
    """
    ways, shapes, pose = c.work.ways, c.shapes, c.work.prediction.pose
    for i in range(c.model.m.shape[0]):
        a, b = ways.met[i, 0], ways.met[i, 1]
        ways.met[i, 0] = ways.met[i, 1] = -1
        if a < 0 or ways.sank[i] == 0:
            continue
        for s in (a, b):
            place_ahead(c.model, c.state, c.work.prediction.no_loads, shapes, s, 0.0, pose)
        count, n = collide(pose, shapes, a, b, 0.0, 0.0, c.memory.scratch)
        k = shapes.body[b] if shapes.body[a] == i else shapes.body[a]
        out = scale(1.0 if shapes.body[b] == i else -1.0, n)
        for p in range(count):
            _stop_point(c, i, k, row(c.memory.scratch.points, p), out)


@kernel
def _stop_point(c: Arguments, i: int, k: int, at: Vector, n: Vector) -> None:
    """Take from body i the velocity of a point at `at` [m] against the normal n, out of body k."""
    model, state = c.model, c.state
    q, inv_I, inv_m = quaternion(state.q, i), column(model.inv_I_C, i), model.inv_m[i]
    r, arm = subtract(at, column(state.x, i)), subtract(at, column(state.x, k))
    u = subtract(
        velocity_at(scale(inv_m, column(state.P, i)), spin_of(q, column(state.L, i), inv_I), r),
        velocity_at(prescribed_velocity(state, k), prescribed_spin(state, k), arm))
    lever = cross(r, n)
    J = -dot(u, n) / (inv_m + dot(lever, spin_of(q, lever, inv_I)))
    if J > 0.0:
        add_impulse_with_lever(model.inv_m, state, i, r, scale(J, n))


@kernel
def _without_work(v: Vector, F: Vector, inv_m: float, work: float, rest: Vector) -> Vector:
    """
    Return v [m/s] without the energy `work` [J] along F, as far as it is there, past `rest`.

    What a contact has stopped is there no longer: h F / m taken from it would throw it up.
    """
    square = dot(F, F)
    if square == 0.0 or work <= 0.0:
        return v
    along = dot(F, subtract(v, rest))
    left = math.sqrt(max(along * along - 2.0 * inv_m * square * work, 0.0))
    return add_scaled(v, (math.copysign(left, along) - along) / square, F)


@kernel
def _take_turn(motion: Array, at: int, done: Vector) -> None:
    """Take from L what a torque has `done`, as far as it is there."""
    square = dot(done, done)
    now = dot((motion[at], motion[at + 1], motion[at + 2]), done)
    share = min(max(now, 0.0), square) / square if square > 0.0 else 0.0
    for k in range(3):
        motion[at + k] -= share * done[k]
