# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How the tests are shared out among processes, the workers of pytest-xdist.

A file stays in one worker (`--dist=loadfile`), so that what its tests share is made once. Each
worker that starts ROS has a domain of its own, and each that opens pages a browser.
"""

from collections.abc import Iterable
import os
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parent
# Workers at most: each takes half a gigabyte of memory, and there are not that many long files.
_MOST = 4
# What is told apart so that files of all kinds run side by side: browsers draw, nodes mostly wait,
# and the others calculate.
_KINDS = ('viewer', 'nodes')
# [s] What the longest files take, about, one at a time; only the order of the files rests on it.
# Those of nodes mostly wait.
_SECONDS = {
    'viewer/test_live.py': 85, 'viewer/test_memory.py': 30, 'viewer/test_bag_page.py': 28,
    'viewer/test_commands.py': 20, 'viewer/test_arrivals_page.py': 16,
    'viewer/test_joints_page.py': 14,
    'viewer/test_old_reports.py': 10, 'nodes/test_replay.py': 80, 'nodes/test_process.py': 45,
    'nodes/test_replay_process.py': 45, 'nodes/test_replay_control.py': 35,
    'nodes/test_recording.py': 27, 'nodes/test_recording_load.py': 24,
    'nodes/test_examples.py': 22, 'nodes/test_neighbours.py': 20, 'nodes/test_resume.py': 18,
    'nodes/test_joints.py': 12, 'nodes/test_extremes.py': 10, 'kernels/test_numba_target.py': 27,
    'cli/test_precompile.py': 25, 'test_warm_up.py': 20, 'test_threads.py': 18,
    'kernels/test_separate.py': 18, 'laws/test_mixed_laws.py': 18, 'plots/test_files.py': 17,
    'bag/test_hostile.py': 16, 'kernels/test_cache.py': 15, 'test_drops.py': 14,
    'test_package.py': 12, 'models/test_mjcf.py': 12, 'laws/test_laws.py': 12,
    'laws/test_ground_laws.py': 8, 'laws/test_jointed_laws.py': 10,
    'engine/detection/test_narrow_phase.py': 12, 'engine/steps/test_precompile.py': 12,
    'render/test_render.py': 11, 'laws/test_thin_laws.py': 6, 'world/test_odd_commands.py': 10,
    'test_imports.py': 9, 'laws/test_crowd_laws.py': 8, 'engine/state/test_body_order.py': 8,
    'bag/test_full_disk.py': 8, 'bag/test_fuzz.py': 8, 'bag/test_forged.py': 6,
    'bag/test_completeness.py': 6, 'bag/test_playback.py': 6, 'bag/test_recover.py': 5,
    'engine/steps/test_timestep_piles.py': 6, 'engine/steps/test_sleeping_joints.py': 6,
    'engine/detection/test_ellipsoids.py': 6, 'engine/detection/test_seams.py': 5}
_USUAL = 2


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


def mix(items: list[pytest.Item]) -> None:
    """
    Sort files so that each kind is spread over the whole run, and of each the longest come first.

    A file that takes long and begins last would keep one worker busy while the others have ended.
    And at most as many workers as there are cores have a page: others would wait for a turn.
    """
    places = _places({item.path: None for item in items})
    items.sort(key=lambda item: places[item.path])


def _places(files: Iterable[Path]) -> dict[Path, float]:
    """Return when each file is to begin, from 0 to 1: at its share of the time of its kind."""
    kinds: dict[str, list[tuple[int, Path]]] = {}
    for file in files:
        name = file.relative_to(ROOT).as_posix()
        folder = name.partition('/')[0]
        seconds = _SECONDS.get(name, _USUAL)
        kinds.setdefault(folder if folder in _KINDS else '', []).append((seconds, file))
    places = {}
    for kind in kinds.values():
        total, before = sum(seconds for seconds, _ in kind), 0
        for seconds, file in sorted(kind, key=lambda one: -one[0]):
            places[file] = before / total
            before += seconds
    return places


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
