# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Shorter ways to what Numba finds out again and again while it compiles.

The results are Numba's own, so compiled code stays the same to the byte. Together these were a
fifth of the time to compile the kernels of a scene.
"""

from typing import Any

from numba import types
from numba.core import ir


def take_shortcuts() -> None:
    """Let Numba take them, for whatever this process compiles from now on."""
    _remember_calls(types.Function)
    _pass_over_plain_values(ir.Inst)


def _remember_calls(kind: Any) -> None:
    """
    Find the type of a call of a function of Numba's, for arguments of some types, once.

    Of `a * b` Numba tries one definition after the other until one fits the types of a and b, for
    every product in a program anew: twenty thousand times for the kernels of a scene, of which two
    hundred differ.
    """
    find = kind.get_call_type

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws:
            return find(self, context, args, kws)
        # A definition that comes later makes another function type, which knows nothing yet.
        known = self.__dict__.setdefault('_known_calls', {})
        call = context, tuple(args)
        if call not in known:
            known[call] = find(self, context, args, kws)
        return known[call]

    kind.get_call_type = get_call_type


def _pass_over_plain_values(kind: Any) -> None:
    """
    List the variables of a statement without asking each value in it all that it might be.

    Most values are places in the source, names and numbers: their types are remembered.
    """
    find, plain = kind._rec_list_vars, set()
    holders = ir.Var, ir.Inst, list, tuple, dict

    def list_variables(self: Any, value: Any) -> Any:
        if type(value) is ir.Var:
            return [value]
        if type(value) not in (dict, list, tuple):
            if not isinstance(value, holders):
                plain.add(type(value))
            return find(self, value)
        found: list[Any] = []
        for part in value.values() if type(value) is dict else value:
            if type(part) not in plain:
                found += list_variables(self, part)
        return found

    kind._rec_list_vars = list_variables
