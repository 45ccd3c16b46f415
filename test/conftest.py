# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests, and real nodes for those that ask for them."""

from collections.abc import Generator, Iterator
import gc
import os
import signal
import sys
from typing import Any

import effort
from hypothesis import settings
import pytest
import sharing


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the thorough form of some tests be asked for."""
    parser.addoption('--long', action='store_true', help='Run what has a long form, in that form: '
                     'properties with more examples, and tests that are marked so.')


def pytest_configure(config: pytest.Config) -> None:
    """Choose the form of tests and of properties before their modules are imported."""
    effort.choose(config.getoption('long'))
    # Under nohup, and behind `&` in a script, these are ignored, and so they would be by all
    # programs that tests start.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Some container images set it. Then each worker would compile the tests, and each of some
    # hundred processes the package: 3 s and 0.4 s of a processor.
    os.environ.pop('PYTHONDONTWRITEBYTECODE', None)
    sys.dont_write_bytecode = False
    # The first example compiles kernels: it takes seconds, and says nothing of the code.
    usual = effort.examples(settings().max_examples, deadline=None)
    settings.register_profile('new_examples', usual)
    # A change is judged by the same examples each time; elsewhere they are new ones.
    settings.register_profile('same_examples', usual, derandomize=True)
    settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'new_examples'))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Start some workers, or none."""
    return sharing.workers(config)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Fill the cache of kernels before the workers start."""
    if not hasattr(session.config, 'workerinput'):
        sharing.compile_for_all(session.config)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """
    Let Python not look for cycles while it imports all tests, nor among what they are made of.

    In each worker that was a quarter of the time of the imports. What stays until the end is a
    million objects: to look through them takes 0.1 s, each time, ten times as a worker ends alone.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item],
) -> None:
    """Share the tests out."""
    if effort.is_long():
        others = [item for item in items if not sharing.has_long_form(item)]
        config.hook.pytest_deselected(items=others)
        items[:] = filter(sharing.has_long_form, items)
    sharing.mix(items)


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
