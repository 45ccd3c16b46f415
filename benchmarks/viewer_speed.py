# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How fast the page follows a simulation, and whether it grows.

    python benchmarks/viewer_speed.py                                # 200 bodies, one browser
    python benchmarks/viewer_speed.py --viewers 5                    # five at once
    python benchmarks/viewer_speed.py --scene tower --seconds 1800 --charts     # memory

Starts the node, `rigid_sim view` and Chromium without a window, each in a process of its own. The
node is reset now and then, so that the bodies keep moving. Printed for the time after warming up:

* pictures: what the browser has drawn a second (of viser's renderer), and how often it could have
  (requestAnimationFrame), each the median of all pages;
* real time: the real-time factor that the node reports, median and worst second;
* memory [MB] of the page's program, of the browser's processes, of what steers it (Playwright and
  this script), and of the page's JavaScript, garbage collected: at the beginning and the end, the
  median of each third of the time between, and the slope of a straight line through the last two
  thirds, when caches are full. Memory is what a process has to itself or shares without a file.

Without a graphics card the browser draws with the CPU: then the pictures say most about the size
of the window (--window).
"""
import argparse
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager, ExitStack
import os
from pathlib import Path
import re
import shutil
import socket
import statistics
import subprocess
import sys
import time
from typing import Any, NamedTuple

import numpy as np
from playwright.sync_api import Page, sync_playwright

_WARM_UP = 8.0      # s
_RESET = 4.0        # s between two resets
_SAMPLES = 60       # looks at most
_MB = 1e6
# What the command line of a process holds, the more special first.
_KINDS = {'--type=renderer': 'pages', '--type=gpu-process': 'drawing', 'chromium': 'browser',
          'rigid_sim_ros': 'program'}

_COUNT = """
() => {
  window.turns = 0;
  const turn = () => { window.turns += 1; requestAnimationFrame(turn); };
  requestAnimationFrame(turn);
}
"""
_LOOK = """
() => ({
  turns: window.turns,
  pictures: window.__viserTestpoints.rendererInfo.render.frame,
  heap: performance.memory.usedJSHeapSize,
  now: performance.now() / 1000,
})
"""


class Sample(NamedTuple):
    """What was seen at one time; memory in MB."""

    now: float          # s
    factor: float       # real-time factor
    program: float      # the page's program
    pages: float        # the browser's processes that hold pages
    drawing: float      # its process that draws
    browser: float      # its other processes
    tools: float        # what steers the browser
    heap: float         # JavaScript in the first page


_MEMORY = ('program', 'pages', 'drawing', 'browser', 'tools', 'heap')


@contextmanager
def running(*words: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command of the package until the end of the block."""
    process = subprocess.Popen([sys.executable, '-m', 'rigid_sim_ros', *words],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def free_port() -> int:
    """Return a port that nobody uses."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def memory(pid: int, without: Collection[int] = ()) -> Counter[str]:
    """Return what a process and its children have in use, by kind of process [MB]."""
    used: Counter[str] = Counter()
    try:
        status = Path(f'/proc/{pid}/status').read_text(encoding='utf-8')
        children = Path(f'/proc/{pid}/task/{pid}/children').read_text(encoding='utf-8')
        command = Path(f'/proc/{pid}/cmdline').read_text(encoding='utf-8')
    except OSError:
        return used     # it has just ended
    kind = next((kind for mark, kind in _KINDS.items() if mark in command), 'tools')
    found = re.findall(r'^Rss(?:Anon|Shmem):\s+(\d+) kB', status, re.MULTILINE)
    used[kind] = sum(1024 * int(number) for number in found) / _MB
    for child in map(int, children.split()):
        if child not in without:
            used += memory(child, without)
    return used


def open_page(browser: Any, address: str, window: str) -> Page:
    """Open a page and wait until it shows a simulation."""
    width, height = map(int, window.split('x'))
    page: Page = browser.new_page(viewport={'width': width, 'height': height})
    end = time.monotonic() + 120.0
    while True:
        try:
            page.goto(address)
            break
        except Exception:
            if time.monotonic() > end:
                raise
            time.sleep(0.5)
    page.get_by_text('times real time').wait_for(timeout=120_000)
    # A message about the missing graphics card would cover buttons in a small window.
    page.add_style_tag(content='.mantine-Notifications-root {visibility: hidden}')
    page.evaluate(_COUNT)
    return page


def press(page: Page, role: Any, name: str) -> None:
    """Click on something, however long it takes to come."""
    page.get_by_role(role, name=name, exact=True).click(timeout=300_000)


def watch(
    pages: list[Page], program: int, own: Collection[int], seconds: float, charts: bool,
) -> list[Sample]:
    """Look at everything again and again, in between at the charts of the first page."""
    samples = []
    factor = 0.0
    garbage = pages[0].context.new_cdp_session(pages[0])
    begin = due = time.monotonic()
    reset = begin - _RESET
    while (now := time.monotonic()) < begin + seconds:
        pages[0].wait_for_timeout(1000)
        if now > reset + _RESET:
            reset = now
            press(pages[0], 'tab', 'Drive')
            found = re.search(r'at ([\d.]+) times real time', pages[0].inner_text('body'))
            factor = float(found.group(1)) if found else 0.0
            press(pages[0], 'button', 'Reset')
            if charts:
                press(pages[0], 'tab', 'Charts')
        if now < due:
            continue
        due = now + seconds / _SAMPLES
        # What is left once nothing is left lying about: else it is a saw.
        garbage.send('HeapProfiler.collectGarbage')
        used = memory(program) + memory(os.getpid(), own)
        used['heap'] = pages[0].evaluate(_LOOK)['heap'] / _MB
        samples.append(Sample(now - begin, factor, **{kind: used[kind] for kind in _MEMORY}))
    return samples


def report(before: list[Any], after: list[Any], samples: list[Sample]) -> None:
    """Print the figures."""
    for what, key in (('pictures drawn a second', 'pictures'), ('chances to draw one', 'turns')):
        rates = [(z[key] - a[key]) / (z['now'] - a['now'])
                 for a, z in zip(before, after, strict=True)]
        print(f'{what:28} {statistics.median(rates):8.1f}   (' + ', '.join(
            f'{rate:.1f}' for rate in rates) + ')')
    factors = [sample.factor for sample in samples]
    print(f'{"real-time factor":28} {statistics.median(factors):8.2f}   '
          f'(worst {min(factors):.2f})')
    times = np.array([sample.now for sample in samples])
    late = times > times[-1] / 3
    for kind in _MEMORY:
        values = np.array([getattr(sample, kind) for sample in samples])
        thirds = ', '.join(f'{np.median(part):.1f}' for part in np.array_split(values, 3))
        slope = 3600 * np.polyfit(times[late], values[late], 1)[0]
        print(f'{"memory of " + kind + " [MB]":28} {values[0]:8.1f} to {values[-1]:.1f}, '
              f'thirds {thirds}, the last two {slope:+.1f} an hour')


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description='Measure the page of a running simulation.')
    parser.add_argument('--scene', default='pile_of_shapes')
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--viewers', type=int, default=1)
    parser.add_argument('--window', default='640x400')
    parser.add_argument('--charts', action='store_true', help='look at the charts meanwhile')
    options = parser.parse_args()
    os.environ.setdefault('ROS_DOMAIN_ID', '91')
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    port = free_port()
    with ExitStack() as stack:
        node = stack.enter_context(running('run', options.scene))
        program = stack.enter_context(running('view', '--port', str(port)))
        tool = stack.enter_context(sync_playwright())
        browser = tool.chromium.launch(executable_path=shutil.which('chromium'), args=[
            '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
            '--disable-gpu-compositing', '--enable-precise-memory-info'])
        stack.callback(browser.close)
        pages = [open_page(browser, f'http://127.0.0.1:{port}', options.window)
                 for _ in range(options.viewers)]
        pages[0].wait_for_timeout(1000 * _WARM_UP)
        before = [page.evaluate(_LOOK) for page in pages]
        samples = watch(pages, program.pid, {node.pid, program.pid}, options.seconds,
                        options.charts)
        after = [page.evaluate(_LOOK) for page in pages]
    print(f'{options.scene}, {options.viewers} pages of {options.window}, '
          f'{samples[-1].now:.0f} s, {os.cpu_count()} CPUs, load {os.getloadavg()[0]:.1f}')
    report(before, after, samples)


if __name__ == '__main__':
    main()
