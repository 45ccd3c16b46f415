# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a user does in the page is not undone by what the simulation said before."""
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import count
import threading
import time
from typing import Any
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

import pytest
from viewer.browsing import Page
from viewer.telling import Nobody, Told

from rigid_sim_ros.viewer.server import start, stop

OFTEN = 0.005   # s between two reports
SPEEDS = 20
SOON = 0.5      # s after a speed was typed in which reports do not put it back for sure


class Listener(Nobody):
    """Notes which speeds the page wants; the reports hold the first one all the time."""

    def __init__(self) -> None:
        self.speeds: list[float] = []
        self.delays: list[float] = []   # [s] that the next calls take

    def set_speed(self, factor: float, answer: Any) -> None:
        """Take note."""
        if self.delays:
            time.sleep(self.delays.pop())
        self.speeds.append(factor)


@pytest.fixture(scope='module')
def driver() -> Listener:
    return Listener()


@pytest.fixture(scope='module')
def page(browser: Any, driver: Listener) -> Iterator[Page]:
    """Give a page that hears of a simulation at speed 1, which runs, much more often than ever."""
    server, stopped = start('127.0.0.1', 0), threading.Event()
    told = Told(server, driver)

    def tell() -> None:
        while not stopped.wait(OFTEN):
            told.turn()

    teller = threading.Thread(target=tell)
    teller.start()
    page = Page(browser, f'http://127.0.0.1:{server.get_port()}')
    yield page
    page.close()
    stopped.set()
    teller.join()
    stop(server)


def test_the_speed_that_is_set_is_the_one_that_was_typed(page, driver):
    field = page.page.locator('input[inputmode]:visible').first
    typed_at = time.monotonic()
    for k, speed in zip(range(SPEEDS), count(2.0, 0.05)):
        if time.monotonic() - typed_at > SOON:
            # The simulation has not done what was wanted: its reports count again.
            page.wait_for(lambda: field.input_value() == '1', 'the reported speed')
        driver.speeds.clear()
        typed_at = time.monotonic()
        page.replace_text(field, f'{speed:.2f}')
        page.wait_for(lambda: driver.speeds, 'the speed to be set')
        assert driver.speeds[-1] == pytest.approx(speed), k


def test_speeds_are_set_in_the_order_in_which_they_were_typed(page, driver):
    driver.speeds.clear()
    driver.delays[:] = [1.0]    # the first
    field = page.page.locator('input[inputmode]:visible').first
    typed = [3.0, 3.5, 4.0]
    page.send()     # what was done before
    for speed in typed:
        page.replace_text(field, f'{speed:.2f}')
        page.send()
    page.wait_for(lambda: driver.speeds[-1:] == [4.0], 'the last one')
    assert driver.speeds == typed
