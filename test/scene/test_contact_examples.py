# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example scenes in which bodies touch do what their comments say."""

import math
from pathlib import Path
import re
import subprocess
import sys

import numpy as np
import pytest

from rigid_sim_ros import load_scene
from rigid_sim_ros.scene import catalogue

WRITER = Path(__file__).parents[2] / 'examples' / 'write_contact_scenes.py'
# A number with all its digits, as in a quaternion.
LONG = re.compile(r'-?\d\.\d{8,}(?:e-\d+)?')


def test_the_crates_on_the_ramp_slide_or_stay_as_their_friction_wills():
    world = load_scene('ramp')
    start = world.position
    world.step(2000)
    moved = np.linalg.norm(world.position - start, axis=1)
    angle, t = math.radians(20), 2.0
    for mu, name in ((0.2, 'crate_0'), (0.35, 'crate_1')):
        a = 9.81 * (math.sin(angle) - mu * math.cos(angle))
        # Positions in the file have six digits: a crate drops by some micrometres at first, which
        # rubs off 1e-4 m/s.
        assert moved[world.names.index(name)] == pytest.approx(a * t * t / 2, abs=1e-3)
    for name in ('crate_2', 'crate_3'):
        assert moved[world.names.index(name)] < 1e-4


def test_the_ball_brings_the_tower_down():
    world = load_scene('tower')
    top = world.names.index('block_9_1')
    height = world.position[top, 2]
    world.step(2500)
    assert world.position[top, 2] < 0.5 * height


def test_the_tower_stands_before_the_ball_comes():
    world = load_scene('tower')
    start = world.position
    world.step(100)  # 0.2 s: the ball is 0.75 m away
    moved = np.linalg.norm(world.position - start, axis=1)[:-1]
    assert moved.max() < 1e-3  # m, of sag


def test_every_domino_falls():
    world = load_scene('dominoes')
    world.step(3000)
    x, y = world.orientation[:, 0], world.orientation[:, 1]
    upright = 1.0 - 2.0 * (x * x + y * y)  # the world's z in the domino's z
    assert (upright[1:] < 0.9).all()


def test_one_ball_of_the_cradle_comes_in_and_one_leaves():
    world = load_scene('newtons_cradle')
    quarter = 0.25 * 2 * math.pi * math.sqrt(0.2 * math.cos(math.pi / 6) / 9.81)
    world.step(round(1.25 * quarter / 0.0005))
    v = world.linear_velocity[:, 0]
    assert v[4] > 0.5
    assert abs(v[:4]).max() < 0.1 * v[4]


def test_the_break_scatters_the_rack():
    world = load_scene('billiard_break')
    start = world.position
    world.step(2000)
    moved = np.linalg.norm(world.position - start, axis=1)
    balls = [i for i, name in enumerate(world.names) if 'ball' in name]
    assert np.count_nonzero(moved[balls] > 0.02) >= 10    # of 16
    assert abs(world.position[balls, 1]).max() < 0.66  # nobody leaves the table


@pytest.mark.parametrize(('name', 'steps'), [('pile_of_shapes', 1500), ('balls', 500)])
def test_the_heaps_stay_above_the_ground_and_out_of_each_other(name, steps):
    world = load_scene(name)
    deepest = 0.0
    for _ in range(10):
        world.step(steps // 10)
        deepest = max(deepest, world.contact_report().deepest)
    assert np.isfinite(world.position).all()
    assert deepest < 0.005
    assert world.position[1:, 2].min() > 0.0


def test_the_script_writes_the_scenes_that_ship(tmp_path):
    subprocess.run([sys.executable, WRITER, tmp_path], check=True, capture_output=True)
    written = sorted(tmp_path.iterdir())
    assert len(written) == 7
    for path in written:
        ours, shipped = path.read_text(), catalogue.find(path.stem).read_text()
        assert LONG.sub('', ours) == LONG.sub('', shipped), path.stem
        # A norm and a sine: with and without fused operations, as processors have them, the last
        # digits differ, by some 1.1e-16 of numbers up to 1.
        assert np.allclose([float(number) for number in LONG.findall(ours)],
                           [float(number) for number in LONG.findall(shipped)], rtol=0, atol=1e-15)


def test_the_turntable_keeps_the_inner_crate_and_loses_the_outer_one():
    world = load_scene('turntable')
    names = world.names
    world.step(2000)
    # 2 rad/s for 2 s; a method of first order goes w^2 h r / 2 farther out in a second.
    inner = world.position[names.index('inner')]
    assert np.hypot(*inner[:2]) == pytest.approx(0.5, abs=5e-3)
    turned = np.arctan2(inner[1], inner[0])
    assert np.remainder(turned - 4.0 + np.pi, 2 * np.pi) - np.pi == pytest.approx(0.0, abs=0.02)
    assert np.hypot(*world.position[names.index('outer'), :2]) > 1.1
    # On the lift, which went up by 0.2 m; a ball of 0.15 m on it.
    assert world.position[names.index('lift')] == pytest.approx([3, 0, 0.3], abs=1e-12)
    assert world.position[names.index('ball'), 2] == pytest.approx(0.5, abs=1e-4)
    assert world.linear_velocity[names.index('ball'), 2] == pytest.approx(0.1, abs=1e-3)


def test_the_rattleback_turns_back_and_its_twin_does_not():
    world = load_scene('rattleback')
    against, along, cone = (world.names.index(name) for name in ('against', 'along', 'cone'))
    standing = world.names.index('standing')
    start = world.position
    world.step(10_000)
    spin = world.angular_velocity
    assert spin[against, 2] > 4.0
    assert spin[along, 2] > 4.5
    # 1.5 rad/s / tan of the angle between axis and mantle, tan 0.5.
    assert np.linalg.norm(spin[cone]) == pytest.approx(3.0, abs=1e-5)
    assert world.position[standing] == pytest.approx(start[standing], abs=1e-9)


def test_what_starts_on_the_slopes_stays_in_the_valley_and_comes_to_rest():
    world = load_scene('valley')
    start = world.potential_energy()
    world.step(5000)
    p = world.position[1:]
    assert (np.abs(p[:, :2]) < 3.5).all()
    assert (p[:, 2] > 0.0).all()        # the lowest place lies at -0.1 m
    assert world.potential_energy() < start
    assert (np.linalg.norm(world.linear_velocity, axis=1) < 0.1).all()
