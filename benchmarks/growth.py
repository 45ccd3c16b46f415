# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How cost and memory grow with the number of bodies.

    python benchmarks/growth.py
    python benchmarks/growth.py --output docs/performance.md --chart docs/pictures/growth.png

Three scenes at several sizes: spheres in a bin whose shape is the same for all sizes, after two
seconds, when deep bins still settle, and after twelve, when all are at rest; the same spheres far
apart without gravity, so that contacts are looked for and none is found; and free bodies in a
world without contacts. Each size runs in a process of its own on one thread, and of its pieces the
median counts. The sizes of a scene take turns with every piece, so that whatever else the machine
does in these minutes, it does to all of them. Time is that of the processor. Sleeping is off, as
it is by default.

Memory, in processes of their own, is what the resident set grew by after a small world of the
same kind was stepped: by the description of the scene (what the file said, kept for bags and for
the page), and by the world that steps. Bodies far apart tell the share of a body, and the bin what
contacts add to it.
"""

import argparse
import ctypes
import gc
import json
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import time
from typing import Any, NamedTuple

import numpy as np
from page import heading, line, machine, write

from rigid_sim_ros import World
from rigid_sim_ros.scene import scene_from_dict

RADIUS = 0.1
FLAT = 1.5      # how much more the dearest size may cost than the cheapest
BODY, CONTACT = 2000, 1000      # bytes at most
LEAST = 1000    # bodies whose memory is more than a few pages
SMALL = 300     # bodies of a world that is numbered by place and cut, as large ones are
SETTLING, RESTING = 480, 2880   # steps after which a bin still settles, and is at rest
PIECE = 0.02    # s of a piece that is timed, at least
TURNS = 45      # pieces of each size
BATCHES = (1, 10, 100)  # steps of free bodies in one call
# What keeps a library from using more than one thread.
ONE_THREAD = dict.fromkeys(('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'NUMBA_NUM_THREADS'), '1')
# glibc: arrays get pages of their own, in place of what was left over from reading the scene.
OWN_PAGES = {'MALLOC_MMAP_THRESHOLD_': '4096'}


def _sphere(k: int, place: np.ndarray) -> dict[str, Any]:
    return {'name': f'b{k}', 'shape': {'type': 'sphere', 'radius': RADIUS}, 'mass': 4.2,
            'pose': {'position': place.tolist()}}


def _in_rows(n: int, distance: float) -> np.ndarray:
    """Return places in a block about as high as wide, which stands on z = 0 amid x and y."""
    side = round(n ** (1 / 3))
    k = np.arange(n)
    grid = np.stack([k % side - (side - 1) / 2, k // side % side - (side - 1) / 2,
                     k // side ** 2 + 0.5], axis=1)
    return distance * grid


def _walls(width: float) -> list[dict[str, Any]]:
    normals = ((0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
    return [{'name': f'wall{k}', 'fixed': True,
             'shape': {'type': 'plane', 'normal': normal,
                       'offset': 0.0 if normal[2] else -width / 2}}
            for k, normal in enumerate(normals)]


def in_a_bin(n: int) -> dict[str, Any]:
    """Return spheres that fall into a bin by a tenth of their height."""
    rng = np.random.default_rng(2)
    places = _in_rows(n, 2.1 * RADIUS) + rng.uniform(-0.004, 0.004, (n, 3)) + (0, 0, 0.01)
    width = 2.1 * RADIUS * round(n ** (1 / 3))
    return {'format': 1, 'world': {'step': 1 / 240, 'contact': 'timestep'},
            'bodies': [_sphere(k, place) for k, place in enumerate(places)] + _walls(width)}


def apart(n: int) -> dict[str, Any]:
    """Return spheres that turn where they are, out of each other's reach."""
    places = _in_rows(n, 10.0 * RADIUS)
    spheres = [_sphere(k, place) | {'twist': {'angular': [0.1, 1.0, 0.2]}}
               for k, place in enumerate(places)]
    return {'format': 1, 'bodies': spheres + _walls(10.0 * RADIUS * (round(n ** (1 / 3)) + 1)),
            'world': {'step': 1 / 240, 'contact': 'timestep', 'gravity': [0, 0, 0]}}


