# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Light feet that land, fingers that close, and corners that come down."""

import math

from inside import arguments_of
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World

GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}


def world_of(bodies, joints, contact, step, **world):
    return World.from_dict({
        'world': {'contact': contact, 'step': step, **world},
        'materials': {'default': {'friction': 0.7, 'restitution': 0.0}},
        'bodies': bodies, 'joints': joints})


def box(name, mass, size, position, **more):
    return {'name': name, 'mass': mass, 'shape': {'type': 'box', 'size': size},
            'pose': {'position': position}, **more}


def landing_leg(mass, limit, pitch, speed, step):
    """Return a leg of 10 kg that falls along a rail, with a foot on which dry friction acts."""
    leg = box('leg', 10, [0.1, 0.1, 0.4], [0, 0, 0.5])
    foot = box('foot', mass, [0.22, 0.09, 0.05], [0.04, 0, 0.26])
    slide = {'name': 'slide', 'type': 'prismatic', 'parent': 'world', 'child': 'leg',
             'pose': {'position': [0, 0, 0.5]}, 'velocity': -speed}
    ankle = {'name': 'ankle', 'type': 'revolute', 'parent': 'leg', 'child': 'foot',
             'axis': [0, 1, 0], 'pose': {'position': [0, 0, -0.22]}, 'position': pitch,
             'limits': {'lower': -limit, 'upper': limit}, 'friction': 0.2}
    return world_of([GROUND, leg, foot], [slide, ankle], 'timestep', step)


@pytest.mark.parametrize('mass, limit, pitch, speed, step', [
    (0.2, 0.35, 0.0, 2.0, 1 / 60),      # the ankle goes from stuck to its limit in a step
    (0.2, 1.2, -0.2, 0.5, 1 / 60),      # its heel is stopped, and its toes were not near
    (0.2, 1.2, -0.3, 2.0, 1 / 240),     # little friction, and the leg is fifty times as heavy
    (0.8, 0.35, -0.3, 2.0, 1 / 60)])
def test_a_light_foot_lands_without_energy_and_does_not_sink_in(mass, limit, pitch, speed, step):
    """No step gives any to the 50 J and more that the leg has, and the floor stops the foot."""
    world = landing_leg(mass, limit, pitch, speed, step)
    energy, deepest = [], 0.0
    for _ in range(round(0.5 / step)):
        world.step(1)
        energy.append(world.kinetic_energy() + world.potential_energy())
        deepest = max(deepest, world.contact_report().deepest)
    # What overlaps, by 2e-4 m at most, is lifted by a fifth of it: 10 kg g 4e-5 m = 4 mJ.
    assert np.diff(energy).max() < 4e-3
    # Second order: 0.22 m (h w)^2 / 8, of the turn h w = 0.3 that brings the toes down, is 2 mm
    # before they are stopped; they are stopped where they come down, to a tenth of that.
    assert deepest < 2e-4
    assert np.abs(world.linear_velocity).max() < 1e-6


@pytest.mark.parametrize('opened', [0.0, 0.02, 0.025, 0.03])
@pytest.mark.parametrize('step', [1 / 60, 1 / 240])
def test_fingers_that_mimic_each_other_close_on_a_bar(opened, step):
    """A drive of 20 N closes light fingers by up to 55 mm a step; they end at the bar."""
    palm = box('palm', 1, [0.02, 0.2, 0.02], [0, 0, 0], fixed=True)
    fingers = [box(name, 0.05, [0.1, 0.01, 0.02], [0.1, y, 0])
               for name, y in (('left', 0.03), ('right', -0.03))]
    joint = {'type': 'prismatic', 'parent': 'palm', 'position': opened,
             'limits': {'lower': -0.04, 'upper': 0.03}}
    joints = [joint | {'name': 'left', 'child': 'left', 'axis': [0, 1, 0],
                       'pose': {'position': [0.05, 0.03, 0]},
                       'drive': {'mode': 'effort', 'effort': -20.0}},
              joint | {'name': 'right', 'child': 'right', 'axis': [0, -1, 0],
                       'pose': {'position': [0.05, -0.03, 0]}, 'mimic': {'joint': 'left'}}]
    bar = box('bar', 0.2, [0.04, 0.04, 0.12], [0.13, 0, 0])
    world = world_of([palm, *fingers, bar], joints, 'timestep', step, gravity=[0, 0, 0])
    world.step(round(1 / 3 / step))
    # Faces of the fingers are 25 mm from the middle, those of the bar 20 mm; points give way by
    # far less than a millionth of a step's way.
    assert world.joint_position == pytest.approx([-0.005, -0.005], abs=1e-7)
    assert np.abs(world.joint_velocity).max() < 1e-9


@pytest.mark.parametrize('contact', ['timestep', 'event'])
@pytest.mark.parametrize('seed', [0, 4, 32, 56])
def test_a_cube_that_tips_from_corner_to_corner_does_not_sink_in(seed, contact):
    """A corner that touches already says nothing of the next one, which comes down fast."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    cube = box('cube', 3, [0.2, 0.2, 0.2], [0, 0, 0.25], twist={
        'linear': [0.5, 0, -1], 'angular': (4 * rng.normal(size=3)).tolist()})
    cube['pose']['orientation'] = (q / math.sqrt(q @ q)).tolist()
    pendulum = {'name': 'pendulum', 'type': 'revolute', 'parent': 'world', 'child': 'weight',
                'axis': [0, 1, 0], 'pose': {'position': [5, 0, 2.5]}}
    world = world_of([GROUND, box('weight', 1, [0.1, 0.1, 0.1], [5, 0, 2]), cube], [pendulum],
                     contact, 1 / 240)
    deepest = 0.0
    for _ in range(120):
        world.step(1)
        deepest = max(deepest, world.contact_report().deepest)
    # A corner goes 6 mm in a step; it is to be found where it meets to second order in the way.
    assert deepest < 1e-4


def test_what_its_joints_press_on_another_robot_meets_it_once():
    """A quadruped falls on the trunk of another one, and both feel their drives from then on."""
    spec = load_scene('quadruped').scene.spec.model_dump(exclude_none=True)
    bodies, joints = list(spec['bodies']), list(spec['joints'])
    for body in spec['bodies'][1:]:
        x, y, z = body['pose']['position']
        bodies.append(body | {'name': f"upper_{body['name']}",
                              'pose': {'position': [x + 0.05, y + 0.02, z + 0.36]}})
    joints += [joint | {key: f'upper_{joint[key]}' for key in ('name', 'parent', 'child')}
               for joint in spec['joints']]
    world = World.from_dict(spec | {'world': {'step': 0.001, 'contact': 'event'},
                                    'bodies': bodies, 'joints': joints})
    events = 0
    for _ in range(500):
        world.step(1)
        events += int(arguments_of(world).now.events[0])
    # Most steps have none: what fell comes to rest within them, on some ten points.
    assert events < 2 * 500
