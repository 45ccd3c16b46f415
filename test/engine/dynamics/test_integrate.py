# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrators against solutions in closed form, and against their orders."""

from effort import examples
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros import World

INTEGRATORS = ('euler', 'semi_implicit', 'rk4', 'symplectic', 'symplectic4')
ORIENTATIONS = ('quaternion', 'matrix', 'axis_angle')


def body(**keys):
    return {'name': 'body', 'shape': {'type': 'box', 'size': [0.3, 0.2, 0.1]}, 'mass': 2.0, **keys}


def make(integrator='symplectic', *, step=1e-3, gravity=(0, 0, 0), forces=(), bodies=None,
         orientation='quaternion') -> World:
    return World.from_dict({
        'format': 1,
        'world': {'integrator': integrator, 'orientation': orientation, 'step': step,
                  'gravity': list(gravity), 'contact': 'none'},
        'bodies': bodies or [body()], 'forces': list(forces)})


@examples(30)
@given(st.floats(1e-4, 0.5), st.integers(1, 50), st.tuples(*[st.floats(-20.0, 20.0)] * 3))
def test_flight_under_gravity_is_exact_at_any_step(step, count, gravity):
    v, x = np.array([3.0, -1.0, 8.0]), np.array([0.5, 1.0, 2.0])
    world = make(step=step, gravity=gravity, bodies=[body(
        pose={'position': x.tolist()}, twist={'linear': v.tolist(), 'angular': [1, 2, 3]})])
    world.step(count)
    g, t = np.array(gravity), count * step
    # Each of at most 50 steps rounds sums of numbers up to |x| + |v| t + |g| t^2.
    rounding = 50 * 4e-16 * (4.0 + 9.0 * t + 35.0 * t * t)
    assert np.allclose(world.position[0], x + v * t + g * t * t / 2, rtol=0.0, atol=rounding)
    assert np.allclose(world.linear_velocity[0], v + g * t, rtol=0.0, atol=rounding + 1e-13)


@examples(20)
@given(st.floats(1e-3, 0.5), st.integers(1, 50))
def test_flight_under_a_constant_wrench_is_exact_at_any_step(step, count):
    world = make(step=step)
    world.apply_wrench('body', force=(1.0, 2.0, -3.0), duration=1e3)
    world.step(count)
    t = count * step
    expected = np.array([1.0, 2.0, -3.0]) / 2.0 * t * t / 2
    assert np.allclose(world.position[0], expected, rtol=50 * 4e-16, atol=1e-300)


@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_momentum_under_gravity_is_exact_for_every_integrator(integrator):
    world = make(integrator, gravity=(0, 0, -9.81))
    world.step(1000)
    assert world.linear_momentum[0, 2] == pytest.approx(-9.81 * 2.0, rel=1e-12)


SPRING = {'type': 'spring', 'a': 'body', 'b': 'world', 'anchor': [0, 0, 0], 'stiffness': 50.0}


def oscillator_error(integrator: str, step: float) -> float:
    """Return the error after 1 s of a mass of 2 kg on a spring of 50 N/m: x = cos 5 t."""
    world = make(integrator, step=step, forces=[SPRING],
                 bodies=[body(pose={'position': [1.0, 0, 0]})])
    world.step(round(1.0 / step))
    return abs(float(world.position[0, 0]) - float(np.cos(5.0)))


@pytest.mark.parametrize(('integrator', 'order'), [
    ('euler', 1), ('semi_implicit', 1), ('rk4', 4), ('symplectic', 2), ('symplectic4', 4)])
def test_the_order_of_each_integrator_under_a_spring(integrator, order):
    ratio = oscillator_error(integrator, 1 / 500) / oscillator_error(integrator, 1 / 1000)
    # 2^p in the limit of small steps; terms of higher order move p by a few hundredths.
    assert np.log2(ratio) == pytest.approx(order, abs=0.1)


def tumbling_error(integrator: str, orientation: str, step: float) -> float:
    """Return the error of a tumbling box's attitude after 0.5 s against symplectic at 10 us."""
    bodies = [body(twist={'angular': [3.0, 4.0, 1.0]})]
    fine = make(step=1e-5, bodies=bodies)
    fine.step(50_000)
    coarse = make(integrator, step=step, bodies=bodies, orientation=orientation)
    coarse.step(round(0.5 / step))
    a, b = coarse.orientation[0], fine.orientation[0]
    return float(min(np.linalg.norm(a - b), np.linalg.norm(a + b)))


@pytest.mark.parametrize(('integrator', 'orientation', 'order'), [
    *(('euler', kind, 1) for kind in ORIENTATIONS),
    *(('semi_implicit', kind, 1) for kind in ORIENTATIONS),
    ('rk4', 'quaternion', 4)])
