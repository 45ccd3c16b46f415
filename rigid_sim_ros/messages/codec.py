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
from struct import calcsize, pack, pack_into
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rigid_sim_ros.times import SECOND

_Floats = npt.NDArray[np.float64]
_Bytes = npt.NDArray[np.uint8]

_CDR_LE = b'\x00\x01\x00\x00'
_POSE = 7       # doubles: position, orientation
_TWIST = 6      # doubles: linear, angular
_DOUBLE = 8     # bytes
_IDENTITY = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)     # as a pose
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

    def number(self, kind: str, *values: float) -> int:
        """Write numbers of one kind, by its letter in `struct`."""
        raw = pack(f'<{len(values)}{kind}', *values)
        return self._append(raw, calcsize(f'<{kind}') if raw else 1)

    def doubles(self, count: int) -> int:
        """Leave room for doubles; an empty sequence is not aligned either."""
        return self._append(bytes(_DOUBLE * count), _DOUBLE if count else 1)

    def doubles_of(self, values: Any) -> int:
        """Write an array of doubles."""
        raw = np.asarray(values, dtype='<f8').tobytes()
        return self._append(raw, _DOUBLE if raw else 1)

    def string(self, text: str) -> int:
        raw = text.encode() + b'\0'
        self.number('I', len(raw))
        return self._append(raw, 1)

    def header(self, frame_id: str, t_ns: int = 0) -> int:
        offset = self.number('I', *divmod(t_ns, SECOND))
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
        self._stamps[:] = divmod(t_ns, SECOND)
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
        writer.number('I', count)
        for name in names:
            writer.string(name)
        writer.number('I', count)
        transforms = writer.doubles(_POSE * count)
        writer.number('I', count)
        twists = writer.doubles(_TWIST * count)
        writer.number('I', 0)     # no wrenches: what acts on a body has topics of its own
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
        self._stamp[:] = divmod(t_ns, SECOND)
        self._transforms[:, :3] = position
        self._transforms[:, 3:] = orientation
        self._twists[:, :3] = linear
        self._twists[:, 3:] = angular
        return self._data.tobytes()


class JointStateEncoder:
    """sensor_msgs/JointState: names, positions, velocities and efforts of some joints."""

    def __init__(self, names: Sequence[str]) -> None:
        writer, count = _Writer(), len(names)
        stamp = writer.header('')   # joint quantities have no frame
        writer.number('I', count)
        for name in names:
            writer.string(name)
        columns = []
        for _ in range(3):
            writer.number('I', count)
            columns.append(writer.doubles(count))
        self._data = writer.array()
        self._stamp = _view(self._data, stamp, _STAMP, (1,))
        self._columns = [_view(self._data, offset, '<f8', (count,)) for offset in columns]

    def encode(
        self, t_ns: int, position: _Floats, velocity: _Floats, effort: _Floats,
    ) -> bytes:
        """Encode the state of the joints, each (j,): rad, rad/s and N m, or m, m/s and N."""
        self._stamp[:] = divmod(t_ns, SECOND)
        for column, values in zip(self._columns, (position, velocity, effort), strict=True):
            column[:] = values
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
        stamp = np.array(divmod(t_ns, SECOND), dtype='<u4')
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
        writer.number('I', len(names))
        for name in names:
            stamps.append(writer.header(frame_id))
            writer.string(name)
            poses.append(writer.doubles(_POSE))
        super().__init__(writer, stamps, poses)


class _MarkerPlaces(NamedTuple):
    """Where in a message what changes of a marker begins."""

    stamp: int
    pose: int
    length: int     # of the list of points
    points: int


class MarkersEncoder(_Scattered):
    """visualization_msgs/MarkerArray: markers whose poses change and nothing else."""

    def __init__(self, frame_id: str, markers: Sequence[Marker]) -> None:
        writer = _Writer()
        places = _write_markers(writer, frame_id, markers)
        super().__init__(writer, [place.stamp for place in places],
                         [place.pose for place in places])


