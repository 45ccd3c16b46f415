# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Keep Numba from importing SciPy before anybody needs it.

Whatever Numba compiles or loads, it first imports a module of its own that asks whether SciPy's
BLAS is there, by importing that: a fifth of a second at each start, for products of matrices that
no kernel here makes.
"""

from importlib import import_module
from importlib.util import find_spec
import sys
from typing import Any

_ASKS = 'numba.np.arraymath'


def spare_scipy() -> None:
    """
    Let Numba know whether SciPy is installed without importing it.

    A kernel of somebody else that multiplies matrices still makes Numba import it, and test it.
    """
    linalg: Any = import_module('numba.np.linalg')
    if _ASKS in sys.modules or not hasattr(linalg, 'ensure_blas'):
        return
    ensure_blas = linalg.ensure_blas
    linalg.ensure_blas = _ensure_scipy
    try:
        arraymath: Any = import_module(_ASKS)
        arraymath.ensure_blas = ensure_blas
    finally:
        linalg.ensure_blas = ensure_blas


def _ensure_scipy() -> None:
    """Raise ImportError, as Numba's own test does, where SciPy is not installed."""
    if find_spec('scipy') is None:
        raise ImportError('scipy is not installed')
