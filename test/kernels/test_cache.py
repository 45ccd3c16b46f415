# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels are found again exactly as long as nothing that they are made of changes."""

import ast
import os
from pathlib import Path
import pickle
import shutil

from bag.small_disk import make_read_only, mounted
import fresh
import pytest

from rigid_sim_ros.kernels import cache

ROOT = Path(cache.__file__).parents[1]
PACKAGE = 'rigid_sim_ros'
MODULES = sorted(
    f'{PACKAGE}.' + '.'.join(path.relative_to(ROOT).with_suffix('').parts)
    for part in ('engine', 'kernels') for path in (ROOT / part).rglob('*.py')
    if path.name != '__init__.py')


def imported(module):
    """Return the modules of the package that a module imports, as Python's parser reads it."""
    tree = ast.parse(cache._path(module).read_text(encoding='utf-8'))
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or '').startswith(PACKAGE):
            names = [node.module, *(f'{node.module}.{alias.name}' for alias in node.names)]
            found |= {name for name in names if cache._path(name).is_file()}
    return found


def test_all_imports_of_a_module_are_seen():
    assert {module: set(cache._source(module)[1]) for module in MODULES} == {
        module: imported(module) for module in MODULES}


@pytest.fixture
def engine(tmp_path, monkeypatch):
    """Give a folder with three modules in place of the engine; `a` imports `b`, and `b` `c`."""
    monkeypatch.setattr(cache, '_ROOT', tmp_path)
    for name, text in {'a': f'from {PACKAGE}.b import (\n    f)\n',
                       'b': f'from {PACKAGE} import c\n', 'c': '', 'd': ''}.items():
        (tmp_path / f'{name}.py').write_text(text, encoding='utf-8')

    def forget():
        for known in (cache._is_module, cache._source, cache._digest):
            known.cache_clear()

    forget()

    def folders():
        forget()
        return {name: cache.cache_folder(f'{PACKAGE}.{name}').name for name in 'abcd'}

    yield folders
    forget()


@pytest.mark.parametrize('changed, affected', [('a', 'a'), ('b', 'ab'), ('c', 'abc'), ('d', 'd')])
def test_a_change_moves_the_cache_of_what_depends_on_it(engine, tmp_path, changed, affected):
    before = engine()
    (tmp_path / f'{changed}.py').open('a', encoding='utf-8').write('x = 1\n')
    after = engine()
    assert ''.join(name for name in 'abcd' if before[name] != after[name]) == affected


def test_another_version_of_numba_has_folders_of_its_own(engine, monkeypatch):
    """Two environments that share a cache would overwrite what the other one reads."""
    before = engine()
    monkeypatch.setattr(cache.numba, '__version__', 'another')
    assert all(before[name] != folder for name, folder in engine().items())


# Prints how often a kernel was found in the cache, and compiled.
FOUND = """
from rigid_sim_ros.engine.maths.rotation import unit
assert __import__('rigid_sim_ros').__file__.startswith(PLACE)
unit((0.0, 0.0, 0.0, 2.0))
print(*(sum(counts.values()) for counts in (unit.stats.cache_hits, unit.stats.cache_misses)))
"""
ANYWHERE = FOUND.replace("assert __import__('rigid_sim_ros').__file__.startswith(PLACE)\n", '')


def test_what_was_compiled_is_found_again_where_nobody_may_write_to_the_package(tmp_path):
    with mounted(tmp_path / 'disk') as place:
        shutil.copytree(ROOT, place / 'rigid_sim_ros',
                        ignore=shutil.ignore_patterns('__pycache__'))
        make_read_only(place)
        with pytest.raises(OSError, match='Read-only'):
            (place / 'rigid_sim_ros' / 'new').mkdir()
        environment = os.environ | {'XDG_CACHE_HOME': str(tmp_path / 'home'),
                                    'PYTHONPATH': str(place)}
        environment.pop('NUMBA_CACHE_DIR', None)
        for expected in ('0 1', '1 0'):
            done = fresh.run('-c', FOUND.replace('PLACE', repr(str(place))), cwd=tmp_path,
                             env=environment)
            assert done.stdout.split() == expected.split(), done.stderr


def test_what_was_compiled_is_found_again_by_the_same_package_in_another_place(tmp_path):
    for place, expected in (('first', '0 1'), ('second', '1 0')):
        shutil.copytree(ROOT, tmp_path / place / 'rigid_sim_ros',
                        ignore=shutil.ignore_patterns('__pycache__'), copy_function=shutil.copy)
        counts, said = found(tmp_path / 'home', program=FOUND.replace(
            'PLACE', repr(str(tmp_path / place))), PYTHONPATH=str(tmp_path / place))
        assert (counts, said) == (expected.split(), '')


