# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A part of a tuple is what was put there last."""

from kernels.own_kernels import of_the_engine
from llvmlite import ir

from rigid_sim_ros.kernels import kernel as kernels
from rigid_sim_ros.kernels.compiler_setup import set_up_compiler

kernel = of_the_engine(kernels.kernel)
set_up_compiler()   # with it parts are named as they were before


@kernel
def nested(x, y, i):
    inner = (x, y)
    outer = (inner, (i, inner, (y, x)))
    a, (b, c, d) = outer
    if i > 0:
        d = c
    return a[1] - a[0], b, c[0], d[0], outer[1][2][1]


def test_tuples_in_tuples_come_apart_as_in_python():
    for i in (0, 1):
        assert nested(2.0, 5.0, i) == nested.py_func(2.0, 5.0, i)


REAL = ir.DoubleType()
PAIR = ir.ArrayType(REAL, 2)
WHOLE = ir.LiteralStructType([REAL, PAIR, PAIR])


def test_a_part_is_seen_where_it_was_put_whole():
    function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), [REAL, REAL, PAIR]), 'f')
    builder = ir.IRBuilder(function.append_basic_block())
    x, y, pair = function.args
    first = builder.insert_value(ir.Constant(WHOLE, ir.Undefined), x, 0)
    second = builder.insert_value(first, pair, 1)
    third = builder.insert_value(second, y, (1, 0))
    assert builder.extract_value(third, 0) is x
    assert builder.extract_value(third, (1, 0)) is y
    assert builder.extract_value(second, 1) is pair
    # Of what was put there whole only a part, and the other way round, is asked for anew.
    other, both, nothing = (builder.extract_value(third, 1, name='both'),
                            builder.extract_value(third, (1, 1)), builder.extract_value(third, 2))
    assert (other.aggregate, both.aggregate) == (third, second)
    assert other.name == 'both'
    assert isinstance(nothing.aggregate, ir.Constant)
    assert (other.type, both.type, nothing.type) == (PAIR, REAL, PAIR)
