# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Places in memory that machine code knows by name, each with room for the address of a function.

Code in the cache names the place; where that lies is told LLVM before the code is loaded.
"""

from ctypes import addressof, c_int64

from llvmlite import binding

_places: dict[str, c_int64] = {}    # they stay for as long as the process


def declare(symbol: str) -> c_int64:
    """Return the place that has this name; it holds 0 at first."""
    if symbol not in _places:
        _places[symbol] = place = c_int64(0)
        binding.add_symbol(symbol, addressof(place))
    return _places[symbol]
