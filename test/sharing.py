# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How the tests are shared out among processes, the workers of pytest-xdist.

A file stays in one worker (`--dist=loadfile`), so that what its tests share is made once. Each
worker that starts ROS has a domain of its own, and each that opens pages a browser.
"""

import os
from pathlib import Path
import subprocess
import sys
from typing import Any

import pytest

ROOT = Path(__file__).parent
# Workers at most: each takes half a gigabyte of memory, and there are not that many long files.
_MOST = 4
# What is told apart so that files of all kinds run side by side: browsers draw, nodes mostly wait,
# and the others calculate.
_KINDS = ('viewer', 'nodes')


def workers(config: pytest.Config) -> int:
    """
    Return how many workers to start: none, that is this process, for files named one by one.

    Else two more than there are cores: tests of nodes wait more than they work.
    """
    if all('.py' in argument for argument in config.args):
        return 0
    return min(_MOST, len(os.sched_getaffinity(0)) + 2)


def has_long_form(item: pytest.Item) -> bool:
    """Return whether a test is a property, or marked as one that can do more."""
    is_property = hasattr(getattr(item, 'obj', None), 'hypothesis')
    return is_property or item.get_closest_marker('long') is not None


def collect_apart(config: pytest.Config) -> None:
    """
    Let this worker collect the whole suite from a file on that is not the first of another one.

    Each worker imports all files, and pytest writes the asserts of a file anew, so that they tell
    values: that is half of the time of a collection. What one worker has written the others read,
    if they are not all at the same file at the same time, and if they may keep it.
    """
    if _is_all(config):
        sys.dont_write_bytecode = False
        files = sorted(str(path) for path in ROOT.rglob('test_*.py'))
        facts: dict[str, Any] = config.workerinput
        first = int(facts['workerid'].removeprefix('gw')) * len(files) // facts['workercount']
        config.args = files[first:] + files[:first]


def mix(items: list[pytest.Item]) -> None:
    """Sort files so that those of each kind come one after the other in turn."""
    # All workers have to agree on the order, wherever each began to collect.
    items.sort(key=lambda item: item.path)
    counts: dict[int, int] = {}
    turns: dict[Path, tuple[int, int]] = {}
    for item in items:
        if item.path not in turns:
            folder = item.path.relative_to(ROOT).parts[0]
            kind = _KINDS.index(folder) if folder in _KINDS else len(_KINDS)
            turns[item.path] = counts.get(kind, 0), kind
            counts[kind] = turns[item.path][0] + 1
    items.sort(key=lambda item: turns[item.path])


def compile_for_all(config: pytest.Config) -> None:
    """
    Compile what all tests need, once, before the workers begin with the whole suite.

    Each of them, and each process that they start, would find nothing and compile the same. What
    fails here fails in the tests too, which say more about it.
    """
    if (not _is_all(config) or config.option.collectonly
            or not getattr(config.option, 'numprocesses', 0)):
        return
    capture = config.pluginmanager.getplugin('capturemanager')
    with capture.global_and_fixture_disabled():
        subprocess.run([sys.executable, '-m', 'rigid_sim_ros', 'compile'], check=False)


def _is_all(config: pytest.Config) -> bool:
    """Return whether the whole suite is to run."""
    return [Path(argument).resolve() for argument in config.args] == [ROOT]
