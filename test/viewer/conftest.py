# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests of the page: a real browser, and ROS where a test needs it."""
from collections.abc import Iterator
import shutil
from typing import Any

import pytest


@pytest.fixture(scope='session')
def ros() -> Iterator[None]:
    """Start ROS in a domain of its own, unless other tests have."""
    import rclpy

    from nodes.live import start_ros, stop_ros

    is_first = not rclpy.ok()
    if is_first:
        start_ros()
    yield
    if is_first:
        stop_ros()


@pytest.fixture(scope='module')
def probe(ros: None) -> Iterator[Any]:
    """Give a node of the test."""
    from nodes.live import Probe

    probe = Probe()
    yield probe
    probe.close()


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    """Start Chromium without a window and without a graphics card."""
    program = shutil.which('chromium')
    if program is None:
        pytest.skip('Chromium is not installed: apt-get install chromium')
    playwright = pytest.importorskip('playwright.sync_api')
    with playwright.sync_playwright() as tool:
        # Root may not use Chromium's sandbox.
        browser = tool.chromium.launch(executable_path=program, args=[
            '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
            '--disable-gpu-compositing'])
        yield browser
        browser.close()
