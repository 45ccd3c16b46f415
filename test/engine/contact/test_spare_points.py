# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A face on many pieces of one body is borne by four points."""

from inside import arguments_of
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.steps import event

G = 9.81


def box_on_cells(cells: int, speed: float = 0.0) -> World:
    """Return a box of 0.3 m and 1 kg on a flat ground of so many cells a side, 1 m wide."""
    ground = {'type': 'heightfield', 'heights': np.zeros((cells + 1, cells + 1)).tolist(),
              'size': [1.0, 1.0]}
    return World.from_dict({
        'format': 1, 'world': {'step': 0.002, 'contact': 'event', 'gravity': [0, 0, -G]},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': ground},
                   {'name': 'box', 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.3, 0.3, 0.3]},
                    'pose': {'position': [0.01, 0.02, 0.15]},
                    'twist': {'linear': [0.0, 0.0, -speed]}}]})


def test_four_points_of_a_hundred_triangles_bear_a_box():
    world = box_on_cells(20)
    world.step(5)
    rows = world.contacts()
    assert len(rows) > 100
    bearing = rows[rows['normal_force'] > 0.0]
    assert len(bearing) == 4
    # Points may yield by 1e-6 of the accelerations.
    assert bearing['normal_force'].sum() == pytest.approx(G, rel=1e-6)
    # They are the corners, so that the box does not tip under a load beside its middle.
    corners = np.abs(bearing['point'][:, :2] - [0.01, 0.02])
    assert corners == pytest.approx(np.full((4, 2), 0.15), abs=1e-6)


def test_the_impact_of_a_face_on_many_triangles_is_a_small_problem():
    world = box_on_cells(20, speed=1.0)
    world.step(1)
    # It touches where a gap of 1e-8 of the smaller shape is left, which closes within a step.
    assert np.abs(world.linear_velocity[1]).max() < 1e-8 * 0.3 / 0.002
    # Its dense matrices have three to six rows a point, of the 32 that there is room for at least.
    assert len(arguments_of(world).buffers.room.e) == 32
    assert not event.report(arguments_of(world)).cut_short
