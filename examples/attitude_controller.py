# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Stop a tumbling CubeSat and turn it to a wanted attitude, with torques only.

    rigid_sim run tumbling_cubesat              # in one terminal
    python examples/attitude_controller.py      # in another

The node hears the state of all bodies on ~/state of the simulation, and answers each message with
a torque on ~/BODY/wrench in the axes of the body, where a satellite's reaction wheels are mounted.
The simulation holds a torque until the next one comes, for at most half a second: a controller
that dies leaves the satellite free.

The law is quaternion feedback (B. Wie, Space Vehicle Dynamics and Control, 2nd ed., 7.3):

    tau = -D (w + sat(K / D e))         each axis limited to what a reaction wheel can do

with the angular velocity w and the vector part e of the attitude error, both in body axes. The
saturation limits the rate at which the satellite turns to its attitude. For a small error
e = angle / 2, so each axis is a damped oscillator, I a'' + D a' + K / 2 a = 0: K and D follow from
a natural frequency and critical damping.

It ends once the satellite rests at its attitude, unless `hold` is true.

Parameters, set with `--ros-args -p NAME:=VALUE`: sim, body, attitude, inertia, frequency,
torque_limit, turn_rate, hold.
"""
from collections.abc import Sequence
import signal
import sys
import threading

from geometry_msgs.msg import WrenchStamped
import numpy as np
import numpy.typing as npt
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import MultiDOFJointState

_Array = npt.NDArray[np.float64]

# CubeSpace CubeWheel Small, a wheel made for satellites of this size: 0.23 mNm, 1.77 mNms.
WHEEL_TORQUE = 0.23e-3      # Nm

# A 1U CubeSat at its greatest mass, as a uniform cube: 1.33 kg * (0.1 m)^2 / 6. The law does not
# depend on it being exact: half or double makes the turn slower or less damped.
INERTIA = 2.2e-3            # kg m^2

_LOOK = 0.2                 # s between two looks at whether to end


class AttitudeController(Node):
    """Turns one body of a simulation to an attitude and holds it there."""

    def __init__(self) -> None:
        super().__init__('attitude_controller')
        sim = self.declare_parameter('sim', '/rigid_sim').value
        self._body: str = self.declare_parameter('body', 'cubesat').value
        attitude = self.declare_parameter('attitude', [0.0, 0.0, 0.0, 1.0]).value
        inertia = self.declare_parameter('inertia', INERTIA).value
        frequency = self.declare_parameter('frequency', 0.5).value          # rad/s
        self._limit = self.declare_parameter('torque_limit', WHEEL_TORQUE).value
        self._turn_rate = self.declare_parameter('turn_rate', 0.1).value    # rad/s
        self._q_WD = np.array(attitude) / np.linalg.norm(attitude)          # D: the wanted frame
        self._damping = 2.0 * frequency * inertia
        self._stiffness = 2.0 * frequency**2 * inertia
        self._wheels = self.create_publisher(WrenchStamped, f'{sim}/{self._body}/wrench', 10)
        self.create_subscription(MultiDOFJointState, f'{sim}/state', self._control, 10)
        self._holds = self.declare_parameter('hold', False).value
        self._rests = False
        self.is_done = False
        self.get_logger().info(f'turning {self._body} in {sim}')

    def _control(self, state: MultiDOFJointState) -> None:
        if self._body not in state.joint_names:
            self.get_logger().error(f'no body {self._body!r}, only {", ".join(state.joint_names)}',
                                    throttle_duration_sec=5.0)
            return
        index = state.joint_names.index(self._body)
        q, w = state.transforms[index].rotation, state.twist[index].angular
        q_WB = np.array([q.x, q.y, q.z, q.w])
        w_WB_B = rotate(conjugate(q_WB), np.array([w.x, w.y, w.z]))
        q_DB = multiply(conjugate(self._q_WD), q_WB)
        # q and -q are the same attitude: the error of positive w is the shorter way.
        error = np.copysign(1.0, q_DB[3]) * q_DB[:3]
        rate = np.clip(self._stiffness / self._damping * error, -self._turn_rate, self._turn_rate)
        tau_B = np.clip(-self._damping * (w_WB_B + rate), -self._limit, self._limit)
        self._report(float(np.linalg.norm(w_WB_B)), float(np.linalg.norm(error)))
        self._send(np.zeros(3) if self.is_done else tau_B)

    def _send(self, tau_B: _Array) -> None:
        message = WrenchStamped()
        message.header.frame_id = self._body
        torque = message.wrench.torque
        torque.x, torque.y, torque.z = map(float, tau_B)
        self._wheels.publish(message)

    def _report(self, speed: float, error: float) -> None:
        angle = np.degrees(2.0 * np.arcsin(min(1.0, error)))
        rests = bool(speed < 1e-3 and angle < 0.5)
        if rests and not self._rests:
            self.get_logger().info('the attitude is reached and the tumbling has stopped')
        self._rests = rests
        self.is_done = rests and not self._holds
        self.get_logger().info(f'{np.degrees(speed):7.3f} deg/s, {angle:7.2f} deg to go',
                               throttle_duration_sec=2.0)


def conjugate(q: _Array) -> _Array:
    """Return the inverse of a unit quaternion x, y, z, w."""
    return np.array([-q[0], -q[1], -q[2], q[3]])


def multiply(a: _Array, b: _Array) -> _Array:
    """Return the product of two quaternions x, y, z, w: first b, then a."""
    xyz = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*xyz, a[3] * b[3] - a[:3] @ b[:3]])


def rotate(q: _Array, v: _Array) -> _Array:
    """Rotate a vector by a unit quaternion x, y, z, w."""
    t = 2.0 * np.cross(q[:3], v)
    return np.asarray(v + q[3] * t + np.cross(q[:3], t))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until the satellite rests, or until Ctrl-C."""
    # An interrupt that is raised while rclpy takes a message ends in an error of its own; so
    # Ctrl-C is only noted, and heard between two messages.
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    rclpy.init(args=None if args is None else list(args),
               signal_handler_options=SignalHandlerOptions.NO)
    node = AttitudeController()
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
