# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small worlds of shapes that touch, for the contact models of the engine."""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.contact.carried_forces import Carried
from rigid_sim_ros.engine.detection.manifolds import current_manifolds, empty_memory
from rigid_sim_ros.engine.dynamics.forces import WIDTH
from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches
from rigid_sim_ros.engine.events.buffers import Buffers
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.kinds.box import box as box_mass
from rigid_sim_ros.engine.model.kinds.sphere import sphere
from rigid_sim_ros.engine.model.kinds.table import BOX, PLANE, SPHERE
from rigid_sim_ros.engine.model.model import Body, build_model, ForceTable
from rigid_sim_ros.engine.model.shapes import build_materials, build_shapes, Shape
from rigid_sim_ros.engine.state.state import (
    copy_state, empty_motion, empty_state, kinetic_energy, total_angular_momentum, write_motion)
from rigid_sim_ros.engine.steps import event, penalty

G = 9.81


class Thing(NamedTuple):
    """One body with one shape in the middle of its frame; no mass: it is fixed."""

    kind: int
    size: Sequence[float]
    mass: MassProperties | None = None
    position: Sequence[float] = (0.0, 0.0, 0.0)
    orientation: Sequence[float] = (0.0, 0.0, 0.0, 1.0)
    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    spin: Sequence[float] = (0.0, 0.0, 0.0)


def ground(orientation=(0.0, 0.0, 0.0, 1.0)) -> Thing:
    return Thing(PLANE, (0.0, 0.0, 0.0), orientation=orientation)


def ball(radius, mass, **motion) -> Thing:
    return Thing(SPHERE, (radius, 0.0, 0.0), sphere(mass, radius), **motion)


def box(size, mass, **motion) -> Thing:
    return Thing(BOX, tuple(0.5 * side for side in size), box_mass(mass, size), **motion)


def about_y(angle) -> tuple[float, float, float, float]:
    return (0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle))


class _Scene:
    """Bodies, shapes and one material, with the state at hand."""

    def __init__(self, things, material, h, gravity):
        bodies = [Body(thing.mass, thing.mass is None) for thing in things]
        none = np.zeros(0, dtype=np.int64)
        forces = ForceTable(none, none, none, np.zeros((0, WIDTH)))
        self.model = build_model(bodies, [], forces, h, gravity)
        self.shapes = build_shapes(self.model, [Shape(i, thing.kind, tuple(thing.size))
                                                for i, thing in enumerate(things)])
        self.materials = build_materials([material])
        self.state = empty_state(len(things))
        motion = empty_motion(len(things))
        for i, thing in enumerate(things):
            motion.position[i], motion.orientation[i] = thing.position, thing.orientation
            motion.linear[i], motion.angular[i] = thing.velocity, thing.spin
            write_motion(self.model, self.state, motion, i)
        self.wrenches = no_wrenches()
        self.memory = empty_memory(len(things), len(things))

    def basis(self) -> Basis:
        return Basis(self.model, self.state, self.wrenches, self.shapes, self.materials,
                     self.memory)

    @property
    def v(self):
        return self.state.P * self.model.inv_m

    def energy(self) -> float:
        return float(kinetic_energy(self.model, self.state))

    def momentum(self):
        return np.append(self.state.P.sum(axis=1), total_angular_momentum(self.state))

    def manifolds(self):
        return current_manifolds(self.memory)


class EventWork(NamedTuple):
    """What tests look at in the model `event`."""

    report: event.EventReport
    carried: Carried
    buffers: Buffers


class EventScene(_Scene):
    """A scene that runs with the model `event`."""

    def __init__(self, things, material, h=1e-3, gravity=(0.0, 0.0, -G)):
        super().__init__(things, material, h, gravity)
        self.arguments, self.pack = self._begin(), None
        self.settings = self.arguments.settings

    def _begin(self):
        return event.make_arguments(self.basis())

    @property
    def work(self) -> EventWork:
        c = self.arguments
        return EventWork(event.report(c), event.carried_over(c), c.buffers)

    def step(self, count=1) -> None:
        self.arguments, self.pack = event.advance(self.arguments, count, self.pack)
        self.memory = self.arguments.memory

    def twin(self) -> 'EventScene':
        """Return a scene that continues from the state and from what is carried over only."""
        other = object.__new__(EventScene)
        other.__dict__.update(self.__dict__)
        other.state = copy_state(self.state)
        count = len(self.shapes.body)
        other.memory = empty_memory(count, count)
        other.arguments, other.pack = event.with_carried(
            other._begin(), Carried(*(array.copy() for array in self.work.carried))), None
        return other


class PenaltyScene(_Scene):
    """A scene that runs with the model `penalty`."""

    def __init__(self, things, material, h=1e-3, gravity=(0.0, 0.0, -G)):
        super().__init__(things, material, h, gravity)
        self.arguments, self.pack = self._begin(), None

    def _begin(self):
        return penalty.make_arguments(self.basis())

    @property
    def bristles(self) -> penalty.Bristles:
        return penalty.carried_over(self.arguments)

    def step(self, count=1) -> None:
        self.arguments, self.pack = penalty.advance(self.arguments, count, self.pack)
        self.memory = self.arguments.memory

    def twin(self) -> 'PenaltyScene':
        """Return a scene that continues from the state and from the bristles, and nothing else."""
        other = object.__new__(PenaltyScene)
        other.__dict__.update(self.__dict__)
        other.state = copy_state(self.state)
        count = len(self.shapes.body)
        other.memory = empty_memory(count, count)
        other.arguments, other.pack = penalty.with_carried(other._begin(), self.bristles), None
        return other


def same_bits(a, b) -> bool:
    return all(x.tobytes() == y.tobytes() for x, y in zip(a, b, strict=True))
