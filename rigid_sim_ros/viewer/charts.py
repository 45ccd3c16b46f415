# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The charts of the page: figures over time."""
from collections import deque
from collections.abc import Mapping, Sequence
from html import escape
import math
from typing import NamedTuple

import numpy as np
import viser
from viser import uplot

_LONGEST = 300      # points that a chart keeps
_HEIGHT = 170       # px
_LEGEND = 'font-size: 12px; text-align: center; padding: 0 14px 10px'
# Okabe and Ito's colours.
_LINES = ('#0072b2', '#d55e00', '#009e73', '#cc79a7')


class Chart(NamedTuple):
    """What stands in one chart: a title with its unit, and the names of its lines."""

    title: str
    lines: Sequence[str]


ENERGY = Chart('energy [J]', ('total', 'kinetic', 'potential'))
MOMENTUM = Chart('momentum [kg m/s]', ('x', 'y', 'z'))
ANGULAR_MOMENTUM = Chart('angular momentum [kg m²/s]', ('x', 'y', 'z'))
CONTACTS = Chart('contacts', ('contacts',))
PACE = Chart('real-time factor', ('measured',))


class Charts:
    """Some charts over one time axis; their legends show the values of the picture beside them."""

    def __init__(self, gui: viser.GuiApi, charts: Sequence[Chart], length: int = _LONGEST,
                 ) -> None:
        """Make them, empty; they keep so many points."""
        self._times: deque[float] = deque(maxlen=length)
        self._values: dict[str, list[deque[float]]] = {}
        self._handles: dict[str, viser.GuiUplotHandle] = {}
        self._charts = {chart.title: chart for chart in charts}
        self._legends: dict[str, viser.GuiHtmlHandle] = {}
        self._filled: tuple[np.ndarray, Mapping[str, np.ndarray]] = np.zeros(1), {}
        self._point = -1        # of whole curves, that is in the legends
        for chart in charts:
            self._values[chart.title] = [deque(maxlen=length) for _ in chart.lines]
            self._handles[chart.title] = gui.add_uplot(
                _empty(len(chart.lines)), _series(chart),
                title=chart.title, height=_HEIGHT, scales={'x': uplot.Scale(time=False)},
                legend=uplot.Legend(show=False))
            self._legends[chart.title] = gui.add_html(_legend(chart, ()))

    def add(self, time: float, values: Mapping[str, Sequence[float]]) -> None:
        """Add a point at a time [s] to each chart; time that goes back begins anew."""
        if self._times and time < self._times[-1]:
            self._forget()
        self._times.append(time)
        for title, lines in self._values.items():
            numbers = values.get(title, [float('nan')] * len(lines))
            for line, number in zip(lines, numbers, strict=True):
                line.append(number)
            self._legends[title].content = _legend(self._charts[title], numbers)
            self._show(title)

    def fill(self, times: Sequence[float], values: Mapping[str, np.ndarray]) -> None:
        """Show whole curves: of each chart a row for each line."""
        for title, rows in values.items():
            self._handles[title].data = (np.asarray(times, float), *np.asarray(rows, float))
        self._filled = np.asarray(times, float), values

    def tell(self, time: float) -> None:
        """Show in the legends what whole curves are at a time [s]."""
        times, values = self._filled
        point = max(int(np.searchsorted(times, time, 'right')) - 1, 0)
        if point != self._point:
            self._point = point
            for title, rows in values.items():
                self._legends[title].content = _legend(
                    self._charts[title], np.asarray(rows, float)[:, point].tolist())

    def clear(self) -> None:
        """Empty all charts."""
        self._forget()
        for title, lines in self._values.items():
            self._handles[title].data = _empty(len(lines))
            self._legends[title].content = _legend(self._charts[title], ())

    def _forget(self) -> None:
        self._times.clear()
        for lines in self._values.values():
            for line in lines:
                line.clear()

    def _show(self, title: str) -> None:
        if len(self._times) < 2:
            return
        self._handles[title].data = (
            np.array(self._times), *(np.array(line) for line in self._values[title]))


def _legend(chart: Chart, numbers: Sequence[float]) -> str:
    """Return the names of the lines in their colours, with numbers if there are any, as HTML."""
    words = [f'{number:.4g}' if math.isfinite(number) else '-' for number in numbers]
    entries = [f'<span style="white-space: nowrap"><span style="color: {color}">&#9632;</span> '
               f'{escape(label)} <b>{word}</b></span>'
               for label, color, word in zip(chart.lines, _LINES, words or [''] * len(chart.lines),
                                             strict=False)]
    return f'<div style="{_LEGEND}">{"&emsp;".join(entries)}</div>'


def _empty(lines: int) -> tuple[np.ndarray, ...]:
    # Two points: viser keeps the part of the time axis that a user has zoomed to, as a share of
    # the whole, and an axis without length has no shares.
    return (np.array([0.0, 1.0]), *(np.zeros(2) for _ in range(lines)))


def _series(chart: Chart) -> tuple[uplot.Series, ...]:
    lines = [uplot.Series(label=label, stroke=color, width=1.5)
             for label, color in zip(chart.lines, _LINES, strict=False)]
    return (uplot.Series(label='time [s]'), *lines)
