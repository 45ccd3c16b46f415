# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The functions and records of ODE's library (libode, of float64) that run_ode.py needs."""

import ctypes
import ctypes.util
from typing import Any

import numpy as np

_NAME = ctypes.util.find_library('ode')
if _NAME is None:
    raise ImportError('libode is not there: apt install libode8')
_LIBRARY = ctypes.CDLL(_NAME)
# Pointers are numbers, which compiled Python can hand on.
REAL, POINTER, INT = ctypes.c_double, ctypes.c_size_t, ctypes.c_int

# What ODE is told of a contact (ode/contact.h): how its surface is, where it is, in which
# direction it rubs.
SURFACE = np.dtype([
    ('mode', 'i4'), ('mu', 'f8'), ('mu2', 'f8'), ('rho', 'f8', 3), ('bounce', 'f8'),
    ('bounce_velocity', 'f8'), ('soft', 'f8', 2), ('motion', 'f8', 3), ('slip', 'f8', 2)],
    align=True)
GEOMETRY = np.dtype([('point', 'f8', 4), ('normal', 'f8', 4), ('depth', 'f8'),
                     ('geoms', 'u8', 2), ('sides', 'i4', 2)], align=True)
CONTACT = np.dtype([('surface', SURFACE), ('geometry', GEOMETRY), ('direction', 'f8', 4)],
                   align=True)
BOUNCES, MU_IS_A_COEFFICIENT = 0x004, 0x3000  # of a surface's mode
NUMBERS_OF_A_MASS = 1 + 4 + 12


def function(name: str, result: Any, *arguments: Any) -> Any:
    """Return a function of the library."""
    found = _LIBRARY[name]
    found.restype, found.argtypes = result, arguments
    return found


if 'ODE_double_precision' not in function('dGetConfiguration', ctypes.c_char_p)().decode().split():
    raise ImportError(f'{_NAME} computes in float32, the runner in float64: apt install libode8')

VERSION = _NAME
