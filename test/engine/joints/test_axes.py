# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drives, springs, dampers, friction and limits along the axes of joints."""

import math

from engine.jointed import body, energy, joint, panda, PANDA_START, rod, world
from engine.jointed_trees import gaps, random_tree
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_sim_ros import World

NO_GRAVITY = (0.0, 0.0, 0.0)
INERTIA = 0.1       # [kg m^2] of the wheel


def wheel(h=1e-3, gravity=NO_GRAVITY, **more):
    return world([body('wheel', 1.0, inertia=(INERTIA,) * 3 + (0,) * 3)],
                 [joint('axle', 'world', 'wheel', **more)], h, gravity)


def effort(size, **more):
    return {'drive': {'mode': 'effort', 'effort': size}, **more}


@pytest.mark.parametrize('h', [1e-3, 4e-3])
def test_a_constant_effort_gives_the_way_of_a_constant_acceleration(h):
    one = wheel(h, **effort(1.5))
    one.step(round(5.0 / h))
    assert one.joint_velocity[0] == pytest.approx(1.5 / INERTIA * 5.0, rel=1e-12)
    assert one.joint_position[0] == pytest.approx(0.5 * 1.5 / INERTIA * 25.0, rel=1e-12)
    assert one.joint_effort[0] == pytest.approx(1.5, rel=1e-12)


def test_a_motor_turns_its_armature_too():
    one = wheel(**effort(1.5, armature=0.2))
    one.step(1000)
    assert one.joint_velocity[0] == pytest.approx(1.5 / 0.3, rel=1e-12)
    assert one.kinetic_energy() == pytest.approx(0.5 * 0.3 * 25.0, rel=1e-12)


@pytest.mark.parametrize('h', [1e-3, 4e-3])
def test_below_its_limit_dry_friction_holds_without_creep(h):
    one = wheel(h, **effort(0.95, friction=1.0))
    one.step(round(5.0 / h))
    assert one.joint_position[0] == 0.0
    assert one.joint_velocity[0] == 0.0


@pytest.mark.parametrize('h', [1e-3, 4e-3])
def test_above_its_limit_dry_friction_takes_its_limit(h):
    one = wheel(h, **effort(1.5, friction=1.0))
    one.step(round(5.0 / h))
    assert one.joint_position[0] == pytest.approx(0.5 * 0.5 / INERTIA * 25.0, rel=1e-12)


@pytest.mark.parametrize('h', [1e-3, 4e-3])
def test_dry_friction_stops_a_wheel_and_keeps_it_there(h):
    one = wheel(h, friction=0.1, velocity=1.3)
    one.step(round(2.0 / h))
    # v^2 / (2 a); the step in which it stops is not of second order: a way of h v at the most,
    # with v the velocity that friction takes in a step.
    assert one.joint_position[0] == pytest.approx(1.3 ** 2 / 2.0, abs=2.0 * h * h)
    before = one.joint_position[0]
    one.step(1000)
    assert one.joint_position[0] == before
    assert one.joint_velocity[0] == 0.0


def test_a_joint_that_sticks_on_a_moving_parent_does_not_creep():
    # A double pendulum whose elbow sticks swings as one body.
    links = [body(f'link{i}', 1.0, (0, 0, -0.5), rod(1, 1, 0.02), (0, 0, -i)) for i in range(2)]
    swinging = world(links, [joint('shoulder', 'world', 'link0') | {'position': 1.0},
                             joint('elbow', 'link0', 'link1', position=(0, 0, -1), friction=1e3)])
    rigid = world(links, [joint('shoulder', 'world', 'link0') | {'position': 1.0},
                          joint('elbow', 'link0', 'link1', 'fixed', position=(0, 0, -1))])
    for _ in range(50):
        swinging.step(100)
        assert abs(swinging.joint_position[1]) < 1e-12
    rigid.step(5000)
    assert swinging.joint_position[0] == pytest.approx(rigid.joint_position[0], abs=1e-9)


