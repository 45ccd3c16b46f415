# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a running simulation."""
import threading
import time

import viser

from rigid_sim_ros.scene import SceneError
from rigid_sim_ros.scene.reader import scene_from_text
from rigid_sim_ros.viewer import charts, overlays as kinds
from rigid_sim_ros.viewer.charts import Charts
from rigid_sim_ros.viewer.controls import BodyPanel, PacePanel
from rigid_sim_ros.viewer.grip import grip, Hands
from rigid_sim_ros.viewer.inputs import write
from rigid_sim_ros.viewer.joints import JointPanel
from rigid_sim_ros.viewer.motion import Motion, MotionDecoder
from rigid_sim_ros.viewer.overlays import contact_lines, Overlays
from rigid_sim_ros.viewer.server import PageServer
from rigid_sim_ros.viewer.show import ShowPanel
from rigid_sim_ros.viewer.simulation import Driver, Inbox, Report
from rigid_sim_ros.viewer.stage import Batch, Stage

_CHARTS = (charts.ENERGY, charts.MOMENTUM, charts.ANGULAR_MOMENTUM, charts.CONTACTS, charts.PACE)
_OVERLAYS = (kinds.VELOCITY, kinds.WRENCHES, kinds.CONTACTS, kinds.AXES, kinds.NAMES, kinds.TRAILS,
             kinds.SPRINGS)
_SILENCE = 3.0      # s without a word after which the simulation counts as gone
_STATUS_PERIOD = 0.25


