# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the contact models `event` and `timestep` reach: `python benchmarks/contact_quality.py`.

Prints a table of cases with a formula, what is wanted of each model, and what it reaches. Steps
are 1 ms unless the case says another. Overlaps are those of all steps, as the models report them;
compare.py measures overlaps of several engines from outside.
"""

import argparse
from collections.abc import Callable
import math
from pathlib import Path
import sys
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent / 'peers'))

from run_rigid_sim import world
from scenes import (
    body, bounce, G, pile, pyramid, roll, scene, SLOPE, slope_hold, slope_slide, spheres, stack)

# Steps between looks at the overlaps of the heap, as for the other engines (peers/figures.py).
LOOK = 96


def apexes(contact: str) -> str:
    """Return the error of the first three apexes of a ball with restitution 0.8."""
    w, best, before = world(bounce(), contact), [], 1.0
    while len(best) < 3:
        w.step()
        # Where the ball would turn around, which is exact in flight, whatever the step.
        apex = w.position[0, 2] - 0.1 + w.linear_velocity[0, 2] ** 2 / (2 * G)
        if apex < before * 0.8:
            best.append(apex)
            before = apex
    errors = np.abs(np.array(best) - 0.64 ** np.arange(1, 4))
    return f'{errors.max():.0e} m, {100 * (errors / 0.64 ** np.arange(1, 4)).max():.0e} %'


def _balls(places: np.ndarray, v: np.ndarray, spin: np.ndarray, steps: int) -> dict[str, Any]:
    """Return elastic balls of 1 kg and 0.1 m, without gravity and ground."""
    found = scene('balls', [body('sphere', [0.1], 1.0, *row[:1], linear=row[1], angular=row[2])
                            for row in zip(places, v, spin, strict=True)], 1e-3, steps, steps,
                  (0, 0, 0), ground=False, friction=0.0, restitution=1.0)
    return found | {'collide': True}


def cradle(contact: str) -> str:
    """Return the error of the velocities behind a cradle of 5 balls, and of the energy."""
    places = np.outer(0.2 * np.arange(5) - 0.1 * (np.arange(5) == 0), (1, 0, 0))
    v = np.outer(np.arange(5) == 0, (1.0, 0.0, 0.0))
    w = world(_balls(places, v, np.zeros((5, 3)), 200), contact)
    energy = w.kinetic_energy()
    w.step(200)
    error = np.abs(w.linear_velocity - v[::-1]).max()
    return f'{error:.0e} m/s, energy {abs(w.kinetic_energy() / energy - 1):.0e}'


def gas(contact: str) -> str:
    """Return the errors of P, L and the energy of 32 spinning elastic balls after 2 s."""
    rng = np.random.default_rng(5)
    places = np.array([(i % 4, i // 4 % 4, i // 16) for i in range(32)]) * 0.3
    v = -2.0 * (places - places.mean(axis=0)) + rng.normal(0, 1, (32, 3))
    w = world(_balls(places, v, rng.normal(0, 20, (32, 3)), 2000), contact)
    P, L, E = w.total_momentum(), w.total_angular_momentum(), w.kinetic_energy()
    w.step(2000)
    errors = (np.abs(w.total_momentum() - P).max() / np.linalg.norm(P),
              np.abs(w.total_angular_momentum() - L).max() / np.linalg.norm(L),
              abs(w.kinetic_energy() / E - 1))
    return 'P {:.0e}, L {:.0e}, energy {:.0e}'.format(*errors)


def creep(contact: str) -> str:
    """Return the creep of a box that friction holds, in 5 s."""
    w = world(slope_hold(), contact)
    w.step(5000)
    return f'{abs(w.position[0, 0]):.0e} m'


def _distance(what: dict[str, Any], contact: str, share: float) -> str:
    w, t = world(what, contact), what['step'] * what['steps']
    w.step(what['steps'])
    return f'{abs(w.position[0, 0] / (0.5 * share * G * t * t) - 1):.0e}'


def slide(contact: str) -> str:
    """Return the relative error of the distance of a sliding box after 5 s."""
    return _distance(slope_slide(), contact, math.sin(SLOPE) - 0.2 * math.cos(SLOPE))


def rolling(contact: str) -> str:
    """Return the relative error of the distance of a rolling ball after 2 s."""
    return _distance(roll(), contact, 5 / 7 * math.sin(SLOPE))


def tower(contact: str) -> str:
    """Return sag and drift of the top of 20 boxes after 10 s, and the error of the force below."""
    w = world(stack(20), contact)
    w.step(2400)
    top, force = w.position[19], -w.contact_wrenches()[20, 2]
    return (f'{1e3 * abs(19.5 - top[2]):.0e} mm, {1e3 * math.hypot(*top[:2]):.0e} mm, '
            f'{abs(force / (20 * G) - 1):.0e}')


def rows(contact: str) -> str:
    """Return the largest displacement in a pyramid of 210 boxes after 5 s."""
    w = world(pyramid(), contact)
    start = w.position
    w.step(1200)
    return f'{1e3 * np.linalg.norm(w.position - start, axis=1).max():.2f} mm'


def _overlaps(what: dict[str, Any], contact: str) -> np.ndarray:
    """Return the deepest overlap of each step [mm]."""
    w, deepest = world(what, contact), np.zeros(what['steps'])
    for k in range(len(deepest)):
        w.step()
        deepest[k] = 1e3 * w.contact_report().deepest
    return deepest


def balls(contact: str) -> str:
    """Return the deepest overlap of 666 falling balls."""
    return f'{_overlaps(spheres(), contact).max():.2f} mm'


def boxes(contact: str) -> str:
    """Return the deepest overlap of 1000 falling boxes as the peers' is looked for, and all."""
    depths = _overlaps(pile(), contact)
    return (f'{depths[::LOOK].max():.1f} mm, {depths[-1]:.2f} mm; '
            f'deepest of all steps {depths.max():.1f} mm')


