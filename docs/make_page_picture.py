# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Make docs/pictures/page.jpg: the page of a simulation, as a browser shows it.

    python docs/make_page_picture.py

Needs ROS, Chromium and `pip install '.[test]'`. The tower falls slowly, is paused a moment
after it was hit, and its contacts are switched on.
"""
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

from playwright.sync_api import Page, sync_playwright

_PICTURE = Path(__file__).parent / 'pictures' / 'page.jpg'
_PORT = 8765
_MOMENT = 0.5       # s of simulation time
_PACE = 0.05        # times real time
_PATIENCE = 120_000     # ms
_MOUSE = 400, 380       # px: over a block, whose name the page shows
_ENVIRONMENT = {'ROS_DOMAIN_ID': '77', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', **os.environ}


def start(*words: str) -> 'subprocess.Popen[bytes]':
    """Start a command of the package."""
    return subprocess.Popen([sys.executable, '-m', 'rigid_sim_ros', *words], env=_ENVIRONMENT)


def simulation_time(page: Page) -> float:
    """Return the simulation time that the page shows [s]."""
    found = re.search(r'/rigid_sim ([\d.]+) s', page.inner_text('body'))
    return float(found.group(1)) if found else 0.0


def take(page: Page) -> None:
    """Wait for the moment and take the picture."""
    page.goto(f'http://127.0.0.1:{_PORT}/?antialias')
    page.add_style_tag(content='.mantine-Notifications-root {visibility: hidden}')
    page.get_by_role('tab', name='Show').click(timeout=_PATIENCE)
    for name in ('velocities', 'contacts'):
        page.get_by_label(name, exact=True).click(timeout=_PATIENCE)
    page.get_by_role('tab', name='Drive').click(timeout=_PATIENCE)
    while simulation_time(page) < _MOMENT:
        page.wait_for_timeout(100)
    page.get_by_role('button', name='Pause', exact=True).click(timeout=_PATIENCE)
    page.wait_for_timeout(8000)
    page.mouse.move(*_MOUSE)
    page.locator('#hovered-body').filter(has_text='_').wait_for(timeout=_PATIENCE)
    page.screenshot(path=_PICTURE, type='jpeg', quality=80)


def main() -> None:
    """Run everything that takes part, and end it."""
    processes = [start('run', 'tower', '--ros-args', '-p', f'real_time_factor:={_PACE}')]
    processes.append(start('view', '--port', str(_PORT)))
    try:
        with sync_playwright() as tool:
            browser = tool.chromium.launch(executable_path=shutil.which('chromium'), args=[
                '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'])
            page = browser.new_page(viewport={'width': 1100, 'height': 680})
            page.wait_for_timeout(5000)
            take(page)
            browser.close()
    finally:
        for process in processes:
            process.terminate()
            process.wait()


if __name__ == '__main__':
    main()
