# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A diagram as one HTML page that can be zoomed into, by plotly.

Plotly writes a page that needs no server and no network (its 5 MB of JavaScript are in it), gives
each panel a legend of its own, and links the time axes. Bokeh does the same with more code.
"""

import math
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from rigid_sim_ros.plots.diagram import Band, Diagram, Line, Panel

_COLUMNS = 2
_ROW_HEIGHT = 270       # pixels
_SPACING = 0.22         # of the width: the legend of one column, the labels of the next
_LEGEND_FONT = 11       # pixels
_DOT = 3.5              # widths of its line
_DASHES = {'solid': 'solid', 'dashed': 'dash', 'dotted': 'dot'}


def write_page(diagram: Diagram, path: Path) -> None:
    """Write a diagram to a file; OSError."""
    columns = min(_COLUMNS, len(diagram.panels))
    rows = math.ceil(len(diagram.panels) / columns)
    figure = make_subplots(
        rows, columns, column_titles=None, horizontal_spacing=_SPACING,
        vertical_spacing=0.28 / rows,
        subplot_titles=[_panel_at(diagram, row, column, rows).title
                        if column * rows + row < len(diagram.panels) else ''
                        for row in range(rows) for column in range(columns)])
    first_time = ''
    for number, panel in enumerate(diagram.panels):
        column, row = divmod(number, rows)
        place = {'row': row + 1, 'col': column + 1}
        legend = f'legend{number + 1 if number else ""}'
        for band in panel.bands:
            figure.add_traces(_band(band, panel, legend), [row + 1] * 2, [column + 1] * 2)
        figure.add_traces([_line(line, panel, legend) for line in panel.lines],
                          [row + 1] * len(panel.lines), [column + 1] * len(panel.lines))
        axes = figure.get_subplot(**place)
        _place_legend(figure, legend, axes)
        first_time = _label(axes, panel, diagram, first_time)
        for reset in diagram.resets if panel.axes is None else ():
            figure.add_vline(reset, line={'color': '#555555', 'dash': 'dashdot', 'width': 1},
                             **place)
    figure.update_layout(title=diagram.title, height=_ROW_HEIGHT * rows + 110,
                         template='plotly_white', hovermode='x', margin={'l': 70, 'r': 150})
    figure.update_annotations(font_size=14)
    path.write_text(figure.to_html(include_plotlyjs=True, config={
        'displaylogo': False, 'responsive': True}), encoding='utf-8')


def _panel_at(diagram: Diagram, row: int, column: int, rows: int) -> Panel:
    return diagram.panels[column * rows + row]


def _line(line: Line, panel: Panel, legend: str) -> Any:
    dots = panel.dots(line)
    return go.Scatter(
        x=line.x, y=panel.visible(line.y), name=line.label, opacity=line.opacity,
        mode='lines+markers' if dots.any() else 'lines',
        marker={'size': _DOT * line.width * dots if dots.any() else 0, 'color': line.color,
                'opacity': 1.0},
        legend=legend, showlegend=bool(line.label),
        line={'color': line.color, 'dash': _DASHES[line.dash], 'width': line.width},
        connectgaps=False)


def _band(band: Band, panel: Panel, legend: str) -> list[Any]:
    red, green, blue = (int(band.color[k:k + 2], 16) for k in (1, 3, 5))
    fill = f'rgba({red}, {green}, {blue}, {band.opacity})'
    no_line = {'width': 0, 'color': band.color}
    return [
        go.Scatter(x=band.x, y=panel.visible(band.low), name=f'{band.label}, least', mode='lines',
                   line=no_line, legendgroup=band.label, showlegend=False, legend=legend),
        go.Scatter(x=band.x, y=panel.visible(band.high), name=band.label, mode='lines',
                   line=no_line, legendgroup=band.label, fill='tonexty', fillcolor=fill,
                   legend=legend)]


def _place_legend(figure: Any, legend: str, axes: Any) -> None:
    figure.update_layout({legend: {
        'x': axes.xaxis.domain[1] + 0.005, 'y': axes.yaxis.domain[1], 'xanchor': 'left',
        'yanchor': 'top', 'groupclick': 'toggleitem', 'bgcolor': 'rgba(255, 255, 255, 0)',
        'font': {'size': _LEGEND_FONT}}})


def _label(axes: Any, panel: Panel, diagram: Diagram, first_time: str) -> str:
    """Write the labels; link a time axis with the first one and return the name of that."""
    if panel.axes is not None:
        axes.xaxis.title.text, axes.yaxis.title.text = panel.axes
        axes.yaxis.scaleanchor = axes.xaxis.plotly_name.replace('axis', '')
        return first_time
    axes.xaxis.title.text, axes.yaxis.title.text = diagram.x_label, f'[{panel.unit}]'
    limits = panel.limits()
    if panel.is_log and limits is not None:
        axes.yaxis.type = 'log'
        limits = math.log10(limits[0]), math.log10(limits[1])
    axes.yaxis.range = limits
    name = axes.xaxis.plotly_name.replace('axis', '')
    if first_time:
        axes.xaxis.matches = first_time
    return str(first_time or name)