class PointMarkersEncoder:
    """visualization_msgs/MarkerArray: markers whose points change and nothing else."""

    def __init__(self, frame_id: str, markers: Sequence[Marker]) -> None:
        writer = _Writer()
        # With a point each: none at all would not be aligned, and further ones shift what follows
        # by 24 bytes, which changes no alignment.
        places = _write_markers(
            writer, frame_id, [marker._replace(points=[(0.0, 0.0, 0.0)]) for marker in markers])
        # Bytes up to the points, and the places of the stamp and of the number of points in them.
        self._pieces: list[tuple[bytearray, int, int]] = []
        begin = 0
        for place in places:
            pack_into(f'<{_POSE}d', writer.data, place.pose, *_IDENTITY)
            self._pieces.append((writer.data[begin:place.points], place.stamp - begin,
                                 place.length - begin))
            begin = place.points + 3 * _DOUBLE
        self._end = writer.data[begin:]

    def encode(self, t_ns: int, points: Sequence[_Floats]) -> bytes:
        """Encode the markers with these points: for each (n, 3) in m, n at least 1."""
        written: list[bytes | bytearray] = []
        for (piece, stamp, length), own in zip(self._pieces, points, strict=True):
            pack_into('<iI', piece, stamp, *divmod(t_ns, SECOND))
            pack_into('<I', piece, length, len(own))
            written += [piece, own.astype('<f8', copy=False).tobytes()]
        return b''.join([*written, self._end])


def _write_markers(
    writer: _Writer, frame_id: str, markers: Sequence[Marker],
) -> list[_MarkerPlaces]:
    writer.number('I', len(markers))
    return [_write_marker(writer, frame_id, marker) for marker in markers]


def _write_marker(writer: _Writer, frame_id: str, marker: Marker) -> _MarkerPlaces:
    stamp = writer.header(frame_id)
    writer.string(marker.namespace)
    writer.number('i', marker.id, marker.type, marker.action)
    pose = writer.doubles(_POSE)
    writer.number('d', *marker.scale)
    writer.number('f', *marker.color)
    writer.number('i', 0, 0)                # lifetime: for ever
    writer.number('B', 0)                   # frame_locked
    length = writer.number('I', len(marker.points))
    points = writer.doubles_of(marker.points)
    writer.number('I', 0)                   # colors: one for the whole marker
    writer.string('')                       # texture_resource
    writer.header('')                       # texture
    writer.string('')                       # texture.format
    writer.number('I', 0)                   # texture.data
    writer.number('I', 0)                   # uv_coordinates
    writer.string('')                       # text
    writer.string('')                       # mesh_resource
    writer.string('')                       # mesh_file.filename
    writer.number('I', 0)                   # mesh_file.data
    writer.number('B', 0)                   # mesh_use_embedded_materials
    return _MarkerPlaces(stamp, pose, length, points)


def encode_wrench(
    t_ns: int, frame_id: str, force: Iterable[float], torque: Iterable[float],
) -> bytes:
    """Encode a geometry_msgs/WrenchStamped; force (3) in N, torque (3) in Nm."""
    writer = _Writer()
    writer.header(frame_id, t_ns)
    writer.number('d', *force, *torque)
    return bytes(writer.data)


def encode_clock(t_ns: int) -> bytes:
    """Encode a rosgraph_msgs/Clock."""
    writer = _Writer()
    writer.number('I', *divmod(t_ns, SECOND))
    return bytes(writer.data)


def encode_uint64(value: int) -> bytes:
    """Encode a std_msgs/UInt64."""
    writer = _Writer()
    writer.number('Q', value)
    return bytes(writer.data)


def encode_string(text: str) -> bytes:
    """Encode a std_msgs/String."""
    writer = _Writer()
    writer.string(text)
    return bytes(writer.data)


def encode_bytes(data: bytes) -> bytes:
    """Encode a std_msgs/UInt8MultiArray of one dimension that is not described."""
    writer = _Writer()
    writer.number('I', 0, 0, len(data))   # layout.dim, layout.data_offset, data
    writer.data += data
    return bytes(writer.data)


def encode_diagnostics(t_ns: int, statuses: Sequence[Status]) -> bytes:
    """Encode a diagnostic_msgs/DiagnosticArray."""
    writer = _Writer()
    writer.header('', t_ns)
    writer.number('I', len(statuses))
    for status in statuses:
        writer.number('B', status.level)
        writer.string(status.name)
        writer.string(status.message)
        writer.string(status.hardware_id)
        writer.number('I', len(status.values))
        for key, value in status.values:
            writer.string(key)
            writer.string(value)
    return bytes(writer.data)
