# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The examples drive a simulation from processes of their own, as the documents tell users to."""
from importlib.util import find_spec
import math
import os
import pty
import re
import signal
import sys
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped, WrenchStamped
from nodes.live import kept, Process, ROOT, running
import pytest
from sensor_msgs.msg import MultiDOFJointState

WHEEL_TORQUE = 0.23e-3      # Nm, as in examples/attitude_controller.py


@pytest.fixture(scope='module')
def sim(probe, tmp_path_factory):
    # Five times as fast as real, with 100 messages a second of wall time.
    with running(tmp_path_factory.mktemp('sim'), 'tumbling_cubesat', real_time_factor=5.0,
                 publish_rate=20.0):
        probe.some(MultiDOFJointState, '/rigid_sim/state')
        yield


def example(folder, name, *words, **options):
    return kept(Process([sys.executable, f'examples/{name}.py', *words], folder, **options))


def speeds(state):
    v, w = state.twist[0].linear, state.twist[0].angular
    return math.hypot(v.x, v.y, v.z), math.hypot(w.x, w.y, w.z)


def test_the_attitude_controller_stops_the_cubesat_with_torques_only(probe, sim, tmp_path):
    tumbling, = probe.some(MultiDOFJointState, '/rigid_sim/state')
    assert speeds(tumbling)[1] > 0.3
    with probe.listening(WrenchStamped, '/rigid_sim/cubesat/applied_wrench') as echoes:
        with example(tmp_path, 'attitude_controller') as controller:
            assert controller.wait() == 0
            assert 'the tumbling has stopped' in controller.stderr
        resting, = probe.some(MultiDOFJointState, '/rigid_sim/state')
        wrenches = [echo.wrench for echo in echoes]
    linear, angular = speeds(resting)
    assert angular < 2e-3                                   # rad/s
    # The centre of mass is at rest throughout and lies 3 mm from the body frame's origin.
    assert linear < 2e-3 * 3e-3                             # m/s
    assert abs(resting.transforms[0].rotation.w) > math.cos(math.radians(1.0) / 2.0)
    forces = [w.force for w in wrenches]
    torques = [w.torque for w in wrenches]
    assert {(f.x, f.y, f.z) for f in forces} == {(0.0, 0.0, 0.0)}
    assert max(abs(c) for t in torques for c in (t.x, t.y, t.z)) <= WHEEL_TORQUE


# Ends itself with Ctrl-C while rclpy makes the message that it has just taken.
INTERRUPTED = """
import os, runpy, signal
from sensor_msgs.msg import MultiDOFJointState as Message
plain, taken = Message.__init__, []

def make(self, **fields):
    taken.append(self)
    if len(taken) == 3:
        os.kill(os.getpid(), signal.SIGINT)
    plain(self, **fields)

Message.__init__ = make
runpy.run_path('examples/attitude_controller.py', run_name='__main__')
"""


def test_ctrl_c_ends_the_attitude_controller_also_in_the_midst_of_a_message(sim, tmp_path):
    command = [sys.executable, '-c', INTERRUPTED, '--ros-args', '-p', 'hold:=true']
    with kept(Process(command, tmp_path)) as controller:
        assert controller.wait() == 0


def push(probe, act, wanted):
    """Repeat an act until the echo of the wanted force (x component) comes."""
    with probe.listening(WrenchStamped, '/rigid_sim/cubesat/applied_wrench') as echoes:
        def done():
            act()
            return [e for e in echoes if e.wrench.force.x == wanted]
        probe.wait_for(done, f'a push of {wanted} N')


def test_a_velocity_command_pushes_the_body(probe, sim, tmp_path):
    command = Twist()
    command.linear.x = 0.5
    with example(tmp_path, 'push_body', '--ros-args', '-p', 'force:=0.002'):
        push(probe, lambda: probe.publish('/cmd_vel', command), 0.001)


def test_a_key_pushes_the_body(probe, sim, tmp_path):
    ours, its = pty.openpty()
    with example(tmp_path, 'push_body', '--ros-args', '-p', 'force:=0.004', stdin=its) as pusher:
        push(probe, lambda: os.write(ours, b'w'), 0.004)
        os.write(ours, b'q')
        assert pusher.wait() == 0
    os.close(ours)
    os.close(its)


