# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a bag: its states over a timeline."""
from collections.abc import Sequence
import multiprocessing
from multiprocessing.connection import Connection
import os
from pathlib import Path
import threading
import time
from typing import Any

import numpy as np
import viser

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import Motion as Series
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.plots.energies import energies
from rigid_sim_ros.viewer import charts, overlays as kinds
from rigid_sim_ros.viewer.charts import Charts
from rigid_sim_ros.viewer.inputs import put, write
from rigid_sim_ros.viewer.overlays import contact_lines, Overlays
from rigid_sim_ros.viewer.recording import Happening, Recording
from rigid_sim_ros.viewer.server import PageServer
from rigid_sim_ros.viewer.show import ShowPanel
from rigid_sim_ros.viewer.stage import Stage

_CHARTS = (charts.ENERGY, charts.MOMENTUM, charts.ANGULAR_MOMENTUM)
_OVERLAYS = (kinds.VELOCITY, kinds.WRENCHES, kinds.CONTACTS, kinds.AXES, kinds.NAMES, kinds.TRAILS,
             kinds.SPRINGS)
_POINTS = 400           # of a curve in a chart
_LETTER = 0.036         # of the timeline: how wide a letter below a mark is, 5 of 140 px
_NO_EVENT = '-'
_DIFFERENCE = 'difference'
_SLOWEST, _FASTEST = 0.05, 10.0
# What stands below that slider, clear of its handle at the start.
_RATES = ((2.0, '2'), (5.0, '5'), (10.0, '10'))
_STEP = 0.001           # s: how fine the timeline is


