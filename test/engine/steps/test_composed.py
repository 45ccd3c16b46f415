# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The method `symplectic4` of bodies that joints hold: order 4, and where it is not."""

from itertools import pairwise
import math

from engine.jointed import (
    body, double_pendulum_tips, energy, four_bar, hanging, joint, point_of, rod)
from engine.jointed_trees import gaps
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.scene import scene_from_text


def composed(world):
    return World(scene_from_text(world.scene.text.replace(
        '"integrator": "symplectic"', '"integrator": "symplectic4"')))


def two_links(h, integrator='symplectic4', second=None, bodies=(), parent='world', forces=(),
              **laws):
    """Return an arm in space: a second axis that is not parallel to the first one."""
    joints = [joint('first', parent, 'upper', position=(0, 0, 0), **laws) | {'position': 1.0},
              joint('second', 'upper', 'lower', position=(0, 0, -1.0),
                    **({'axis': (1.0, 0.0, 0.0)} | (second or {})), **laws)]
    if joints[1]['type'] == 'spherical':
        del joints[1]['axis']
    return World.from_dict({
        'world': {'contact': 'none', 'step': h, 'integrator': integrator},
        'bodies': [body('upper', 1.0, (0, 0, -0.5), rod(1.0, 1.0, 0.05)),
                   body('lower', 0.7, (0, 0.1, -0.4), rod(0.7, 0.8, 0.05), (0, 0, -1.0)),
                   *bodies], 'joints': joints, 'forces': list(forces)})


def place(world):
    return np.r_[world.position.ravel(), world.orientation.ravel()]


def order(make, h, end):
    """Return p of the differences c h^p between runs with h, h / 2 and h / 4."""
    places = []
    for step in (h, h / 2, h / 4):
        world = make(step)
        world.step(round(end / step))
        places.append(place(world))
    coarse, fine = (np.abs(a - b).max() for a, b in pairwise(places))
    return math.log2(coarse / fine)


def test_half_the_step_divides_the_error_of_a_double_pendulum_by_sixteen():
    times = np.array([0.0, 0.4])
    tip, errors = double_pendulum_tips(times)[-1], []
    for h in (4e-3, 2e-3):
        world = composed(hanging(2, h=h))
        world.step(round(0.4 / h))
        errors.append(np.linalg.norm(point_of(world, 'link1', (0, 0, -1.0)) - tip))
    # A symmetric method: c h^4 + d h^6, the second term a hundredth of the first at 4 ms. The
    # truth and the joints, each to 1e-13 m, are a thousandth of the smaller error.
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.1)


ARMATURE = {'armature': 0.1, 'damping': 0.5}
DRIVE = {'drive': {'mode': 'position', 'stiffness': 50.0, 'damping': 2.0, 'position': 0.5}}
BASE = {'name': 'base', 'kinematic': True,
        'twist': {'linear': [0.3, 0.0, 0.0], 'angular': [0.0, 0.5, 1.0]}}
TIE = {'type': 'spring', 'a': 'lower', 'b': 'world', 'anchor': [0, 0, 1], 'stiffness': 20.0}
SMOOTH = {
    'free': {},
    'armatures and dampers': ARMATURE,
    'springs': {'spring': {'stiffness': 20.0, 'rest': 0.2}},
    'drives that hold': DRIVE,
    'a ball joint': {'second': {'kind': 'spherical'}},
    'a slide on a spring': {'second': {'kind': 'prismatic'}, 'spring': {'stiffness': 200.0}},
    'a base that moves': {'bodies': [BASE], 'parent': 'base'},
    'a spring to the world': {'forces': [TIE]},
}


@pytest.mark.parametrize('laws', SMOOTH.values(), ids=SMOOTH)
def test_what_is_smooth_is_followed_to_fourth_order(laws):
    # Terms of sixth order move p by some hundredths, and so do the 1e-13 m to which joints close
    # where the smaller difference is 1.5e-12 m.
    assert order(lambda h: two_links(h, **laws), 5e-3, 0.5) == pytest.approx(4.0, abs=0.1)


def test_a_loop_is_followed_to_fourth_order():
    assert order(lambda h: composed(four_bar(h)), 5e-3, 0.5) == pytest.approx(4.0, abs=0.15)


def test_a_drag_of_the_scene_is_followed_to_third_order():
    wind = {'type': 'wind', 'velocity': [1.0, 0.0, 0.0], 'drag': 0.5}
    assert order(lambda h: two_links(h, forces=[wind]), 5e-3, 0.25) == pytest.approx(3.0, abs=0.2)


