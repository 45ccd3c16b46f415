# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The topics of a simulation: what is said on each, its type and its name.

The node publishes those of PUBLISHED, `batch` and the node record them, and `verify` makes those
again that are made of the world alone. The node listens to those of HEARD. The quality of service
of a topic is a parameter, `qos.KIND` in msg_config/default.yaml.
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
JOINT_STATES = 'joint_states'
ALL_JOINT_STATES = 'all_joint_states'
JOINT_WRENCH = 'joint_wrench'
ROBOT_DESCRIPTION = 'robot_description'
# What follows from what the world was told.
APPLIED_WRENCH = 'applied_wrench'
# What is recorded as it was, and not made again.
CONTACT_WRENCH = 'contact_wrench'
DIAGNOSTICS = 'diagnostics'
MARKERS = 'markers'

# What others ask for.
WRENCH = 'wrench'
WRENCHES = 'wrenches'
SET_POSE = 'set_pose'
SET_TWIST = 'set_twist'
JOINT_COMMANDS = 'joint_commands'
JOINT_TRAJECTORY = 'joint_trajectory'
SET_JOINT_STATES = 'set_joint_states'


class Published(NamedTuple):
    """What one kind of topic is."""

    type: str  # package/msg/Type
    # '~' is the node, {body} a body, a model or a joint: one topic for each
    name: str
    is_made_again: bool = True  # by `verify`


PUBLISHED = {
    CLOCK: Published('rosgraph_msgs/msg/Clock', '/clock'),
    POSE: Published('geometry_msgs/msg/PoseStamped', '~/{body}/pose'),
    TWIST: Published('geometry_msgs/msg/TwistStamped', '~/{body}/twist'),
    STATE: Published('sensor_msgs/msg/MultiDOFJointState', '~/state'),
    TRANSFORMS: Published('tf2_msgs/msg/TFMessage', '/tf'),
    STATE_HASH: Published('std_msgs/msg/UInt64', '~/state_hash'),
    SCENE: Published('std_msgs/msg/String', '~/scene'),
    JOINT_STATES: Published('sensor_msgs/msg/JointState', '~/{body}/joint_states'),
    ALL_JOINT_STATES: Published('sensor_msgs/msg/JointState', '/joint_states'),
    JOINT_WRENCH: Published('geometry_msgs/msg/WrenchStamped', '~/{body}/wrench'),
    ROBOT_DESCRIPTION: Published('std_msgs/msg/String', '~/{body}/robot_description'),
    APPLIED_WRENCH: Published('geometry_msgs/msg/WrenchStamped', '~/{body}/applied_wrench'),
    CONTACT_WRENCH: Published('geometry_msgs/msg/WrenchStamped', '~/{body}/contact_wrench', False),
    DIAGNOSTICS: Published('diagnostic_msgs/msg/DiagnosticArray', '/diagnostics', False),
    MARKERS: Published('visualization_msgs/msg/MarkerArray', '~/markers', False),
}


class Heard(NamedTuple):
    """A kind of topic that the node listens to."""

    type: str  # package/msg/Type
    name: str  # as in `Published`


HEARD = {
    WRENCH: Heard('geometry_msgs/msg/WrenchStamped', '~/{body}/wrench'),
    WRENCHES: Heard('sensor_msgs/msg/MultiDOFJointState', '~/wrenches'),
    SET_POSE: Heard('geometry_msgs/msg/PoseStamped', '~/{body}/set_pose'),
    SET_TWIST: Heard('geometry_msgs/msg/TwistStamped', '~/{body}/set_twist'),
    JOINT_COMMANDS: Heard('sensor_msgs/msg/JointState', '~/{body}/joint_commands'),
    JOINT_TRAJECTORY: Heard('trajectory_msgs/msg/JointTrajectory', '~/{body}/joint_trajectory'),
    SET_JOINT_STATES: Heard('sensor_msgs/msg/JointState', '~/{body}/set_joint_states'),
}

_TABLE: dict[str, Published | Heard] = {**PUBLISHED, **HEARD}


def body_of(topic: str, names: Collection[str]) -> str:
    """Return the body that a topic such as /lab/crate/pose is of: the longest name that fits."""
    above = topic.rpartition('/')[0]
    fitting = [name for name in names if above.endswith(f'/{name}')]
    return max(fitting, key=len, default=above.rpartition('/')[2])


def topic_name(kind: str, node: str = '~', body: str = '') -> str:
    """
    Return the name of a topic of a node, given by its full name.

    Without a body it is one of the node's own: joints without a model have ~/joint_states.
    """
    name = _TABLE[kind].name
    if not body:
        name = name.replace('{body}/', '')
    return name.replace('~', node, 1).format(body=body)
