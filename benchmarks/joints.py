# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Accuracy and speed of worlds with joints, beside other engines.

    python benchmarks/joints.py
    python benchmarks/joints.py --output docs/joints.md
    python benchmarks/joints.py --cases gear,limit --engines MuJoCo

Accuracy is measured against integration in minimal coordinates by an eighth-order method, or
against formulas (peers/joint_cases.py). Speed is steps of 1 ms a second of processor time of one
thread, the best of several turns in which the engines follow one another, from the same state each
time. What an accuracy costs is measured on the same motions at several steps, of the methods of
fourth order. Engines that this Python does not have are named, and left out.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
import math
from pathlib import Path
import sys
import time
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent / 'peers'))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))

from engine.jointed import hanging, panda
from joint_cases import CASES, Figures, KNOWN, Make, Ours, truth
from joint_scenes import humanoid, pendulums, quadruped
import numpy as np
from page import heading, line, machine, write

from rigid_sim_ros import World

OURS = 'rigid_sim_ros'
FOURTH = 'rigid_sim_ros symplectic4'
STEPS = (1e-3, 4e-3)
# Methods of fourth order, and steps at which what they cost is compared.
PRICED = (FOURTH, 'MuJoCo RK4')
PRICED_STEPS = (1e-3, 2e-3, 4e-3, 1e-2)
# What makes an engine at least as fast as it should be.
GOAL = 'MuJoCo implicitfast'


class Peer(NamedTuple):
    """Another engine."""

    name: str
    module: str     # that Python imports
    install: str
    runner: str     # the module here that drives it


PEERS = (
    Peer('MuJoCo', 'mujoco', 'pip install mujoco', 'jointed_mujoco'),
    Peer('Drake', 'pydrake', 'pip install drake', 'jointed_drake'),
    Peer('Pinocchio', 'pinocchio', 'pip install pin', 'jointed_pinocchio'),
)
# The integration of a chain of 50 by Pinocchio takes long; of the loop it knows nothing.
CHECKED = ('pendulum', 'double', 'Panda')


def composed(scene: Any) -> Ours:
    """Return a world of the method of fourth order, which is one without contact."""
    if scene.contact != 'none':
        raise NotImplementedError
    return Ours(replace(scene, integrator='symplectic4'))


def engines(chosen: list[str]) -> tuple[dict[str, Make], list[str]]:
    """Return how to put a scene into each engine that is there, and what to say of them all."""
    found: dict[str, Make] = {OURS: Ours, FOURTH: composed}
    said = []
    for peer in PEERS:
        if peer.name not in chosen:
            continue
        if find_spec(peer.module) is None:
            said.append(f'{peer.name}: not installed ({peer.install})')
            continue
        runner = import_module(peer.runner)
        said.append(f'{peer.name} {runner.VERSION}')
        found |= runner.ENGINES
    return found, said


def _short(value: float) -> str:
    return f'{value:.1e}' if value else '0'


def outcome(run: Callable[[Make, float], Figures], make: Make, h: float) -> Figures | str:
    """Return the figures of a case in an engine, or why there are none."""
    try:
        found = run(make, h)
    except NotImplementedError:
        return '-'
    except (ArithmeticError, np.linalg.LinAlgError):    # the latter from poses that are no numbers
        return 'blew up'
    return found if all(map(math.isfinite, found.values())) else 'blew up'


def _reached(wanted: float | None, found: Figures | str, key: str) -> str:
    if wanted is None:
        return ''
    return 'yes' if not isinstance(found, str) and found[key] <= wanted else 'NO'


def accuracy(names: list[str], makes: dict[str, Make], h: float) -> list[str]:
    """Return the lines of a table: a row for each figure, a column for each engine."""
    judged = h == STEPS[0]
    lines = heading([f'steps of {1e3 * h:g} ms', *(['wanted'] if judged else []), *makes,
                     *(['reached'] if judged else [])])
    for name in names:
        found = {}
        for engine, make in makes.items():
            print(f'  {1e3 * h:g} ms, {name}: {engine}', file=sys.stderr, flush=True)
            found[engine] = outcome(CASES[name].run, make, h)
        keys = dict.fromkeys(key for one in found.values() if not isinstance(one, str)
                             for key in one)
        for key in keys:
            wanted = CASES[name].wanted.get(key)
            cells = [one if isinstance(one, str) else _short(one[key]) for one in found.values()]
            if judged:
                cells = ['' if wanted is None else f'{wanted:g}', *cells,
                         _reached(wanted, found[OURS], key)]
            lines.append(line([f'{name}: {key}', *cells]))
    return lines


# Scenes whose speed is measured: how, time before, steps a turn.
SPEEDS: dict[str, tuple[Callable[[], World], int, int]] = {
    'Panda, free': (panda, 500, 4000),
    'quadruped, 4 contacts': (lambda: World.from_dict(quadruped()), 2000, 2000),
    'humanoid, 8 contacts': (lambda: World.from_dict(humanoid()), 2000, 1000),
    'chain of 50': (lambda: hanging(50, 0.1, 0.1, 0.01, end=10.0), 500, 500),
    '100 double pendulums': (lambda: World.from_dict(pendulums()), 500, 500),
}


def _seconds(engine: Any, saved: Any, steps: int) -> float:
    """Return the processor time of some steps from a saved state [s]."""
    engine.restore(saved)
    begun = time.thread_time()
    engine.step(steps)
    return time.thread_time() - begun


