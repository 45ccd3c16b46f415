# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""However long a page is open, nothing is kept of what it has shown."""
from collections import Counter
from collections.abc import Callable, Iterator
import gc
from importlib.util import find_spec
import json
from typing import Any
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

import numpy as np
import pytest
from viewer.browsing import OTHER_SCENE, Page, SCENE
from viewer.telling import Told

from rigid_sim_ros.viewer.server import PageServer, start, stop

OVERLAYS = ('velocities', 'wrenches', 'contacts', 'body axes', 'names', 'trails')
# ms: about as many pictures are drawn as are told.
PAUSE = 50
# How many pictures are drawn between two counts, and how often the scene changes.
PICTURES, SCENES = 30, 10
# What fills only slowly is full after so many counts.
ROUNDS = 8
_THINGS = ('object', 'closure', 'array')

_PICTURES = 'window.__viserTestpoints.rendererInfo.render.frame'
_HAS_CHARTS = 'Object.values(window.__viserTestpoints.uplots ?? {}).length > 0'
_SHOWN = f"""
(time) => {_HAS_CHARTS} && Object.values(
  window.__viserTestpoints.uplots).every(({{chart}}) => chart.data[0].at(-1) >= time)
"""
_ON_THE_CARD = '({...window.__viserTestpoints.rendererInfo.memory})'


@pytest.fixture(scope='module')
def server() -> Iterator[PageServer]:
    server = start('127.0.0.1', 0)
    yield server
    stop(server)


@pytest.fixture(scope='module')
def told(server: PageServer) -> Told:
    return Told(server)


@pytest.fixture(scope='module')
def page(told: Told, server: PageServer, browser: Any) -> Iterator[Page]:
    """Give the page with all that can be switched on, and the charts in view."""
    page = Page(browser, f'http://127.0.0.1:{server.get_port()}', (500, 300), pause=PAUSE)
    for overlay in OVERLAYS:
        page.switch(overlay)
    show_charts(page)
    draw(page, told, PICTURES)
    yield page
    page.close()


def draw(page: Page, told: Told, pictures: int) -> None:
    """Go on until so many more pictures are drawn, and as many reports are told."""
    end = page.page.evaluate(_PICTURES) + pictures
    last = told.turns + pictures

    def is_drawn() -> bool:
        told.turn()
        # Else a quick page has drawn them before it was told enough for a leak to count.
        return told.turns >= last and bool(page.page.evaluate(_PICTURES) >= end)

    page.wait_for(is_drawn, f'{pictures} pictures', look=50)


def held(page: Page) -> Counter[str]:
    """Count what the page holds in the browser, and the program for it."""
    tools = page.page.context.new_cdp_session(page.page)
    parts: list[str] = []
    tools.on('HeapProfiler.addHeapSnapshotChunk', lambda event: parts.append(event['chunk']))
    tools.send('HeapProfiler.takeHeapSnapshot')     # garbage is collected first
    found = Counter(dict(tools.send('Memory.getDOMCounters')))
    tools.detach()
    found.update(things(''.join(parts)))
    found.update(page.page.evaluate(_ON_THE_CARD))
    gc.collect()
    found['kept by viser in Python'] = sum(
        str(type(each).__module__).startswith('viser') for each in gc.get_objects())
    return found


def things(snapshot: str) -> dict[str, int]:
    """Count objects, functions and arrays of JavaScript in a snapshot of its memory."""
    head, _, rest = snapshot.partition('"nodes":[')
    meta = json.loads(head[len('{"snapshot":'):].rstrip().rstrip(','))['meta']
    numbers = np.fromstring(rest[:rest.index(']')], dtype=np.int64, sep=',')
    kinds = numbers[meta['node_fields'].index('type')::len(meta['node_fields'])]
    names = meta['node_types'][0]
    return {name: int((kinds == names.index(name)).sum()) for name in _THINGS}


def wait_until_shown(page: Page, told: Told) -> None:
    """
    Wait until the page has all that it was told.

    Else what is still on its way to a page that a busy machine lets wait counts as kept. One that
    had to wait for long has lost its connection, and began again without the charts in view.
    """
    told.turn()

    def is_shown() -> bool:
        if not page.page.evaluate(_HAS_CHARTS):
            show_charts(page)
        return bool(page.page.evaluate(_SHOWN, told.time))

    page.wait_for(is_shown, 'the last point of the charts')


def show_charts(page: Page) -> None:
    page.click_on(page.page.get_by_role('tab', name='Charts'))


@pytest.fixture(scope='module')
def counts() -> list[Counter[str]]:
    """Give what was counted so far: a test begins with the last count of the one before."""
    return []


def growing(
    page: Page, told: Told, counts: list[Counter[str]], go_on: Callable[[], None], least: int,
) -> dict[str, list[int]]:
    """
    Return what becomes more by at least that number each time that the page goes on.

    What is kept grows every time. A cache that fills, and code that the browser compiles when it
    has run often enough, grow less and less: a count that once grew by less is not suspected any
    more, and the page goes on until none is, at most `ROUNDS` times.
    """
    if not counts:
        wait_until_shown(page, told)
        counts.append(held(page))
    suspects: dict[str, list[int]] = {what: [] for what in counts[-1]}
    for _ in range(ROUNDS):
        go_on()
        wait_until_shown(page, told)
        before, after = counts[-1], held(page)
        counts.append(after)
        suspects = {what: [*steps, after[what] - before[what]]
                    for what, steps in suspects.items() if after[what] - before[what] >= least}
        if not suspects:
            break
    return suspects


def test_nothing_is_kept_of_pictures_charts_and_texts(
    page: Page, told: Told, counts: list[Counter[str]],
) -> None:
    turns = told.turns
    assert growing(page, told, counts, lambda: draw(page, told, PICTURES), PICTURES // 2) == {}
    assert told.turns > turns


def test_nothing_is_kept_of_scenes(page: Page, told: Told, counts: list[Counter[str]]) -> None:
    def change_scenes() -> None:
        for _ in range(SCENES // 2):
            for scene in (OTHER_SCENE, SCENE):
                told.show(scene)
                draw(page, told, 2)
        draw(page, told, PICTURES // 4)

    assert growing(page, told, counts, change_scenes, SCENES // 2) == {}
