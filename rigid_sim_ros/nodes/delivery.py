# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What was published arrives before its publishers end."""

from collections.abc import Iterable
from time import monotonic

from rclpy.duration import Duration
from rclpy.publisher import Publisher


def await_delivery(publishers: Iterable[Publisher], seconds: float) -> bool:
    """
    Wait until reliable subscribers have what was sent, at most this long for all together.

    Return whether they have it.
    """
    end = monotonic() + seconds
    return all(publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - monotonic())))
               for publisher in publishers)
