# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Shorter ways to what Numba finds out again and again while it compiles.

The results are Numba's own, so compiled code stays the same to the byte. The first two alone were
a fifth of the time to compile the kernels of a scene.
"""

from typing import Any
from weakref import WeakKeyDictionary

from llvmlite.ir import IdentifiedStructType
from numba import types
from numba.core import base, ir, postproc


def take_shortcuts() -> None:
    """Let Numba take them, for whatever this process compiles from now on."""
    _remember_calls(types.Function)
    _pass_over_plain_values(ir.Inst)
    _remember_sizes(base.BaseContext)
    _remember_parameters(base)
    _spare_entry_variables(postproc)


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


def _remember_sizes(kind: Any) -> None:
    """
    Let LLVM say once how many bytes a type takes.

    For each answer it reads a module with a variable of that type, and Numba asks, for a debugger,
    at every variable of a kernel.
    """
    find = kind.get_abi_sizeof
    sizes: dict[Any, Any] = {}

    def get_abi_sizeof(self: Any, its: Any) -> Any:
        if isinstance(its, IdentifiedStructType):   # which may get its members later
            return find(self, its)
        key = type(self), str(its)
        if key not in sizes:
            sizes[key] = find(self, its)
        return sizes[key]

    kind.get_abi_sizeof = get_abi_sizeof


def _remember_parameters(module: Any) -> None:
    """Look once at the signature of what writes a call for LLVM, not at every call."""
    find = module._has_loc
    known: Any = WeakKeyDictionary()

    def has_loc(function: Any) -> Any:
        answer = known.get(function)
        if answer is None:
            answer = known[function] = find(function)
        return answer

    module._has_loc = has_loc


def _spare_entry_variables(module: Any) -> None:
    """
    Do not find out which variables are alive where a block begins, after each of four passes.

    Generators need it, and kernels that Numba cannot compile and interprets.
    """
    everything = module.PostProcessor.run

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        code = self.func_ir
        if emit_dels or code.is_generator:
            everything(self, emit_dels, extend_lifetimes)
            return
        code.blocks = module.transforms.canonicalize_cfg(code.blocks)
        code.variable_lifetime = module.VariableLifetime(code.blocks)
        code.generator_info = None

    module.PostProcessor.run = run
