# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests of the page: a real browser, and a simulation that it shows."""
from collections.abc import Iterator
from contextlib import ExitStack
import fcntl
import os
from pathlib import Path
import shutil
import time
from typing import Any, IO

from free import free_port
import pytest

_LOOK = 0.2     # [s] between two looks for a free place
# Since Chromium is one program with a window and without one, each window has pages of its own for
# what is typed into its address bar: 1.8 s of a processor, as much as it takes to read our page.
# Of a switch that is given twice the last one counts, so what Playwright leaves out and these
# tests may meet is here too: requests to the internet, and pictures that wait.
_LEFT_OUT = ('WebUIOmniboxPopup', 'WebUIOmniboxAimPopup', 'AimEnabled', 'PreconnectToSearch',
             'OptimizationHints', 'NetworkTimeServiceQuerying', 'MediaRouter', 'HttpsUpgrades',
             'HttpsFirstBalancedModeAutoEnable', 'PaintHolding', 'DestroyProfileOnBrowserClose',
             'AvoidUnnecessaryBeforeUnloadCheckSync')


@pytest.fixture(scope='session')
def chromium() -> Iterator[Any]:
    """Start Chromium without a window and without a graphics card."""
    program = shutil.which('chromium')
    if program is None:
        pytest.skip('Chromium is not installed: apt-get install chromium')
    playwright = pytest.importorskip('playwright.sync_api')
    with playwright.sync_playwright() as tool:
        # Root may not use Chromium's sandbox.
        browser = tool.chromium.launch(executable_path=program, args=[
            '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
            '--disable-gpu-compositing', f'--disable-features={",".join(_LEFT_OUT)}'])
        yield browser
        browser.close()


@pytest.fixture(scope='module')
def browser(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """
    Give the browser to the tests of a module when it is their turn.

    Without a graphics card a page takes a core to be drawn: at most as many modules as there are
    cores have one at a time, whichever workers run them. More of them wait for each other's
    pictures until nobody is patient any more.
    """
    # The folder above is that of all workers of a run.
    folder = tmp_path_factory.getbasetemp().parent
    with ExitStack() as turns:
        places = [turns.enter_context(open(folder / f'page{n}.lock', 'w'))
                  for n in range(len(os.sched_getaffinity(0)))]
        while not any(_is_taken(place) for place in places):
            time.sleep(_LOOK)
        yield chromium


def _is_taken(place: IO[str]) -> bool:
    """Return whether a place was free, and is taken now: until the file is closed."""
    try:
        fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder for all tests of a module."""
    return tmp_path_factory.mktemp('viewer')


@pytest.fixture(scope='module')
def sim(probe: Any, folder: Path) -> Iterator[Any]:
    """Run the scene of three bodies in the node `rigid_sim`."""
    from nodes.live import running
    from sensor_msgs.msg import MultiDOFJointState
    from viewer.browsing import scene_file

    with running(folder / 'sim', str(scene_file(folder)), bag_path=folder / 'bag') as process:
        probe.some(MultiDOFJointState, '/rigid_sim/state')
        yield process


@pytest.fixture(scope='module')
def port() -> int:
    """Give the port of the page."""
    return free_port()


@pytest.fixture(scope='module')
def viewer(sim: Any, folder: Path, port: int) -> Iterator[Any]:
    """Run `rigid_sim view` for the simulation."""
    from nodes.live import kept
    from viewer.browsing import view

    with kept(view(folder / 'view', '--port', str(port))) as process:
        yield process


@pytest.fixture(scope='module')
def shown(viewer: Any, browser: Any, port: int) -> Iterator[Any]:
    """Open the page in the browser."""
    from viewer.browsing import Page

    page = Page(browser, f'http://127.0.0.1:{port}')
    yield page
    page.close()


@pytest.fixture
def page(shown: Any, probe: Any) -> Any:
    """Give the page of a simulation that has just been reset, once it shows that."""
    from viewer.browsing import GREEN

    shown.page.mouse.move(20, 20)
    probe.pause(False)
    probe.trigger('/rigid_sim/reset')
    # The first pictures of a page are those of a camera that is still on its way.
    home = shown.resting_spot(GREEN) if shown.home is None else shown.home
    shown.home = home
    shown.wait_for(lambda: shown.spots(GREEN) == [pytest.approx(home, abs=2.0)],   # px
                   'the box where it was at the beginning')
    return shown
