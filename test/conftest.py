# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests, and real nodes for those that ask for them."""

from collections.abc import Iterator, Sequence
import os
from typing import Any

from hypothesis import settings
import pytest

# The first example of a property compiles kernels: it takes seconds, and says nothing of the code.
settings.register_profile('rigid_sim_ros', deadline=None)
# A change is judged by the same examples each time; elsewhere they are new ones.
settings.register_profile('same_examples', deadline=None, derandomize=True)
settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'rigid_sim_ros'))


def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """
    Run a test with real nodes once more when it waited in vain; the report lists it.

    On a machine whose processors belong to others too, one side of DDS may hear of the other half
    a second or more after the other heard of it; what is said meanwhile is lost, once in some
    thousand tests. What fails twice is wrong, and so is what came and was not as it should be.
    """
    for item in items:
        if 'ros' in getattr(item, 'fixturenames', ()):
            item.add_marker(pytest.mark.flaky(reruns=1, only_rerun='AssertionError: waited '))


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
