# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node `replay`; names and defaults stand in msg_config/replay.yaml."""

from typing import Any

from rclpy.node import Node

from rigid_sim_ros.nodes.declaring import declare_all, defaults_in, Meaning

_MEANINGS = {
    'bag': Meaning('Folder of a ROS 2 bag, or one of its files.'),
    'topics': Meaning('Names or glob patterns that choose which topics are published.'),
    'start': Meaning('Where to begin, in s from the beginning of the bag.', most=1e9),
    'duration': Meaning('How much to play, in s of the bag; 0 is to its end.', most=1e9),
    'paused': Meaning('Whether to begin paused.'),
    'subscriber_timeout': Meaning(
        'How long to wait at the start, in s of wall time, as long as nobody has subscribed to '
        'any of the topics or to /clock.', most=1e6),
    'rate': Meaning(
        'Seconds of the bag per second of wall time.', live=True, least=1e-3, most=1e3),
    'loop': Meaning('Whether to begin again at the end.', live=True),
    'clock_rate': Meaning(
        'Rate of /clock in Hz of wall time, unless the bag holds /clock itself; 0 publishes '
        'none.', live=True, most=1e4),
}

# The names of those that may change while the node runs.
LIVE = frozenset(name for name, meaning in _MEANINGS.items() if meaning.live)


def declare(node: Node) -> dict[str, Any]:
    """
    Declare every parameter on a node and return their values.

    Raise ParameterError for an override of the wrong type or out of its range.
    """
    return declare_all(node, defaults_in('replay.yaml'), _MEANINGS.__getitem__)
