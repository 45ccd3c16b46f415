# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hands that hold bodies, in worlds that feel what they do."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.viewer.grip import grip, Hands, held_point, Push
from rigid_sim_ros.viewer.motion import Motion

WAY = np.array([0.5, -0.3, 0.4])
PERIOD = 10     # steps from one wrench to the next, as a node that publishes at 100 Hz


def world(mass=2.0, size=(0.4, 0.3, 0.2), gravity=(0, 0, -9.81)):
    return World.from_dict({
        'format': 1, 'world': {'contact': 'none', 'gravity': list(gravity)},
        'bodies': [{'name': 'crate', 'mass': mass,
                    'shape': {'type': 'box', 'size': list(size)},
                    'pose': {'position': [1, 2, 3], 'orientation': [0.5, 0.1, -0.7, 0.5]}}]})


def motion_of(w):
    return Motion(w.time_ns, w.position, w.orientation, w.linear_velocity, w.angular_velocity)


def run(w, hands, seconds):
    """Let the hands act as they do on a node: a constant wrench from each state to the next."""
    for _ in range(round(seconds / (PERIOD * 1e-3))):
        for wrench in hands.wrenches(motion_of(w), 1e-9 * w.time_ns):
            w.apply_wrench(wrench.body, wrench.force, wrench.torque, duration=PERIOD * 1e-3)
        w.step(PERIOD)


@pytest.mark.parametrize('mass', [1e-3, 2.0, 500.0])
@pytest.mark.parametrize('offset', [(0, 0, 0), (0.2, 0.15, 0.1), (0.2, 0, 0)])
def test_a_held_point_comes_to_the_mouse_and_rests_there(mass, offset):
    w = world(mass)
    hands = Hands(w.scene)
    start = w.position[0] + np.array(offset)
    hand = grip(0, tuple(start), motion_of(w))
    assert held_point(hand, motion_of(w)) == pytest.approx(start, abs=1e-12)    # rounding of 3 m
    hands.grips[7] = hand._replace(target=tuple(start + WAY))
    run(w, hands, 8.0)
    # o = 8 / s at most: after 8 s no more than e^-60 of the way is left, but for the swinging of a
    # body that hangs from the hand, which fades with 2 / s.
    assert held_point(hand, motion_of(w)) == pytest.approx(start + WAY, abs=1e-3)
    assert np.linalg.norm(w.linear_velocity) < 1e-2


def test_a_hand_carries_the_weight_at_once():
    w = world()
    hands = Hands(w.scene)
    hands.grips[0] = grip(0, tuple(w.position[0]), motion_of(w))
    run(w, hands, 1.0)
    assert w.position[0] == pytest.approx([1, 2, 3], abs=1e-9)


def test_a_push_acts_for_its_time_and_no_longer():
    w = world(mass=2.0, gravity=(0, 0, 0))
    hands = Hands(w.scene)
    hands.pushes.append(Push(0, (3.0, 0.0, 0.0), (0.0, 0.0, 0.0), False, 200_000_000))
    run(w, hands, 1.0)
    assert w.linear_momentum[0] == pytest.approx([3.0 * 0.2, 0, 0], rel=1e-12)  # F t
    assert hands.are_idle


def test_a_push_counts_from_when_it_begins():
    w = world(mass=2.0, gravity=(0, 0, 0))
    hands = Hands(w.scene)
    run(w, hands, 0.5)
    for _ in range(2):      # they add up
        hands.pushes.append(Push(0, (3.0, 0.0, 0.0), (0.0, 0.0, 0.0), False, 200_000_000))
    run(w, hands, 0.1)
    assert w.linear_momentum[0] == pytest.approx([2 * 3.0 * 0.1, 0, 0], rel=1e-12)
    run(w, hands, 0.5)
    assert w.linear_momentum[0] == pytest.approx([2 * 3.0 * 0.2, 0, 0], rel=1e-12)


def test_a_push_in_body_axes_turns_with_the_body():
    w = world(gravity=(0, 0, 0))
    axis = World.from_dict(w.scene.spec.model_dump(exclude_none=True)).orientation[0]
    hands = Hands(w.scene)
    hands.pushes.append(Push(0, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), True, 100_000_000))
    run(w, hands, 0.1)
    x, y, z, q = axis
    column = [1 - 2 * (y * y + z * z), 2 * (x * y + z * q), 2 * (x * z - y * q)]
    assert w.linear_momentum[0] == pytest.approx(0.1 * np.array(column), abs=1e-12)


def test_hands_of_several_pages_add_up():
    w = world(gravity=(0, 0, 0))
    hands = Hands(w.scene)
    for page, way in enumerate(([1.0, 0, 0], [-1.0, 0, 0])):
        hand = grip(0, tuple(w.position[0]), motion_of(w))
        hands.grips[page] = hand._replace(target=tuple(w.position[0] + way))
    forces = [wrench.force for wrench in hands.wrenches(motion_of(w), 0.0)]
    assert np.sum(forces, axis=0) == pytest.approx([0, 0, 0], abs=1e-9)
