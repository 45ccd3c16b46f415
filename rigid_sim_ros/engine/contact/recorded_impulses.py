# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What acted at the points of contact in a step, for those who ask what pressed on what."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.contacts import Contacts, length, to_world
from rigid_sim_ros.engine.detection.manifolds import forget_impulses, Manifolds, point_of_feature
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel


class Acted(NamedTuple):
    """
    What acted in a step, point by point, also at points that are there no longer; capacity c.

    A step may have several parts, with detection in between: what bounced in one of them is near
    nothing any more at the end. A point is where, and has the normal that, it had last.
    """

    count: IntArray  # type: ignore[assignment]  # (1,) points in use
    shape_a: IntArray  # (c,)
    shape_b: IntArray  # (c,)
    feature: IntArray  # (c,) as in the manifolds
    body_a: IntArray  # (c,)
    body_b: IntArray  # (c,)
    point: Array  # (c, 3) [m], world axes
    normal: Array  # (c, 3) from A to B
    gap: Array  # (c,) [m]
    impulse: Array  # (c, 3) [N s] on B, world axes


def nothing_acted(points: int) -> Acted:
    """Return room for so many points."""
    def whole(size: int = points) -> IntArray:
        return np.zeros(size, dtype=np.int64)

    return Acted(whole(1), whole(), whole(), whole(), whole(), whole(), np.zeros((points, 3)),
                 np.zeros((points, 3)), np.zeros(points), np.zeros((points, 3)))


@kernel
def note(state: State, contacts: Contacts, k: int, impulse: Array, acted: Acted) -> None:
    """Add an impulse at point k, (6,) [N s, contact axes], to what acted; there is room for it."""
    i = _entry(acted, contacts.shape_a[k], contacts.shape_b[k], contacts.feature[k])
    acted.body_a[i], acted.body_b[i] = contacts.body_a[k], contacts.body_b[k]
    acted.gap[i] = contacts.gap[k]
    F = to_world(contacts, k, (impulse[0], impulse[1], impulse[2]))
    for j in range(3):
        acted.point[i, j] = state.x[j, contacts.body_a[k]] + contacts.r_A[k, j]
        acted.normal[i, j] = contacts.axes[k, 0, j]
        acted.impulse[i, j] += F[j]


@kernel
def note_all(acted: Acted, more: Acted) -> None:
    """Add what acted in a part of a step, `more`; there is room for it."""
    for k in range(more.count[0]):
        i = _entry(acted, more.shape_a[k], more.shape_b[k], more.feature[k])
        acted.body_a[i], acted.body_b[i] = more.body_a[k], more.body_b[k]
        acted.gap[i] = more.gap[k]
        for j in range(3):
            acted.point[i, j], acted.normal[i, j] = more.point[k, j], more.normal[k, j]
            acted.impulse[i, j] += more.impulse[k, j]


@kernel
def _entry(acted: Acted, a: int, b: int, feature: int) -> int:
    """Return the place of a point, a new one if nothing acted there yet."""
    n = acted.count[0]
    for i in range(n - 1, -1, -1):
        if acted.shape_a[i] == a and acted.shape_b[i] == b and acted.feature[i] == feature:
            return i
    acted.shape_a[n], acted.shape_b[n], acted.feature[n] = a, b, feature
    for j in range(3):
        acted.impulse[n, j] = 0.0
    acted.count[0] = n + 1
    return n


@kernel
def forget_all_impulses(manifolds: Manifolds) -> None:
    """Begin a step in which nothing has acted yet."""
    for r in range(manifolds.count[0]):
        forget_impulses(manifolds, r)


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
        p = point_of_feature(manifolds, r, contacts.feature[k])
        if p >= 0:
            manifolds.impulse[p, r] += impulses[k, 0]
        rubbing = to_world(contacts, k, (0.0, impulses[k, 1], impulses[k, 2]))
        for i in range(3):
            manifolds.friction[r, i] += rubbing[i]
        manifolds.spin[r] += length(model, contacts, k) * impulses[k, 3]