def free(n: int) -> dict[str, Any]:
    """Return tumbling boxes in free fall."""
    rng = np.random.default_rng(1)
    return {'format': 1, 'world': {'step': 1 / 240, 'contact': 'none'},
            'bodies': [{'name': f'b{k}', 'shape': {'type': 'box', 'size': [0.2, 0.3, 0.4]},
                        'mass': 24.0, 'twist': {'angular': rng.normal(0, 3.0, 3).tolist()}}
                       for k in range(n)]}


class Case(NamedTuple):
    """A kind of scene, and how it is run."""

    name: str
    make: Any
    sizes: tuple[int, ...]
    after: tuple[int, ...]  # steps before it is measured, for the limit the last of them
    batches: tuple[int, ...]

    def rows(self) -> list[tuple[int, int]]:
        """Return when each line of its table was measured, and how many steps a call had."""
        return [(after, count) for after in self.after for count in self.batches]


CASES = {
    'bin': Case('spheres at rest in a bin', in_a_bin, (100, 300, 1000, 3000, 10_000),
                (SETTLING, RESTING), (10,)),
    'apart': Case('the same spheres far apart', apart, (100, 1000, 3000, 10_000), (10,), (10,)),
    'free': Case('free bodies', free, (100, 1000, 10_000, 100_000), (10,), BATCHES),
}


# --- in the process of one size ---------------------------------------------------------------

