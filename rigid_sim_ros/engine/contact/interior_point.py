# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
An interior point method for the rows of contact_rows.py.

With the cones K = {(s, t): s >= |t|}, Coulomb's law at a point says of each disk d of it that

    y_d = (mu_d f_n, f_d) in K,    u_d = (u_dn, a_d) in K,    y_d . u_d = 0,
    a_n = sum_d mu_d (u_dn - |a_d|)

(De Saxce, Feng, The bipotential method, Math. Comput. Modelling 28 (1998)). From inside of all
cones the method follows the points at which the product of y_d and u_d is one number for all, and
that number goes to 0 (Acary, Armand, Nguyen, Shpakovych, Second-order cone programming for
frictional contact mechanics using interior point algorithm, Optim. Methods Softw. 39 (2024)). How
many iterations that takes hardly depends on masses, points, or where it begins; and their order
decides nothing: redundant points end in the middle of the forces that would do. The last digits
are left to Newton's method.

An iteration takes two steps of Newton's method with one matrix (Mehrotra, SIAM J. Optim. 2
(1992)), in the scaling of Nesterov and Todd: with v_0 >= |v_t|, v_0^2 - v_t^2 = 1 and

    W^2 = eta (2 v v' - diag(1, -1, -1)),    u = W^2 y,

the changes of u are q - W^2 dy, and for each point, with rho = (1, -a_d / |a_d|),

    sum_d mu_d rho' W_d^2 dy_d + G_n dz = x_n,    T_d df_d + mu_d h_d df_n + G_d dz = x_d,

where T = eta (1 + 2 v_t v_t') + R and h = 2 eta v_0 v_t. One equation after the other is solved
for df, in forms in which nothing cancels at the border of a cone: E = H^-1 of the other methods is
made of sums of what has one sign.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contact_newton import add_point, Newton
from rigid_sim_ros.engine.contact.contact_rows import Rows, violation
from rigid_sim_ros.engine.contact.coulomb import coefficients, disk
from rigid_sim_ros.engine.maths.elimination import factor_linear, solve_factored
from rigid_sim_ros.kernels.arrays import Array, IntArray, Vector
from rigid_sim_ros.kernels.kernel import kernel

# At most; 10 to 25 are usual, of 1011 problems of heaps and columns that overlap 28 take more
# than 30.
ITERATIONS = 40
# The part of the way to the border of a cone that one goes at most.
BOUNDARY = 0.95
# No iteration aims at less than this part of the product.
LEAST = 1e-4
# Steps shorter than this part of the whole gain nothing; so many of them in turn end it.
SHORT, MANY = 0.2, 3
# The violation, in parts of |b|, of the point on the way from which the same points under slightly
# other forces begin.
NEAR = 1e-3


class Interior(NamedTuple):
    """Scratch memory for c points, r rows of them and s bodies that are touched."""

    dual: Array  # (c, 9) u of each disk
    change: Array  # (c, 9) of u in a step
    aim: Array  # (c, 9) q, to which u + W^2 dy comes
    scale: Array  # (c, 12) v and sqrt(eta) of each disk
    turn: Array  # (c, 12) T^-1 along and across v_t, and the direction of v_t
    x: Array  # (r,) right sides
    back: Array  # (r,) mu T^-1 h: what friction follows of the normal force
    row: Array  # (r,) mu T^-1 b with rho' W^2 = (a, b): what the normal force takes of it
    schur: Array  # (c,) of the normal force, without friction
    right: Array  # (6 s,)
    order: IntArray  # (6 s,)
    start: Array  # (r,) forces to go back to
    on_way: IntArray  # (1,) whether the following ones are of the problem before
    force_then: Array  # (r,) forces that were NEAR to the solution
    dual_then: Array  # (c, 9) and their u


def make_interior(points: int, rows: int, touched: int) -> Interior:
    """Return room for so many points, rows and bodies that are touched."""
    c, r, s = points, rows, 6 * touched
    return Interior(np.zeros((c, 9)), np.zeros((c, 9)), np.zeros((c, 9)), np.zeros((c, 12)),
                    np.zeros((c, 12)), np.zeros(r), np.zeros(r), np.zeros(r), np.zeros(c),
                    np.zeros(s), np.zeros(s, dtype=np.int64), np.zeros(r),
                    np.zeros(1, dtype=np.int64), np.zeros(r), np.zeros((c, 9)))


@kernel
def approach_solution(rows: Rows, m: int, width: int, touched: int, size: float, goal: float,
                      again: bool, proximal: Array, w: Newton,
                      i: Interior) -> tuple[int, float]:
    """
    Write rows.f, forces near to a solution, whatever stands there.

    `again`: a problem like the one before, of the same points, begins on the way to its solution.

    As if the points did not yield: rows.b has `proximal`, (r,), subtracted of that. size and goal
    are |b| and a violation [unit of b]. Returns how many iterations it took, and the violation.
    """
    f, count = rows.f, width * m
    if not again:
        i.on_way[0] = 0
    if i.on_way[0] == 0:
        _begin(rows, m, width, size, i)
    else:
        _copy(m, width, i.force_then, rows.f, i.dual_then, i.dual)
    best, idle, turn = np.inf, 0, 0
    while turn < ITERATIONS:
        worst = _violation(rows, m, width, proximal)
        if worst < best:
            best = worst
            for k in range(count):
                rows.trial[k] = f[k]
        if best <= goal or idle >= MANY:
            break
        if i.on_way[0] == 0 and worst <= NEAR * size:
            _copy(m, width, rows.f, i.force_then, i.dual, i.dual_then)
            i.on_way[0] = 1
        mean = _mean_product(rows, m, width, i)
        if not (_write_systems(rows, m, width, w, i) and _factor(rows, m, width, touched, w, i)):
            break
        _write_aims(rows, m, width, 0.0, False, w, i)
        far = min(1.0, _find_step(rows, m, width, touched, w, i))
        _write_aims(rows, m, width, max((1.0 - far) ** 3, LEAST) * mean, True, w, i)
        far = min(1.0, BOUNDARY * _find_step(rows, m, width, touched, w, i))
        if far == 0.0:
            break
        idle = 0 if far > SHORT else idle + 1
        for k in range(count):
            f[k] += far * w.y[k]
        for c in range(m):
            for k in range(9):
                i.dual[c, k] += far * i.change[c, k]
        turn += 1
    for k in range(count):
        f[k] = rows.trial[k]
    return turn, best


@kernel
def _violation(rows: Rows, m: int, width: int, proximal: Array) -> float:
    """Write the rates of rows.f as if points did not yield; return what they violate."""
    for k in range(width * m):
        rows.b[k] -= rows.compliance[k] * rows.f[k] - proximal[k]
    worst = violation(rows, m, width, rows.f)
    for k in range(width * m):
        rows.b[k] += rows.compliance[k] * rows.f[k] - proximal[k]
    return worst


# --- cones ---------------------------------------------------------------------------------------


@kernel
def _share(rows: Rows, c: int, d: int, width: int) -> float:
    """Return mu_d, 0: there is no such disk; without friction 1, for f_n >= 0 alone."""
    if d > 0 or rows.mu[c, 0] > 0.0:
        return float(rows.mu[c, d])
    for other in range(1, coefficients(width)):
        if rows.mu[c, other] > 0.0:
            return 0.0
    return 1.0


@kernel
def _disk_of(rows: Rows, c: int, d: int) -> tuple[int, int]:
    """Return the first row of disk d in its point, and how many it has that can be used."""
    first, size = disk(d)
    return first, size if rows.mu[c, d] > 0.0 else 0


@kernel
def _cone(rows: Rows, c: int, d: int, width: int, f: Array) -> Vector:
    """Return y of a disk for forces f, or how it changes with them."""
    n, (first, size) = width * c, _disk_of(rows, c, d)
    return (_share(rows, c, d, width) * f[n], f[n + first] if size > 0 else 0.0,
            f[n + first + 1] if size > 1 else 0.0)


@kernel
def _three(table: Array, c: int, at: int) -> Vector:
    return (table[c, at], table[c, at + 1], table[c, at + 2])


@kernel
def _determinant(x: Vector) -> float:
    """Return s^2 - t^2 of x = (s, t)."""
    long = np.sqrt(x[1] * x[1] + x[2] * x[2])
    return float((x[0] - long) * (x[0] + long))


@kernel
def _product(x: Vector, y: Vector) -> Vector:
    """Return the product of Jordan: (x . y, x_0 y_t + y_0 x_t)."""
    return (x[0] * y[0] + x[1] * y[1] + x[2] * y[2], x[0] * y[1] + y[0] * x[1],
            x[0] * y[2] + y[0] * x[2])


@kernel
def _quotient(x: Vector, y: Vector) -> Vector:
    """Return z whose product with x is y."""
    z_0 = (x[0] * y[0] - x[1] * y[1] - x[2] * y[2]) / _determinant(x)
    return (z_0, (y[1] - z_0 * x[1]) / x[0], (y[2] - z_0 * x[2]) / x[0])


@kernel
def _scaled(i: Interior, c: int, d: int, x: Vector, sign: float) -> Vector:
    """Return W x, or with the sign -1 W^-1 x."""
    v, root = _three(i.scale, c, 4 * d), i.scale[c, 4 * d + 3]
    along = sign * (v[1] * x[1] + v[2] * x[2])
    part, times = x[0] + along / (1.0 + v[0]), root if sign > 0.0 else 1.0 / root
    return (times * (v[0] * x[0] + along), times * (x[1] + sign * part * v[1]),
            times * (x[2] + sign * part * v[2]))


@kernel
def _way(x: Vector, d: Vector) -> float:
    """Return how far x may go along d within the cone, in parts of d."""
    a, b = d[0] * d[0] - d[1] * d[1] - d[2] * d[2], x[0] * d[0] - x[1] * d[1] - x[2] * d[2]
    c = _determinant(x)
    far, square = -x[0] / d[0] if d[0] < 0.0 else np.inf, b * b - a * c
    if square >= 0.0:
        q = -(b + np.copysign(np.sqrt(square), b))
        if q != 0.0 and c / q > 0.0:
            far = min(far, c / q)
        if a != 0.0 and q / a > 0.0:
            far = min(far, q / a)
    return float(far)


# --- an iteration --------------------------------------------------------------------------------


@kernel
def _begin(rows: Rows, m: int, width: int, size: float, i: Interior) -> None:
    """Begin with y and u whose product is the same at all points: what bears the heaviest body."""
    least = np.inf
    for c in range(m):
        at = rows.at[width * c]
        for e in range(2):
            moved = 0.0
            for k in range(6 * e, 6 * e + 6):
                moved += rows.G[width * c, k] * rows.W[at + k]
            least = min(least, moved) if moved > 0.0 else least
    for c in range(m):
        n, share = width * c, 0.0
        for q in range(width):
            rows.f[n + q] = 0.0
        for q in range(9):
            i.dual[c, q] = 0.0
        for d in range(coefficients(width)):
            if _share(rows, c, d, width) > 0.0:
                share = max(share, _share(rows, c, d, width))
                i.dual[c, 3 * d] = size
        rows.f[n] = size / (least * share)


@kernel
def _copy(m: int, width: int, f: Array, to_f: Array, dual: Array, to_dual: Array) -> None:
    """Copy forces and u of the points."""
    for k in range(width * m):
        to_f[k] = f[k]
    for c in range(m):
        for k in range(9):
            to_dual[c, k] = dual[c, k]


@kernel
def _mean_product(rows: Rows, m: int, width: int, i: Interior) -> float:
    total, count = 0.0, 0
    for c in range(m):
        for d in range(coefficients(width)):
            if _share(rows, c, d, width) > 0.0:
                y, u = _cone(rows, c, d, width, rows.f), _three(i.dual, c, 3 * d)
                total += y[0] * u[0] + y[1] * u[1] + y[2] * u[2]
                count += 1
    return total / count


@kernel
def _write_systems(rows: Rows, m: int, width: int, w: Newton, i: Interior) -> bool:
    """Write the equations of each point; False: it is at the border of a cone by rounding."""
    for c in range(m):
        n = width * c
        i.schur[c] = rows.compliance[n]
        for q in range(width):
            i.back[n + q] = i.row[n + q] = 0.0
            for r in range(width):
                w.E[c, q, r] = 0.0
        for d in range(coefficients(width)):
            if _share(rows, c, d, width) > 0.0 and not (
                    _write_scale(rows, c, d, width, i) and _add_disk(rows, c, d, width, w, i)):
                return False
        i.back[n] = i.row[n] = -1.0
        for q in range(width):
            for r in range(width):
                w.E[c, q, r] += i.back[n + q] * i.row[n + r] / i.schur[c]
    return True


@kernel
def _write_scale(rows: Rows, c: int, d: int, width: int, i: Interior) -> bool:
    y, u = _cone(rows, c, d, width, rows.f), _three(i.dual, c, 3 * d)
    of_y, of_u = _determinant(y), _determinant(u)
    if not (of_y > 0.0 and of_u > 0.0):
        return False
    of_y, of_u = np.sqrt(of_y), np.sqrt(of_u)
    inner = (y[0] * u[0] + y[1] * u[1] + y[2] * u[2]) / (of_y * of_u)
    part, sign = 1.0 / np.sqrt(2.0 * (1.0 + inner)), 1.0
    for k in range(3):
        i.scale[c, 4 * d + k] = part * (u[k] / of_u + sign * y[k] / of_y)
        sign = -1.0
    i.scale[c, 4 * d + 3] = np.sqrt(of_u / of_y)
    return True


@kernel
def _add_disk(rows: Rows, c: int, d: int, width: int, w: Newton, i: Interior) -> bool:
    """
    Add what a disk does to the equations of its point.

    rho' W^2 = eta (2 (rho . v) v - (1, a_d / |a_d|)), rho . v = 1 / (v_0 + |v_t|) + |v_t| (1 -
    cos) with the angle between a_d and v_t: of (a, b) along and across v_t that leaves

        a = 1 / (v_0 + |v_t|)^2 + 2 v_0 |v_t| (1 - cos),
        b = -1 / (v_0 + |v_t|)^2 + (1 - cos) (1 + 2 v_t^2),    -sin.
    """
    share, (first, size) = _share(rows, c, d, width), _disk_of(rows, c, d)
    v, eta = _three(i.scale, c, 4 * d), i.scale[c, 4 * d + 3] * i.scale[c, 4 * d + 3]
    long, u = np.sqrt(v[1] * v[1] + v[2] * v[2]), _three(i.dual, c, 3 * d)
    h, slip = eta * (v[0] * v[0] + long * long), np.sqrt(u[1] * u[1] + u[2] * u[2])
    if size == 0:
        i.schur[c] += share * share * h
        return True
    e_x, e_y = (v[1] / long, v[2] / long) if long > 0.0 else (1.0, 0.0)
    a, b, across = h, 2.0 * eta * v[0] * long, 0.0
    if slip > 0.0:
        cosine, sine = (u[1] * e_x + u[2] * e_y) / slip, (e_x * u[2] - e_y * u[1]) / slip
        off = sine * sine / (1.0 + cosine) if cosine > 0.0 else 1.0 - cosine
        least = 1.0 / ((v[0] + long) * (v[0] + long))
        a = eta * (least + 2.0 * v[0] * long * off)
        b = eta * (off * (1.0 + 2.0 * long * long) - least)
        across = -eta * sine
    n = width * c + first
    yields = max(rows.compliance[n], rows.compliance[n + size - 1])
    inv_e, inv_f = 1.0 / (h + yields), 1.0 / (eta + yields)
    follows = 2.0 * eta * v[0] * long * inv_e
    i.schur[c] += share * share * (a - b * follows)
    for k, value in enumerate((inv_e, inv_f, e_x, e_y)):
        i.turn[c, 4 * d + k] = value
    for p in range(size):
        e_p, f_p = (e_x, -e_y) if p == 0 else (e_y, e_x)
        i.back[n + p] = share * follows * e_p
        i.row[n + p] = share * (b * inv_e * e_p + across * inv_f * f_p)
        for q in range(size):
            e_q, f_q = (e_x, -e_y) if q == 0 else (e_y, e_x)
            w.E[c, first + p, first + q] = inv_e * e_p * e_q
            if size == 2:
                w.E[c, first + p, first + q] += inv_f * f_p * f_q
    return True


@kernel
def _factor(rows: Rows, m: int, width: int, touched: int, w: Newton, i: Interior) -> bool:
    size, rows.factored[0] = 6 * touched, 0
    K = w.K[:size * size].reshape((size, size))
    for k in range(size):
        for j in range(size):
            K[k, j] = 0.0
        K[k, k] = 1.0
    for c in range(m):
        add_point(rows, c, width, w.slot, w.E, K)
    return factor_linear(K, w.last[:size], i.order[:size])


@kernel
def _write_aims(rows: Rows, m: int, width: int, product: float, second: bool, w: Newton,
                i: Interior) -> None:
    """
    Write q for a product of y and u: product / y, and the right sides.

    With `second` less what the last step left out: W (L : W dy o W^-1 du), L = W y.
    """
    for c in range(m):
        n = width * c
        for q in range(width):
            i.x[n + q] = -rows.a[n + q]
        for d in range(coefficients(width)):
            share, at, (first, size) = _share(rows, c, d, width), 3 * d, _disk_of(rows, c, d)
            if share == 0.0:
                continue
            y, u = _cone(rows, c, d, width, rows.f), _three(i.dual, c, at)
            part = product / _determinant(y)
            aim = (part * y[0], -part * y[1], -part * y[2])
            if second:
                both = _product(_scaled(i, c, d, _cone(rows, c, d, width, w.y), 1.0),
                                _scaled(i, c, d, _three(i.change, c, at), -1.0))
                left = _scaled(i, c, d, _quotient(_scaled(i, c, d, y, 1.0), both), 1.0)
                aim = (aim[0] - left[0], aim[1] - left[1], aim[2] - left[2])
            slip, rises = np.sqrt(u[1] * u[1] + u[2] * u[2]), aim[0]
            for k in range(3):
                i.aim[c, at + k] = aim[k]
            for k in range(size):
                i.x[n + first + k] += aim[1 + k]
                if slip > 0.0:
                    rises -= u[1 + k] / slip * aim[1 + k]
            i.x[n] += share * rises


@kernel
def _find_step(rows: Rows, m: int, width: int, touched: int, w: Newton, i: Interior) -> float:
    """
    Write the change of the forces to w.y, and that of u; return how far one may go.

    0: rounding left none that is a number.
    """
    size = 6 * touched
    K, p, right = w.K[:size * size].reshape((size, size)), w.p[:size], i.right[:size]
    for k in range(size):
        right[k] = 0.0
    for c in range(m):
        _resolve(rows, c, width, i, w.y)
        for side in range(2):
            to = w.slot[rows.body[c, side]]
            for q in range(width * c, width * c + width if to >= 0 else 0):
                for j in range(6):
                    right[6 * to + j] += rows.G[q, 6 * side + j] * w.y[q]
    solve_factored(K, right, p, w.last[:size], i.order[:size])
    far, largest = np.inf, 0.0
    for c in range(m):
        for q in range(width * c, width * c + width):
            begin, moved = rows.at[q], 0.0
            for e in range(rows.first[c], rows.first[c + 1]):
                at = w.slot[rows.moved[e]]
                for k in range(6 if at >= 0 else 0):
                    moved += rows.W[begin + k] * p[6 * at + k]
                begin += 6
            i.x[q] -= moved
        _resolve(rows, c, width, i, w.y)
        far = min(far, _write_change(rows, c, width, w, i))
        for q in range(9):
            largest += abs(i.change[c, q])
    return far if largest < np.inf else 0.0


@kernel
def _resolve(rows: Rows, c: int, width: int, i: Interior, y: Array) -> None:
    """Write the forces y of a point for its right sides."""
    n = width * c
    normal = i.x[n]
    for q in range(n + 1, n + width):
        normal -= i.row[q] * i.x[q]
        y[q] = 0.0
    y[n] = normal / i.schur[c]
    for d in range(coefficients(width)):
        first, size = _disk_of(rows, c, d)
        e_x, e_y, p = i.turn[c, 4 * d + 2], i.turn[c, 4 * d + 3], n + first
        if size > 0:
            x_x, x_y = i.x[p], i.x[p + 1] if size == 2 else 0.0
            along = i.turn[c, 4 * d] * (e_x * x_x + e_y * x_y)
            across = i.turn[c, 4 * d + 1] * (e_x * x_y - e_y * x_x)
            y[p] = along * e_x - across * e_y - i.back[p] * y[n]
            if size == 2:
                y[p + 1] = along * e_y + across * e_x - i.back[p + 1] * y[n]


@kernel
def _write_change(rows: Rows, c: int, width: int, w: Newton, i: Interior) -> float:
    """Write q - u - W^2 dy of a point; return how far y and u may go."""
    far = np.inf
    for d in range(coefficients(width)):
        if _share(rows, c, d, width) == 0.0:
            continue
        y, u, step = (_cone(rows, c, d, width, rows.f), _three(i.dual, c, 3 * d),
                      _cone(rows, c, d, width, w.y))
        v, eta = _three(i.scale, c, 4 * d), i.scale[c, 4 * d + 3] ** 2
        _, size = _disk_of(rows, c, d)
        twice, sign = 2.0 * (v[0] * step[0] + v[1] * step[1] + v[2] * step[2]), -1.0
        for k in range(3):
            i.change[c, 3 * d + k] = 0.0
            if k <= size:
                i.change[c, 3 * d + k] = (i.aim[c, 3 * d + k] - u[k]
                                          - eta * (twice * v[k] + sign * step[k]))
            sign = 1.0
        far = min(far, _way(y, step), _way(u, _three(i.change, c, 3 * d)))
    return far
