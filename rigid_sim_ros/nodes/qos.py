# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The QoS of each topic, from the parameters `qos.TOPIC.reliability|durability|depth`."""
from collections.abc import Mapping
from typing import Any, TypeVar

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rigid_sim_ros.nodes.parameters import ParameterError

_Policy = TypeVar('_Policy')

_RELIABILITY = {
    'reliable': ReliabilityPolicy.RELIABLE,
    'best_effort': ReliabilityPolicy.BEST_EFFORT,
}
_DURABILITY = {
    'volatile': DurabilityPolicy.VOLATILE,
    'transient_local': DurabilityPolicy.TRANSIENT_LOCAL,
}


def profiles(parameters: Mapping[str, Any]) -> dict[str, QoSProfile]:
    """
    Return the profile of every topic that has `qos.` parameters, by the topic's short name.

    Raise ParameterError where a policy has a name that ROS does not know.
    """
    topics = sorted({name.split('.')[1] for name in parameters if name.startswith('qos.')})
    return {topic: _profile(parameters, topic) for topic in topics}


def _profile(parameters: Mapping[str, Any], topic: str) -> QoSProfile:
    depth = parameters[f'qos.{topic}.depth']
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=_policy(parameters, f'qos.{topic}.reliability', _RELIABILITY),
        durability=_policy(parameters, f'qos.{topic}.durability', _DURABILITY),
    )


def _policy(
    parameters: Mapping[str, Any], name: str, policies: Mapping[str, _Policy],
) -> _Policy:
    value = parameters[name]
    if value not in policies:
        raise ParameterError(f'parameter {name}: {value!r}, must be {" or ".join(policies)}')
    return policies[value]