@pytest.mark.parametrize('h', [1e-3, 4e-3])
def test_a_limit_is_not_passed_and_gives_nothing_back(h):
    bar = body('bar', 1.0, (0, 0, -0.5), rod(1, 1, 0.02))
    one = world([bar], [joint('pin', 'world', 'bar', **effort(
        -6.0, limits={'lower': -0.5, 'upper': 3.0})) | {'position': 1.0}], h)
    fastest, beyond, rebound = 0.0, 0.0, 0.0
    for _ in range(round(3.0 / h)):
        one.step()
        fastest = min(fastest, one.joint_velocity[0])
        beyond = max(beyond, -0.5 - one.joint_position[0])
        rebound = max(rebound, one.joint_velocity[0])
    assert fastest < -5.0
    assert beyond < 1e-12
    assert rebound == 0.0
    assert one.joint_position[0] == pytest.approx(-0.5, abs=1e-12)
    # It bears what the drive and the weight press on it, about y and on the child.
    wanted = 6.0 - 9.81 * 0.5 * math.sin(0.5)
    assert one.joint_wrench('pin')[4] == pytest.approx(-6.0 + wanted, rel=1e-9)


def test_a_joint_whose_limits_are_one_position_is_fixed_whatever_its_drive_does():
    load = {'mode': 'position', 'position': 5.0, 'stiffness': 1e5, 'damping': 10.0}
    limits = {'lower': 0.1, 'upper': 0.1, 'restitution': 0.5}
    one = world([body('wheel')], [joint('axle', 'world', 'wheel', limits=limits, drive=load,
                                        friction=1.0) | {'position': 0.1}])
    one.step(20)
    assert one.joint_position[0] == pytest.approx(0.1, abs=1e-12)
    assert one.joint_velocity[0] == 0.0
    assert one.joint_effort[0] == pytest.approx(1e5 * 4.9, rel=1e-12)


# It is met as the 500th step ends, or 0.3 of the way through it.
@pytest.mark.parametrize('upper', [1.0, 0.9986])
@pytest.mark.parametrize('restitution', [0.5, 1.0])
def test_a_limit_gives_back_what_its_restitution_says(upper, restitution):
    one = wheel(limits={'upper': upper, 'restitution': restitution}, velocity=2.0)
    one.step(700)
    # The time of a limit is known to 1e-9 of a way, SHARP.
    assert one.joint_velocity[0] == pytest.approx(-2.0 * restitution, rel=2e-9)


def test_a_joint_comes_to_rest_on_a_limit_that_bounces():
    bar = body('bar', 1.0, (0, 0, -0.5), rod(1, 1, 0.02))
    one = world([bar], [joint('pin', 'world', 'bar', limits={
        'lower': 0.5, 'restitution': 0.5}) | {'position': 1.0}])
    one.step(5000)
    assert one.joint_velocity[0] == 0.0
    assert one.joint_position[0] == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize('h', [1e-3, 2e-3])
def test_a_spring_swings_as_its_stiffness_has_it(h):
    one = wheel(h, spring={'stiffness': 40.0, 'rest': 0.3})
    w = math.sqrt(40.0 / INERTIA)
    before, off = energy(one), 0.0
    for _ in range(round(1.0 / h)):
        one.step()
        off = max(off, abs(energy(one) - before))
    # The trapezoidal rule is late by (w h)^2 / 12 of the phase.
    late = (w * h) ** 2 / 12 * w
    assert one.joint_position[0] == pytest.approx(0.3 - 0.3 * math.cos(w), abs=0.3 * 1.1 * late)
    # It keeps the energy of a linear spring exactly.
    assert off < 1e-10 * before


def test_a_spring_of_any_stiffness_is_stable():
    # w h = 316: a hundred and fifty times beyond what an explicit method bears.
    one = wheel(spring={'stiffness': 1e10}, velocity=1.0)
    for _ in range(1000):
        one.step()
        assert abs(one.joint_velocity[0]) < 1.0 + 1e-9


@pytest.mark.parametrize('h', [1e-3, 2e-3])
def test_a_damper_slows_down_as_its_rate_has_it(h):
    one = wheel(h, damping=0.5, velocity=1.0)
    one.step(round(0.5 / h))
    # The trapezoidal rule: (z^3 / 12) of the velocity in a step of z = h d / I.
    z = h * 0.5 / INERTIA
    assert one.joint_velocity[0] == pytest.approx(
        math.exp(-2.5), rel=1.1 * z ** 2 / 12 * 2.5)


