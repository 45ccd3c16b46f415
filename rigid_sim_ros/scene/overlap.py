# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies that are in each other when a scene begins: seldom meant, and pushed apart by force."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.detect import detect
from rigid_sim_ros.engine.detection.manifolds import current_manifolds, empty_memory, grown
from rigid_sim_ros.engine.state.state import copy_state
from rigid_sim_ros.problems import counted
from rigid_sim_ros.scene.build import Scene

# Of the size of the smaller shape: an overlap below this is rounding in the file, or what contact
# detection is off by (2e-3 of half of an edge).
_WORTH_A_LINE = 2e-3
_MOST_LINES = 5


class Overlap(NamedTuple):
    """Two bodies that overlap."""

    body_a: str
    body_b: str
    depth: float    # [m] how far one has to move until they only touch


def initial_overlaps(scene: Scene) -> list[Overlap]:
    """Return the pairs of bodies that can collide and overlap at the start, deepest first."""
    shapes = scene.shapes
    if scene.contact == 'none' or len(shapes.body) < 2:
        return []
    state, memory = copy_state(scene.state), empty_memory(len(scene.names), len(shapes.body))
    margin = 1e-6 * float(np.min(shapes.bound))     # contacts that are not even near do not matter
    while not detect(scene.model, state, shapes, memory, margin):
        memory = grown(memory)
    found = current_manifolds(memory)
    deepest: dict[tuple[int, int], float] = {}
    for r in range(int(found.count[0])):
        depth = -float(found.gap[:found.points[r], r].min())
        size = min(shapes.bound[found.shape_a[r]], shapes.bound[found.shape_b[r]])
        if depth > _WORTH_A_LINE * size:
            pair = int(found.body_a[r]), int(found.body_b[r])
            deepest[pair] = max(depth, deepest.get(pair, 0.0))
    ranked = sorted(deepest.items(), key=lambda item: -item[1])
    return [Overlap(scene.names[a], scene.names[b], depth) for (a, b), depth in ranked]


def describe_overlaps(scene: Scene) -> Iterator[str]:
    """Give a line, with what to do, for each of the deepest overlaps at the start of a scene."""
    overlaps = initial_overlaps(scene)
    for a, b, depth in overlaps[:_MOST_LINES]:
        yield (f"bodies '{a}' and '{b}' overlap by {depth:.3g} m at the start and will be pushed "
               f'apart; move one, or let them pass through each other with collision: '
               f'{{ignore: [[{a}, {b}]]}}')
    if len(overlaps) > _MOST_LINES:
        yield counted(len(overlaps) - _MOST_LINES, 'more pair of bodies overlaps',
                      'more pairs of bodies overlap') + ' at the start, less deep'
