# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
r"""
Drive the car with velocity commands, through the steering and the motors of its wheels.

    rigid_sim run car                     # in one terminal
    python examples/drive_car.py          # in another
    ros2 topic pub -r 10 /cmd_vel geometry_msgs/msg/Twist "{linear: {x: 0.7}, angular: {z: 0.5}}"

Each geometry_msgs/Twist on the topic `cmd_vel` is the velocity v of the middle of the rear axle
and the rate w at which the car turns. All wheels roll about one point, on the line of the rear
axle and v / w to the left (Ackermann): a front wheel, ahead by the wheelbase l and to the left by
y, has the steering angle atan(k l / (1 - k y)) with k = w / v, and each wheel the rate of its
distance from that point. The car cannot turn on the spot, nor more sharply than its steering lets
it; it then turns as sharply as it can.

Parameters, set with `--ros-args -p NAME:=VALUE`: sim, radius [m], track [m], wheelbase [m],
most_steering [rad].
"""
import math
import sys

from geometry_msgs.msg import Twist
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState


class DriveCar(Node):
    """Turns velocity commands into commands for the steering and the wheels."""

    def __init__(self) -> None:
        """Listen to `cmd_vel`."""
        super().__init__('drive_car')
        sim = self.declare_parameter('sim', '/rigid_sim').value
        self._radius = self.declare_parameter('radius', 0.05).value
        self._track = self.declare_parameter('track', 0.265).value
        self._wheelbase = self.declare_parameter('wheelbase', 0.3302).value
        self._most_steering = self.declare_parameter('most_steering', 0.4189).value
        self._commands = self.create_publisher(JointState, f'{sim}/joint_commands', 10)
        self.create_subscription(Twist, 'cmd_vel', self._drive, 10)

    def _drive(self, twist: Twist) -> None:
        v = twist.linear.x
        # Where the inner front wheel is turned as far as it can be.
        sharpest = 1.0 / (self._wheelbase / math.tan(self._most_steering) + 0.5 * self._track)
        curvature = min(max(twist.angular.z / v, -sharpest), sharpest) if v != 0.0 else 0.0
        angles, rates = {}, {}
        for end, ahead in (('front', self._wheelbase), ('rear', 0.0)):
            for side, left in (('left', 0.5 * self._track), ('right', -0.5 * self._track)):
                along, across = 1.0 - curvature * left, curvature * ahead
                rates[f'{end}_{side}_wheel'] = v * math.hypot(along, across) / self._radius
                if end == 'front':
                    # Beyond its limit by rounding alone, the command would be refused.
                    angles[f'front_{side}_steering'] = min(max(
                        math.atan2(across, along), -self._most_steering), self._most_steering)
        nothing = math.nan      # leaves what it is told for as it is
        self._commands.publish(JointState(
            name=[*angles, *rates],
            position=[*angles.values(), *[nothing] * len(rates)],
            velocity=[*[nothing] * len(angles), *rates.values()]))


def main(arguments: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=arguments)
    node = DriveCar()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main(sys.argv)
