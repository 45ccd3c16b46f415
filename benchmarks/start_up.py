# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How long it takes from starting Python to the first step.

    python benchmarks/start_up.py
    python benchmarks/start_up.py --output docs/performance.md

Cold: with an empty cache, so that every kernel that the scene needs is compiled. Warm: with the
cache of the run before. Python's bytecode is there either way, as after an installation. Each
start is a process of its own. Its time ends with the first step; that of the processor, which
tells more on a machine that does other things too, is that of the whole process, with what it
compiles while the world steps, and what Python takes to end. `batch` is `rigid_sim batch`, which
records one step, until it has ended; it has to say that it compiles when that takes.
"""

import json
import os
from pathlib import Path
import resource
from statistics import median
import subprocess
import sys
import time
from typing import Any, NamedTuple

from page import heading, line, measure

COLD, WARM = 15.0, 1.0      # s at most
SCENES: dict[str, dict[str, Any]] = {
    'free bodies': {
        'format': 1, 'world': {'contact': 'none'},
        'bodies': [{'name': f'b{k}', 'shape': {'type': 'box', 'size': [0.1, 0.2, 0.3]},
                    'mass': 1.0, 'twist': {'angular': [1, 2, 3]}} for k in range(10)]},
    'balls on a plane': {
        'format': 1,
        'bodies': [{'name': f'b{k}', 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.0,
                    'pose': {'position': [0, 0, 0.1 + 0.2 * k]}} for k in range(10)]
        + [{'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}]},
    'balls and boxes on a plane': {
        'format': 1,
        'bodies': [{'name': f'b{k}', 'mass': 1.0, 'pose': {'position': [0, 0, 0.1 + 0.2 * k]},
                    'shape': {'type': 'box', 'size': [0.2, 0.2, 0.2]} if k % 2 else
                    {'type': 'sphere', 'radius': 0.1}} for k in range(10)]
        + [{'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}]},
}
# Prints what each part of a start takes [s]; the parts are imported from the bottom up.
PARTS = """
import time; marks = [('', time.perf_counter())]
def mark(name): marks.append((name, time.perf_counter()))
import numpy; mark('numpy')
import numba; mark('numba')
import rigid_sim_ros.engine.steps.contact_models; mark('the engine')
import rigid_sim_ros.scene.reader, rigid_sim_ros.world; mark('scenes and world')
import json, sys
world = rigid_sim_ros.world.World.from_dict(json.loads(sys.argv[1])); mark('building')
world.step(); mark('the first step')
print(json.dumps({b[0]: b[1] - a[1] for a, b in zip(marks, marks[1:])}))
"""
STEP = """
import json, sys, time
from rigid_sim_ros import World
World.from_dict(json.loads(sys.argv[1])).step()
print(time.monotonic())
from rigid_sim_ros.kernels.separate import finish
finish()
"""


class Start(NamedTuple):
    """One start."""

    wall: float     # [s] to the time that it printed, or to its end
    cpu: float      # [s] of the processor
    output: str
    errors: str


def start(words: list[str], folder: Path) -> Start:
    """Run Python with a cache below `folder`."""
    environment = {key: value for key, value in os.environ.items()
                   if key not in ('PYTHONDONTWRITEBYTECODE', 'NUMBA_CACHE_DIR')}
    environment['XDG_CACHE_HOME'] = str(folder / 'cache')
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run([sys.executable, *words], env=environment, cwd=folder, check=True,
                          capture_output=True, text=True)
    ended, after = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    if STEP in words:
        ended = float(done.stdout)      # of the clock that all processes share
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Start(ended - begun, cpu, done.stdout, done.stderr)


def _seconds(starts: list[Start]) -> list[str]:
    return [f'{median(one.wall for one in starts):.2f}',
            f'{median(one.cpu for one in starts):.2f}']


def cold_and_warm(below: Path, repeats: int) -> list[str]:
    """Return the lines of a table, a line for each scene and one for the command."""
    lines = heading(['first step of', 'cold [s]', 'of the processor', 'warm [s]',
                     'of the processor'])
    for name, scene in SCENES.items():
        words = ['-c', STEP, json.dumps(scene)]
        lines.append(_row(name, words, below / name, repeats)[0])
    folder = below / 'batch'
    path = below / 'scene.yaml'
    path.write_text(json.dumps(scene), encoding='utf-8')
    words = ['-m', 'rigid_sim_ros', 'batch', str(path), '--duration', '0.001', '--output']
    text, cold = _row(f'{name}, `batch`', words, folder, repeats)
    said = [part for part in cold.errors.replace('\r', '\n').splitlines() if 'compiling' in part]
    print(f'  batch said: {said[-1].strip()}' if said else
          '  batch did not say that it compiles', file=sys.stderr, flush=True)
    return [*lines, text, line(['wanted, at most', COLD, '', WARM, ''])]


def _row(name: str, words: list[str], folder: Path, repeats: int) -> tuple[str, Start]:
    print(f'  {name}', file=sys.stderr, flush=True)
    folder.mkdir()
    is_command = words[-1] == '--output'

    def once(k: int) -> Start:
        return start([*words, f'bag{k}'] if is_command else words, folder)

    cold = once(0)
    warm = [once(k) for k in range(1, repeats + 1)]
    return line([name, *_seconds([cold]), *_seconds(warm)]), cold


def parts(below: Path, repeats: int) -> list[str]:
    """Return a table of what a warm start consists of, of a scene that was started before."""
    name, scene = list(SCENES.items())[-1]
    starts = [start(['-c', PARTS, json.dumps(scene)], below / name) for _ in range(repeats)]
    found = [json.loads(one.output) for one in starts]
    row = {key: median(one[key] for one in found) for key in found[0]}
    rest = median(one.wall for one in starts) - sum(row.values())
    cells = [*row.values(), rest]
    return [*heading([f'a warm start, {name} [s]', *row, 'Python itself']),
            line(['', *(f'{value:.2f}' for value in cells)])]


def main() -> int:
    """Measure, print and write down."""
    return measure('start-up', __doc__, 7, 'warm starts of each', cold_and_warm, parts)


if __name__ == '__main__':
    sys.exit(main())