def test_the_publisher_of_the_docs_pushes_and_ends_with_ctrl_c(probe, sim, tmp_path):
    code, = re.findall(r'^```python\n(import rclpy\n.*?)^```$',
                       (ROOT / 'docs/node.md').read_text(encoding='utf-8'),
                       re.MULTILINE | re.DOTALL)
    with kept(Process([sys.executable, '-c', code], tmp_path)) as pusher:
        with probe.listening(WrenchStamped, '/rigid_sim/cubesat/applied_wrench') as echoes:
            # The first ones may be those of another test, on their way when it ended.
            probe.wait_for(lambda: [echo for echo in echoes if echo.wrench.torque.z == 1e-4],
                           'a push of 1e-4 N m')
        pusher.signal(signal.SIGINT)
        assert pusher.wait() == 0


def test_the_arm_follows_the_trajectory_of_the_tracker(probe, tmp_path):
    def has_come():
        report, = probe.some(DiagnosticArray, '/diagnostics')
        return any(value.key == 'joint messages accepted' and value.value == '1'
                   for status in report.status for value in status.values)

    words = ('track_trajectory', '--ros-args', '-p', 'sim:=/arm_sim')
    # The trajectory begins half a second of simulation time after the tracker has sent it: at this
    # pace it is there by then, however busy the machine is.
    with running(tmp_path / 'sim', 'arm', name='arm_sim', real_time_factor=0.05,
                 publish_rate=50.0, diagnostics_rate=10.0, publish_clock=False), example(
                     tmp_path, *words) as tracker:
        probe.wait_for(has_come, 'the trajectory to be accepted')
        assert probe.set_parameter('real_time_factor', 5.0, '/arm_sim').successful
        assert tracker.wait() == 0
        found, = re.findall(r'followed within ([0-9.]+) rad', tracker.stderr)
    # It lags by I a / k and sags by gravity / k: I a stays below 3 N m and gravity below 16 N m, k
    # is 2e4 N m/rad, 4e3 below the elbow; and a goal is met within a step, 0.5 rad/s * 1 ms.
    assert float(found) < 3.0 / 4e3 + 16.0 / 2e4 + 5e-4


def test_the_rover_goes_as_velocity_commands_say(probe, tmp_path):
    command = Twist()
    command.linear.x = 0.5

    def goes():
        probe.publish('/cmd_vel', command)
        # 12 kg and 4 wheels with 4 N m each: it is as fast as its wheels within 0.1 s.
        return [twist for twist in twists if abs(twist.twist.linear.x - 0.5) < 1e-3]

    words = ('drive_rover', '--ros-args', '-p', 'sim:=/rover_sim')
    with (running(tmp_path / 'sim', 'rover', name='rover_sim', publish_rate=50.0,
                  publish_clock=False),
          example(tmp_path, *words),
          probe.listening(TwistStamped, '/rover_sim/chassis/twist') as twists):
        probe.wait_for(goes, 'a rover at 0.5 m/s')
        # Interrupted as it takes a message, rclpy raises an error that says nothing of that.
        assert probe.set_parameter('slip', 2.0, '/drive_rover').successful


def test_the_car_turns_as_velocity_commands_say(probe, tmp_path):
    command = Twist()
    command.linear.x, command.angular.z = 0.5, 0.5

    def goes():
        probe.publish('/cmd_vel', command)
        # The radius is right to 1e-3, see test_robot_examples.py, and so is the rate.
        return [twist for twist in twists if abs(twist.twist.angular.z - 0.5) < 1e-3]

    words = ('drive_car', '--ros-args', '-p', 'sim:=/car_sim')
    with (running(tmp_path / 'sim', 'car', name='car_sim', publish_rate=50.0,
                  publish_clock=False),
          example(tmp_path, *words),
          probe.listening(TwistStamped, '/car_sim/chassis/twist') as twists):
        probe.wait_for(goes, 'a car that turns at 0.5 rad/s')
        # Interrupted as it takes a message, rclpy raises an error that says nothing of that.
        assert probe.set_parameter('track', 0.265, '/drive_car').successful
