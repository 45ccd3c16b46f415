# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The resting problem: forces that keep touching bodies from moving into each other.

At m points the relative accelerations are a = A f + b. Along the normal (Meyer, Rigid Body
Dynamics, "Resting Contact")

    a_n >= 0,    f_n >= 0,    f_n a_n = 0,

and in the tangential plane Coulomb's law: |f_t| <= mu f_n, and where a_t is not 0, f_t = -mu f_n
a_t / |a_t|. Without friction these are the optimality conditions of the quadratic program min
f'Af/2 + b'f over f >= 0. With friction they are those of

    min f'Af/2 + (b + s)'f    over the cones |f_t| <= mu f_n,    with s_n = mu |a_t|, s_t = 0

(De Saxce, Feng, The bipotential method, Math. Comput. Modelling 28 (1998); Acary, Cadoux,
Lemarechal, Malick, A formulation of the linear discrete Coulomb friction problem via convex
optimization, ZAMM 91 (2011)): without s a body that slides would be lifted off by mu |a_t|. s is
found by iteration; where one point slides it contracts by mu^2 / (1 + mu^2).

Torques against spinning and rolling obey the same law with coefficients of their own, about the
normal and in the tangential plane: three disks in place of one, and three more rows to a point.

OSQP solves each program over a pyramid in place of the cone, whose edges point along the friction
force; it finds which points press and which slide. Newton's method on the exact conditions takes
it from there to rounding, and while that division of the points lasts, from step to step without
OSQP.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.classify import resting_speed
from rigid_sim_ros.engine.contact.contact_newton import (
    FEW_STEPS, make_newton, Newton, NEWTON_STEPS, refine_rows)
from rigid_sim_ros.engine.contact.contact_rows import (
    make_rows, read_matrix, Rows, sweep_rows, violation)
from rigid_sim_ros.engine.contact.contacts import Bodies, Contacts, length, read_rates
from rigid_sim_ros.engine.contact.coulomb import (
    coefficients, COMPLIANCE, disk, EARLY_TOLERANCE, GOAL, TOLERANCE)
from rigid_sim_ros.engine.detection.backtrack import film
from rigid_sim_ros.engine.maths.algebra import cross, dot, row
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Sides of the pyramid. Friction off its edges is up to 1 - cos(pi / 8) = 8 % too weak, until
# Newton's method.
SIDES = 8
# Fixed, so that runs repeat: OSQP would otherwise choose the interval from the time that its setup
# took.
OSQP_SETTINGS = {'verbose': False, 'eps_abs': 1e-10, 'eps_rel': 1e-10, 'max_iter': 5000,
                 'adaptive_rho_interval': 25, 'check_termination': 25, 'polishing': False,
                 'time_limit': 1e10}
# Compliance for a step that finds no solution otherwise: 1e-8 m/s for a body under its weight
SOFTER = 1e-6
SWEEPS = 300  # of Gauss-Seidel, where Newton's method does not get on from OSQP's forces
# Sweeps where nothing else led on: redundant points on the verge of slipping, towards which the
# sweeps creep. 1e4 take 15 ms for six points; at most as many as so many products allow.
LAST_SWEEPS = (1000, 10000)
LAST_PRODUCTS = 2e7
ROUNDS = 8  # of the iteration for s
FEW_ROUNDS = 3  # after so many, TOLERANCE will do
CARRIED_OVER = 'carried over'
# A gap left at rest is closed at this rate per step. The gap and its rate then shrink with the
# factors 0.6 and 0.25 a step without swinging; above 0.34 they would swing.
CLOSING = 0.3
# Of the speed of a rebound that is too short to be one: no faster may a force lift what overlaps.
LIFTING = 0.1
# 1 - cos of 1e-6 rad: normals that differ by less are those of one face.
FLUSH = 5e-13


class Outcome(NamedTuple):
    """How a set of contact forces was found."""

    # The largest |f - P(f - a / A_ii)| A_ii over the points relative to max |b|, P the projection
    # onto f_n >= 0 and the disks |f_t| <= mu f_n: 0 exactly for a solution.
    residual: float
    solved: bool  # whether that is within TOLERANCE
    status: str  # OSQP's own word, or 'carried over' where it was not needed
    osqp_iterations: int


