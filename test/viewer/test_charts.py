# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The charts of the page show what /diagnostics says."""
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

import pytest
from viewer.browsing import Page
from viewer.telling import Told

from rigid_sim_ros.viewer.server import start, stop

TURNS = 5
# Of each chart its title, the names of its lines, and their points.
_CHARTS = """
() => Object.values(window.__viserTestpoints.uplots ?? {}).map(({chart}) => ({
  title: chart.root.querySelector('.u-title').textContent,
  names: chart.series.map((line) => line.label),
  points: chart.data.map((line) => Array.from(line)),
}))
"""


@pytest.fixture(scope='module')
def told() -> Iterator[tuple[Told, str]]:
    """Give a page that is told of a simulation, and its address."""
    server = start('127.0.0.1', 0)
    yield Told(server), f'http://127.0.0.1:{server.get_port()}'
    stop(server)


@pytest.fixture(scope='module')
def page(told: tuple[Told, str], browser: Any) -> Iterator[Page]:
    page = Page(browser, told[1])
    yield page
    page.close()


@pytest.fixture(scope='module')
def charts(told: tuple[Told, str], page: Page) -> dict[str, dict[str, list[float]]]:
    """Give the points of the lines of each chart, as the browser has them."""
    page.click_on(page.page.get_by_role('tab', name='Charts'))
    for _ in range(TURNS):
        told[0].turn()

    def shown() -> list[Any]:
        found = page.page.evaluate(_CHARTS)
        is_all = len(found) == 5 and all(len(each['points'][0]) == TURNS for each in found)
        return found if is_all else []

    found = page.wait_for(shown, 'five charts of all reports')
    return {each['title']: dict(zip(each['names'], each['points'], strict=True))
            for each in found}


def expected(factor: float, offset: float = 0.0) -> Any:
    return pytest.approx([factor * k + offset for k in range(1, TURNS + 1)])


def test_time_is_that_of_the_simulation(charts: Any) -> None:
    assert all(lines['time [s]'] == expected(0.25) for lines in charts.values())


def test_energy_stands_with_its_parts(charts: Any) -> None:
    lines = charts['energy [J]']
    assert (lines['total'], lines['kinetic'], lines['potential']) == (
        expected(3.0), expected(1.0), expected(2.0))


@pytest.mark.parametrize(('title', 'sign'), [
    ('momentum [kg m/s]', 1.0), ('angular momentum [kg m²/s]', -1.0)])
def test_momentum_has_a_line_for_each_axis(charts: Any, title: str, sign: float) -> None:
    for place, axis in enumerate('xyz'):
        assert charts[title][axis] == expected(sign, place)


def test_contacts_are_counted(charts: Any) -> None:
    assert charts['contacts']['contacts'] == expected(1.0)


def test_the_real_time_factor_is_the_measured_one(charts: Any) -> None:
    assert charts['real-time factor']['measured'] == expected(0.01, 0.5)


def test_legends_show_the_latest_values(charts: Any, page: Page) -> None:
    energy = [charts['energy [J]'][name][-1] for name in ('total', 'kinetic', 'potential')]
    legends = page.page.locator('div[style*="text-align: center"] b')
    page.wait_for(lambda: legends.all_inner_texts()[:3] == [f'{value:.4g}' for value in energy],
                  'the latest values in the legends')
