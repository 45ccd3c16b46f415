# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What bounces, and joints that meet their limits, at their own times within a step."""

import numpy as np
import pytest

from rigid_sim_ros import World

G = 9.81
MODELS = ['timestep', 'event']
STEPS = [1e-3, 1 / 240, 1 / 60]


def world_of(bodies, joints, contact, step, gravity=0.0, restitution=0.0):
    return World.from_dict({
        'world': {'contact': contact, 'step': step, 'gravity': [0, 0, -gravity]},
        'materials': {'default': {'restitution': restitution, 'friction': 0.5}},
        'bodies': bodies, 'joints': joints})


def cube(name, mass, position):
    return {'name': name, 'mass': mass, 'shape': {'type': 'box', 'size': [0.1, 0.1, 0.1]},
            'pose': {'position': position}}


def slider(child, axis, **rest):
    return {'name': f'slide_{child}', 'type': 'prismatic', 'parent': 'world', 'child': child,
            'axis': axis} | rest


@pytest.mark.parametrize('contact', MODELS)
@pytest.mark.parametrize('step', STEPS)
@pytest.mark.parametrize('gain', [10.0, 1e4, 1e6])
def test_a_drive_of_finite_gain_gives_nothing_to_what_bounces_off(gain, step, contact):
    """
    A ball of m that a slider of M hits leaves with (1 + e) v M / (M + m).

    The drive would need the time M / gain to answer, and in the limit of small steps it has none;
    the slider, slower than the ball, meets it once. What the drive of 10 N s/m gives it before
    that is 0, as it has the velocity that the drive wants.
    """
    ball = {'name': 'ball', 'mass': 0.5, 'shape': {'type': 'sphere', 'radius': 0.05},
            'pose': {'position': [0.1123, 0.0, 0.0]}}
    drive = {'mode': 'velocity', 'gain': gain, 'velocity': 1.0}
    world = world_of([cube('pusher', 1.0, [0, 0, 0]), ball],
                     [slider('pusher', [1, 0, 0], velocity=1.0, drive=drive)], contact, step,
                     restitution=0.8)
    world.step(round(0.1 / step))
    # The gap within which shapes touch, 1e-7 of their size, and rounding.
    assert world.linear_velocity[1, 0] == pytest.approx(1.8 / 1.5, rel=1e-6)


@pytest.mark.parametrize('contact', MODELS)
@pytest.mark.parametrize('step', STEPS)
def test_a_leg_that_jumps_pushes_until_it_is_stretched(step, contact):
    """
    A body of M is lifted by F through s, and takes a foot of m along as the leg is stretched.

    M v = (M + m) V with v^2 = 2 (F / M - g) s, and from then on both fly.
    """
    M, m, F, s = 4.0, 1.0, 200.0, 0.2
    floor = {'name': 'floor', 'fixed': True, 'shape': {'type': 'plane'}}
    leg = slider('body', [0, 0, 1], parent='foot', pose={'position': [0, 0, 0.35]},
                 limits={'lower': 0.0, 'upper': s}, drive={'mode': 'effort', 'effort': F})
    world = world_of([floor, cube('foot', m, [0, 0, 0.05]), cube('body', M, [0, 0, 0.4])],
                     [slider('foot', [0, 0, 1]), leg], contact, step, gravity=G)
    v, until = np.sqrt(2 * (F / M - G) * s), np.sqrt(2 * s / (F / M - G))
    steps = int(until / step) + 2
    world.step(steps)
    P = m * world.linear_velocity[1, 2] + M * world.linear_velocity[2, 2]
    # The shortest way is 1/1024 of a step, in which F is lost at most.
    assert abs(P - (M * v - (M + m) * G * (steps * step - until))) < F * step / 500


@pytest.mark.parametrize('others', [False, True])
@pytest.mark.parametrize('contact', MODELS)
@pytest.mark.parametrize('stroke', [0.2, 0.2123])
@pytest.mark.parametrize('restitution', [0.0, 0.5, 1.0])
def test_what_is_driven_to_its_limit_comes_back_as_fast_as_it_came(restitution, stroke, contact,
                                                                   others):
    """
    A slider of 1 kg under F meets its limit with v^2 = 2 F s, within a step or as one ends.

    Also where nothing can touch: that is a step of its own.
    """
    F, step = 40.0, 1 / 60
    bodies = [cube('a', 1.0, [0, 0, 0])] + ([cube('far', 1.0, [9, 0, 0])] if others else [])
    world = world_of(bodies, [slider(
        'a', [1, 0, 0], drive={'mode': 'effort', 'effort': F},
        limits={'lower': -1.0, 'upper': stroke, 'restitution': restitution})], contact, step)
    v, until = np.sqrt(2 * F * stroke), np.sqrt(2 * stroke / F)
    steps = int(until / step) + 2
    world.step(steps)
    wanted = F * (steps * step - until) - restitution * v if restitution > 0 else 0.0
    assert abs(world.joint_velocity[0] - wanted) < F * step / 500   # as above
