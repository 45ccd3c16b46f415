# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How kernels hold and hand on a NamedTuple of the engine that has arrays: by its place in memory.

To Numba such a tuple is one value of all its numbers, and an array of k dimensions is 5 + 2 k of
them. It copies the value at every name that it gets and passes number by number. The buffers of a
step are some hundred arrays that go through a dozen kernels: to copy them was half of what LLVM
had to read, and 27 of 69 s of the processor for the first start of the scene `tower`. Nobody
writes to a tuple, so that a name and an argument may be the address of one.

In memory each number takes a slot. Of an array there are its address and its lengths: kernels
count no references, and of an array without gaps the rest follows from its type and lengths. A
tuple in a tuple lies inside it.

Each line of a kernel that makes a tuple, by its constructor or by a call, has room for one. A loop
that makes one each time around may use it until it comes there again. What lasts from one time
around to the next meets, where the loop begins, what came before it: in the form in which Numba
names each value once, that is a choice between both (a phi) at its head. So a kernel is refused
that has one there which is a tuple in memory.

With a Numba that is not supported tuples stay values.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import analysis, errors, ir as numba_ir
from numba.core.datamodel import models as numba_models
from numba.cpython import tupleobj

from rigid_sim_ros.kernels.numba_target import lowerings, models, register_model, SUPPORTED

SLOT = 8        # bytes: no number is larger
_PACKAGE = __name__.partition('.')[0] + '.'
_models: Any = numba_models
_types: Any = types
_tuples: Any = tupleobj
_analysis: Any = analysis
_errors: Any = errors
_ir: Any = numba_ir
# The members of an array, by place.
_OWNER, _PARENT, _COUNT, _ITEM_SIZE, ADDRESS, LENGTHS, _STRIDES = range(7)
_INTEGER = ir.IntType(8 * SLOT)
_PLACE = ir.IntType(8).as_pointer()
# The second has two names, of which an LLVM knows one.
_UNCHANGED = 'noalias', 'captures(none)', 'nocapture'


def is_packed(kind: Any) -> bool:
    """Return whether a type is that of an array of numbers without gaps."""
    return (isinstance(kind, types.Array) and kind.layout == 'C' and kind.ndim > 0
            and isinstance(kind.dtype, (types.Integer, types.Float)))


class _InMemory(_models.DataModel):
    """
    A tuple by its address; what a function returns is all that lies there.

    The methods are those that Numba asks any model for, and at the end two more.
    """

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind)
        self.firsts = [0]   # slots of the members, and the one after
        parts: list[Any] = []
        for member in kind:
            parts += _parts(member, packed=True)
            self.firsts.append(len(parts))
        self._content = ir.LiteralStructType([_in_a_slot(part) for part in parts])

    def get_value_type(self) -> Any:
        return _PLACE

    def get_data_type(self) -> Any:
        return self._content

    def get_return_type(self) -> Any:
        return self._content

    def as_data(self, builder: Any, value: Any) -> Any:
        return builder.load(builder.bitcast(value, self._content.as_pointer()))

    def from_data(self, builder: Any, value: Any) -> Any:
        place = self._room(builder)
        builder.store(value, builder.bitcast(place, self._content.as_pointer()))
        return place

    def load_from_data_pointer(self, builder: Any, pointer: Any, align: Any = None) -> Any:
        return builder.bitcast(pointer, _PLACE)

    def as_argument(self, builder: Any, value: Any) -> Any:
        return value

    def from_argument(self, builder: Any, value: Any) -> Any:
        return nobody_writes(value, self.firsts[-1])

    as_return = as_data
    from_return = from_data

    def made(self, builder: Any, values: Sequence[Any]) -> Any:
        """Return a new tuple."""
        place = self._room(builder)
        for member, first, value in zip(self._fe_type, self.firsts, values, strict=False):
            _write(builder, place, first, member, value, True)
        return place

    def member(self, builder: Any, value: Any, index: int) -> Any:
        """Return one of the members of a tuple."""
        return read(builder, value, self.firsts[index], self._fe_type[index], True)

    def _room(self, builder: Any) -> Any:
        with builder.goto_entry_block():
            return builder.bitcast(builder.alloca(_INTEGER, self.firsts[-1]), _PLACE)


