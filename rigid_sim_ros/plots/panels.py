# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The quantities that can be plotted, each as panels.

A body has a colour, which is the same in all panels. More bodies than there are colours are shown
by what they have in common: median, the middle 80 %, and the extremes.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.bag.motion import Array
from rigid_sim_ros.plots.diagram import Band, COLORS, DASHES, Line, Panel, thinned
from rigid_sim_ros.plots.energies import Energies

_AXES = 'xyz'
_MANY = len(COLORS)     # bodies that get a line of their own


class Shown(NamedTuple):
    """What is to be plotted: chosen bodies in a span of time."""

    names: list[str]
    time: Array             # (t,) [s]
    breaks: list[int]       # rows at which lines are interrupted
    position: Array         # (t, n, 3) [m]
    velocity: Array         # (t, n, 3) [m/s]
    angular_velocity: Array     # (t, n, 3) [rad/s]
    energies: Energies | None
    forces: dict[str, tuple[Array, Array]]      # of contact, by body: [s], [N]
    gaps: dict[str, tuple[Array, Array]]        # by body: [s], [m]
    # By joint: [s], (k, 3) position, velocity, effort; and which of them slide.
    joints: dict[str, tuple[Array, Array]]
    slides: frozenset[str]


def _position(shown: Shown) -> list[Panel]:
    return _vectors(shown, 'Position', 'm', shown.position)


def _path(shown: Shown) -> list[Panel]:
    """Show where the bodies went, seen along the axis along which they moved least."""
    flat = shown.position.reshape(-1, 3)
    flat = flat[np.isfinite(flat).all(axis=1)]
    if not len(flat):
        return []
    spans = np.ptp(flat, axis=0)
    a, b = sorted(sorted(range(3), key=lambda k: (-spans[k], k))[:2])
    paths = [_broken(shown, shown.position[:, k, a], shown.position[:, k, b])
             for k in range(len(shown.names))]
    labels = (f'{_AXES[a]} [m]', f'{_AXES[b]} [m]')
    if len(paths) <= _MANY:
        lines = [Line(name, x, y, COLORS[k])
                 for k, (name, (x, y)) in enumerate(zip(shown.names, paths, strict=True))]
    else:
        lines = _many_paths(paths)
    return [Panel('Path', '', lines, axes=labels)]


def _many_paths(paths: Sequence[tuple[Array, Array]]) -> list[Line]:
    """Return the paths of many bodies: neighbours in the scene have different colours."""
    nan = np.array([np.nan])
    lines = []
    for k, color in enumerate(COLORS):
        x, y = (np.concatenate([part for path in paths[k::len(COLORS)]
                                for part in (path[axis], nan)]) for axis in (0, 1))
        lines.append(Line('' if k else f'{len(paths)} bodies', x, y, color, width=0.8,
                          opacity=0.8))
    return lines


def _velocity(shown: Shown) -> list[Panel]:
    return _vectors(shown, 'Velocity', 'm/s', shown.velocity, 'Speed')


def _angular_velocity(shown: Shown) -> list[Panel]:
    return _vectors(shown, 'Angular velocity', 'rad/s', shown.angular_velocity,
                    'Angular speed')


def _energy(shown: Shown) -> list[Panel]:
    e = shown.energies
    if e is None:
        return []
    kinetic = e.linear + e.rotational
    parts = [('kinetic, linear', e.linear), ('kinetic, rotational', e.rotational)]
    parts += ([('kinetic', kinetic)] if e.potential is None else
              [('potential', e.potential), ('total', kinetic + e.potential)])
    colors = [*COLORS[:len(parts) - 1], '#000000']
    return [Panel('Energy', 'J', [
        Line(label, *_broken(shown, shown.time, values), color,
             'dashed' if color == '#000000' else 'solid')
        for (label, values), color in zip(parts, colors, strict=True)])]


def _momentum(shown: Shown) -> list[Panel]:
    e = shown.energies
    return [] if e is None else [
        _components(shown, 'Momentum', 'kg m/s', e.momentum, _scale(shown))]


def _angular_momentum(shown: Shown) -> list[Panel]:
    e = shown.energies
    return [] if e is None else [_components(
        shown, 'Angular momentum about the origin', 'kg m\u00b2/s', e.angular_momentum,
        _scale(shown))]


def _contact_force(shown: Shown) -> list[Panel]:
    return [panel._replace(is_log=True) for panel in _scalars(
        shown.names, 'Net contact force (at the bottom: none)', 'N', shown.forces, 1.0, 1e-9)]


def _gap(shown: Shown) -> list[Panel]:
    return _scalars(shown.names, 'Smallest gap (below 0: overlap)', 'mm', shown.gaps, 1e3, 1e-6)


def _of_joints(column: int, title: str, units: tuple[str, str], floor: float) -> Callable[
        [Shown], list[Panel]]:
    """Return what makes the panels of a number of joints, of those that slide apart."""
    def panels(shown: Shown) -> list[Panel]:
        return [panel for slides, unit in enumerate(units)
                for panel in _scalars(list(shown.joints), title, unit, {
                    name: (time, values[:, column]) for name, (time, values) in
                    shown.joints.items() if (name in shown.slides) == bool(slides)}, 1.0, floor)]
    return panels


