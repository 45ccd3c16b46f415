# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages as CDR bytes: the only encoder of this package.

What a node publishes and what a bag keeps are the same bytes, made here once. No ROS is imported.

The messages of many bodies at once are templates: everything that stays (frame ids, names,
lengths, padding) is written when the encoder is made, and each call patches the stamps and the
doubles of all bodies with NumPy. The format is plain CDR, little endian (XCDR1, OMG DDSI-RTPS 2.5,
section 10): four bytes of encapsulation header, then every value aligned to its own size counted
from behind that header; a string is its length with the closing NUL, its bytes, the NUL.
"""
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]
_Bytes = npt.NDArray[np.uint8]

_CDR_LE = b'\x00\x01\x00\x00'
_SECOND = 1_000_000_000
_POSE = 7       # doubles: position, orientation
_TWIST = 6      # doubles: linear, angular
_DOUBLE = 8     # bytes
_STAMP = np.dtype([('sec', '<i4'), ('nanosec', '<u4')])


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus; values are pairs of key and text."""

    level: int          # 0 ok, 1 warning, 2 error, 3 stale
    name: str
    message: str
    hardware_id: str
    values: Sequence[tuple[str, str]]


class Marker(NamedTuple):
    """What stays the same about one visualization_msgs/Marker; its pose comes with each call."""

    namespace: str
    id: int             # unique within the namespace
    type: int           # visualization_msgs/Marker: ARROW 0, CUBE 1, SPHERE 2, CYLINDER 3, ...
    scale: tuple[float, float, float]           # m
    color: tuple[float, float, float, float]    # red, green, blue, alpha, each 0 to 1
    points: Sequence[Sequence[float]] | _Floats = ()    # m, in the marker's own frame
    action: int = 0     # ADD


class _Writer:
    """Appends values to one CDR message; each method returns the offset of what it wrote."""

    def __init__(self) -> None:
        self.data = bytearray(_CDR_LE)

    def _append(self, raw: bytes, alignment: int) -> int:
        self.data += bytes(-(len(self.data) - len(_CDR_LE)) % alignment)
        self.data += raw
        return len(self.data) - len(raw)

    def number(self, dtype: str, *values: float) -> int:
        raw = np.array(values, dtype=dtype).tobytes()
        return self._append(raw, np.dtype(dtype).itemsize if raw else 1)

    def doubles(self, count: int) -> int:
        """Leave room for doubles; an empty sequence is not aligned either."""
        return self._append(bytes(_DOUBLE * count), _DOUBLE if count else 1)

    def string(self, text: str) -> int:
        raw = text.encode() + b'\0'
        self.number('<u4', len(raw))
        return self._append(raw, 1)

    def header(self, frame_id: str, t_ns: int = 0) -> int:
        offset = self.number('<u4', *divmod(t_ns, _SECOND))
        self.string(frame_id)
        return offset

    def array(self) -> _Bytes:
        return np.frombuffer(self.data, dtype=np.uint8)     # writable: the bytearray's own memory


def _view(data: _Bytes, offset: int, dtype: npt.DTypeLike, shape: tuple[int, ...]) -> Any:
    # A double in CDR starts at a multiple of 8 behind the 4 header bytes: NumPy handles the view
    # although it is not aligned in memory.
    return np.ndarray(shape, dtype=dtype, buffer=data, offset=offset)


class _Rows:
    """One message of equal length per body: header and `width` doubles."""

    def __init__(self, frame_id: str, count: int, width: int) -> None:
        writer = _Writer()
        writer.header(frame_id)
        offset = writer.doubles(width)
        self._size = len(writer.data)
        fields = {
            'names': ['stamp', 'doubles'],
            'formats': [_STAMP, ('<f8', (width,))],
            'offsets': [len(_CDR_LE), offset],
            'itemsize': self._size,
        }
        memory = np.tile(writer.array(), count)
        self._rows = memory.view(np.dtype(fields))  # type: ignore[call-overload]
        self._stamps = self._rows['stamp']
        self._doubles = self._rows['doubles']

    def _encode(self, t_ns: int, first: _Floats, second: _Floats) -> list[bytes]:
        self._stamps[:] = divmod(t_ns, _SECOND)
        self._doubles[:, :3] = first
        self._doubles[:, 3:] = second
        data, size = self._rows.tobytes(), self._size
        return [data[start:start + size] for start in range(0, len(data), size)]


