# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The arguments of a step of the model `timestep`: constants, state, and buffers."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.constraints.contact_prediction import make_prediction, Prediction
from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.contact.colliding_body import CollisionWork, make_collision_work
from rigid_sim_ros.engine.detection.manifolds import Memory
from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads, Loads
from rigid_sim_ros.engine.dynamics.free_flight import BLOCK_SIZE as FLIGHT_SIZE
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.model.joints import JointTable
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import can_meet, Materials, Shapes
from rigid_sim_ros.engine.solver.coloring import (
    Blocks, Coloring, make_blocks, make_coloring, most_blocks, REGIONS)
from rigid_sim_ros.engine.solver.direct_islands import differ
from rigid_sim_ros.engine.solver.direct_newton import Direct, make_direct
from rigid_sim_ros.engine.solver.impacts import Impacts, make_impacts
from rigid_sim_ros.engine.solver.new_islands import make_new_islands, NewIslands
from rigid_sim_ros.engine.solver.partition import Cut, make_sides, Sides
from rigid_sim_ros.engine.solver.sleeping import linked_bodies, no_rest, Rest
from rigid_sim_ros.engine.solver.solver_bodies import make_bodies, SolverBodies
from rigid_sim_ros.engine.state.body_order import middle_of
from rigid_sim_ros.engine.state.state import empty_state, State
from rigid_sim_ros.kernels.arrays import Array, IntArray, integers, room
from rigid_sim_ros.kernels.second_core import make_job


class SequentialSettings(NamedTuple):
    """Numbers that trade accuracy for time and softness for speed."""

    substeps: int = 4  # more: stiffer and slower; an overlap under load shrinks with the square
    # part of an overlap that a substep pushes out; above 0.5 neighbours overshoot
    push: float = 0.2


class SequentialWork(NamedTuple):
    """Buffers for one step: nothing here outlives it but what is reported."""

    bodies: SolverBodies
    sides: Sides
    coloring: Coloring
    blocks: Blocks
    fresh: IntArray  # (blocks,) the bits of lanes that touch without an impulse to begin with
    begin: NewIslands
    impacts: Impacts
    shifted: IntArray  # (1,) 1 if collisions moved bodies since detection
    notes: Array  # (REGIONS, 8) see DEEPEST and LARGEST
    residual: Array  # (1,) [m/s] largest change of a contact's velocity in the last sweep
    overlap: Array  # (1,) [m] deepest


def _make_sequential_work(n: int, middle: tuple[int, int], capacity: int) -> SequentialWork:
    """Return buffers for n bodies and `capacity` manifolds; for `middle` see `make_sides`."""
    return SequentialWork(make_bodies(n), make_sides(n, middle), make_coloring(n, capacity),
                          make_blocks(capacity), integers(most_blocks(capacity)),
                          make_new_islands(n, capacity), make_impacts(n, capacity),
                          np.zeros(1, dtype=np.int64),
                          room(REGIONS, 8), np.zeros(1), np.zeros(1))


class Ways(NamedTuple):
    """How far n bodies go in a step, see passages.py."""

    thinnest: Array  # (1,) [m] half of the least that any shape measures across
    begin: Array  # (n,) [s] after the start of the step, from when on a way is looked at
    path: State  # with which P and L they would get there, if these were constant
    length: Array  # (n,) [m] how far any point of a body goes, at most, past what is at rest
    part: Array  # (n,) of its way that a body may go
    carried: Array  # (3, n) [m/s] with which it goes on then, with what it met
    met: IntArray  # (n, 2) the shapes that met there, -1: it was not stopped
    sank: IntArray  # (n,) 1 if they overlapped as the way began


def _make_ways(shapes: Shapes, n: int) -> Ways:
    """Return room for n bodies."""
    return Ways(np.array([shapes.half_width.min(initial=np.inf)]), room(n), empty_state(n),
                room(n), room(n), room(3, n), np.full((n, 2), -1), integers(n))


class TimestepSettings(NamedTuple):
    """The parameters of the model."""

    sequential: SequentialSettings = SequentialSettings()
    # contacts are found this far ahead, as a part of the half thickness of what may move: less
    # misses some, more costs time
    margin: float = 0.01
    sleep_steps: int = 0  # what has been at rest for so many steps sleeps; 0: nothing does


