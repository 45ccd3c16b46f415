# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example scenes: they can be found, and they do what their comments say."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipk

from rigid_sim_ros import load_scene, World
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.scene import DEFAULT_SCENE, describe, example_names, read_scene, SceneError


def axis(world: World, body_axis: tuple[float, float, float]) -> Array:
    """Return an axis of the first body in world axes."""
    x, y, z, w = world.orientation[0]
    u, v = np.array([x, y, z]), np.array(body_axis)
    t = 2.0 * np.cross(u, v)
    return v + w * t + np.cross(u, t)


def test_there_are_examples_of_every_promised_kind() -> None:
    assert set(example_names()) >= {
        'tumbling_cubesat', 't_handle', 'spring_pendulum', 'free_top', 'drone_in_wind'}


def test_the_default_scene_is_an_example() -> None:
    assert DEFAULT_SCENE in example_names()


@pytest.mark.parametrize('name', example_names())
def test_an_example_is_described_in_one_sentence(name: str) -> None:
    line = describe(name)
    assert line[0].isupper()
    assert line.endswith('.')
    assert len(line) < 100


def test_only_an_example_is_described() -> None:
    with pytest.raises(SceneError, match='neither a scene file nor an example'):
        describe('no_such_example')


def test_a_file_comes_before_an_example_of_its_name(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 't_handle').write_text('bodies: [{name: mine, fixed: true}]')
    monkeypatch.chdir(tmp_path)
    assert read_scene('t_handle').names == ('mine',)


def test_a_folder_does_not_hide_an_example(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 't_handle').mkdir()
    monkeypatch.chdir(tmp_path)
    assert read_scene('t_handle').names == ('t_handle',)


def test_the_cubesat_has_the_principal_moments_of_its_source() -> None:
    moments = np.sort(read_scene('tumbling_cubesat').model.I_C[:, 0])
    # The source gives three digits after the point for 1.715, 2.05 and 2.114 g m^2.
    assert moments == pytest.approx([1.715e-3, 2.05e-3, 2.114e-3], abs=0.6e-6)


def test_the_cubesat_tumbles_about_a_centre_of_mass_at_rest() -> None:
    world = load_scene('tumbling_cubesat')
    L, E = world.angular_momentum[0].copy(), world.kinetic_energy()
    start = world.angular_velocity[0].copy()
    world.step(20_000)
    assert np.linalg.norm(world.linear_momentum[0]) < 1e-15  # rounding of v = w x r, 5e-4 m/s
    assert world.angular_momentum[0] == pytest.approx(L, rel=1e-12)
    assert world.kinetic_energy() == pytest.approx(E, rel=1e-12)
    assert np.linalg.norm(world.angular_velocity[0] - start) > 0.01  # the axis wanders


def test_the_t_handle_turns_over_as_the_elliptic_integral_says() -> None:
    world = load_scene('t_handle')
    model = world.scene.model
    order = np.argsort(model.I_C[:, 0])
    I1, I2, I3 = model.I_C[order, 0]
    w = world.angular_velocity[0][order]
    L2, E2 = float((np.array([I1, I2, I3]) * w) @ (np.array([I1, I2, I3]) * w)), float(
        np.array([I1, I2, I3]) @ w**2)
    scale = (I2 - I1) * (E2 * I3 - L2)
    expected = 2.0 * ellipk((I3 - I2) * (L2 - E2 * I1) / scale) * math.sqrt(I1 * I2 * I3 / scale)
    assert expected == pytest.approx(3.72, abs=0.005)  # as the comment in the file says
    turns, before = [], 1.0
    while len(turns) < 4:
        world.step()
        # The spin about the stem has one sign before the turn, the other after it.
        now = float(world.angular_velocity[0] @ axis(world, (0.0, 0.0, 1.0)))
        if now * before < 0.0:
            turns.append(world.time_ns * 1e-9)
        before = now
    assert np.diff(turns) == pytest.approx([expected] * 3, abs=1e-3)  # a step of 1 ms


def test_the_spring_pendulum_keeps_energy_and_spin_while_it_trades_bouncing_for_swinging() -> None:
    world = load_scene('spring_pendulum')
    energy = world.kinetic_energy() + world.potential_energy()
    spin = np.cross(world.position[0], world.linear_momentum[0])[2]
    swing = 0.0
    for _ in range(3000):
        world.step(10)
        swing = max(swing, float(np.hypot(*world.position[0, :2])))
    # A symplectic method of first order is off by h w of the oscillation's energy at most, here
    # 1e-3 s * 6.3 rad/s * (39 N/m * (0.08 m)^2 / 2 = 0.13 J); it does not drift.
    assert world.kinetic_energy() + world.potential_energy() == pytest.approx(energy, abs=8e-4)
    assert np.cross(world.position[0], world.linear_momentum[0])[2] == pytest.approx(
        spin, rel=1e-9)
    # All of the bounce of 8 cm in the swing: k b^2 / 2 = (m g / l) a^2 / 2 with k = 4 m g / l
    # makes a = 2 b = 16 cm, and the 4 cm it began with on top.
    assert 0.12 < swing < 0.20