class PoseEncoder(_Rows):
    """geometry_msgs/PoseStamped for each of `count` bodies, all in `frame_id`."""

    def __init__(self, frame_id: str, count: int) -> None:
        super().__init__(frame_id, count, _POSE)

    def encode(self, t_ns: int, position: _Floats, orientation: _Floats) -> list[bytes]:
        """
        Encode one message a body.

        position is (n, 3) in m, orientation (n, 4) as x, y, z, w.
        """
        return self._encode(t_ns, position, orientation)


class TwistEncoder(_Rows):
    """geometry_msgs/TwistStamped for each of `count` bodies, all in `frame_id`."""

    def __init__(self, frame_id: str, count: int) -> None:
        super().__init__(frame_id, count, _TWIST)

    def encode(self, t_ns: int, linear: _Floats, angular: _Floats) -> list[bytes]:
        """
        Encode one message a body.

        linear is (n, 3) in m/s, angular (n, 3) in rad/s.
        """
        return self._encode(t_ns, linear, angular)


class StateEncoder:
    """sensor_msgs/MultiDOFJointState: names, poses and twists of all bodies in one message."""

    def __init__(self, frame_id: str, names: Sequence[str]) -> None:
        writer, count = _Writer(), len(names)
        stamp = writer.header(frame_id)
        writer.number('<u4', count)
        for name in names:
            writer.string(name)
        writer.number('<u4', count)
        transforms = writer.doubles(_POSE * count)
        writer.number('<u4', count)
        twists = writer.doubles(_TWIST * count)
        writer.number('<u4', 0)     # no wrenches: what acts on a body has topics of its own
        self._data = writer.array()
        self._stamp = _view(self._data, stamp, _STAMP, (1,))
        self._transforms = _view(self._data, transforms, '<f8', (count, _POSE))
        self._twists = _view(self._data, twists, '<f8', (count, _TWIST))

    def encode(
        self, t_ns: int, position: _Floats, orientation: _Floats, linear: _Floats,
        angular: _Floats,
    ) -> bytes:
        """
        Encode the state of all bodies.

        position is (n, 3) in m, orientation (n, 4) as x, y, z, w, linear (n, 3) in m/s and
        angular (n, 3) in rad/s.
        """
        self._stamp[:] = divmod(t_ns, _SECOND)
        self._transforms[:, :3] = position
        self._transforms[:, 3:] = orientation
        self._twists[:, :3] = linear
        self._twists[:, 3:] = angular
        return self._data.tobytes()


class _Scattered:
    """Stamps and poses at any places of one message, whose strings shift what follows them."""

    def __init__(self, writer: _Writer, stamps: list[int], poses: list[int]) -> None:
        self._data = writer.array()
        self._at_stamps = np.array(stamps, dtype=np.intp)[:, None] + np.arange(_STAMP.itemsize)
        self._at_poses = np.array(poses, dtype=np.intp)[:, None] + np.arange(_POSE * _DOUBLE)
        self._poses = np.empty((len(poses), _POSE))

    def encode(self, t_ns: int, position: _Floats, orientation: _Floats) -> bytes:
        """
        Encode the message with these poses.

        position is (n, 3) in m, orientation (n, 4) as x, y, z, w.
        """
        stamp = np.array(divmod(t_ns, _SECOND), dtype='<u4')
        self._poses[:, :3] = position
        self._poses[:, 3:] = orientation
        self._data[self._at_stamps] = stamp.view(np.uint8)
        self._data[self._at_poses] = self._poses.view(np.uint8)
        return self._data.tobytes()


