# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How much a second thread brings.

    python benchmarks/threads.py
    python benchmarks/threads.py --output docs/performance.md

The heaps that engines are compared in, and spheres at rest in a bin. Two worlds of a scene, one
with one thread and one with two, take turns, some steps each; every piece of the one is compared
with the same steps of the other. Time is that of the wall, since what is asked for is how much
sooner the steps are done; on a machine that others use too, the ratio of the quickest pieces tells
most. Both must end in the same state.
"""

import argparse
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent / 'peers'))

from growth import in_a_bin
from page import heading, line, machine, write
from run_rigid_sim import world as peers_world
from scenes import pile, spheres

from rigid_sim_ros import World
from rigid_sim_ros.engine.compiling import cores

WANTED = 1.6
# Steps. After a change of worlds the caches hold the other one, and the second thread has to wake
# up: what is stepped without a break has neither.
PIECE = 40
QUICKEST = 0.1  # part of the pieces whose ratio is given apart from the median
SCENES: dict[str, Any] = {
    'spheres 666': lambda: peers_world(spheres()),
    'pile 1000': lambda: peers_world(pile()),
    '3000 spheres in a bin': lambda: World.from_dict(in_a_bin(3000))}


def _seconds(world: World) -> float:
    begun = time.perf_counter()
    world.step(PIECE)
    return time.perf_counter() - begun


def row(name: str, steps: int) -> list[object]:
    """Run a scene with one thread and with two; return the cells of a line."""
    one, two = SCENES[name](), SCENES[name]()
    two.threads = 2
    # Kernels are compiled, and bodies have fallen onto each other.
    one.step(240)
    two.step(240)
    taken = np.array([(_seconds(one), _seconds(two)) for _ in range(steps // PIECE)])
    same = 'yes' if one.state_hash() == two.state_hash() else 'NO'
    quickest = np.quantile(taken, QUICKEST, axis=0)
    ratios = taken[:, 0] / taken[:, 1]
    low, middle, high = np.quantile(ratios, [0.25, 0.5, 0.75])
    return [name, *(f'{PIECE / t:.0f}' for t in np.median(taken, axis=0)), f'{middle:.2f}',
            f'{low:.2f} to {high:.2f}', f'{quickest[0] / quickest[1]:.2f}', same]


def main() -> int:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--steps', type=int, default=960, help='of each scene that count, 960')
    parser.add_argument('--output', type=Path, help='a Markdown file to write, besides')
    arguments = parser.parse_args()
    if cores() < 2:
        parser.error('this process may use only one core')
    lines = heading(['', 'one thread, steps/s', 'two threads', 'ratio', 'half of the ratios',
                     'of the quickest tenth', 'the same hash'])
    for name in SCENES:
        lines.append(line(row(name, arguments.steps)))
        print(lines[-1], flush=True)
    lines.append(line(['wanted', '', '', f'{WANTED}', '', '', 'yes']))
    pages = [machine(), '\n'.join(lines)]
    print('', *pages, sep='\n\n')
    if arguments.output:
        write(arguments.output, pages, 'threads')
    return 0


if __name__ == '__main__':
    sys.exit(main())
