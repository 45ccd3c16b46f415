# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Every message of the codec against the two codecs of others: rclpy's and rosbags'.

rosbags fills alignment gaps with zeros as this codec does, so its bytes must be ours. Fast CDR
leaves whatever its buffer held in the gaps, so there a byte may differ if, and only if, changing
it changes nothing of the message that is read back.
"""
from importlib.util import find_spec
from typing import Any
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point, Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3, Wrench,
    WrenchStamped)
from hypothesis import given, HealthCheck, settings, strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import get_typestore, Stores
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import ColorRGBA, Header, String, UInt64
from visualization_msgs.msg import Marker, MarkerArray

from rigid_sim_ros.messages import codec, decode

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)

# Any text without NUL, which ends a string in CDR; lengths around the alignments of 4 and 8.
texts = st.text(
    st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=18)
times = st.integers(0, 2**31 * 1_000_000_000 - 1)
doubles = st.floats(allow_nan=False)
counts = st.integers(0, 5)
seeds = st.integers(0, 2**32 - 1)
many = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def header(t_ns: int, frame_id: str) -> Header:
    sec, nanosec = divmod(t_ns, 1_000_000_000)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame_id)


def values(seed: int, count: int, width: int) -> np.ndarray:
    """Return doubles of all magnitudes, so that each of their bytes matters."""
    rng = np.random.default_rng(seed + width)
    return rng.standard_normal((count, width)) * 10.0 ** rng.integers(-9, 9, (count, width))


def vector(row: Any) -> Vector3:
    return Vector3(**dict(zip('xyz', map(float, row), strict=True)))


def point(row: Any) -> Point:
    return Point(**dict(zip('xyz', map(float, row), strict=True)))


def quaternion(row: Any) -> Quaternion:
    return Quaternion(**dict(zip('xyzw', map(float, row), strict=True)))


def check(ours: bytes, message: Any, ros_type: str) -> None:
    """Compare the bytes with rclpy's and rosbags', and the fields with what rclpy reads."""
    assert type(ours) is bytes      # Publisher.publish takes nothing else
    assert deserialize_message(ours, type(message)) == message

    fast_cdr = serialize_message(message)
    assert len(ours) == len(fast_cdr)
    for k in range(len(ours)):
        if ours[k] != fast_cdr[k]:
            changed = bytearray(ours)
            changed[k] = fast_cdr[k]
            assert ours[k] == 0
            assert deserialize_message(bytes(changed), type(message)) == message, k

    again = TYPESTORE.serialize_cdr(TYPESTORE.deserialize_cdr(ours, ros_type), ros_type)
    assert ours == bytes(again)


@many
@given(times, texts, counts, seeds)
def test_poses_are_what_rclpy_writes(t_ns, frame_id, count, seed):
    p, q = values(seed, count, 3), values(seed, count, 4)
    messages = codec.PoseEncoder(frame_id, count).encode(t_ns, p, q)
    assert len(messages) == count
    for ours, position, orientation in zip(messages, p, q, strict=True):
        pose = Pose(position=point(position), orientation=quaternion(orientation))
        check(ours, PoseStamped(header=header(t_ns, frame_id), pose=pose),
              'geometry_msgs/msg/PoseStamped')


@many
@given(times, texts, counts, seeds)
def test_twists_are_what_rclpy_writes(t_ns, frame_id, count, seed):
    v, w = values(seed, count, 3), values(seed + 1, count, 3)
    messages = codec.TwistEncoder(frame_id, count).encode(t_ns, v, w)
    assert len(messages) == count
    for ours, linear, angular in zip(messages, v, w, strict=True):
        twist = Twist(linear=vector(linear), angular=vector(angular))
        check(ours, TwistStamped(header=header(t_ns, frame_id), twist=twist),
              'geometry_msgs/msg/TwistStamped')


@many
@given(times, texts, st.lists(texts, max_size=5), seeds)
def test_the_state_is_what_rclpy_writes(t_ns, frame_id, names, seed):
    count = len(names)
    p, q = values(seed, count, 3), values(seed, count, 4)
    v, w = values(seed + 1, count, 3), values(seed + 2, count, 3)
    ours = codec.StateEncoder(frame_id, names).encode(t_ns, p, q, v, w)
    check(ours, MultiDOFJointState(
        header=header(t_ns, frame_id),
        joint_names=names,
        transforms=[
            Transform(translation=vector(a), rotation=quaternion(b))
            for a, b in zip(p, q, strict=True)],
        twist=[Twist(linear=vector(a), angular=vector(b)) for a, b in zip(v, w, strict=True)],
    ), 'sensor_msgs/msg/MultiDOFJointState')


@many
@given(times, st.lists(texts, min_size=1, max_size=5), seeds)   # nobody publishes none
def test_the_state_of_joints_is_what_rclpy_writes_and_is_read_back(t_ns, names, seed):
    columns = values(seed, 3, len(names))
    ours = codec.JointStateEncoder(names).encode(t_ns, *columns)
    position, velocity, effort = columns.tolist()
    check(ours, JointState(header=header(t_ns, ''), name=names, position=position,
                           velocity=velocity, effort=effort), 'sensor_msgs/msg/JointState')
    at, frame, found, numbers = decode.joint_state(ours)
    assert (at, frame, found) == (t_ns, '', names)
    assert numbers.T.tolist() == columns.tolist()


def test_a_state_of_joints_may_lack_columns_and_not_rows():
    def written(**columns):
        return serialize_message(JointState(name=['a', 'b'], **columns))
    numbers = decode.joint_state(written(velocity=[1.0, 2.0]))[3]
    assert numbers[:, 1].tolist() == [1.0, 2.0]
    assert np.isnan(numbers[:, [0, 2]]).all()
    whole = written(position=[1.0, 2.0])
    for data in (written(position=[1.0]), whole[:-9], b'', b'\x00\x01\x00\x00' + b'\xff' * 40):
        with pytest.raises(decode.Malformed):
            decode.joint_state(data)


def test_an_encoder_keeps_nothing_of_the_call_before():
    p, q = values(1, 3, 3), values(1, 3, 4)
    encoder = codec.PoseEncoder('world', 3)
    first = encoder.encode(5, p, q)
    encoder.encode(6, p + 1, q + 1)
    assert encoder.encode(5, p, q) == first
    state = codec.StateEncoder('world', ['a', 'b', 'c'])
    before = state.encode(5, p, q, p, p)
    kept = bytes(before)
    state.encode(6, p + 1, q + 1, p, p)
    assert before == kept
    assert state.encode(5, p, q, p, p) == kept


@many
@given(times, texts, st.lists(doubles, min_size=6, max_size=6))
def test_a_wrench_is_what_rclpy_writes(t_ns, frame_id, six):
    ours = codec.encode_wrench(t_ns, frame_id, six[:3], six[3:])
    wrench = Wrench(force=vector(six[:3]), torque=vector(six[3:]))
    check(ours, WrenchStamped(header=header(t_ns, frame_id), wrench=wrench),
          'geometry_msgs/msg/WrenchStamped')


@many
@given(times)
def test_a_clock_is_what_rclpy_writes(t_ns):
    check(codec.encode_clock(t_ns), Clock(clock=header(t_ns, '').stamp),
          'rosgraph_msgs/msg/Clock')


@many
@given(st.integers(0, 2**64 - 1))
def test_a_hash_is_what_rclpy_writes(value):
    check(codec.encode_uint64(value), UInt64(data=value), 'std_msgs/msg/UInt64')


@many
@given(texts)
def test_a_string_is_what_rclpy_writes(text):
    check(codec.encode_string(text), String(data=text), 'std_msgs/msg/String')


pairs = st.lists(st.tuples(texts, texts), max_size=3)
statuses = st.builds(codec.Status, st.integers(0, 3), texts, texts, texts, pairs)


@many
@given(times, st.lists(statuses, max_size=3))
def test_diagnostics_are_what_rclpy_writes(t_ns, given_statuses):
    ours = codec.encode_diagnostics(t_ns, given_statuses)
    check(ours, DiagnosticArray(header=header(t_ns, ''), status=[
        DiagnosticStatus(
            level=bytes([s.level]), name=s.name, message=s.message, hardware_id=s.hardware_id,
            values=[KeyValue(key=k, value=v) for k, v in s.values])
        for s in given_statuses]), 'diagnostic_msgs/msg/DiagnosticArray')


# The colours are float32: multiples of 1/256 are exact in it.
color = st.tuples(*[st.integers(0, 256).map(lambda k: k / 256)] * 4)
triples = st.tuples(doubles, doubles, doubles)
markers = st.builds(
    codec.Marker, texts, st.integers(-2**31, 2**31 - 1), st.integers(0, 11), triples, color,
    st.lists(triples, max_size=4), st.integers(0, 3))


@many
@given(times, texts, st.lists(markers, max_size=4), seeds)
def test_markers_are_what_rclpy_writes(t_ns, frame_id, given_markers, seed):
    count = len(given_markers)
    p, q = values(seed, count, 3), values(seed, count, 4)
    encoder = codec.MarkersEncoder(frame_id, given_markers)
    encoder.encode(1, p + 1, q + 1)
    expected = [
        Marker(
            header=header(t_ns, frame_id), ns=m.namespace, id=m.id, type=m.type, action=m.action,
            pose=Pose(position=point(a), orientation=quaternion(b)), scale=vector(m.scale),
            color=ColorRGBA(**dict(zip('rgba', m.color, strict=True))),
            points=[point(c) for c in m.points])
        for m, a, b in zip(given_markers, p, q, strict=True)]
    check(encoder.encode(t_ns, p, q), MarkerArray(markers=expected),
          'visualization_msgs/msg/MarkerArray')


@many
@given(times, texts, st.lists(st.tuples(markers, st.integers(1, 5)), max_size=4), seeds)
def test_markers_with_other_points_are_as_if_they_were_made_with_them(t_ns, frame_id, made, seed):
    encoder = codec.PointMarkersEncoder(frame_id, [marker for marker, _ in made])
    encoder.encode(1, [np.ones((k + 1, 3)) for k in range(len(made))])
    points = [values(seed + k, count, 3) for k, (_, count) in enumerate(made)]
    whole = codec.MarkersEncoder(frame_id, [
        marker._replace(points=own) for (marker, _), own in zip(made, points, strict=True)])
    ours = encoder.encode(t_ns, points)
    assert type(ours) is bytes
    assert ours == whole.encode(
        t_ns, np.zeros((len(made), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(made), 1)))


@many
@given(times, texts, st.lists(texts, max_size=5), seeds)
def test_transforms_are_what_rosbags_writes(t_ns, frame_id, names, seed):
    # tf2_msgs is not among the ROS wheels: rosbags, which knows the type, is the other codec.
    p, q = values(seed, len(names), 3), values(seed, len(names), 4)
    encoder = codec.TransformsEncoder(frame_id, names)
    encoder.encode(1, p + 1, q + 1)
    ours = encoder.encode(t_ns, p, q)
    ros_type = 'tf2_msgs/msg/TFMessage'
    message: Any = TYPESTORE.deserialize_cdr(ours, ros_type)
    assert ours == bytes(TYPESTORE.serialize_cdr(message, ros_type))
    stamp = divmod(t_ns, 1_000_000_000)
    assert [t.child_frame_id for t in message.transforms] == names
    for t, position, orientation in zip(message.transforms, p, q, strict=True):
        assert (t.header.stamp.sec, t.header.stamp.nanosec) == stamp
        assert t.header.frame_id == frame_id
        moved, turned = t.transform.translation, t.transform.rotation
        assert [moved.x, moved.y, moved.z] == position.tolist()
        assert [turned.x, turned.y, turned.z, turned.w] == orientation.tolist()
