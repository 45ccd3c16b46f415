# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What was published arrives soon, and before its publishers end."""

from collections.abc import Iterable
import os
from pathlib import Path
from time import monotonic

from rclpy.duration import Duration
from rclpy.publisher import Publisher

# Name the file that says how Fast DDS works, the first one before its version 3.
_NAMES = 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'
HEARTBEATS = Path(__file__).parents[1] / 'msg_config' / 'heartbeats.xml'


def ask_often() -> None:
    """
    Let Fast DDS ask ten times a second what has arrived, unless the user has named another file.

    It reads the environment when a process first starts ROS.
    """
    if not any(name in os.environ for name in _NAMES):
        os.environ.update(dict.fromkeys(_NAMES, str(HEARTBEATS)))


def await_delivery(publishers: Iterable[Publisher], seconds: float) -> bool:
    """
    Wait until reliable subscribers have what was sent, at most this long for all together.

    Return whether they have it.
    """
    end = monotonic() + seconds
    return all(publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - monotonic())))
               for publisher in publishers)
