# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages that a bag adds, from their bytes: the other half of codec.py for these."""

import struct

from rigid_sim_ros.bag.errors import Damaged

_STRING = struct.Struct('<4xI')
_UINT64 = struct.Struct('<4xQ')
_BYTES = struct.Struct('<4xIII')


def string(data: bytes) -> str:
    """Return the text of a std_msgs/String."""
    try:
        length, = _STRING.unpack_from(data)
        text = data[_STRING.size:_STRING.size + length]
        if len(text) != length or not length:
            raise ValueError(f'{len(text)} of {length} bytes')
        return text[:-1].decode()
    except (struct.error, ValueError) as error:
        raise Damaged(f'a text is damaged ({error})') from None


def uint64(data: bytes) -> int:
    """Return the number of a std_msgs/UInt64."""
    if len(data) != _UINT64.size:
        raise Damaged(f'a number is damaged ({len(data)} bytes)')
    return int(_UINT64.unpack(data)[0])


def byte_array(data: bytes) -> bytes:
    """Return the bytes of a std_msgs/UInt8MultiArray without layout."""
    if len(data) < _BYTES.size or _BYTES.unpack_from(data) != (0, 0, len(data) - _BYTES.size):
        raise Damaged(f'an array of bytes is damaged ({len(data)} bytes)')
    return data[_BYTES.size:]
