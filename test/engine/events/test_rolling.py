# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model `event`: what rolls without slipping keeps its energy, to second order of the step."""

import math
from typing import Any

import numpy as np
import pytest

from rigid_sim_ros.world import World

G, RADIUS, LENGTH = 9.81, 0.1, 0.01


def world(body: dict[str, Any], step: float) -> World:
    ground = {'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}
    return World.from_dict({'format': 1, 'world': {'contact': 'event', 'step': step},
                            'materials': {'default': {'friction': 1.0}},
                            'bodies': [ground, {'name': 'roller', **body}]})


def rocking(step: float) -> World:
    """Return a ball with a low centre of mass that begins to rock from 0.5 rad."""
    moment = 0.4 * RADIUS ** 2
    return world({'shape': {'type': 'sphere', 'radius': RADIUS},
                  'inertial': {'mass': 1.0, 'com': [0, 0, -0.03],
                               'inertia': [moment, moment, moment, 0, 0, 0]},
                  'pose': {'position': [0, 0, RADIUS],
                           'orientation': [0, math.sin(0.25), 0, math.cos(0.25)]}}, step)


def rolling_disk(step: float) -> World:
    """
    Return a disk that rolls steadily at 20 degrees, with its centre at rest (Euler's disk).

    The point of contact p is on the instantaneous axis, so w = k p. With a precession Omega about
    z, w = Omega z + s e (e: the axis of the disk) gives k = -Omega sin(angle) / r, and
    Omega z x L = p x N gives Omega.
    """
    angle = math.radians(20.0)
    e = np.array([math.sin(angle), 0, math.cos(angle)])
    down = np.array([math.cos(angle), 0, -math.sin(angle)])
    p = -0.5 * LENGTH * e + RADIUS * down
    across, along = (3 * RADIUS ** 2 + LENGTH ** 2) / 12.0, 0.5 * RADIUS ** 2
    k = -math.sin(angle) / RADIUS  # for Omega = 1
    L = along * (-0.5 * k * LENGTH) * e + across * (k * RADIUS) * down
    torque = np.cross(p, [0, 0, G])[1]
    omega = math.sqrt(torque / np.cross([0, 0, 1.0], L)[1])
    return world({'shape': {'type': 'cylinder', 'radius': RADIUS, 'length': LENGTH}, 'mass': 1.0,
                  'pose': {'position': [0, 0, -p[2]],
                           'orientation': [0, math.sin(0.5 * angle), 0, math.cos(0.5 * angle)]},
                  'twist': {'linear': [0, 0, 0], 'angular': (omega * k * p).tolist()}}, step)


def gain(made: World, seconds: float, step: float) -> float:
    """Return the largest change of the energy against that at the start, at 20 moments."""
    start, most = made.kinetic_energy() + made.potential_energy(), 0.0
    for _ in range(20):
        made.step(round(seconds / step / 20))
        most = max(most, abs(made.kinetic_energy() + made.potential_energy() - start))
    return most / start


@pytest.mark.parametrize(('build', 'rate'), [(rocking, 6.0), (rolling_disk, 35.0)])
def test_what_rolls_keeps_its_energy_to_second_order(build, rate):
    step = 1e-3
    coarse, fine = gain(build(2 * step), 2.0, 2 * step), gain(build(step), 2.0, step)
    # (rate h)^2 is the error of a method of second order for a motion of `rate` [rad/s].
    assert fine < (rate * step) ** 2
    # Four times as large at twice the step; 2 would be the first order.
    assert fine < 0.35 * coarse
