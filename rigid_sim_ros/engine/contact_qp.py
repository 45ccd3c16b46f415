# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Forces that keep touching bodies from moving into each other.

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

OSQP solves each program over a pyramid in place of the cone, whose edges point along the friction
force; it finds which points press and which slide. Newton's method on the exact conditions takes
it from there to rounding, and while that division of the points lasts, from step to step without
OSQP.
"""

from typing import NamedTuple

import numpy as np
import osqp
from scipy import sparse

from rigid_sim_ros.engine.arrays import Array
from rigid_sim_ros.engine.kernel import kernel

# Sides of the pyramid. Friction off its edges is up to 1 - cos(pi / 8) = 8 % too weak, until
# Newton's method.
SIDES = 8
# Fixed, so that runs repeat: OSQP would otherwise choose the interval from the time that its setup
# took.
OSQP_SETTINGS = {'verbose': False, 'eps_abs': 1e-10, 'eps_rel': 1e-10, 'max_iter': 5000,
                 'adaptive_rho_interval': 25, 'check_termination': 25, 'polishing': False,
                 'time_limit': 1e10}
# A is singular where points are redundant (the four corners of a box): the forces are not unique,
# A f is, and rounding in b can make sticking everywhere impossible. Each A_ii grows by this
# fraction, as if the points gave way a little: redundant points share the load evenly, and a
# contact under the force f yields with the acceleration 1e-8 A_ii f, 1e-10 m/s for a body under
# its weight at a step of 1 ms. Smaller: forces feel rounding more.
COMPLIANCE = 1e-8
# Compliance for a step that finds no solution otherwise: 1e-8 m/s for a body under its weight
SOFTER = 1e-6
SWEEPS = 300  # of Gauss-Seidel, where Newton's method does not get on from OSQP's forces
ROUNDS = 8  # of the iteration for s
FEW_ROUNDS = 3  # after so many, TOLERANCE will do
NEWTON_STEPS = 40
FEW_STEPS = 4  # while the division of the points lasts, 1 or 2 are enough
# Newton's method ends at a violation this small against |b|; rounding leaves 1e-16 to 1e-13.
GOAL = 1e-12
# Less than ENOUGH ends the search: 1e-9 of g moves a body at rest with 1e-11 m/s after a step of 1
# ms. Redundant points on the verge of slipping may stay above it; more than TOLERANCE after ROUNDS
# is not solved.
ENOUGH = 1e-9
TOLERANCE = 1e-7


class Outcome(NamedTuple):
    """How a set of contact forces was found."""

    residual: float  # violation of the conditions, relative to |b|; see `residual`
    solved: bool  # whether that is within TOLERANCE
    status: str  # OSQP's own word, or 'carried over' where it was not needed
    osqp_iterations: int
    newton_steps: int


@kernel
def _violation(A: Array, b: Array, mu: Array, f: Array, a: Array) -> float:
    """Write a = A f + b and return by how much the conditions are violated [unit of b]."""
    rows = b.shape[0]
    for i in range(rows):
        total = b[i]
        for j in range(rows):
            total += A[i, j] * f[j]
        a[i] = total
    worst = 0.0
    for k in range(mu.shape[0]):
        n = 3 * k
        stiff = A[n, n]
        pressed = max(0.0, f[n] - a[n] / stiff)
        worst = max(worst, abs(f[n] - pressed) * stiff)
        stiff = max(A[n + 1, n + 1], A[n + 2, n + 2])
        w_x, w_y = f[n + 1] - a[n + 1] / stiff, f[n + 2] - a[n + 2] / stiff
        size, limit = np.sqrt(w_x * w_x + w_y * w_y), mu[k] * max(0.0, f[n])
        if size > limit:
            w_x, w_y = w_x * limit / size, w_y * limit / size
        worst = max(worst, abs(f[n + 1] - w_x) * stiff, abs(f[n + 2] - w_y) * stiff)
    return worst


def residual(A: Array, b: Array, mu: Array, f: Array) -> float:
    """
    Return how far forces are from the conditions at the top of this file, relative to max |b|.

    It is the largest |f - P(f - a / A_ii)| A_ii over the points, P the projection onto f_n >= 0
    and onto the disk |f_t| <= mu f_n: an acceleration, and 0 exactly for a solution.
    """
    return float(_violation(A, b, mu, f, np.empty_like(b))) / max(float(np.abs(b).max()), 1e-300)


@kernel
def _solve_linear(M: Array, x: Array) -> bool:
    """Replace x by M^-1 x, destroying M, by elimination; return False if M is singular."""
    size = x.shape[0]
    for k in range(size):
        p = k
        for i in range(k + 1, size):
            if abs(M[i, k]) > abs(M[p, k]):
                p = i
        if M[p, k] == 0.0:
            return False
        if p != k:
            for j in range(k, size):
                M[k, j], M[p, j] = M[p, j], M[k, j]
            x[k], x[p] = x[p], x[k]
        for i in range(k + 1, size):
            factor = M[i, k] / M[k, k]
            if factor != 0.0:
                for j in range(k + 1, size):
                    M[i, j] -= factor * M[k, j]
                x[i] -= factor * x[k]
    for k in range(size - 1, -1, -1):
        total = x[k]
        for j in range(k + 1, size):
            total -= M[k, j] * x[j]
        x[k] = total / M[k, k]
    return True


@kernel
def _newton_row(A: Array, a: Array, mu: Array, f: Array, k: int, M: Array, x: Array) -> None:
    """
    Write the three equations of point k for the change of f: M df = x.

    They are the derivatives of f = P(f - a / A_ii) in the case that holds at f: open, sticking,
    sliding (Alart, Curnier, A mixed formulation for frictional contact problems, Comput. Methods
    Appl. Mech. Eng. 92 (1991)).
    """
    n = 3 * k
    rows = x.shape[0]
    for i in range(n, n + 3):
        for j in range(rows):
            M[i, j] = 0.0
    if f[n] - a[n] / A[n, n] <= 0.0:
        for i in range(n, n + 3):
            M[i, i] = 1.0
            x[i] = -f[i]
        return
    stiff = max(A[n + 1, n + 1], A[n + 2, n + 2])
    w_x, w_y = f[n + 1] - a[n + 1] / stiff, f[n + 2] - a[n + 2] / stiff
    size, limit = np.sqrt(w_x * w_x + w_y * w_y), mu[k] * max(0.0, f[n])
    for j in range(rows):
        M[n, j] = A[n, j] / A[n, n]
    x[n] = -a[n] / A[n, n]
    if size <= limit:
        for i in range(n + 1, n + 3):
            for j in range(rows):
                M[i, j] = A[i, j] / stiff
            x[i] = -a[i] / stiff
        return
    e_x, e_y = w_x / size, w_y / size
    bend = limit / size
    # d(limit e) = mu e df_n + limit / |w| (1 - e e') (df_t - da_t / stiff)
    for i in range(2):
        e_i = e_x if i == 0 else e_y
        along_x = bend * ((1.0 if i == 0 else 0.0) - e_i * e_x)
        along_y = bend * ((1.0 if i == 1 else 0.0) - e_i * e_y)
        for j in range(rows):
            M[n + 1 + i, j] = (along_x * A[n + 1, j] + along_y * A[n + 2, j]) / stiff
        M[n + 1 + i, n] -= mu[k] * e_i
        M[n + 1 + i, n + 1] -= along_x
        M[n + 1 + i, n + 2] -= along_y
        M[n + 1 + i, n + 1 + i] += 1.0
        x[n + 1 + i] = limit * e_i - f[n + 1 + i]


def refine(A: Array, b: Array, mu: Array, f: Array, goal: float, steps: int) -> tuple[float, int]:
    """
    Improve f, in place, by Newton's method; return its violation [unit of b] and the steps taken.

    It ends at a violation of `goal` [unit of b], after `steps`, or when it gains nothing any more.
    """
    rows = len(b)
    violation, done = _refine(A, b, mu, f, goal, steps, np.empty(rows), f.copy(),
                              np.empty((rows, rows)), np.empty(rows))
    return float(violation), int(done)


@kernel
def _refine(A: Array, b: Array, mu: Array, f: Array, goal: float, steps: int, a: Array,
            trial: Array, M: Array, x: Array) -> tuple[float, int]:
    rows = b.shape[0]
    best = _violation(A, b, mu, f, a)
    idle = 0
    if best <= goal:
        return best, 0
    for step in range(steps):
        if best <= goal or idle > 6:
            return best, step
        for k in range(mu.shape[0]):
            _newton_row(A, a, mu, trial, k, M, x)
        if not _solve_linear(M, x):
            return best, step
        for i in range(rows):
            trial[i] += x[i]
        now = _violation(A, b, mu, trial, a)
        if not now < np.inf:
            return best, step
        idle += 1
        if now < best:
            # A gain worth another try; small ones, at rounding, let the counter run.
            if now < 0.5 * best:
                idle = 0
            best = now
            for i in range(rows):
                f[i] = trial[i]
    return best, steps


def sweep(A: Array, b: Array, mu: Array, f: Array, count: int) -> None:
    """
    Bring f nearer to a solution, in place, by `count` sweeps of projected Gauss-Seidel.

    It cannot end in a cycle as Newton's method can, but only creeps where points are redundant.
    """
    _sweep(A, b, mu, f, count, np.empty_like(b))


@kernel
def _sweep(A: Array, b: Array, mu: Array, f: Array, count: int, a: Array) -> None:
    _violation(A, b, mu, f, a)
    for _ in range(count):
        for k in range(mu.shape[0]):
            n = 3 * k
            before = f[n]
            f[n] = max(0.0, before - a[n] / A[n, n])
            for i in range(b.shape[0]):
                a[i] += A[i, n] * (f[n] - before)
            x, y = f[n + 1], f[n + 2]
            # The largest eigenvalue of the 2 x 2 block bounds the step, so that the projection
            # converges.
            stiff = max(A[n + 1, n + 1], A[n + 2, n + 2]) + abs(A[n + 1, n + 2])
            w_x, w_y = x - a[n + 1] / stiff, y - a[n + 2] / stiff
            size, limit = np.sqrt(w_x * w_x + w_y * w_y), mu[k] * f[n]
            if size > limit:
                w_x, w_y = w_x * limit / size, w_y * limit / size
            f[n + 1], f[n + 2] = w_x, w_y
            for i in range(b.shape[0]):
                a[i] += A[i, n + 1] * (w_x - x) + A[i, n + 2] * (w_y - y)


def _pyramid(mu: Array, angle: Array) -> sparse.csc_matrix:
    """Return the rows C of C f >= 0: f_n, then SIDES sides with an edge at `angle`."""
    m = len(mu)
    phi = angle[:, None] + (2.0 * np.pi / SIDES) * (np.arange(SIDES) + 0.5)
    rows = np.zeros((m, SIDES + 1, 3))
    rows[:, 0, 0] = 1.0
    rows[:, 1:, 0] = mu[:, None] * np.cos(np.pi / SIDES)
    rows[:, 1:, 1] = -np.cos(phi)
    rows[:, 1:, 2] = -np.sin(phi)
    at = np.arange(m)
    i = np.broadcast_to((at * (SIDES + 1))[:, None, None] + np.arange(SIDES + 1)[None, :, None],
                        rows.shape)
    j = np.broadcast_to((3 * at)[:, None, None] + np.arange(3)[None, None, :], rows.shape)
    return sparse.csc_matrix((rows.ravel(), (i.ravel(), j.ravel())), shape=(m * (SIDES + 1),
                                                                            3 * m))


def _osqp(A: Array, q: Array, C: sparse.csc_matrix, f: Array) -> tuple[Array, str, int]:
    """Return the minimiser of f'Af/2 + q'f over C f >= 0, OSQP's status and its iterations."""
    # In units in which A and q are of order 1, so that the absolute tolerance means something.
    per_force = float(np.trace(A)) / len(A)
    size = max(float(np.abs(q).max()), 1e-300)
    solver = osqp.OSQP()
    count = C.shape[0]
    solver.setup(sparse.csc_matrix(np.triu(A / per_force)), q / size, C, np.zeros(count),
                 np.full(count, np.inf), **OSQP_SETTINGS)
    solver.warm_start(x=f * (per_force / size))
    result = solver.solve(raise_error=False)
    found = np.asarray(result.x, dtype=np.float64) * (size / per_force)
    if not np.isfinite(found).all():
        found = np.zeros_like(f)
    return found, str(result.info.status), int(result.info.iter)