def test_joints_stay_closed_and_energy_stays():
    world = composed(hanging(3, h=4e-3))
    before, apart, off = energy(world), 0.0, 0.0
    for _ in range(500):
        world.step()
        apart = max(apart, float(np.abs(gaps(world)).max()))
        off = max(off, abs(energy(world) - before))
    assert apart < 1e-12
    # 3 kg that fall through some 2 m: 60 J. The method of second order is off by 5e-3 of them.
    assert off < 1e-5 * 60.0


def bar(integrator, restitution=0.0):
    """Return a bar that falls on the lower limit of its joint."""
    return World.from_dict({
        'world': {'contact': 'none', 'step': 2e-3, 'integrator': integrator},
        'bodies': [body('bar', 1.0, (0, 0, -0.5), rod(1.0, 1.0, 0.02))],
        'joints': [joint('pin', 'world', 'bar', limits={
            'lower': 0.5, 'restitution': restitution}) | {'position': 1.5}]})


def test_a_limit_stops_a_joint_at_once():
    world, beyond = bar('symplectic4'), 0.0
    for _ in range(500):
        world.step()
        beyond = max(beyond, 0.5 - float(world.joint_position[0]))
    assert beyond < 1e-9
    assert abs(world.joint_velocity[0]) < 1e-9


def test_a_limit_sends_a_joint_back_with_its_share_of_the_energy():
    world, speeds = bar('symplectic4', 0.5), []
    for _ in range(500):
        world.step()
        speeds.append(float(world.joint_velocity[0]))
    # From rest at 1.5 rad to 0.5 rad: w^2 = 2 m g l (cos 0.5 - cos 1.5) / I, with 0.5 m of lever
    # and the inertia of a rod about its end. It is seen at the end of that step, until when the
    # weight takes up to h m g l / I of it, times the sine of where it then is.
    inertia = rod(1.0, 1.0, 0.02)[0] + 0.25
    speed = math.sqrt(2.0 * 9.81 * 0.5 * (math.cos(0.5) - math.cos(1.5)) / inertia)
    slower = 2e-3 * 9.81 * 0.5 * math.sin(0.5 + 2e-3 * 0.5 * speed) / inertia
    assert 0.5 * speed - slower < max(speeds) <= 0.5 * speed


def test_with_dry_friction_all_steps_are_those_of_second_order():
    one, other = (two_links(2e-3, integrator, friction=0.1)
                  for integrator in ('symplectic', 'symplectic4'))
    one.step(100)
    other.step(100)
    assert np.array_equal(place(one), place(other))


def test_a_damper_too_fast_to_be_followed_back_in_time_takes_steps_of_second_order():
    # Back by a part p of a step a damper with z = h d / I makes a rate (1 + p z / 2) / (1 - p z /
    # 2) times as large: that is infinite for z = 2 / p.
    h, inertia, p = 4e-3, 0.1, 4.0 / (4.0 - 4.0 ** (1.0 / 3.0)) - 1.0
    world = World.from_dict({
        'world': {'contact': 'none', 'step': h, 'integrator': 'symplectic4'},
        'bodies': [body('wheel', inertia=(inertia,) * 3 + (0.0,) * 3)],
        'joints': [joint('axle', 'world', 'wheel', damping=2.0 / p * inertia / h) | {
            'velocity': 1.0}]})
    world.step()
    # Such a damper stops the wheel in the first half of the step.
    assert abs(world.joint_velocity[0]) < 1e-12


def test_a_saved_world_goes_on_to_the_bit():
    world = two_links(4e-3, **DRIVE)
    world.step(7)
    saved = world.save()
    world.step(50)
    after = world.state_hash()
    other = two_links(4e-3, **DRIVE)
    other.restore(saved)
    other.step(50)
    assert other.state_hash() == after


def test_a_motor_that_has_turned_a_million_times_is_followed_as_exactly():
    def way(turns):
        world = two_links(2e-3, armature=0.1, damping=0.5)
        world.set_joint_state('first', 1.0 + 2.0 * math.pi * turns, 0.0)
        world.step(50)
        assert world.contact_report().message == ''
        return world.position

    # 2 pi 1e6 rad are known to 1e-9 rad.
    assert np.allclose(way(1_000_000), way(0), rtol=0.0, atol=1e-8)


def test_a_joint_may_come_and_go():
    world = two_links(2e-3)
    world.step(10)
    world.add({'name': 'hold', 'type': 'fixed', 'parent': 'upper', 'child': 'lower'})
    world.step(10)
    assert np.abs(gaps(world)).max() < 1e-12
    world.remove('hold')
    world.step(10)
    assert np.isfinite(place(world)).all()
