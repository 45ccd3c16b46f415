# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the page does to a simulation: the topics and services that other nodes use too."""
from collections.abc import Callable, Sequence
import time
from typing import Any

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Pose, PoseStamped, Vector3, Wrench
from geometry_msgs.msg import Quaternion as QuaternionMessage
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rigid_sim_ros.messages.topics import (
    JOINT_TRAJECTORY, SET_JOINT_STATES, SET_POSE, topic_name)
from rigid_sim_ros.scene.joint_groups import model_of
from rigid_sim_ros.viewer.simulation import Answer, BodyWrench, Quaternion, Vector

_MATCHING = 2.0     # s at most until a new publisher or client has found its counterpart
# [ns] of simulation time in which a joint goes where its slider is: the slider moves on as fast.
_LEAD_NS = 200_000_000
_PARAMETER, _REPLAY_PARAMETER = 'real_time_factor', 'rate'


class RosDriver:
    """Drives one simulation; any thread may call."""

    def __init__(self, node: Node, target: str, listen: Callable[[str, bool], None]) -> None:
        self.listen = listen
        self._node = node
        self._target = target
        # ~/wrenches, not ~/BODY/wrench: a controller that holds a body there is not overruled,
        # and what several pages do to several bodies acts from the same step.
        self._wrenches = node.create_publisher(MultiDOFJointState, f'{target}/wrenches', 10)
        self._clients: dict[str, Client] = {}
        self._publishers: dict[str, Publisher] = {}

    def pause(self, paused: bool, answer: Answer) -> None:
        """Pause or go on."""
        self._call(SetBool, 'pause', SetBool.Request(data=paused), answer)

    def trigger(self, service: str, answer: Answer) -> None:
        """Call step, reset, start_recording or stop_recording."""
        self._call(Trigger, service, Trigger.Request(), answer)

    def set_speed(self, factor: float, answer: Answer) -> None:
        """Set the parameter real_time_factor, or the rate of a replay."""
        name = _PARAMETER if self._owner() == self._target else _REPLAY_PARAMETER
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=factor)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=value)])

        def said(response: Any) -> None:
            result = response.results[0]
            done = f'{factor:g} times real time' if factor else 'as fast as possible'
            answer(done if result.successful else result.reason, result.successful)

        self._send(SetParameters, 'set_parameters', request, said, answer)

    def set_pose(
        self, body: str, position: Vector, orientation: Quaternion, answer: Answer,
    ) -> None:
        """Publish on ~/BODY/set_pose."""
        x, y, z = position
        qx, qy, qz, qw = orientation
        self._publish(topic_name(SET_POSE, self._target, body), PoseStamped(pose=Pose(
            position=Point(x=x, y=y, z=z), orientation=QuaternionMessage(x=qx, y=qy, z=qz, w=qw))),
            f'{body} is put to [{x:g}, {y:g}, {z:g}] m', answer)

    def lead_joint(self, joint: str, position: float, answer: Answer) -> None:
        """Publish a trajectory of one point on ~/MODEL/joint_trajectory."""
        model = model_of(joint)
        self._publish(topic_name(JOINT_TRAJECTORY, self._target, model), JointTrajectory(
            joint_names=[joint.removeprefix(f'{model}/')], points=[JointTrajectoryPoint(
                positions=[position], time_from_start=Duration(nanosec=_LEAD_NS))]),
            f'{joint} goes to {position:g}', answer)

    def put_joint(self, joint: str, position: float, answer: Answer) -> None:
        """Publish on ~/MODEL/set_joint_states."""
        model = model_of(joint)
        self._publish(topic_name(SET_JOINT_STATES, self._target, model), JointState(
            name=[joint.removeprefix(f'{model}/')], position=[position]),
            f'{joint} is put to {position:g}', answer)

    def apply(self, wrenches: Sequence[BodyWrench]) -> None:
        """Publish on ~/wrenches."""
        self._wrenches.publish(MultiDOFJointState(
            joint_names=[wrench.body for wrench in wrenches],
            wrench=[Wrench(force=_vector(wrench.force), torque=_vector(wrench.torque))
                    for wrench in wrenches]))

    def _publish(self, topic: str, message: Any, done: str, answer: Answer) -> None:
        """Publish a message once somebody listens, and say what is done, or that nobody does."""
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(type(message), topic, 10)
        publisher = self._publishers[topic]
        end = time.monotonic() + _MATCHING
        while not publisher.get_subscription_count():
            if time.monotonic() > end:
                answer(f'nobody listens to {topic}', False)
                return
            time.sleep(0.02)
        publisher.publish(message)
        answer(done, True)

    def _owner(self) -> str:
        """Return the node that publishes the states: the simulation, or a replay of it."""
        publishers = self._node.get_publishers_info_by_topic(f'{self._target}/state')
        names = [f'{each.node_namespace.rstrip("/")}/{each.node_name}' for each in publishers]
        return names[0] if names and self._target not in names else self._target

    def _call(self, service: type, name: str, request: Any, answer: Answer) -> None:
        self._send(service, name, request,
                   lambda response: answer(response.message, response.success), answer)

    def _send(self, service: type, name: str, request: Any, said: Callable[[Any], None],
              answer: Answer) -> None:
        full = f'{self._owner()}/{name}'
        if full not in self._clients:
            self._clients[full] = self._node.create_client(service, full)
        client = self._clients[full]
        if not client.wait_for_service(_MATCHING):
            answer(f'nobody offers the service {full}', False)
            return
        client.call_async(request).add_done_callback(lambda future: said(future.result()))


def _vector(triple: Vector) -> Vector3:
    x, y, z = triple
    return Vector3(x=x, y=y, z=z)