class TimestepWork(NamedTuple):
    """Buffers; only the impulses of the last step are worth reading afterwards."""

    loads: Loads
    later: Loads
    loaded: IntArray  # (1,) 1 if others than gravity act in this step
    uniform: IntArray  # (1,) 1 if `loads` are those of gravity alone, as in most steps
    block: Array
    radius: Array  # (n,) [m] how far the shapes of a body reach from its centre of mass
    thickness: Array  # (s,) [m] half of the least that a shape measures across; of a plane 0
    thrown: IntArray  # (s,) of 8 bits, 1: its margin is that of what may be hit in this step
    round_shapes: IntArray  # (s,) 1: a ball about its centre of mass, or a body that never moves
    prediction: Prediction
    collision: CollisionWork
    solver: SequentialWork
    direct: Direct
    ways: Ways


def make_timestep_work(model: Model, shapes: Shapes, memory: Memory) -> TimestepWork:
    """Return buffers for a world whose manifolds live in `memory`."""
    n, capacity = model.m.shape[0], memory.pages[0].shape_a.shape[0]
    return TimestepWork(empty_loads(n), empty_loads(n), integers(1), integers(1),
                        np.zeros(FLIGHT_SIZE), radii(shapes, n), thicknesses(shapes),
                        room(shapes.body.shape[0], kind=np.int8),
                        _round_shapes(model, shapes),
                        make_prediction(n, shapes.body.shape[0], capacity),
                        make_collision_work(n, capacity),
                        _make_sequential_work(n, middle_of_shapes(model, shapes.body), capacity),
                        make_direct(n, capacity), _make_ways(shapes, n))


def with_cut(work: TimestepWork, cut: Cut) -> TimestepWork:
    """Return buffers, the same, for a world that is cut in this way."""
    for there, field in zip(work.solver.sides.cut, cut, strict=True):
        there[:] = field
    return work


def radii(shapes: Shapes, bodies: int) -> Array:
    """Return how far the shapes of each body reach from its centre of mass, (n,) [m]."""
    radius = np.zeros(bodies)
    finite = np.isfinite(shapes.bound)
    reach = np.linalg.norm(shapes.p_CS[finite], axis=1) + shapes.bound[finite]
    np.maximum.at(radius, shapes.body[finite], reach)
    return radius


def thicknesses(shapes: Shapes) -> Array:
    """Return half of the least that each shape measures across, (s,) [m]; of a plane 0."""
    return np.where(np.isfinite(shapes.half_width), shapes.half_width, 0.0)


def _round_shapes(model: Model, shapes: Shapes) -> IntArray:
    i = shapes.body
    alike = (model.inv_I_C[:, i] == model.inv_I_C[0, i]).all(axis=0)
    return np.where((shapes.ball == 1) & alike | (model.inv_m[i] == 0.0), 1, 0)


def middle_of_shapes(model: Model, body: IntArray) -> tuple[int, int]:
    """
    Return the first body of the second half by number, and its first shape.

    Not quite in the middle where else a body would be on both sides.
    """
    before, after = np.maximum.accumulate(body), np.minimum.accumulate(body[::-1])[::-1]
    places = 1 + np.flatnonzero(before[:-1] < after[1:])
    later = places[after[places] >= middle_of(model.inv_m)]
    if len(later) == 0:
        return len(model.m), len(body)
    return int(after[later[0]]), int(later[0])


class Uses(NamedTuple):
    """What a world has, 1 or 0."""

    contacts: int  # there are two shapes that could meet
    bounces: int  # something has a restitution
    uneven: int  # masses differ so much that small islands are solved directly


class Arguments(NamedTuple):
    """What the kernels of a step read and write."""

    model: Model
    state: State
    wrenches: Wrenches
    shapes: Shapes
    materials: Materials
    memory: Memory
    settings: TimestepSettings
    work: TimestepWork
    rest: Rest
    uses: Uses
    job: IntArray  # where a second core finds what to do, see second_core.py


def make_arguments(basis: Basis, settings: TimestepSettings,
                   joints: JointTable | None = None) -> Arguments:
    """Return the arguments of a world with buffers of their own; nobody helps, nobody sleeps."""
    model, shapes = basis.model, basis.shapes
    uses = Uses(int(can_meet(shapes)), int((basis.materials.restitution > 0.0).any()),
                int(differ(model.inv_m)))
    return Arguments(*basis, settings, make_timestep_work(model, shapes, basis.memory),
                     no_rest(len(model.m), linked_bodies(model, joints)), uses, make_job())


def with_memory(c: Arguments, memory: Memory) -> Arguments:
    """Return arguments with another memory, and buffers for it; how the world is cut stays."""
    if len(memory.pages[0].shape_a) > len(c.work.collision.rows):
        work = make_timestep_work(c.model, c.shapes, memory)
        c = c._replace(work=with_cut(work, c.work.solver.sides.cut))
    return c._replace(memory=memory)
