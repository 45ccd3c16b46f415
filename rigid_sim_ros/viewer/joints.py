# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The part of the page that shows and moves joints: a slider for each, and charts of one.

A slider stands where the joint is. While the simulation runs, moving it sends the drive of the
joint there within a moment, to stay; what has no drive that leads it to a position stays as it is.
In a pause it puts the joint there at once.
"""
import asyncio
from collections.abc import Callable, Mapping
import math
import time
from typing import Any, NamedTuple

import viser

from rigid_sim_ros.messages.decode import joint_state, Malformed
from rigid_sim_ros.scene import Scene, schema
from rigid_sim_ros.scene.joint_groups import full_name, joint_groups, JointGroup
from rigid_sim_ros.viewer.charts import Chart, Charts
from rigid_sim_ros.viewer.controls import notify
from rigid_sim_ros.viewer.inputs import put, write
from rigid_sim_ros.viewer.simulation import Driver

_NONE = '-'
_CHARTS = tuple(Chart(title, ('joint',)) for title in (
    'position [rad or m]', 'velocity [rad/s or m/s]', 'effort [N m or N]'))
_CHART_PERIOD = 0.1     # [s] of wall time between two points of a chart
# [s] After a slider was moved, it is not moved back: the joint needs a moment to get there.
_PATIENCE = 1.5
_TURN = 2.0 * math.pi
# More sliders than anybody looks at would slow the page down.
_MOST_SLIDERS = 64
_LONG = 1.0     # [m] to either side, of a joint that slides without limits


class _Figures(NamedTuple):
    """What was heard of a joint."""

    position: float     # [rad or m]
    velocity: float
    effort: float


class JointPanel:
    """The tab of joints."""

    def __init__(self, server: viser.ViserServer, driver: Driver, tab: Any,
                 is_paused: Callable[[], bool]) -> None:
        """Fill the tab; what is in it follows from the scene."""
        self._server, self._driver = server, driver
        self._is_paused = is_paused
        self._joints: dict[str, schema.Joint] = {}
        self._sliders: dict[str, Any] = {}
        self._folders: list[Any] = []
        self._moved_at: dict[str, float] = {}
        self._wanted: dict[str, float] = {}
        self._figures: dict[str, _Figures] = {}
        self._heard: dict[str, bytes] = {}
        self._charted, self._charted_at = _NONE, 0.0
        self._t_ns = 0
        self._asking = asyncio.Lock()
        with tab:
            self._status = server.gui.add_markdown('')
            self._place = server.gui.add_folder('positions [rad or m]')
            self._chosen = server.gui.add_dropdown('chart of', (_NONE,), initial_value=_NONE)
            self._charts = Charts(server.gui, _CHARTS)

    def attach(self, scene: Scene) -> None:
        """Offer the joints of a scene."""
        for handle in (*self._sliders.values(), *self._folders):
            handle.remove()
        self._sliders, self._folders = {}, []
        self._figures, self._heard = {}, {}
        self._charted = _NONE
        named = scene.spec.joints or ()
        groups = joint_groups(scene.spec.joints)
        self._joints = {full_name(group.model, name): named[j] for group in groups
                        for name, j in zip(group.names, group.places, strict=True)}
        names = tuple(self._joints)
        self._chosen.options = (_NONE, *names)
        put(self._chosen, names[0] if names else _NONE)
        left = len(names) - _MOST_SLIDERS
        write(self._status, 'the scene has no joints with a position' if not names else (
            f'sliders for the first {_MOST_SLIDERS} joints of {len(names)}' if left > 0 else ''))
        for group in groups:
            self._add_group(group, is_alone=len(groups) == 1)

    def _add_group(self, group: JointGroup, *, is_alone: bool) -> None:
        folder = self._place
        if not is_alone:
            with self._place:
                folder = self._server.gui.add_folder(group.model or 'without a model')
            self._folders.append(folder)
        with folder:
            for name in group.names[:_MOST_SLIDERS - len(self._sliders)]:
                self._add_slider(full_name(group.model, name))

    def _add_slider(self, name: str) -> None:
        low, high = reach(self._joints[name])
        if not low < high:
            return
        step = 10.0 ** math.floor(math.log10((high - low) / 500.0))
        slider = self._server.gui.add_slider(
            name.rpartition('/')[2], low, high, step, min(max(0.0, low), high),
            hint='Moves the joint: by its drive, or in a pause at once.')
        self._sliders[name] = slider

        # async: viser calls it as soon as the value is here, in the order of the mouse.
        @slider.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self._move(name, float(event.target.value))

    async def _move(self, name: str, position: float) -> None:
        """Send the latest of the positions that somebody wants of a joint."""
        self._moved_at[name] = time.monotonic()
        self._wanted[name] = position
        async with self._asking:
            if name in self._wanted:
                await asyncio.to_thread(self._send, name, self._wanted.pop(name))

    def _send(self, name: str, position: float) -> None:
        joint = self._joints.get(name)
        if joint is None:
            return      # of a scene that is gone
        if self._is_paused():
            now = self._figures.get(name)
            if joint.type == 'continuous' and now is not None:     # its turns stay counted
                position = now.position + math.remainder(position - now.position, _TURN)
            self._driver.put_joint(name, position, self._answer)
        elif joint.drive is None or joint.drive.stiffness is None:
            self._answer(f'{name} has no drive that leads it to a position: pause to put it there',
                         False)
        else:
            self._driver.lead_joint(name, position, self._answer)

    def _answer(self, text: str, is_well: bool) -> None:
        if not is_well:     # what goes well is seen
            notify(self._server, text, False)

    def hear(self, heard: Mapping[str, bytes], now: float) -> None:
        """Take messages of joint states, by model, into the charts; now [s] is wall time."""
        if not self._joints or now - self._charted_at < _CHART_PERIOD:
            return
        self._charted_at = now
        is_new = False
        for model, data in list(heard.items()):
            if self._heard.get(model) is not data:
                self._heard[model] = data
                self._read(model, data)
                is_new = True
        chosen = self._chosen.value
        if chosen != self._charted:     # here, and not in the thread of the one who chooses
            self._charted = chosen
            self._charts.clear()
        figures = self._figures.get(chosen)
        if is_new and figures is not None:
            self._charts.add(1e-9 * self._t_ns, {
                chart.title: [number] for chart, number in zip(_CHARTS, figures, strict=True)})

    def show(self, now: float) -> None:
        """Let sliders stand where their joints are, but those that were moved just now."""
        for name, slider in self._sliders.items():
            figures = self._figures.get(name)
            if figures is not None and now - self._moved_at.get(name, -_PATIENCE) >= _PATIENCE:
                put(slider, self._shown(name, figures.position, slider))

    def _read(self, model: str, data: bytes) -> None:
        try:
            self._t_ns, _, names, numbers = joint_state(data)
        except Malformed:
            return
        for name, row in zip(names, numbers.tolist(), strict=True):
            self._figures[full_name(model, name)] = _Figures(*row)

    def _shown(self, name: str, position: float, slider: Any) -> float:
        """Return where a slider stands for a position."""
        if self._joints[name].type == 'continuous':
            position = math.remainder(position, _TURN)
        digits = max(0, round(-math.log10(slider.step)))
        return round(min(max(position, slider.min), slider.max), digits)


def reach(joint: schema.Joint) -> tuple[float, float]:
    """Return the ends of the slider of a joint [rad or m]."""
    lower, upper = joint.limits.lower, joint.limits.upper
    far = _LONG if joint.type == 'prismatic' else math.pi
    return (-far if lower is None else lower), (far if upper is None else upper)
