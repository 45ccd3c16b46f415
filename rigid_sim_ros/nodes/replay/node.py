# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The node `replay`, from its parameters to its end.

Four threads: the main one attends to the terminal, one runs the executor with the callbacks, one
plays, and one reads ahead.
"""

from collections.abc import Callable, Mapping, Sequence
import gc
import sys
import time
import traceback
from typing import Any

from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.utilities import remove_ros_args

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.playback import PlayableBag
from rigid_sim_ros.nodes.declaring import ParameterError
from rigid_sim_ros.nodes.neighbours import Neighbours
from rigid_sim_ros.nodes.process import (
    complain, DONE, end_ros, ends_in_time, FAILED, Parser, ROS_ERRORS, ros_text, start_ros,
    Threads)
from rigid_sim_ros.nodes.replay.controls import Controls
from rigid_sim_ros.nodes.replay.outputs import Outputs
from rigid_sim_ros.nodes.replay.parameters import declare
from rigid_sim_ros.nodes.replay.player import Player, Settings
from rigid_sim_ros.nodes.replay.qos import read_overrides
from rigid_sim_ros.nodes.replay.terminal import attend, Bar, Keyboard
from rigid_sim_ros.problems import counted
from rigid_sim_ros.signals import Stop, stop_on_signals
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.words import matching, nearest

NODE_NAME = 'replay'
SKIP = 5.0              # s that an arrow key moves


# s: how long the interpreter may stay with another thread while the one that plays wants it. The
# default of 5 ms would be late for every message.
_SWITCH_INTERVAL = 0.0005
# s at most for the last messages of a bag to arrive. A subscriber on a busy machine may stand
# still for some; what got lost last is missed at the next heartbeat: every 0.1 s (delivery.py), or
# every 3 s, the default of Fast DDS, where a user has named a file of settings without a period.
_LAST = 20

# s: subscribers are there one after the other; all have come when there is no new one for so long.
_QUIET = 0.3
_LEAST_WAIT = 0.6
_LOOK = 0.05


class Replay:
    """One bag in one node."""

    def __init__(self, overrides: Mapping[str, Any], stopped: Stop) -> None:
        """Open the bag; BagError or ParameterError where that cannot be played."""
        self._stopped = stopped
        self._threads = Threads(stopped)
        self.node = Node(NODE_NAME, parameter_overrides=[
            Parameter(name, value=value) for name, value in overrides.items()])
        self._log = self.node.get_logger()
        parameters = declare(self.node)
        if not parameters['bag']:
            raise ParameterError('parameter bag: which one? It must be the folder of a bag')
        self._bag = PlayableBag(parameters['bag'])
        for note in self._bag.notes:
            self._log.warning(note)
        self._outputs = Outputs(self.node, self._bag, _chosen(self._bag, parameters['topics']))
        self._player = Player(
            self._bag, self._outputs, _settings(self._bag, parameters), self._log)
        self._controls = Controls(self.node, self._player)
        Neighbours(self.node, self._outputs.topics)
        self._wait: float = parameters['subscriber_timeout']
        self._is_played = False     # to its end
        self._tell(parameters)

    def run(self) -> None:
        """Play until the end; raise what went wrong in a thread."""
        # What was made to start up lives as long as the process: not for the collector, whose
        # search through it would make messages late.
        gc.collect()
        gc.freeze()
        sys.setswitchinterval(_SWITCH_INTERVAL)
        executor = EventsExecutor()
        executor.add_node(self.node)
        spinning = self._threads.make('spin', self._threads.spin, executor)
        playing = self._threads.make('play', self._play)
        spinning.start()
        playing.start()
        try:
            attend(Bar(self._bag.path.name), Keyboard(), self._player.status, self._actions(),
                   self._stopped)
        finally:
            self._stopped.set()
            self._player.stop()
            playing.join()
            self._deliver()
            executor.wake()
            spinning.join()
            executor.shutdown()
        self._threads.raise_failure()
        self._log.info(f'published {counted(self._outputs.messages, "message")}')

    def _play(self) -> None:
        self._await_subscribers()
        if not self._stopped.is_set():
            self._player.run()
            self._is_played = not self._stopped.is_set()

    def _deliver(self) -> None:
        """Wait for the last messages to arrive; whoever ends the replay waits for a second."""
        for _ in range(_LAST if self._is_played else 1):
            if self._outputs.flush(1.0) or self._stopped.signal:
                return
        if self._is_played:
            self._log.warning(
                f'a subscriber has not taken the last messages for {_LAST} s, and will lack them')

    def _await_subscribers(self) -> None:
        """Wait until those who listen have found the publishers: what comes before is lost."""
        begun = changed = time.monotonic()
        found, is_told = 0, False
        while not self._stopped.wait(_LOOK):
            now, count = time.monotonic(), self._outputs.subscriptions()
            if count != found:
                found, changed = count, now
            if not (found or is_told) and now - begun > _LEAST_WAIT:
                is_told = True
                self._log.info(f'waiting for subscribers, {self._wait:g} s at most: the parameter '
                               'subscriber_timeout')
            if now - begun >= self._wait or (
                    found and now - begun > _LEAST_WAIT and now - changed > _QUIET):
                return

    def _actions(self) -> dict[str, Callable[[], Any]]:
        """Return what the keys do."""
        tell = self._player.tell
        return {
            ' ': lambda: tell('toggle'),
            's': lambda: tell('step'),
            'n': lambda: tell('step'),
            'left': lambda: tell('skip', -SKIP),
            'right': lambda: tell('skip', SKIP),
            'up': lambda: self._controls.change_rate(1),
            'down': lambda: self._controls.change_rate(-1),
            'q': self._stopped.set,
        }

    def _tell(self, parameters: Mapping[str, Any]) -> None:
        for reason, topics in self._outputs.skipped:
            more = f' and {len(topics) - 3} more' if len(topics) > 3 else ''
            self._log.warning(f'skipping {", ".join(topics[:3])}{more}: {reason}')
        length = (self._bag.last_ns - self._bag.first_ns) / SECOND
        self._log.info(f'replaying {parameters["bag"]}: {length:.3f} s, '
                       f'{counted(len(self._outputs.names), "topic")}')


def _chosen(bag: PlayableBag, patterns: Sequence[str]) -> list[str]:
    """Return the topics that a pattern matches; ParameterError for one that matches none."""
    for pattern in patterns:
        if bag.topics and not matching(bag.topics, [pattern]):
            raise ParameterError(
                f'parameter topics: no topic of the bag matches {pattern!r}: '
                f'{nearest(pattern, sorted(bag.topics))}')
    return matching(bag.topics, patterns)


def _settings(bag: PlayableBag, parameters: Mapping[str, Any]) -> Settings:
    length_ns = bag.last_ns - bag.first_ns
    start_ns = round(parameters['start'] * SECOND)
    if start_ns > length_ns:
        raise ParameterError(f'parameter start: {parameters["start"]:g} s, must be at most '
                             f'{length_ns / SECOND:g} s, which is all of {bag.path}')
    return Settings(
        start_ns, round(parameters['duration'] * SECOND) or None, parameters['rate'],
        parameters['loop'], parameters['clock_rate'], parameters['paused'])


def run(
    bag: str | None = None, *, qos_path: str | None = None, ros_args: Sequence[str] = (),
    **given: Any,
) -> int:
    """
    Replay a bag until its end, or until Ctrl-C or SIGTERM.

    What is not given, or None, is as the parameters of ROS say; `given` are `topics`, `start`,
    `duration`, `paused`, `rate` and `loop`. qos_path is a file with the QoS of topics that differs
    from the recorded one, as `ros2 bag play` reads it. ros_args are ROS's own arguments, from
    `--ros-args` on. Returns the exit code: 0 for a clean end, 2 with one line on stderr for a bad
    parameter or a bag that cannot be read.
    """
    overrides = {name: value for name, value in {'bag': bag, **given}.items()
                 if value is not None}
    stopped = Stop()
    restore = stop_on_signals(stopped)
    try:
        overrides.update(read_overrides(qos_path) if qos_path else {})
        start_ros(ros_args)
        with ends_in_time():
            replay = Replay(overrides, stopped)
            replay.run()
        replay.node.destroy_node()
    except (BagError, ParameterError, OSError) as error:
        return complain(str(error))
    except ROS_ERRORS as error:
        return complain(ros_text(error))
    except Exception:
        traceback.print_exc()       # a mistake of this program, not of its user
        return FAILED
    finally:
        end_ros()
        restore()
    return DONE


def main(args: Sequence[str] | None = None) -> int:
    """Run the ROS executable `replay`: BAG and options as of `rigid_sim replay`."""
    words = list(sys.argv if args is None else ['replay', *args])
    parser = Parser(prog='replay', description='Publish what a bag holds, as it was recorded.')
    parser.add_argument('bag', nargs='?', metavar='BAG', help='folder of a ROS 2 bag')
    parser.add_argument('--rate', type=float, metavar='R', help='seconds of the bag per second')
    parser.add_argument('--loop', action='store_true', default=None, help='begin again at the end')
    parser.add_argument('--start', type=float, metavar='S', help='begin S seconds into the bag')
    parser.add_argument('--duration', type=float, metavar='S', help='play S seconds of the bag')
    parser.add_argument('--topics', action='append', metavar='GLOB',
                        help='publish only topics that match; may be given several times')
    parser.add_argument('--pause', action='store_true', default=None, dest='paused',
                        help='begin paused')
    parser.add_argument('--qos-profile-overrides-path', metavar='FILE', dest='qos_path',
                        help='YAML file with other QoS than was recorded')
    try:
        own_words = remove_ros_args(words)[1:]
    except ROS_ERRORS as error:
        return complain(ros_text(error))
    options = vars(parser.parse_args(own_words))
    return run(options.pop('bag'), ros_args=words, **options)
