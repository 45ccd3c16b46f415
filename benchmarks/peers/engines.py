# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The engines that can be compared: how to see whether one is there, and how to run a scene."""

from collections.abc import Sequence
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
    runner: str  # beside this file: a program in Python, or a crate
    install: str  # how to get it
    module: str = ''  # that the Python imports, and asks for its version
    crate: str = ''  # that Cargo builds, with a feature of the runner's own
    feature: str = ''
    arguments: tuple[str, ...] = ()


OURS = 'rigid_sim_ros'
CARGO, CLANG = 'install cargo, see rustup.rs', 'install cargo and apt install cmake libclang-dev'
ENGINES = (
    Engine(OURS, 'run_rigid_sim.py', 'pip install .', 'rigid_sim_ros', arguments=('timestep',)),
    Engine('Rapier', 'rapier', CARGO, crate='rapier3d-f64', feature='f64'),
    Engine('Rapier f32', 'rapier', CARGO, crate='rapier3d', feature='f32'),
    Engine('Box3D', 'box3d', CLANG, crate='box3d-sys', feature='f32'),
    Engine('Jolt', 'jolt', CLANG, crate='joltc-sys', feature='f32'),
    Engine('MuJoCo', 'run_mujoco.py', 'pip install mujoco', 'mujoco'),
    Engine('Bullet', 'run_bullet.py', 'pip install pybullet', 'pybullet'),
    Engine('ODE', 'run_ode.py', 'apt install libode8', 'ode_library'),
    Engine('DART', 'run_dart.py', 'pip install dartpy', 'dartpy'),
    Engine('Drake', 'run_drake.py', 'pip install drake', 'pydrake'),
)


class Command(NamedTuple):
    """How to run an engine, without the arguments of a scene."""

    words: tuple[str, ...]
    arguments: tuple[str, ...]
    version: str


_VERSION = """
import importlib.metadata as m, sys
sys.path.append({folder!r})
import {module}
names = m.packages_distributions().get('{module}', ['{module}'])
print(getattr({module}, 'VERSION', None) or m.version(names[0]))
"""


def find(engine: Engine, pythons: Sequence[str], target: Path) -> Command | None:
    """Return how to run an engine; None if it is not there. Cargo builds below `target`."""
    if engine.crate:
        return _cargo(engine, target.resolve() / engine.feature)
    for python in pythons:
        asked = subprocess.run(
            [python, '-c', _VERSION.format(module=engine.module, folder=str(HERE))],
            capture_output=True, text=True, check=False)
        if asked.returncode == 0:
            return Command((python, str(HERE / engine.runner)), engine.arguments,
                           asked.stdout.strip())
    return None


# All for this processor, what is in Rust, C or C++; and Jolt without its profiler, with which its
# crate would build it.
_NATIVE = {'RUSTFLAGS': '-C target-cpu=native', 'CFLAGS': '-march=native',
           'CXXFLAGS': '-march=native -UJPH_PROFILE_ENABLED'}


def _cargo(engine: Engine, target: Path) -> Command | None:
    """Build a runner in Rust."""
    def cargo(*words: str, quiet: bool = False) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ['cargo', *words, '--package', f'run_{engine.runner}', '--features', engine.feature],
            cwd=HERE, env=os.environ | _NATIVE | {'CARGO_TARGET_DIR': str(target)}, check=False,
            text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL if quiet else None)

    try:
        if cargo('build', '--release', '--quiet').returncode != 0:
            return None
    except FileNotFoundError:
        return None
    tree = cargo('tree', '--depth', '1', quiet=True).stdout.splitlines()
    version = [words[2].lstrip('v') for words in map(str.split, tree) if engine.crate in words]
    program = target / 'release' / f'run_{engine.runner}'
    return Command((str(program),), engine.arguments, ', '.join([*version, engine.feature]))