def found(home, check=True, program=ANYWHERE, **environment):
    """Return how often a kernel was found and compiled in a new process, and what it said."""
    variables = os.environ | {'XDG_CACHE_HOME': str(home), **environment}
    if 'NUMBA_CACHE_DIR' not in environment:
        variables.pop('NUMBA_CACHE_DIR', None)
    # Python looks for the package where it starts first.
    done = fresh.run('-c', program, env=variables, cwd=home.parent)
    assert done.returncode == 0 or not check, done.stderr
    return done.stdout.split(), done.stderr


class Harm:
    """Writes a file when it is read as a pickle."""

    def __init__(self, trace):
        self.trace = trace

    def __reduce__(self):
        return os.mkdir, (str(self.trace),)


# Of each kernel the file is damaged in one of these ways.
DAMAGES = {
    'unit': lambda raw: b'',
    'exponential': lambda raw: raw[:len(raw) // 2],
    'logarithm': lambda raw: raw[20:],
    'to_matrix': lambda raw: raw[:-1] + bytes([raw[-1] ^ 1]),
    'from_matrix': lambda raw: (
        raw[:len(raw) // 2] + bytes([raw[len(raw) // 2] ^ 4]) + raw[len(raw) // 2 + 1:]),
    'world_inertia': lambda raw: bytes(len(raw)),
}
# Prints of each kernel how often it was found and compiled.
ALL_FOUND = """
from rigid_sim_ros.engine.maths.rotation import (
    exponential, from_matrix, logarithm, to_matrix, unit)
from rigid_sim_ros.engine.state.world_inertia import world_inertia
q, r = (0.0, 0.0, 0.0, 1.0), (0.1, 0.2, 0.3)
for kernel, *arguments in ((unit, q), (exponential, r), (logarithm, q), (to_matrix, q),
                           (from_matrix, to_matrix(q)), (world_inertia, q, r)):
    kernel(*arguments)
    print(kernel.__name__, *(sum(counts.values()) for counts in (
        kernel.stats.cache_hits, kernel.stats.cache_misses)))
"""


@pytest.fixture(scope='module')
def filled(tmp_path_factory):
    """Give a user's cache folder with the kernels."""
    home = tmp_path_factory.mktemp('filled') / 'home'
    found(home, program=ALL_FOUND)
    return home


@pytest.mark.parametrize('suffix', ['.nbi', '.nbc'])
def test_a_damaged_file_is_compiled_anew(tmp_path, filled, suffix):
    home = shutil.copytree(filled, tmp_path / 'home')
    for name, damage in DAMAGES.items():
        path, = (path for path in home.rglob(f'*{suffix}') if f'.{name}-' in path.name)
        path.write_bytes(damage(path.read_bytes()))
    for expected in ('0 1', '1 0'):
        assert found(home, program=ALL_FOUND) == (
            [word for name in DAMAGES for word in (name, *expected.split())], '')


@pytest.mark.parametrize('gone', [
    b'cno_module_of_ours\nGone\n.', b'crigid_sim_ros.kernels.cache\nGone\n.'])
def test_a_file_of_a_version_with_other_classes_is_as_if_it_was_not_there(tmp_path, gone):
    files = cache._Files(str(tmp_path), 'kernel', 'stamp')
    files.save('key', 'kernel')
    assert files.load('key') == 'kernel'
    for path in tmp_path.iterdir():
        path.write_bytes(cache._digest_of(gone) + gone)
    assert files.load('key') is None
    files.save('key', 'kernel')
    assert files.load('key') == 'kernel'


def planted(home, filled, *suffixes):
    """Fill a cache folder in which files of these kinds leave a trace when they are run."""
    shutil.copytree(filled, home)
    trace = home.parent / f'trace_of_{home.name}'
    for path in (path for suffix in suffixes for path in home.rglob(f'*{suffix}')):
        harm = pickle.dumps(Harm(trace))
        path.write_bytes(cache._digest_of(harm) + harm)
    return trace


@pytest.mark.parametrize('suffix', ['.nbi', '.nbc'])
def test_what_a_trusted_folder_holds_is_run(tmp_path, filled, suffix):
    """Otherwise the next test says nothing."""
    trace = planted(tmp_path / 'home', filled, suffix)
    found(tmp_path / 'home', check=False)
    assert trace.exists()


@pytest.mark.parametrize('which', ['kernels', 'rigid_sim_ros', '.', '..'])
def test_a_folder_that_others_may_write_to_is_not_used(tmp_path, filled, which):
    home = tmp_path / 'home'
    trace = planted(home, filled, '.nbi', '.nbc')
    (home / {'kernels': 'rigid_sim_ros/kernels'}.get(which, which)).chmod(0o777)
    counts, said = found(home)
    assert counts == ['0', '1']
    assert 'set NUMBA_CACHE_DIR' in said
    assert len(said.splitlines()) == 1
    assert not trace.exists()


@pytest.mark.parametrize('which', ['kernels', 'rigid_sim_ros'])
def test_a_link_that_somebody_may_let_lead_elsewhere_is_not_followed(tmp_path, filled, which):
    home, elsewhere = tmp_path / 'home', tmp_path / 'elsewhere'
    trace = planted(elsewhere, filled, '.nbi', '.nbc')
    link = home / 'rigid_sim_ros' / which if which == 'kernels' else home / which
    link.parent.mkdir(parents=True)
    link.symlink_to(elsewhere / link.relative_to(home))
    counts, said = found(home)
    assert counts == ['0', '1']
    assert 'set NUMBA_CACHE_DIR' in said
    assert not trace.exists()


def test_a_cache_may_be_given_by_a_link(tmp_path, filled):
    home = tmp_path / 'home'
    home.symlink_to(filled)
    assert found(home)[0] == ['1', '0']


@pytest.mark.skipif(os.geteuid() != 0, reason='only root may give a folder away')
def test_a_folder_of_another_user_is_not_used(tmp_path):
    (tmp_path / 'rigid_sim_ros' / 'kernels').mkdir(parents=True)
    os.chown(tmp_path / 'rigid_sim_ros' / 'kernels', 12345, 12345)
    counts, said = found(tmp_path)
    assert counts == ['0', '1']
    assert 'set NUMBA_CACHE_DIR' in said
    assert list((tmp_path / 'rigid_sim_ros' / 'kernels').iterdir()) == []


def test_nothing_is_left_of_a_folder_for_one_run(tmp_path):
    (tmp_path / 'tmp').mkdir()
    (tmp_path / 'home').write_text('no folder')
    assert found(tmp_path / 'home', TMPDIR=str(tmp_path / 'tmp'))[0] == ['0', '1']
    assert list((tmp_path / 'tmp').iterdir()) == []


def test_what_another_process_writes_meanwhile_is_not_taken_for_a_kernel(tmp_path):
    """Both have looked which files there are before either has written, and choose the same."""
    one, other = (cache._Files(str(tmp_path), 'kernel', 'stamp') for _ in range(2))
    write = one._save_data

    def be_overtaken(name, data):
        other._load_index = dict    # it has looked before
        other.save('for others', 'kernel of others')
        del other._load_index
        write(name, data)

    one._save_data = be_overtaken
    one.save('for one', 'kernel of one')
    assert other.load('for others') is None
    other.save('for others', 'kernel of others')
    assert other.load('for others') == 'kernel of others'
    assert one.load('for one') in (None, 'kernel of one')


# A kernel that imports nothing of what its arguments are made of.
READER = """
from own_kernels import of_the_engine
@of_the_engine()
def read(c):
    return c.low * 10.0 + c.inner.high
"""
VALUES = """
from typing import Any, NamedTuple
class Inner(NamedTuple):
    {0}: float
    {1}: float
class {2}(NamedTuple):
    low: float
    inner: Any
"""
READ = """
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from reader import read
from values import Inner, {2}
arguments = {2}(1.0, Inner(high=2.0, higher=3.0))
print(read(arguments), read(ArgumentPack(arguments)),
      *(sum(counts.values()) for counts in (read.stats.cache_hits, read.stats.cache_misses)))
"""


def test_a_kernel_is_found_again_only_for_arguments_with_the_same_names_in_the_same_places(
        tmp_path):
    """Otherwise it would read another one's place, and a class that has gone would be an error."""
    (tmp_path / 'reader.py').write_text(READER)
    versions = ('high', 'higher', 'Outer'), ('higher', 'high', 'Outer'), ('high', 'higher', 'All')
    places = ':'.join(map(str, (tmp_path, Path(__file__).parent, ROOT.parent)))
    for expected in ('0 2', '2 0'):
        for names in versions:
            shutil.rmtree(tmp_path / '__pycache__', ignore_errors=True)
            (tmp_path / 'values.py').write_text(VALUES.format(*names))
            counts, said = found(tmp_path / 'home', program=READ.format(*names), PYTHONPATH=places)
            assert (counts, said) == (['12.0', '12.0', *expected.split()], '')
