# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each force of a scene against its formula."""

import math

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.dynamics.forces import FORCES, WIDTH

STEP = 1e-4


def ball(name='a', position=(0, 0, 0), linear=(0, 0, 0), angular=(0, 0, 0), **keys):
    return {'name': name, 'shape': {'type': 'sphere', 'radius': 0.5}, 'mass': 2.0,
            'pose': {'position': list(position)},
            'twist': {'linear': list(linear), 'angular': list(angular)}, **keys}


def make(forces, bodies, gravity=(0, 0, 0), integrator='rk4') -> World:
    return World.from_dict({
        'format': 1, 'world': {'gravity': list(gravity), 'step': STEP, 'contact': 'none',
                               'integrator': integrator},
        'bodies': bodies, 'forces': forces})


def loads(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque on each body now, from the momenta of a step of explicit Euler."""
    P, L = world.linear_momentum, world.angular_momentum
    world.step(1)
    return (world.linear_momentum - P) / STEP, (world.angular_momentum - L) / STEP


def test_wind_drags_linearly_and_quadratically():
    wind = {'type': 'wind', 'velocity': [3.0, 0, 0], 'drag': 0.5, 'quadratic_drag': 0.25}
    F, _ = loads(make([wind], [ball(linear=(0.0, 4.0, 0.0))], integrator='euler'))
    # u = (-3, 4, 0), |u| = 5: F = -(0.5 + 0.25 * 5) u. P / STEP resolves 8 * 1e-16 / 1e-4 N.
    assert np.allclose(F[0], [5.25, -7.0, 0.0], atol=1e-10)


def test_wind_damps_the_rotation():
    wind = {'type': 'wind', 'angular_drag': 0.5, 'quadratic_angular_drag': 0.1}
    _, tau = loads(make([wind], [ball(angular=(0.0, 0.0, 2.0))], integrator='euler'))
    assert np.allclose(tau[0], [0.0, 0.0, -(0.5 + 0.2) * 2.0], atol=1e-10)


def test_wind_blows_on_the_chosen_bodies_only():
    wind = {'type': 'wind', 'velocity': [1.0, 0, 0], 'drag': 1.0, 'bodies': ['b*']}
    F, _ = loads(make([wind], [ball('a'), ball('b1'), ball('b2')], integrator='euler'))
    assert np.allclose(F[:, 0], [0.0, 1.0, 1.0], atol=1e-12)


def test_linear_drag_reaches_the_speed_of_the_wind_exponentially():
    world = make([{'type': 'wind', 'velocity': [3.0, 0, 0], 'drag': 4.0}], [ball()])
    world.step(10_000)
    # v = 3 (1 - exp(-c t / m)); rk4 errs by (c h / m)^4 / 120.
    assert world.linear_velocity[0, 0] == pytest.approx(3.0 * (1 - math.exp(-2.0)), rel=1e-10)


def test_terminal_velocity_under_quadratic_drag():
    world = make([{'type': 'wind', 'quadratic_drag': 0.5}], [ball()], gravity=(0, 0, -9.81))
    world.step(20_000)
    t, v_end = 2.0, math.sqrt(2.0 * 9.81 / 0.5)
    expected = -v_end * math.tanh(9.81 * t / v_end)
    assert world.linear_velocity[0, 2] == pytest.approx(expected, rel=1e-10)


def test_a_spring_pulls_at_named_frames_with_their_levers():
    bodies = [ball('a', frames={'handle': {'position': [0.5, 0, 0]}}), ball('b', (0.5, 3.0, 0.0))]
    spring = {'type': 'spring', 'a': 'a/handle', 'b': 'b', 'stiffness': 10.0, 'rest_length': 1.0}
    F, tau = loads(make([spring], bodies, integrator='euler'))
    # 3 m between (0.5, 0, 0) and (0.5, 3, 0): tension 10 * 2 N along y; lever 0.5 m on a.
    assert np.allclose(F, [[0, 20, 0], [0, -20, 0]], atol=1e-9)
    assert np.allclose(tau, [[0, 0, 10], [0, 0, 0]], atol=1e-9)


def test_a_spring_damps_only_along_its_line():
    spring = {'type': 'spring', 'a': 'a', 'b': 'world', 'anchor': [0, 0, 2], 'stiffness': 0.0,
              'damping': 3.0}
    F, _ = loads(make([spring], [ball(linear=(5.0, 0.0, 1.0))], integrator='euler'))
    assert np.allclose(F[0], [0.0, 0.0, -3.0], atol=1e-9)


def test_a_spring_damps_the_velocity_that_turning_gives_its_end():
    handle = {'handle': {'position': [0.5, 0, 0]}}
    spring = {'type': 'spring', 'a': 'a/handle', 'b': 'world', 'anchor': [0.5, 2.0, 0.0],
              'stiffness': 0.0, 'damping': 3.0}
    F, tau = loads(make([spring], [ball(angular=(0.0, 0.0, 4.0), frames=handle)],
                        integrator='euler'))
    # w x r = (0, 2, 0) m/s, towards the anchor: F = -3 * 2 N along y, with a lever of 0.5 m.
    assert np.allclose(F[0], [0.0, -6.0, 0.0], atol=1e-9)
    assert np.allclose(tau[0], [0.0, 0.0, -3.0], atol=1e-9)


def test_a_spring_of_no_length_exerts_nothing():
    spring = {'type': 'spring', 'a': 'a', 'b': 'world', 'stiffness': 7.0, 'rest_length': 1.0}
    F, _ = loads(make([spring], [ball()], integrator='euler'))
    assert not F.any()


def test_avoidance_grows_inside_its_range_and_ends_there():
    avoidance = {'type': 'avoidance', 'bodies': ['*'], 'range': 2.0, 'stiffness': 8.0}
    bodies = [ball('a'), ball('b', (1.5, 0, 0)), ball('c', (0, 2.5, 0))]
    F, _ = loads(make([avoidance], bodies, integrator='euler'))
    # a and b: 8 * (2 - 1.5) N apart; c is 2.5 m from a and 2.9 m from b: out of range.
    assert np.allclose(F, [[-4, 0, 0], [4, 0, 0], [0, 0, 0]], atol=1e-9)


def test_avoidance_turns_two_bodies_round_without_loss():
    avoidance = {'type': 'avoidance', 'bodies': ['a', 'b'], 'range': 2.0, 'stiffness': 100.0}
    world = make([avoidance], [ball('a', linear=(1.0, 0, 0)), ball('b', (3.0, 0, 0))])
    world.step(40_000)
    # Equal masses in a central collision exchange their velocities. The force sets in with a kink,
    # which a step of rk4 that straddles it sees to second order: k h^2 v / m = 5e-7.
    assert np.allclose(world.linear_velocity[:, 0], [0.0, 1.0], atol=1e-6)


def test_hold_point_resists_in_every_direction():
    hold = {'type': 'hold_point', 'a': 'a', 'b': 'world', 'anchor': [1, 0, 0], 'stiffness': 10.0,
            'damping': 2.0}
    F, _ = loads(make([hold], [ball(linear=(0.0, 3.0, 0.0))], integrator='euler'))
    assert np.allclose(F[0], [10.0, -6.0, 0.0], atol=1e-9)


def test_hold_orientation_turns_back_the_shorter_way():
    angle = 2.5
    q = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
    hold = {'type': 'hold_orientation', 'a': 'a', 'b': 'world', 'stiffness': 4.0, 'damping': 0.5}
    body = ball(angular=(0, 0, 3.0))
    body['pose']['orientation'] = q
    _, tau = loads(make([hold], [body], integrator='euler'))
    assert np.allclose(tau[0], [0.0, 0.0, -4.0 * angle - 0.5 * 3.0], atol=1e-9)


def test_hold_orientation_oscillates_at_its_frequency():
    body = ball()
    body['pose']['orientation'] = [math.sin(0.25), 0.0, 0.0, math.cos(0.25)]
    hold = {'type': 'hold_orientation', 'a': 'a', 'b': 'world', 'stiffness': 5.0}
    world = make([hold], [body])
    world.step(10_000)
    moment = 0.4 * 2.0 * 0.25
    angle = 2.0 * math.atan2(world.orientation[0, 0], world.orientation[0, 3])
    assert angle == pytest.approx(0.5 * math.cos(math.sqrt(5.0 / moment)), abs=1e-9)


PAIRS = [
    {'type': 'spring', 'a': 'a/tip', 'b': 'b/tip', 'anchor': [0.1, 0.2, 0.3], 'stiffness': 30.0,
     'damping': 2.0, 'rest_length': 0.7},
    {'type': 'avoidance', 'bodies': ['a', 'b'], 'range': 5.0, 'stiffness': 9.0},
    {'type': 'hold_point', 'a': 'a/tip', 'b': 'b', 'stiffness': 30.0, 'damping': 2.0},
    {'type': 'hold_orientation', 'a': 'a', 'b': 'b/tip', 'stiffness': 3.0, 'damping': 1.0},
]


@pytest.mark.parametrize('force', PAIRS, ids=lambda force: force['type'])
def test_forces_between_two_bodies_change_no_total_momentum(force):
    tip = {'tip': {'position': [0.3, -0.2, 0.4], 'orientation': [0.5, 0.5, 0.5, 0.5]}}
    world = make([force], [ball('a', (0, 0, 0), (1, 2, 3), (3, 1, 2), frames=tip),
                           ball('b', (1, 2, 1), (-1, 0, 1), (0, 1, -1), frames=tip)])
    P, L = world.total_momentum(), world.total_angular_momentum()
    world.step(1000)
    # Forces of up to 100 N for 0.1 s on momenta of order 10: rounding 1e-15 a step in P. In L the
    # stages of rk4 cancel only to its order: h^5 a step.
    assert np.allclose(world.total_momentum(), P, atol=1e-12)
    assert np.allclose(world.total_angular_momentum(), L, atol=1e-9)


CONSERVATIVE = [{**force, 'damping': 0.0} if 'damping' in force else force for force in PAIRS]


@pytest.mark.parametrize('force', CONSERVATIVE, ids=lambda force: force['type'])
def test_potential_energy_is_what_kinetic_energy_loses(force):
    tip = {'tip': {'position': [0.3, -0.2, 0.4]}}
    world = make([force], [ball('a', (0, 0, 0), (1, 2, 3), (3, 1, 2), frames=tip),
                           ball('b', (1, 2, 1), (-1, 0, 1), (0, 1, -1), frames=tip)],
                 gravity=(1.0, -2.0, 3.0))
    energy = world.kinetic_energy() + world.potential_energy()
    start = world.kinetic_energy()
    world.step(5000)
    assert abs(world.kinetic_energy() - start) > 0.1  # something was exchanged
    # rk4 over 0.5 s at angular rates below 10 /s: (10 h)^4 = 1e-12 of energies of order 100 J.
    assert world.kinetic_energy() + world.potential_energy() == pytest.approx(energy, abs=1e-8)


def test_every_force_fits_its_row():
    for name, force in FORCES.items():
        assert sum(parameter.size for parameter in force.parameters) <= WIDTH, name
        assert force.ends in ('each', 'pairs', 'ab'), name
