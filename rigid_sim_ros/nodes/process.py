# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the nodes share as processes: how they start, end, and complain."""
import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import faulthandler
from itertools import pairwise
import os
from pathlib import Path
import sys
import threading
from traceback import extract_tb
from typing import Any, NoReturn

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.logging import get_logger, LoggingSeverity, set_logger_level
from rclpy.signals import SignalHandlerOptions

from rigid_sim_ros.environment import check_node, has_place_for_logs
from rigid_sim_ros.nodes.delivery import ask_often
from rigid_sim_ros.problems import printable
from rigid_sim_ros.reading import check

DONE, FAILED, USAGE = 0, 1, 2
_STDERR = 2             # the file descriptor, whatever Python has made of sys.stderr
_SPIN_PERIOD = 0.2      # s between two looks at whether to end
_LOG_PERIOD = 5.0       # s between two lines about what ROS cannot read
LONGEST_END = 20.0     # s that ROS may take to end
# Arguments of ROS that name a file, and how many bytes it may have.
_FILES, _MOST_BYTES = ('--params-file', '--log-config-file'), 2 ** 24
_PACKAGE = Path(__file__).parents[1]

# rclpy has no public names for what rclpy.init raises.
ROS_ERRORS = (_rclpy.RCLError, _rclpy.RCLInvalidROSArgsError, _rclpy.UnknownROSArgsError)


class Parser(argparse.ArgumentParser):
    """The arguments of a ROS executable; what is wrong with them is one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong on one line."""
        raise SystemExit(complain(f'{message} (see {self.prog} --help)'))


def start_ros(ros_args: Sequence[str]) -> None:
    """
    Start ROS and leave the signals alone.

    One of ROS_ERRORS for a wrong argument, OSError for what the system does not allow and for a
    file that ROS would wait for, such as a pipe.
    """
    check_node()
    for option, path in pairwise(ros_args):
        if option in _FILES and os.path.lexists(path):
            try:
                check(os.stat(path), path, _MOST_BYTES)
            except OSError as error:
                raise OSError(f'{option} {path}: {error.strerror}') from None
    ask_often()
    words = list(ros_args)
    if not has_place_for_logs():
        words += ['--ros-args', '--disable-external-lib-logs']
    # rcl logs what it raises as well: one line about a wrong argument is enough.
    set_logger_level('rcl', LoggingSeverity.FATAL)
    rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    set_logger_level('rcl', LoggingSeverity.UNSET)


@contextmanager
def ends_in_time() -> Iterator[None]:
    """
    End this process with code 1 if ROS has not ended, by `end_ros`, some seconds after the block.

    What Fast DDS 2.14 takes down while another node is found may wait for ever: set_listener of
    its DomainParticipant holds a lock until no callback is at work, and one of them waits for that
    lock. rclpy keeps the GIL meanwhile, and neither a signal nor a thread of Python gets a turn.
    """
    try:
        yield
    finally:
        faulthandler.dump_traceback_later(LONGEST_END, exit=True, file=_STDERR)


def end_ros() -> None:
    """End ROS, if it was started."""
    rclpy.try_shutdown()
    faulthandler.cancel_dump_traceback_later()


def ros_text(error: Exception) -> str:
    """Return what one of ROS_ERRORS says."""
    unknown = isinstance(error, _rclpy.UnknownROSArgsError)
    return f'unknown ROS arguments {error}' if unknown else str(error)


def complain(message: str) -> int:
    """Print one line on stderr and return the exit code for what a user can mend."""
    print('rigid_sim:', ' '.join(message.split()), file=sys.stderr)
    return USAGE


def _spin_once(executor: Any) -> None:
    """
    Let an executor do what is due, or wait a little.

    A request that rclpy itself cannot read, as of a parameter of a type that there is not, is left
    without an answer: whoever sends one must not end the node.
    """
    try:
        executor.spin_once(timeout_sec=_SPIN_PERIOD)
    except Exception as error:
        if not rclpy.ok() or _is_of_this_package(error):
            raise
        get_logger('rigid_sim').warning(printable(f'a message that ROS cannot read: {error}'),
                                        throttle_duration_sec=_LOG_PERIOD)


def _is_of_this_package(error: Exception) -> bool:
    """Return whether an error passed through code of this package, other than what spins."""
    return any(Path(frame.filename).is_relative_to(_PACKAGE) and frame.filename != __file__
               for frame in extract_tb(error.__traceback__))


class Threads:
    """The threads of a node, which end together: `stopped` is set however one of them ends."""

    def __init__(self, stopped: threading.Event) -> None:
        self._stopped = stopped
        self._failures: list[BaseException] = []

    def make(self, name: str, function: Callable[..., None], *args: Any) -> threading.Thread:
        """Return a thread that is not yet started."""
        return threading.Thread(target=self._guard, args=(function, *args), name=name)

    def spin(self, executor: Any) -> None:
        """Let an executor work until the node stops."""
        # Not spin(): it keeps a lock that waking, and so creating or destroying, needs as well.
        while not self._stopped.is_set():
            _spin_once(executor)

    def raise_failure(self) -> None:
        """Raise what ended a thread, if anything did."""
        if self._failures:
            raise self._failures[0]

    def _guard(self, function: Callable[..., None], *args: Any) -> None:
        try:
            function(*args)
        except BaseException as error:      # carried over to the main thread
            self._failures.append(error)
        finally:
            self._stopped.set()