def test_the_bob_hangs_at_rest_where_its_comment_says() -> None:
    scene = read_scene('spring_pendulum')
    spring = scene.spec.forces[0]
    load = scene.spec.bodies[0].mass * 9.81 / spring.stiffness
    assert spring.anchor[2] - spring.rest_length - load == pytest.approx(1.0, abs=1e-15)


def test_the_free_top_precesses_at_l_over_i1_on_its_cone() -> None:
    world = load_scene('free_top')
    I_across = world.scene.model.I_C[0, 0]
    rate = float(np.linalg.norm(world.angular_momentum[0])) / I_across
    axle = axis(world, (0.0, 0.0, 1.0))
    start = math.atan2(axle[1], axle[0])
    world.step(1000)
    axle = axis(world, (0.0, 0.0, 1.0))
    # Fourth order: 1000 steps of 0.012 rad are off by about 1000 * 0.012^5 / 720 = 3e-10 rad.
    assert math.degrees(math.acos(axle[2])) == pytest.approx(20.0, abs=1e-6)
    turned = math.atan2(axle[1], axle[0]) - start - rate * 1.0
    assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


def test_the_drone_adrift_takes_up_the_speed_of_the_wind() -> None:
    world = load_scene('drone_in_wind')
    drag, m, wind = 5.67e-3, 0.028, 3.0
    world.step(5000)
    expected = wind * (1.0 - math.exp(-5.0 * drag / m))
    # First order in the step: h c / (2 m) = 1e-4 of the wind's speed.
    assert world.linear_velocity[1, 0] == pytest.approx(expected, abs=1e-4 * wind)


def test_the_drone_that_is_held_rests_where_its_leash_balances_the_wind() -> None:
    world = load_scene('drone_in_wind')
    world.step(15_000)
    # The slowest motion dies as exp(-1.5 t): 0.15 m * exp(-22) is 4e-11 m.
    assert world.position[0] == pytest.approx([5.67e-3 * 3 / 0.112, 0, 1], abs=1e-9)
    assert abs(world.orientation[0, 3]) == pytest.approx(1.0, abs=1e-9)


def test_the_double_pendulum_keeps_its_energy() -> None:
    world = load_scene('double_pendulum')
    start = world.kinetic_energy() + world.potential_energy()
    assert start == pytest.approx(24.6466, abs=5e-5)
    lowest = 0.0
    for _ in range(100):
        world.step(100)
        lowest = min(lowest, world.joint_position[1])
        assert abs(world.kinetic_energy() + world.potential_energy() - start) < 1e-2
    assert lowest < -2.0 * math.pi      # the lower rod goes round, and its turns are counted


def test_the_rocker_of_the_four_bar_turns_back_where_the_law_of_cosines_says() -> None:
    world = load_scene('four_bar')
    turns = []
    for _ in range(4300):       # two turns of the crank
        world.step()
        turns.append(84.1407 + math.degrees(world.joint_position[2]))
    # Near its ends the rocker stands still but for a step: they are missed by less than a
    # ten-thousandth of its angular acceleration, 30 rad/s^2, times the step squared.
    assert min(turns) == pytest.approx(36.8699, abs=1e-3)
    assert max(turns) == pytest.approx(101.5370, abs=1e-3)
    assert world.joint_velocity[0] == pytest.approx(3.0, abs=0.05)     # held by its drive


def test_the_arm_reaches_where_the_published_distances_say() -> None:
    world = load_scene('arm')
    # Denavit and Hartenberg's parameters (Craig's form) of the source: a, d, alpha.
    links = [(0, 0.333, 0), (0, 0, -90), (0, 0.316, 90), (0.0825, 0, 90), (-0.0825, 0.384, -90),
             (0, 0, 90), (0.088, 0, 90)]
    T = np.eye(4)
    for q, (a, d, alpha) in zip(world.joint_position, links, strict=True):
        c, s = math.cos(q), math.sin(q)
        ca, sa = math.cos(math.radians(alpha)), math.sin(math.radians(alpha))
        T = T @ np.array([[c, -s, 0, a], [s * ca, c * ca, -sa, -d * sa],
                          [s * sa, c * sa, ca, d * ca], [0, 0, 0, 1]])
    # Orientations are written with nine digits, and the arm is a metre long.
    assert world.position[world.names.index('arm/link7')] == pytest.approx(T[:3, 3], abs=1e-8)
    assert float(world.scene.model.m.sum()) == pytest.approx(16.08, abs=1e-9)
