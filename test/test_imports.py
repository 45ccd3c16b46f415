# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Imports go one way: cli, nodes -> bag -> messages, world -> scene -> engine -> kernels."""
import ast
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
import importlib
from importlib.util import find_spec
import os
from pathlib import Path
import subprocess
import sys

from kernels.caches import cache_without
import pytest

import rigid_sim_ros

ROOT = Path(rigid_sim_ros.__file__).parent
MODULES = sorted(
    path for path in ROOT.rglob('*.py') if not path.relative_to(ROOT).parts[0].startswith('_'))

# What any part may import, but for the engine and the kernels.
ANYWHERE = {'problems', 'times', 'words'}
# What a part may import of the others, besides itself and these.
PHYSICS = {'engine', 'kernels'}
LOWER = PHYSICS | {'bag', 'messages', 'scene', 'world'}
MAY_IMPORT = {
    'cli': LOWER | {'environment', 'nodes', 'plots', 'render', 'signals', 'viewer', 'warm_up'},
    'environment': set(),
    'programs': {'signals'},
    'problems': set(),
    'times': set(),
    'words': set(),
    'reading': set(),
    'plots': LOWER,
    'render': LOWER | {'plots'},
    'nodes': LOWER | {'environment', 'reading', 'signals', 'viewer', 'warm_up'},
    'viewer': LOWER | {'plots', 'signals'},
    'bag': LOWER,
    'warm_up': PHYSICS | {'scene', 'signals', 'world'},
    'messages': PHYSICS,
    'signals': set(),
    'scene': PHYSICS | {'models', 'reading'},
    'models': PHYSICS | {'reading'},
    'world': PHYSICS | {'scene'},
    'engine': {'kernels'},
    'kernels': set(),
}
# The rooms of the engine; each imports of those that stand after it.
ROOMS = ('steps', 'events', 'solver', 'constraints', 'joints', 'contact', 'detection', 'dynamics',
         'state', 'model', 'maths')
# SciPy comes with OSQP, whose matrices are those of scipy.sparse; llvmlite with Numba, to both of
# which kernels/ alone speaks.
LIBRARIES = {'engine': {'numpy', 'osqp', 'scipy'}, 'kernels': {'llvmlite', 'numba', 'numpy'}}
ROS_LIBRARIES = ('rclpy', 'rcl_', 'ament_', 'launch', 'rosidl_', 'builtin_interfaces')


def name_of(path: Path) -> str:
    """Return the dotted name of a module of the package."""
    parts = path.relative_to(ROOT.parent).with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


@cache
def imports_of(path: Path) -> list[str]:
    """Return the names of all that a module imports, wherever in the file it stands."""
    return list(_imports_of(path))


def _imports_of(path: Path) -> Iterator[str]:
    package = (name_of(path) if path.name == '__init__.py' else name_of(path).rpartition('.')[0])
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'), str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            if node.level:
                above = package.split('.')[:len(package.split('.')) - node.level + 1]
                base = '.'.join([*above, base]).rstrip('.')
            yield from (f'{base}.{alias.name}' for alias in node.names)


def part_of(module: str) -> str:
    """Return the part that a module lies in: `engine` for rigid_sim_ros.engine.steps.free."""
    return [*module.split('.'), ''][1]


def is_ros(module: str) -> bool:
    top = module.partition('.')[0]
    return top.startswith(ROS_LIBRARIES) or top.endswith(('_msgs', '_srvs'))


def room_of(module: str) -> str:
    """Return the room of the engine that a module lies in: `steps`, or '' for none."""
    return [*module.split('.'), '', ''][2] if module.startswith('rigid_sim_ros.engine.') else ''


ENGINE = [path for path in MODULES if part_of(name_of(path)) in PHYSICS]


def test_imports_go_towards_the_engine() -> None:
    wrong = {}
    for path in MODULES:
        part = part_of(name_of(path))
        others = {part_of(module) for module in imports_of(path)
                  if module.startswith('rigid_sim_ros.')} - {part, '__version__'}
        anywhere = set() if part in PHYSICS | ANYWHERE else ANYWHERE
        wrong[name_of(path)] = others - MAY_IMPORT[part] - anywhere
    assert offenders(wrong) == {}