@kernel
def effective_mass(model: Model, contacts: Contacts, bodies: Bodies, chosen: IntArray, m: int,
                   width: int, arm: Array, A: Array) -> None:
    """
    Write A, (wm, wm) [1/kg]: rates of motion at the first m chosen points per force at them.

    A_ij = sum over the bodies that i and j share of s_i s_j (e_i . e_j / M + (r_i x e_i) . I^-1
    (r_j x e_j)) with s = 1 for B and -1 for A (Meyer, Rigid Body Dynamics, "Resting Contact": d''
    = A f + b). width: rows of a point, 3 or 6; a row that turns has l e_i in place of r_i x e_i,
    and no first term. arm: scratch, (2, wm, 3).
    """
    for i in range(m):
        for p in range(width):
            axis = p if p < 3 else p - 3
            e = (contacts.axes[chosen[i], axis, 0], contacts.axes[chosen[i], axis, 1],
                 contacts.axes[chosen[i], axis, 2])
            if p < 3:
                on_A = cross(row(contacts.r_A, chosen[i]), e)
                on_B = cross(row(contacts.r_B, chosen[i]), e)
            else:
                turn = length(model, contacts, chosen[i])
                on_A = (turn * e[0], turn * e[1], turn * e[2])
                on_B = on_A
            for k in range(3):
                arm[0, width * i + p, k] = -on_A[k]
                arm[1, width * i + p, k] = on_B[k]
    for i in range(width * m):
        for j in range(width * m):
            A[i, j] = 0.0
    for i in range(m):
        for side_i in range(2):
            body = contacts.body_a[chosen[i]] if side_i == 0 else contacts.body_b[chosen[i]]
            if model.inv_m[body] == 0.0:
                continue
            for j in range(i + 1):
                for side_j in range(2):
                    other = contacts.body_b[chosen[j]]
                    if side_j == 0:
                        other = contacts.body_a[chosen[j]]
                    if other == body:
                        sign = 1.0 if side_i == side_j else -1.0
                        _add_block(contacts, chosen, i, j, width, sign * model.inv_m[body],
                                   arm, side_i, side_j, bodies.inv_I_W, body, A)
    for i in range(width * m):
        for j in range(i):
            A[j, i] = A[i, j]


@kernel
def _add_block(contacts: Contacts, chosen: IntArray, i: int, j: int, width: int, inv_m: float,
               arm: Array, side_i: int, side_j: int, inv_I_W: Array, body: int, A: Array) -> None:
    for p in range(width):
        for q in range(width):
            if i == j and q > p:
                continue
            total = 0.0
            for k in range(3):
                if p < 3 and q < 3:
                    total += (inv_m * contacts.axes[chosen[i], p, k]
                              * contacts.axes[chosen[j], q, k])
                for c in range(3):
                    total += (arm[side_i, width * i + p, k] * inv_I_W[body, k, c]
                              * arm[side_j, width * j + q, c])
            A[width * i + p, width * j + q] += total


@kernel
def resting_rates(model: Model, shapes: Shapes, contacts: Contacts, bodies: Bodies,
                  chosen: IntArray, width: int, u: Array, span: float, closing: float,
                  b: Array) -> bool:
    """
    Write b of a = A f + b: accelerations without contact forces, and what stops points.

    a = 0 then means that the point, with the rates u at the end of the span [s] but for the loads,
    has stopped there, so that neither a velocity nor a gap that rounding left behind can grow from
    step to step: of the gap a part is closed in `closing` [s]. Returns whether a point overlaps so
    much that this would give it a speed worth mentioning: that is left to displacements.
    """
    deep = False
    for c in range(chosen.shape[0]):
        k, at = chosen[c], width * c
        read_rates(model, contacts, bodies.acceleration, k, width, b, at)
        gap = contacts.gap[k] - common_film(shapes, contacts, chosen, c)
        wanted = -CLOSING * gap / closing
        if wanted <= LIFTING * resting_speed(contacts, bodies, k, model.h):
            u[at] -= wanted
        else:
            deep = True
        for i in range(width):
            b[at + i] += u[at + i] / span
    return deep


