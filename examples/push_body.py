# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
r"""
Push a body with the keyboard, or with any node that publishes velocity commands.

    rigid_sim run tumbling_cubesat                                          # in one terminal
    python examples/push_body.py --ros-args -p body:=cubesat -p force:=0.1  # in another

On a terminal these keys push for a fifth of a second, in world axes:

    w  s    +x, -x          i  k    turn about +y, -y
    a  d    +y, -y          j  l    turn about +z, -z
    r  f    +z, -z          u  o    turn about +x, -x
    q       quit            space   stop pushing

Each geometry_msgs/Twist on the topic `cmd_vel` does the same, so a joystick or another teleop node
can push too: its linear part times `force` is the force in N, its angular part times `torque` the
torque in Nm. For example

    ros2 run teleop_twist_keyboard teleop_twist_keyboard

The wrenches go to ~/wrenches of the simulation, apart from those on ~/BODY/wrench: they add to
what a controller does to the same body, they do not replace it.

Parameters, set with `--ros-args -p NAME:=VALUE`: sim, body, force, torque, axes (empty: the
world's; or a body or BODY/FRAME, where the force then acts too).
"""
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
import select
import sys
import termios
import threading
import tty

from geometry_msgs.msg import Twist, Vector3, Wrench
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import MultiDOFJointState

_Triple = tuple[float, float, float]
_NONE: _Triple = (0.0, 0.0, 0.0)

KEYS: dict[str, tuple[_Triple, _Triple]] = {
    'w': ((1.0, 0.0, 0.0), _NONE), 's': ((-1.0, 0.0, 0.0), _NONE),
    'a': ((0.0, 1.0, 0.0), _NONE), 'd': ((0.0, -1.0, 0.0), _NONE),
    'r': ((0.0, 0.0, 1.0), _NONE), 'f': ((0.0, 0.0, -1.0), _NONE),
    'u': (_NONE, (1.0, 0.0, 0.0)), 'o': (_NONE, (-1.0, 0.0, 0.0)),
    'i': (_NONE, (0.0, 1.0, 0.0)), 'k': (_NONE, (0.0, -1.0, 0.0)),
    'j': (_NONE, (0.0, 0.0, 1.0)), 'l': (_NONE, (0.0, 0.0, -1.0)),
    ' ': (_NONE, _NONE),
}
_PUSH = 0.2     # s of wall time that a key pushes
_LOOK = 0.1     # s at most until the end of the other thread is noticed


class BodyPusher(Node):
    """Turns keys and velocity commands into wrenches on one body."""

    def __init__(self) -> None:
        super().__init__('push_body')
        sim = self.declare_parameter('sim', '/rigid_sim').value
        self._body: str = self.declare_parameter('body', 'cubesat').value
        self._force: float = self.declare_parameter('force', 1.0).value
        self._torque: float = self.declare_parameter('torque', 1.0).value
        self._axes: str = self.declare_parameter('axes', '').value
        self._wrenches = self.create_publisher(MultiDOFJointState, f'{sim}/wrenches', 10)
        self.create_subscription(Twist, 'cmd_vel', self._relay, 10)
        self._release: threading.Timer | None = None

    def key(self, key: str) -> None:
        """Push as a key says, and let go a moment later."""
        if key not in KEYS:
            return
        if self._release:
            self._release.cancel()
        self._push(*KEYS[key])
        self._release = threading.Timer(_PUSH, self._push, (_NONE, _NONE))
        self._release.daemon = True
        self._release.start()

    def _relay(self, command: Twist) -> None:
        linear, angular = command.linear, command.angular
        self._push((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))

    def _push(self, direction: _Triple, axis: _Triple) -> None:
        message = MultiDOFJointState()
        message.header.frame_id = self._axes
        message.joint_names = [self._body]
        message.wrench = [Wrench(
            force=_vector(self._force, direction), torque=_vector(self._torque, axis))]
        self._wrenches.publish(message)


def _vector(factor: float, triple: _Triple) -> Vector3:
    x, y, z = (factor * component for component in triple)
    return Vector3(x=x, y=y, z=z)


@contextmanager
def _single_keys() -> Iterator[None]:
    """Let the terminal hand over each key at once, without showing it."""
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _read_keys(node: BodyPusher, stopped: threading.Event) -> None:
    while not stopped.is_set():
        # In small waits, so that the end of the other thread is noticed.
        if select.select([sys.stdin], [], [], _LOOK)[0]:
            # Not sys.stdin.read: it keeps further keys in a buffer that select does not see.
            key = os.read(sys.stdin.fileno(), 1).decode(errors='replace')
            if key in ('q', ''):
                return
            node.key(key)


def _spin(node: BodyPusher, stopped: threading.Event) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stopped.is_set():
            executor.spin_once(_LOOK)
    finally:
        stopped.set()
        executor.shutdown()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until Ctrl-C or the key q."""
    # Ctrl-C is for this thread alone: ROS must not end while the other one still uses it.
    rclpy.init(args=None if args is None else list(args),
               signal_handler_options=SignalHandlerOptions.NO)
    node = BodyPusher()
    stopped = threading.Event()
    spinning = threading.Thread(target=_spin, args=(node, stopped))
    try:
        spinning.start()
        if sys.stdin.isatty():
            print((__doc__ or '').split('\n\n')[3])
            with _single_keys():
                _read_keys(node, stopped)
        else:
            # Not join: a thread whose join is interrupted counts as ended, though it runs.
            stopped.wait()
    except KeyboardInterrupt:
        pass
    finally:
        stopped.set()
        if spinning.ident is not None:      # Ctrl-C may come before it has begun
            spinning.join()
        node.destroy_node()
        rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