def resident() -> int:
    """Return the bytes of memory that this process holds, without what it could give back."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path('/proc/self/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE')


class Timed:
    """One size that steps when asked."""

    def __init__(self, case: Case, n: int) -> None:
        self.world, self.n = World.from_dict(case.make(n)), n
        self.done = 0

    def begin(self, after: int, count: int) -> int:
        """Step until `after` steps are done, and return how many calls a piece has."""
        self.world.step(max(after - self.done, 0))
        self.done = max(after, self.done)
        calls = 1
        while self._seconds(calls, count) < PIECE and calls < 100_000:
            calls *= 2
        return calls

    def piece(self, calls: int, count: int) -> float:
        """Return what a body and step cost [ns], after a call that nobody counts."""
        self.world.step(count)
        return 1e9 * self._seconds(calls, count) / (calls * count * self.n)

    def report(self) -> dict[str, float]:
        """Return how it stands at the end."""
        report = self.world.contact_report()
        return {'contacts': report.contacts / self.n, 'residual': report.residual}

    def _seconds(self, calls: int, count: int) -> float:
        start = time.process_time()
        for _ in range(calls):
            self.world.step(count)
        return time.process_time() - start


def answer(case: Case, n: int) -> None:
    """Do what the lines of standard input ask for, each with a line, until they end."""
    timed = Timed(case, n)
    for asked in sys.stdin:
        name, *arguments = asked.split()
        print(json.dumps(getattr(timed, name)(*map(int, arguments))), flush=True)


def memory_of(case: Case, n: int) -> dict[str, Any]:
    """Measure the memory of one size, bytes a body."""
    small = World.from_dict(case.make(SMALL))
    small.step(10)
    data = case.make(n)
    before = resident()
    scene = scene_from_dict(data)
    described = resident()
    world = World(scene)
    world.step(case.after[0])
    stepped = resident()
    # The arrays that the world shares with its scene belong to what steps.
    shared = size_of((scene.model, scene.state, scene.shapes))
    return {'contacts': world.contact_report().contacts / n,
            'description': (described - before - shared) / n,
            'world': (stepped - described + shared) / n}


def size_of(arrays: Any) -> int:
    """Return the bytes of all arrays in tuples of tuples."""
    if isinstance(arrays, tuple):
        return sum(map(size_of, arrays))
    return arrays.nbytes if isinstance(arrays, np.ndarray) else 0


# --- in the process that asks -----------------------------------------------------------------

Results = dict[tuple[str, str, int], dict[str, Any]]    # by what, scene and size


def command(what: str, name: str, n: int) -> list[str]:
    """Return what runs one size in a process of its own, and say so."""
    print(f'  {what}: {CASES[name].name}, {n}', file=sys.stderr, flush=True)
    return [sys.executable, __file__, '--run', what, name, str(n)]


class Size:
    """A size in a process of its own, which takes its turn when asked."""

    def __init__(self, name: str, n: int) -> None:
        self.process = subprocess.Popen(command('time', name, n), stdin=subprocess.PIPE, text=True,
                                        stdout=subprocess.PIPE, env=os.environ | ONE_THREAD)

    def ask(self, *words: object) -> Any:
        """Return the answer to a line."""
        assert self.process.stdin is not None and self.process.stdout is not None
        print(*words, file=self.process.stdin, flush=True)
        return json.loads(self.process.stdout.readline())

    def end(self) -> None:
        """Let the process end."""
        self.process.communicate()


def times_of(name: str, numbers: list[int], turns: int) -> Results:
    """Measure what a body and step cost at these sizes, in turn."""
    case, sizes = CASES[name], [Size(name, n) for n in numbers]
    times: dict[str, list[list[float]]] = {}
    for after, count in case.rows():
        calls = [size.ask('begin', after, count) for size in sizes]
        rounds = [[size.ask('piece', k, count) for size, k in zip(sizes, calls, strict=True)]
                  for _ in range(turns)]
        times[f'{after}/{count}'] = [list(pieces) for pieces in zip(*rounds, strict=True)]
    found: Results = {
        ('time', name, n): {'times': {row: times[row][k] for row in times}} | size.ask('report')
        for k, (n, size) in enumerate(zip(numbers, sizes, strict=True))}
    for size in sizes:
        size.end()
    return found


def measure(turns: int, most: int) -> Results:
    """Measure all sizes up to `most`, in turn."""
    chosen = {name: [n for n in case.sizes if n <= most] for name, case in CASES.items()}
    results: Results = {}
    for name, numbers in chosen.items():
        results |= times_of(name, numbers, turns)
    for name, n in [(name, n) for name, numbers in chosen.items() for n in numbers if n >= LEAST]:
        done = subprocess.run(command('memory', name, n), check=True, capture_output=True,
                              text=True, env=os.environ | ONE_THREAD | OWN_PAGES)
        results['memory', name, n] = json.loads(done.stdout.splitlines()[-1])
    return results


def cost(results: Results, name: str, n: int, row: tuple[int, int]) -> float:
    """Return the median cost of a body and step [ns] of a row."""
    return median(results['time', name, n]['times'][f'{row[0]}/{row[1]}'])


def sizes(results: Results, what: str, name: str) -> list[int]:
    """Return the sizes of a kind of scene that were measured."""
    return [n for found, case, n in results if (found, case) == (what, name)]


def cost_table(results: Results) -> str:
    """Return the table of costs: a column for each size, lines for each kind of scene."""
    columns = sorted({n for name in CASES for n in sizes(results, 'time', name)})
    lines = heading(['ns a body and step', *columns, 'largest / smallest'])
    for name, case in CASES.items():
        measured = sizes(results, 'time', name)

        def across(title: str, cells: dict[int, str], last: str = '') -> str:
            return line([title, *(cells.get(n, '') for n in columns), last])

        for after, count in case.rows():
            row = {n: cost(results, name, n, (after, count)) for n in measured}
            text = f'{case.name}, ' + ('1 step' if count == 1 else f'{count} steps') + ' a call'
            if name == 'bin':
                text += f', after {after / 240:.0f} s'
            limit = f' (at most {FLAT})' if after == case.after[-1] else ', still settling'
            lines.append(across(text, {n: f'{value:.3g}' if value < 100 else f'{value:.0f}'
                                       for n, value in row.items()},
                                f'{max(row.values()) / min(row.values()):.2f}{limit}'))
        if name == 'bin':
            found = {n: results['time', name, n] for n in measured}
            lines.append(across('contacts a body', {
                n: f'{one["contacts"]:.2f}' for n, one in found.items()}))
            lines.append(across('velocity that a sweep changes at the end [m/s]', {
                n: f'{one["residual"]:.0e}' for n, one in found.items()}))
    return '\n'.join(lines)


def shares(results: Results) -> tuple[list[int], list[float], list[float]]:
    """Return sizes with the bytes of a body and of a contact in a world that steps."""
    common = [n for n in sizes(results, 'memory', 'bin') if ('memory', 'apart', n) in results]
    bodies = [results['memory', 'apart', n]['world'] for n in common]
    contacts = [(results['memory', 'bin', n]['world'] - body)
                / results['memory', 'bin', n]['contacts']
                for n, body in zip(common, bodies, strict=True)]
    return common, bodies, contacts


def memory_table(results: Results) -> str:
    """Return the table of memory."""
    common, bodies, contacts = shares(results)
    lines = heading(['bytes', *common, 'at most'])
    in_bin = [results['memory', 'bin', n]['world'] for n in common]
    count = results['memory', 'bin', common[-1]]['contacts']
    lines.append(line([f'a body in the bin, with its {count:.1f} contacts',
                       *(f'{b:.0f}' for b in in_bin), f'{BODY + count * CONTACT:.0f}']))
    lines.append(line(['a body far apart', *(f'{b:.0f}' for b in bodies), BODY]))
    lines.append(line(['what a contact adds', *(f'{b:.0f}' for b in contacts), CONTACT]))
    for text, name, key, limit in (('a free body', 'free', 'world', BODY),
                                   ('the description of a body', 'bin', 'description', '')):
        row = [f'{results["memory", name, n][key]:.0f}'
               if ('memory', name, n) in results else '' for n in common]
        lines.append(line([text, *row, limit]))
    return '\n'.join(lines)


def draw(results: Results, path: Path) -> None:
    """Draw costs and memory against the number of bodies."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from rigid_sim_ros.plots.diagram import COLORS
    with rc_context({'font.size': 10, 'axes.spines.top': False, 'axes.spines.right': False,
                     'axes.grid': True, 'grid.color': '#d9d9d9', 'grid.linewidth': 0.6,
                     'legend.frameon': False, 'svg.fonttype': 'none'}):
        figure = Figure(figsize=(10.5, 4.2), layout='constrained')
        left, right = figure.subplots(1, 2)
        kinds = zip(CASES.items(), COLORS, ('o', 's', '^'), strict=False)
        for (name, case), color, marker in kinds:
            x = sizes(results, 'time', name)
            y = [cost(results, name, n, case.rows()[-1]) for n in x]
            left.plot(x, y, color=color, marker=marker, label=case.name)
            left.fill_between(x, min(y), FLAT * min(y), color=color, alpha=0.15, linewidth=0)
        left.set(xscale='log', yscale='log', xlabel='bodies',
                 ylabel='cost of a body and step [ns]',
                 title=f'Bands: {FLAT} times the cheapest size')
        left.legend(loc='upper left', bbox_to_anchor=(0.02, 0.8))     # between the lines
        x, bodies, contacts = shares(results)
        for y, limit, label, color, marker in (
                (bodies, BODY, 'a body', COLORS[0], 'o'),
                (contacts, CONTACT, 'a contact', COLORS[3], 's')):
            right.plot(x, np.array(y) / 1e3, color=color, marker=marker, label=label)
            right.axhline(limit / 1e3, color=color, linestyle='dashed', linewidth=1.0,
                          label=f'{label}: at most')
        right.set(xscale='log', ylim=(0.0, None), xlabel='bodies', ylabel='resident memory [kB]',
                  title='Memory of a world that steps')
        right.legend(frameon=True, framealpha=0.9, edgecolor='none')
        figure.savefig(path, dpi=110)


def main() -> int:
    """Measure, print, draw and write down."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--turns', type=int, default=TURNS, help=f'pieces of a size, {TURNS}')
    parser.add_argument('--most', type=int, default=100_000, help='bodies at most')
    parser.add_argument('--chart', type=Path, help='a .png or .svg file to draw into')
    parser.add_argument('--output', type=Path, help='a Markdown file to write, besides')
    parser.add_argument('--run', nargs=3, metavar=('WHAT', 'SCENE', 'N'),
                        help='one size, as JSON')
    arguments = parser.parse_args()
    if arguments.run:
        what, name, n = arguments.run
        if what == 'time':
            answer(CASES[name], int(n))
        else:
            print(json.dumps(memory_of(CASES[name], int(n))))
        return 0
    if arguments.most < LEAST:
        parser.error(f'argument --most: {arguments.most}, must be at least {LEAST}')
    where = machine()
    print(where, flush=True)
    results = measure(arguments.turns, arguments.most)
    pages = [where, cost_table(results), memory_table(results)]
    print('', *pages[1:], sep='\n\n')
    if arguments.chart:
        draw(results, arguments.chart)
    if arguments.output:
        write(arguments.output, pages, 'growth')
    return 0


if __name__ == '__main__':
    sys.exit(main())