def speed(name: str, makes: dict[str, Make], repeats: int) -> dict[str, tuple[float, str]]:
    """Return steps/s of each engine and what else is to say, of one scene."""
    scene, before, steps = SPEEDS[name]
    ready, found = {}, {}
    for engine, make in makes.items():
        print(f'  speed, {name}: {engine}', file=sys.stderr, flush=True)
        try:
            one = make(scene().scene)
            one.step(before)
            ready[engine] = (one, one.save())
        except (NotImplementedError, ArithmeticError) as error:
            found[engine] = (0.0, 'blew up' if isinstance(error, ArithmeticError) else '-')
    times: dict[str, list[float]] = {engine: [] for engine in ready}
    for _ in range(repeats):
        for engine, (one, saved) in ready.items():
            times[engine].append(_seconds(one, saved, steps))
    for engine, values in times.items():
        found[engine] = (steps / min(values), '')
    return found


def speeds(makes: dict[str, Make], repeats: int) -> list[str]:
    """Return the lines of a table: a row for each engine, a column for each scene."""
    found = {name: speed(name, makes, repeats) for name in SPEEDS}
    lines = heading(['steps/s', *found])
    for engine in makes:
        cells = [one[engine] for one in found.values()]
        lines.append(line([engine, *(said or f'{value:.3g}' if value < 1000 else f'{value:.0f}'
                                     for value, said in cells)]))
    if GOAL in makes:
        ratios = [one[OURS][0] / one[GOAL][0] if one[GOAL][0] else math.nan
                  for one in found.values()]
        lines.append(line([f'{OURS} to {GOAL}, wanted 1', *(f'{ratio:.2f}' for ratio in ratios)]))
    return lines


def price(name: str, make: Make, h: float, repeats: int) -> tuple[float, float]:
    """Return the largest error of a known motion, and processor time of a second of it [s]."""
    one, steps = KNOWN[name], round(KNOWN[name].every / h)
    engine, worst, times = make(one.scene(h).scene), 0.0, []
    start = engine.save()
    for _ in range(repeats):
        engine.restore(start)
        spent = 0.0
        for true in truth(name)[1][1:]:
            begun = time.thread_time()
            engine.step(steps)
            spent += time.thread_time() - begun
            worst = max(worst, float(np.linalg.norm(one.read(engine) - true)))
        times.append(spent / one.end)
    return worst, min(times)


def prices(names: list[str], makes: dict[str, Make], repeats: int) -> list[str]:
    """Return the lines of a table: what the methods of fourth order cost, at several steps."""
    chosen = {engine: makes[engine] for engine in PRICED if engine in makes}
    lines = heading(['largest error, at ms of a processor a second', 'step [ms]', *chosen])
    for name in names:
        for h in PRICED_STEPS if name in KNOWN and 'four-bar' not in name else ():
            cells = []
            for engine, make in chosen.items():
                print(f'  price, {name}, {1e3 * h:g} ms: {engine}', file=sys.stderr, flush=True)
                try:
                    error, spent = price(name, make, h, repeats)
                    cells.append(f'{_short(error)}, {1e3 * spent:.3g}')
                except ArithmeticError:
                    cells.append('blew up')
            lines.append(line([f'{name}: {KNOWN[name].unit}', f'{1e3 * h:g}', *cells]))
    return lines


def truths() -> list[str]:
    """Return a sentence: how far Pinocchio is from the motions that are held for true."""
    check = import_module('jointed_pinocchio').disagreement
    found = []
    for name, one in KNOWN.items():
        if name.startswith(CHECKED):
            print(f'  the truth of {name}', file=sys.stderr, flush=True)
            times, true = truth(name)
            found.append(f'{name} {_short(check(one.scene(1e-3).scene, times, true, one.read))} m')
    return ["From the truth, Pinocchio's accelerations integrated by DOP853 are off by: "
            + ', '.join(found) + '.']


def _chosen(text: str, known: list[str]) -> list[str]:
    """Return the names that begin with one of the words."""
    words = [word.strip() for word in text.split(',') if word.strip()]
    for word in words:
        if not any(name.startswith(word) for name in known):
            sys.exit(f"'{word}' begins none of: {', '.join(known)}")
    return [name for name in known if not words or name.startswith(tuple(words))]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--cases', default='',
                        help='how their names begin, separated by commas; default: all')
    parser.add_argument('--engines', default='', help='peers likewise; default: all')
    parser.add_argument('--repeats', type=int, default=7, help='turns of each speed, 7')
    parser.add_argument('--only', choices=('accuracy', 'speed', 'price'),
                        help='one of the three parts')
    parser.add_argument('--output', type=Path, help='a Markdown file to write, besides')
    return parser.parse_args()


def main() -> int:
    """Measure, print and write down."""
    arguments = _arguments()
    names = _chosen(arguments.cases, list(CASES))
    makes, said = engines(_chosen(arguments.engines, [peer.name for peer in PEERS]))
    pages = [machine(), '; '.join(said) + '.']
    print(*pages, sep='\n\n', flush=True)

    def note(lines: list[str]) -> None:
        pages.append('\n'.join(lines))
        print('', *lines, sep='\n', flush=True)

    if arguments.only in (None, 'speed'):
        note(speeds(makes, arguments.repeats))
    if arguments.only in (None, 'price'):
        note(prices(names, makes, 3))
    if arguments.only in (None, 'accuracy'):
        if any(name.startswith('Pinocchio') for name in makes):
            note(truths())
        for h in STEPS:
            note(accuracy(names, makes, h))
    if arguments.output:
        write(arguments.output, pages, 'joints')
    return 0


if __name__ == '__main__':
    sys.exit(main())