class LivePage:
    """Shows what an inbox holds, and drives the simulation that fills it."""

    def __init__(self, server: PageServer, inbox: Inbox, driver: Driver) -> None:
        self._server = server
        self._inbox = inbox
        self._driver = driver
        self._text = ''
        self._problem = ''      # with the scene
        self._state = b''
        self._reported = 0
        self._status_due = 0.0
        self._stage: Stage | None = None
        self._overlays: Overlays | None = None
        self._decoder = MotionDecoder(())
        self._motion: Motion | None = None
        self._hands: Hands | None = None
        self._acts = False
        self._is_stale = False      # another overlay is wanted than those in the picture
        tabs = server.gui.add_tab_group()
        with tabs.add_tab('Drive'):
            self._pace = PacePanel(server, driver)
            self._body = BodyPanel(server, driver)
        with tabs.add_tab('Show'):
            self._show = ShowPanel(server, _OVERLAYS, self._switch)
        self._joints = JointPanel(server, driver, tabs.add_tab('Joints'),
                                  lambda: self._pace.is_paused)
        with tabs.add_tab('Charts'):
            self._charts = Charts(server.gui, _CHARTS)
        inbox.heard_state = self._react
        server.on_client_disconnect(self._let_go)

    def run(self, stopped: threading.Event, rate: float) -> None:
        """Follow the simulation until the event is set, at most `rate` times a second."""
        due = time.monotonic()
        while not stopped.wait(max(0.0, due - time.monotonic())):
            now = time.monotonic()
            due = max(due + 1.0 / rate, now)
            self.update(now)

    def update(self, now: float) -> None:
        """Show what is new; now [s] is steady wall time."""
        with self._server.atomic():
            if self._inbox.scene != self._text:
                self._build(self._inbox.scene)
            if self._inbox.state != self._state:
                self._state = self._inbox.state
                self._follow(self._decoder.read(self._state), now)
            elif self._is_stale:    # also while the simulation is paused
                self._follow(self._motion, now)
            if self._inbox.reported != self._reported:
                self._reported = self._inbox.reported
                self._server.set_title(f'{self._inbox.node}: {self._inbox.scene_name}')
                self._report(now)
            self._joints.hear(self._inbox.joints, now)
            if now >= self._status_due:
                self._status_due = now + _STATUS_PERIOD
                self._say(now)
                self._joints.show(now)

    def _build(self, text: str) -> None:
        """Show another scene."""
        self._text, self._problem = text, ''
        try:
            scene = scene_from_text(text, 'scene')
        except SceneError as error:
            self._problem = f'this scene cannot be shown: {error.summary}'
            return
        if self._stage is not None and self._overlays is not None:
            self._overlays.remove()
            self._stage.remove()
        self._charts.clear()
        self._state, self._motion = b'', None
        stage = self._stage = Stage(self._server, scene)
        self._overlays = Overlays(self._server, stage)
        self._hands = Hands(scene)
        self._decoder = MotionDecoder(scene.names)
        self._show.attach(stage, self._overlays)
        self._body.attach(scene.names, self._hands)
        self._joints.attach(scene)
        for batch in stage.batches:
            if stage.is_moving(batch):
                self._make_touchable(batch)

    def _follow(self, motion: Motion | None, now: float) -> None:
        if motion is None or self._stage is None or self._overlays is None:
            return
        self._motion = motion
        self._is_stale = False
        self._body.follow(motion)
        self._stage.move(motion)
        self._overlays.move(motion, now)
        self._overlays.show_wrenches(motion, self._inbox.applied)
        lines = contact_lines(self._inbox.contacts) if self._inbox.contacts else None
        if lines is not None:
            self._overlays.show_contacts(lines)
        self._inbox.contacts = b''
        if self._hands is not None:
            self._overlays.show_grips(motion, list(self._hands.grips.values()))

    def _switch(self, kind: str, wanted: bool) -> None:
        self._driver.listen(kind, wanted)
        self._is_stale = True

    def _report(self, now: float) -> None:
        reports = self._inbox.reports
        pace, physics = reports.get('pace'), reports.get('physics')
        self._pace.report(pace, reports.get('recording'), now)
        if pace is None or physics is None:
            return
        self._charts.add(_number(pace, 'simulation time [s]'), {
            charts.ENERGY.title: [_number(physics, key) for key in (
                'energy [J]', 'kinetic energy [J]', 'potential energy [J]')],
            charts.MOMENTUM.title: [
                _number(physics, f'momentum {axis} [kg m/s]') for axis in 'xyz'],
            charts.ANGULAR_MOMENTUM.title: [
                _number(physics, f'angular momentum {axis} [kg m^2/s]') for axis in 'xyz'],
            charts.CONTACTS.title: [_number(reports.get('contact'), 'contacts')],
            charts.PACE.title: [_number(pace, 'real-time factor')],
        })

    def _say(self, now: float) -> None:
        """Say in one line what is shown."""
        inbox = self._inbox
        pace = inbox.reports.get('pace')
        if not inbox.node:
            text = 'looking for a simulation ...'
        elif self._problem:
            text = self._problem
        elif inbox.is_silent(now, _SILENCE):
            text = f'**{inbox.node}** is not heard: waiting for it'
        elif self._motion is None:
            text = f'**{inbox.node}**: waiting for its first state'
        else:
            text = f'**{inbox.node}** {1e-9 * self._motion.t_ns:.2f} s'
            if self._pace.is_paused:
                text += ', paused'
            elif pace is not None:
                text += f' at {_number(pace, "real-time factor"):.2f} times real time'
        write(self._pace.status, text)
        self._body.show()

    def _make_touchable(self, batch: Batch) -> None:
        # async: viser calls these in the order of the mouse, the others in that of its threads.
        @batch.handle.on_click
        async def _(event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
            if event.instance_index is not None:
                self._body.choose(int(batch.bodies[event.instance_index]))

        @batch.handle.on_drag
        async def _(event: viser.SceneNodeDragEvent[viser.BatchedMeshHandle]) -> None:
            if event.instance_index is not None:
                self._drag(int(batch.bodies[event.instance_index]), event)

    def _drag(
        self, body: int, event: viser.SceneNodeDragEvent[viser.BatchedMeshHandle],
    ) -> None:
        hands, motion = self._hands, self._motion
        if hands is None or motion is None:
            return
        page = event.client_id
        if event.phase == 'end':
            self._release(page)
            return
        if page not in hands.grips:
            hands.grips[page] = grip(body, event.start_position, motion)
        hands.grips[page] = hands.grips[page]._replace(target=event.end_position)

    def _release(self, page: int) -> None:
        """Let go at once, even if no further state comes to react to."""
        if self._hands is not None and self._hands.grips.pop(page, None) is not None:
            self._react(self._inbox.state)

    def _let_go(self, client: viser.ClientHandle) -> None:
        self._release(client.client_id)

    def _react(self, data: bytes) -> None:
        """Renew the wrenches of the hands, in the thread that has heard a state."""
        hands = self._hands
        if hands is None or (hands.are_idle and not self._acts):
            return
        motion = self._decoder.read(data)
        if motion is None:
            return
        wrenches = hands.wrenches(motion, time.monotonic())
        if wrenches or self._acts:
            self._driver.apply(wrenches)
        self._acts = bool(wrenches)


def _number(report: Report | None, key: str) -> float:
    text = report.values.get(key, '') if report is not None else ''
    try:
        return float(text)
    except ValueError:
        return float('nan')
