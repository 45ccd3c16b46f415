# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The complete dynamic state of a world as bytes.

A JSON header that names the arrays, then their raw little-endian numbers, then a checksum: nothing
is rounded, and a part that is missing or changed is noticed.
"""

from collections.abc import Mapping
import json
import struct
from typing import Any
import zlib

import numpy as np

_MAGIC = b'RSIMSNAP'
_PREFIX = struct.Struct('<8sII')  # magic, bytes of the header, checksum of all that follows


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


def _checksum(header_size: int, body: bytes) -> int:
    return zlib.crc32(body, header_size)


def unpack(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return what `pack` was given; ValueError when the bytes are not such a snapshot."""
    if len(data) < _PREFIX.size or data[:8] != _MAGIC:
        raise ValueError(f'{len(data)} bytes are not a snapshot of a world: use World.save()')
    _, header_size, checksum = _PREFIX.unpack_from(data)
    body = data[_PREFIX.size:]
    if _checksum(header_size, body) != checksum:
        raise ValueError(f'the snapshot of {len(data)} bytes is damaged: its checksum is '
                         f'{_checksum(header_size, body):08x}, must be {checksum:08x}')
    header = json.loads(body[:header_size])
    arrays = {}
    offset = header_size
    for name, dtype, shape in header['arrays']:
        count = int(np.prod(shape, dtype=np.int64))
        array = np.frombuffer(body, dtype=dtype, count=count, offset=offset).reshape(shape)
        arrays[name] = array.astype(array.dtype.newbyteorder('='))
        offset += array.nbytes
    return header['meta'], arrays