def nobody_writes(place: Any, length: int) -> Any:
    """
    Tell LLVM, where an argument is the address of so many slots, that they stay as they are.

    It need not read them anew whenever an entry of an array was written. Return the address.
    """
    if isinstance(place, ir.Argument):
        for attribute in _UNCHANGED:
            if attribute in place.attributes._known:
                place.add_attribute(attribute)
        place.attributes.dereferenceable = SLOT * length
    return place


def _in_a_slot(part: Any) -> Any:
    is_wide = isinstance(part, (ir.PointerType, ir.DoubleType)) or part == _INTEGER
    return part if is_wide else _INTEGER


def _parts(kind: Any, packed: bool = False) -> list[Any]:
    """Return LLVM's types of the slots of a value; `packed`: an array in a tuple of ours."""
    model = models[kind]
    if packed and is_packed(kind):
        return [model.get_value_type().elements[ADDRESS], *kind.ndim * [_INTEGER]]
    if isinstance(model, _InMemory):
        return list(model.get_data_type().elements)
    if isinstance(kind, _types.BaseTuple):
        return [part for member in kind for part in _parts(member)]
    return list(_flat(model.get_argument_type()))


def _flat(nested: Any) -> Iterator[Any]:
    if isinstance(nested, (tuple, list)):
        for one in nested:
            yield from _flat(one)
    else:
        yield nested


def slots(kind: Any, packed: bool = False) -> int:
    """Return how many slots a value takes in memory; `packed`: an array in a tuple of ours."""
    return len(_parts(kind, packed))


def _slot(builder: Any, start: Any, at: int, part: Any = None) -> Any:
    place = builder.gep(start, [ir.Constant(_INTEGER, SLOT * at)])
    return builder.bitcast(place, part.as_pointer()) if part else place


def read(builder: Any, start: Any, first: int, kind: Any, packed: bool = False) -> Any:
    """Return the value whose slots begin with the `first` after an address."""
    model = models[kind]
    if isinstance(model, _InMemory):
        return _slot(builder, start, first)
    if isinstance(kind, _types.BaseTuple):
        whole: Any = ir.Constant(model.get_value_type(), ir.Undefined)
        for k, member in enumerate(kind):
            part = read(builder, start, first, member)
            whole = builder.insert_value(whole, part, k)
            first += slots(member)
        return whole
    found = [builder.load(_slot(builder, start, k, part), align=SLOT)
             for k, part in enumerate(_parts(kind, packed), first)]
    if packed and is_packed(kind):
        return _put_together(builder, kind, model, *found)
    return _unflattened(model, builder, found)


def _unflattened(model: Any, builder: Any, found: list[Any]) -> Any:
    waiting = iter(found)

    def nested(pattern: Any) -> Any:
        if isinstance(pattern, (tuple, list)):
            return tuple(nested(one) for one in pattern)
        return next(waiting)

    return model.from_argument(builder, nested(model.get_argument_type()))


def _write(builder: Any, start: Any, first: int, kind: Any, value: Any, packed: bool) -> None:
    model = models[kind]
    if isinstance(model, _InMemory):
        place = _slot(builder, start, first, model.get_data_type())
        builder.store(model.as_data(builder, value), place)
    elif isinstance(kind, _types.BaseTuple):
        for k, member in enumerate(kind):
            _write(builder, start, first, member, builder.extract_value(value, k), False)
            first += slots(member)
    else:
        given = (_taken_apart(builder, value, kind.ndim) if packed and is_packed(kind)
                 else _flat(model.as_argument(builder, value)))
        for k, part in enumerate(given, first):
            builder.store(part, _slot(builder, start, k, part.type), align=SLOT)


def _taken_apart(builder: Any, array: Any, dimensions: int) -> tuple[Any, ...]:
    """Return the address and the lengths of an array."""
    return (builder.extract_value(array, ADDRESS),
            *(builder.extract_value(array, (LENGTHS, k)) for k in range(dimensions)))


