# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How kernels hand the arrays of a NamedTuple of the engine on: each by address and lengths.

Numba passes an array of k dimensions as 5 + 2 k numbers: its owner and parent, how many entries it
has and how many bytes each takes, their address, lengths and strides. Kernels count no references,
and of an array without gaps the rest follows from its type and lengths. The buffers of a step are
some hundred arrays that go from kernel to kernel; with 1 + k numbers each the kernels of a scene
compile in a sixth less time.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.datamodel import default_manager, models

_PACKAGE = __name__.partition('.')[0] + '.'
_models: Any = models
_types: Any = types
# The members of an array, by place.
_OWNER, _PARENT, _COUNT, _ITEM_SIZE, _ADDRESS, _LENGTHS, _STRIDES = range(7)
_INTEGER = ir.IntType(64)


def _is_packed(kind: Any) -> bool:
    return (isinstance(kind, types.Array) and kind.layout == 'C' and kind.ndim > 0
            and isinstance(kind.dtype, (types.Integer, types.Float)))


class _ByAddress:
    """What the models of Numba for both kinds of NamedTuples are mixed with."""

    def _members_and_models(self) -> list[tuple[Any, Any]]:
        own: Any = self
        return [(member, own._dmm.lookup(member)) for member in own._fe_type]

    def get_argument_type(self) -> Any:
        """Return the types of LLVM's that are passed, nested as the members are."""
        return tuple((model.get_value_type().elements[_ADDRESS], *member.ndim * [_INTEGER])
                     if _is_packed(member) else model.get_argument_type()
                     for member, model in self._members_and_models())

    def as_argument(self, builder: Any, value: Any) -> Any:
        """Take a value apart."""
        parts: list[Any] = []
        for i, (member, model) in enumerate(self._members_and_models()):
            part = builder.extract_value(value, i)
            parts.append(_taken_apart(builder, part, member.ndim) if _is_packed(member)
                         else model.as_argument(builder, part))
        return tuple(parts)

    def from_argument(self, builder: Any, value: Any) -> Any:
        """Put a value together again."""
        own: Any = self
        whole: Any = ir.Constant(own.get_value_type(), ir.Undefined)
        for i, ((member, model), given) in enumerate(
                zip(self._members_and_models(), value, strict=True)):
            part = (_put_together(builder, member, model, *given) if _is_packed(member)
                    else model.from_argument(builder, given))
            whole = builder.insert_value(whole, part, i)
        return whole


def _taken_apart(builder: Any, array: Any, dimensions: int) -> tuple[Any, ...]:
    """Return the address and the lengths of an array."""
    return (builder.extract_value(array, _ADDRESS),
            *(builder.extract_value(array, (_LENGTHS, k)) for k in range(dimensions)))


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
        ir.Constant(model.get_value_type(), entries), address, _ADDRESS)
    count = lengths[0]
    for k, length in enumerate(lengths):
        array = builder.insert_value(array, length, (_LENGTHS, k))
        count = count if k == 0 else builder.mul(count, length)
    for k in range(len(lengths) - 1, 0, -1):
        stride = builder.mul(stride, lengths[k])
        array = builder.insert_value(array, stride, (_STRIDES, k - 1))
    return builder.insert_value(array, count, _COUNT)


class _TupleByAddress(_ByAddress, _models.TupleModel):
    pass


class _UniTupleByAddress(_ByAddress, _models.UniTupleModel):
    pass


def passes_packed(kind: Any, member: Any) -> bool:
    """Return whether a tuple of this type hands on a member by address and lengths."""
    return isinstance(default_manager[kind], _ByAddress) and _is_packed(member)


def pass_by_address() -> None:
    """
    Pass the NamedTuples of this package so from now on; for others nothing changes.

    What is compiled to return an array of such a tuple to Python returns it without its owner.
    """
    for kind, ours in ((types.NamedTuple, _TupleByAddress),
                       (_types.NamedUniTuple, _UniTupleByAddress)):
        _register(kind, ours)


def _register(kind: Any, ours: Any) -> None:
    others = default_manager._handlers[kind]

    def model(manager: Any, own: Any) -> Any:
        is_ours = own.instance_class.__module__.startswith(_PACKAGE)
        return (ours if is_ours else others)(manager, own)

    default_manager.register(kind, model)
