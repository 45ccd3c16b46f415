# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reference solver of the model `timestep` against formulas and the sequential solver."""

import math

from engine.stepping import TimestepScene
from engine.touching import about_y, ball, box, G, ground
import numpy as np
import pytest

from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.steps.qp import advance, make_arguments

SLOPE = math.radians(20.0)
DOWNHILL = np.array([math.cos(SLOPE), 0.0, -math.sin(SLOPE)])
UPWARDS = np.array([math.sin(SLOPE), 0.0, math.cos(SLOPE)])


class QpScene(TimestepScene):
    """A scene that runs with the model `timestep` and the solver `qp`."""

    def __init__(self, things, material, h=1e-3, gravity=(0.0, 0.0, -G)):
        super().__init__(things, material, h, gravity)
        self.qp = make_arguments(self.basis(), self.settings)

    def step(self, count=1) -> None:
        self.qp = advance(self.qp, count)
        self.memory = self.qp.memory


def test_a_box_slides_with_g_sine_minus_mu_g_cosine():
    scene = QpScene([ground(about_y(SLOPE)), box((1, 1, 0.5), 1.0, position=0.25 * UPWARDS,
                                                 orientation=about_y(SLOPE))],
                    Material(friction=0.2))
    start = scene.state.x[:, 1].copy()
    scene.step(500)
    exact = 0.5 * G * (math.sin(SLOPE) - 0.2 * math.cos(SLOPE)) * 0.5 ** 2
    # The points give way by 1e-8 of A to be unique.
    assert (scene.state.x[:, 1] - start) @ DOWNHILL == pytest.approx(exact, rel=1e-6)
    assert scene.qp.work.report.solved


def test_an_apex_is_e_squared():
    r, e = 0.1, 0.8
    scene = QpScene([ground(), ball(r, 1.0, position=(0, 0, r + 0.2))], Material(restitution=e))
    scene.step(300)
    apex = scene.state.x[2, 1] - r + scene.v[2, 1] ** 2 / (2.0 * G)
    assert apex == pytest.approx(0.2 * e ** 2, abs=1e-10)


def test_a_tower_rests_on_the_ground():
    boxes = [box((1, 1, 1), 1.0, position=(0, 0, 0.5 + k)) for k in range(4)]
    scene = QpScene([ground(), *boxes], Material(friction=0.6), 1 / 240)
    scene.step(100)
    assert np.abs(scene.v).max() < 1e-6  # 1e-8 of A times four weights and 1 / 240 s: 2e-9
    assert scene.state.x[2, 1:] == pytest.approx(0.5 + np.arange(4), abs=1e-6)


def test_a_free_pair_keeps_its_momenta():
    scene = QpScene(
        [box((1, 0.8, 0.6), 1.0, velocity=(1, 0, 0), spin=(0.1, 1, 0.3)),
         box((1, 0.8, 0.6), 2.0, position=(0.1, 0.1, 0.7), velocity=(0, 0.5, -1), spin=(0, 0, 2))],
        Material(friction=0.5), 1 / 240, (0, 0, 0))
    before = scene.momentum()
    scene.step(120)
    assert scene.momentum() == pytest.approx(before, abs=1e-12)  # rounding


def test_a_pair_that_presses_while_it_falls_keeps_its_angular_momentum():
    # Slowly enough that what the impulses change looks as smooth as a fall.
    scene = QpScene([ball(0.1, 1.0, position=(0.01, 0.02, 0.0), velocity=(0, 0, 0.01)),
                     ball(0.1, 2.0, position=(0.0, 0.0, 0.198), spin=(0.1, 0.2, 0))],
                    Material(friction=0.5), 1 / 240)

    def about_the_centre():
        x, P = scene.state.x.T, scene.state.P.T
        centre = (scene.model.m @ x) / scene.model.m.sum()
        return np.cross(x - centre, P).sum(axis=0) + scene.state.L.sum(axis=1)

    before, impulses = about_the_centre(), 0.0
    for _ in range(5):
        scene.step()
        impulses = max(impulses, scene.manifolds().impulse[0, :1].max())
    assert impulses > 1e-3      # N s
    assert about_the_centre() == pytest.approx(before, abs=1e-14)   # rounding


def test_the_sequential_solver_agrees_on_how_a_box_lands():
    things = [ground(), box((1, 1, 1), 1.0, position=(0, 0, 0.75), velocity=(1, 0, 0),
                            orientation=about_y(0.1))]
    reference, fast = QpScene(things, Material()), TimestepScene(things, Material())
    reference.step(700)
    fast.step(700)
    # Both are of first order in the step when a box lands on an edge and topples.
    assert fast.state.x[:, 1] == pytest.approx(reference.state.x[:, 1], abs=5e-3)
