# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What acted at the points of contact in a step, for those who ask what pressed on what."""

from rigid_sim_ros.engine.contact.contacts import Contacts, length, to_world
from rigid_sim_ros.engine.detection.manifolds import Manifolds
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel


@kernel
def forget_impulses(manifolds: Manifolds) -> None:
    """Begin a step in which nothing has acted yet."""
    for r in range(manifolds.count[0]):
        manifolds.spin[r] = 0.0
        for j in range(manifolds.points[r]):
            manifolds.impulse[j, r] = 0.0
        for i in range(3):
            manifolds.friction[r, i] = 0.0


@kernel
def record(model: Model, manifolds: Manifolds, contacts: Contacts, impulses: Array) -> None:
    """Add impulses, (c, 6) [N s, contact axes], to those of the manifolds."""
    r = 0
    for k in range(contacts.count[0]):
        a, b = contacts.shape_a[k], contacts.shape_b[k]
        for _ in range(manifolds.count[0]):
            if manifolds.shape_a[r] == a and manifolds.shape_b[r] == b:
                break
            r = (r + 1) % manifolds.count[0]
        for j in range(manifolds.points[r]):
            if manifolds.feature[j, r] == contacts.feature[k]:
                manifolds.impulse[j, r] += impulses[k, 0]
        rubbing = to_world(contacts, k, (0.0, impulses[k, 1], impulses[k, 2]))
        for i in range(3):
            manifolds.friction[r, i] += rubbing[i]
        manifolds.spin[r] += length(model, contacts, k) * impulses[k, 3]
