# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How much a second thread brings.

    python benchmarks/threads.py
    python benchmarks/threads.py --output docs/performance.md

The heaps that engines are compared in, and spheres at rest in a bin, each run some times. Worlds
of a scene take turns, some steps each: one with one thread on either of two cores, one with two
threads on both, and two with one thread each, both at once; every piece of one world is compared
with the same steps of the others. Time is that of the wall: what is asked for is how much sooner
the steps are done. The cores of a rented machine are shared with strangers, and one of them may be
the slower one for a while: the speed of one thread is the mean of both cores, and two worlds at
once tell what both cores together are worth to work that shares nothing: two threads of one core,
as which a machine may lend them, not much more than one. Nor do the two cores have to be
neighbours, and they may be moved, at any time: before and after each piece with two threads a line
of the cache is sent there and back. All worlds must end in the same state.
"""

import argparse
import os
from pathlib import Path
import sys
import threading
import time
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent / 'peers'))

from growth import in_a_bin
from page import heading, line, machine, write
from run_rigid_sim import world as peers_world
from scenes import pile, spheres

from rigid_sim_ros import World
from rigid_sim_ros.kernels.second_core import make_job, read_acquire, write_release
from rigid_sim_ros.kernels.helper_process import cores
from rigid_sim_ros.kernels.kernel import kernel

WANTED = 1.6
# Steps, and those before them that do not count: after a change of worlds the caches hold another
# one, and the second thread has to wake up. What is stepped without a break has neither.
PIECE, BEFORE = 40, 10
BALLS = 2000  # how often a line of the cache goes there and back
# [ns] that a line takes between neighbours, at most: 65 to 85 on the machines that were seen, 295
# where it leaves their common cache.
NEAR = 120.0
# What both are worth to two worlds at once, at least, if they are two cores: these reach 1.9 to 2,
# two threads of one core 1.1 to 1.5.
TWO = 1.8
SCENES: dict[str, Any] = {
    'spheres 666': lambda: peers_world(spheres()),
    'pile 1000': lambda: peers_world(pile()),
    '3000 spheres in a bin': lambda: World.from_dict(in_a_bin(3000))}


def _place(core: int, thread: int = 0) -> None:
    """Let a thread, this one without a number, run on one core only."""
    os.sched_setaffinity(thread, {core})


def _seconds(world: World, core: int) -> float:
    """Return how long a piece takes on a core."""
    _place(core)
    world.step(BEFORE)
    begun = time.perf_counter()
    world.step(PIECE)
    return time.perf_counter() - begun


def _seconds_at_once(worlds: list[World], pair: list[int]) -> list[float]:
    """Return how long a piece of two worlds takes, each on a core of its own."""
    taken = [0.0, 0.0]

    def run(k: int) -> None:
        taken[k] = _seconds(worlds[k], pair[k])

    threads = [threading.Thread(target=run, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return taken


@kernel
def _play(job: np.ndarray, begins: bool, balls: int) -> None:
    """Write the next number whenever the other one did."""
    mine, other = (0, 8) if begins else (8, 0)
    for k in range(1, balls + 1):
        if begins:
            write_release(job, mine, k)
        while read_acquire(job, other) != k:
            pass
        if not begins:
            write_release(job, mine, k)


def _line_time(pair: list[int]) -> float:
    """Return how long what one core writes takes to the other one [ns]."""
    warm_up, job = make_job(), make_job()

    def answer() -> None:
        _place(pair[1])
        _play(warm_up, False, BALLS // 10)
        _play(job, False, BALLS)

    partner = threading.Thread(target=answer)
    _place(pair[0])
    partner.start()
    _play(warm_up, True, BALLS // 10)
    begun = time.perf_counter()
    _play(job, True, BALLS)
    taken = time.perf_counter() - begun
    partner.join()
    return 1e9 * taken / (2 * BALLS)


def _with_both(world: World, pair: list[int]) -> tuple[float, float]:
    """Return how long a piece takes on both cores, and a line there before or after, at most."""
    before = _line_time(pair)
    taken = _seconds(world, pair[0])
    return taken, max(before, _line_time(pair))


def run(name: str, steps: int, pair: list[int]) -> tuple[np.ndarray, set[int]]:
    """
    Run a scene with one thread and with two; return how long its pieces took, and all hashes.

    A row is a piece: the times of one thread on either core, that of two threads, a line from core
    to core [ns], and the times of two worlds at once.
    """
    # A world that may use one core only has no helper.
    os.sched_setaffinity(0, pair)
    worlds = [SCENES[name]() for _ in range(5)]
    alone, two, at_once = worlds[:2], worlds[2], worlds[3:]
    others = set(threading.enumerate())
    two.threads = 2
    for thread in set(threading.enumerate()) - others:
        _place(pair[1], thread.native_id or 0)
    # Kernels are compiled, and bodies have fallen onto each other.
    for world in worlds:
        world.step(240)
    _play(make_job(), True, 0)
    taken = np.array([[*map(_seconds, alone, pair), *_with_both(two, pair),
                       *_seconds_at_once(at_once, pair)] for _ in range(steps // PIECE)])
    os.sched_setaffinity(0, pair)
    return taken, {world.state_hash() for world in worlds}


def row(name: str, steps: int, rounds: int) -> list[object]:
    """Run a scene some times; return the cells of a line."""
    pair = sorted(os.sched_getaffinity(0))[:2]
    pieces, hashes = zip(*(run(name, steps, pair) for _ in range(rounds)), strict=True)
    taken, same = np.vstack(pieces), 'yes' if len(set().union(*hashes)) == 1 else 'NO'
    ratios, worth = taken[:, :2].mean(axis=1) / taken[:, 2], taken[:, :2] / taken[:, 4:]
    near = (taken[:, 3] < NEAR) & (worth.sum(axis=1) > TWO)
    return [name, *(f'{PIECE / t:.0f}' for t in np.median(taken[:, :3], axis=0)),
            f'{np.median(worth.sum(axis=1)):.2f}', f'{np.median(taken[:, 3]):.0f}',
            _middle(ratios), f'{100.0 * near.mean():.0f}', _middle(ratios[near]), same]


def _middle(ratios: np.ndarray) -> str:
    """Return the median and where half of the numbers lie, as a cell."""
    if len(ratios) == 0:
        return '-'
    low, middle, high = np.quantile(ratios, [0.25, 0.5, 0.75])
    return f'{middle:.2f} ({low:.2f} to {high:.2f})'


def main() -> int:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--steps', type=int, default=960, help='of each scene that count, 960')
    parser.add_argument('--rounds', type=int, default=4, help='how often each is run, 4')
    parser.add_argument('--output', type=Path, help='a Markdown file to write, besides')
    arguments = parser.parse_args()
    if cores() < 2:
        parser.error('this process may use only one core')
    lines = heading(['', 'one thread on the first core, steps/s', 'on the second', 'two threads',
                     'two worlds at once', 'a line from core to core [ns]', 'ratio (half of them)',
                     'two cores, and near, % of the pieces', 'ratio then', 'the same hash'])
    for name in SCENES:
        lines.append(line(row(name, arguments.steps, arguments.rounds)))
        print(lines[-1], flush=True)
    lines.append(line(['wanted', '', '', '', '', '', '', '', f'{WANTED}', 'yes']))
    pages = [machine(), '\n'.join(lines)]
    print('', *pages, sep='\n\n')
    if arguments.output:
        write(arguments.output, pages, 'threads')
    return 0


if __name__ == '__main__':
    sys.exit(main())