class BagPage:
    """Plays a recording in the page."""

    def __init__(self, server: PageServer, recording: Recording) -> None:
        self._server = server
        self._recording = recording
        self._time = self._begin = float(recording.times[0])
        self._end = float(recording.times[-1])
        self._row = -1          # that is in the picture
        self._plays = False
        self._lock = threading.Lock()
        tabs = server.gui.add_tab_group()
        self._tab = tabs.add_tab('Play')
        with self._tab:
            self._add_controls(server.gui)
        with tabs.add_tab('Show'):
            show = ShowPanel(server, _OVERLAYS, self._switch)
        with tabs.add_tab('Charts'):
            self._fill_charts(server.gui)
        self._stage = Stage(server, recording.scene)
        self._overlays = Overlays(server, self._stage)
        show.attach(self._stage, self._overlays)
        self._mark()
        server.set_title(Path(recording.path).resolve().name)

    def run(self, stopped: threading.Event, rate: float) -> None:
        """Play until the event is set, at most `rate` pictures a second."""
        before = time.monotonic()
        while not stopped.wait(1.0 / rate):
            now = time.monotonic()
            if self._plays:
                self._advance(now - before)
            before = now
            self._show(now)

    def note_verdict(self, text: str, at: float | None) -> None:
        """Show what verify found, and where on the timeline."""
        write(self._verdict, text)
        if at is not None:
            self._recording.happenings.append(Happening(at, _DIFFERENCE, 'first difference'))
            self._mark()

    def _add_controls(self, gui: viser.GuiApi) -> None:
        recording = self._recording
        note = (f', one of {recording.thinning} states' if recording.thinning > 1 else '')
        write(gui.add_markdown(''), f'**{recording.path}**: {recording.duration:.2f} s, '
                                    f'{len(recording)} states{note}')
        self._status = gui.add_markdown('')
        self._play = gui.add_button('Play', icon=viser.Icon.PLAYER_PLAY)
        self._timeline = self._new_timeline((), None)
        steps = gui.add_button_group('step', ('back', 'forward'))
        self._rate = gui.add_slider('rate', _SLOWEST, _FASTEST, 0.05, 1.0, marks=_RATES,
                                    hint='Seconds of the recording a second.')
        self._loops = gui.add_checkbox('loop', initial_value=False)
        self._event = gui.add_dropdown('event', (_NO_EVENT,), hint='Go to what happened.')
        self._verdict = gui.add_markdown('')
        self._play.on_click(lambda _: self._toggle())
        steps.on_click(lambda event: self._step(1 if event.target.value == 'forward' else -1))
        self._event.on_update(self._go_to_event)

    def _fill_charts(self, gui: viser.GuiApi) -> None:
        recording, scene = self._recording, self._recording.scene
        rows = np.unique(np.linspace(0, len(recording) - 1, _POINTS).round().astype(np.intp))
        table = recording.table(rows)
        series = Series(
            list(scene.names), recording.times[rows], table[..., :3], table[..., 3:7],
            table[..., 7:10], table[..., 10:], [], False, scene, None, {}, {}, [])
        sums = energies(series, scene, slice(None), np.arange(len(scene.names)))
        kinetic = sums.linear + sums.rotational
        potential = np.zeros_like(kinetic) if sums.potential is None else sums.potential
        self._charts = Charts(gui, _CHARTS)
        self._charts.fill(series.time.tolist(), {
            charts.ENERGY.title: np.array([kinetic + potential, kinetic, potential]),
            charts.MOMENTUM.title: sums.momentum.T,
            charts.ANGULAR_MOMENTUM.title: sums.angular_momentum.T})

    def _mark(self) -> None:
        """Put what happened on the timeline and into the list."""
        happenings = sorted(self._recording.happenings)
        marks = named_marks(happenings, self._begin, self._end)
        old = self._timeline
        # At once: what stands below must not move to and fro under the mouse.
        with self._server.atomic(), self._tab:
            self._timeline = self._new_timeline(
                tuple((at, text) if text else at for at, text in marks.items()), old.order)
            old.remove()
        self._event.options = (_NO_EVENT, *(
            f'{each.time:.3f} s  {each.text}' for each in happenings))

    def _new_timeline(self, marks: tuple[float | tuple[float, str], ...],
                      order: float | None) -> viser.GuiSliderHandle[float]:
        # The marks of a slider cannot be changed later.
        timeline = self._server.gui.add_slider(
            'time [s]', self._begin, max(self._end, self._begin + _STEP), _STEP, self._begin,
            marks=marks or None, order=order)
        timeline.on_update(self._seek)
        put(timeline, round(self._time, 3))
        return timeline

    def _toggle(self) -> None:
        with self._lock:
            if not self._plays and self._time >= self._end:
                self._time = self._begin
            self._turn(not self._plays)

    def _turn(self, plays: bool) -> None:
        self._plays = plays
        self._play.label = 'Pause' if plays else 'Play'
        self._play.icon = viser.Icon.PLAYER_PAUSE if plays else viser.Icon.PLAYER_PLAY

    def _switch(self, kind: str, wanted: bool) -> None:
        self._row = -1      # draws it again

    def _seek(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:        # not by this program, as it plays
            with self._lock:
                self._time = float(self._timeline.value)

    def _step(self, count: int) -> None:
        """Go to the next state, or the one before."""
        with self._lock:
            self._turn(False)
            row = self._recording.row(self._time) + count
            self._time = float(self._recording.times[min(max(row, 0), len(self._recording) - 1)])

    def _go_to_event(self, event: viser.GuiEvent[Any]) -> None:
        happenings = sorted(self._recording.happenings)
        chosen = self._event.options.index(self._event.value) - 1
        if event.client is not None and 0 <= chosen < len(happenings):
            with self._lock:
                self._time = happenings[chosen].time

    def _advance(self, passed: float) -> None:
        with self._lock:
            self._time += passed * self._rate.value
            if self._time >= self._end:
                self._time = self._begin if self._loops.value else self._end
                if not self._loops.value:
                    self._turn(False)

    def _show(self, now: float) -> None:
        at = self._time
        row = self._recording.row(at)
        if row == self._row:
            return
        self._row = row
        motion = self._recording.motion(row)
        with self._server.atomic():
            self._stage.move(motion)
            self._overlays.move(motion, now)
            self._overlays.show_wrenches(motion, self._recording.applied(at))
            lines = contact_lines(self._recording.contacts(at))
            if lines is not None:
                self._overlays.show_contacts(lines)
            self._charts.tell(at)
            put(self._timeline, round(at, 3))
            write(self._status, f'{at:.3f} s, state {row + 1} of {len(self._recording)}, '
                                f'simulation time {1e-9 * motion.t_ns:.3f} s')


def named_marks(happenings: Sequence[Happening], begin: float, end: float) -> dict[float, str]:
    """
    Return the marks of a timeline with what stands below them, '' where there is no room.

    The first difference comes first, then what happened earlier.
    """
    marks = dict.fromkeys((each.time for each in happenings), '')
    taken: list[tuple[float, float]] = []
    for each in sorted(happenings, key=lambda one: (one.what != _DIFFERENCE, one.time)):
        place = (each.time - begin) / max(end - begin, _STEP)
        half = 0.5 * _LETTER * (len(each.what) + 1)
        if all(abs(place - other) >= half + width for other, width in taken):
            taken.append((place, half))
            marks[each.time] = each.what
    return marks


class Verification:
    """Verifies a bag in a process of its own, and tells a page what comes of it."""

    def __init__(self, page: BagPage, recording: Recording) -> None:
        self._page = page
        self._recording = recording
        context = multiprocessing.get_context('spawn')
        self._answer, end = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_send_verdict, args=(recording.path, end), daemon=True)
        page.note_verdict('verifying ...', None)
        self._process.start()
        end.close()
        threading.Thread(target=self._wait, name='verify', daemon=True).start()

    def stop(self) -> None:
        """Wait for nothing any more."""
        self._process.terminate()
        self._process.join()

    def _wait(self) -> None:
        try:
            text, stamp = self._answer.recv()
        except EOFError:
            return      # it was stopped
        at = None if stamp is None else self._recording.time_of_stamp(stamp)
        self._page.note_verdict(text, at)


def _send_verdict(path: str | os.PathLike[str], end: Connection) -> None:
    end.send(_verify(path))


def _verify(path: str | os.PathLike[str]) -> tuple[str, int | None]:
    """Return what came of it, and the time in the bag [ns] of the first difference."""
    stamps = [0]

    def progress(stamp: int) -> None:
        stamps[0] = stamp

    try:
        verdict = verify(path, progress)
    except BagError as error:
        return f'cannot be verified: {error}', None
    if verdict.difference is not None:
        return f'differs at {verdict.difference}', stamps[0]
    if verdict.faults:
        return f'damaged: {verdict.faults[0]}', None
    return f'verified: the same to the bit in {verdict.steps} steps', None
