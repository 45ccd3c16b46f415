# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
r"""
Drive the rover with velocity commands, through the motors of its wheels.

    rigid_sim run rover                   # in one terminal
    python examples/drive_rover.py        # in another
    ros2 topic pub -r 10 /cmd_vel geometry_msgs/msg/Twist "{linear: {x: 0.5}, angular: {z: 0.4}}"

Each geometry_msgs/Twist on the topic `cmd_vel` becomes the rates of the wheels on either side:
v / r less or more w b / 2 r, where r is the radius of a wheel and b how far apart the sides are.
Wheels that do not steer skid sideways as they turn the rover, so it turns slower than b says;
`slip` is by how much.

Parameters, set with `--ros-args -p NAME:=VALUE`: sim, radius [m], track [m], slip.
"""
import sys

from geometry_msgs.msg import Twist
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState

LEFT = ('front_left_wheel', 'rear_left_wheel')
RIGHT = ('front_right_wheel', 'rear_right_wheel')


class DriveRover(Node):
    """Turns velocity commands into commands for the wheels."""

    def __init__(self) -> None:
        """Listen to `cmd_vel`."""
        super().__init__('drive_rover')
        sim = self.declare_parameter('sim', '/rigid_sim').value
        self._radius = self.declare_parameter('radius', 0.1).value
        self._track = self.declare_parameter('track', 0.36).value
        self._slip = self.declare_parameter('slip', 2.0).value
        self._commands = self.create_publisher(JointState, f'{sim}/joint_commands', 10)
        self.create_subscription(Twist, 'cmd_vel', self._drive, 10)

    def _drive(self, twist: Twist) -> None:
        apart = 0.5 * self._slip * self._track * twist.angular.z
        rates = [(twist.linear.x + side * apart) / self._radius for side in (-1.0, 1.0)]
        self._commands.publish(JointState(
            name=[*LEFT, *RIGHT], velocity=[rates[0]] * len(LEFT) + [rates[1]] * len(RIGHT)))


def main(arguments: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=arguments)
    node = DriveRover()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main(sys.argv)
