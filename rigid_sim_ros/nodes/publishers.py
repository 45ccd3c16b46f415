# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Everything the node `simulate` publishes, as bytes.

The encoders write once what does not change; each publication patches numbers and hands bytes to
rclpy, which passes them on as they are. All of them go through `_send` or `_send_later`, from
which a recording gets the same bytes. What has a topic for each body is sent later, between steps.
"""
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from math import inf
from time import perf_counter_ns
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from rigid_sim_ros.bag.joint_messages import JointMessages
from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.messages import topics as kinds
from rigid_sim_ros.messages.codec import (
    encode_clock, encode_diagnostics, encode_string, encode_uint64, encode_wrench, PoseEncoder,
    StateEncoder, Status, TransformsEncoder, TwistEncoder)
from rigid_sim_ros.nodes.contact_markers import ContactMarkers
from rigid_sim_ros.nodes.delivery import await_delivery
from rigid_sim_ros.nodes.markers import SceneMarkers
from rigid_sim_ros.nodes.outbox import Outbox
from rigid_sim_ros.nodes.parameters import ParameterError
from rigid_sim_ros.words import matches, matching
from rigid_sim_ros.world import World


def chosen_bodies(names: Sequence[str], patterns: Sequence[str]) -> list[int]:
    """Return the indices of the bodies that a pattern matches, in the order of the scene."""
    return [k for k, name in enumerate(names) if matches(name, patterns)]


def chosen_joints(world: World, patterns: Iterable[str]) -> list[str]:
    """
    Return the joints that a pattern matches, which are to have a topic for their wrench.

    ParameterError for one whose topic is that of a body, on which the node hears wrenches.
    """
    chosen = matching(world.joint_names, patterns)
    for name in chosen:
        if name in world.names:
            raise ParameterError(
                f'parameter joint_wrenches: the joint {name!r} has the name of a body, whose '
                f'wrenches arrive on ~/{name}/wrench: give one of them another name')
    return chosen


class _Outlet:
    """Publishers that send at the same time, one message each, and what a bag calls them."""

    def __init__(self, publishers: Sequence[Publisher], topics: Sequence[Topic]) -> None:
        # Publisher.publish would check types and lock the handle for each message: 1.2 us instead
        # of 0.6. Nothing destroys a publisher while the step thread runs.
        self.handles = [publisher.handle for publisher in publishers]
        self.topics = list(topics)
        self.channels: list[int] = []       # of the recording


class Publishers:
    """The topics of one simulation; only the step thread calls the methods."""

    def __init__(
        self, node: Node, world: World, bodies: Sequence[int], parameters: Mapping[str, Any],
        qos: Mapping[str, QoSProfile],
    ) -> None:
        self.messages = 0       # so far, and the wall time that encoding and sending them took
        self.cost_ns = 0
        self.recorded = 0       # messages, and the wall time that handing them over took
        self.recording_ns = 0
        self._node = node
        self._world = world
        self._recorder: Recorder | None = None
        self._outlets: list[_Outlet] = []
        self._outbox = Outbox()
        self._all: list[Publisher] = []
        self._qos = qos
        self._frame_id: str = parameters['frame_id']
        names = [world.names[k] for k in bodies]
        self._bodies = np.array(bodies, dtype=np.intp)
        self._has_all = len(bodies) == len(world.names)

        self._pose = self._create(kinds.POSE, names)
        self._twist = self._create(kinds.TWIST, names)
        self._applied_wrench = {
            name: self._create(kinds.APPLIED_WRENCH, [name]) for name in names}
        self._contact_wrench = (self._create(kinds.CONTACT_WRENCH, names)
                                if parameters['publish_contact_wrench'] else None)
        self._state = self._create(kinds.STATE)
        self._scene = self._create(kinds.SCENE)
        self._state_hash = self._create(kinds.STATE_HASH)
        self._diagnostics = self._create(kinds.DIAGNOSTICS)
        self._clock = self._create(kinds.CLOCK) if parameters['publish_clock'] else None
        self._tf = self._create(kinds.TRANSFORMS) if parameters['publish_tf'] else None
        self._markers = (self._create(kinds.MARKERS, messages=2)
                         if parameters['publish_markers'] else None)

        self._joints = JointMessages(world)
        self._joint_states = self._create_of_joints(kinds.JOINT_STATES)
        self._all_joint_states = (self._create_of_joints(kinds.ALL_JOINT_STATES)
                                  if parameters['publish_joint_states'] else None)
        self._joint_wrenches = self._create_of_joints(
            kinds.JOINT_WRENCH, chosen_joints(world, parameters['joint_wrenches']))
        self._descriptions = self._create_of_joints(kinds.ROBOT_DESCRIPTION)

        self._poses = PoseEncoder(self._frame_id, len(names))
        self._twists = TwistEncoder(self._frame_id, len(names))
        self._states = StateEncoder(self._frame_id, world.names)
        self._transforms = TransformsEncoder(self._frame_id, world.names)
        self._scene_markers = SceneMarkers(self._frame_id, world.scene) if self._markers else None
        self._contact_markers = ContactMarkers(self._frame_id, world) if self._markers else None

    def publish_scene(self, text: str) -> None:
        """Publish the scene in effect and its models; late subscribers get them too."""
        self._send(self._scene, [encode_string(text)])
        self._send(self._descriptions, self._encode_joints(self._descriptions))

    def publish_state(self, world: World) -> None:
        """
        Publish pose and twist of every body, together and one by one, and the transforms.

        Those of single bodies go out with `send_waiting`, and before the next state at the latest.
        """
        self.send_waiting()
        start_ns = perf_counter_ns()
        t_ns = world.time_ns
        p, q = world.position, world.orientation
        v, w = world.linear_velocity, world.angular_velocity
        own = (p, q, v, w) if self._has_all else tuple(a[self._bodies] for a in (p, q, v, w))
        self._send_later(self._pose, self._poses.encode(t_ns, own[0], own[1]))
        self._send_later(self._twist, self._twists.encode(t_ns, own[2], own[3]))
        self._send(self._state, [self._states.encode(t_ns, p, q, v, w)])
        if self._contact_wrench:
            wrenches = world.contact_wrenches()[self._bodies]
            self._send_later(self._contact_wrench, [
                encode_wrench(t_ns, self._frame_id, wrench[:3], wrench[3:])
                for wrench in wrenches])
        if self._tf:
            self._send(self._tf, [self._transforms.encode(t_ns, p, q)])
        self._publish_joints()
        self.cost_ns += perf_counter_ns() - start_ns

    def _publish_joints(self) -> None:
        """Publish the states of the joints, which controllers wait for, and their wrenches."""
        if not self._joint_states.topics:
            return
        for outlet in (self._joint_states, self._all_joint_states):
            if outlet:
                self._send(outlet, self._encode_joints(outlet))
        self._send_later(self._joint_wrenches, self._encode_joints(self._joint_wrenches))

    def _encode_joints(self, outlet: _Outlet) -> list[bytes]:
        if not outlet.topics:
            return []
        return self._joints.encode(outlet.topics[0].kind, [t.body for t in outlet.topics])

    def send_waiting(self, until_ns: float = inf) -> bool:
        """
        Send what waits, until all of it is sent or that time [ns] of the steady clock.

        Return whether anything was sent.
        """
        start_ns = perf_counter_ns()
        has_sent = self._outbox.send(until_ns)
        self.cost_ns += perf_counter_ns() - start_ns
        return has_sent

    def publish_clock(self, t_ns: int) -> None:
        """Publish the simulation time."""
        if self._clock:
            self._send(self._clock, [encode_clock(t_ns)])

    def publish_markers(self, world: World) -> None:
        """Publish the shapes at their poses, and the contacts."""
        if self._markers and self._scene_markers and self._contact_markers:
            data = self._scene_markers.encode(world.time_ns, world.position, world.orientation)
            contacts = self._contact_markers.encode(world)
            self._send(self._markers, [data, contacts])

    def delete_markers(self, t_ns: int) -> None:
        """Take all markers away: the simulation ends, and nobody else would."""
        if self._markers and self._scene_markers and self._contact_markers:
            self._send(self._markers, [self._scene_markers.encode_end(t_ns),
                                       self._contact_markers.encode_end(t_ns)])

    def publish_hash(self, state_hash: int) -> None:
        """Publish a hash of the complete state."""
        self._send(self._state_hash, [encode_uint64(state_hash)])

    def publish_applied_wrench(
        self, body: str, t_ns: int, frame_id: str, force: Iterable[float],
        torque: Iterable[float],
    ) -> None:
        """
        Echo an accepted wrench with the time of the step from which it acts.

        Bodies that have no topics of their own have no echo either.
        """
        if body in self._applied_wrench:
            data = encode_wrench(t_ns, frame_id or self._frame_id, force, torque)
            self._send(self._applied_wrench[body], [data])

    def publish_diagnostics(self, t_ns: int, statuses: Sequence[Status]) -> None:
        """Publish what the node knows about itself."""
        self._send(self._diagnostics, [encode_diagnostics(t_ns, statuses)])

    def clock_publishers(self) -> int:
        """Return how many publishers /clock has; more than one tears time to and fro."""
        return sum(self._node.count_publishers(t.name) for t in self._clock.topics) if (
            self._clock) else 0

    def telling_names(self) -> list[str]:
        """Return topics that one node alone publishes: one that all have, clock, joint states."""
        return [topic.name for outlet in (self._state, self._clock, self._all_joint_states)
                if outlet for topic in outlet.topics]

    def flush(self, seconds: float) -> None:
        """Wait until reliable subscribers have what was sent, at most this long."""
        await_delivery(self._all, seconds)

    @property
    def topics(self) -> list[Topic]:
        """The topics as a bag describes them; the scene is recorded by itself."""
        found = {topic.name: topic for outlet in self._outlets for topic in outlet.topics
                 if topic.kind != kinds.SCENE}
        return list(found.values())

    def record(self, recorder: Recorder | None) -> None:
        """Hand what is published to a recorder from now on, or to none."""
        for outlet in self._outlets:
            outlet.channels = [] if recorder is None else [
                recorder.channel(topic.name) for topic in outlet.topics
                if topic.kind != kinds.SCENE]
        self._recorder = recorder
        # They were published when the node started: a bag has them as it begins.
        self._note(self._descriptions, self._encode_joints(self._descriptions))

    def _create(self, kind: str, bodies: Sequence[str] = ('',), *, messages: int = 1) -> _Outlet:
        """Create a publisher for each body; `messages` go out through it at a time."""
        message_type = kinds.PUBLISHED[kind].type
        publishers = [self._node.create_publisher(
            message_class(message_type), kinds.topic_name(kind, body=body), self._qos[kind])
            for body in bodies]
        self._all += publishers
        known = kind if kinds.PUBLISHED[kind].is_made_again else ''
        topics = [Topic(publisher.topic_name, message_type, known, body,
                        kind == kinds.ROBOT_DESCRIPTION)
                  for publisher, body in zip(publishers, bodies, strict=True)]
        outlet = _Outlet(publishers * messages, topics * messages)
        self._outlets.append(outlet)
        return outlet

    def _create_of_joints(self, kind: str, owners: Sequence[str] | None = None) -> _Outlet:
        """Create a publisher for each model or joint that has something to say."""
        return self._create(kind, self._joints.owners(kind) if owners is None else owners)

    def _send(self, outlet: _Outlet, messages: Sequence[bytes]) -> None:
        for handle, data in zip(outlet.handles, messages, strict=True):
            handle.publish_raw(data)
        self._note(outlet, messages)

    def _send_later(self, outlet: _Outlet, messages: Sequence[bytes]) -> None:
        self._outbox.put(outlet.handles, messages)
        self._note(outlet, messages)

    def _note(self, outlet: _Outlet, messages: Sequence[bytes]) -> None:
        """Count messages, and record them."""
        self.messages += len(messages)
        if self._recorder is not None and outlet.channels:
            start_ns = perf_counter_ns()
            self._recorder.publish(self._world.step_index, outlet.channels, messages)
            self.recorded += len(messages)
            self.recording_ns += perf_counter_ns() - start_ns


def message_class(message_type: str) -> type:
    """Return the class of a message type, 'package/msg/Type'; ImportError if there is none."""
    package, _, name = message_type.split('/')
    found: type = getattr(import_module(f'{package}.msg'), name)
    return found


def check_tf() -> None:
    """Raise ParameterError where tf2_msgs is not installed."""
    try:
        message_class(kinds.PUBLISHED[kinds.TRANSFORMS].type)
    except ImportError as error:
        raise ParameterError(
            f'parameter publish_tf: the package tf2_msgs is not installed ({error}): install it '
            '(apt install ros-jazzy-tf2-msgs) or set publish_tf to false') from None
