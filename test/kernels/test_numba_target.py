# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Numba compiles the functions of others as if this package was not there, and ours as ever."""

import json
import os
from pathlib import Path
import re
import subprocess
import sys

from effort import either
from kernels.own_kernels import of_the_engine
from numba import njit
from numba.core.errors import TypingError
import pytest

from rigid_sim_ros.kernels.numba_target import is_supported, NEWEST, OLDEST, SUPPORTED

ROOT = Path(__file__).parents[2]
needs_target = pytest.mark.skipif(not SUPPORTED, reason='kernels are compiled as by njit')

# A function of somebody else with all that kernels do in another way, and its instructions in
# LLVM's words, without the numbers that Numba gives to the functions of a process, and without the
# lengths of names.
FOREIGN = r"""
import collections, re
import numba, numpy
from kernels.numba_state import modules, Walk

Pair = collections.namedtuple('Pair', 'x array')

def foreign(array, pair, stop):
    total = 0.0
    for i in range(stop):
        for j in range(1, stop, 2):
            total += array[i, j] * pair.x - abs(pair.array[-i])
    other = Pair(total, array[0])
    return max(min(total, 1.0), other.array.sum(), len(str(stop)))

def instructions():
    array, compiled = numpy.ones((4, 4)), numba.njit(foreign)
    compiled(array, Pair(1.0, array[1]), 3)
    (text,) = compiled.inspect_llvm().values()
    return re.sub(r'B\d+v\d+|v\d+B\d+|0x[0-9a-f]+|\d{9,}|\[\d+ x i8\]', '', text)
"""
# All that this package does to its own kernels; and the collector of cycles is as it was.
OURS = """
import gc, io
collector = gc.isenabled(), gc.get_threshold()
from rigid_sim_ros import load_scene, warm_up
load_scene('tower').step()
from kernels import kernels_of_all_kinds
warm_up.announced(kernels_of_all_kinds.run, io.StringIO())
assert (gc.isenabled(), gc.get_threshold()) == collector
"""
# A process tells which modules it has, the instructions before and after, and what there is.
TELL = """
import gc, importlib, json
before = instructions()
{between}
for name in {names}:
    importlib.import_module(name)
after = instructions()
gc.collect()
lines = Walk(sorted(modules())).lines
{then}
print(json.dumps([modules(), before, after, lines, seen]))
"""
# What somebody does to Numba then, and where it is seen.
BREAK = """
for code in {breaches}.values():
    exec(code)
broken = Walk(sorted(modules())).lines
seen = [path for path in {breaches} if lines.get(path) != broken.get(path)]
"""
# What nobody must do to Numba, and where it shows.
BREACHES = {
    'numba.core.base.BaseContext.make_tuple':
        'from numba.core.base import BaseContext\nBaseContext.make_tuple = lambda *_: None',
    'llvmlite.ir.IRBuilder.gep': 'import llvmlite\nllvmlite.ir.IRBuilder.gep = None',
    'numba.core.base.builtin_registry.functions':
        'numba.extending.lower_builtin(range, numba.types.int64)(lambda *_: None)',
    'numba.core.typing.templates.builtin_registry.globals':
        'numba.extending.overload(str.title)(lambda x: None)',
    'numba.core.datamodel.default_manager._handlers':
        'numba.extending.register_model(type("T", (numba.types.Type,), {}))(dict)',
    'numba.core.extending.typeof_impl.registry':
        'numba.extending.typeof_impl.register(collections.Counter)(print)',
    'numba.core.pythonapi._unboxers.functions':
        'numba.extending.unbox(type("T", (numba.types.Type,), {}))(print)',
    'numba.core.event._registered':
        'from numba.core import event\nevent.register("other", event.TimingListener())',
    'numba.core.target_extension.target_registry':
        'from numba.core import target_extension as t\nt.target_registry["x"] = t.CPU',
    'numba.core.compiler_machinery._pass_registry._id': """
from numba.core import compiler_machinery
compiler_machinery.register_pass(False, True)(type('P', (compiler_machinery.AnalysisPass,), {
    '_name': 'x', '__init__': lambda self: None, 'run_pass': print}))""",
    'numba.core.types.Function.get_call_type':
        'numba.types.Function.get_call_type = lambda *_: None',
}


def said(code, folder=None, **environment):
    """Return what a process says that can import this folder, and another one."""
    path = [str(ROOT / 'test'), *filter(None, sys.path)] + ([str(folder)] if folder else [])
    # Numba goes through sets, and gives names by hashes.
    environment = {'PYTHONHASHSEED': '0', 'PYTHONPATH': os.pathsep.join(path)} | environment
    done = subprocess.run([sys.executable, '-c', code], env=os.environ | environment,
                          capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, '')
    return done.stdout


@pytest.fixture(scope='module')
def both():
    """Give what a process with kernels of ours tells, and one without that then harms Numba."""
    ours = json.loads(said(FOREIGN + TELL.format(between=OURS, names=(), then='seen = []')))
    return ours, json.loads(said(FOREIGN + TELL.format(
        between='', names=ours[0], then=BREAK.format(breaches=repr(BREACHES)))))


