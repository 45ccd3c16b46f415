# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which laws of mechanics each contact model breaks, on random scenes: `python benchmarks/laws.py`.

    python benchmarks/laws.py                           every law and model, 2000 scenes each
    python benchmarks/laws.py --law energy --model event --scenes 200
    python benchmarks/laws.py --law jointed-order --model none --scenes 500
    python benchmarks/laws.py --law mixed-ground --model event --scenes 200
    python benchmarks/laws.py --law energy --seed 17 --scenes 1 --show    that scene, as JSON
    python benchmarks/laws.py --cases                   the cases that once broke a law

Other engines on the same scenes: `--model mujoco`, `--model bullet`, with a Python that has them
(`pip install numpy mujoco pybullet`; it needs nothing of this package). What an engine cannot
express is left out, and not counted among its scenes.
"""

import argparse
from collections.abc import Iterator
from importlib import import_module
import json
from multiprocessing import get_context
from pathlib import Path
import sys
import time

sys.path.insert(0, str(Path(__file__).resolve().parent / 'peers'))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))

from laws.book import builder, EVERY_LAW, judge, LAWS, scene
from laws.cases import Case, CASES
from laws.motion import Build, Verdict
from laws.scenes import with_model

WORST = 5  # seeds that are listed
PEERS = ('mujoco', 'bullet')


def engine(model: str, substeps: int) -> Build:
    """Return how a scene gets into a contact model of ours, or into another engine."""
    if model in PEERS:
        return import_module(f'laws_{model}').Run
    return builder(model, substeps)


def run(law: str, model: str, seed: int, substeps: int) -> tuple[int, Verdict | None]:
    """Ask a law of one scene; what a scene raises is a breach that says so."""
    try:
        return seed, judge(law, seed, engine(model, substeps))
    except NotImplementedError:
        return seed, None
    except Exception as error:
        return seed, Verdict(float('inf'), 0.0, f'{type(error).__name__}: {error}')


def _excess(verdict: Verdict) -> float:
    ratio = verdict.figure / verdict.allowed if verdict.allowed > 0 else float('inf')
    return ratio if ratio == ratio else float('inf')


def table(laws: list[str], models: list[str], seeds: range, substeps: int, jobs: int,
          limit: float) -> Iterator[str]:
    """Yield a line for each law and model: breaches, scenes, time, and the worst seeds."""
    yield '| law | model | breaches | scenes | CPU s | worst seeds |'
    yield '| --- | --- | ---: | ---: | ---: | --- |'
    context = get_context('fork')
    for law in laws:
        for model in models:
            if model not in EVERY_LAW[law].models + (PEERS if law in LAWS else ()):
                continue
            start, found = time.process_time(), []
            tasks = ((law, model, seed, substeps) for seed in seeds)
            if jobs > 1:
                with context.Pool(jobs) as pool:
                    found = pool.starmap(run, list(tasks), chunksize=20)
            else:
                for task in tasks:
                    found.append(run(*task))
                    if time.process_time() - start > limit:
                        break
            found = [one for one in found if one[1] is not None]
            broken = sorted((one for one in found if one[1].breach),
                            key=lambda one: -_excess(one[1]))
            listed = '; '.join(
                f'{seed}: {one.figure:.2g} > {one.allowed:.2g} {one.what}'
                for seed, one in broken[:WORST])
            yield (f'| {law} | {model} | {len(broken)} | {len(found)} '
                   f'| {time.process_time() - start:.0f} | {listed} |')


def cases(models: list[str], letters: str) -> Iterator[str]:
    """Yield a line for each case and model: its figure, and what is allowed."""
    yield '| | case | model | figure | allowed | of what | |'
    yield '| --- | --- | --- | ---: | ---: | --- | --- |'
    for case in CASES:
        for model in case.models:
            if model in models and case.letter in letters:
                yield _case(case, model)


def _case(case: Case, model: str) -> str:
    try:
        found = case.measure(model)
    except Exception as error:
        return f'| {case.letter} | {case.name} | {model} | | | {error} | BREACH |'
    return (f'| {case.letter} | {case.name} | {model} | {found.figure:.3g} | {found.allowed:.2g} '
            f"| {found.what} | {'BREACH' if found.breach else ''} |")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--law', action='append', choices=EVERY_LAW, help='a law; may be repeated')
    parser.add_argument('--model', action='append', help='a contact model; may be repeated')
    parser.add_argument('--scenes', type=int, default=2000, help='a law')
    parser.add_argument('--seed', type=int, default=0, help='of the first scene')
    parser.add_argument('--substeps', type=int, default=4, help='of timestep')
    parser.add_argument('--jobs', type=int, default=1, help='processes')
    parser.add_argument('--limit', type=float, default=float('inf'),
                        help='seconds of the processor for a law and model, after which the rest '
                        'is left out; with one process')
    parser.add_argument('--cases', nargs='?', const='ABCDEFGHI', metavar='LETTERS',
                        help='run the cases, or those of some letters, in place of the laws')
    parser.add_argument('--show', action='store_true', help='print the scenes, run nothing')
    wanted = parser.parse_args()
    laws = wanted.law or list(EVERY_LAW)
    models = wanted.model or ['timestep', 'event', 'qp', 'penalty', 'none']
    seeds = range(wanted.seed, wanted.seed + wanted.scenes)
    if wanted.cases:
        for line in cases(models, wanted.cases):
            print(line, flush=True)
        return
    if wanted.show:
        for law in laws:
            for seed in seeds:
                found = scene(law, seed)
                print(json.dumps(with_model(found.spec, models[0], wanted.substeps)))
                print(f'# {found.steps} steps; {found.facts}', file=sys.stderr)
        return
    for line in table(laws, models, seeds, wanted.substeps, wanted.jobs, wanted.limit):
        print(line, flush=True)


if __name__ == '__main__':
    main()
