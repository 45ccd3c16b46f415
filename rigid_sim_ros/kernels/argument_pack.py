# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Arguments of a kernel that are the same objects from call to call, taken apart once.

A call from Python reads address, shape and strides of every array that it is given, 0.25 us each:
30 us for the 120 arrays of a world, whose step may take 4. An `ArgumentPack` writes what was read
to memory and hands over where that is. A kernel reads the arguments as attributes of the pack, as
it would those of the NamedTuple that the pack was made of. The arrays stay the same: a kernel sees
what Python writes to them.
"""

from functools import cache, partial
from hashlib import blake2b
from operator import is_
from typing import Any

from llvmlite import ir
import numba
from numba import types
from numba._dispatcher import compute_fingerprint
from numba.core.datamodel.models import PrimitiveModel
from numba.core.pythonapi import NativeValue
from numba.core.typing.templates import AttributeTemplate
import numpy as np

from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.kernels.numba_target import (
    lowerings, models, register_model, register_unboxing, typings)
from rigid_sim_ros.kernels.tuple_passing import nobody_writes, passes_packed, read, slots
from rigid_sim_ros.kernels.type_description import description

_POINTER = ir.IntType(8).as_pointer()
_typeof: Any = numba.typeof
_PrimitiveModel: Any = PrimitiveModel
_Tuple: Any = types.BaseTuple
_Template: Any = AttributeTemplate


class PackType(types.Type):
    """Where the fields of a NamedTuple of arguments lie in memory."""

    def __init__(self, content: Any) -> None:
        self.content = content
        # It becomes part of the names of functions; that of the tuple fills pages.
        digest = blake2b(description(content).encode(), digest_size=16).hexdigest()
        super().__init__(name=f'ArgumentPack{digest}')
        # Of each field its first slot, its type, and whether it is a packed array.
        self.fields: dict[str, tuple[int, Any, bool]] = {}
        self.slots = 0
        for name, kind in zip(content.fields, content, strict=True):
            is_packed = passes_packed(content, kind)
            self.fields[name] = self.slots, kind, is_packed
            self.slots += slots(kind, is_packed)

    @property
    def literal_type(self) -> 'PackType':
        """
        Return the type itself, which tells Numba that a pack is never None.

        Of `if c is None` it then compiles one branch, as it does for None: the other one took 4 s
        of the first start where it calls all of the search for nearest points.
        """
        return self


# Types of packs, and how the parts of their arguments are found, by Numba's fingerprint of these.
_types: dict[bytes, tuple[PackType, Any]] = {}


def _type(arguments: Any) -> tuple[PackType, Any]:
    """
    Return the type of a pack, and how the parts of its arguments are found.

    To find either for 120 arrays takes milliseconds.
    """
    mark = compute_fingerprint(arguments)
    if mark not in _types:
        content = _typeof(arguments)
        _types[mark] = PackType(content), _how(content)
    return _types[mark]


class ArgumentPack:
    """
    A NamedTuple of arguments, and their parts in memory.

    TypeError for arguments other than arrays, numbers of 64 bits and tuples of these.
    """

    def __init__(self, arguments: Any) -> None:
        """Take the arguments apart."""
        self.type, how = _type(arguments)
        self.arguments = arguments      # or the arrays might go away
        self.slots: IntArray = np.array(_parts(arguments, how), dtype=np.int64)
        if self.slots.shape != (self.type.slots,):
            raise AssertionError(f'{len(self.slots)} parts for {self.type.slots} slots')
        self.address = self.slots.ctypes.data
        self.is_linked = False      # what kernels of this pack call is there, see separate.py
        self._compiled: dict[Any, Any] = {}

    @property
    def _numba_type_(self) -> PackType:
        return self.type

    def __reduce__(self) -> Any:
        """Copy the arguments, and take the copies apart."""
        return ArgumentPack, (self.arguments,)

    def run(self, kernel: Any, *numbers: int) -> Any:
        """
        Return what a kernel returns for this pack and some ints.

        Called as usual it would ask Python for the type of the pack each time: 1.5 us.
        """
        compiled = self._compiled.get(kernel)
        if compiled is None:
            compiled = kernel.compile((self.type, *(types.int64 for _ in numbers)))
            self._compiled[kernel] = compiled
        return compiled(self, *numbers)


def packed(arguments: Any, before: ArgumentPack | None) -> ArgumentPack:
    """Return a pack of these arguments: the one of before, if it holds the same objects."""
    if before is None or False in map(is_, before.arguments, arguments):
        return ArgumentPack(arguments)
    return before


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
    raise TypeError(f'a {kind} cannot be packed, only arrays and numbers of 64 bits')


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


class _PackModel(_PrimitiveModel):

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _POINTER)

    def from_argument(self, builder: Any, value: Any) -> Any:
        """Return the address; what lies there stays as it is."""
        return nobody_writes(value, self._fe_type.slots)


def _unbox(kind: Any, pack: Any, c: Any) -> Any:
    address = c.pyapi.object_getattr_string(pack, 'address')
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


class _Attributes(_Template):
    key = PackType

    def generic_resolve(self, pack: Any, name: str) -> Any:
        """Return the type of an attribute, None if there is none of this name."""
        return pack.fields[name][1] if name in pack.fields else None


def _attribute(context: Any, builder: Any, kind: Any, pack: Any, name: str) -> Any:
    first, member, is_packed = kind.fields[name]
    return read(builder, pack, first, member, is_packed)


register_model(PackType, _PackModel)
register_unboxing(PackType, _unbox)
typings.register_attr(_Attributes)
lowerings.lower_getattr_generic(PackType)(_attribute)
