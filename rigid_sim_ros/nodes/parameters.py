# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters of the node `simulate`.

Names and defaults stand in msg_config/default.yaml and nowhere else; here is what each one means,
which values it may have and whether it changes while the node runs.
"""
from collections.abc import Mapping
from typing import Any

from rclpy.node import Node

from rigid_sim_ros.bag.writer import COMPRESSIONS, STORAGES
from rigid_sim_ros.nodes.declaring import (
    declare_all, defaults_in, Meaning, NOT_A_NUMBER, ParameterError)

# The parameters of which only some words are right.
_CHOICES = {'bag_storage': tuple(STORAGES), 'bag_compression': COMPRESSIONS}


_MEANINGS = {
    'scene': Meaning('Path of a scene file, or the name of an example scene.'),
    'frame_id': Meaning(
        'frame_id of every published message. Wrenches, poses and twists that name it, or '
        '`world`, or no frame are in world axes.', constraints='not empty, no body of the scene'),
    'bodies': Meaning(
        'Names or glob patterns that choose which bodies get topics of their own; ~/state and '
        '~/wrenches always cover all of them.'),
    'real_time_factor': Meaning(
        'Simulated seconds per second of wall time; 0 is as fast as possible.', True, 1e4),
    'paused': Meaning('Whether to begin paused; ~/pause lets it go on.'),
    'threads': Meaning(
        'Threads that a step may use: a second one helps where contacts are many, and changes no '
        'result.', most=2, least=1),
    'publish_rate': Meaning(
        'Rate of poses, twists, states and transforms in Hz of simulation time, rounded to whole '
        'steps; 0 publishes none.', True, 1e6),
    'clock_rate': Meaning(
        'Rate of /clock in Hz of simulation time, rounded to whole steps; 0 publishes none.',
        True, 1e6),
    'marker_rate': Meaning(
        'Rate of ~/markers in Hz of simulation time, rounded to whole steps; 0 publishes none.',
        True, 1e6),
    'diagnostics_rate': Meaning(
        'Rate of /diagnostics in Hz of wall time; 0 publishes none.', True, 1e3),
    'hash_interval': Meaning(
        'Steps from one ~/state_hash to the next; 0 publishes none.', True, 2**31 - 1),
    'wrench_timeout': Meaning(
        'Simulation time in s, rounded to whole steps, for which a wrench holds unless a message '
        'on its topic replaces it; 0 is one step.', True, 1e6),
    'command_timeout': Meaning(
        'Simulation time in s, rounded to whole steps, for which a joint follows a command on '
        '~/MODEL/joint_commands unless another one replaces it; then its drive lets go. 0 is one '
        'step.', True, 1e6),
    'reset_time': Meaning(
        'Whether ~/reset also sets the simulation time, and with it /clock, back to 0.', True),
    'publish_clock': Meaning('Whether to publish the simulation time on /clock.'),
    'publish_tf': Meaning('Whether to publish the poses on /tf; needs the package tf2_msgs.'),
    'publish_markers': Meaning(
        'Whether to publish the shapes, contact points and contact forces on ~/markers.'),
    'publish_contact_wrench': Meaning(
        'Whether to publish the net contact wrench on each body, about its centre of mass.'),
    'publish_joint_states': Meaning(
        'Whether to publish the states of all joints on /joint_states too.'),
    'joint_wrenches': Meaning(
        'Names or glob patterns that choose which joints publish the wrench through them, on '
        '~/MODEL/JOINT/wrench.'),
    'record': Meaning('Whether to record from the start; ~/start_recording does so later.'),
    'bag_path': Meaning(
        'Folder of the next recording, which must not exist yet; empty is NODE_DATE-TIME in the '
        'working directory.', True),
    'bag_storage': Meaning(
        'Format of the next recording.', True, constraints='mcap | sqlite3'),
    'bag_compression': Meaning(
        'Compression of the next recording.', True, constraints='none | zstd'),
    'bag_segment_duration': Meaning(
        'Wall time in s after which a recording goes on in a new file, 0.1 s or more; 0 is never.',
        True, 1e6),
    'bag_segment_size': Meaning(
        'Size in MB after which a recording goes on in a new file; 0 is never.', True, 2**20),
}
_QOS_MEANINGS = {
    'reliability': Meaning('Reliability of topic `{}`.', constraints='reliable | best_effort'),
    'durability': Meaning(
        'Durability of topic `{}`.', constraints='volatile | transient_local'),
    'depth': Meaning('How many messages the queue of topic `{}` holds.', most=100_000, least=1),
}


def default_parameters() -> dict[str, Any]:
    """Return every parameter of msg_config/default.yaml; a nested key has dots in its name."""
    return defaults_in('default.yaml')


def declare(node: Node, defaults: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """
    Declare every parameter on a node and return their values.

    `defaults` take the place of those of the file where they have the same type. Raise
    ParameterError for an override of the wrong type or out of its range.
    """
    known = default_parameters()
    for name, value in (defaults or {}).items():
        if name in known and type(value) is type(known[name]):
            known[name] = value
    values = declare_all(node, known, _meaning)
    for name, value in values.items():
        if mistake := mistake_in(name, value):
            raise ParameterError(f'parameter {mistake}')
    return values


def mistake_in(name: str, value: Any) -> str:
    """Return what is wrong with a value although its type and range are right, or ''."""
    if value != value:
        return f'{name}: {NOT_A_NUMBER}'
    if isinstance(value, str) and not value.isprintable():
        return f'{name}: {value!r:.80}, must hold no control characters'
    if name in _CHOICES and value not in _CHOICES[name]:
        return f'{name}: {value!r}, must be {" or ".join(_CHOICES[name])}'
    return ''


def is_live(name: str) -> bool:
    """Return whether a declared parameter may change while the node runs."""
    return name in _MEANINGS and _MEANINGS[name].live


def _meaning(name: str) -> Meaning:
    if not name.startswith('qos.'):
        return _MEANINGS[name]
    _, topic, policy = name.split('.')
    meaning = _QOS_MEANINGS[policy]
    return meaning._replace(description=meaning.description.format(topic))
