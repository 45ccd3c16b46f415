# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A kernel becomes the same machine code, whatever its process did before."""

import os
from pathlib import Path
import subprocess
import sys

KERNEL = """
from kernels.own_kernels import of_the_engine
from rigid_sim_ros.kernels.kernel import kernel

@of_the_engine(kernel)
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


def said(code: str, cache: Path, folder: Path) -> str:
    environment = os.environ | {
        'NUMBA_CACHE_DIR': str(cache),
        'PYTHONPATH': os.pathsep.join([str(folder), str(Path(__file__).parents[1])])}
    return subprocess.run([sys.executable, '-c', code], env=environment, capture_output=True,
                          text=True, check=True).stdout


def test_a_kernel_becomes_the_same_code_whatever_came_before(tmp_path):
    (tmp_path / 'own.py').write_text(KERNEL, encoding='utf-8')
    alone = said(INSTRUCTIONS, tmp_path / 'alone', tmp_path)
    assert len(alone.splitlines()) > 20
    for k, before in enumerate((SOMEBODYS, f'import own\n{SOMEBODYS}')):
        assert said(before + INSTRUCTIONS, tmp_path / f'before{k}', tmp_path) == alone
    # One whose other kernels are in the cache.
    cache = tmp_path / 'cached'
    assert said(CACHED, cache, tmp_path) == '0\n'
    assert said(CACHED + INSTRUCTIONS, cache, tmp_path) == f'1\n{alone}'
