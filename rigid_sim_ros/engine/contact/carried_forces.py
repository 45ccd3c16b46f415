# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The forces of the points of contact, carried over to the next step by the features that meet.

What was found before is where the next solution starts from: a warm start.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from rigid_sim_ros.engine.contact.contacts import (
    Contacts, length, to_contact, to_world, torque_in_world)
from rigid_sim_ros.engine.maths.algebra import row
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


class Known(Protocol):
    """Points of the last step by which features of which shapes met there, (c,) each."""

    @property
    def shape_a(self) -> IntArray:
        """Return the shapes A."""

    @property
    def shape_b(self) -> IntArray:
        """Return the shapes B."""

    @property
    def feature(self) -> IntArray:
        """Return the features."""


class Carried(NamedTuple):
    """The forces of the last step, from which the next solution starts."""

    shape_a: IntArray  # (c,)
    shape_b: IntArray  # (c,)
    feature: IntArray  # (c,)
    force: Array  # (c, 3) [N] on B, world axes
    torque: Array  # (c, 3) [N m] on B, world axes, against spinning and rolling


def no_forces() -> Carried:
    """Return what is carried over where nothing touched."""
    none = np.zeros(0, dtype=np.int64)
    return Carried(none, none, none, np.zeros((0, 3)), np.zeros((0, 3)))


def more_forces(forces: Carried, points: int) -> Carried:
    """Return the forces with room for twice as many points."""
    return Carried._make(longer(field, 2 * points) for field in forces)


def longer(array: Array | IntArray, rows: int) -> Any:
    """Return the array with room for `rows` rows, if that is more than it has."""
    longer_one = np.zeros((max(rows, len(array)), *array.shape[1:]), dtype=array.dtype)
    longer_one[:len(array)] = array
    return longer_one


@kernel
def copy_force(to: Carried, kept: int, forces: Carried, k: int) -> None:
    """Write force k as the one at `kept`."""
    to.shape_a[kept], to.shape_b[kept] = forces.shape_a[k], forces.shape_b[k]
    to.feature[kept] = forces.feature[k]
    for i in range(3):
        to.force[kept, i], to.torque[kept, i] = forces.force[k, i], forces.torque[k, i]


@kernel
def copy_forces(to: Carried, forces: Carried, count: int) -> None:
    """Write the first `count` forces."""
    for k in range(count):
        copy_force(to, k, forces, k)


@kernel
def match_forces(contacts: Contacts, carried: Known, known: int, match: IntArray) -> None:
    """Write for each point which of those of the last step was there, -1: none."""
    at = 0
    for k in range(contacts.count[0]):
        match[k] = -1
        for tried in range(known):
            # Both are in nearly the same order, so the search mostly ends at once.
            i = (at + tried) % known
            if (carried.shape_a[i] == contacts.shape_a[k]
                    and carried.shape_b[i] == contacts.shape_b[k]
                    and carried.feature[i] == contacts.feature[k]):
                match[k], at = i, i + 1
                break


@kernel
def recall_forces(model: Model, contacts: Contacts, chosen: IntArray, width: int,
                  carried: Carried, match: IntArray, f: Array) -> bool:
    """
    Write the forces of the last step at the points that were there already, 0 at the others.

    Returns whether any was.
    """
    f[:width * chosen.shape[0]] = 0.0
    found = False
    for c in range(chosen.shape[0]):
        k, to = chosen[c], width * c
        i = match[k]
        if i < 0:
            continue
        f[to], f[to + 1], f[to + 2] = to_contact(contacts, k, row(carried.force, i))
        if width == 6:
            tau = to_contact(contacts, k, row(carried.torque, i))
            arm = length(model, contacts, k)
            f[to + 3], f[to + 4], f[to + 5] = tau[0] / arm, tau[1] / arm, tau[2] / arm
        found = True
    return found


@kernel
def keep_force(model: Model, contacts: Contacts, k: int, width: int, f: Array, carried: Carried,
               kept: int) -> None:
    """Carry over the force f, (6,) [N, contact axes], of point k."""
    carried.shape_a[kept], carried.shape_b[kept] = contacts.shape_a[k], contacts.shape_b[k]
    carried.feature[kept] = contacts.feature[k]
    F = to_world(contacts, k, (f[0], f[1], f[2]))
    tau = torque_in_world(model, contacts, k, width, f, 0)
    for i in range(3):
        carried.force[kept, i] = F[i]
        carried.torque[kept, i] = tau[i]
