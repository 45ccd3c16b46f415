# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The topics of a simulation: what is said on each, its type and its name.

The node publishes them, `batch` and the node record them, and `verify` makes those again that are
made of the world alone. The quality of service of a topic is a parameter, `qos.KIND` in
msg_config/default.yaml.
"""

from collections.abc import Collection
from typing import NamedTuple

# What follows from the world alone.
CLOCK = 'clock'
POSE = 'pose'
TWIST = 'twist'
STATE = 'state'
TRANSFORMS = 'tf'
STATE_HASH = 'state_hash'
SCENE = 'scene'
# What follows from what the world was told.
APPLIED_WRENCH = 'applied_wrench'
# What is recorded as it was, and not made again.
CONTACT_WRENCH = 'contact_wrench'
DIAGNOSTICS = 'diagnostics'
MARKERS = 'markers'


class Published(NamedTuple):
    """What one kind of topic is."""

    type: str  # package/msg/Type
    name: str  # '~' is the node, {body} a body: one topic for each
    is_made_again: bool = True  # by `verify`


PUBLISHED = {
    CLOCK: Published('rosgraph_msgs/msg/Clock', '/clock'),
    POSE: Published('geometry_msgs/msg/PoseStamped', '~/{body}/pose'),
    TWIST: Published('geometry_msgs/msg/TwistStamped', '~/{body}/twist'),
    STATE: Published('sensor_msgs/msg/MultiDOFJointState', '~/state'),
    TRANSFORMS: Published('tf2_msgs/msg/TFMessage', '/tf'),
    STATE_HASH: Published('std_msgs/msg/UInt64', '~/state_hash'),
    SCENE: Published('std_msgs/msg/String', '~/scene'),
    APPLIED_WRENCH: Published('geometry_msgs/msg/WrenchStamped', '~/{body}/applied_wrench'),
    CONTACT_WRENCH: Published('geometry_msgs/msg/WrenchStamped', '~/{body}/contact_wrench', False),
    DIAGNOSTICS: Published('diagnostic_msgs/msg/DiagnosticArray', '/diagnostics', False),
    MARKERS: Published('visualization_msgs/msg/MarkerArray', '~/markers', False),
}


def body_of(topic: str, names: Collection[str]) -> str:
    """Return the body that a topic such as /lab/crate/pose is of: the longest name that fits."""
    above = topic.rpartition('/')[0]
    fitting = [name for name in names if above.endswith(f'/{name}')]
    return max(fitting, key=len, default=above.rpartition('/')[2])


def topic_name(kind: str, node: str = '~', body: str = '') -> str:
    """Return the name of a topic of a node, given by its full name."""
    return PUBLISHED[kind].name.replace('~', node, 1).format(body=body)
