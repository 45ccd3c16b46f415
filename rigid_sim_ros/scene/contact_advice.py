# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What contacts will not resolve: masses too far apart, bodies too small, speeds too high."""

from collections.abc import Iterator
import math

import numpy as np

from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.problems import counted
from rigid_sim_ros.scene.build import Scene

# A body that is heavier than what it lies on by more than this sinks in: a solver that goes from
# contact to contact passes on a part of the weight with each visit.
HEAVY = 1e3
# Part of its own radius by which a body may fall in a step. A body of radius r rocks with a period
# of about 2 pi sqrt(r / g): at 0.1 that takes 14 steps.
FALL = 0.1
_MOST_LINES = 3


def describe_contact(scene: Scene) -> Iterator[str]:
    """Give a line, with what to do, for each thing that contacts of this scene cannot resolve."""
    if scene.contact == 'none' or len(scene.shapes.body) < 2:
        return
    yield from _of_masses(scene)
    yield from _of_sizes(scene)
    yield from _of_speeds(scene)


def _of_masses(scene: Scene) -> Iterator[str]:
    """Tell of the heaviest and the lightest body that may touch each other."""
    if (scene.contact, scene.solver) != ('timestep', 'sequential'):
        return
    shapes, m = scene.shapes, scene.model.m
    moving = np.flatnonzero(shapes.still == 0)
    worst, heavy, light = HEAVY, -1, -1
    # The lightest and the heaviest of those with the same filters stand for all of them.
    filters = np.stack([shapes.group[moving], shapes.mask[moving]], axis=1)
    of_filter = np.unique(filters, axis=0, return_inverse=True)[1].reshape(-1)
    kinds = [moving[of_filter == k] for k in range(of_filter.max(initial=-1) + 1)]
    for one in kinds:
        for other in kinds:
            a = one[np.argmax(m[shapes.body[one]])]
            b = other[np.argmin(m[shapes.body[other]])]
            i, j = int(shapes.body[a]), int(shapes.body[b])
            if m[i] > worst * m[j] and len(_partners(shapes, len(m), a, np.array([b]))) > 0:
                worst, heavy, light = float(m[i] / m[j]), i, j
    if heavy >= 0:
        yield (f"body '{scene.names[heavy]}' weighs {m[heavy]:.3g} kg, {worst:.3g} times what "
               f"'{scene.names[light]}' does: lying on it, it sinks in; use contact: event, or "
               f'masses within a factor of {HEAVY:g}')


def _of_sizes(scene: Scene) -> Iterator[str]:
    """Tell of bodies that fall by too much of their own size in a step."""
    shapes, h = scene.shapes, scene.model.h
    fall = 0.5 * math.hypot(*scene.model.gravity.tolist()) * h * h
    reach = np.zeros(len(scene.names))
    moving = shapes.still == 0
    np.maximum.at(reach, shapes.body[moving], shapes.bound[moving])
    small = np.flatnonzero((reach > 0.0) & (fall > FALL * reach))
    for i in small[np.argsort(reach[small], kind='stable')][:_MOST_LINES]:
        step = h * math.sqrt(FALL * reach[i] / fall)
        yield (f"body '{scene.names[i]}' reaches {reach[i]:.3g} m from its middle and falls "
               f'{fall:.3g} m in the first step: how it rocks and comes to rest is not resolved; '
               f'use a step of at most {below(step)} s')
    if len(small) > _MOST_LINES:
        yield counted(len(small) - _MOST_LINES, 'more body is', 'more bodies are') + (
            ' too small for the step')


def _of_speeds(scene: Scene) -> Iterator[str]:
    """
    Tell of bodies that begin so fast that they may cross another one in a step.

    From where they touch, the middle of one passes that of the other after half of both widths:
    an overlap that is first seen then is left on the far side.
    """
    if scene.contact != 'penalty':
        return
    shapes, n, h = scene.shapes, len(scene.names), scene.model.h
    thickness = _thickness(shapes)
    thinnest = float(thickness.min())
    told = 0
    for i, body in enumerate(scene.spec.bodies):
        v, w = math.hypot(*body.twist.linear), math.hypot(*body.twist.angular)
        if v + w == 0.0:
            continue
        own = np.flatnonzero((shapes.body == i) & np.isfinite(shapes.bound))
        far = max((float(np.linalg.norm(shapes.p_CS[s]) + shapes.bound[s]) for s in own),
                  default=0.0)
        way, half = (v + w * far) * h, 0.5 * float(thickness[own].min(initial=np.inf))
        if way <= half + 0.5 * thinnest:
            continue
        others = _partners(shapes, n, int(own[0]),
                           np.flatnonzero(half + 0.5 * thickness < way))
        if len(others) == 0:
            continue
        s = others[np.argmin(thickness[others])]
        safe = h * (half + 0.5 * thickness[s]) / way
        told += 1
        if told <= _MOST_LINES:
            yield (f"body '{body.name}' moves by {way:.3g} m in a step and may cross "
                   f"'{scene.names[shapes.body[s]]}', {thickness[s]:.3g} m thick, unseen; use a "
                   f'step of at most {below(safe)} s, or contact: timestep')
    if told > _MOST_LINES:
        yield counted(told - _MOST_LINES, 'more body', 'more bodies') + (
            ' may cross others unseen')


def _partners(shapes: Shapes, n: int, s: int, others: IntArray) -> IntArray:
    """Return those of the other shapes that shape s can touch."""
    i, j = shapes.body[s], shapes.body[others]
    key = np.minimum(i, j) * n + np.maximum(i, j)
    touches = ((i != j) & (shapes.still[s] + shapes.still[others] < 2)
               & (shapes.mask[s] & shapes.group[others] != 0)
               & (shapes.mask[others] & shapes.group[s] != 0) & ~np.isin(key, shapes.ignored))
    return np.asarray(others[touches])


def _thickness(shapes: Shapes) -> Array:
    """Return the least width of each shape [m]; infinite for a plane, which has no other side."""
    return np.asarray(2.0 * shapes.half_width)


def below(step: float) -> str:
    """Write a step with one digit, rounded down."""
    digit = 10.0 ** math.floor(math.log10(step))
    return f'{math.floor(step / digit * (1 + 1e-9)) * digit:.1g}'
