# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is drawn, whatever draws it: panels of lines and bands with their units."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rigid_sim_ros.bag.motion import Array

# Okabe and Ito's colours, which colour-blind people tell apart, without the yellow that is hard
# to see on white.
COLORS = ('#0072B2', '#E69F00', '#009E73', '#D55E00', '#CC79A7', '#56B4E9', '#000000')
DASHES = ('solid', 'dashed', 'dotted')

# Points of a line: more than a screen or a page can show. A page of 30 lines has some 5 MB then.
_MOST_POINTS = 4000
# Decades below the largest number that a logarithmic axis shows: weights, and what hits them.
_DECADES = 5
# Half the height of a panel is at least this share of the numbers in it: rounding stays flat.
_LEAST_SHARE = 2e-3


class Line(NamedTuple):
    """One line; it is interrupted where a number is nan."""

    label: str      # '': it has no place in the legend
    x: Array
    y: Array
    color: str
    dash: str = 'solid'
    width: float = 1.4      # points
    opacity: float = 1.0


class Band(NamedTuple):
    """The area between two lines."""

    label: str
    x: Array
    low: Array
    high: Array
    color: str
    opacity: float


class Panel(NamedTuple):
    """One pair of axes."""

    title: str
    unit: str
    lines: Sequence[Line]
    bands: Sequence[Band] = ()
    floor: float = 0.0      # half of the least height, so that rounding looks like what it is
    axes: tuple[str, str] | None = None     # labels of a panel that shows a path, not a time
    is_log: bool = False    # of sizes: an impact is thousands of times a weight

    def visible(self, y: Array) -> Array:
        """Return numbers as they are drawn: on a logarithmic axis what is none is at its end."""
        limits = self.limits()
        return np.maximum(y, limits[0]) if self.is_log and limits is not None else y

    def dots(self, line: Line) -> npt.NDArray[np.bool_]:
        """
        Return which points of a line are drawn as dots.

        A point between two gaps is no stretch that could be seen. Of a path it is each end: that
        of a body which stays where it is shows nothing else.
        """
        known = np.isfinite(line.x) & np.isfinite(line.y)
        ends: npt.NDArray[np.bool_] = known & ~np.append(known[1:], False)
        return ends if self.axes else ends & ~np.insert(known[:-1], 0, False)

    def limits(self) -> tuple[float, float] | None:
        """Return the least and the largest y that is to be seen, None for those of the lines."""
        arrays = [*(line.y for line in self.lines), *(band.low for band in self.bands),
                  *(band.high for band in self.bands)]
        numbers = np.concatenate([array[np.isfinite(array)] for array in arrays])
        if self.axes or not numbers.size:
            return None
        low, high = float(numbers.min()), float(numbers.max())
        if self.is_log:
            high = max(high, self.floor)
            return high * 10.0 ** -_DECADES, 2.0 * high
        floor = max(self.floor, _LEAST_SHARE * max(abs(low), abs(high)))
        half = max(0.55 * (high - low), floor) or 1.0
        return (low + high) / 2 - half, (low + high) / 2 + half


class Diagram(NamedTuple):
    """All that one picture or page shows."""

    title: str
    x_label: str
    panels: Sequence[Panel]
    resets: Sequence[float]     # [s], drawn as vertical lines

    def span(self) -> tuple[float, float]:
        """Return the first and the last time [s] of any panel; nan without one."""
        panels = [panel for panel in self.panels if not panel.axes]
        times = np.concatenate([np.empty(0), *(line.x for panel in panels for line in panel.lines),
                                *(band.x for panel in panels for band in panel.bands)])
        times = times[np.isfinite(times)]
        return (float(times.min()), float(times.max())) if times.size else (np.nan, np.nan)


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """
    Return a line with fewer points that looks the same.

    Of each stretch the least and the largest number stay, so that no peak is lost, and a gap.
    """
    if len(x) <= _MOST_POINTS:
        return x, y
    starts = np.linspace(0, len(x), _MOST_POINTS // 2, endpoint=False).astype(int)
    keep = {0, len(x) - 1}
    for start, end in zip(starts, [*starts[1:], len(x)], strict=True):
        piece = y[start:end]
        missing = np.isnan(piece)
        keep |= {start + int(np.argmin(np.where(missing, np.inf, piece))),
                 start + int(np.argmax(np.where(missing, -np.inf, piece)))}
        if missing.any():
            keep.add(start + int(np.argmax(missing)))
    index = np.array(sorted(keep))
    return x[index], y[index]
