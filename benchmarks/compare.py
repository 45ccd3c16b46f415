# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Compare this engine with others, scene by scene: `python benchmarks/compare.py`.

Prints what the contact models reach of what is wanted (contact_quality.py), then for every scene
of peers/scenes.py a row for each engine that is installed: steps a second, the ratio of that to
ours, and figures of quality. Each engine runs in a process of its own, on one thread, with sleep
off; runs of the engines take turns (A B C A B C), and medians and the spread of the speed are
printed. Only stepping is timed, after whatever an engine prepares.

    python benchmarks/compare.py --python venv-of-drake/bin/python --output docs/performance.md

An engine is run with the first of the Pythons that can import it: this one, then those given.
Runners in Rust are built by Cargo, once, which takes minutes.
"""

import argparse
import json
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


def _row(name: str, runs: list[Run], ours: float, columns: list[str]) -> list[str]:
    speeds, share = [one.speed for one in runs], min(one.share for one in runs)
    speed = median(speeds)
    spread = f'{100 * (max(speeds) - min(speeds)) / speed:.0f} %'
    note = '' if share == 1.0 else f' (first {100 * share:.0f} %)'
    cells = [name, f'{speed:.4g}{note}', spread if len(speeds) > 1 else 'one run',
             f'{speed / ours:.3g}' if ours and share == 1.0 else '']
    for key in columns:
        values = [one.figures[key] for one in runs if key in one.figures]
        cells.append(_short(median(values)) if values else '')
    return cells


def table(scene: dict[str, Any], commands: dict[str, Command], repeats: int,
          limit: float) -> list[str]:
    """Run a scene in all engines, in turn; return the lines of a table."""
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
    columns = list(dict.fromkeys(key for of_engine in runs.values() for one in of_engine
                                 for key in one.figures))
    lines = heading([scene['name'], 'steps/s', 'spread', 'to ours', *columns])
    # Parts of a scene cannot be compared: its beginning is often the easy part.
    whole = [one.speed for one in runs.get(OURS, []) if one.share == 1.0]
    ours = median(whole) if whole else 0.0
    for name, of_engine in runs.items():
        if name in failed:
            lines.append(line([name, f'failed: {failed[name]}', *[''] * (2 + len(columns))]))
        else:
            lines.append(line(_row(name, of_engine, ours, columns)))
    return lines


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
        pages.append('\n'.join(lines))
        print('', *lines, sep='\n', flush=True)

    if not arguments.no_quality:
        say(contact_quality.table())
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
    for name in scenes:
        say(table(SCENES[name](), commands, arguments.repeats, arguments.limit))
    if arguments.output:
        write(arguments.output, pages)


if __name__ == '__main__':
    main()