def test_a_damper_of_any_size_stops_without_swinging_back():
    one = wheel(damping=1e6, velocity=1.0)
    for _ in range(10):
        one.step()
        assert -1e-9 < one.joint_velocity[0] < 0.5


def test_a_position_drive_comes_to_its_goal():
    one = wheel(drive={'mode': 'position', 'stiffness': 40.0, 'damping': 4.0, 'position': 0.7})
    one.step(5000)
    # Critically damped at 20 / s: e^-100.
    assert one.joint_position[0] == pytest.approx(0.7, abs=1e-12)


def test_a_drive_gives_no_more_than_its_effort():
    one = wheel(limits={'effort': 0.5}, drive={
        'mode': 'position', 'stiffness': 4000.0, 'damping': 40.0, 'position': 10.0})
    one.step(100)
    assert one.joint_velocity[0] == pytest.approx(0.5 / INERTIA * 0.1, rel=1e-9)
    assert one.joint_effort[0] == pytest.approx(0.5, rel=1e-9)


def test_a_drive_does_not_go_faster_than_its_velocity():
    one = wheel(limits={'velocity': 2.0, 'effort': 1.0}, drive={
        'mode': 'position', 'stiffness': 4000.0, 'damping': 40.0, 'position': 10.0})
    for _ in range(1000):
        one.step()
        assert one.joint_velocity[0] < 2.0 + 1e-9
    assert one.joint_velocity[0] == pytest.approx(2.0, rel=1e-9)


def test_a_velocity_drive_goes_at_its_velocity_against_a_load():
    # The weight of the bar needs up to 4.9 N m; a gain of 1e4 N m s/rad lets it err by 5e-4 rad/s.
    bar = body('bar', 1.0, (0, 0, -0.5), rod(1, 1, 0.02))
    one = world([bar], [joint('pin', 'world', 'bar', drive={
        'mode': 'velocity', 'gain': 1e4, 'velocity': 1.5})])
    one.step(100)
    for _ in range(4000):
        one.step()
        assert one.joint_velocity[0] == pytest.approx(1.5, abs=6e-4)


@pytest.mark.parametrize('gain', [1e2, 1e4, 1e6])
@pytest.mark.parametrize('drag', ['drive', 'damping'])
@pytest.mark.parametrize('h', [0.001, 1 / 60])
def test_a_load_drags_a_joint_at_the_rate_that_it_is_said_to_have(h, drag, gain):
    """A steady force F moves a damper d by F / d a second, whatever d and the step are."""
    given = {'damping': gain} if drag == 'damping' else {
        'drive': {'mode': 'velocity', 'gain': gain}}
    one = world([body('load', 3.0)], [joint(
        'slide', 'world', 'load', 'prismatic', axis=[0, 0, 1], **given)], h)
    rate = -3.0 * 9.81 / gain
    one.step(round(1.0 / h))
    before = one.joint_position[0]
    one.step(100)
    # e^-33 is left of the beginning with the weakest damper, and positions are rounded.
    assert one.joint_velocity[0] == pytest.approx(rate, rel=1e-9)
    assert one.joint_position[0] - before == pytest.approx(100 * h * rate, rel=1e-9, abs=1e-13)


def test_a_drive_between_free_bodies_changes_no_momentum():
    between = joint('between', 'a', 'b', position=(0.3, 0, 0), **effort(1.0, friction=0.2))
    one = world([body('a'), body('b', 2.0, position=(0.5, 0, 0))], [between], gravity=NO_GRAVITY)
    one.step(1000)
    assert one.kinetic_energy() > 1.0
    assert np.abs(one.total_momentum()).max() < 1e-11
    assert np.abs(one.total_angular_momentum()).max() < 1e-11


def test_light_links_stand_under_stiff_gains():
    # Links of 10 g and 1e-6 kg m^2, a damper of 2 N m s: h d / I = 2000. Explicit dampers fly
    # apart within some steps.
    links = [body(f'link{i}', 0.01, (0, 0, 0.02), (1e-6,) * 3 + (0,) * 3, (0, 0, 0.04 * i))
             for i in range(10)]
    one = world(links, [joint(
        f'joint{i}', f'link{i - 1}' if i else 'world', f'link{i}', position=(
            0, 0, 0.04 if i else 0), axis=(0, 1, 0) if i % 2 else (1, 0, 0),
        drive={'mode': 'position', 'stiffness': 100.0, 'damping': 2.0}) | {'position': 0.05}
        for i in range(10)])
    one.step(3000)
    assert np.abs(one.joint_velocity).max() < 1e-9
    # 0.1 kg at 0.2 m need 0.2 N m, which 100 N m/rad give at 2e-3 rad.
    assert np.abs(one.joint_position - 0.05).max() < 2e-3