def soften(A: Array, compliance: float = COMPLIANCE) -> Array:
    """Return A with its diagonal larger by that fraction."""
    return A + np.diag(compliance * np.diag(A))


def solve(A: Array, b: Array, mu: Array, start: Array) -> tuple[Array, Outcome]:
    """
    Return the forces (3m,) at m points, triples (n, t1, t2), and how they were found.

    A is (3m, 3m) [1/kg], b (3m,) [m/s^2], mu (m,); `start` are forces to begin with, those of the
    last step. The result is a function of the arguments alone. Where the conditions cannot be met
    to TOLERANCE (with friction there may be no solution: Painleve) the best forces found are
    returned with solved=False.
    """
    size = float(np.abs(b).max(initial=0.0))
    f, stiff = start.copy(), soften(A)
    # Forces that carry over come with a division into open, sticking and sliding points: try that
    # first.
    worst, steps = refine(stiff, b, mu, f, GOAL * size, FEW_STEPS if start.any() else 0)
    if worst <= ENOUGH * size:
        return f, Outcome(worst / max(size, 1e-300), True, 'carried over', 0, steps)
    best, outcome = _search(stiff, b, mu, start)
    if not outcome.solved:
        # Redundant points on the verge of slipping: let them give way a little more, for this
        # step.
        other, softer = _search(soften(A, SOFTER), b, mu, start)
        if softer.residual < outcome.residual:
            best, outcome = other, softer
    return best, outcome


