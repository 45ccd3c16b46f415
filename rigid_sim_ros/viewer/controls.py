# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The part of the page that drives a simulation: pace, recording, and one chosen body."""
import asyncio
from collections.abc import Sequence
import time
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
import viser

from rigid_sim_ros.times import SECOND
from rigid_sim_ros.viewer.grip import Hands, Push
from rigid_sim_ros.viewer.inputs import put, write
from rigid_sim_ros.viewer.motion import Motion
from rigid_sim_ros.viewer.simulation import Driver, Report, Vector

_SLOWEST, _FASTEST = 0.05, 5.0
_NONE = '-'
_WORLD_AXES, _BODY_AXES = 'world axes', 'body axes'
# [s] After a button was pressed or the speed was set, older reports do not turn it back.
_PATIENCE = 1.5


class PacePanel:
    """Pause, step, reset, speed, and the recording."""

    def __init__(self, server: viser.ViserServer, driver: Driver) -> None:
        gui = server.gui
        self._server = server
        self._driver = driver
        self.is_paused = False
        self._is_recording = False
        self._turned_at = self._sped_at = -_PATIENCE
        self._asking = asyncio.Lock()
        self.status = gui.add_markdown('looking for a simulation ...')
        self._pause = gui.add_button('Pause', icon=viser.Icon.PLAYER_PAUSE)
        self._step = gui.add_button('Step', icon=viser.Icon.PLAYER_SKIP_FORWARD)
        self._reset = gui.add_button('Reset', icon=viser.Icon.REFRESH)
        self._speed = gui.add_slider(
            'speed', _SLOWEST, _FASTEST, 0.05, 1.0,
            marks=((1.0, '1'), (2.0, '2'), (5.0, '5')),
            hint='Simulated seconds a second.')
        self._unlimited = gui.add_checkbox('as fast as possible', initial_value=False)
        self._record = gui.add_button('Record', icon=viser.Icon.PLAYER_RECORD, color='red')
        self._recorded = gui.add_markdown('not recording')
        self._pause.on_click(lambda _: self._set_paused(not self.is_paused))
        self._step.on_click(lambda _: self._driver.trigger('step', self._answer))
        self._reset.on_click(lambda _: self._driver.trigger('reset', self._answer))
        self._speed.on_update(self._set_speed)
        self._unlimited.on_update(self._set_speed)
        self._record.on_click(lambda _: self._driver.trigger(
            'stop_recording' if self._is_recording else 'start_recording', self._answer))

    def report(self, pace: Report | None, recording: Report | None, now: float) -> None:
        """Show what the simulation says of itself; now [s] is wall time."""
        if pace is not None and now - self._turned_at > _PATIENCE:
            self.show_paused(pace.message == 'paused')
        if pace is not None and now - self._sped_at > _PATIENCE:
            # In the loop, where no report comes between what a page sets and `_set_speed`.
            self._server.get_event_loop().call_soon_threadsafe(
                self._show_speed, pace.values.get('real-time factor wanted', ''), now)
        text = 'not recording'
        is_recording = False
        if recording is not None:
            is_recording = recording.message.startswith('recording ')
            text = recording.message
            if 'elapsed [s]' in recording.values:
                text += (f', {float(recording.values["elapsed [s]"]):.1f} s, '
                         f'{recording.values.get("size [MB]", "?")} MB')
        if is_recording != self._is_recording:
            self._is_recording = is_recording
            self._record.label = 'Stop recording' if is_recording else 'Record'
        write(self._recorded, text)

    def show_paused(self, paused: bool) -> None:
        """Turn the button."""
        if paused != self.is_paused:
            self.is_paused = paused
            self._pause.label = 'Go on' if paused else 'Pause'
            self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE

    def _set_paused(self, paused: bool) -> None:
        def said(text: str, is_well: bool) -> None:
            if is_well:
                # Who replays a bag reports nothing while it pauses.
                self._turned_at = time.monotonic()
                self.show_paused(paused)
            self._answer(text, is_well)

        self._driver.pause(paused, said)

    def _show_speed(self, wanted: str, now: float) -> None:
        if now - self._sped_at <= _PATIENCE:
            return
        is_unlimited = wanted == 'unlimited'
        put(self._unlimited, is_unlimited)
        if wanted and not is_unlimited:
            put(self._speed, min(max(float(wanted), _SLOWEST), _FASTEST))

    async def _set_speed(self, event: viser.GuiEvent[Any]) -> None:
        # async: viser calls it as soon as the value is here; in a thread, some time later, a
        # report from before could have put the old value back.
        if event.client is None:
            return          # it was this program that moved the slider
        self._sped_at = time.monotonic()
        factor = 0.0 if self._unlimited.value else float(self._speed.value)
        async with self._asking:    # one after the other, as they came
            await asyncio.to_thread(self._driver.set_speed, factor, self._answer)

    def _answer(self, text: str, is_well: bool) -> None:
        notify(self._server, text, is_well)


