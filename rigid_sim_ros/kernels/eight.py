# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Eight numbers that are worked on at once: the type `Eight` inside of a kernel.

    n = load(b, NORMAL)             # row NORMAL of a flat array of rows of eight numbers
    speed = max(n * v, 0.0)         # lane by lane, as + - * / min max abs and comparisons are
    store(b, SPEED, select(speed < limit, speed, limit))

A lane never hears of the others, but in `any_of` and where records are turned into rows and back:

    record 0: a0 b0 c0 ...            row a: a0 a1 a2 ... a7
    record 1: a1 b1 c1 ...    <->     row b: b0 b1 b2 ... b7
    ...                               ...

A loop over eight numbers would do the same. But the compiler makes vector instructions only of
some such loops, as long as nobody touches them; it keeps what passes from one to the next in
memory; and rows written number by number are not to be had before the last of eight stores is
done. So vectors are a type here, in LLVM's words; each operation is rounded as that of a float.
"""

from collections.abc import Callable, Sequence
import operator
from typing import Any, TypeAlias

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, signature

from rigid_sim_ros.kernels.numba_target import intrinsic, lowerings, register_model, typings
from rigid_sim_ros.kernels.tuple_passing import ADDRESS

LANES = 8
EVERY = (1 << LANES) - 1    # the bits of all lanes
# In kernels only: to Python and its checkers they are just something.
Eight: TypeAlias = Any
Mask: TypeAlias = Any

_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)
_INT = ir.IntType(64)
_ALIGN = 8      # bytes: arrays may begin anywhere


class EightType(types.Type):
    """Eight floats."""

    def __init__(self) -> None:
        super().__init__(name='Eight')

    def can_convert_from(self, _: Any, other: Any) -> Any:
        """Let a number stand for eight of it."""
        return Conversion.safe if isinstance(other, types.Number) else None


class MaskType(types.Type):
    """Eight truth values."""

    def __init__(self) -> None:
        super().__init__(name='Mask')


_LANES, _MASK = EightType(), MaskType()


class _EightModel(models.PrimitiveModel):

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


class _MaskModel(models.PrimitiveModel):

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)  # type: ignore[no-untyped-call]


register_model(EightType, _EightModel)
register_model(MaskType, _MaskModel)


@lowerings.lower_cast(types.Number, EightType)
def _spread(context: Any, builder: ir.IRBuilder, kind: Any, _: Any, value: ir.Value) -> ir.Value:
    """Return a number in all lanes."""
    number = context.cast(builder, value, kind, types.float64)
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, ir.IntType(32)(0))
    return builder.shuffle_vector(first, first, _mask([0] * LANES))


# --- operators ---------------------------------------------------------------------------------

def _operator(function: Any, result: Any, count: int, emit: Callable[..., ir.Value]) -> None:
    """Let a function of Python work on lanes: `emit` makes its instruction."""

    @typings.register_global(function)
    class _Template(AbstractTemplate):

        def generic(self, args: Any, kws: Any) -> Any:
            known = all(a == _LANES or isinstance(a, types.Number) for a in args)
            if len(args) == count and _LANES in args and known:
                return signature(result, *[_LANES] * count)
            return None

    @lowerings.lower(function, *[EightType] * count)
    def _lower(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return emit(builder, *args)


def _compare(sign: str) -> Callable[..., ir.Value]:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


def _absolute(builder: ir.IRBuilder, a: ir.Value) -> ir.Value:
    return builder.call(_llvm(builder, 'fabs'), [a])


def _llvm(builder: ir.IRBuilder, name: str) -> ir.Function:
    kind = ir.FunctionType(_VECTOR, [_VECTOR])
    return builder.module.declare_intrinsic(f'llvm.{name}.v{LANES}f64', (), kind)


_operator(operator.add, _LANES, 2, lambda builder, a, b: builder.fadd(a, b))
_operator(operator.sub, _LANES, 2, lambda builder, a, b: builder.fsub(a, b))
_operator(operator.mul, _LANES, 2, lambda builder, a, b: builder.fmul(a, b))
_operator(operator.truediv, _LANES, 2, lambda builder, a, b: builder.fdiv(a, b))
_operator(operator.neg, _LANES, 1, lambda builder, a: builder.fneg(a))
_operator(abs, _LANES, 1, _absolute)
for _function, _sign in ((operator.lt, '<'), (operator.le, '<='), (operator.gt, '>'),
                         (operator.ge, '>='), (operator.eq, '==')):
    _operator(_function, _MASK, 2, _compare(_sign))
_operator(max, _LANES, 2, lambda builder, a, b: builder.select(
    builder.fcmp_ordered('>', a, b), a, b))
_operator(min, _LANES, 2, lambda builder, a, b: builder.select(
    builder.fcmp_ordered('<', a, b), a, b))


@intrinsic
def spread(_: Any, number: Any) -> Any:
    """Return a number in all lanes."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return args[0]

    return _LANES(_LANES), generate


