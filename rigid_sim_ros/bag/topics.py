# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of a bag: what is said on each, and the definition of its type."""

from functools import cache
from typing import Any, NamedTuple

from rosbags.typesys import get_typestore, Stores

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.messages.topics import (
    ALL_JOINT_STATES, APPLIED_WRENCH, CLOCK, JOINT_STATES, JOINT_WRENCH, POSE, PUBLISHED,
    ROBOT_DESCRIPTION, SCENE, STATE, STATE_HASH, topic_name, TRANSFORMS, TWIST)

__all__ = ['ALL_JOINT_STATES', 'APPLIED_WRENCH', 'CLOCK', 'EVENT', 'JOINT_STATES', 'JOINT_WRENCH',
           'OF_BODIES', 'OF_JOINTS', 'POSE', 'ROBOT_DESCRIPTION', 'SCENE', 'SESSION', 'SNAPSHOT',
           'STATE', 'STATE_HASH', 'STEP', 'TRANSFORMS', 'TWIST', 'TYPES', 'Topic', 'definition',
           'own_topics', 'published', 'qos_profiles', 'topic', 'typestore']

# What a recording adds by itself, below BAG.
STEP = 'step'
EVENT = 'event'
SNAPSHOT = 'snapshot'
SESSION = 'session'

# What `verify` compares, by what a topic carries. Other kinds are recorded all the same.
TYPES = {
    **{kind: published.type for kind, published in PUBLISHED.items() if published.is_made_again},
    STEP: 'std_msgs/msg/UInt64',
    EVENT: 'std_msgs/msg/String',
    SNAPSHOT: 'std_msgs/msg/UInt8MultiArray',
    SESSION: 'std_msgs/msg/String',
}

# Kinds with a topic for each body, and such with one for each model or joint.
OF_BODIES = (POSE, TWIST, APPLIED_WRENCH)
OF_JOINTS = (JOINT_STATES, ALL_JOINT_STATES, JOINT_WRENCH, ROBOT_DESCRIPTION)

_FOREVER = {'sec': 9223372036, 'nsec': 854775807}     # as ROS writes it: 2^63 - 1 ns


class Topic(NamedTuple):
    """A topic that is recorded."""

    name: str           # absolute
    type: str           # as in TYPES
    kind: str = ''      # what it carries, see above; '' for anything else
    body: str = ''      # whose pose, twist or wrench it is; a model or a joint for OF_JOINTS
    latched: bool = False


def topic(kind: str, name: str, body: str = '', *, latched: bool = False) -> Topic:
    """Return a topic of one of the kinds above."""
    return Topic(name, TYPES[kind], kind, body, latched)


def published(kind: str, node: str, body: str = '') -> Topic:
    """Return a topic that a node publishes."""
    return topic(kind, topic_name(kind, node, body), body, latched=kind == ROBOT_DESCRIPTION)


def own_topics(node: str) -> tuple[Topic, ...]:
    """Return the topics that a recording of a node adds, the scene first."""
    return (topic(SCENE, topic_name(SCENE, node), latched=True),
            topic(SESSION, f'{node}/bag/session', latched=True),
            topic(SNAPSHOT, f'{node}/bag/snapshot', latched=True),
            topic(STEP, f'{node}/bag/step'),
            topic(EVENT, f'{node}/bag/event'))


@cache
def typestore() -> Any:
    """Return the definitions of ROS 2 Jazzy's message types."""
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def definition(message_type: str) -> tuple[str, str]:
    """Return the definition of a type as text, with all it refers to, and the hash of it."""
    store = typestore()
    if message_type not in store.types:
        raise BagError(f'the message type {message_type} is not one of ROS 2 Jazzy, which a bag '
                       'can describe: leave the topic out')
    text, _ = store.generate_msgdef(message_type, ros_version=2)
    return text, store.hash_rihs01(message_type)


def qos_profiles(latched: bool) -> list[dict[str, Any]]:
    """
    Return the quality of service of a topic in the form of rosbag2's metadata, version 9.

    None is given where it is ROS's default: rosbags takes 10 ms to read one, for each topic and
    file of a bag.
    """
    return [] if not latched else [{
        'history': 'keep_last',
        'depth': 1,
        'reliability': 'reliable',
        'durability': 'transient_local',
        'deadline': dict(_FOREVER),
        'lifespan': dict(_FOREVER),
        'liveliness': 'automatic',
        'liveliness_lease_duration': dict(_FOREVER),
        'avoid_ros_namespace_conventions': False,
    }]
