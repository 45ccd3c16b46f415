# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The QoS of publishers that stand in for those that were recorded, and what overrides it."""

from typing import Any

from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSPolicyKind, QoSProfile,
    ReliabilityPolicy)
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.validate_topic_name import validate_topic_name
from ruamel.yaml import YAML, YAMLError

from rigid_sim_ros.bag.offered_qos import (
    AUTOMATIC, BEST_EFFORT, MANUAL_BY_TOPIC, OfferedQos, RELIABLE, TRANSIENT_LOCAL, VOLATILE)
from rigid_sim_ros.nodes.declaring import given_names, ParameterError
from rigid_sim_ros.reading import bytes_of
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.words import nearest

# [bytes] Of a file of overrides, some hundred for each topic.
_MOST_BYTES = 2 ** 20

# What is not known is as ROS does it by default.
_RELIABILITY = {
    RELIABLE: ReliabilityPolicy.RELIABLE,
    BEST_EFFORT: ReliabilityPolicy.BEST_EFFORT,
    '': ReliabilityPolicy.RELIABLE,
}
_DURABILITY = {
    TRANSIENT_LOCAL: DurabilityPolicy.TRANSIENT_LOCAL,
    VOLATILE: DurabilityPolicy.VOLATILE,
    '': DurabilityPolicy.VOLATILE,
}
_LIVELINESS = {
    AUTOMATIC: LivelinessPolicy.AUTOMATIC,
    MANUAL_BY_TOPIC: LivelinessPolicy.MANUAL_BY_TOPIC,
    '': LivelinessPolicy.SYSTEM_DEFAULT,
}

# A queue is no part of what publishers and subscribers agree on. At least this many messages find
# a place in it: what a subscriber misses that gets no time for a while is sent once more only as
# long as it is in the queue. At 20 times the speed 100 messages of 100 Hz are 0.05 s.
_LEAST_DEPTH = 1000
_MOST_DEPTH = 10_000

CLOCK_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)


def profile(qos: OfferedQos) -> QoSProfile:
    """Return the profile of a publisher that offers what the recorded ones offered."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=qos.kept or min(max(qos.depth, _LEAST_DEPTH), _MOST_DEPTH),
        reliability=_RELIABILITY[qos.reliability],
        durability=_DURABILITY[qos.durability],
        deadline=_duration(qos.deadline_ns),
        lifespan=_duration(qos.lifespan_ns),
        liveliness=_LIVELINESS[qos.liveliness],
        liveliness_lease_duration=_duration(qos.lease_ns),
        avoid_ros_namespace_conventions=qos.ignores_ros_names,
    )


def _duration(span_ns: int | None) -> Duration:
    return Duration(nanoseconds=span_ns or 0)       # 0: not limited


# The policies that a user may override, by their names in parameters and in files.
_POLICIES = {
    kind.name.lower(): kind for kind in QoSPolicyKind if kind is not QoSPolicyKind.INVALID}
_SPANS = ('deadline', 'lifespan', 'liveliness_lease_duration')
_PREFIX = 'qos_overrides'


def make_publisher(node: Node, message: type, name: str, qos: QoSProfile) -> Publisher:
    """
    Make a publisher with a profile that parameters of the node may override.

    They are ROS's `qos_overrides.TOPIC.publisher.POLICY`. ParameterError for a value that no
    publisher can have, InvalidTopicNameException for a name that no topic can have.
    """
    validate_topic_name(name)
    begin = f'{_PREFIX}.{node.resolve_topic_name(name)}.publisher.'
    kinds = [_POLICIES[word] for given in given_names(node) if given.startswith(begin)
             if (word := given.removeprefix(begin)) in _POLICIES]
    try:
        return node.create_publisher(
            message, name, qos, qos_overriding_options=QoSOverridingOptions(kinds))
    except (InvalidQosOverridesError, InvalidParameterTypeException, RuntimeError,
            ValueError) as error:
        raise ParameterError(f'parameter {begin}*: {error}') from None


def read_overrides(path: str) -> dict[str, Any]:
    """
    Return what a file for `ros2 bag play --qos-profile-overrides-path` says, as parameters.

    It holds a mapping for each topic. ParameterError where it does not.
    """
    try:
        content = YAML(typ='safe', pure=True).load(bytes_of(path, _MOST_BYTES).decode())
    except (OSError, UnicodeDecodeError, YAMLError, RecursionError) as error:
        told = getattr(error, 'strerror', None) or error     # an OSError repeats the path
        raise ParameterError(f'{path}: {told}') from None
    parameters = {}
    for topic, policies in _mapping(path, content).items():
        for name, value in _mapping(f'{path}: {topic}', policies).items():
            if name not in _POLICIES:
                raise ParameterError(f'{path}: {topic}: no policy {name!r}: '
                                     f'{nearest(str(name), list(_POLICIES))}')
            parameters[f'{_PREFIX}.{topic}.publisher.{name}'] = (
                _nanoseconds(f'{path}: {topic}: {name}', value) if name in _SPANS else value)
    return parameters


def _mapping(where: str, value: Any) -> dict[Any, Any]:
    if not isinstance(value, dict):
        raise ParameterError(f'{where}: {value!r}, must be a mapping')
    return value


def _nanoseconds(where: str, value: Any) -> int:
    parts = _mapping(where, value)
    try:
        return int(parts.get('sec', 0)) * SECOND + int(parts.get('nsec', 0))
    except (TypeError, ValueError):
        raise ParameterError(f'{where}: {value!r}, must be {{sec: ..., nsec: ...}}') from None
