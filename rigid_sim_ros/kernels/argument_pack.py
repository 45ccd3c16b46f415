# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Arguments of a kernel that are the same objects from call to call, taken apart once.

A call from Python reads address, shape and strides of every array that it is given, 0.25 us each:
30 us for the 120 arrays of a world, whose step may take 4. `Kept` writes what was read to memory
and hands over where that is. The arrays stay the same: a kernel sees what Python writes to them.
"""

from functools import cache, partial
from hashlib import blake2b
from operator import is_
from typing import Any

from llvmlite import ir
import numba
from numba import types
from numba._dispatcher import compute_fingerprint
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.pythonapi import NativeValue
import numpy as np

from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.numba_target import (
    intrinsic, models, register_model, register_unboxing)
from rigid_sim_ros.kernels.tuple_passing import nobody_writes, passes_packed, read, slots

_POINTER = ir.IntType(8).as_pointer()
_typeof: Any = numba.typeof
_PrimitiveModel: Any = PrimitiveModel
_Tuple: Any = types.BaseTuple


class _BoxType(types.Type):
    """Where a tuple of arguments lies in memory."""

    def __init__(self, content: Any) -> None:
        self.content = content
        # It becomes part of the names of functions; that of the tuple fills pages.
        digest = blake2b(str(content).encode(), digest_size=16).hexdigest()
        super().__init__(name=f'Box{digest}')
        self.slots = slots(content)


# Types of boxes, and how the parts of their arguments are found, by Numba's fingerprint of these.
_types: dict[bytes, tuple[_BoxType, Any]] = {}


def _type(values: tuple[Any, ...]) -> tuple[_BoxType, Any]:
    """
    Return the type of a box, and how the parts of its arguments are found.

    To find either for 120 arrays takes milliseconds.
    """
    mark = compute_fingerprint(values)
    if mark not in _types:
        content = _typeof(values)
        _types[mark] = _BoxType(content), _how(content)
    return _types[mark]


class _Box:
    """A tuple of arguments, and their parts in memory."""

    def __init__(self, *values: Any) -> None:
        self.type, how = _type(values)
        self.values = values    # or the arrays might go away
        self.slots: IntArray = np.array(_parts(values, how), dtype=np.int64)
        if self.slots.shape != (self.type.slots,):
            raise AssertionError(f'{len(self.slots)} parts for {self.type.slots} slots')
        self.address = self.slots.ctypes.data
        self._compiled: dict[Any, Any] = {}

    @property
    def _numba_type_(self) -> _BoxType:
        return self.type

    def __reduce__(self) -> Any:
        """Copy the arguments, and take the copies apart."""
        return _Box, self.values

    def run(self, kernel: Any, *numbers: int) -> Any:
        """
        Return what a kernel returns for this box and some ints.

        Called as usual it would ask Python for the type of the box each time: 1.5 us.
        """
        compiled = self._compiled.get(kernel)
        if compiled is None:
            compiled = kernel.compile((self.type, *(types.int64 for _ in numbers)))
            self._compiled[kernel] = compiled
        return compiled(self, *numbers)


def _parts(value: Any, how: Any) -> list[int]:
    """
    Return the parts of an argument as Numba passes them, each as 64 bits.

    A kernel that did this for a world took longer to compile than to load all others.
    """
    if isinstance(how, tuple):
        return [part for item, its in zip(value, how, strict=True) for part in _parts(item, its)]
    found: list[int] = how(value)
    return found


def _how(kind: Any, packed: bool = False) -> Any:
    """
    Return how the parts of an argument are found: a function, or for a tuple one for each item.

    `packed`: an array is passed by address and lengths.
    """
    if isinstance(kind, _Tuple):
        return tuple(_how(its, passes_packed(kind, its)) for its in kind)
    if isinstance(kind, types.Array):
        return _packed if packed else partial(_unpacked, _fields(kind))
    if kind == types.float64:
        return lambda value: [int(np.float64(value).view(np.int64))]
    if kind == types.int64:
        return lambda value: [int(value)]
    raise TypeError(f'a {kind} cannot be kept, only arrays and numbers of 64 bits')


def _packed(array: Any) -> list[int]:
    return [_address(array), *array.shape]


def _unpacked(names: tuple[str, ...], array: Any) -> list[int]:
    fields = {
        'meminfo': (0,), 'parent': (0,), 'nitems': (array.size,), 'itemsize': (array.itemsize,),
        'data': (_address(array),), 'shape': array.shape, 'strides': array.strides}
    return [part for name in names for part in fields[name]]


def _address(array: Any) -> int:
    return int(array.__array_interface__['data'][0])


@cache
def _fields(kind: Any) -> tuple[str, ...]:
    """Return the names of the parts of an array, in the order in which Numba passes them."""
    return tuple(models[kind]._fields)


class Kept:
    """The arguments of the latest call, and the addresses of what it calls with the same ones."""

    def __init__(self, pieces: int = 0) -> None:
        """Begin with none, and room for the addresses of kernels (see `separate.py`)."""
        self.addresses: IntArray = np.zeros(pieces, dtype=np.int64)
        self.compiled_for: Any = None   # the box that these kernels take
        self._box: Any = None

    def __reduce__(self) -> Any:
        """Let a copy begin with none: what lies in memory, and where, is of this process."""
        return Kept, (len(self.addresses),)

    def box(self, *values: Any) -> Any:
        """Return what a kernel gets in place of these arguments, for `contents` to open."""
        box = self._box
        if box is None or False in map(is_, box.values, values):
            self._box = box = _Box(*values)
        return box


class _BoxModel(_PrimitiveModel):

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _POINTER)

    def from_argument(self, builder: Any, value: Any) -> Any:
        """Return the address; what lies there stays as it is."""
        return nobody_writes(value, self._fe_type.slots)


def _unbox(kind: Any, box: Any, c: Any) -> Any:
    address = c.pyapi.object_getattr_string(box, 'address')
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


register_model(_BoxType, _BoxModel)
register_unboxing(_BoxType, _unbox)


@intrinsic
def contents(context: Any, box: Any) -> Any:
    """Return the tuple of arguments that a box holds."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return read(builder, arguments[0], 0, box.content)
    return box.content(box), build


@intrinsic
def held(context: Any, box: Any, index: Any) -> Any:
    """Return one of the arguments that a box holds, by an index that is a constant."""
    if not isinstance(index, types.IntegerLiteral):
        return None     # Numba asks again with the constant
    before, kind = box.content.types[:index.literal_value], box.content[index.literal_value]

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return read(builder, arguments[0], sum(map(slots, before)), kind)
    return kind(box, index), build


@intrinsic
def call(context: Any, address: Any, box: Any, number: Any) -> Any:
    """Return what a kernel at an address returns, which takes a box and an int: an int."""
    kinds = box, types.int64

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        convention = context.call_conv
        kind = convention.get_function_type(types.int64, kinds)
        callee = builder.inttoptr(arguments[0], kind.as_pointer())
        status, value = convention.call_function(
            builder, callee, types.int64, kinds, arguments[1:])
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return value
    return types.int64(address, *kinds), build
