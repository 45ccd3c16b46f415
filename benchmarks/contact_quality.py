# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Quality of contacts of the model `timestep`: `python benchmarks/contact_quality.py`.

Prints what it reaches in the scenes in which other engines were measured, with the best of their
figures beside it. Overlaps of piles are the deepest of every 96th step for all engines; the
deepest of all steps follows in brackets.
"""

import argparse
import math
import platform
import time

import numpy as np

from rigid_sim_ros import World

G = 9.81
SLOPE = math.radians(20.0)
H = 1 / 240


def world(bodies, step, friction=0.5, restitution=0.0, gravity=(0.0, 0.0, -G), plane=True):
    """Return a world of these bodies, by default on the ground."""
    ground = [{'name': 'ground', 'fixed': True,
               'shape': {'type': 'plane', 'normal': [0, 0, 1], 'offset': 0}}]
    return World.from_dict({
        'format': 1,
        'world': {'step': step, 'gravity': list(gravity), 'contact': 'timestep'},
        'materials': {'default': {'friction': friction, 'restitution': restitution}},
        'bodies': (ground if plane else []) + bodies})


def box(name, size, mass, position, orientation=(0, 0, 0, 1)):
    """Return the entry of a box in a scene."""
    return {'name': name, 'shape': {'type': 'box', 'size': list(size)}, 'mass': mass,
            'pose': {'position': list(map(float, position)),
                     'orientation': list(map(float, orientation))}}


def ball(name, radius, mass, position, linear=(0, 0, 0), angular=(0, 0, 0)):
    """Return the entry of a ball in a scene."""
    return {'name': name, 'shape': {'type': 'sphere', 'radius': radius}, 'mass': mass,
            'pose': {'position': list(map(float, position))},
            'twist': {'linear': list(map(float, linear)),
                      'angular': list(map(float, angular))}}


def on_slope(body, friction):
    """Return a world in which gravity leans by 20 degrees towards x."""
    return world([body], 1e-3, friction, gravity=(G * math.sin(SLOPE), 0, -G * math.cos(SLOPE)))


def bounce():
    """Return the largest relative error of the first three apexes."""
    w = world([ball('ball', 0.1, 1.0, (0, 0, 1.1))], 1e-3, restitution=0.8)
    z = []
    for _ in range(4000):
        w.step()
        z.append(w.position[1, 2] - 0.1)
    z = np.array(z)
    apexes = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])][:3]
    return f'{100 * np.abs(apexes / 0.64 ** np.arange(1, 4) - 1).max():.1e} %'


def creep():
    """Return the creep of a box that friction holds, in 5 s."""
    w = on_slope(box('box', (1, 1, 0.5), 1.0, (0, 0, 0.25)), math.tan(SLOPE) * 1.02)
    w.step(5000)
    return f'{abs(w.position[1, 0]):.1e} m'


def slide():
    """Return the relative error of the distance of a sliding box after 5 s."""
    w = on_slope(box('box', (1, 1, 0.5), 1.0, (0, 0, 0.25)), 0.2)
    w.step(5000)
    exact = 0.5 * G * (math.sin(SLOPE) - 0.2 * math.cos(SLOPE)) * 25.0
    return f'{abs(w.position[1, 0] / exact - 1):.1e}'


def roll():
    """Return the relative error of the distance of a rolling ball after 2 s."""
    w = on_slope(ball('ball', 0.1, 1.0, (0, 0, 0.1)), 0.5)
    w.step(2000)
    return f'{abs(w.position[1, 0] / (0.5 * 5 / 7 * G * math.sin(SLOPE) * 4.0) - 1):.1e}'


def gas():
    """Return the relative errors of P, L and the energy of 32 spinning elastic balls, 2 s."""
    rng = np.random.default_rng(5)
    places = np.array([(i % 4, i // 4 % 4, i // 16) for i in range(32)]) * 0.3
    v = -2.0 * (places - places.mean(axis=0)) + rng.normal(0, 1, (32, 3))
    w = world([ball(f'b{i}', 0.1, 1.0, places[i], v[i], rng.normal(0, 20, 3))
               for i in range(32)], 1e-3, 0.0, 1.0, (0, 0, 0), plane=False)
    P, L, E = w.total_momentum(), w.total_angular_momentum(), w.kinetic_energy()
    w.step(2000)
    errors = (np.abs(w.total_momentum() - P).max() / np.linalg.norm(P),
              np.abs(w.total_angular_momentum() - L).max() / np.linalg.norm(L),
              abs(w.kinetic_energy() / E - 1))
    return 'P {:.0e}, L {:.0e}, energy {:.0e}'.format(*errors)


def tower():
    """Return sag and drift of the top of 20 boxes after 10 s, and the error of the force below."""
    w = world([box(f'b{k}', (1, 1, 1), 1.0, (0, 0, 0.5 + k)) for k in range(20)], H, 0.6)
    w.step(2400)
    top = w.position[20]
    rows = w.contacts()
    force = rows['normal_force'][rows['body_a'] == 0].sum()
    return (f'{abs(19.5 - top[2]) * 1e3:.1e} mm, {math.hypot(top[0], top[1]) * 1e3:.1e} mm, '
            f'{abs(force / (20 * G) - 1):.0e}')


def pyramid():
    """Return the largest displacement in a pyramid of 210 boxes after 5 s."""
    w = world([box(f'b{k}_{i}', (1, 1, 1), 1.0, ((i - (19 - k) / 2) * 1.05, 0, 0.5 + k))
               for k in range(20) for i in range(20 - k)], H, 0.6)
    start = w.position
    w.step(1200)
    return f'{np.linalg.norm(w.position - start, axis=1).max() * 1e3:.2f} mm'


def overlaps(w):
    """Return the deepest overlap of samples, of all steps, and at the end [mm]."""
    depths = []
    for _ in range(1200):
        w.step()
        depths.append(max(0.0, -w.contacts()['gap'].min(initial=0.0)))
    depths = 1e3 * np.array(depths)
    return depths[95::96].max(), depths.max(), depths[-1]


def heap_of_balls():
    """Return 666 balls that fall into a heap."""
    rng, r = np.random.default_rng(2), 0.1
    places = [np.array((i - 4, j - 4, k)) * 2.2 * r + (0, 0, 0.3) + rng.uniform(-0.01, 0.01, 3)
              for k in range(9) for j in range(9) for i in range(9)][:666]
    mass = 4 / 3 * math.pi * r ** 3 * 1000
    return world([ball(f'b{i}', r, mass, p) for i, p in enumerate(places)], H)


def heap_of_boxes():
    """Return 1000 boxes that fall into a heap."""
    rng = np.random.default_rng(3)
    boxes = []
    for i in range(1000):
        w, x, y, z = rng.normal(0, 1, 4)
        q = np.array((x, y, z, w)) / math.sqrt(w * w + x * x + y * y + z * z)
        grid = np.array((i % 10 - 4.5, i // 10 % 10 - 4.5, i // 100)) * 0.36
        boxes.append(box(f'b{i}', (0.2, 0.2, 0.2), 8.0,
                         np.array((0.0, 0.0, 0.4)) + grid + rng.uniform(-0.005, 0.005, 3), q))
    return world(boxes, H)


def balls():
    """Return the deepest overlap of 666 falling balls."""
    sampled, deepest, _ = overlaps(heap_of_balls())
    return f'{sampled:.2f} mm ({deepest:.2f})'


def pile():
    """Return the deepest overlap of 1000 falling boxes, and that at the end."""
    sampled, deepest, end = overlaps(heap_of_boxes())
    return f'{sampled:.1f} mm ({deepest:.1f}), {end:.2f} mm'


CASES = (
    ('bounce 0.8: worst of three apexes', bounce, '0.2 % (ODE)'),
    ('slope, mu 2 % above the limit: creep in 5 s', creep, '1e-8 m (DART)'),
    ('slope, mu = 0.2: distance', slide, '5e-5 (Box3D, Rapier)'),
    ('ball rolls down: distance', roll, '8e-5 (Rapier)'),
    ('gas of 32 elastic balls, 2 s', gas, ''),
    ('tower of 20, 10 s: sag, drift, force', tower,
     '0.07 mm (DART), 0.004 mm (DART), 1e-5 (Rapier, Box3D, MuJoCo)'),
    ('pyramid of 210, 5 s: displacement', pyramid, ''),
    ('666 balls: deepest', balls, '1.2 mm (Jolt)'),
    ('pile of 1000 boxes: deepest, at the end', pile, '18 mm (Rapier, Jolt), 1.2 mm (Bullet)'),
)


def main() -> None:
    """Run the cases and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', default='', help='cases whose name contains this')
    only = parser.parse_args().only
    print(f'{platform.processor() or platform.machine()}, {time.strftime("%Y-%m-%d")}')
    print(f'{"case":<46}{"timestep":<44}best of the other engines')
    for name, run, best in CASES:
        if only in name:
            print(f'{name:<46}{run():<44}{best}', flush=True)


if __name__ == '__main__':
    main()
