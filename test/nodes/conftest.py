# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests with real nodes."""
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope='session')
def ros() -> Iterator[None]:
    """Start ROS in a domain of its own."""
    from nodes.live import start_ros, stop_ros

    start_ros()
    yield
    stop_ros()


@pytest.fixture(scope='module')
def probe(ros: None) -> Iterator[Any]:
    """Give a node of the test."""
    from nodes.live import Probe

    probe = Probe()
    yield probe
    probe.close()
