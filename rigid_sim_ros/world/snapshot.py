# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The complete dynamic state of a world as bytes.

A JSON header that names the arrays, then their raw little-endian numbers, then a checksum: nothing
is rounded, and a part that is missing or changed is noticed. What goes in, and the hash of it:
saving.py.
"""

from collections.abc import Mapping
import json
from math import prod
from operator import index
import struct
from typing import Any
import zlib

import numpy as np

_MAGIC = b'RSIMSNAP'
_PREFIX = struct.Struct('<8sII')  # magic, bytes of the header, checksum of all that follows

# The types of numbers that a world is made of, by their names in the header.
_TYPES = {name: np.dtype(name) for name in ('<f8', '<i8', '<i4', '|i1')}


def pack(meta: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """Return the bytes of some JSON-like facts and named arrays of numbers."""
    raw = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    layout = [[name, array.dtype.newbyteorder('<').str, list(array.shape)]
              for name, array in raw.items()]
    header = json.dumps({'meta': dict(meta), 'arrays': layout}).encode()
    body = header + b''.join(
        array.astype(array.dtype.newbyteorder('<'), copy=False).tobytes()
        for array in raw.values())
    return _PREFIX.pack(_MAGIC, len(header), _checksum(len(header), body)) + body


def are_same(one: bytes, other: bytes) -> bool:
    """Return whether two snapshots say the same of a world, whichever version saved them."""
    if one == other:
        return True
    try:
        (meta, arrays), (others_meta, others_arrays) = unpack(one), unpack(other)
    except ValueError:
        return False
    return ({**meta, 'version': ''} == {**others_meta, 'version': ''}
            and arrays.keys() == others_arrays.keys()
            and all(array.shape == others_arrays[name].shape
                    and array.dtype == others_arrays[name].dtype
                    and array.tobytes() == others_arrays[name].tobytes()
                    for name, array in arrays.items()))


def _checksum(header_size: int, body: bytes) -> int:
    return zlib.crc32(body, header_size)


def unpack(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """
    Return what `pack` was given; ValueError when the bytes are not such a snapshot.

    The arrays have the layout that the header tells of. What their numbers mean is not looked at.
    """
    if len(data) < _PREFIX.size or data[:8] != _MAGIC:
        raise ValueError(f'{len(data)} bytes are not a snapshot of a world: use World.save()')
    _, header_size, checksum = _PREFIX.unpack_from(data)
    body = data[_PREFIX.size:]
    if _checksum(header_size, body) != checksum:
        raise ValueError(f'the snapshot of {len(data)} bytes is damaged: its checksum is '
                         f'{_checksum(header_size, body):08x}, must be {checksum:08x}')
    try:
        header = json.loads(body[:header_size])
        meta, layout = dict(header['meta']), [
            (str(name), _TYPES[dtype], tuple(map(index, shape)))
            for name, dtype, shape in header['arrays']]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ValueError('the header of the snapshot makes no sense '
                         f'({type(error).__name__}): use World.save()') from None
    arrays: dict[str, np.ndarray] = {}
    offset = header_size
    for name, kind, shape in layout:
        # In Python's integers, which do not overflow.
        count = prod(shape)
        if min(shape, default=0) < 0 or name in arrays or (
                count * kind.itemsize > len(body) - offset):
            raise ValueError(f'the snapshot of {len(data)} bytes holds no array {name!r} of shape '
                             f'{shape} and type {kind}: use World.save()')
        array = np.frombuffer(body, dtype=kind, count=count, offset=offset).reshape(shape)
        arrays[name] = array.astype(array.dtype.newbyteorder('='))
        offset += array.nbytes
    if offset != len(body):
        raise ValueError(f'the snapshot holds {len(body) - offset} bytes that belong to no array: '
                         'use World.save()')
    return meta, arrays
