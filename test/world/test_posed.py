# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Poses that follow each other are a motion; a jump is none."""

import math

from carrying import crate, floor, REST, UPRIGHT, world_of
import numpy as np
import pytest
from scipy.spatial.transform import Rotation


@pytest.mark.parametrize('model', ['event', 'timestep', 'qp'])
def test_poses_set_in_every_step_are_the_twist_that_they_make(model):
    by_twist, by_pose = (world_of(model, floor(), crate()) for _ in range(2))
    by_twist.set_twist('floor', (0.1, 0.2, 0.3), (0, 0, 0.7))
    for k in range(200):
        t = 1e-3 * (k + 1)
        by_pose.set_pose('floor', (0.1 * t, 0.2 * t, 0.3 * t - 0.5),
                         Rotation.from_rotvec([0, 0, 0.7 * t]).as_quat())
        for world in (by_pose, by_twist):
            world.step()
    # A pose is rounded to 1e-16, its velocity over a step of 1 ms to 1e-13, and friction may take
    # such a difference for a direction.
    assert by_pose.position == pytest.approx(by_twist.position, abs=1e-7)
    assert by_pose.linear_velocity == pytest.approx(by_twist.linear_velocity, abs=1e-6)
    assert by_pose.angular_velocity[0] == pytest.approx([0, 0, 0.7], abs=1e-9)


def test_poses_that_come_at_50_hz_join_to_a_smooth_motion():
    world, fastest = world_of('timestep', floor(), crate()), 0.0
    for k in range(1000):
        if k % 20 == 0:
            world.set_pose('floor', (0, 0, 0.2 * 1e-3 * k - 0.5), UPRIGHT)
        world.step()
        fastest = max(fastest, world.linear_velocity[1, 2])
    # Later by one interval, with the last pose reached.
    assert world.position[0, 2] == pytest.approx(0.2 * 0.98 - 0.5, abs=1e-12)
    assert fastest == pytest.approx(0.2, abs=1e-6)
    assert world.position[1, 2] - world.position[0, 2] == pytest.approx(0.7, abs=1e-4)


def test_a_body_stands_still_once_it_is_there():
    world = world_of('timestep', floor(), crate())
    world.set_pose('floor', (1e-3, 0, -0.5), UPRIGHT)
    assert world.position[0].tolist() == [0, 0, -0.5]
    world.step()
    assert world.position[0] == pytest.approx([1e-3, 0, -0.5], abs=1e-16)
    # How it moved in the step that is over.
    assert world.linear_velocity[0] == pytest.approx([1, 0, 0])
    world.step()
    assert world.position[0] == pytest.approx([1e-3, 0, -0.5], abs=1e-16)
    assert not world.linear_velocity[0].any()


@pytest.mark.parametrize('model', ['event', 'timestep', 'qp'])
@pytest.mark.parametrize('position', [(5.0, 0.0, -0.5), (0.0, 0.0, -0.8), (30.0, 0.0, -0.5)])
@pytest.mark.parametrize('kind', ['fixed', 'kinematic'])
def test_a_jump_throws_nothing(model, position, kind):
    world = world_of(model, floor(**({'fixed': True} if kind == 'fixed' else {})), crate())
    world.step(100)
    world.set_pose('floor', position, UPRIGHT)
    assert world.position[0].tolist() == list(position)
    assert not world.linear_velocity[0].any()
    before = world.linear_velocity[1]
    world.step(10)
    assert abs(world.linear_velocity[1, 0]) < 1e-9
    # It falls at most.
    assert before[2] - 9.82 * 0.01 <= world.linear_velocity[1, 2] <= 1e-6


def test_a_jump_amid_poses_is_taken_at_once():
    slat = {'name': 'slat', 'kinematic': True, 'shape': {'type': 'box', 'size': [0.5, 2, 0.1]}}
    world, fastest = world_of('timestep', slat, crate(position=(9, 0, 0))), 0.0
    for k in range(500):
        world.set_pose('slat', (-1.0 + 0.01 * (k % 200), 0, 0), UPRIGHT)
        world.step()
        assert world.position[0, 0] == pytest.approx(-1.0 + 0.01 * (k % 200), abs=1e-12)
        fastest = max(fastest, float(np.abs(world.linear_velocity[0]).max()))
    assert fastest == pytest.approx(10.0)


def test_a_pose_set_twice_before_a_step_counts_once():
    world = world_of('timestep', floor(), crate())
    for k in range(5):
        for z in (-3.0, 1e-4 * (k + 1) - 0.5):
            world.set_pose('floor', (0, 0, z), UPRIGHT)
        world.step()
    # Each pair began with a jump, from which the way back is one again.
    assert world.position[0, 2] == pytest.approx(5e-4 - 0.5, abs=1e-12)


def test_what_has_a_twist_is_put_elsewhere_at_once_and_keeps_it():
    world = world_of('timestep', floor(twist={'linear': [1, 0, 0]}), crate())
    for _ in range(100):
        world.step()
        world.set_pose('floor', (0, 0, -0.5), UPRIGHT)
        assert world.position[0].tolist() == [0, 0, -0.5]
    assert world.linear_velocity[0].tolist() == [1, 0, 0]
    # So a belt may stay in its place.
    assert world.linear_velocity[1, 0] == pytest.approx(0.5 * 9.81 * 0.1, rel=1e-3)


def test_a_twist_ends_a_motion_to_a_pose():
    world = world_of('timestep', floor(), crate())
    for k in (0, 1):
        world.set_pose('floor', (1e-3 * k, 0, -0.5), UPRIGHT)
        world.step(10)
    world.set_pose('floor', (0.1, 0, -0.5), UPRIGHT)
    world.step(5)
    world.set_twist('floor', REST, REST)
    at = world.position[0].tolist()
    world.step(20)
    assert world.position[0].tolist() == at


def test_a_reset_forgets_the_poses_before():
    world = world_of('timestep', floor(), crate())
    for _ in range(2):
        for k in range(5):
            world.set_pose('floor', (0, 0, 1e-3 * k - 0.5), UPRIGHT)
            world.step(3)
        hashed = world.state_hash()
        world.reset()
    assert world.state_hash() == type(world)(world.scene).state_hash()
    for k in range(5):
        world.set_pose('floor', (0, 0, 1e-3 * k - 0.5), UPRIGHT)
        world.step(3)
    assert world.state_hash() == hashed


def test_a_plane_turns_to_a_pose():
    plane = {'name': 'floor', 'kinematic': True, 'shape': {'type': 'plane'}}
    world = world_of('timestep', plane, crate())
    for k in range(100):
        angle = 1e-3 * (k + 1)
        world.set_pose('floor', (0, 0, 0), (math.sin(angle / 2), 0, 0, math.cos(angle / 2)))
        world.step()
    assert world.angular_velocity[0] == pytest.approx([1, 0, 0], abs=1e-9)
    assert world.angular_velocity[1] == pytest.approx([1, 0, 0], abs=0.05)


@pytest.mark.parametrize(('pause', 'steps'), [(100, 100), (101, 1)])
def test_poses_join_if_they_follow_each_other_within_a_tenth_of_a_second(pause, steps):
    world = world_of('timestep', floor())
    world.set_pose('floor', (1e-3, 0, -0.5), UPRIGHT)
    world.step(pause)
    world.set_pose('floor', (2e-3, 0, -0.5), UPRIGHT)
    world.step()
    assert world.position[0] == pytest.approx([1e-3 + 1e-3 / steps, 0, -0.5], abs=1e-15)