class BodyPanel:
    """The chosen body: how it moves, pushes, and another pose."""

    def __init__(self, server: viser.ViserServer, driver: Driver) -> None:
        gui = server.gui
        self._server = server
        self._driver = driver
        self._names: Sequence[str] = ()
        self._motion: Motion | None = None
        self._hands: Hands | None = None
        self._body = gui.add_dropdown('body', (_NONE,), initial_value=_NONE,
                                      hint='Or click on one.')
        self._figures = gui.add_markdown('')
        with gui.add_folder('Push'):
            self._force = gui.add_vector3('force [N]', (0.0, 0.0, 0.0), step=0.01)
            self._torque = gui.add_vector3('torque [Nm]', (0.0, 0.0, 0.0), step=0.01)
            self._axes = gui.add_dropdown('axes', (_WORLD_AXES, _BODY_AXES))
            self._duration = gui.add_number('for [s]', 0.2, min=0.0, step=0.05)
            push = gui.add_button('Push', icon=viser.Icon.HAND_FINGER)
        with gui.add_folder('Pose'):
            self._position = gui.add_vector3('position [m]', (0.0, 0.0, 0.0), step=0.01)
            self._angles = gui.add_vector3(
                'roll, pitch, yaw [deg]', (0.0, 0.0, 0.0), step=1.0)
            read = gui.add_button('Read', icon=viser.Icon.DOWNLOAD, hint='The present pose.')
            place = gui.add_button('Set pose', icon=viser.Icon.MAP_PIN)
        self._body.on_update(lambda _: self._read())
        push.on_click(lambda _: self._push())
        read.on_click(lambda _: self._read())
        place.on_click(lambda _: self._set_pose())

    def attach(self, names: Sequence[str], hands: Hands) -> None:
        """Offer the bodies of a new scene."""
        chosen = self._body.value
        self._names, self._hands, self._motion = names, hands, None
        self._body.options = (_NONE, *names)
        put(self._body, chosen if chosen in names else _NONE)

    def choose(self, body: int) -> None:
        """Choose a body that was clicked on."""
        put(self._body, self._names[body])
        self._read()

    def follow(self, motion: Motion) -> None:
        """Take note of how the bodies move."""
        self._motion = motion

    def show(self) -> None:
        """Show how the chosen body moves."""
        k, motion = self._index(), self._motion
        if k < 0 or motion is None:
            text = ''
        else:
            p, v, w = (_listed(a[k]) for a in (motion.position, motion.linear, motion.angular))
            text = (f'position {p} m  \nvelocity {v} m/s  \nangular velocity {w} rad/s')
        write(self._figures, text)

    def _index(self) -> int:
        name = self._body.value
        return self._names.index(name) if name in self._names else -1

    def _read(self) -> None:
        k = self._index()
        if k >= 0 and self._motion is not None:
            put(self._position, _rounded(self._motion.position[k]))
            turn = Rotation.from_quat(self._motion.orientation[k])
            put(self._angles, _rounded(turn.as_euler('xyz', degrees=True)))

    def _push(self) -> None:
        k = self._index()
        if k < 0 or self._hands is None:
            notify(self._server, 'choose a body first', False)
            return
        self._hands.pushes.append(Push(
            k, self._force.value, self._torque.value, self._axes.value == _BODY_AXES,
            round(self._duration.value * SECOND)))

    def _set_pose(self) -> None:
        k = self._index()
        if k < 0:
            notify(self._server, 'choose a body first', False)
            return
        x, y, z, w = Rotation.from_euler('xyz', self._angles.value, degrees=True).as_quat()
        self._driver.set_pose(
            self._names[k], self._position.value, (float(x), float(y), float(z), float(w)),
            lambda text, is_well: notify(self._server, text, is_well))


def notify(server: viser.ViserServer, text: str, is_well: bool) -> None:
    """Tell the users of all pages."""
    for client in server.get_clients().values():
        client.add_notification('done' if is_well else 'not done', text, auto_close_seconds=3.0,
                                color='green' if is_well else 'red')


def _listed(row: np.ndarray) -> str:
    return '[' + ', '.join(f'{number:.3f}' for number in row.tolist()) + ']'


def _rounded(row: np.ndarray) -> Vector:
    x, y, z = (round(number, 4) for number in row.tolist())
    return x, y, z
