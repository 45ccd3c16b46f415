# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Parts of tuples and arrays by the names under which they were put there.

Numba takes apart for LLVM what it put together a line before, each index of an array for one.
"""

from typing import Any

from llvmlite import ir

_Builder: Any = ir.IRBuilder
_Insert: Any = ir.instructions.InsertValue


def see_through_tuples() -> None:
    """Name a part of a value, from now on, as it was named before, if that can be seen."""
    extract = _Builder.extract_value

    def extract_value(self: Any, whole: Any, at: Any, name: str = '') -> Any:
        path = tuple(at) if isinstance(at, (tuple, list)) else (at,)
        while isinstance(whole, _Insert):
            there = tuple(whole.indices)
            if there == path:
                return whole.value
            common = min(len(there), len(path))
            if there[:common] == path[:common]:     # a part of what was put there, or more
                break
            whole = whole.aggregate
        return extract(self, whole, path, name)

    _Builder.extract_value = extract_value
