# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mass matrices, Jacobians and inverse dynamics, against formulas and against the engine."""

import math

from engine.jointed import body, joint
import numpy as np
import pytest

from rigid_sim_ros import World

G = 9.81


def arm(velocity=(0.0, 0.0), **more) -> World:
    """Return two rods of 1 m and 1 kg about y, at 0.4 and -0.7 rad."""
    rods = [body(f'm/{name}', 1.0, (0, 0, -0.5), (1 / 12, 1 / 12, 1e-4, 0, 0, 0), (0, 0, -i))
            for i, name in enumerate('ab')]
    joints = [joint('m/first', 'world', 'm/a', position_=0.4, velocity=velocity[0]),
              joint('m/second', 'm/a', 'm/b', position=(0, 0, -1), position_=-0.7,
                    velocity=velocity[1], armature=0.02)]
    for one in joints:
        one['position'] = one.pop('position_')
    rods[1]['frames'] = {'m/tip': {'position': [0, 0, -1]}}
    return World.from_dict({'world': {'contact': 'none', **more}, 'bodies': rods,
                            'joints': joints})


def test_the_mass_matrix_of_a_double_pendulum() -> None:
    M = arm().mass_matrix('m')
    # Rods of length 1 and mass 1, b at the angle -0.7 to a: I + m c^2 = 1/3 each.
    both = 0.5 * math.cos(0.7)
    expected = [[1 / 3 + 1 + 1 / 3 + 2 * both, 1 / 3 + both], [1 / 3 + both, 1 / 3 + 0.02]]
    np.testing.assert_allclose(M, expected, rtol=1e-14)


def test_the_jacobian_gives_the_velocity_of_the_tip() -> None:
    world = arm((0.3, -1.1))
    J = world.jacobian('m', 'm/tip')
    # Both angles turn -z to -x.
    a, b = 0.4, 0.4 - 0.7
    np.testing.assert_allclose(J[:3, 1], [-math.cos(b), 0, math.sin(b)], atol=1e-15)
    np.testing.assert_allclose(J[:3, 0], J[:3, 1] + [-math.cos(a), 0, math.sin(a)], atol=1e-15)
    np.testing.assert_allclose(J[3:], [[0, 0], [1, 1], [0, 0]], atol=1e-15)
    np.testing.assert_allclose(J[3:] @ [0.3, -1.1], world.angular_velocity[1], atol=1e-14)


def test_a_frame_has_a_pose() -> None:
    p, q = arm().frame_pose('m/tip')
    np.testing.assert_allclose(p, [-math.sin(0.4) + math.sin(0.3), 0,
                                   -math.cos(0.4) - math.cos(0.3)], atol=1e-15)
    np.testing.assert_allclose(q, [0, math.sin(-0.15), 0, math.cos(-0.15)], atol=1e-15)


def test_holding_still_takes_the_moments_of_the_weights() -> None:
    # m g c sin(angle), about +y back to the vertical.
    b = 0.5 * G * math.sin(-0.3)
    a = 0.5 * G * math.sin(0.4) + G * math.sin(0.4) + b
    np.testing.assert_allclose(arm().inverse_dynamics('m', np.zeros(2)), [a, b], rtol=1e-13)


def chain(free: bool) -> World:
    """Return a base, fixed or free, with a ball joint, a slide and a hinge behind each other."""
    solids = [body(f'm/{name}', 1.0 + i, (0.1, 0.02 * i, -0.05), (0.03, 0.04, 0.05, 0.002, 0, 0),
                   (0.3 * i, 0, 0), twist={'linear': [0.1, 0.2, 0], 'angular': [0.3, 0.1, 0.2]}
                   if free and i == 0 else {}, fixed=not free and i == 0)
              for i, name in enumerate('abcd')]
    joints = [joint('m/ball', 'm/a', 'm/b', 'spherical', (0.2, 0, 0)),
              joint('m/slide', 'm/b', 'm/c', 'prismatic', (0.1, 0, 0), (1, 1, 0), velocity=0.4),
              joint('m/hinge', 'm/c', 'm/d', 'revolute', (0.1, 0.1, 0), (0, 1, 2), velocity=-0.7)]
    return World.from_dict({'world': {'contact': 'none', 'step': 1e-5}, 'bodies': solids,
                            'joints': joints})


def rates(world: World, free: bool) -> np.ndarray:
    """Return the velocities of the chain along its coordinates."""
    w, v = world.angular_velocity, world.linear_velocity
    base = [*v[0], *w[0]] if free else []
    R = np.array([world.jacobian('m', 'm/b')[3:, len(base):len(base) + 3][:, k]
                  for k in range(3)])
    return np.array([*base, *(R @ (w[1] - w[0])), *world.joint_velocity[1:]])


@pytest.mark.parametrize('free', [False, True])
def test_half_the_mass_matrix_is_the_kinetic_energy(free: bool) -> None:
    world = chain(free)
    world.step(100)
    v = rates(world, free)
    assert len(v) == 5 + 6 * free
    assert 0.5 * v @ world.mass_matrix('m') @ v == pytest.approx(world.kinetic_energy(), rel=1e-12)
    # And the Jacobian of each body gives its twist.
    for i, name in enumerate(world.names):
        twist = world.jacobian('m', name) @ v
        np.testing.assert_allclose(twist[:3], world.linear_velocity[i], atol=1e-12)
        np.testing.assert_allclose(twist[3:], world.angular_velocity[i], atol=1e-12)


@pytest.mark.parametrize('free', [False, True])
def test_what_moves_freely_needs_no_force(free: bool) -> None:
    world = chain(free)
    world.step(1000)
    h, before = 1e-5, rates(world, free)
    world.step()
    tree = world.save()
    world.step()
    acceleration = (rates(world, free) - before) / (2 * h)
    world.restore(tree)
    forces = world.inverse_dynamics('m', acceleration)
    # Central differences: h^2 / 6 of a third derivative of some 10 to 1000, and rounding
    # 1e-15 / h; forces are some 10 N.
    np.testing.assert_allclose(forces, 0.0, atol=1e-6)
    assert abs(world.mass_matrix('m') @ acceleration).max() > 1.0


def test_mistakes_are_named() -> None:
    world = arm()
    with pytest.raises(ValueError, match="model 'n' does not exist, must be one of: m"):
        world.mass_matrix('n')
    with pytest.raises(ValueError, match="frame 'm/tap' does not exist"):
        world.jacobian('m', 'm/tap')
    with pytest.raises(ValueError, match=r'acceleration has the shape \(3,\), must be \(2,\)'):
        world.inverse_dynamics('m', np.zeros(3))
