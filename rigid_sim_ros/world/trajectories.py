# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Curves that drives follow: between waypoints a polynomial for each joint.

The rules are those of ros2_control's joint_trajectory_controller with its interpolation `splines`:
between two points with velocities and accelerations the curve is of the fifth order, with
velocities of the third, else it is a straight line. It begins where the joint is when it is told,
and stays at the last point.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.times import SECOND

_ORDER = 5
_POWERS = np.arange(1.0, _ORDER + 1)
# What a point may lack is not a number.
_NOT_GIVEN = np.nan
# [ns] Far beyond any simulation, and twice as much is still a 64-bit integer.
_LATEST = 2 ** 61

# An hour with a point each 0.1 s; one message may not fill the memory.
_MOST_POINTS = 36_000

FIELDS = ('path_joint', 'path_begin', 'path_coefficient')


class Waypoints:
    """p points for j joints, checked; each (p, j), in rad or m and s."""

    def __init__(self, names: Sequence[str], times: ArrayLike, positions: ArrayLike,
                 velocities: ArrayLike | None, accelerations: ArrayLike | None) -> None:
        """Raise ValueError for what makes no curve."""
        if not names:
            raise ValueError('names [], must be at least one joint')
        if twice := sorted({name for name in names if list(names).count(name) > 1}):
            raise ValueError(f'joint {twice[0]!r} is named twice, must be named once')
        seconds = _numbers('times', times, (-1,))
        p, j = len(seconds), len(names)
        if not 0 < p <= _MOST_POINTS:
            raise ValueError(f'{p} times, must be one for each of 1 to {_MOST_POINTS} points')
        if not ((seconds >= 0.0) & (seconds < 1e9)).all():
            raise ValueError(f'times {seconds.tolist()}, must be finite numbers from 0 to 1e9 s')
        self.seconds = seconds
        self.times: IntArray = np.round(seconds * SECOND).astype(np.int64)     # [ns]
        late = np.flatnonzero(np.diff(self.times) <= 0)
        if len(late):
            k = int(late[0])
            raise ValueError(f'times: point {k + 1} at {seconds[k + 1]:g} s comes after point {k} '
                             f'at {seconds[k]:g} s, must be later than it')
        self.positions = _numbers('positions', positions, (p, j))
        if not np.isfinite(self.positions).all():
            raise ValueError(f'positions {self.positions.tolist()}, must be finite')
        self.velocities, self.accelerations = (
            np.full((p, j), _NOT_GIVEN) if values is None else _numbers(what, values, (p, j))
            for what, values in (('velocities', velocities), ('accelerations', accelerations)))
        for what, numbers in (('velocities', self.velocities),
                              ('accelerations', self.accelerations)):
            if np.isinf(numbers).any():
                raise ValueError(f'{what} {numbers.tolist()}, must be finite, or nan where a '
                                 'point has none')


