# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compare this engine with others, scene by scene: `python benchmarks/compare.py`.

Prints what the contact models reach of what is wanted (contact_quality.py), then for every scene
of peers/scenes.py a row for each engine that is installed: steps a second, the ratio of that to
ours, and figures of quality. Each engine runs in a process of its own, on one thread, with sleep
off; runs of the engines take turns (A B C A B C), and medians and the spread of the speed are
printed. Only stepping is timed, after whatever an engine prepares. The file that is written has
the same figures in three tables: one of speeds and two of quality, a column for each scene.

    python benchmarks/compare.py --python venv-of-drake/bin/python --output docs/performance.md

An engine is run with the first of the Pythons that can import it: this one, then those given.
Runners in Rust are built by Cargo, once, which takes minutes.
"""

import argparse
import json
import math
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
from typing import Any, NamedTuple

import contact_quality  # which puts peers/ on the path of modules
from engines import Command, Engine, ENGINES, find, HERE, ONE_THREAD, OURS
from figures import figures
import numpy as np
from page import heading, line, machine, write
from scenes import SCENES


_A_TABLE = 5    # scenes


class Run(NamedTuple):
    """One run of one scene in one engine."""

    speed: float  # steps a second
    share: float  # of the scene's steps that were done within the limit
    figures: dict[str, float]


def run(command: Command, scene: dict[str, Any], folder: Path, limit: float) -> Run | str:
    """Run a scene; return what came of it, or what went wrong."""
    source, output = folder / 'scene.json', folder / 'looks'
    source.write_text(json.dumps(scene), encoding='utf-8')
    # A single step may take longer than the limit.
    patience = 120.0 + 3.0 * limit
    try:
        done = subprocess.run([*command.words, str(source), str(output), str(limit),
                               *command.arguments], capture_output=True, text=True, check=False,
                              env=os.environ | ONE_THREAD, timeout=patience)
    except subprocess.TimeoutExpired:
        return f'not done after {patience:.0f} s'
    if done.returncode < 0:
        return f'ended by signal {-done.returncode}'
    if done.returncode != 0:
        return (done.stderr.strip().splitlines() or [f'exit code {done.returncode}'])[-1]
    report = json.loads(done.stdout.strip().splitlines()[-1])
    looks = np.fromfile(output, dtype='<f8').reshape(-1, len(scene['bodies']), 13)
    if not np.isfinite(looks).all():
        return 'numbers that are not finite'
    share = report['steps'] / scene['steps']
    # Half a scene has no end to judge.
    found = figures(scene, looks, report['ground']) if share == 1.0 else {}
    return Run(report['steps'] / report['seconds'], share, found)


def _short(value: float) -> str:
    return f'{value:.1e}' if value and (abs(value) < 0.01 or abs(value) >= 1e4) else f'{value:.3g}'


class Result(NamedTuple):
    """What an engine makes of a scene: medians over its runs."""

    speed: float  # steps a second; 0: it failed
    spread: float  # (largest - smallest) / median of the speeds; NaN of one run
    share: float  # of the scene's steps that were done within the limit
    figures: dict[str, float]
    failure: str = ''


def _result(runs: list[Run], failure: str) -> Result:
    if failure:
        return Result(0.0, 0.0, 0.0, {}, failure)
    found = [one.speed for one in runs]
    keys = dict.fromkeys(key for one in runs for key in one.figures)
    spread = (max(found) - min(found)) / median(found) if len(found) > 1 else math.nan
    return Result(median(found), spread, min(one.share for one in runs), {
        key: median(one.figures[key] for one in runs if key in one.figures) for key in keys})


def results(scene: dict[str, Any], commands: dict[str, Command], repeats: int,
            limit: float) -> dict[str, Result]:
    """Run a scene in all engines, in turn; return what came of it, by engine."""
    runs: dict[str, list[Run]] = {name: [] for name in commands}
    failed: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(repeats):
            for name in [name for name in commands if name not in failed]:
                print(f'  {scene["name"]}: {name}', file=sys.stderr, flush=True)
                one = run(commands[name], scene, Path(folder), limit)
                if isinstance(one, str):
                    failed[name] = one
                else:
                    runs[name].append(one)
    return {name: _result(runs[name], failed.get(name, '')) for name in commands}


def _ratio(found: dict[str, Result], name: str) -> float:
    """Return our speed over that of another engine, 0 where one of them did not finish."""
    # Parts of a scene cannot be compared: its beginning is often the easy part.
    ours, other = found.get(OURS), found[name]
    return ours.speed / other.speed if ours and ours.share == other.share == 1.0 else 0.0


def _spread(spread: float) -> str:
    return 'one run' if math.isnan(spread) else f'{100 * spread:.0f} %'


def _speed(one: Result) -> str:
    if one.failure:
        return 'failed'
    return f'{one.speed:.4g}' + ('' if one.share == 1.0 else f' (first {100 * one.share:.0f} %)')


def _columns(found: dict[str, Result]) -> list[str]:
    return list(dict.fromkeys(key for one in found.values() for key in one.figures))


def _figures(one: Result, columns: list[str]) -> list[str]:
    return [_short(one.figures[key]) if key in one.figures else '' for key in columns]


def table(title: str, found: dict[str, Result]) -> list[str]:
    """Return the lines of a table of one scene."""
    columns = _columns(found)
    lines = heading([title, 'steps/s', 'spread', 'to ours', *columns])
    for name, one in found.items():
        if one.failure:
            lines.append(line([name, f'failed: {one.failure}', *[''] * (2 + len(columns))]))
        else:
            ratio = _ratio(found, name)
            lines.append(line([name, _speed(one), _spread(one.spread),
                               f'{1 / ratio:.3g}' if ratio else '', *_figures(one, columns)]))
    return lines


def _ratios(everything: dict[str, dict[str, Result]], title: str, chosen: list[str]) -> str:
    """Return a line of our speed over the fastest of some engines, scene by scene."""
    cells = []
    for found in everything.values():
        ratios = [ratio for name in chosen if name in found and (ratio := _ratio(found, name))]
        cells.append(f'{min(ratios):.3g}' if ratios else '')
    return line([title, *cells])


def speeds(everything: dict[str, dict[str, Result]], engines: list[str]) -> list[str]:
    """Return the lines of a table of speeds: a row for each engine, a column for each scene."""
    lines = heading(['steps/s', *everything])
    lines += [line([name, *(_speed(found[name]) for found in everything.values())])
              for name in engines]
    spreads = [max(one.spread for one in found.values()) for found in everything.values()]
    return [*lines, line(['largest spread', *map(_spread, spreads)]),
            _ratios(everything, 'ratio to Rapier', ['Rapier']),
            _ratios(everything, 'ratio to the fastest other', [
                name for name in engines if name != OURS])]


def quality(everything: dict[str, dict[str, Result]], engines: list[str]) -> list[list[str]]:
    """Return tables of the figures of quality: a column for each scene, five to a table."""
    judged = {name: found for name, found in everything.items() if _columns(found)}
    pages, names = [], list(judged)
    for first in range(0, len(names), _A_TABLE):
        some = names[first:first + _A_TABLE]
        lines = heading(['', *(f'{name}: ' + ' / '.join(_columns(judged[name])) for name in some)])
        for engine in engines:
            cells = [_figures(judged[name][engine], _columns(judged[name])) for name in some]
            lines.append(line([engine, *(' / '.join(value or '-' for value in values)
                                         if any(values) else ''
                                         for values in cells)]))
        pages.append(lines)
    return pages


def missing(engine: Engine) -> str:
    """Return what to say of an engine that is not there."""
    return f'{engine.name}: not installed ({engine.install})'


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--scenes', default='', help='names, separated by commas; default: all')
    parser.add_argument('--engines', default='', help='names, separated by commas; default: all')
    parser.add_argument('--repeats', type=int, default=3, help='runs of each, 3')
    parser.add_argument('--limit', type=float, default=60.0,
                        help='seconds of stepping after which a run ends, 60')
    parser.add_argument('--python', action='append', default=[],
                        help='another Python that may have engines; may be given again')
    parser.add_argument('--target', type=Path, default=HERE / 'target',
                        help='where Cargo builds')
    parser.add_argument('--no-quality', action='store_true', help='the comparison only')
    parser.add_argument('--output', type=Path, help='a Markdown file to write, besides')
    return parser.parse_args()


def _chosen(names: str, known: list[str]) -> list[str]:
    chosen = [name.strip() for name in names.split(',') if name.strip()] or known
    for name in chosen:
        if name not in known:
            sys.exit(f"'{name}' is none of: {', '.join(known)}")
    return chosen


def main() -> None:
    """Measure, print, and write down."""
    arguments = _arguments()
    names = _chosen(arguments.engines, [engine.name for engine in ENGINES])
    scenes = _chosen(arguments.scenes, list(SCENES))
    pages = [machine()]
    print(pages[0], flush=True)

    def say(lines: list[str]) -> None:
        print('', *lines, sep='\n', flush=True)

    def note(lines: list[str]) -> None:
        pages.append('\n'.join(lines))

    if not arguments.no_quality:
        cases = contact_quality.table()
        say(cases)
        note(cases)
    commands: dict[str, Command] = {}
    said = []
    for engine in ENGINES:
        if engine.name in names:
            found = find(engine, [sys.executable, *arguments.python], arguments.target)
            if found is None:
                said.append(missing(engine))
            else:
                commands[engine.name] = found
                said.append(f'{engine.name} {found.version}')
    say(['; '.join(said) + '.'])
    note(['; '.join(said) + '.'])
    everything = {}
    for name in scenes:
        scene = SCENES[name]()
        found = results(scene, commands, arguments.repeats, arguments.limit)
        everything[scene['name']] = found
        say(table(scene['name'], found))
    for lines in [speeds(everything, list(commands)), *quality(everything, list(commands))]:
        note(lines)
    if arguments.output:
        write(arguments.output, pages)


if __name__ == '__main__':
    main()
