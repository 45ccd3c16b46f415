# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Arguments of a kernel that are the same objects from call to call, taken apart once.

A call from Python reads address, shape and strides of every array that it is given, 0.25 us each:
30 us for the 120 arrays of a world, whose step may take 4. `Kept` writes what was read to memory
and hands over where that is. The arrays stay the same: a kernel sees what Python writes to them.
"""

from hashlib import blake2b
from operator import is_
from typing import Any

from llvmlite import ir
import numba
from numba import types
from numba._dispatcher import compute_fingerprint
from numba.core.registry import cpu_target
from numba.extending import (
    intrinsic, models, NativeValue, register_model, typeof_impl, unbox)
import numpy as np

from rigid_sim_ros.engine.arrays import IntArray
from rigid_sim_ros.engine.kernel import kernel

_POINTER = ir.IntType(8).as_pointer()
_SLOT = 8       # bytes: no part of an argument is larger
_intrinsic: Any = intrinsic
_typeof: Any = numba.typeof
_PrimitiveModel: Any = models.PrimitiveModel


class _BoxType(types.Type):
    """Where a tuple of arguments lies in memory."""

    def __init__(self, content: Any) -> None:
        self.content = content
        # It becomes part of the names of functions; that of the tuple fills pages.
        digest = blake2b(str(content).encode(), digest_size=16).hexdigest()
        super().__init__(name=f'Box{digest}')
        packer = cpu_target.target_context.get_arg_packer((content,))
        self.slots = len(packer.argument_types)


_types: dict[bytes, _BoxType] = {}


def _type(values: tuple[Any, ...]) -> _BoxType:
    """Return the type of a box; to find that of 120 arrays takes Numba a millisecond."""
    mark = compute_fingerprint(values)
    if mark not in _types:
        _types[mark] = _BoxType(_typeof(values))
    return _types[mark]


class _Box:
    """A tuple of arguments, and their parts in memory."""

    def __init__(self, *values: Any) -> None:
        self.type = _type(values)
        self.values = values    # or the arrays might go away
        self.slots: IntArray = np.zeros(self.type.slots, dtype=np.int64)
        self.address = self.slots.ctypes.data
        _fill(self.slots, values)


class Kept:
    """The arguments of the latest call."""

    def __init__(self) -> None:
        """Begin with none."""
        self._box: Any = None

    def box(self, *values: Any) -> Any:
        """Return what a kernel gets in place of these arguments, for `contents` to open."""
        box = self._box
        if box is None or not all(map(is_, box.values, values)):
            self._box = box = _Box(*values)
        return box


class _BoxModel(_PrimitiveModel):

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _POINTER)


register_model(_BoxType)(_BoxModel)
typeof_impl.register(_Box)(lambda box, context: box.type)


def _unbox(kind: Any, box: Any, c: Any) -> Any:
    address = c.pyapi.object_getattr_string(box, 'address')
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


unbox(_BoxType)(_unbox)


def _slots(builder: Any, start: Any, parts: Any) -> Any:
    """Yield a pointer to each part of a tuple of arguments."""
    for k, kind in enumerate(parts):
        place = builder.gep(start, [ir.Constant(ir.IntType(64), _SLOT * k)])
        yield builder.bitcast(place, kind.as_pointer())


@_intrinsic
def contents(context: Any, box: Any) -> Any:
    """Return the tuple of arguments that a box holds."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        packer = context.get_arg_packer((box.content,))
        found = [builder.load(slot, align=_SLOT)
                 for slot in _slots(builder, arguments[0], packer.argument_types)]
        return packer.from_arguments(builder, found)[0]
    return box.content(box), build


@_intrinsic
def _write(context: Any, slots: Any, values: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        packer = context.get_arg_packer((values,))
        parts = packer.as_arguments(builder, [arguments[1]])
        data = context.make_array(slots)(context, builder, value=arguments[0]).data
        start = builder.bitcast(data, _POINTER)
        for part, slot in zip(parts, _slots(builder, start, packer.argument_types), strict=True):
            builder.store(part, slot, align=_SLOT)
        return context.get_dummy_value()
    return types.none(slots, values), build


@kernel
def _fill(slots: IntArray, values: Any) -> None:
    """Write the parts of a tuple of arguments."""
    _write(slots, values)