class TransformsEncoder(_Scattered):
    """tf2_msgs/TFMessage: the transform from `frame_id` to each body."""

    def __init__(self, frame_id: str, names: Sequence[str]) -> None:
        writer = _Writer()
        stamps, poses = [], []
        writer.number('<u4', len(names))
        for name in names:
            stamps.append(writer.header(frame_id))
            writer.string(name)
            poses.append(writer.doubles(_POSE))
        super().__init__(writer, stamps, poses)


class MarkersEncoder(_Scattered):
    """visualization_msgs/MarkerArray: markers whose poses change and nothing else."""

    def __init__(self, frame_id: str, markers: Sequence[Marker]) -> None:
        writer = _Writer()
        stamps, poses = [], []
        writer.number('<u4', len(markers))
        for marker in markers:
            stamp, pose = self._write(writer, frame_id, marker)
            stamps.append(stamp)
            poses.append(pose)
        super().__init__(writer, stamps, poses)

    @staticmethod
    def _write(writer: _Writer, frame_id: str, marker: Marker) -> tuple[int, int]:
        stamp = writer.header(frame_id)
        writer.string(marker.namespace)
        writer.number('<i4', marker.id, marker.type, marker.action)
        pose = writer.doubles(_POSE)
        writer.number('<f8', *marker.scale)
        writer.number('<f4', *marker.color)
        writer.number('<i4', 0, 0)              # lifetime: for ever
        writer.number('|u1', 0)                 # frame_locked
        writer.number('<u4', len(marker.points))
        points = np.asarray(marker.points, dtype='<f8')
        writer._append(points.tobytes(), _DOUBLE if points.size else 1)
        writer.number('<u4', 0)                 # colors: one for the whole marker
        writer.string('')                       # texture_resource
        writer.header('')                       # texture
        writer.string('')                       # texture.format
        writer.number('<u4', 0)                 # texture.data
        writer.number('<u4', 0)                 # uv_coordinates
        writer.string('')                       # text
        writer.string('')                       # mesh_resource
        writer.string('')                       # mesh_file.filename
        writer.number('<u4', 0)                 # mesh_file.data
        writer.number('|u1', 0)                 # mesh_use_embedded_materials
        return stamp, pose


def encode_wrench(
    t_ns: int, frame_id: str, force: Iterable[float], torque: Iterable[float],
) -> bytes:
    """Encode a geometry_msgs/WrenchStamped; force (3) in N, torque (3) in Nm."""
    writer = _Writer()
    writer.header(frame_id, t_ns)
    writer.number('<f8', *force, *torque)
    return bytes(writer.data)


def encode_clock(t_ns: int) -> bytes:
    """Encode a rosgraph_msgs/Clock."""
    writer = _Writer()
    writer.number('<u4', *divmod(t_ns, _SECOND))
    return bytes(writer.data)


def encode_uint64(value: int) -> bytes:
    """Encode a std_msgs/UInt64."""
    writer = _Writer()
    writer.number('<u8', value)
    return bytes(writer.data)


def encode_string(text: str) -> bytes:
    """Encode a std_msgs/String."""
    writer = _Writer()
    writer.string(text)
    return bytes(writer.data)


def encode_bytes(data: bytes) -> bytes:
    """Encode a std_msgs/UInt8MultiArray of one dimension that is not described."""
    writer = _Writer()
    writer.number('<u4', 0, 0, len(data))   # layout.dim, layout.data_offset, data
    writer.data += data
    return bytes(writer.data)


def encode_diagnostics(t_ns: int, statuses: Sequence[Status]) -> bytes:
    """Encode a diagnostic_msgs/DiagnosticArray."""
    writer = _Writer()
    writer.header('', t_ns)
    writer.number('<u4', len(statuses))
    for status in statuses:
        writer.number('|u1', status.level)
        writer.string(status.name)
        writer.string(status.message)
        writer.string(status.hardware_id)
        writer.number('<u4', len(status.values))
        for key, value in status.values:
            writer.string(key)
            writer.string(value)
    return bytes(writer.data)
