# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The node `simulate`: a world of rigid bodies with topics, services and parameters.

Three threads: the main one waits for the end, one runs the executor with the callbacks, and one
owns the world and steps it. The callbacks hand over what arrives through a queue.

The node never waits for its own /clock: it paces itself on the steady wall clock.
"""
import argparse
from collections.abc import Callable, Sequence
from functools import partial
import gc
import signal
import sys
import threading
import traceback
from typing import Any, NoReturn

from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rcl_interfaces.msg import SetParametersResult
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.nodes.inputs import ParameterInput, Queue, Receiver, Refusals
from rigid_sim_ros.nodes.parameters import declare, is_live, ParameterError
from rigid_sim_ros.nodes.publishers import chosen_bodies, Publishers, tf_message
from rigid_sim_ros.nodes.qos import profiles
from rigid_sim_ros.nodes.services import Services
from rigid_sim_ros.nodes.step_loop import StepLoop
from rigid_sim_ros.nodes.warm_up import warm_up
from rigid_sim_ros.scene.errors import SceneError
from rigid_sim_ros.world import load_scene

NODE_NAME = 'rigid_sim'
_DONE, _FAILED, _USAGE = 0, 1, 2

# rclpy has no public names for what rclpy.init raises.
_ROS_ERRORS = (_rclpy.RCLError, _rclpy.RCLInvalidROSArgsError, _rclpy.UnknownROSArgsError)

# s: how long the GIL may stay with the executor's thread while the step thread wants it. The
# default of 5 ms would be five steps.
_SWITCH_INTERVAL = 0.0005
_FLUSH = 0.5            # s at most for the last messages to arrive
_SPIN_PERIOD = 0.2      # s between two looks at whether to end


class Simulation:
    """One world in one node, from its parameters to its end."""

    def __init__(
        self, scene: str | None, duration: float | None, stopped: threading.Event,
    ) -> None:
        overrides = [] if scene is None else [Parameter('scene', value=scene)]
        self._stopped = stopped
        self._failures: list[BaseException] = []
        self.node = Node(NODE_NAME, parameter_overrides=overrides)
        self._log = self.node.get_logger()
        self._parameters = declare(self.node)
        self._qos = profiles(self._parameters)
        if self._parameters['publish_tf']:
            tf_message()    # fails now, not after compiling
        self._world = load_scene(self._parameters['scene'])
        self._check_frame_id()
        self._queue = Queue()
        self._refusals = Refusals(self._log.warning)
        self._duration = duration

    def run(self) -> None:
        """Compile, connect, and simulate until the end; raise what went wrong in a thread."""
        warm_up(self._world, self._stopped)
        if self._stopped.is_set():
            return
        bodies = chosen_bodies(self._world.names, self._parameters['bodies'])
        if not bodies:
            self._log.warning(f'no body matches the parameter bodies {self._parameters["bodies"]}:'
                              ' ~/state and ~/wrenches still cover all of them')
        publishers = Publishers(self.node, self._world, bodies, self._parameters, self._qos)
        publishers.publish_scene(self._world.scene.text)
        loop = StepLoop(
            self.node, self._world, self._queue, publishers, self._refusals,
            dict(self._parameters), self._most_steps())
        self._subscribe(bodies)
        Services(self.node, self._queue)
        self.node.add_on_set_parameters_callback(self._check_parameters)
        self.node.add_post_set_parameters_callback(self._hand_over_parameters)
        self._log.info(
            f'simulating {self._parameters["scene"]}: {len(self._world.names)} '
            f'bod{"y" if len(self._world.names) == 1 else "ies"}, '
            f'step {self._world.step_ns / 1e6:g} ms')
        self._run_threads(loop, publishers)

    def _run_threads(self, loop: StepLoop, publishers: Publishers) -> None:
        # What was made to start up lives as long as the process: not for the collector, whose
        # search through it would stop the step thread for some ten milliseconds.
        gc.collect()
        gc.freeze()
        sys.setswitchinterval(_SWITCH_INTERVAL)
        executor = EventsExecutor()
        executor.add_node(self.node)
        stepping = threading.Thread(target=self._guard, args=(loop.run,), name='step')
        spinning = threading.Thread(target=self._guard, args=(self._spin, executor), name='spin')
        stepping.start()
        spinning.start()
        self._stopped.wait()
        loop.stop()
        stepping.join()
        publishers.flush(_FLUSH)
        executor.wake()
        spinning.join()
        executor.shutdown()
        if self._failures:
            raise self._failures[0]

    def _spin(self, executor: Any) -> None:
        # Not spin(): it keeps a lock that waking, and so creating or destroying, needs as well.
        while not self._stopped.is_set():
            executor.spin_once(timeout_sec=_SPIN_PERIOD)

    def _guard(self, function: Callable[..., None], *args: Any) -> None:
        """Run a thread, and end the others with it however it ends."""
        try:
            function(*args)
        except BaseException as error:      # carried over to the main thread
            self._failures.append(error)
        finally:
            self._stopped.set()

    def _subscribe(self, bodies: Sequence[int]) -> None:
        receiver = Receiver(
            self._queue, self._refusals, self._world.names, self._world.frame_names,
            self._parameters['frame_id'])
        for name in (self._world.names[k] for k in bodies):
            for message, kind, callback in (
                (WrenchStamped, 'wrench', receiver.wrench),
                (PoseStamped, 'set_pose', receiver.set_pose),
                (TwistStamped, 'set_twist', receiver.set_twist),
            ):
                self.node.create_subscription(
                    message, f'~/{name}/{kind}', partial(callback, name), self._qos[kind])
        self.node.create_subscription(
            MultiDOFJointState, '~/wrenches', receiver.wrenches, self._qos['wrenches'])

    def _check_frame_id(self) -> None:
        frame_id = self._parameters['frame_id']
        if not frame_id:
            raise ParameterError('parameter frame_id: must not be empty')
        if frame_id in self._world.frame_names:
            raise ParameterError(f'parameter frame_id: {frame_id!r} is a frame of the scene, '
                                 'must be another name')

    def _most_steps(self) -> int | None:
        if self._duration is None:
            return None
        return max(1, round(self._duration * 1e9 / self._world.step_ns))

    def _check_parameters(self, parameters: Sequence[Any]) -> Any:
        # The ranges are checked by rclpy, which has let NaN pass in other versions.
        for parameter in parameters:
            if parameter.value != parameter.value:
                return SetParametersResult(
                    successful=False, reason=f'{parameter.name}: must be a number')
        return SetParametersResult(successful=True)

    def _hand_over_parameters(self, parameters: Sequence[Any]) -> None:
        for parameter in parameters:
            if is_live(parameter.name):
                self._queue.put(ParameterInput(parameter.name, parameter.value))


def run(
    scene: str | None = None, *, duration: float | None = None, ros_args: Sequence[str] = (),
) -> int:
    """
    Run the node until Ctrl-C, SIGTERM or, if given, `duration` s of simulation time.

    scene is the path of a scene file or the name of an example; without it the parameter `scene`
    counts. ros_args are ROS's own arguments, from `--ros-args` on. Returns the exit code: 0 for a
    clean end, 2 with one line on stderr for a bad parameter or scene.
    """
    stopped = threading.Event()
    restore = _stop_on_signals(stopped)
    try:
        _start_ros(ros_args)
        simulation = Simulation(scene, duration, stopped)
        simulation.run()
        simulation.node.destroy_node()
    except SceneError as error:
        return _complain(error.summary)
    except (ParameterError, OSError) as error:
        return _complain(str(error))
    except ArithmeticError as error:
        print('rigid_sim:', error, file=sys.stderr)
        return _FAILED
    except _ROS_ERRORS as error:
        return _complain(_ros_text(error))
    except Exception:
        traceback.print_exc()       # a mistake of this program, not of its user
        return _FAILED
    finally:
        rclpy.try_shutdown()
        restore()
    return _DONE


def main(args: Sequence[str] | None = None) -> int:
    """Run the ROS executable `simulate`: [SCENE] [--duration S] [--ros-args ...]."""
    words = list(sys.argv if args is None else ['simulate', *args])
    parser = _Parser(prog='simulate', description='Simulate rigid bodies in a ROS 2 node.')
    parser.add_argument('scene', nargs='?', metavar='SCENE',
                        help='path of a scene file or name of an example')
    parser.add_argument('--duration', type=float, metavar='S',
                        help='stop after S seconds of simulation time')
    try:
        own_words = remove_ros_args(words)[1:]
    except _ROS_ERRORS as error:
        return _complain(_ros_text(error))
    options = parser.parse_args(own_words)
    if options.duration is not None and not 0.0 < options.duration < float('inf'):
        parser.error(f'argument --duration: {options.duration} s, must be > 0 and finite')
    return run(options.scene, duration=options.duration, ros_args=words)


class _Parser(argparse.ArgumentParser):

    def error(self, message: str) -> NoReturn:
        """Say what is wrong on one line."""
        raise SystemExit(_complain(f'{message} (see simulate --help)'))


def _start_ros(ros_args: Sequence[str]) -> None:
    # rcl logs what it raises as well: one line about a wrong argument is enough.
    set_logger_level('rcl', LoggingSeverity.FATAL)
    rclpy.init(args=list(ros_args), signal_handler_options=SignalHandlerOptions.NO)
    set_logger_level('rcl', LoggingSeverity.UNSET)


def _ros_text(error: Exception) -> str:
    unknown = isinstance(error, _rclpy.UnknownROSArgsError)
    return f'unknown ROS arguments {error}' if unknown else str(error)


def _complain(message: str) -> int:
    print('rigid_sim:', ' '.join(message.split()), file=sys.stderr)
    return _USAGE


def _stop_on_signals(stopped: threading.Event) -> Callable[[], None]:
    """Let SIGINT and SIGTERM set the event; return what restores the handlers."""
    if threading.current_thread() is not threading.main_thread():
        return lambda: None         # only the main thread may set handlers
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in signals]

    def stop(number: int, frame: object) -> None:
        stopped.set()

    def restore() -> None:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)

    for number in signals:
        signal.signal(number, stop)
    return restore


if __name__ == '__main__':
    sys.exit(main())
