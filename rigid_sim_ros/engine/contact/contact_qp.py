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

Torques against spinning and rolling obey the same law with coefficients of their own, about the
normal and in the tangential plane: three disks in place of one, and three more rows to a point.

OSQP solves each program over a pyramid in place of the cone, whose edges point along the friction
force; it finds which points press and which slide. Newton's method on the exact conditions takes
it from there to rounding, and while that division of the points lasts, from step to step without
OSQP.
"""

from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

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
# Sweeps where nothing else led on: redundant points on the verge of slipping, towards which the
# sweeps creep. 1e4 take 15 ms for six points; at most as many as so many products allow.
LAST_SWEEPS = (1000, 10000)
LAST_PRODUCTS = 2e7
ROUNDS = 8  # of the iteration for s
FEW_ROUNDS = 3  # after so many, TOLERANCE will do
NEWTON_STEPS = 40
CARRIED_OVER = 'carried over'
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
def coefficients(width: int) -> int:
    """Return how many coefficients, and disks, a point with so many rows has: 1 or 3."""
    return width // 3 * 2 - 1


@kernel
def disk(d: int) -> tuple[int, int]:
    """Return the first row of disk d of a point and how many it has: slip, spin, roll."""
    if d == 0:
        return 1, 2
    if d == 1:
        return 3, 1
    return 4, 2


@kernel
def _stiffness(A: Array, x: int, rows: int) -> float:
    """Return the larger diagonal entry of the rows of a disk [1/kg]."""
    return max(A[x, x], A[x + rows - 1, x + rows - 1])


@kernel
def _violation(A: Array, b: Array, mu: Array, f: Array, a: Array) -> float:
    """Write a = A f + b and return by how much the conditions are violated [unit of b]."""
    rows = b.shape[0]
    for i in range(rows):
        total = b[i]
        for j in range(rows):
            total += A[i, j] * f[j]
        a[i] = total
    worst, width = 0.0, rows // mu.shape[0]
    for k in range(mu.shape[0]):
        n = width * k
        stiff = A[n, n]
        pressed = max(0.0, f[n] - a[n] / stiff)
        worst = max(worst, abs(f[n] - pressed) * stiff)
        for d in range(coefficients(width)):
            first, size = disk(d)
            x, y = n + first, n + first + size - 1
            stiff = _stiffness(A, x, size)
            w_x = f[x] - a[x] / stiff
            w_y = f[y] - a[y] / stiff if size == 2 else 0.0
            length, limit = np.sqrt(w_x * w_x + w_y * w_y), mu[k, d] * max(0.0, f[n])
            if length > limit:
                w_x, w_y = w_x * limit / length, w_y * limit / length
            worst = max(worst, abs(f[x] - w_x) * stiff)
            if size == 2:
                worst = max(worst, abs(f[y] - w_y) * stiff)
    return worst


def _table(mu: Array, rows: int) -> Array:
    """Return the coefficients as (m, 1) or, with rows for spinning and rolling, (m, 3)."""
    m = len(mu)
    return np.ascontiguousarray(mu.reshape(m, -1)[:, :coefficients(rows // m)])


def residual(A: Array, b: Array, mu: Array, f: Array) -> float:
    """
    Return how far forces are from the conditions at the top of this file, relative to max |b|.

    It is the largest |f - P(f - a / A_ii)| A_ii over the points, P the projection onto f_n >= 0
    and onto the disk |f_t| <= mu f_n: an acceleration, and 0 exactly for a solution.
    """
    worst = float(_violation(A, b, _table(mu, len(b)), f, np.empty_like(b)))
    return worst / max(float(np.abs(b).max()), 1e-300)


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
def _newton_rows(A: Array, a: Array, mu: Array, f: Array, k: int, M: Array, x: Array) -> None:
    """
    Write the equations of point k for the change of f: M df = x.

    They are the derivatives of f = P(f - a / A_ii) in the case that holds at f: open, sticking,
    sliding (Alart, Curnier, A mixed formulation for frictional contact problems, Comput. Methods
    Appl. Mech. Eng. 92 (1991)).
    """
    rows = x.shape[0]
    width = rows // mu.shape[0]
    n = width * k
    for i in range(n, n + width):
        for j in range(rows):
            M[i, j] = 0.0
    if f[n] - a[n] / A[n, n] <= 0.0:
        for i in range(n, n + width):
            M[i, i] = 1.0
            x[i] = -f[i]
        return
    for j in range(rows):
        M[n, j] = A[n, j] / A[n, n]
    x[n] = -a[n] / A[n, n]
    for d in range(coefficients(width)):
        first, size = disk(d)
        _newton_disk(A, a, mu[k, d], f, n, n + first, size, M, x)


@kernel
def _newton_disk(A: Array, a: Array, mu: float, f: Array, n: int, p: int, size: int, M: Array,
                 x: Array) -> None:
    """Write the equations of one disk: `size` rows from p on, of the point with the normal n."""
    rows, q = x.shape[0], p + size - 1
    stiff = _stiffness(A, p, size)
    w_x = f[p] - a[p] / stiff
    w_y = f[q] - a[q] / stiff if size == 2 else 0.0
    length, limit = np.sqrt(w_x * w_x + w_y * w_y), mu * max(0.0, f[n])
    if length <= limit:
        for i in range(p, q + 1):
            for j in range(rows):
                M[i, j] = A[i, j] / stiff
            x[i] = -a[i] / stiff
        return
    e_x, e_y = w_x / length, w_y / length
    bend = limit / length
    # d(limit e) = mu e df_n + limit / |w| (1 - e e') (df_t - da_t / stiff)
    for i in range(size):
        e_i = e_x if i == 0 else e_y
        along_x = bend * ((1.0 if i == 0 else 0.0) - e_i * e_x)
        along_y = bend * ((1.0 if i == 1 else 0.0) - e_i * e_y)
        if size == 1:
            along_x, along_y = 0.0, 0.0
        for j in range(rows):
            M[p + i, j] = (along_x * A[p, j] + along_y * A[q, j]) / stiff
        M[p + i, n] -= mu * e_i
        M[p + i, p] -= along_x
        M[p + i, q] -= along_y
        M[p + i, p + i] += 1.0
        x[p + i] = limit * e_i - f[p + i]


def _improve(A: Array, b: Array, mu: Array, f: Array, goal: float,
             steps: int) -> tuple[float, int]:
    """Improve f as `refine` does, with scratch memory of its own."""
    rows = len(b)
    violation, done = refine(A, b, mu, f, goal, steps, np.empty(rows), np.empty(rows),
                             np.empty((rows, rows)), np.empty(rows))
    return float(violation), int(done)


@kernel
def refine(A: Array, b: Array, mu: Array, f: Array, goal: float, steps: int, a: Array,
           trial: Array, M: Array, x: Array) -> tuple[float, int]:
    """
    Improve f, in place, by Newton's method; return its violation [unit of b] and the steps taken.

    It ends at a violation of `goal` [unit of b], after `steps`, or when it gains nothing any more.
    a, trial, x, (rows,), and M, (rows, rows), are scratch.
    """
    rows = b.shape[0]
    for i in range(rows):
        trial[i] = f[i]
    best = _violation(A, b, mu, f, a)
    idle = 0
    if best <= goal:
        return best, 0
    for step in range(steps):
        if best <= goal or idle > 6:
            return best, step
        for k in range(mu.shape[0]):
            _newton_rows(A, a, mu, trial, k, M, x)
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
    rows = b.shape[0]
    width = rows // mu.shape[0]
    for _ in range(count):
        for k in range(mu.shape[0]):
            n = width * k
            before = f[n]
            f[n] = max(0.0, before - a[n] / A[n, n])
            for i in range(rows):
                a[i] += A[i, n] * (f[n] - before)
            for d in range(coefficients(width)):
                first, size = disk(d)
                _sweep_disk(A, mu[k, d] * f[n], f, n + first, size, a)


@kernel
def _sweep_disk(A: Array, limit: float, f: Array, p: int, size: int, a: Array) -> None:
    """Project the forces of one disk after a step against its rates."""
    q = p + size - 1
    x, y = f[p], f[q]
    # The largest eigenvalue of the 2 x 2 block bounds the step, so that the projection converges.
    stiff = _stiffness(A, p, size) + (abs(A[p, q]) if size == 2 else 0.0)
    w_x = x - a[p] / stiff
    w_y = y - a[q] / stiff if size == 2 else 0.0
    length = np.sqrt(w_x * w_x + w_y * w_y)
    if length > limit:
        w_x, w_y = w_x * limit / length, w_y * limit / length
    f[p] = w_x
    for i in range(a.shape[0]):
        a[i] += A[i, p] * (w_x - x)
    if size == 2:
        f[q] = w_y
        for i in range(a.shape[0]):
            a[i] += A[i, q] * (w_y - y)


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
    f, stiff, table = start.copy(), soften(A), _table(mu, len(b))
    # Forces that carry over come with a division into open, sticking and sliding points: try that
    # first.
    worst, steps = _improve(stiff, b, table, f, GOAL * size, FEW_STEPS if start.any() else 0)
    if worst <= ENOUGH * size:
        return f, Outcome(worst / max(size, 1e-300), True, CARRIED_OVER, 0, steps)
    return search(stiff, b, table, start)


def search(A: Array, b: Array, mu: Array, start: Array) -> tuple[Array, Outcome]:
    """
    Return the forces and how they were found, where those of the last step are no solution.

    As `solve`, but A has its compliance already, and mu is (m, 1) or (m, 3).
    """
    best, outcome = _search(A, b, mu, start)
    if not outcome.solved:
        # Redundant points on the verge of slipping: let them give way a little more, for this
        # step.
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
    best, worst, status, iterations, steps = start, np.inf, '', 0, 0
    now = start
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
            sweep(A, b, mu, trial, sweeps)
            violation, more = _improve(A, b, mu, trial, GOAL * size, NEWTON_STEPS)
            steps += more
            if violation < worst:
                worst, best = violation, trial
            if worst <= ENOUGH * size:
                break
        if worst <= (ENOUGH if turn < FEW_ROUNDS else TOLERANCE) * size:
            break
    return best, Outcome(worst / max(size, 1e-300), worst <= TOLERANCE * size, status, iterations,
                         steps)