def test_a_panda_holds_its_pose_under_position_drives():
    one = panda(drive={'mode': 'position', 'stiffness': 4000.0, 'damping': 400.0},
                limits={'effort': 87.0})
    one.step(3000)
    assert np.abs(one.joint_velocity).max() < 1e-9
    # 87 N m at the most, 4000 N m/rad.
    np.testing.assert_allclose(one.joint_position[:7], PANDA_START, atol=87.0 / 4000.0)


@pytest.mark.parametrize('seed', range(6))
def test_passive_joints_pass_no_limit_and_give_no_energy(seed):
    rng = np.random.default_rng(seed)
    spec = random_tree(rng, 8, types=('revolute', 'prismatic'))
    for one in spec['joints']:
        one['friction'], one['damping'] = rng.uniform(0, 2), 10 ** rng.uniform(-3, 2)
        one['limits'] = {'lower': one['position'] - rng.uniform(0.05, 0.5),
                         'upper': one['position'] + rng.uniform(0.05, 0.5)}
    tree = World.from_dict(spec)
    laws, axis_joint = tree.scene.joints.table.laws, tree.scene.joints.table.axis_joint
    before = energy(tree)
    for _ in range(400):
        tree.step()
        q = tree.joint_position[axis_joint]
        assert (laws.lower - q).max() < 1e-12
        assert (q - laws.upper).max() < 1e-12
        assert gaps(tree) < 1e-12
        # The energy that the method keeps is off by the order of h^2: far less than is lost.
        assert energy(tree) < before + 1e-6 * abs(before)
        before = energy(tree)
    assert tree.contact_report().message == ''


def test_a_drive_that_brakes_at_its_speed_does_the_work_that_it_says():
    """A slider on a rod that spins is thrown outwards; the drive holds it back."""
    two = world([body('rod', 2.0, inertia=(0.3, 0.3, 0.3, 0, 0, 0),
                      twist={'linear': [0.0, 0.0, 0.0], 'angular': [0.0, 0.0, 6.0]}),
                 body('slider', 0.5, inertia=(0.01,) * 3 + (0,) * 3, position=(0.2, 0.0, 0.0))],
                [joint('rail', 'rod', 'slider', 'prismatic', (0.2, 0.0, 0.0), (0.6, 0.8, 0.0),
                       limits={'velocity': 0.5},
                       drive={'mode': 'position', 'stiffness': 0.01})],
                gravity=NO_GRAVITY)
    two.step(200)       # until it goes so fast
    before, work = energy(two), 0.0
    for _ in range(400):
        at = two.joint_position[0]
        two.step()
        work += two.joint_effort[0] * (two.joint_position[0] - at)
    assert work < -0.01
    # Of second order in the turn h w = 0.006 of a step, and some of these along the way.
    assert energy(two) - before == pytest.approx(work, rel=5 * 0.006 ** 2)


def test_a_ball_joint_is_damped_alike_however_the_world_is_turned():
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    q = Rotation.from_matrix(turn)
    found = []
    for R in (Rotation.identity(), q):
        spins = {'linear': R.apply([0.0, 0.0, 0.0]).tolist(),
                 'angular': R.apply([3.0, -1.0, 4.0]).tolist()}
        two = world([body('a', 2.0, inertia=(0.01, 0.02, 0.025, 0, 0, 0),
                          orientation=R.as_quat().tolist()),
                     body('b', 0.1, inertia=(1e-4, 2e-4, 2.5e-4, 0, 0, 0), twist=spins,
                          position=R.apply([0.2, 0.1, 0.0]).tolist(),
                          orientation=R.as_quat().tolist())],
                    [joint('ball', 'a', 'b', 'spherical', (0.1, 0.1, 0.0), damping=2.0)],
                    gravity=NO_GRAVITY)
        two.step(20)
        found.append(R.inv().apply(two.angular_velocity))
    # Rounding, in directions that a step of h d / I = 10 divides by.
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-11)
