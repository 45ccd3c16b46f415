# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages from their bytes: the other half of codec.py, for those that this package reads itself.

Malformed where the bytes are no such message.
"""

import struct

import numpy as np
import numpy.typing as npt

from rigid_sim_ros.times import SECOND

_STRING = struct.Struct('<4xI')
_UINT64 = struct.Struct('<4xQ')
_BYTES = struct.Struct('<4xIII')


class Malformed(ValueError):
    """Bytes that are not a message of their type."""


def string(data: bytes) -> str:
    """Return the text of a std_msgs/String."""
    try:
        length, = _STRING.unpack_from(data)
        text = data[_STRING.size:_STRING.size + length]
        if len(text) != length or not length:
            raise ValueError(f'{len(text)} of {length} bytes')
        return text[:-1].decode()
    except (struct.error, ValueError) as error:
        raise Malformed(f'a text is damaged ({error})') from None


def uint64(data: bytes) -> int:
    """Return the number of a std_msgs/UInt64."""
    if len(data) != _UINT64.size:
        raise Malformed(f'a number is damaged ({len(data)} bytes)')
    return int(_UINT64.unpack(data)[0])


def byte_array(data: bytes) -> bytes:
    """Return the bytes of a std_msgs/UInt8MultiArray without layout."""
    if len(data) < _BYTES.size or _BYTES.unpack_from(data) != (0, 0, len(data) - _BYTES.size):
        raise Malformed(f'an array of bytes is damaged ({len(data)} bytes)')
    return data[_BYTES.size:]


def multi_dof_state(data: bytes) -> tuple[int, str, list[str], npt.NDArray[np.float64]]:
    """
    Return time [ns], frame, names and numbers of a sensor_msgs/MultiDOFJointState.

    The numbers are a row for each name: position, orientation, linear and angular velocity; nan
    where the message has no twists.
    """
    walk = _Walk(data)
    t_ns, frame = walk.header()
    names = [walk.string() for _ in range(walk.uint32())]
    numbers = np.full((len(names), 13), np.nan)
    for columns in (slice(0, 7), slice(7, 13)):
        count, width = walk.uint32(), columns.stop - columns.start
        if count not in (0, len(names)):
            raise Malformed(f'a state of {len(names)} bodies has {count} poses or twists')
        if count:
            numbers[:, columns] = walk.doubles(count * width).reshape(count, width)
    return t_ns, frame, names, numbers


def joint_state(data: bytes) -> tuple[int, str, list[str], npt.NDArray[np.float64]]:
    """
    Return time [ns], frame, names and numbers of a sensor_msgs/JointState.

    The numbers are a row for each name: position, velocity, effort; nan where it has none.
    """
    walk = _Walk(data)
    t_ns, frame = walk.header()
    names = [walk.string() for _ in range(walk.uint32())]
    numbers = np.full((len(names), 3), np.nan)
    for column in range(3):
        count = walk.uint32()
        if count not in (0, len(names)):
            raise Malformed(f'a state of {len(names)} joints has {count} positions, velocities or '
                            'efforts')
        if count:
            numbers[:, column] = walk.doubles(count)
    return t_ns, frame, names, numbers


def wrench(data: bytes) -> tuple[int, str, npt.NDArray[np.float64]]:
    """Return time [ns], frame, and force and torque as (1, 6), of a WrenchStamped."""
    walk = _Walk(data)
    t_ns, frame = walk.header()
    return t_ns, frame, walk.doubles(6).reshape(1, 6)


class _Walk:
    """Goes through one CDR message."""

    def __init__(self, data: bytes) -> None:
        if data[:2] != b'\x00\x01':
            raise Malformed('a message is not little-endian CDR')
        self._data = data
        self._position = 4

    def _take(self, size: int, alignment: int) -> int:
        start = self._position + -(self._position - 4) % alignment
        if start + size > len(self._data):
            raise Malformed(f'a message of {len(self._data)} bytes breaks off')
        self._position = start + size
        return start

    def uint32(self) -> int:
        return int.from_bytes(self._data[(start := self._take(4, 4)):start + 4], 'little')

    def string(self) -> str:
        length = self.uint32()
        start = self._take(length, 1)
        try:
            return self._data[start:start + length].rstrip(b'\0').decode()
        except UnicodeDecodeError as error:
            raise Malformed(f'a name is damaged ({error})') from None

    def header(self) -> tuple[int, str]:
        t_ns = self.uint32() * SECOND + self.uint32()
        return t_ns, self.string()

    def doubles(self, count: int) -> npt.NDArray[np.float64]:
        return np.frombuffer(self._data, '<f8', count, self._take(8 * count, 8))
