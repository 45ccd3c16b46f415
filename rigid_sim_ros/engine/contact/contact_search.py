# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the poses of the bodies to a list of their points of contact, with detection on the way."""

from rigid_sim_ros.engine.contact.contacts import Contacts, gather
from rigid_sim_ros.engine.detection.detect import detect_within_margins
from rigid_sim_ros.engine.detection.manifold_rows import find_anew
from rigid_sim_ros.engine.detection.manifolds import current, Memory
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Whether it was done, or else what is too small for it.
DONE, MORE_MEMORY, MORE_MANIFOLDS, MORE_CONTACTS = range(4)


@kernel
def find_manifolds(model: Model, state: State, shapes: Shapes, memory: Memory,
                   order: IntArray) -> tuple[int, int]:
    """
    Find the manifolds of shapes within `memory.margin`; return DONE, or what is too small.

    And how many there are, for which `order`, (2, rows), has to have room.
    """
    find_anew(current(memory))
    if not detect_within_margins(model, state, shapes, memory, None):
        return MORE_MEMORY, 0
    rows = current(memory).count[0]
    return DONE if rows <= order.shape[1] else MORE_MANIFOLDS, rows


@kernel
def find_points(model: Model, state: State, shapes: Shapes, materials: Materials, memory: Memory,
                farthest: float, order: IntArray, contacts: Contacts) -> tuple[int, int]:
    """
    Write the points of these manifolds with a gap below `farthest` [m]; see `find_manifolds`.

    Returns DONE, or what is too small; and how many rows that needs, of points if it is done: for
    the caller to see whether there is room in `contacts`, see `gather`.
    """
    why, rows = find_manifolds(model, state, shapes, memory, order)
    if why != DONE:
        return why, rows
    return DONE, gather(state, current(memory), shapes, materials, farthest, order[0, :rows],
                        order[1, :rows], contacts)