def test_only_nodes_import_ros() -> None:
    assert offenders({name_of(path): filter(is_ros, imports_of(path)) for path in MODULES
                      if part_of(name_of(path)) != 'nodes'}) == {}


def test_the_engine_needs_no_more_than_numpy_numba_and_osqp() -> None:
    known = {'rigid_sim_ros', *sys.stdlib_module_names}
    assert offenders({name_of(path): {module.partition('.')[0] for module in imports_of(path)}
                      - known - LIBRARIES[part_of(name_of(path))] for path in ENGINE}) == {}


def test_a_room_of_the_engine_imports_what_stands_after_it() -> None:
    wrong, rooms = {}, set()
    for path in ENGINE:
        name, room = name_of(path), room_of(name_of(path))
        if room:
            rooms.add(room)
            before = ROOMS[:ROOMS.index(room)]
            wrong[name] = {module for module in imports_of(path) if room_of(module) in before}
    assert offenders(wrong) == {}
    assert rooms == set(ROOMS)


def offenders(wrong: Mapping[str, Iterable[str]]) -> dict[str, list[str]]:
    """Return who imports what it must not, without those that do nothing wrong."""
    return {name: found for name, modules in wrong.items() if (found := sorted(modules))}


def in_a_fresh_interpreter(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False, timeout=300,
        env=os.environ | environment)


def test_a_world_steps_where_no_ros_is_installed() -> None:
    result = in_a_fresh_interpreter('''
import sys


class Block:
    """Makes every package of ROS look as if it were not installed."""

    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0].endswith(('rclpy', '_msgs', '_srvs', 'ament_index_python')):
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)


sys.meta_path.insert(0, Block())
from rigid_sim_ros import load_scene
world = load_scene('t_handle')
world.step(10)
print(world.step_index)
''')
    assert (result.stdout, result.stderr) == ('10\n', '')


def test_importing_the_package_does_not_wait_for_numba() -> None:
    result = in_a_fresh_interpreter(
        "import rigid_sim_ros.cli, sys; print({'numba', 'numpy', 'rclpy'} & set(sys.modules))")
    assert result.stdout == 'set()\n'


def test_a_world_steps_without_waiting_for_scipy_which_numba_finds_when_asked() -> None:
    result = in_a_fresh_interpreter("""
import sys
from rigid_sim_ros import load_scene
load_scene('t_handle').step()
print('scipy.linalg' in sys.modules)
import numba
import numpy as np
print(numba.njit(lambda a: (a @ a)[0, 0])(2.0 * np.eye(2)), 'scipy.linalg' in sys.modules)
""")
    assert (result.stdout, result.stderr) == ('False\n4.0 True\n', '')


def test_a_world_whose_kernels_are_cached_steps_without_what_compiles_them(tmp_path: Path) -> None:
    code = """
import sys
from rigid_sim_ros import load_scene
world = load_scene('t_handle')
world.step()
world.position
print('numba.np.linalg' in sys.modules)
"""
    cache_without(tmp_path, 'read_motion')
    for expected in ('True\n', 'False\n'):
        result = in_a_fresh_interpreter(code, NUMBA_CACHE_DIR=str(tmp_path))
        assert (result.stdout, result.stderr) == (expected, '')


def test_the_package_offers_what_the_contract_names() -> None:
    assert set(rigid_sim_ros.__all__) <= set(dir(rigid_sim_ros))
    for name in rigid_sim_ros.__all__:
        assert getattr(rigid_sim_ros, name) is not None


def test_an_unknown_name_in_the_package_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match='no_such_name'):
        rigid_sim_ros.no_such_name    # noqa: B018


def test_benchmarks_and_examples_import_what_the_package_has() -> None:
    """Those are seldom run; what they need of ROS is left to the tests that run them."""
    lost = []
    above = ROOT.parent
    for path in sorted((*above.glob('benchmarks/**/*.py'), *above.glob('examples/*.py'))):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'), str(path))):
            if isinstance(node, ast.ImportFrom) and (node.module or '').startswith(
                    'rigid_sim_ros') and part_of(node.module or '') != 'nodes':
                module = importlib.import_module(node.module or '')
                lost += [f'{path.name}: {node.module}.{alias.name}' for alias in node.names
                         if not hasattr(module, alias.name) and not (
                             hasattr(module, '__path__')
                             and find_spec(f'{node.module}.{alias.name}'))]
    assert not lost
