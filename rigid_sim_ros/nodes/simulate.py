# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The node `simulate`: a world of rigid bodies with topics, services and parameters.

Three threads: the main one waits for the end, one runs the executor with the callbacks, and one
owns the world and steps it. The callbacks hand over what arrives through a queue.

The node never waits for its own /clock: it paces itself on the steady wall clock.
"""
from collections.abc import Callable, Sequence
from functools import partial
import gc
import sys
import traceback
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.utilities import remove_ros_args

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.resume import Moment
from rigid_sim_ros.bag.writer import check_path
from rigid_sim_ros.messages import topics
from rigid_sim_ros.nodes.inputs import ParameterInput, Queue, Receiver, Refusals
from rigid_sim_ros.nodes.joint_inputs import JointReceiver
from rigid_sim_ros.nodes.neighbours import Neighbours
from rigid_sim_ros.nodes.parameters import declare, is_live, mistake_in, ParameterError
from rigid_sim_ros.nodes.process import (
    complain, DONE, end_ros, ends_in_time, FAILED, Parser, ROS_ERRORS, ros_text, start_ros,
    Threads)
from rigid_sim_ros.nodes.publishers import (
    check_tf, chosen_bodies, message_class, Publishers)
from rigid_sim_ros.nodes.qos import profiles
from rigid_sim_ros.nodes.recording import Recording
from rigid_sim_ros.nodes.services import Services
from rigid_sim_ros.nodes.step_loop import StepLoop
from rigid_sim_ros.problems import counted, span
from rigid_sim_ros.scene.errors import SceneError
from rigid_sim_ros.scene.overlap import describe_overlaps
from rigid_sim_ros.signals import Stop, stop_on_signals
from rigid_sim_ros.warm_up import announce_later, Stopped, use, watched
from rigid_sim_ros.world import load_scene, World

NODE_NAME = 'rigid_sim'

# s: how long the GIL may stay with the executor's thread while the step thread wants it. The
# default of 5 ms would be five steps.
_SWITCH_INTERVAL = 0.0005
_FLUSH = 0.5            # s at most for the last messages to arrive


class Simulation:
    """One world in one node, from its parameters to its end."""

    def __init__(
        self, scene: str | None, duration: float | None, record: str | None,
        moment: Moment | None, paused: bool, stopped: Stop,
    ) -> None:
        overrides = [Parameter('paused', value=True)] if paused else []
        overrides += [] if scene is None else [Parameter('scene', value=scene)]
        if record is not None:
            check_path(record)      # fails now, not after compiling
            overrides += [Parameter('record', value=True), Parameter('bag_path', value=record)]
        self._must_record = record is not None
        self._moment = moment
        self._stopped = stopped
        self._threads = Threads(stopped)
        self.node = Node(NODE_NAME, parameter_overrides=overrides)
        self._log = self.node.get_logger()
        self._parameters = declare(self.node, _recorded_parameters(moment))
        self._qos = profiles(self._parameters)
        if self._parameters['publish_tf']:
            check_tf()      # fails now, not after compiling
        self._world = watched(self._make_world, stopped)
        self._world.threads = self._parameters['threads']
        self._check_frame_id()
        self._queue = Queue()
        self._refusals = Refusals(self._log.warning)
        self._duration = duration
        self._recording: Recording | None = None

    def run(self) -> None:
        """Compile, connect, and simulate until the end; raise what went wrong in a thread."""
        for line in watched(self._prepare, self._stopped):
            self._log.warning(line)
        announce_later()
        if self._moment is not None:
            self._moment.apply(self._world)
        bodies = chosen_bodies(self._world.names, self._parameters['bodies'])
        if not bodies:
            self._log.warning(f'no body matches the parameter bodies {self._parameters["bodies"]}:'
                              ' ~/state and ~/wrenches still cover all of them')
        publishers = Publishers(self.node, self._world, bodies, self._parameters, self._qos)
        self._recording = Recording(self.node, self._world, publishers, self._parameters)
        if self._parameters['record']:
            self._create_recording()
        publishers.publish_scene(self._world.scene.text)
        loop = StepLoop(
            self.node, self._world, self._queue, publishers, self._refusals, self._recording,
            dict(self._parameters), self._most_steps())
        self._subscribe(bodies)
        Services(self.node, self._queue, self._recording)
        Neighbours(self.node, publishers.telling_names)
        self.node.add_on_set_parameters_callback(self._check_parameters)
        self.node.add_post_set_parameters_callback(self._hand_over_parameters)
        begin = '' if self._moment is None else f', from {self._world.time_ns / 1e9:.9g} s on'
        self._log.info(
            f'simulating {self._parameters["scene"]}: '
            f'{counted(len(self._world.names), "body", "bodies")}, '
            f'step {self._world.step_ns / 1e6:g} ms{begin}'
            f'{", paused: ~/pause lets it go on" if self._parameters["paused"] else ""}')
        self._run_threads(loop, publishers)

    @property
    def lost_a_recording(self) -> bool:
        """Whether a bag that was begun, or was to be from the start, is not whole."""
        return self._recording is not None and self._recording.has_failed

    def _make_world(self) -> World:
        if self._moment is not None:
            return World(self._moment.scene)
        return load_scene(self._parameters['scene'])

    def _prepare(self) -> list[str]:
        """Do all for which kernels are compiled; return what there is to say of the scene."""
        world = World(self._world.scene)
        world.threads = self._parameters['threads']
        use(world)
        return [] if self._moment is not None else [*describe_overlaps(self._world.scene)]

    def _create_recording(self) -> None:
        assert self._recording is not None
        try:
            self._recording.create()
        except BagError as error:
            if self._must_record:
                raise
            self._recording.has_failed = True
            self._log.error(f'not recording: {error}')

    def _run_threads(self, loop: StepLoop, publishers: Publishers) -> None:
        # What was made to start up lives as long as the process: not for the collector, whose
        # search through it would stop the step thread for some ten milliseconds.
        gc.collect()
        gc.freeze()
        sys.setswitchinterval(_SWITCH_INTERVAL)
        executor = EventsExecutor()
        executor.add_node(self.node)
        stepping = self._threads.make('step', loop.run)
        spinning = self._threads.make('spin', self._threads.spin, executor)
        stepping.start()
        spinning.start()
        self._stopped.wait()
        loop.stop()
        stepping.join()
        publishers.delete_markers(self._world.time_ns)
        publishers.flush(_FLUSH)
        executor.wake()
        spinning.join()
        executor.shutdown()
        self._threads.raise_failure()

    def _subscribe(self, bodies: Sequence[int]) -> None:
        receiver = Receiver(
            self._queue, self._refusals, self._world.names, self._world.frame_names,
            self._parameters['frame_id'])
        joints = JointReceiver(self._queue, self._refusals, self._world.scene.spec.joints)
        names = [self._world.names[k] for k in bodies]
        for kind, callback, owners in (
            (topics.WRENCH, receiver.wrench, names),
            (topics.SET_POSE, receiver.set_pose, names),
            (topics.SET_TWIST, receiver.set_twist, names),
            (topics.JOINT_COMMANDS, joints.commands, joints.models),
            (topics.JOINT_TRAJECTORY, joints.trajectory, joints.models),
            (topics.SET_JOINT_STATES, joints.states, joints.models),
        ):
            for owner in owners:
                self._listen(kind, partial(callback, owner), owner)
        self._listen(topics.WRENCHES, receiver.wrenches)

    def _listen(self, kind: str, callback: Callable[[Any], None], owner: str = '') -> None:
        self.node.create_subscription(
            message_class(topics.HEARD[kind].type), topics.topic_name(kind, body=owner), callback,
            self._qos[kind])

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
        for parameter in parameters:
            if mistake := mistake_in(parameter.name, parameter.value):
                return SetParametersResult(successful=False, reason=mistake)
        return SetParametersResult(successful=True)

    def _hand_over_parameters(self, parameters: Sequence[Any]) -> None:
        assert self._recording is not None
        for parameter in parameters:
            if is_live(parameter.name):
                # Before the queue: who sets a path and then starts a recording means that path.
                self._recording.set_parameter(parameter.name, parameter.value)
                self._queue.put(ParameterInput(parameter.name, parameter.value))


def _recorded_parameters(moment: Moment | None) -> dict[str, Any]:
    """Return the parameters with which a session goes on, which others may override."""
    if moment is None:
        return {}
    own = ('paused', 'record', 'real_time_factor')      # of each run
    kept = {name: value for name, value in moment.parameters.items()
            if not name.startswith('bag_') and name not in own}
    return {**kept, 'scene': moment.session.scene}


def run(
    scene: str | None = None, *, duration: float | None = None, record: str | None = None,
    moment: Moment | None = None, paused: bool = False, ros_args: Sequence[str] = (),
) -> int:
    """
    Run the node until Ctrl-C, SIGTERM, SIGHUP or, if given, `duration` s of simulation time.

    scene is the path of a scene file or the name of an example; without it the parameter `scene`
    counts. record is the folder of a new bag. With a moment of a recorded session the node goes on
    from there, with the parameters of then but the pace. It begins paused if `paused` or the
    parameter of this name says so. ros_args are ROS's own arguments, from
    `--ros-args` on. Returns the exit code: 0 for a clean end, 1 if a recording broke off, 2 with
    one line on stderr for a bad parameter, scene or folder, 128 and the number of the signal that
    ended it before it simulated anything.
    """
    stopped = Stop()
    restore = stop_on_signals(stopped)
    try:
        start_ros(ros_args)
        with ends_in_time():
            simulation = Simulation(scene, duration, record, moment, paused, stopped)
            simulation.run()
        simulation.node.destroy_node()
        return FAILED if simulation.lost_a_recording else DONE
    except Stopped:
        print('rigid_sim: stopped before the start: nothing was simulated', file=sys.stderr)
        return stopped.exit_code
    except SceneError as error:
        return complain(error.summary)
    except (ParameterError, BagError, OSError) as error:
        return complain(str(error))
    except ArithmeticError as error:
        print('rigid_sim:', error, file=sys.stderr)
        return FAILED
    except ROS_ERRORS as error:
        return complain(ros_text(error))
    except Exception:
        traceback.print_exc()       # a mistake of this program, not of its user
        return FAILED
    finally:
        end_ros()
        restore()


def main(args: Sequence[str] | None = None) -> int:
    """Run the ROS executable: [SCENE] [--duration S] [--record DIR] [--ros-args ...]."""
    words = list(sys.argv if args is None else ['simulate', *args])
    parser = Parser(prog='simulate', description='Simulate rigid bodies in a ROS 2 node.')
    parser.add_argument('scene', nargs='?', metavar='SCENE',
                        help='path of a scene file or name of an example')
    parser.add_argument('--duration', type=float, metavar='S',
                        help='stop after S seconds of simulation time')
    parser.add_argument('--record', metavar='DIR', help='record into a new bag')
    try:
        own_words = remove_ros_args(words)[1:]
    except ROS_ERRORS as error:
        return complain(ros_text(error))
    options = parser.parse_args(own_words)
    try:
        duration = None if options.duration is None else span(options.duration)
    except ValueError as error:
        parser.error(f'argument --duration: {error}')
    return run(options.scene, duration=duration, record=options.record, ros_args=words)
