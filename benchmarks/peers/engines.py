# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The engines that can be compared: how to see whether one is there, and how to run a scene."""

from collections.abc import Sequence
import functools
import os
from pathlib import Path
import subprocess
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
# What keeps a library from using more than one thread.
ONE_THREAD = dict.fromkeys(
    ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS'), '1')


class Engine(NamedTuple):
    """An engine and its runner."""

    name: str
    module: str  # that Python imports; '' for Rapier, which Cargo builds
    runner: str  # beside this file
    install: str  # how to get it
    arguments: tuple[str, ...] = ()


OURS = 'rigid_sim_ros'
ENGINES = (
    Engine(OURS, 'rigid_sim_ros', 'run_rigid_sim.py', 'pip install .', ('timestep',)),
    Engine('Rapier', '', 'rapier', 'install cargo, see rustup.rs'),
    Engine('MuJoCo', 'mujoco', 'run_mujoco.py', 'pip install mujoco'),
    Engine('Bullet', 'pybullet', 'run_bullet.py', 'pip install pybullet'),
    Engine('DART', 'dartpy', 'run_dart.py', 'pip install dartpy'),
    Engine('Drake', 'pydrake', 'run_drake.py', 'pip install drake'),
)


class Command(NamedTuple):
    """How to run an engine, without the arguments of a scene."""

    words: tuple[str, ...]
    arguments: tuple[str, ...]
    version: str


_VERSION = """
import importlib.metadata as m, {module}
names = m.packages_distributions().get('{module}', ['{module}'])
print(m.version(names[0]))
"""


def find(engine: Engine, pythons: Sequence[str], target: Path) -> Command | None:
    """Return how to run an engine; None if it is not there. Rapier is built in `target`."""
    if not engine.module:
        return _cargo(engine, str(target))
    for python in pythons:
        asked = subprocess.run([python, '-c', _VERSION.format(module=engine.module)],
                               capture_output=True, text=True, check=False)
        if asked.returncode == 0:
            return Command((python, str(HERE / engine.runner)), engine.arguments,
                           asked.stdout.strip())
    return None


@functools.cache
def _cargo(engine: Engine, target: str) -> Command | None:
    """Build the runner of Rapier."""
    folder = HERE / engine.runner
    environment = os.environ | {'RUSTFLAGS': '-C target-cpu=native', 'CARGO_TARGET_DIR': target}
    try:
        built = subprocess.run(['cargo', 'build', '--release', '--quiet'], cwd=folder,
                               env=environment, check=False)
        tree = subprocess.run(['cargo', 'tree', '--depth', '1'], cwd=folder, env=environment,
                              capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return None
    if built.returncode != 0:
        return None
    versions = [line.split()[2] for line in tree.stdout.splitlines() if 'rapier3d' in line]
    return Command((str(Path(target) / 'release' / 'run_rapier'),), (),
                   f'{versions[0].lstrip("v")}, f64' if versions else 'f64')