def test_the_order_of_each_way_to_turn_a_body(integrator, orientation, order):
    coarse, fine = (tumbling_error(integrator, orientation, step) for step in (1 / 200, 1 / 400))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize('orientation', ORIENTATIONS)
def test_every_way_to_turn_a_body_keeps_it_a_rotation(orientation):
    world = make('euler', orientation=orientation, bodies=[body(twist={'angular': [9.0, 8, 7]})])
    world.step(2000)
    assert np.linalg.norm(world.orientation[0]) == pytest.approx(1.0, abs=1e-14)


def test_the_ways_to_turn_a_body_differ():
    turned = []
    for orientation in ORIENTATIONS:
        world = make('semi_implicit', orientation=orientation, step=0.01,
                     bodies=[body(twist={'angular': [3.0, 4.0, 1.0]})])
        world.step(10)
        turned.append(tuple(world.orientation[0]))
    assert len(set(turned)) == 3


def test_axis_angle_is_exact_about_a_principal_axis():
    world = make('semi_implicit', orientation='axis_angle', step=0.1,
                 bodies=[body(twist={'angular': [0, 0, 2.0]})])
    world.step(5)
    # 0.5 s at 2 rad/s are 1 rad.
    assert np.allclose(world.orientation[0], [0, 0, np.sin(0.5), np.cos(0.5)], atol=1e-15)


def test_symplectic_keeps_the_energy_of_a_spring_bounded():
    world = make(step=0.01, forces=[SPRING], bodies=[body(pose={'position': [1.0, 0, 0]})])
    energies = []
    for _ in range(20_000):
        world.step(1)
        energies.append(world.kinetic_energy() + world.potential_energy())
    # Velocity Verlet conserves a neighbouring energy that differs by a fraction (w h)^2 / 4 =
    # 6e-4.
    assert max(energies) / min(energies) - 1.0 < (5.0 * 0.01) ** 2 / 2
    assert np.mean(energies[:5000]) == pytest.approx(np.mean(energies[-5000:]), rel=1e-5)


def test_explicit_euler_gains_energy():
    world = make('euler', step=0.01, forces=[SPRING],
                 bodies=[body(pose={'position': [1.0, 0, 0]})])
    world.step(100)
    # |amplification| of a step is sqrt(1 + (w h)^2): the energy grows by 1.0025^100 = 1.284.
    energy = world.kinetic_energy() + world.potential_energy()
    assert energy == pytest.approx(25.0 * (1 + 0.05 ** 2) ** 100, rel=1e-9)


@pytest.mark.parametrize(('integrator', 'order'), [('symplectic', 2), ('symplectic4', 3)])
def test_the_order_of_damped_motion(integrator, order):
    def error(step):
        world = make(integrator, step=step, forces=[{'type': 'wind', 'drag': 4.0}],
                     bodies=[body(twist={'linear': [1.0, 0, 0]})])
        world.step(round(1.0 / step))
        return abs(world.linear_velocity[0, 0] - np.exp(-2.0))  # c / m = 2 / s

    assert np.log2(error(0.02) / error(0.01)) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_a_fixed_body_stays_where_it_is_to_the_bit(integrator):
    q = (np.array([1.0, 2, 3, 4]) / np.sqrt(30)).tolist()
    world = make(integrator, gravity=(0, 0, -9.81), bodies=[
        body(fixed=True, pose={'position': [0.1, 0.2, 0.3], 'orientation': q})])
    pose = world.position.tobytes() + world.orientation.tobytes()
    world.apply_wrench('body', force=(1e3, 0, 0), torque=(0, 1e3, 0), duration=1.0)
    world.step(100)
    assert world.position.tobytes() + world.orientation.tobytes() == pose
    assert not world.linear_momentum.any()


def test_free_flight_in_blocks_equals_the_staged_steps_to_the_bit():
    # A spring without stiffness sends the same bodies the other way through the code.
    rng = np.random.default_rng(3)
    bodies = [{**body(), 'name': f'b{i}', 'twist': {'linear': rng.normal(size=3).tolist(),
                                                    'angular': rng.normal(size=3).tolist()}}
              for i in range(13)]
    blocks = make(gravity=(0.1, 0.2, -9.81), bodies=bodies)
    staged = make(gravity=(0.1, 0.2, -9.81), bodies=bodies, forces=[
        {'type': 'wind', 'bodies': ['b0'], 'drag': 0.0}])
    blocks.step(40)
    staged.step(40)
    # The staged step takes half a kick off again: P differs by its rounding, 40 * 1e-15 relative.
    assert np.array_equal(blocks.orientation, staged.orientation)
    assert np.allclose(blocks.position, staged.position, rtol=1e-13, atol=1e-15)
