# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The thread that owns the world: take inputs, step, publish, on the deadlines of the pacer.

Nothing else touches the world once this runs. What is published depends on the number of the step
alone, so a slow machine publishes the same messages as a fast one, only later.
"""
from collections.abc import Callable
from math import inf
import threading
from time import monotonic_ns, sleep, thread_time_ns
from typing import Any

from rclpy.node import Node

from rigid_sim_ros.bag import events
from rigid_sim_ros.nodes.diagnostics import Diagnostics
from rigid_sim_ros.nodes.inputs import (
    ENDED, Input, is_of_wrenches, JointInput, ParameterInput, Queue, Refusals, Request, Wrenches)
from rigid_sim_ros.nodes.pacing import MILLISECOND, NEVER, Pacer
from rigid_sim_ros.nodes.publishers import Publishers
from rigid_sim_ros.nodes.recording import Recording
from rigid_sim_ros.problems import printable
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.world import World
from rigid_sim_ros.world.commands import Command, FRAME_ID


# Steps between two looks at the inputs and at the stop flag when no publication comes before.
# A batch saves the cost of entering the kernel; inputs wait for at most one.
_BATCH = 64

# Waits up to this long are plain sleeps, which are exact to some 60 us; longer ones end early when
# an input arrives.
_PLAIN_SLEEP_NS = 5 * MILLISECOND
_LONGEST_WAIT_NS = 50 * MILLISECOND

# A loop that is later than this does not wait for time to send in.
_BEHIND_NS = 10 * MILLISECOND


class StepLoop:
    """Steps a world at a pace, applies what arrives, and publishes what comes of it."""

    def __init__(
        self, node: Node, world: World, queue: Queue, publishers: Publishers,
        refusals: Refusals, recording: Recording, parameters: dict[str, Any],
        most_steps: int | None = None,
    ) -> None:
        self._log = node.get_logger()
        self._world = world
        self._queue = queue
        self._publishers = publishers
        self._refusals = refusals
        self._recording = recording
        self._parameters = parameters
        self._steps_left = most_steps
        self._stopped = threading.Event()
        self._paused: bool = parameters['paused']
        self._broken = ''                       # why the world cannot be stepped any more
        self._moved = False                     # while paused: there is something new to publish
        # Of the last ~/wrenches message; a world that goes on from a bag may bring some along.
        self._sources = dict.fromkeys(
            name for name in world.wrench_sources if is_of_wrenches(name))
        self._pacer = Pacer(world.step_ns, parameters['real_time_factor'], monotonic_ns())
        self._diagnostics = Diagnostics(
            node.get_fully_qualified_name(), world, publishers, refusals, self._pacer, recording)
        self._schedule()

    def stop(self) -> None:
        """Ask the loop to end after the step it is in; any thread may call this."""
        self._stopped.set()
        self._queue.wake()

    def run(self) -> None:
        """Step until `stop` is called or the last step is done."""
        try:
            if self._recording.is_made:
                self._start_recording()
            self._publish_all()
            now_ns = monotonic_ns()
            self._pacer.restart(now_ns)
            self._diagnostics.begin(now_ns, thread_time_ns())
            while not self._stopped.is_set() and self._steps_left != 0:
                self._turn()
        finally:
            self._stopped.set()
            self._refuse_requests()
            try:
                self._publishers.send_waiting()
            finally:
                self._recording.close()     # which waits for the disk

    def _turn(self) -> None:
        for item in self._queue.take():
            _APPLY[type(item)](self, item)
        if self._moved and self._paused:
            self._publish_all()
        self._moved = False
        self._recording.turn()
        now_ns = monotonic_ns()
        if self._diagnostics.is_due(now_ns):
            self._diagnostics.publish(now_ns, thread_time_ns(), self._paused, self._broken)
        count = 0 if self._paused else self._count(now_ns)
        if count:
            lateness = self._pacer.start(count, now_ns)
            self._diagnostics.note(lateness)
            self._step(count)
            if not self._pacer.factor or lateness.late_ns > _BEHIND_NS:
                self._publishers.send_waiting()     # no time is left between steps
        else:
            self._wait(now_ns)

    def _count(self, now_ns: int) -> int:
        """Return how many steps to take in one go: to the next publication at most."""
        index = self._world.step_index
        count = min([_BATCH, *(n - index % n for n, _ in self._outputs)])
        due = self._pacer.due(now_ns)
        if due is not None:
            count = min(count, due)
        if self._steps_left is not None:
            count = min(count, self._steps_left)
        return count

    def _step(self, count: int) -> None:
        if not self._advance(count):
            return
        index = self._world.step_index
        for interval, publish in self._outputs:
            if index % interval == 0:
                publish()

    def _advance(self, count: int) -> bool:
        """
        Step the world; return whether that went well.

        A motion beyond all numbers pauses the node, which then waits for ~/reset: topics and
        services stay. A run of a given duration ends instead.
        """
        try:
            self._world.step(count)
        except ArithmeticError as error:
            if self._steps_left is not None:
                raise
            self._paused, self._broken = True, str(error)
            self._log.error(f'paused: {error}; ~/reset starts again')
            return False
        if self._steps_left is not None:
            self._steps_left -= count
        return True

    def _wait(self, now_ns: int) -> None:
        """Let time pass until a step is due or an input arrives; use it to send what waits."""
        wait_ns = _LONGEST_WAIT_NS if self._paused else self._pacer.wait_ns(now_ns)
        if self._publishers.send_waiting(now_ns + wait_ns):
            return      # and look again: time has passed
        if wait_ns <= _PLAIN_SLEEP_NS:
            sleep(wait_ns / SECOND)
        else:
            self._queue.wait(min(wait_ns, _LONGEST_WAIT_NS) / SECOND)

    def _schedule(self) -> None:
        """
        Set when each output is published.

        Those of one step go out in this order, but the topics of single bodies: these come last.
        """
        rate = self._parameters['diagnostics_rate']
        self._diagnostics.period_ns = SECOND / rate if rate else inf
        outputs = [
            (self._interval('clock_rate'), self._publish_clock),
            (self._interval('publish_rate'), self._publish_state),
            (self._interval('marker_rate'), self._publish_markers),
            (self._parameters['hash_interval'], self._publish_hash),
        ]
        self._outputs: list[tuple[int, Callable[[], None]]] = [o for o in outputs if o[0]]

    def _interval(self, rate_name: str) -> int:
        rate = self._parameters[rate_name]
        if not rate:
            return 0
        return max(1, round(min(SECOND / rate / self._world.step_ns, NEVER)))

    def _publish_all(self) -> None:
        for _, publish in self._outputs:
            publish()
        self._publishers.send_waiting()

    def _publish_rest(self) -> None:
        """Publish what was not published at this step: a pause shows the state of its moment."""
        for interval, publish in self._outputs:
            if self._world.step_index % interval:
                publish()
        self._publishers.send_waiting()

    def _publish_clock(self) -> None:
        self._publishers.publish_clock(self._world.time_ns)

    def _publish_state(self) -> None:
        self._publishers.publish_state(self._world)

    def _publish_markers(self) -> None:
        self._publishers.publish_markers(self._world)

    def _publish_hash(self) -> None:
        self._publishers.publish_hash(self._world.state_hash())

    def _apply(self, command: Command) -> None:
        """Do to the world what a message asks for; what it cannot do is refused as any other."""
        given = dict(command.arguments)
        if command.kind == 'apply_wrench':
            given['duration'] = self._held_for('wrench_timeout')
        try:
            self._world.apply(Command(command.kind, given))
        except ValueError as error:
            topic = given.get('source') or f'{given["name"]}/{command.kind}'
            self._refusals.refuse('impossible', f'{topic}: {error}')
            return
        if command.kind == 'apply_wrench':
            self._diagnostics.accepted += 1
            self._publishers.publish_applied_wrench(
                given['name'], self._world.time_ns, given[FRAME_ID], given['force'],
                given['torque'])
        else:
            self._moved = True

    def _apply_wrenches(self, item: Wrenches) -> None:
        for source in self._sources:
            self._world.cancel_wrenches(source)
        self._sources = dict.fromkeys(one.arguments['source'] for one in item.commands)
        for one in item.commands:
            self._apply(one)

    def _apply_to_joints(self, item: JointInput) -> None:
        try:
            for one in item.commands:
                given = dict(one.arguments)
                if one.kind == 'set_joint_commands':
                    given['duration'] = self._held_for('command_timeout')
                self._world.apply(Command(one.kind, given))
                self._moved |= one.kind == 'set_joint_states'
        except ValueError as error:
            self._refusals.refuse('impossible', f'{item.topic}: {error}')
            return
        self._diagnostics.accepted_of_joints += 1

    def _held_for(self, parameter: str) -> float:
        """Return for how long [s] a message holds: at least one step."""
        return max(self._parameters[parameter], self._world.step_ns / SECOND)

    def _apply_parameter(self, item: ParameterInput) -> None:
        self._parameters[item.name] = item.value
        self._log.info(printable(f'parameter {item.name}: {item.value}'))
        self._recording.note_parameter(item.name, item.value)
        if item.name == 'real_time_factor':
            self._pacer.set_factor(item.value, monotonic_ns())
        self._schedule()

    def _answer(self, item: Request) -> None:
        try:
            self._publishers.send_waiting()     # what came before is sent before the answer
            answer = _ANSWERS[item.name](self)
        except Exception:
            item.answer.set_result(ENDED)       # or who asked would wait for ever
            raise
        item.answer.set_result(answer)

    def _pause(self) -> tuple[bool, str]:
        said = 'already paused' if self._paused else 'paused'
        if not self._paused:
            self._note(events.PAUSE)
            self._publish_rest()
        self._paused = True
        return self._told(f'{said} at {self._time()}')

    def _resume(self) -> tuple[bool, str]:
        if self._broken:
            return False, self._broken
        said = 'resumed' if self._paused else 'was not paused'
        if self._paused:
            self._note(events.RESUME)
            self._pacer.restart(monotonic_ns())
        self._paused = False
        return self._told(f'{said} at {self._time()}')

    def _single_step(self) -> tuple[bool, str]:
        if not self._paused:
            return False, 'not paused: call ~/pause with data: true first'
        if self._steps_left == 0:
            return False, 'the last step is done'
        if not self._broken:
            self._note(events.SINGLE_STEP)
        if self._broken or not self._advance(1):
            return False, self._broken
        self._publish_all()     # before the answer: who hears it finds the new state on the topics
        return True, f'stepped to {self._time()}'

    def _reset(self) -> tuple[bool, str]:
        self._world.reset(keep_time=not self._parameters['reset_time'])
        self._sources = {}
        self._broken = ''
        self._pacer.restart(monotonic_ns())
        self._publish_all()
        return self._told(f'reset at {self._time()}')

    def _told(self, text: str) -> tuple[bool, str]:
        """Return an answer that the log has too: everybody else wonders who paused."""
        self._log.info(text)
        return True, text

    def _start_recording(self) -> tuple[bool, str]:
        answer = self._recording.begin()
        if self._paused:
            self._note(events.PAUSE)
        return answer

    def _stop_recording(self) -> tuple[bool, str]:
        return self._recording.end()

    def _note(self, kind: str) -> None:
        self._recording.note(self._world.step_index, kind)

    def _time(self) -> str:
        return f'{self._world.time_ns / SECOND:.9f} s'

    def _refuse_requests(self) -> None:
        for item in self._queue.close():
            if isinstance(item, Request):
                item.answer.set_result(ENDED)


_APPLY: dict[type[Input], Callable[[StepLoop, Any], None]] = {
    Command: StepLoop._apply,
    JointInput: StepLoop._apply_to_joints,
    ParameterInput: StepLoop._apply_parameter,
    Request: StepLoop._answer,
    Wrenches: StepLoop._apply_wrenches,
}
_ANSWERS: dict[str, Callable[[StepLoop], tuple[bool, str]]] = {
    'pause': StepLoop._pause,
    'resume': StepLoop._resume,
    'step': StepLoop._single_step,
    'reset': StepLoop._reset,
    'start_recording': StepLoop._start_recording,
    'stop_recording': StepLoop._stop_recording,
}