def _put_together(builder: Any, kind: Any, model: Any, address: Any, *lengths: Any) -> Any:
    """Return an array without an owner, in C's order."""
    entries = [ir.Constant(entry, ir.Undefined) for entry in model.get_value_type().elements]
    for k in _OWNER, _PARENT:
        entries[k] = ir.Constant(entries[k].type, None)
    stride: Any = ir.Constant(_INTEGER, kind.dtype.bitwidth // 8)
    strides: list[Any] = [ir.Constant(_INTEGER, ir.Undefined) for _ in lengths]
    entries[_ITEM_SIZE] = strides[-1] = stride
    entries[_STRIDES] = ir.Constant(entries[_STRIDES].type, strides)
    array = builder.insert_value(
        ir.Constant(model.get_value_type(), entries), address, ADDRESS)
    count = lengths[0]
    for k, length in enumerate(lengths):
        array = builder.insert_value(array, length, (LENGTHS, k))
        count = count if k == 0 else builder.mul(count, length)
    for k in range(len(lengths) - 1, 0, -1):
        stride = builder.mul(stride, lengths[k])
        array = builder.insert_value(array, stride, (_STRIDES, k - 1))
    return builder.insert_value(array, count, _COUNT)


def passes_packed(kind: Any, member: Any) -> bool:
    """Return whether a tuple of this type holds a member by address and lengths."""
    return isinstance(models[kind], _InMemory) and is_packed(member)


def is_in_memory(kind: Any) -> bool:
    """Return whether a value of this type is, or has in it, the address of a tuple."""
    return isinstance(models[kind], _InMemory) or (
        isinstance(kind, _types.BaseTuple) and any(map(is_in_memory, kind)))


class _OfTuples(_models.UniTupleModel):
    """Several tuples of one type; Numba would return such values as they are, the addresses."""

    def get_return_type(self) -> Any:
        return self.get_data_type()

    def as_return(self, builder: Any, value: Any) -> Any:
        return self.as_data(builder, value)

    def from_return(self, builder: Any, value: Any) -> Any:
        return self.from_data(builder, value)


def _is_ours(kind: Any) -> bool:
    return (isinstance(kind, _types.BaseNamedTuple)
            and kind.instance_class.__module__.startswith(_PACKAGE) and _has_arrays(kind))


def _has_arrays(kind: Any) -> bool:
    return isinstance(kind, types.Array) or (
        isinstance(kind, _types.BaseTuple) and any(map(_has_arrays, kind)))


def _register(kind: Any, concerns: Callable[[Any], bool], ours: Any) -> None:
    others = models._handlers[kind]
    register_model(kind, lambda manager, own: (ours if concerns(own) else others)(manager, own))


def _read_members(kind: Any) -> None:
    """Let kernels read members of a tuple, by name and by a constant index."""
    def attribute(context: Any, builder: Any, own: Any, value: Any, name: str) -> Any:
        model = models[own]
        if isinstance(model, _InMemory):
            return model.member(builder, value, own.fields.index(name))
        return _tuples.namedtuple_getattr(context, builder, own, value, name)

    def item(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        (own, _), (value, index) = signature.args, arguments
        model = models[own]
        if isinstance(model, _InMemory) and -len(own) <= index < len(own):
            return model.member(builder, value, index % len(own))
        return _tuples.static_getitem_tuple(context, builder, signature, arguments)

    lowerings.lower_getattr_generic(kind)(attribute)
    lowerings.lower('static_getitem', kind, types.IntegerLiteral)(item)


def refuse_kept_tuples(code: Any, kinds: Any) -> None:
    """
    Raise UnsupportedError for a kernel that keeps a tuple for the next time around a loop.

    `code` is Numba's form of it, in which each variable is assigned once, `kinds` their types.
    """
    chosen = {label: names for label, block in code.blocks.items()
              if (names := _chosen(block, kinds))}
    if not chosen:
        return
    loops = _analysis.compute_cfg_from_blocks(code.blocks).loops().values()
    for label in {loop.header for loop in loops} & set(chosen):
        raise _errors.UnsupportedError(
            f'{chosen[label][0]} is a tuple with arrays, kept for the next time around a loop, '
            f'which makes it anew in the same place: keep its arrays', loc=code.blocks[label].loc)


def _chosen(block: Any, kinds: Any) -> list[str]:
    """Return the names of the tuples in memory that are one of several."""
    return [one.target.name for one in block.find_insts(_ir.Assign)
            if getattr(one.value, 'op', '') == 'phi' and is_in_memory(kinds[one.target.name])]


# What returns an array of such a tuple to Python returns it without its owner.
if SUPPORTED:
    for _kind in types.NamedTuple, _types.NamedUniTuple:
        _register(_kind, _is_ours, _InMemory)
        _read_members(_kind)
    for _kind in types.UniTuple, _types.NamedUniTuple:
        _register(_kind, lambda own: not _is_ours(own) and is_in_memory(own.dtype), _OfTuples)
