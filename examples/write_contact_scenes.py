# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write the example scenes that have too many bodies to be written by hand.

    python examples/write_contact_scenes.py [FOLDER]

The scenes in rigid_sim_ros/example_scenes were written by this script; the same numbers come out
on every run. Copy a function to build a scene of your own.
"""

from collections.abc import Callable, Iterator
import inspect
import math
from pathlib import Path
import sys

import numpy as np

FOLDER = Path(__file__).parent.parent / 'rigid_sim_ros' / 'example_scenes'
GROUND = '- {name: ground, fixed: true, color: [0.55, 0.57, 0.6], shape: {type: plane}}'
# Of blocks, balls and shapes, told apart also by the colour-blind (Okabe and Ito, 2008).
COLORS = ('[0.90, 0.62, 0.0]', '[0.34, 0.71, 0.91]', '[0.0, 0.62, 0.45]', '[0.94, 0.89, 0.26]',
          '[0.0, 0.45, 0.70]', '[0.84, 0.37, 0.0]', '[0.80, 0.47, 0.65]')


def numbers(*values: float) -> str:
    """Write a list of numbers with a tenth of a millimetre or better."""
    return '[' + ', '.join(f'{value:.6g}' for value in values) + ']'


def body(name: str, shape: str, position: tuple[float, ...], *more: str) -> str:
    """Write one body on one line."""
    pose = f'pose: {{position: {numbers(*position)}}}'
    if more and more[0].startswith('pose'):
        pose, more = more[0], more[1:]
    return f'- {{{", ".join([f"name: {name}", f"shape: {{{shape}}}", pose, *more])}}}'


def turned(position: tuple[float, ...], axis: tuple[float, ...], angle: float) -> str:
    """Write a pose that is turned about an axis by an angle [rad]."""
    q = [*(math.sin(angle / 2) * np.array(axis) / np.linalg.norm(axis)), math.cos(angle / 2)]
    return f'pose: {{position: {numbers(*position)}, orientation: {numbers_exact(q)}}}'


def numbers_exact(values: list[float]) -> str:
    """Write a list of numbers so that they read back the same."""
    return '[' + ', '.join(repr(float(value)) for value in values) + ']'


def tower() -> Iterator[str]:
    """
    Steel meets wood: a ball flies into a tower of blocks and brings it down.

    Ten layers of three wooden blocks each, laid crosswise, and a steel ball of 33 kg at
    5 m/s. Blocks of a common toy: 75 x 25 x 15 mm, scaled by four; wood on wood slides with a
    coefficient of friction of 0.4 (CRC Handbook of Chemistry and Physics).
    """
    yield from ('format: 1', 'world: {step: 0.002, contact: timestep}',
                'materials: {wood: {friction: 0.4}, steel: {friction: 0.3, restitution: 0.3}}',
                'bodies:', GROUND)
    for layer in range(10):
        for k in range(3):
            along, size = (k - 1) * 0.1, (0.3, 0.0996, 0.06)
            z = 0.03 + 0.06 * layer
            position = (0.0, along, z) if layer % 2 == 0 else (along, 0.0, z)
            size = size if layer % 2 == 0 else (size[1], size[0], size[2])
            yield body(f'block_{layer}_{k}', f'type: box, size: {numbers(*size)}', position,
                       'density: 600', 'material: wood', f'color: {COLORS[layer % 7]}')
    yield body('ball', 'type: sphere, radius: 0.1', (-2.0, 0.06, 0.4), 'density: 7850',
               'material: steel', 'twist: {linear: [5, 0, 1.6]}', 'color: [0.2, 0.2, 0.2]')


def dominoes() -> Iterator[str]:
    """
    Forty dominoes stand on a curve, and the first one tips over.

    Dominoes of a common size, 48 x 24 x 7.5 mm and 11 g, 22 mm apart. The wave settles to a
    constant speed (D. E. Shaw, Mechanics of a chain of dominoes, Am. J. Phys. 46, 1978).
    """
    yield from ('format: 1', 'world: {step: 0.001, contact: timestep}',
                'materials: {default: {friction: 0.3}}', 'bodies:', GROUND)
    angle, radius = 0.0, 0.28
    for k in range(40):
        a = angle + k * 0.022 / radius
        position = (radius * math.sin(a), radius * (1 - math.cos(a)), 0.024)
        lean = 'twist: {angular: ' + numbers(0, 9, 0) + '}' if k == 0 else 'material: default'
        yield body(f'domino_{k}', 'type: box, size: [0.0075, 0.024, 0.048]', position,
                   turned(position, (0, 0, 1), a), 'mass: 0.011', lean,
                   f'color: {COLORS[k % 7]}')


def newtons_cradle() -> Iterator[str]:
    """
    Newton's cradle: one ball comes in, one ball leaves, again and again.

    Five steel balls of 25 mm and 64 g, each on two threads of 0.2 m that meet at 60 degrees. A
    thread is a stiff spring: 20 kN/m, as 0.2 m of steel wire of 0.16 mm has. Each collision
    happens at its own instant, so the momentum goes through the row ball by ball.
    """
    yield from ('format: 1', 'world: {step: 0.0005, contact: event}',
                'materials: {default: {friction: 0, restitution: 0.99}}', 'bodies:')
    drop, spread = 0.2 * math.cos(math.pi / 6), 0.2 * math.sin(math.pi / 6)
    lift = 0.6
    for k in range(5):
        x, height = k * 0.0252, 0.3
        position = (x, 0.0, height - drop)
        if k == 0:
            position = (x - drop * math.sin(lift), 0.0, height - drop * math.cos(lift))
        yield body(f'ball_{k}', 'type: sphere, radius: 0.0125', position, 'mass: 0.064',
                   f'color: {COLORS[1]}')
    yield 'forces:'
    for k in range(5):
        for side in (-1, 1):
            anchor = numbers(k * 0.0252, side * spread, 0.3)
            yield (f'- {{type: spring, a: ball_{k}, b: world, anchor: {anchor}, '
                   'stiffness: 20000, damping: 2, rest_length: 0.2}')


def billiard_break() -> Iterator[str]:
    """
    Fifteen balls on a billiard table are scattered by a cue ball.

    Balls of 57.15 mm and 0.17 kg (World Pool Association, Equipment Specifications) on cloth;
    ball on ball: friction 0.06, restitution 0.94; cloth: friction 0.2, rolling resistance 0.01
    of the weight (D. G. Alciatore, Illustrated Principles of Pool).
    """
    yield from ('format: 1', 'world: {step: 0.0005, contact: timestep}', 'materials:',
                '  ball: {friction: 0.06, restitution: 0.94}',
                '  cloth: {friction: 0.2, restitution: 0.5, rolling: 0.000286}',
                '  cushion: {friction: 0.14, restitution: 0.85}', 'material_pairs:',
                '- {a: ball, b: cloth, friction: 0.2, restitution: 0.5, rolling: 0.000286}',
                '- {a: ball, b: cushion, friction: 0.14, restitution: 0.85}', 'bodies:',
                GROUND.replace('color: [0.55, 0.57, 0.6]',
                               'material: cloth, color: [0.0, 0.35, 0.25]'))
    long, short = (2.64, 0.05, 0.04), (0.05, 1.27, 0.04)
    for name, x, y, size in (('left', 0, 0.66, long), ('right', 0, -0.66, long),
                             ('head', -1.295, 0, short), ('foot', 1.295, 0, short)):
        yield body(f'cushion_{name}', f'type: box, size: {numbers(*size)}', (x, y, 0.0365),
                   'fixed: true', 'material: cushion', 'color: [0.3, 0.2, 0.1]')
    r, k = 0.028575, 0
    rng = np.random.default_rng(4)  # nobody racks without a gap of some tenths of a millimetre
    for line in range(5):
        for place in range(line + 1):
            dx, dy = rng.uniform(-2e-4, 2e-4, 2)
            position = (0.635 + line * math.sqrt(3) * r * 1.016 + dx,
                        (2 * place - line) * r * 1.016 + dy, r)
            yield body(f'ball_{k + 1}', f'type: sphere, radius: {r}', position, 'mass: 0.17',
                       'material: ball', f'color: {COLORS[k % 7]}')
            k += 1
    yield body('cue_ball', f'type: sphere, radius: {r}', (-0.635, 0.01, r), 'mass: 0.17',
               'material: ball', 'twist: {linear: [8, 0, 0]}', 'color: [1, 1, 1]')


def ramp() -> Iterator[str]:
    """
    Four crates on a ramp: two stick, two slip, as their friction wills.

    The ramp is steeper than the friction angle of two of the crates: tan 20 deg = 0.364. Those
    with mu = 0.37 and 0.5 stay; those with 0.35 and 0.2 slide by
    g (sin 20 deg - mu cos 20 deg) t^2 / 2: 0.58 m in 3 s and 3.0 m in 2 s.
    """
    angle = math.radians(20)
    yield from ('format: 1', 'world: {step: 0.001, contact: timestep}', 'materials:',
                '  ramp: {friction: 1.0}', *(f'  crate_{k}: {{}}' for k in range(4)))
    frictions = (0.2, 0.35, 0.37, 0.5)
    yield 'material_pairs:'
    for k, mu in enumerate(frictions):
        yield f'- {{a: ramp, b: crate_{k}, friction: {mu}}}'
    yield 'bodies:'
    yield body('ramp', 'type: box, size: [10, 3, 0.2]', (0, 0, 0),
               turned((0, 0, 2.0), (0, 1, 0), angle), 'fixed: true', 'material: ramp',
               'color: [0.55, 0.57, 0.6]')
    along = np.array([math.cos(angle), 0, -math.sin(angle)])
    up = np.array([math.sin(angle), 0, math.cos(angle)])
    for k in range(4):
        p = np.array([0, -1.05 + 0.7 * k, 2.0]) - 3.5 * along + (0.1 + 0.15) * up
        yield body(f'crate_{k}', 'type: box, size: [0.4, 0.4, 0.3]', tuple(p),
                   turned(tuple(p), (0, 1, 0), angle), 'mass: 10', f'material: crate_{k}',
                   f'color: {COLORS[k]}')


def pile_of_shapes() -> Iterator[str]:
    """
    Two hundred balls, boxes, capsules and cylinders fall on a heap.

    Shapes of 0.1 to 0.2 m and of the density of ice, in eight layers of 25.
    """
    yield from ('format: 1', 'world: {step: 0.002, contact: timestep}',
                'materials: {default: {friction: 0.5, rolling: 0.001}}', 'bodies:', GROUND)
    rng = np.random.default_rng(7)
    for k in range(200):
        layer, place = divmod(k, 25)
        x, y = (place % 5 - 2) * 0.27, (place // 5 - 2) * 0.27
        position = (x, y, 0.3 + 0.3 * layer)
        r, length = rng.uniform(0.05, 0.08), rng.uniform(0.05, 0.1)
        shape = (f'type: sphere, radius: {r:.4f}',
                 f'type: box, size: {numbers(*np.round(rng.uniform(0.08, 0.16, 3), 4))}',
                 f'type: capsule, radius: {0.7 * r:.4f}, length: {length:.4f}',
                 f'type: cylinder, radius: {r:.4f}, length: {length:.4f}')[k % 4]
        yield body(f'shape_{k}', shape, position,
                   turned(position, tuple(rng.normal(size=3)), rng.uniform(0, math.pi)),
                   'density: 917', f'color: {COLORS[k % 4]}')


def balls() -> Iterator[str]:
    """
    Six hundred and sixty-six balls fall in a block and spread over the floor.

    Balls of 0.1 m radius and the density of water, packed with 2 cm between them.
    """
    yield from ('format: 1', 'world: {step: 0.004, contact: timestep}',
                'materials: {default: {friction: 0.5}}', 'bodies:', GROUND)
    rng = np.random.default_rng(2)
    for k in range(666):
        i, j, layer = k % 9, k // 9 % 9, k // 81
        away = rng.uniform(-0.01, 0.01, 3)
        position = 0.22 * np.array([i - 4, j - 4, layer]) + [0.0, 0.0, 0.3] + away
        yield body(f'ball_{k}', 'type: sphere, radius: 0.1', tuple(np.round(position, 4)),
                   'density: 1000', f'color: {COLORS[layer % 7]}')


SCENES: dict[str, Callable[[], Iterator[str]]] = {
    'tower': tower, 'dominoes': dominoes, 'newtons_cradle': newtons_cradle,
    'billiard_break': billiard_break, 'ramp': ramp, 'pile_of_shapes': pile_of_shapes,
    'balls': balls}


def main() -> None:
    """Write every scene into the folder of the examples, or into another."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for name, scene in SCENES.items():
        header = inspect.cleandoc(scene.__doc__ or '').splitlines()
        lines = [*(f'# {line}'.rstrip() for line in header), *scene()]
        (folder / f'{name}.yaml').write_text('\n'.join(lines) + '\n', encoding='utf-8')
        print(f'{folder / name}.yaml')


if __name__ == '__main__':
    main()