@needs_target
def test_nothing_that_can_be_reached_in_numba_is_another(both):
    (_, _, _, ours, _), (_, _, _, alone, _) = both
    assert len(ours) > 10_000
    assert {path: (alone.get(path), ours.get(path)) for path in alone.keys() | ours.keys()
            if alone.get(path) != ours.get(path)} == {}


@needs_target
def test_a_function_of_somebody_else_has_the_same_instructions_before_and_after(both):
    (_, before, after, *_), (_, *alone, _, _) = both
    assert len(before.splitlines()) > 100
    assert [before, after] == alone
    assert before == after


def test_what_is_replaced_or_added_in_numba_is_seen(both):
    _, (*_, seen) = both
    assert seen == [*BREACHES]


@of_the_engine()
def twice(x):
    return 2.0 * x


@needs_target
def test_a_function_that_is_no_kernel_is_told_that_it_cannot_call_one():
    assert twice(1.0) == 2.0
    with pytest.raises(TypingError, match='twice is a kernel of rigid_sim_ros'):
        njit(lambda x: twice(x))(1.0)


# --- the range of Numba -------------------------------------------------------------------------

# Kernels without which a ball neither turns nor is told where it is; those of a step, if any.
FALL = """
import numba
numba.__version__ = '9.0.0'
from rigid_sim_ros import World
world = World.from_dict({'format': 1, 'bodies': [
    {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.0,
     'twist': {'angular': [1, 2, 3]}}]})
world.apply_impulse('ball', (1, 2, 3), point=(0.1, 0, 0), frame='ball')
world.step(STEPS)
world.set_pose('ball', (1, 2, 3), (0.5, 0.5, 0.5, 0.5))
from rigid_sim_ros.kernels.kernel import kernel
print(world.state_hash(), *world.angular_velocity[0],
      isinstance(kernel(lambda x: x), type(numba.njit(lambda x: x))))
"""


@pytest.mark.parametrize('version, expected', [
    ('0.58.1', False), ('{}.{}.0rc1'.format(*OLDEST), True), ('{}.{}.9'.format(*NEWEST), True),
    (f'{NEWEST[0]}.{NEWEST[1] + 1}.0dev1', False), ('1.0.0', False)])
def test_a_numba_of_the_range_is_supported(version, expected):
    assert is_supported(version) == expected


@pytest.mark.long
def test_with_another_numba_kernels_are_compiled_by_njit_to_the_same_bits(tmp_path):
    code = FALL.replace('STEPS', str(either(0, 10)))
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True,
                          env=os.environ | {'NUMBA_CACHE_DIR': str(tmp_path)})
    *bits, by_njit = done.stdout.split()
    usual = code.replace("numba.__version__ = '9.0.0'\n", '')
    assert (bits, by_njit) == (said(usual).split()[:-1], 'True')
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith('Numba 9.0.0 is not one of 0.59 to ')


def test_the_package_asks_for_a_numba_of_the_range():
    wanted, = re.findall(r"'numba(\S*)'", (ROOT / 'setup.py').read_text(encoding='utf-8'))
    assert wanted == '>={}.{},<{}.{}'.format(*OLDEST, NEWEST[0], NEWEST[1] + 1)


# --- kernels ------------------------------------------------------------------------------------

KERNEL = """
from kernels.own_kernels import of_the_engine

@of_the_engine()
def weighted(rows, pair):
    total = 0.0
    for i in range(len(rows)):
        for j in range(1, 3):
            total += rows[i, j] * pair[1]
    return total, pair[0]
"""
SOMEBODYS = """
import numba, numpy
numba.njit(lambda a: (a @ a)[0, 0] + sum([x for x in a[0]]))(numpy.eye(2))
"""
CACHED = """
from rigid_sim_ros.engine.maths.rotation import unit
unit((0.0, 0.0, 0.0, 2.0))
print(sum(unit.stats.cache_hits.values()))
"""
# Prints the instructions, without the names of functions and constants in them: Numba counts the
# functions of a process, and the count is part of the names.
INSTRUCTIONS = r"""
import re, numpy, own
own.weighted(numpy.ones((4, 3)), (1.0, 2.0))
(compiled,) = own.weighted.overloads.values()
for line in compiled.library.get_asm_str().splitlines():
    code = line.partition('#')[0].strip()
    if code and not code.startswith(('.', '_')):
        print(re.sub(r'[._]\w*[.\w]*', 'name', code))
"""


def test_a_kernel_becomes_the_same_code_whatever_came_before(tmp_path):
    (tmp_path / 'own.py').write_text(KERNEL, encoding='utf-8')

    def told(code, cache):
        return said(code, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / cache))

    *lines, compiled = told(INSTRUCTIONS + CACHED, 'cached').splitlines(keepends=True)
    alone = ''.join(lines)
    assert (len(lines) > 20, compiled) == (True, '0\n')
    for k, before in enumerate((SOMEBODYS, f'import own\n{SOMEBODYS}')):
        assert told(before + INSTRUCTIONS, f'before{k}') == alone
    # One whose other kernels are in the cache.
    for path in (tmp_path / 'cached').rglob('*weighted*'):
        path.unlink()
    assert told(CACHED + INSTRUCTIONS, 'cached') == f'1\n{alone}'