def cube(contact: str) -> str:
    """Return tilt and speed of a cube 3 s after it fell on a corner from 1.5 m."""
    q = np.array([0.34, -0.29, 0.05, 0.88])
    cube = body('box', (0.2, 0.2, 0.2), 1.0, (0, 0, 1.5 + 0.1 * math.sqrt(3)),
                q / np.linalg.norm(q))
    w = world(scene('cube', [cube], 1e-3, 4000, 4000), contact)
    w.step(4000)
    x, y, z, s = w.orientation[0]
    up = np.array([2 * (x * z - s * y), 2 * (y * z + s * x), 1 - 2 * (x * x + y * y)])
    tilt = math.sqrt(1 - min(1.0, np.abs(up).max() ** 2))
    speed = np.abs(np.append(w.linear_velocity[0], w.angular_velocity[0])).max()
    return f'{tilt:.0e} rad, {speed:.0e}'


def bullet(contact: str) -> str:
    """Return whether a ball of 2 cm at 200 m/s passes a wall of 1 cm, from 40 distances."""
    passed = 0
    for k in range(40):
        wall = body('box', (0.01, 2, 2), 1.0, (0, 0, 0)) | {'fixed': True}
        ball = body('sphere', [0.01], 0.03, (-0.5 - 0.005 * k, 0, 0), linear=(200, 0, 0))
        what = scene('bullet', [wall, ball], 1e-3, 10, 10, (0, 0, 0), ground=False)
        w = world(what | {'collide': True}, contact, continuous=True)
        w.step(10)
        passed += w.position[1, 0] > 0.0
    return f'passed {passed} of 40 times' if passed else 'never passes'


class Case(NamedTuple):
    """A case and what is wanted of each model; '' where it is not asked."""

    name: str
    reach: Callable[[str], str]
    event: str
    timestep: str


CASES = (
    Case('bounce 0.8, first three apexes', apexes, '1e-6 m', '0.1 %'),
    Case('cradle of 5 touching balls', cradle, '1e-9 m/s', 'energy 1e-2'),
    Case('32 elastic balls, 2 s', gas, '1e-12 each', 'P, L 1e-9, energy 1e-2'),
    Case('20 deg slope, mu 2 % above the limit: creep in 5 s', creep, '1e-8 m', '1e-7 m'),
    Case('the same, mu = 0.2: distance', slide, '1e-5', '5e-5'),
    Case('ball rolls down: distance', rolling, '1e-5', '8e-5'),
    Case('stack of 20, 1/240 s, 10 s: sag, drift, force', tower, 'stands',
         '1 mm, 0.01 mm, 1e-5'),
    Case('pyramid of 210, 1/240 s, 5 s: displacement', rows, '', '1 mm'),
    Case('666 balls, 1/240 s, 5 s: deepest', balls, '', '1.2 mm'),
    Case(f'1000 boxes, 1/240 s, 5 s: deepest of every {LOOK}th step, at the end', boxes, '',
         '15 mm, 1 mm'),
    Case('cube dropped on a corner: tilt, speed', cube, 'flat, 1e-9', 'flat, 1e-6'),
    Case('2 cm ball at 200 m/s against a 1 cm wall (timestep: `continuous`)', bullet,
         'never passes', 'never passes'),
)


def table(only: str = '') -> list[str]:
    """Run the cases whose name contains `only`; return the lines of a table."""
    lines = ['| case | event wanted | event | timestep wanted | timestep |',
             '| --- | --- | --- | --- | --- |']
    for case in CASES:
        if only in case.name:
            print(f'  {case.name}', file=sys.stderr, flush=True)
            event = case.reach('event') if case.event else ''
            lines.append(f'| {case.name} | {case.event} | {event} | {case.timestep} '
                         f'| {case.reach("timestep")} |')
    return lines


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', default='', help='cases whose name contains this')
    print(*table(parser.parse_args().only), sep='\n')
