# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Let the arm of the scene `arm` draw a figure in joint space, and say how well it followed.

    rigid_sim run arm                       # in one terminal
    python examples/track_trajectory.py     # in another

The node waits for a state of the joints, sends one trajectory_msgs/JointTrajectory, and compares
each further state with the curve that it has sent. Between its points, which have positions,
velocities and accelerations, the simulation goes along polynomials of the fifth order, as
ros2_control's joint_trajectory_controller does.

Parameters, set with `--ros-args -p NAME:=VALUE`: sim, model, amplitude, period.
"""
from collections.abc import Sequence
import math
import signal
import sys
import threading

from builtin_interfaces.msg import Duration, Time
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

_POINTS = 40        # a period
_LEAD = 0.5         # s of simulation time from the state heard to the start: messages take time
_LOOK = 0.2         # s between two looks at whether to end


class Tracker(Node):
    """Sends one trajectory and watches how it is followed."""

    def __init__(self) -> None:
        super().__init__('track_trajectory')
        sim = self.declare_parameter('sim', '/rigid_sim').value
        model = self.declare_parameter('model', 'arm').value
        self._amplitude: float = self.declare_parameter('amplitude', 0.3).value     # rad
        self._period: float = self.declare_parameter('period', 4.0).value           # s
        self._publisher = self.create_publisher(JointTrajectory, f'{sim}/{model}/joint_trajectory',
                                                10)
        self.create_subscription(JointState, f'{sim}/{model}/joint_states', self._watch, 10)
        self._start: tuple[float, list[float]] | None = None    # s, rad
        self._worst = 0.0
        self.is_done = False

    def _watch(self, state: JointState) -> None:
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        if self._start is None:
            if self._publisher.get_subscription_count():
                self._start = now + _LEAD, list(state.position)
                self._publisher.publish(self._trajectory(state, now + _LEAD))
            return
        begun, start = self._start
        if now > begun + 1.1 * self._period:
            self.get_logger().info(f'followed within {self._worst:.4f} rad')
            self.is_done = True
        elif now > begun:
            wanted = [p + self._curve(k, now - begun)[0] for k, p in enumerate(start)]
            self._worst = max(self._worst, *(abs(p - w) for p, w in zip(
                state.position, wanted, strict=True)))

    def _trajectory(self, state: JointState, begin: float) -> JointTrajectory:
        message = JointTrajectory(joint_names=state.name)
        message.header.stamp = Time(sec=int(begin), nanosec=round(begin % 1.0 * 1e9))
        # The first point is where the arm is: it waits there until the start.
        for i in range(_POINTS + 1):
            t = i * self._period / _POINTS
            rows = [self._curve(k, t) for k in range(len(state.name))]
            message.points.append(JointTrajectoryPoint(
                positions=[p + row[0] for p, row in zip(state.position, rows, strict=True)],
                velocities=[row[1] for row in rows], accelerations=[row[2] for row in rows],
                time_from_start=Duration(sec=int(t), nanosec=round(t % 1.0 * 1e9))))
        self.get_logger().info(f'sent {len(message.points)} points for {len(state.name)} joints')
        return message

    def _curve(self, joint: int, t: float) -> tuple[float, float, float]:
        """
        Return how far a joint is from its start at a time, and both derivatives.

        a / 2 (1 - cos(w t)) sin(w t): at rest at both ends, to one side and to the other, and
        every other joint the other way.
        """
        t = min(t, self._period)
        w = 2.0 * math.pi / self._period
        a = self._amplitude * (-1) ** joint
        s, c, s2, c2 = math.sin(w * t), math.cos(w * t), math.sin(2 * w * t), math.cos(2 * w * t)
        return (0.5 * a * (s - 0.5 * s2), 0.5 * a * w * (c - c2),
                0.5 * a * w * w * (2.0 * s2 - s))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until the trajectory is over, or until Ctrl-C."""
    # An interrupt that is raised while rclpy takes a message ends in an error of its own; so
    # Ctrl-C is only noted, and heard between two messages.
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    rclpy.init(args=None if args is None else list(args),
               signal_handler_options=SignalHandlerOptions.NO)
    node = Tracker()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not (stopped.is_set() or node.is_done):
        executor.spin_once(timeout_sec=_LOOK)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