@intrinsic
def root(_: Any, a: Any) -> Any:
    """Return the square root of each lane."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return builder.call(_llvm(builder, 'sqrt'), args)

    return _LANES(_LANES), generate


@intrinsic
def select(_: Any, mask: Any, a: Any, b: Any) -> Any:
    """Return a where the mask holds, else b; both may be numbers."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return builder.select(*args)

    return _LANES(_MASK, _LANES, _LANES), generate


@intrinsic
def both(_: Any, a: Any, b: Any) -> Any:
    """Return where two masks hold."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return builder.and_(*args)

    return _MASK(_MASK, _MASK), generate


@intrinsic
def either(_: Any, a: Any, b: Any) -> Any:
    """Return where any of two masks holds."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return builder.or_(*args)

    return _MASK(_MASK, _MASK), generate


@intrinsic
def any_of(_: Any, mask: Any) -> Any:
    """Return whether a mask holds in any lane."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        bits = builder.bitcast(args[0], ir.IntType(LANES))
        return builder.icmp_unsigned('!=', bits, ir.IntType(LANES)(0))

    return types.boolean(_MASK), generate


# --- rows and records --------------------------------------------------------------------------

@intrinsic
def load(_: Any, b: Any, row: Any) -> Any:
    """Return a row of a flat array of rows of eight numbers."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return _load(builder, _row(context, builder, signature, args))

    return _LANES(b, types.int64), generate


@intrinsic
def store(_: Any, b: Any, row: Any, lanes: Any) -> Any:
    """Write a row of a flat array of rows of eight numbers."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        builder.store(args[2], _row(context, builder, signature, args), align=_ALIGN)
        return context.get_dummy_value()

    return types.void(b, types.int64, _LANES), generate


@intrinsic
def read_eight(_: Any, array: Any, first: Any) -> Any:
    """Return eight numbers of an array that lie side by side, whichever is the first."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        data = builder.extract_value(args[0], ADDRESS)
        return _load(builder, _vector_at(builder, data, args[1]))

    return _LANES(array, types.int64), generate


@intrinsic
def write_eight(_: Any, array: Any, first: Any, lanes: Any) -> Any:
    """Write eight numbers of an array that lie side by side, whichever is the first."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        data = builder.extract_value(args[0], ADDRESS)
        builder.store(args[2], _vector_at(builder, data, args[1]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, _LANES), generate


@intrinsic
def gather(_: Any, records: Any, at: Any) -> Any:
    """Return the eight numbers of the records that begin at `at` (8,), each in eight lanes."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        rows = [_load(builder, place) for place in _records(context, builder, signature, args)]
        return context.make_tuple(builder, signature.return_type, _transposed(builder, rows))

    return types.UniTuple(_LANES, LANES)(records, at), generate


@intrinsic
def scatter(_: Any, records: Any, at: Any, numbers: Any) -> Any:
    """Write records of eight numbers, given as up to eight lanes; what is not given becomes 0."""
    count = len(numbers)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        rows = [builder.extract_value(args[2], k) for k in range(count)]
        rows += [ir.Constant(_VECTOR, None)] * (LANES - count)
        places = _records(context, builder, signature, args)
        for record, place in zip(_transposed(builder, rows), places, strict=True):
            builder.store(record, place, align=_ALIGN)
        return context.get_dummy_value()

    return types.void(records, at, types.UniTuple(_LANES, count)), generate


