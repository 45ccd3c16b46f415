# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Instructions of processors that Python has no words for, and which processors need them."""

from typing import Any

from llvmlite import ir
from llvmlite.binding import get_host_cpu_name
from numba import types

from rigid_sim_ros.kernels.numba_target import intrinsic
from rigid_sim_ros.kernels.tuple_passing import ADDRESS

# Whether to ask for lines of the cache ahead of time pays. Other processors than those of AMD do
# so by themselves, and are held up: by 8 % of a step of 10 000 spheres on an Intel Xeon.
FETCHING_PAYS = get_host_cpu_name().startswith('znver')
_BYTES = ir.IntType(8).as_pointer()


def place(builder: Any, arguments: Any) -> Any:
    """Return the address of an entry of a flat array, from (array, index, ...)."""
    return builder.gep(builder.extract_value(arguments[0], ADDRESS), [arguments[1]])


@intrinsic
def lowest_zero(_: Any, mask: Any) -> Any:
    """
    Return the place of the lowest bit of a mask that is 0, or 64 without one.

    In a loop over the bits the processor would have to guess where it ends.
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return builder.cttz(builder.not_(args[0]), ir.IntType(1)(0))

    return types.int64(types.int64), generate


@intrinsic
def fetch(_: Any, numbers: Any, at: Any) -> Any:
    """Ask for the line of the cache where a number stands, to be read or written soon."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        ask = builder.module.declare_intrinsic(
            'llvm.prefetch', (_BYTES,),
            ir.FunctionType(ir.VoidType(), [_BYTES, *[ir.IntType(32)] * 3]))
        entry = builder.bitcast(place(builder, args), _BYTES)
        # To write, for all levels of the cache, data.
        builder.call(ask, [entry, *(ir.IntType(32)(k) for k in (1, 3, 1))])
        return context.get_dummy_value()

    return types.void(numbers, types.int64), generate
