# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Cost and accuracy of free motion: `python benchmarks/free_motion.py`.

Prints body-steps a second for worlds of several sizes, the cost of one body, the error of a
tumbling body over 100 s, and the measured order of each integrator. One thread, medians.
"""

import argparse
import platform
import statistics
import time

import numpy as np

from rigid_sim_ros import World

REPEATS = 7
INTEGRATORS = ('symplectic', 'symplectic4', 'rk4', 'semi_implicit', 'euler')
# The attitude of the body of `flipping_body` after 100 s, from Taylor series with 34 digits.
AFTER_100_S = np.array((-0.00033532024701064178, 0.69467618661934152, 0.0065696244258204497,
                        0.71929251583653713))


def falling_boxes(n: int, integrator: str) -> World:
    """Return n tumbling boxes under gravity."""
    rng = np.random.default_rng(1)
    return World.from_dict({
        'format': 1,
        'world': {'step': 1 / 240, 'integrator': integrator, 'contact': 'none'},
        'bodies': [{'name': f'b{i}', 'shape': {'type': 'box', 'size': [0.2, 0.3, 0.4]},
                    'mass': 24.0, 'twist': {'linear': rng.normal(0, 0.2, 3).tolist(),
                                            'angular': rng.normal(0, 3.0, 3).tolist()}}
                   for i in range(n)]})


def flipping_body(w: tuple[float, float, float], step: float, integrator: str) -> World:
    """Return a body with the moments 1, 2, 3 kg m^2 in no gravity."""
    return World.from_dict({
        'format': 1,
        'world': {'gravity': [0, 0, 0], 'step': step, 'integrator': integrator, 'contact': 'none'},
        'bodies': [{'name': 'body', 'shape': {'type': 'sphere', 'radius': 0.1},
                    'inertial': {'mass': 1.0, 'com': [0, 0, 0], 'inertia': [1, 2, 3, 0, 0, 0]},
                    'twist': {'angular': list(w)}}]})


def oscillator(step: float, integrator: str) -> World:
    """Return 2 kg on a spring of 50 N/m, 1 m out: x = cos 5 t."""
    return World.from_dict({
        'format': 1,
        'world': {'gravity': [0, 0, 0], 'step': step, 'integrator': integrator, 'contact': 'none'},
        'bodies': [{'name': 'body', 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 2.0,
                    'pose': {'position': [1, 0, 0]}}],
        'forces': [{'type': 'spring', 'a': 'body', 'b': 'world', 'stiffness': 50.0}]})


def seconds(world: World, steps: int) -> float:
    """Return the median wall time of some steps, warmed up."""
    world.step(steps)
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        world.step(steps)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two attitudes [rad]."""
    cross = a[3] * b[:3] - b[3] * a[:3] - np.cross(a[:3], b[:3])
    return 2.0 * float(np.linalg.norm(cross))


def speed() -> None:
    """Print the cost of a body-step."""
    print('\n| integrator | bodies | ns a body-step | million body-steps a second |')
    print('| --- | ---: | ---: | ---: |')
    for integrator in INTEGRATORS:
        for n in (1, 100, 1000, 100_000) if integrator == 'symplectic' else (1000,):
            steps = max(3, 1_000_000 // n)
            cost = seconds(falling_boxes(n, integrator), steps) / (n * steps)
            print(f'| {integrator} | {n} | {cost * 1e9:.1f} | {1e-6 / cost:.1f} |')


def accuracy() -> None:
    """Print errors and drifts over 100 s of a body that flips about its middle axis."""
    print('\n| integrator, 1 ms, 100 s | attitude error [rad] | energy drift | drift of L '
          '| us a step |')
    print('| --- | ---: | ---: | ---: | ---: |')
    for integrator in INTEGRATORS:
        world = flipping_body((0.01, 5.0, 0.01), 1e-3, integrator)
        L, energy = world.angular_momentum[0], world.kinetic_energy()
        energy_drift = momentum_drift = 0.0
        for _ in range(1000):
            world.step(100)
            energy_drift = max(energy_drift, abs(world.kinetic_energy() / energy - 1.0))
            change = np.linalg.norm(world.angular_momentum[0] - L) / np.linalg.norm(L)
            momentum_drift = max(momentum_drift, float(change))
        error = angle(world.orientation[0], AFTER_100_S)
        cost = seconds(world, 100_000) / 100_000
        print(f'| {integrator} | {error:.1e} | {energy_drift:.1e} | {momentum_drift:.1e} '
              f'| {cost * 1e6:.3f} |')


def orders() -> None:
    """Print the order of each integrator, from the errors at two steps."""
    print('\n| integrator | order on a spring | order of the attitude of a tumbling body |')
    print('| --- | ---: | ---: |')
    fine = flipping_body((1.0, 2.0, 0.5), 1e-4, 'symplectic')
    fine.step(10_000)
    for integrator in INTEGRATORS:
        on_spring, turning = [], []
        coarse = integrator in ('symplectic', 'symplectic4', 'rk4')
        for step in (1 / 50, 1 / 100) if coarse else (1e-3, 5e-4):
            world = oscillator(step, integrator)
            world.step(round(1 / step))
            on_spring.append(abs(float(world.position[0, 0]) - np.cos(5.0)))
            world = flipping_body((1.0, 2.0, 0.5), step, integrator)
            world.step(round(1 / step))
            turning.append(angle(world.orientation[0], fine.orientation[0]))
        print(f'| {integrator} | {np.log2(on_spring[0] / on_spring[1]):.2f} '
              f'| {np.log2(turning[0] / turning[1]):.2f} |')


def main() -> None:
    """Run the parts that were asked for."""
    parts = {'speed': speed, 'accuracy': accuracy, 'orders': orders}
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('parts', nargs='*', choices=[[], *parts], help='default: all')
    print(f'{platform.machine()}, Python {platform.python_version()}, '
          f'{time.strftime("%Y-%m-%d")}, medians of {REPEATS} runs')
    for part in parser.parse_args().parts or parts:
        parts[part]()


if __name__ == '__main__':
    main()