def _rows_gatherer(numbers: int, load_row: Callable[..., ir.Value]) -> Any:

    @intrinsic
    def gatherer(_: Any, array: Any, rows: Any, width: Any, first: Any) -> Any:

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
            data, at = (builder.extract_value(args[k], ADDRESS) for k in (0, 1))
            at_hand = _row_at_hand(builder, at)
            loaded = []
            for lane in range(LANES):
                row = _integer(builder, at, _INT(lane))
                exists = builder.icmp_signed('>=', row, _INT(0))
                row = builder.select(exists, row, at_hand)
                start = builder.add(builder.mul(row, args[2]), args[3])
                value = load_row(builder, data, start)
                loaded.append(builder.select(exists, value, ir.Constant(value.type, None)))
            columns = _COLUMNS[loaded[0].type](builder, loaded)
            return context.make_tuple(builder, signature.return_type, columns[:numbers])

        kind = types.UniTuple(_LANES, numbers)
        return kind(array, rows, types.int64, types.int64), generate

    return gatherer


def _row_at_hand(builder: ir.IRBuilder, rows: ir.Value) -> ir.Value:
    """
    Return the row that a lane without one reads, in vain: that of the first lane, if it has one.

    Of an array of which only a part is in use the row 0 would have to be fetched for it.
    """
    first = _integer(builder, rows, _INT(0))
    return builder.select(builder.icmp_signed('>=', first, _INT(0)), first, _INT(0))


def _one_number(builder: ir.IRBuilder, data: ir.Value, start: ir.Value) -> ir.Value:
    return builder.load(builder.gep(data, [start]))


def _three_numbers(builder: ir.IRBuilder, data: ir.Value, start: ir.Value) -> ir.Value:
    # There may be no fourth: the array may end there.
    value = ir.Constant(ir.VectorType(ir.DoubleType(), 4), None)
    for k in range(3):
        number = builder.load(builder.gep(data, [builder.add(start, _INT(k))]))
        value = builder.insert_element(value, number, ir.IntType(32)(k))
    return value


# gather_rows_N(array, rows, width, first): return N numbers, each in eight lanes, from number
# `first` on in the rows (8,) of an array with `width` numbers in a row; 0 for a row below 0.
gather_rows_1 = _rows_gatherer(1, _one_number)
gather_rows_3 = _rows_gatherer(3, _three_numbers)


def _rows_scatterer(numbers: int) -> Any:

    @intrinsic
    def scatterer(_: Any, array: Any, rows: Any, width: Any, first: Any, lanes: Any) -> Any:

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
            data, at = (builder.extract_value(args[k], ADDRESS) for k in (0, 1))
            columns = [builder.extract_value(args[4], k) for k in range(numbers)]
            nowhere = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), numbers))
            nowhere = builder.gep(nowhere, [_INT(0), _INT(0)])
            for lane in range(LANES):
                row = _integer(builder, at, _INT(lane))
                start = builder.add(builder.mul(row, args[2]), args[3])
                place = builder.select(builder.icmp_signed('>=', row, _INT(0)),
                                       builder.gep(data, [start]), nowhere)
                for k, column in enumerate(columns):
                    number = builder.extract_element(column, ir.IntType(32)(lane))
                    builder.store(number, builder.gep(place, [_INT(k)]))
            return context.get_dummy_value()

        kind = types.UniTuple(_LANES, numbers)
        return types.void(array, rows, types.int64, types.int64, kind), generate

    return scatterer


# scatter_rows_N(array, rows, width, first, lanes): write N numbers where gather_rows_N reads them.
scatter_rows_1, scatter_rows_3 = _rows_scatterer(1), _rows_scatterer(3)


@intrinsic
def gather_integers(_: Any, array: Any, rows: Any) -> Any:
    """Return the integers that stand in the rows (8,) of an array, 0 for a row below 0."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        data, at = (builder.extract_value(args[k], ADDRESS) for k in (0, 1))
        value, at_hand = ir.Constant(_VECTOR, None), _row_at_hand(builder, at)
        for lane in range(LANES):
            row = _integer(builder, at, _INT(lane))
            exists = builder.icmp_signed('>=', row, _INT(0))
            found = _integer(builder, data, builder.select(exists, row, at_hand))
            number = builder.sitofp(builder.select(exists, found, _INT(0)), ir.DoubleType())
            value = builder.insert_element(value, number, ir.IntType(32)(lane))
        return value

    return _LANES(array, rows), generate


@intrinsic
def bits_of(_: Any, mask: Any) -> Any:
    """Return an integer whose bit k is set where a mask holds in lane k."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), _INT)

    return types.int64(_MASK), generate