@kernel
def common_film(shapes: Shapes, contacts: Contacts, chosen: IntArray, c: int) -> float:
    """
    Return the gap [m] at which chosen point c is to rest.

    It is one for all points of a pair of bodies along one normal: on triangles of many sizes a box
    would be tilted by what their films differ by, and a light one under a load driven aside.
    """
    k = chosen[c]
    thick = film(shapes, contacts.shape_a[k], contacts.shape_b[k])
    if thick == 0.0:
        return 0.0
    for i in chosen:
        if (contacts.body_a[i] == contacts.body_a[k] and contacts.body_b[i] == contacts.body_b[k]
                and dot(row(contacts.axes[i], 0), row(contacts.axes[k], 0)) > 1.0 - FLUSH):
            thick = max(thick, film(shapes, contacts.shape_a[i], contacts.shape_b[i]))
    return thick


def _pyramid(mu: Array, pull: Array) -> Any:
    """
    Return the rows C of C f >= 0: f_n, and for each disk what bounds it.

    That is SIDES sides with an edge along `pull`, (m, w), for two rows, and two for one.
    """
    m, width = pull.shape
    parts = [np.zeros((m, 1, width))]
    parts[0][:, 0, 0] = 1.0
    for d in range(mu.shape[1]):
        first, size = disk(d)
        sides = np.zeros((m, SIDES if size == 2 else 2, width))
        if size == 2:
            angle = np.arctan2(pull[:, first + 1], pull[:, first])
            phi = angle[:, None] + (2.0 * np.pi / SIDES) * (np.arange(SIDES) + 0.5)
            sides[:, :, 0] = mu[:, d, None] * np.cos(np.pi / SIDES)
            sides[:, :, first], sides[:, :, first + 1] = -np.cos(phi), -np.sin(phi)
        else:
            sides[:, :, 0] = mu[:, d, None]
            sides[:, 0, first], sides[:, 1, first] = 1.0, -1.0
        parts.append(sides)
    rows = np.concatenate(parts, axis=1)
    count, at = rows.shape[1], np.arange(m)
    i = np.broadcast_to((at * count)[:, None, None] + np.arange(count)[None, :, None], rows.shape)
    j = np.broadcast_to((width * at)[:, None, None] + np.arange(width)[None, None, :], rows.shape)
    from scipy import sparse        # as OSQP below

    return sparse.csc_matrix((rows.ravel(), (i.ravel(), j.ravel())),
                             shape=(m * count, width * m))


def _osqp(A: Array, q: Array, C: Any, f: Array) -> tuple[Array, str, int]:
    """Return the minimiser of f'Af/2 + q'f over C f >= 0, OSQP's status and its iterations."""
    # Here, not above: a tenth of a second at each start, and most worlds never need it.
    import osqp
    from scipy import sparse

    # In units in which A and q are of order 1, so that the absolute tolerance means something.
    per_force = float(np.trace(A)) / len(A)
    size = max(float(np.abs(q).max()), 1e-300)
    solver = osqp.OSQP()
    count = C.shape[0]
    try:
        solver.setup(sparse.csc_matrix(np.triu(A / per_force)), q / size, C, np.zeros(count),
                     np.full(count, np.inf), **OSQP_SETTINGS)
    except osqp.OSQPException:
        # A is positive semi-definite but for the rounding of numbers of very different sizes.
        return np.zeros_like(f), 'problem non convex', 0
    solver.warm_start(x=f * (per_force / size))
    result = solver.solve(raise_error=False)
    found = np.asarray(result.x, dtype=np.float64) * (size / per_force)
    if not np.isfinite(found).all():
        found = np.zeros_like(f)
    return found, str(result.info.status), int(result.info.iter)


class Problem(NamedTuple):
    """A, b and mu as the methods of contact_rows.py and contact_newton.py take them."""

    rows: Rows
    newton: Newton


