# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What is published when: the thread that plays.

It sleeps until the next message is due or a command arrives, whichever comes first. What is late
is published at once, up to CATCH_UP_NS of delay; what is beyond is given up by shifting the
timeline, so a stall of the machine, of the disk or of a subscriber never ends in a burst.
"""

from collections.abc import Callable
from concurrent.futures import Future, wait
from math import inf
from queue import Empty, SimpleQueue
import threading
from time import monotonic_ns
from typing import Any, NamedTuple

from rigid_sim_ros.bag.playback import PlayableBag
from rigid_sim_ros.nodes.pacing import CATCH_UP_NS, MILLISECOND
from rigid_sim_ros.nodes.replay.outputs import Outputs
from rigid_sim_ros.nodes.replay.read_ahead import ReadAhead
from rigid_sim_ros.nodes.replay.timeline import Timeline
from rigid_sim_ros.problems import counted
from rigid_sim_ros.times import SECOND


# Messages that are sent between two looks at the commands: some 2 ms.
_MOST_AT_ONCE = 500
_LOOK = 0.2         # s between two looks at whether to end
_LONGEST_SLEEP = 3600.0     # s: the queue cannot wait for ever in one go
# A bag that lasts no time at all would loop as fast as it can.
_SHORTEST_LOOP_NS = 100 * MILLISECOND
_LOG_PERIOD_NS = 5 * SECOND
# Messages whose times differ by no more are of one time stamp: recorders make the times of one
# moment distinct by counting nanoseconds.
_SAME_TIME_NS = 1

Answer = tuple[bool, str]
ENDED: Answer = False, 'the replay has ended'


class Settings(NamedTuple):
    """How to play; times are in ns of the bag."""

    start_ns: int               # from the beginning of the bag
    duration_ns: int | None     # from the start; None: to the end
    rate: float
    loop: bool
    clock_rate: float           # Hz of wall time; 0: no clock
    paused: bool


class Status(NamedTuple):
    """Where a replay is."""

    position_ns: int            # from the beginning of the bag
    length_ns: int
    rate: float
    is_paused: bool
    has_begun: bool


class Command(NamedTuple):
    """What the player is told, by name as in _COMMANDS."""

    name: str
    value: Any = None
    answer: 'Future[Answer] | None' = None


class Player:
    """Plays a bag; only `tell`, `stop` and `status` are for other threads."""

    def __init__(
        self, bag: PlayableBag, outputs: Outputs, settings: Settings, log: Any,
    ) -> None:
        self._bag = bag
        self._outputs = outputs
        self._log = log
        self._loop = settings.loop
        self._begin_ns = bag.first_ns + settings.start_ns
        self._end_ns = bag.last_ns
        if settings.duration_ns is not None:
            self._end_ns = min(self._end_ns, self._begin_ns + settings.duration_ns)
        self._paused = settings.paused
        self._timeline = Timeline(settings.rate)
        self._timeline.jump(self._begin_ns, monotonic_ns())
        self._names = outputs.names | {bag.step_topic}
        self._commands: SimpleQueue[Command] = SimpleQueue()
        self._ahead: ReadAhead | None = None
        self._stopped = threading.Event()
        self._starved = False       # the player has looked for messages and found none
        self._fresh = False         # nothing was played since it began or was sought
        self._pass_ns = 0           # wall time at which this pass through the bag has begun
        self._given_up_ns = 0
        self._logged_ns = -_LOG_PERIOD_NS
        self._clock_due_ns: float = inf
        self._clock_ns = 0          # the time it showed last
        self._clock_period_ns = 0.0
        self._set_clock_rate(settings.clock_rate)

    def tell(self, name: str, value: Any = None) -> None:
        """Give a command and do not wait."""
        self._commands.put(Command(name, value))

    def ask(self, name: str, value: Any = None) -> Answer:
        """Give a command and wait for the answer."""
        answer: Future[Answer] = Future()
        self._commands.put(Command(name, value, answer))
        while not (self._stopped.is_set() or answer.done()):
            wait([answer], _LOOK)
        return answer.result() if answer.done() else ENDED

    def stop(self) -> None:
        """Ask the player to end."""
        self._stopped.set()
        self.tell('wake')

    def status(self) -> Status:
        """Return where the replay is."""
        position_ns = min(max(self._timeline.at(monotonic_ns()), self._bag.first_ns),
                          self._bag.last_ns)
        return Status(position_ns - self._bag.first_ns, self._bag.last_ns - self._bag.first_ns,
                      self._timeline.rate, self._paused, self._ahead is not None)

    def run(self) -> None:
        """Play until the end, or until `stop` is called; BagError where the bag is damaged."""
        try:
            self._begin(self._begin_ns)
            while not self._stopped.is_set():
                self._turn()
        finally:
            self._stopped.set()
            if self._ahead is not None:
                self._ahead.close()

    def _turn(self) -> None:
        wait_ns = self._next_due() - monotonic_ns()
        try:
            command = (self._commands.get(timeout=min(wait_ns / SECOND, _LONGEST_SLEEP))
                       if wait_ns > 0 else self._commands.get_nowait())
        except Empty:
            self._advance(monotonic_ns())
            return
        answer = _COMMANDS[command.name](self, command.value)
        if command.answer is not None:
            command.answer.set_result(answer)

    def _next_due(self) -> float:
        """Return the wall time at which something is to be done."""
        assert self._ahead is not None
        due = self._clock_due_ns
        if self._paused:
            return due
        head = self._ahead.head()
        if head is not None:
            if self._starved:
                self._limit_delay(head[0], 0)       # reading took that long
                self._starved = self._fresh = False
            return min(due, self._timeline.due(min(head[0], self._end_ns)))
        if self._ahead.is_at_end:
            return min(due, self._timeline.due(self._end_ns))
        self._starved = True
        return due

    def _advance(self, now_ns: int) -> None:
        assert self._ahead is not None
        head = None if self._paused else self._ahead.head()
        if head is not None:
            self._limit_delay(head[0], CATCH_UP_NS)
        t_ns = self._timeline.at(now_ns)
        if now_ns >= self._clock_due_ns:
            self._publish_clock(now_ns, t_ns)
        if head is not None:
            self._outputs.publish(
                *self._ahead.take(min(t_ns, self._end_ns), _MOST_AT_ONCE))
        if not self._paused and t_ns >= self._end_ns and self._is_done():
            self._finish(now_ns)

    def _is_done(self) -> bool:
        assert self._ahead is not None
        head = self._ahead.head()
        return self._ahead.is_at_end if head is None else head[0] > self._end_ns

    def _finish(self, now_ns: int) -> None:
        if self._loop:
            self._begin(self._begin_ns, max(now_ns, self._pass_ns + _SHORTEST_LOOP_NS))
        else:
            self._timeline.stop(now_ns)
            self._timeline.jump(self._end_ns, now_ns)
            self._stopped.set()

    def _begin(self, at_ns: int, wall_ns: int = 0) -> None:
        """Go on from a time of the bag, what was latched at that time first."""
        if self._ahead is not None:
            self._ahead.close()
        self._ahead = ReadAhead(
            self._bag.messages(at_ns, self._names), lambda: self.tell('wake'))
        latched = self._bag.latched(at_ns, self._outputs.names)
        now_ns = max(wall_ns, monotonic_ns())
        self._timeline.jump(at_ns, now_ns)
        if not self._paused:
            self._timeline.run(now_ns)
        self._pass_ns = now_ns
        self._starved = self._fresh = True
        self._show_clock(at_ns)
        self._outputs.begin(at_ns, latched)

    def _limit_delay(self, t_ns: int, most_ns: int) -> None:
        now_ns = monotonic_ns()
        given_up_ns = self._timeline.limit_delay(t_ns, now_ns, most_ns)
        if not self._fresh:
            self._given_up_ns += given_up_ns
        if self._given_up_ns > CATCH_UP_NS and now_ns - self._logged_ns > _LOG_PERIOD_NS:
            self._log.warning(f'{self._given_up_ns / SECOND:.1f} s behind: reading or publishing '
                              'took too long; what follows is shifted by that')
            self._logged_ns, self._given_up_ns = now_ns, 0

    def _publish_clock(self, now_ns: int, t_ns: int) -> None:
        # Not back where the timeline was shifted, and not beyond what is played.
        self._show_clock(max(self._clock_ns, min(t_ns, self._end_ns)))
        self._clock_due_ns += self._clock_period_ns
        if self._clock_due_ns <= now_ns:
            self._clock_due_ns = now_ns + self._clock_period_ns

    def _show_clock(self, t_ns: int) -> None:
        self._clock_ns = t_ns
        if self._clock_period_ns:
            self._outputs.publish_clock(t_ns)

    # --- commands ---------------------------------------------------------------------------

    def _set_clock_rate(self, rate: float) -> Answer:
        if rate and self._outputs.make_clock():
            self._clock_period_ns = SECOND / rate
            self._clock_due_ns = monotonic_ns() + self._clock_period_ns
        else:
            self._clock_period_ns, self._clock_due_ns = 0.0, inf
        return True, ''

    def _set_rate(self, rate: float) -> Answer:
        self._timeline.set_rate(rate, monotonic_ns())
        return True, ''

    def _set_loop(self, loop: bool) -> Answer:
        self._loop = loop
        return True, ''

    def _pause(self, paused: bool) -> Answer:
        if paused == self._paused:
            return True, f'{"already paused" if paused else "was not paused"} at {self._time()}'
        self._paused = paused
        if paused:
            self._timeline.stop(monotonic_ns())
        else:
            self._timeline.run(monotonic_ns())
        return True, f'{"paused" if paused else "resumed"} at {self._time()}'

    def _toggle(self, _: None) -> Answer:
        return self._pause(not self._paused)

    def _seek(self, seconds: float) -> Answer:
        length = (self._bag.last_ns - self._bag.first_ns) / SECOND
        at_ns = self._bag.first_ns + round(min(max(seconds, 0.0), length) * SECOND)
        self._begin(min(at_ns, self._bag.last_ns))
        return True, f'at {self._time()}'

    def _skip(self, seconds: float) -> Answer:
        return self._seek(self.status().position_ns / SECOND + seconds)

    def _step(self, _: None) -> Answer:
        """Publish the messages of the next time stamp, or of the next step of a recording."""
        assert self._ahead is not None
        if not self._paused:
            return False, 'not paused: call ~/pause with data: true first'
        marker, sent, last_ns, is_enough = self._bag.step_topic, 0, 0, False
        while (head := self._wait_for_head()) is not None and head[0] <= self._end_ns:
            stamp, name, _data = head
            if is_enough and (name == marker if marker else stamp > last_ns + _SAME_TIME_NS):
                break
            file, messages = self._ahead.take(stamp, 1)
            new = self._outputs.publish(file, messages)
            # What is latched tells of a recording as a whole, not of one of its steps.
            is_enough = is_enough or bool(
                new and not (marker and self._outputs.is_latched(name)))
            sent += new
            last_ns = stamp
        if not sent:
            return False, f'at the end, {self._time()}'
        self._timeline.jump(last_ns, monotonic_ns())
        self._show_clock(last_ns)
        return True, f'stepped to {self._time()}: {counted(sent, "message")}'

    def _wait_for_head(self) -> Any:
        """Return the next message, None at the end; the disk is what is waited for."""
        assert self._ahead is not None
        while not self._stopped.is_set():
            head = self._ahead.head()
            if head is not None or self._ahead.is_at_end:
                return head
            self._ahead.wait(_LOOK)
        return None

    def _time(self) -> str:
        return f'{self.status().position_ns / SECOND:.9f} s'

    def _wake(self, _: None) -> Answer:
        return True, ''


_COMMANDS: dict[str, Callable[[Player, Any], Answer]] = {
    'clock_rate': Player._set_clock_rate,
    'loop': Player._set_loop,
    'pause': Player._pause,
    'rate': Player._set_rate,
    'seek': Player._seek,
    'skip': Player._skip,
    'step': Player._step,
    'toggle': Player._toggle,
    'wake': Player._wake,
}
