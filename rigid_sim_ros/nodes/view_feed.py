# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the page hears of a simulation: the subscriptions."""
from collections.abc import Callable, Sequence
from functools import partial
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from rigid_sim_ros.messages.topics import JOINT_STATES, topic_name
from rigid_sim_ros.scene import scene_from_text, SceneError
from rigid_sim_ros.scene.joint_groups import joint_groups
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.viewer.overlays import CONTACTS, WRENCHES
from rigid_sim_ros.viewer.simulation import Applied, Inbox, Report

_SCENE, _STATE = '/scene', '/state'
_STATE_TYPE = 'sensor_msgs/msg/MultiDOFJointState'

# The page shows the latest: what is lost is not missed, and a slow page holds nobody up.
_LATEST = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1,
                     reliability=ReliabilityPolicy.BEST_EFFORT)
_EVERY = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=100,
                    reliability=ReliabilityPolicy.RELIABLE)
_LATCHED = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1,
                      reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)


def simulations(node: Node) -> list[str]:
    """Return the names of the nodes that publish a state and a scene."""
    topics = dict(node.get_topic_names_and_types())
    return sorted(name.removesuffix(_STATE) for name, types in topics.items()
                  if name.endswith(_STATE) and _STATE_TYPE in types
                  and name.removesuffix(_STATE) + _SCENE in topics)


class Feed:
    """Fills an inbox from the topics of one simulation."""

    def __init__(self, node: Node, target: str, inbox: Inbox) -> None:
        self._node = node
        self._target = target
        self._inbox = inbox
        self._extra: dict[str, list[Subscription]] = {}
        self._wanted: set[str] = set()
        self._bodies: tuple[str, ...] = ()
        self._joints: dict[str, Subscription] = {}      # by model
        inbox.node = target
        node.create_subscription(String, f'{target}/scene', self._take_scene, _LATCHED)
        node.create_subscription(
            MultiDOFJointState, f'{target}/state', self._take_state, _LATEST, raw=True)
        node.create_subscription(DiagnosticArray, '/diagnostics', self._take_report, _EVERY)

    def listen(self, what: str, wanted: bool) -> None:
        """Hear contacts or wrenches too, or no longer."""
        (self._wanted.add if wanted else self._wanted.discard)(what)
        for subscription in self._extra.pop(what, []):
            self._node.destroy_subscription(subscription)
        if wanted and what in _EXTRA:
            self._extra[what] = _EXTRA[what](self)

    def _hear_contacts(self) -> list[Subscription]:
        return [self._node.create_subscription(
            MarkerArray, f'{self._target}/markers', self._take_markers, _LATEST, raw=True)]

    def _hear_wrenches(self) -> list[Subscription]:
        return [self._node.create_subscription(
            WrenchStamped, f'{self._target}/{body}/applied_wrench',
            partial(self._take_wrench, body), _LATEST) for body in self._bodies]

    def _take_scene(self, message: String) -> None:
        try:
            scene = scene_from_text(message.data, 'scene')
            self._bodies = tuple(
                body.name for body in scene.spec.bodies if body.is_pushed)
            models = [group.model for group in joint_groups(scene.spec.joints)]
        except SceneError:
            self._bodies, models = (), []       # the page says why
        self._hear_joints(models)
        self._inbox.applied = {}
        self._inbox.scene = message.data
        if WRENCHES in self._wanted:
            self.listen(WRENCHES, True)

    def _hear_joints(self, models: Sequence[str]) -> None:
        """Subscribe to the joint states of these models, and of no others."""
        self._inbox.joints = {}
        for model in [model for model in self._joints if model not in models]:
            self._node.destroy_subscription(self._joints.pop(model))
        for model in models:
            if model not in self._joints:
                self._joints[model] = self._node.create_subscription(
                    JointState, topic_name(JOINT_STATES, self._target, model),
                    partial(self._take_joints, model), _LATEST, raw=True)

    def _take_joints(self, model: str, data: bytes) -> None:
        self._inbox.joints[model] = data

    def _take_state(self, data: bytes) -> None:
        self._inbox.state = data
        self._inbox.state_at = time.monotonic()
        if self._inbox.heard_state is not None:
            self._inbox.heard_state(data)

    def _take_markers(self, data: bytes) -> None:
        # Shapes come on the same topic, in messages of their own.
        if _CONTACTS in data[:_HEAD]:
            self._inbox.contacts = data

    def _take_wrench(self, body: str, message: Any) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        stamp = message.header.stamp
        self._inbox.applied[body] = Applied(
            stamp.sec * SECOND + stamp.nanosec, message.header.frame_id,
            (force.x, force.y, force.z), (torque.x, torque.y, torque.z))

    def _take_report(self, message: Any) -> None:
        reports = {}
        for status in message.status:
            owner, _, part = status.name.partition(': ')
            if owner == self._target:
                values = {pair.key: pair.value for pair in status.values}
                reports[part] = Report(int.from_bytes(status.level, 'little'), status.message,
                                       values)
                self._inbox.scene_name = status.hardware_id
        if reports:
            self._inbox.reports = reports
            self._inbox.reported += 1
            self._inbox.reported_at = time.monotonic()


_HEAD = 200     # bytes in which the namespace of the first marker stands
_CONTACTS = b'contact_'
_EXTRA: dict[str, Callable[[Feed], list[Subscription]]] = {
    CONTACTS: Feed._hear_contacts,
    WRENCHES: Feed._hear_wrenches,
}