def make_problem(A: Array, b: Array, mu: Array) -> Problem:
    """Return the problem of m points with the coefficients mu, (m, 1) or (m, 3)."""
    m, size = len(mu), len(b)
    problem = Problem(make_rows(m, size, 0, 0, matrix=size), make_newton(m, size, 0, 0, size))
    read_matrix(problem.rows, m, size // m, A, mu, 0.0)
    problem.rows.b[:] = b
    return problem


def improve(problem: Problem, f: Array, sweeps: int, goal: float, steps: int) -> float:
    """
    Improve f, in place, by so many sweeps and then Newton's method; return its violation.

    Sweeps cannot end in a cycle as Newton's method can, but only creep where points are redundant.
    """
    rows, m = problem.rows, len(problem.rows.mu)
    width = len(f) // m
    rows.f[:] = f
    violation(rows, m, width, rows.f)
    sweep_rows(rows, m, width, rows.f, sweeps, 0.0)
    worst = float(refine_rows(rows, m, width, 0, goal, steps, problem.newton))
    f[:] = rows.f
    return worst


def coefficient_table(mu: Array, rows: int) -> Array:
    """Return the coefficients as (m, 1) or, with rows for spinning and rolling, (m, 3)."""
    m = len(mu)
    return np.ascontiguousarray(mu.reshape(m, -1)[:, :coefficients(rows // m)])


def soften(A: Array, compliance: float = COMPLIANCE) -> Array:
    """Return A with its diagonal larger by that fraction."""
    return A + np.diag(compliance * np.diag(A))


def solve(A: Array, b: Array, mu: Array, start: Array) -> tuple[Array, Outcome]:
    """
    Return the forces (wm,) at m points and how they were found; w = 3 or 6 rows to a point.

    The rows of a point are (n, t1, t2) and perhaps spin about n and roll about t1, t2. A is (wm,
    wm) [1/kg], b (wm,) [m/s^2], mu (m,) or (m, 3); `start` are forces to begin with, those of the
    last step. The result is a function of the arguments alone. Where the conditions cannot be met
    to TOLERANCE (with friction there may be no solution: Painleve) the best forces found are
    returned with solved=False.
    """
    size = float(np.abs(b).max(initial=0.0))
    f, stiff, table = start.copy(), soften(A), coefficient_table(mu, len(b))
    # Forces that carry over come with a division into open, sticking and sliding points: try that
    # first.
    worst = improve(make_problem(stiff, b, table), f, 0, GOAL * size,
                    FEW_STEPS if start.any() else 0)
    if worst <= EARLY_TOLERANCE * size:
        return f, Outcome(worst / max(size, 1e-300), True, CARRIED_OVER, 0)
    return search(stiff, b, table, start)


def search(A: Array, b: Array, mu: Array, start: Array) -> tuple[Array, Outcome]:
    """
    Return the forces and how they were found, where those of the last step are no solution.

    As `solve`, but A has its compliance already, and mu is (m, 1) or (m, 3).
    """
    best, outcome = _search(A, b, mu, start)
    if not outcome.solved:
        # Redundant points on the verge of slipping: let their compliance be a little larger, for
        # this step.
        other, softer = _search(soften(A, SOFTER), b, mu, start)
        if softer.residual < outcome.residual:
            best, outcome = other, softer
    return best, outcome


def _slip(mu: Array, a: Array) -> Array:
    """Return s_n = sum of mu |a| over the disks of each point, from a (m, w)."""
    total = np.zeros(len(mu))
    for d in range(mu.shape[1]):
        first, size = disk(d)
        total += mu[:, d] * np.linalg.norm(a[:, first:first + size], axis=1)
    return total


def _search(A: Array, b: Array, mu: Array, start: Array) -> tuple[Array, Outcome]:
    """Iterate for s, with OSQP for each s, until the conditions hold; see `solve`."""
    m, size = len(mu), float(np.abs(b).max(initial=0.0))
    width = len(b) // m
    best, worst, status, iterations = start, np.inf, '', 0
    now, problem = start, make_problem(A, b, mu)
    for turn in range(ROUNDS + 1):
        if turn < ROUNDS:
            a, f = (A @ now + b).reshape(m, width), now.reshape(m, width)
            # Edges of the pyramid where friction pulls or, where none does yet, against the slip
            # that is coming.
            pulls = np.hypot(f[:, 1], f[:, 2]) > 0.0
            q = b.copy()
            q[::width] += _slip(mu, a) * (f[:, 0] > 0.0)
            now, status, count = _osqp(A, q, _pyramid(mu, np.where(pulls[:, None], f, -a)), now)
            iterations += count
        most = int(LAST_PRODUCTS / len(b) ** 2)
        for sweeps in (0, SWEEPS) if turn < ROUNDS else (min(n, most) for n in LAST_SWEEPS):
            trial = now.copy()
            left = improve(problem, trial, sweeps, GOAL * size, NEWTON_STEPS)
            if left < worst:
                worst, best = left, trial
            if worst <= EARLY_TOLERANCE * size:
                break
        if worst <= (EARLY_TOLERANCE if turn < FEW_ROUNDS else TOLERANCE) * size:
            break
    return best, Outcome(worst / max(size, 1e-300), worst <= TOLERANCE * size, status, iterations)