class Trajectories:
    """
    The curves in effect, a row for each piece, sorted by joint and time.

    A piece holds until the next one of its joint begins; the last one is constant.
    """

    joints: IntArray        # that follow a curve, (j,)
    _now: IntArray          # (j,) their present rows
    _end: IntArray          # (j,) where their rows end
    _joint: IntArray        # (r,)
    _begin: IntArray        # (r,) [ns] of simulation time
    _coefficient: Array     # (r, 6) of the powers of time since then [s]

    def __init__(self) -> None:
        """Begin with none."""
        self.clear()

    def clear(self) -> None:
        """Drop all curves."""
        self._hold(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64),
                   np.zeros((0, _ORDER + 1)))

    @property
    def are_empty(self) -> bool:
        """Whether no joint follows a curve."""
        return not len(self.joints)

    def rows(self) -> dict[str, np.ndarray]:
        """Return the present pieces and those to come, by the names that snapshots give them."""
        left = np.concatenate([np.arange(0), *(
            np.arange(a, b) for a, b in zip(self._now, self._end, strict=True))]).astype(np.int64)
        return dict(zip(FIELDS, (self._joint[left], self._begin[left], self._coefficient[left]),
                        strict=True))

    def replace(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Put these rows in the place of all."""
        self._hold(*(arrays[name] for name in FIELDS))

    def drop(self, joint: int) -> None:
        """End the curve of a joint."""
        if joint in self.joints:
            rows = self.rows()
            others = rows['path_joint'] != joint
            self.replace({name: row[others] for name, row in rows.items()})

    def put(self, joint: int, begins: Sequence[int], coefficients: Sequence[Array]) -> None:
        """Let a joint follow these pieces, and no others."""
        self.drop(joint)
        joints, begin, coefficient = self.rows().values()
        at = int(np.searchsorted(joints, joint))
        self._hold(np.insert(joints, at, np.full(len(begins), joint)),
                   np.insert(begin, at, np.array(begins, dtype=np.int64)),
                   np.insert(coefficient, at, np.array(coefficients), axis=0))

    def at(self, t_ns: int) -> tuple[IntArray, Array, Array]:
        """
        Return joints, positions and velocities at a time, each (j,); the past is forgotten.

        A joint that has come to its last piece is returned once more, and no longer followed.
        """
        last = self._end - 1
        while True:
            following = np.minimum(self._now + 1, last)
            goes_on = (following > self._now) & (self._begin[following] <= t_ns)
            if not goes_on.any():
                break
            self._now = np.where(goes_on, following, self._now)
        joints, c = self.joints, self._coefficient[self._now]
        s = (t_ns - self._begin[self._now]) / SECOND
        position, velocity = c[:, _ORDER].copy(), np.zeros(len(c))
        with np.errstate(over='ignore', invalid='ignore'):  # of a snapshot from anywhere
            for k in range(_ORDER - 1, -1, -1):     # Horner's rule for a polynomial and its slope
                velocity = velocity * s + position
                position = position * s + c[:, k]
        if (done := self._now == last).any():
            for joint in joints[done].tolist():
                self.drop(joint)
        return joints, position, velocity

    def _hold(self, joint: IntArray, begin: IntArray, coefficient: Array) -> None:
        """Keep these rows, of which the first of each joint is the present one."""
        self._joint, self._begin, self._coefficient = joint, begin, coefficient
        self.joints, self._now = np.unique(joint, return_index=True)
        self._end = np.append(self._now[1:], len(joint))[:len(self._now)]


def pieces(points: Waypoints, j: int, start_ns: int, now_ns: int, position: float,
           velocity: float, turn: float) -> tuple[list[int], list[Array]]:
    """
    Return when the pieces of one joint begin [ns], and their coefficients.

    The curve begins at now_ns with this position and velocity and goes on to the first point that
    is later, on the trajectory that began at start_ns. A continuous joint goes the short way to
    the first point: of the positions that differ by whole turns of `turn` it takes the nearest; 0
    for other joints.
    """
    p, v, a = (field[:, j] for field in (points.positions, points.velocities,
                                         points.accelerations))
    if turn:
        p = p + turn * round((position - float(p[0])) / turn)
    times = (start_ns + points.times).tolist()
    begins, found = [], []
    if times[0] > now_ns:
        first = (position, velocity, 0.0)
        begins.append(now_ns)
        found.append(_curve(first, (p[0], v[0], a[0]), (times[0] - now_ns) / SECOND))
    for k in range(len(times) - 1):
        begins.append(times[k])
        found.append(_curve((p[k], v[k], a[k]), (p[k + 1], v[k + 1], a[k + 1]),
                            (times[k + 1] - times[k]) / SECOND))
    begins.append(times[-1])
    found.append(np.array([p[-1], *[0.0] * _ORDER]))
    return begins, found


def extremes(begins: Sequence[int], coefficients: Sequence[Array]) -> tuple[Array, Array]:
    """
    Return positions and velocities near the largest that the pieces of a joint ask for.

    A polynomial of the fifth order comes near its extremes at one of these
    times, and no bound is so sharp that nearer would be better.
    """
    lasting = np.append(np.diff(begins) / SECOND, 0.0)
    positions, velocities = [], []
    with np.errstate(over='ignore', invalid='ignore'):
        for T, c in zip(lasting, coefficients, strict=True):
            s = np.linspace(0.0, T, 9)
            positions.append(np.polynomial.polynomial.polyval(s, c))
            velocities.append(np.polynomial.polynomial.polyval(s, c[1:] * _POWERS))
    return np.concatenate(positions), np.concatenate(velocities)


def start_of(start: float | None, now_ns: int, points: Waypoints) -> int:
    """Return when a trajectory starts [ns]; ValueError for one that has ended already."""
    if start is None:
        return now_ns
    if not 0.0 <= start < _LATEST / SECOND:
        raise ValueError(f'start {start!r} s, must be a time of the simulation, or None for now')
    start_ns = round(start * SECOND)
    if start_ns + int(points.times[-1]) <= now_ns:
        raise ValueError(f'the trajectory ends at {(start_ns + int(points.times[-1])) / 1e9:g} s, '
                         f'and it is {now_ns / 1e9:g} s: must end in the future, or leave its '
                         'start out')
    return start_ns


def _curve(begin: tuple[float, float, float], end: tuple[float, float, float], T: float) -> Array:
    """
    Return the coefficients of the polynomial through two points, T [s] apart.

    It has position, velocity and acceleration of both, as far as both have them. With
    d = p1 - p0 - v0 T - a0 T^2/2, w = v1 - v0 - a0 T, b = a1 - a0 the three last coefficients of
    the fifth order solve the conditions at T (Biagiotti and Melchiorri, Trajectory Planning for
    Automatic Machines and Robots, 2008, sections 2.1.4 and 2.1.6).
    """
    c = np.zeros(_ORDER + 1)
    with np.errstate(over='ignore', invalid='ignore'):  # what overflows is refused with its pull
        _fill(c, begin, end, T)
    return c


def _fill(c: Array, begin: tuple[float, float, float], end: tuple[float, float, float],
          T: float) -> None:
    (p0, v0, a0), (p1, v1, a1) = begin, end
    if np.isnan(v0) or np.isnan(v1):
        c[:2] = p0, (p1 - p0) / T
    elif np.isnan(a0) or np.isnan(a1):
        slope = (p1 - p0) / T
        c[:4] = p0, v0, (3.0 * slope - 2.0 * v0 - v1) / T, (v0 + v1 - 2.0 * slope) / T ** 2
    else:
        d = p1 - p0 - v0 * T - 0.5 * a0 * T ** 2
        w, b = v1 - v0 - a0 * T, a1 - a0
        c[:] = (p0, v0, 0.5 * a0, (10.0 * d - 4.0 * w * T + 0.5 * b * T ** 2) / T ** 3,
                (-15.0 * d + 7.0 * w * T - b * T ** 2) / T ** 4,
                (6.0 * d - 3.0 * w * T + 0.5 * b * T ** 2) / T ** 5)


def _numbers(what: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return an array of this shape, of which -1 is any length, or raise ValueError."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f'{what} {values!r}, must be numbers') from None
    if array.ndim != len(shape) or any(
            have != want for have, want in zip(array.shape, shape, strict=True) if want >= 0):
        form = 'one for each point' if len(shape) == 1 else (
            f'{shape[0]} points of {shape[1]} joints')
        raise ValueError(f'{what} of shape {array.shape}, must be {form}')
    return array
