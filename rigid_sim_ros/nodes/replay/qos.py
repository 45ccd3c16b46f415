# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The QoS of publishers that stand in for those that were recorded."""

from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy)

from rigid_sim_ros.bag.offered_qos import (
    AUTOMATIC, BEST_EFFORT, MANUAL_BY_TOPIC, OfferedQos, RELIABLE, TRANSIENT_LOCAL, VOLATILE)

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
# a place in it: after a stall some are sent at once.
_LEAST_DEPTH = 100
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