QUANTITIES: dict[str, Callable[[Shown], list[Panel]]] = {
    'position': _position,
    'path': _path,
    'velocity': _velocity,
    'angular_velocity': _angular_velocity,
    'energy': _energy,
    'momentum': _momentum,
    'angular_momentum': _angular_momentum,
    'contact_force': _contact_force,
    'gap': _gap,
    'joint_position': _of_joints(0, 'Joint position', ('rad', 'm'), 1e-6),
    'joint_velocity': _of_joints(1, 'Joint velocity', ('rad/s', 'm/s'), 1e-6),
    'joint_effort': _of_joints(2, 'Joint effort', ('N m', 'N'), 1e-9),
}
OF_SCENE = ('energy', 'momentum', 'angular_momentum')
OF_CONTACT = ('contact_force', 'gap')
OF_JOINTS = ('joint_position', 'joint_velocity', 'joint_effort')


def _scale(shown: Shown) -> float:
    """Return a momentum below which a sum of momenta is rounding: 1e-9 of their sizes."""
    e = shown.energies
    assert e is not None
    sizes = [np.abs(array) for array in (e.momentum, e.angular_momentum)]
    return 1e-9 * max(float(np.nanmax(size, initial=0.0)) for size in sizes)


def _vectors(shown: Shown, title: str, unit: str, vectors: Array,
             size: str = '') -> list[Panel]:
    """Return one panel for one body; of several, a panel for each axis or for the size alone."""
    if np.isnan(vectors).all():
        return []
    floor = 1e-6
    if len(shown.names) == 1:
        return [_components(shown, f'{title} of {shown.names[0]}', unit, vectors[:, 0], floor)]
    if size:
        return _bodies(shown, size, unit, np.linalg.norm(vectors, axis=2), floor)
    return [panel for k, axis in enumerate(_AXES)
            for panel in _bodies(shown, f'{title}, {axis}', unit, vectors[:, :, k], floor)]


def _components(shown: Shown, title: str, unit: str, vector: Array, floor: float) -> Panel:
    return Panel(title, unit, [
        Line(axis, *_broken(shown, shown.time, vector[:, k]), COLORS[k], DASHES[k])
        for k, axis in enumerate(_AXES)], floor=floor)


def _bodies(shown: Shown, title: str, unit: str, values: Array, floor: float) -> list[Panel]:
    """Return the panel of one number for each body and time, (t, n)."""
    if len(shown.names) <= _MANY:
        lines = [Line(name, *_broken(shown, shown.time, values[:, k]), COLORS[k])
                 for k, name in enumerate(shown.names) if np.isfinite(values[:, k]).any()]
        return [Panel(title, unit, lines, floor=floor)]
    return [_crowd(title, unit, shown.time, values, floor)]


def _crowd(title: str, unit: str, time: Array, values: Array, floor: float) -> Panel:
    """Return the panel of more bodies than can be told apart."""
    known = np.isfinite(values).any(axis=1)
    time, values = time[known], values[known]
    low, lower, middle, upper, high = np.nanpercentile(values, [0, 10, 50, 90, 100], axis=1)
    return Panel(title, unit, [Line('median', *thinned(time, middle), COLORS[0])], [
        Band('all', *_thinned_pair(time, low, high), COLORS[0], 0.15),
        Band('80 %', *_thinned_pair(time, lower, upper), COLORS[0], 0.3)], floor)


def _thinned_pair(time: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    at, below = thinned(time, low)
    return at, below, np.interp(at, time, high)


def _scalars(owners: list[str], title: str, unit: str, series: dict[str, tuple[Array, Array]],
             factor: float, floor: float) -> list[Panel]:
    """Return the panel of a number that bodies, or joints, have at times of their own."""
    series = {name: (time, values) for name, (time, values) in series.items()
              if np.isfinite(values).any()}
    if not series:
        return []
    if len(owners) > _MANY:
        times = next(iter(series.values()))[0]
        same = [values for time, values in series.values() if np.array_equal(time, times)]
        return [_crowd(title, unit, times, factor * np.array(same).T, floor)]
    return [Panel(title, unit, [
        Line(name, *thinned(time, factor * values), COLORS[owners.index(name)])
        for name, (time, values) in series.items()], floor=floor)]


def _broken(shown: Shown, x: Array, y: Array) -> tuple[Array, Array]:
    """Return a line that is interrupted where the world was reset, and where both are unknown."""
    known = np.isfinite(x) & np.isfinite(y)
    breaks = [int(np.count_nonzero(known[:k])) for k in shown.breaks]
    x, y = x[known], y[known]
    return thinned(np.insert(x, breaks, x[_at(breaks, len(x))] if len(x) else np.nan),
                   np.insert(y, breaks, np.nan))


def _at(breaks: Sequence[int], count: int) -> list[int]:
    return [min(k, count - 1) for k in breaks]
