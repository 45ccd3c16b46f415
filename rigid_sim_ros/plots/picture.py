# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A diagram as PNG or SVG, by matplotlib."""

import math
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from rigid_sim_ros.plots.diagram import Diagram, Panel

_COLUMNS = 2
_WIDTH, _HEIGHT = 7.0, 2.5      # inches of a panel
_HEADING = 0.6                  # inches
_DPI = 110
_DOT = 2.2                      # widths of its line
_BESIDE = 0.05                  # of the span of time, left free on each side
_STYLE: Any = {
    'font.size': 9.5, 'axes.titlesize': 10.5, 'axes.titleweight': 'bold',
    'axes.titlelocation': 'left', 'axes.spines.top': False, 'axes.spines.right': False,
    'axes.grid': True, 'grid.color': '#d9d9d9', 'grid.linewidth': 0.6,
    'axes.formatter.useoffset': False, 'axes.formatter.limits': (-4, 5),
    'legend.frameon': False, 'legend.fontsize': 9,
    # Text stays text: it can be searched, and read to somebody.
    'svg.fonttype': 'none', 'svg.hashsalt': 'rigid_sim_ros',
}


def write_picture(diagram: Diagram, path: Path) -> None:
    """Write a diagram to a file whose suffix, .png or .svg, says the format; OSError."""
    with rc_context(_STYLE):
        columns = min(_COLUMNS, len(diagram.panels))
        rows = math.ceil(len(diagram.panels) / columns)
        figure = Figure(figsize=(columns * _WIDTH, rows * _HEIGHT + _HEADING),
                        layout='constrained')
        figure.suptitle(diagram.title, x=0.01, ha='left', fontsize=13)
        grid = figure.subplots(rows, columns, squeeze=False)
        # Column by column: what is one below the other shares the eye's time axis.
        places = list(grid.T.ravel())
        first, last = diagram.span()
        for axes, panel in zip(places, diagram.panels, strict=False):
            _draw(axes, panel, diagram)
            if panel.axes is None and first < last:
                axes.set_xlim(first - _BESIDE * (last - first), last + _BESIDE * (last - first))
        for axes in places[len(diagram.panels):]:
            axes.set_axis_off()
        # No date: the same bag gives the same file.
        metadata = {'Date': None} if path.suffix == '.svg' else {}
        figure.savefig(path, dpi=_DPI, metadata=metadata)


def _draw(axes: Any, panel: Panel, diagram: Diagram) -> None:
    for band in panel.bands:
        axes.fill_between(band.x, panel.visible(band.low), panel.visible(band.high),
                          color=band.color, alpha=band.opacity, linewidth=0.5,
                          label=band.label)
    for line in panel.lines:
        axes.plot(line.x, panel.visible(line.y), color=line.color, linestyle=line.dash,
                  linewidth=line.width, alpha=line.opacity, label=line.label or '_')
        dots = panel.dots(line)
        axes.plot(line.x[dots], panel.visible(line.y[dots]), color=line.color, linestyle='none',
                  marker='o', markersize=_DOT * line.width, alpha=line.opacity, label='_')
    axes.set_title(panel.title)
    if panel.axes is not None:
        axes.set_xlabel(panel.axes[0])
        axes.set_ylabel(panel.axes[1])
        axes.set_aspect('equal', adjustable='datalim')
    else:
        axes.set_xlabel(diagram.x_label)
        axes.set_ylabel(f'[{panel.unit}]')
        if panel.is_log:
            axes.set_yscale('log')
        axes.set_ylim(panel.limits())
        for reset in diagram.resets:
            axes.axvline(reset, color='#555555', linewidth=0.8, linestyle='dashdot')
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc='upper left', bbox_to_anchor=(1.0, 1.02), handlelength=1.8)
