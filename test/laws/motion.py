# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What laws look at: poses and twists of a world that steps, its energy and its momenta."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from laws.scenes import matrix, Spec
import numpy as np


class Run(Protocol):
    """A scene in an engine; bodies in the order of the scene, those that move and those fixed."""

    def step(self, count: int) -> None:
        """Advance by so many steps."""

    def motion(self) -> np.ndarray:
        """Return position, orientation x, y, z, w, linear and angular velocity, (n, 13)."""

    def deepest(self) -> float:
        """Return the deepest overlap [m] of the latest step."""

    def force_on(self, name: str) -> np.ndarray:
        """Return the force [N] of all contacts on a body in the latest step, (3,)."""


Build = Callable[[Spec], Run]  # of a scene that `with_model` completed, or an engine of its own


class Ours:
    """A scene in this package."""

    def __init__(self, spec: Spec) -> None:
        """Build the world."""
        from rigid_sim_ros import World

        self.world = World.from_dict(spec)

    def step(self, count: int) -> None:
        """Advance."""
        self.world.step(count)

    def motion(self) -> np.ndarray:
        """Return poses and twists."""
        w = self.world
        return np.hstack([w.position, w.orientation, w.linear_velocity, w.angular_velocity])

    def deepest(self) -> float:
        """Return what the model reports."""
        return self.world.contact_report().deepest

    def force_on(self, name: str) -> np.ndarray:
        """Return the sum of the contact forces."""
        return np.asarray(self.world.contact_wrenches()[self.world.names.index(name), :3])


class Masses(NamedTuple):
    """The mass properties of the bodies of a scene, 0 for what is fixed."""

    m: np.ndarray  # (n,) [kg]
    com: np.ndarray  # (n, 3) [m] in the body frames
    inertia: np.ndarray  # (n, 3, 3) [kg m^2] about the centres of mass, body axes


def masses(spec: Spec) -> Masses:
    """Return the mass properties that a scene says."""
    n = len(spec['bodies'])
    found = Masses(np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3)))
    for k, one in enumerate(spec['bodies']):
        if 'inertial' in one:
            xx, yy, zz, xy, xz, yz = one['inertial']['inertia']
            found.m[k], found.com[k] = one['inertial']['mass'], one['inertial']['com']
            found.inertia[k] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    return found


class Look(NamedTuple):
    """The mechanics of one moment, a row for each body."""

    x: np.ndarray  # (n, 3) [m] centres of mass
    v: np.ndarray  # (n, 3) [m/s] of the centres of mass
    w: np.ndarray  # (n, 3) [rad/s]
    P: np.ndarray  # (n, 3) [kg m/s]
    L: np.ndarray  # (n, 3) [kg m^2/s] about the centres of mass
    kinetic: np.ndarray  # (n,) [J]


def look(of: Masses, motion: np.ndarray) -> Look:
    """Return momenta and energies from poses and twists."""
    R = np.array([matrix(q) for q in motion[:, 3:7]])
    w = motion[:, 10:]
    arm = np.einsum('nij,nj->ni', R, of.com)
    v = motion[:, 7:10] + np.cross(w, arm)
    P = of.m[:, None] * v
    L = np.einsum('nij,njk,nlk,nl->ni', R, of.inertia, R, w)
    kinetic = 0.5 * ((P * v).sum(axis=1) + (L * w).sum(axis=1))
    return Look(motion[:, :3] + arm, v, w, P, L, kinetic)


def potential(spec: Spec, of: Masses, now: Look) -> float:
    """Return the energy [J] of gravity."""
    return -float(of.m @ (now.x @ np.asarray(spec['world']['gravity'])))


class Verdict(NamedTuple):
    """What a law found: a breach if the figure is above what is allowed."""

    figure: float
    allowed: float
    what: str = ''  # what the figure is of

    @property
    def breach(self) -> bool:
        """Return whether the law is broken; what is no number breaks it too."""
        return not self.figure <= self.allowed


def worst(verdicts: list[Verdict]) -> Verdict:
    """Return the verdict that is farthest above, or least below, what is allowed."""
    def ratio(one: Verdict) -> float:
        found = one.figure / one.allowed if one.allowed > 0 else np.inf * (one.figure > 0)
        return found if found == found else np.inf
    return max(verdicts, key=ratio)