def _search(A: Array, b: Array, mu: Array, start: Array) -> tuple[Array, Outcome]:
    """Iterate for s, with OSQP for each s, until the conditions hold; see `solve`."""
    size = float(np.abs(b).max(initial=0.0))
    best, worst, status, iterations, steps = start, np.inf, '', 0, 0
    now = start
    for turn in range(ROUNDS):
        a = (A @ now + b).reshape(-1, 3)
        triples = now.reshape(-1, 3)
        slip = np.hypot(a[:, 1], a[:, 2]) * (triples[:, 0] > 0.0)
        # Edges of the pyramid where friction pulls or, where none does yet, against the slip that
        # is coming.
        pull = np.where((np.hypot(triples[:, 1], triples[:, 2]) > 0.0)[:, None], triples[:, 1:],
                        -a[:, 1:])
        q = b.copy()
        q[::3] += mu * slip
        now, status, count = _osqp(A, q, _pyramid(mu, np.arctan2(pull[:, 1], pull[:, 0])), now)
        iterations += count
        for sweeps in (0, SWEEPS):
            f = now.copy()
            sweep(A, b, mu, f, sweeps)
            violation, more = refine(A, b, mu, f, GOAL * size, NEWTON_STEPS)
            steps += more
            if violation < worst:
                worst, best = violation, f
            if worst <= ENOUGH * size:
                break
        if worst <= (ENOUGH if turn < FEW_ROUNDS else TOLERANCE) * size:
            break
    return best, Outcome(worst / max(size, 1e-300), worst <= TOLERANCE * size, status, iterations,
                         steps)