@intrinsic
def lanes_in(_: Any, bits: Any) -> Any:
    """Return a mask that holds in lane k where bit k of an integer is set."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        return builder.bitcast(builder.trunc(args[0], ir.IntType(LANES)), _BITS)

    return _MASK(types.int64), generate


@intrinsic
def largest_of(_: Any, lanes: Any) -> Any:
    """Return the largest number of all lanes."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
        best, half = args[0], LANES // 2
        while half > 0:
            # Each half of what is left against the other.
            other = builder.shuffle_vector(best, best, _mask([k ^ half for k in range(LANES)]))
            best = builder.select(builder.fcmp_ordered('>', other, best), other, best)
            half //= 2
        return builder.extract_element(best, ir.IntType(32)(0))

    return types.float64(_LANES), generate


def _one_column(builder: ir.IRBuilder, rows: Sequence[ir.Value]) -> list[ir.Value]:
    """Return eight numbers as one column."""
    column = ir.Constant(_VECTOR, None)
    for lane, number in enumerate(rows):
        column = builder.insert_element(column, number, ir.IntType(32)(lane))
    return [column]


def _four_columns(builder: ir.IRBuilder, rows: Sequence[ir.Value]) -> list[ir.Value]:
    """Return the columns of a matrix of eight rows of four."""
    pairs = [builder.shuffle_vector(rows[k], rows[k + 4], _mask(range(LANES))) for k in range(4)]
    return _exchange(builder, pairs, (1, 2))


def _transposed(builder: ir.IRBuilder, rows: Sequence[ir.Value]) -> list[ir.Value]:
    """
    Return the columns of a matrix of eight rows.

    Three times what stands off the diagonal changes places: single numbers in blocks of two by
    two, then those blocks in blocks of four by four, then these.
    """
    return _exchange(builder, rows, (1, 2, 4))


# By what was loaded from each row.
_COLUMNS = {ir.DoubleType(): _one_column, ir.VectorType(ir.DoubleType(), 4): _four_columns}


def _exchange(builder: ir.IRBuilder, rows: Sequence[ir.Value],
              widths: Sequence[int]) -> list[ir.Value]:
    turned = list(rows)
    for width in widths:
        low = [k if k & width == 0 else k - width + LANES for k in range(LANES)]
        high = [k + width if k & width == 0 else k + LANES for k in range(LANES)]
        for k in range(len(turned)):
            if k & width == 0:
                a, b = turned[k], turned[k + width]
                turned[k] = builder.shuffle_vector(a, b, _mask(low))
                turned[k + width] = builder.shuffle_vector(a, b, _mask(high))
    return turned


def _mask(indices: Sequence[int]) -> ir.Constant:
    return ir.Constant(ir.VectorType(ir.IntType(32), LANES), list(indices))


def _vector_at(builder: ir.IRBuilder, data: ir.Value, index: ir.Value) -> ir.Value:
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _row(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> ir.Value:
    data = builder.extract_value(args[0], ADDRESS)
    return _vector_at(builder, data, builder.mul(args[1], _INT(LANES)))


def _records(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> list[ir.Value]:
    """Return where the record of each lane begins."""
    data, at = (builder.extract_value(args[k], ADDRESS) for k in (0, 1))
    starts = [_integer(builder, at, _INT(lane)) for lane in range(LANES)]
    return [_vector_at(builder, data, start) for start in starts]


def _integer(builder: ir.IRBuilder, data: ir.Value, index: ir.Value) -> ir.Value:
    """Return an integer of an array of whatever width, 64 bits at most."""
    number = builder.load(builder.gep(data, [index]))
    return number if number.type == _INT else builder.sext(number, _INT)


def _load(builder: ir.IRBuilder, place: ir.Value) -> ir.Value:
    return builder.load(place, align=_ALIGN)
