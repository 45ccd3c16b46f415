# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node as a process: how it starts, how it ends, and beside another of its kind."""
import importlib.util
from importlib.util import find_spec
import re
import signal
import sys
import time
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

import fresh
from kernels.caches import cache_without
from nodes.live import kept, nanoseconds, Process, running, simulate
from nodes.scenes import crates
from odd_files import KINDS
import pytest
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.bag.verify import verify


# What a healthy run may write to stderr. On a busy machine a probe asks whether a node knows it
# again, and is gone with the first answer: of the other rclpy warns, with a line of its source.
HEALTHY = re.compile(
    r'\[INFO\] \[[0-9.]+\] \[\w+\]: simulating |compiling the physics kernels|'
    r'\S+/rclpy/service\.py:\d+: RuntimeWarning: failed to send response |  .*request_id\)$')


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return str(crates(tmp_path_factory.mktemp('scene')))


def complaint(process):
    """Return the one line that a process wrote to stderr before it ended with code 2."""
    assert process.wait() == 2
    line, = process.stderr.splitlines()
    return line


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_node_cleanly(probe, tmp_path, scene, number):
    with running(tmp_path, scene, name=f'sim_{number}', is_forked=False) as process:
        probe.some(MultiDOFJointState, f'/sim_{number}/state')
        process.signal(number)
        assert process.wait() == 0
        assert [line for line in process.stderr.splitlines() if not HEALTHY.match(line)] == []


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_while_it_compiles(ros, tmp_path, monkeypatch, number):
    # Without this one, which takes longest to compile, no body can meet another.
    cache_without(tmp_path / 'cache', 'detect_part')
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'cache'))
    process = simulate(tmp_path, 'tower', is_forked=False)
    while not process.has_children():   # the helper that compiles it, for which the node waits
        assert process.is_running(), process.stderr
        time.sleep(0.1)
    process.signal(number)
    assert process.wait() == 128 + number       # as a shell reports it
    said = [line for line in process.stderr.splitlines() if not HEALTHY.match(line)]
    assert said == ['rigid_sim: stopped before the start: nothing was simulated']


def test_a_signal_to_any_thread_ends_the_node(probe, tmp_path, scene):
    with running(tmp_path, scene, name='sim_thread') as process:
        probe.some(MultiDOFJointState, '/sim_thread/state')
        process.signal_other_thread(signal.SIGINT)
        assert process.wait() == 0


def test_a_signal_ends_the_node_while_it_is_paused(probe, tmp_path, scene):
    with running(tmp_path, scene) as process:
        probe.pause(True)
        process.signal(signal.SIGTERM)
        assert process.wait() == 0


def test_a_signal_ends_the_node_between_long_steps(probe, tmp_path):
    scene = tmp_path / 'slow.yaml'
    scene.write_text('{world: {step: 1000.0, gravity: [0, 0, 0]}, bodies: [{name: rock, '
                     'shape: {type: sphere, radius: 1}, mass: 1}]}', encoding='utf-8')
    with running(tmp_path, str(scene), name='slow') as process:
        # The next step is due in a quarter of an hour.
        assert probe.pause(False, '/slow').success
        process.signal(signal.SIGINT)
        assert process.wait() == 0


def test_the_node_ends_after_its_duration(tmp_path, scene):
    process = simulate(tmp_path, scene, words=['--duration', '0.2'])
    assert process.wait() == 0


def test_the_duration_is_simulation_time(probe, tmp_path, scene):
    # Slow until somebody listens: to find each other may take nodes longer than the whole run.
    with running(
        tmp_path, scene, name='timed', words=['--duration', '20'], real_time_factor=0.1,
    ) as process, probe.listening(MultiDOFJointState, '/timed/state') as states:
        assert probe.set_parameter('real_time_factor', 10.0, '/timed').successful
        assert process.wait() == 0
        probe.wait_for(lambda: nanoseconds(states[-1].header.stamp) == 20 * 10**9)


@pytest.mark.parametrize('text, expected', [
    ('bodies: [{name: a, mass: -1}]', 'mass'),
    ('bodies: [', 'bad.yaml'),
    ('hello', 'bad.yaml'),
])
def test_a_bad_scene_is_one_line_and_code_2(ros, tmp_path, text, expected):
    path = tmp_path / 'bad.yaml'
    path.write_text(text, encoding='utf-8')
    line = complaint(simulate(tmp_path, str(path)))
    assert line.startswith('rigid_sim: ')
    assert expected in line


def test_a_missing_scene_is_one_line_and_code_2(ros, tmp_path):
    assert 'nowhere.yaml' in complaint(simulate(tmp_path, str(tmp_path / 'nowhere.yaml')))


@pytest.mark.parametrize('parameters, expected', [
    ({'real_time_factor': -1.0}, 'real_time_factor'),
    ({'threads': 3}, 'threads'),
    ({'publish_rate': 'often'}, 'must be a number'),
    ({'publish_clock': 'perhaps'}, 'true or false'),
    ({'frame_id': 'crate'}, "'crate' is a frame of the scene"),
    ({'frame_id': '""'}, 'must not be empty'),
    ({'qos.pose.reliability': 'perfect'}, 'reliable or best_effort'),
    ({'qos.pose.depth': 0}, 'at least 1'),
])
def test_a_bad_parameter_is_one_line_and_code_2(ros, tmp_path, scene, parameters, expected):
    line = complaint(simulate(tmp_path, scene, **parameters))
    assert line.startswith('rigid_sim: parameter ')
    assert expected in line


@pytest.mark.parametrize('words', [
    ['--duration', 'long'], ['--duration', '-1'], ['--durations', '1'], ['one', 'too_many'],
    ['--ros-args', '--bogus'], ['--ros-args', '-p', 'nonsense'],
    ['--ros-args', '--params-file', '/nowhere/p.yaml'],
])
def test_wrong_usage_is_one_line_and_code_2(ros, tmp_path, words):
    process = Process(['simulate', *words], tmp_path, is_forked=True)
    assert complaint(process).startswith('rigid_sim: ')


@pytest.mark.parametrize('words', [
    ['--bogus'], ['-p', 'nonsense'], ['--params-file', '/nowhere/p.yaml'],
])
def test_a_wrong_argument_of_ros_to_the_command_is_one_line_and_code_2(ros, tmp_path, words):
    process = Process(['rigid_sim', 'run', '--ros-args', *words], tmp_path, is_forked=True)
    assert complaint(process).startswith('rigid_sim: ')


@pytest.mark.parametrize(('kind', 'command'), [
    *((kind, 'run') for kind in KINDS), ('pipe', 'replay'), ('pipe', 'view')])
def test_a_file_that_ros_would_wait_for_is_one_line_and_code_2(ros, tmp_path, kind, command):
    KINDS[kind](tmp_path / 'p.yaml')
    process = Process(['rigid_sim', command, '--ros-args', '--params-file',
                       str(tmp_path / 'p.yaml')], tmp_path, is_forked=True)
    assert complaint(process).startswith('rigid_sim: ')


def test_the_command_runs_the_node(probe, tmp_path, scene):
    command = [sys.executable, '-m', 'rigid_sim_ros', 'run', scene, '--ros-args', '-r',
               '__node:=commanded']
    with kept(Process(command, tmp_path)) as process:
        probe.some(MultiDOFJointState, '/commanded/state')
        process.signal(signal.SIGINT)
        assert process.wait() == 0


def test_the_node_runs_inside_another_program(ros, tmp_path, scene):
    code = ('from rigid_sim_ros.nodes import simulate\n'
            f"print(simulate.run({scene!r}, duration=0.1, record='bag', "
            "ros_args=['--ros-args', '-r', '__node:=inside']), 'and on')")
    done = fresh.run('-c', code, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, '0 and on\n'), done.stderr
    assert verify(tmp_path / 'bag').holds


@pytest.mark.parametrize('mistake', [False, True])
def test_a_process_ends_though_ros_waits_for_ever_as_it_takes_the_node_down(
        ros, tmp_path, scene, mistake):
    # As Fast DDS may wait, with the GIL: pause() of C, which returns after a signal alone.
    code = ('import ctypes\n'
            'from rclpy.node import Node\n'
            'from rigid_sim_ros.nodes import process, simulate\n'
            'process.LONGEST_END = 0.5\n'
            'Node.destroy_node = Node.__del__ = lambda node: ctypes.PyDLL(None).pause()\n'
            f'simulate.run({scene!r}, duration=0.1, ros_args=["--ros-args", "-p", '
            f'"real_time_factor:={-1.0 if mistake else 1.0}"])')
    done = fresh.run('-c', code, cwd=tmp_path)
    assert done.returncode == 1
    assert 'Timeout' in done.stderr
    assert ('real_time_factor' in done.stderr) == mistake


def test_a_mistyped_parameter_is_named_with_the_nearest(probe, tmp_path, scene):
    with running(tmp_path, scene, publish_rat=50.0) as process:
        probe.wait_for(lambda: "did you mean 'publish_rate'?" in process.stderr)


def test_bodies_that_no_pattern_matches_are_reported(probe, tmp_path, scene):
    with running(tmp_path, scene, bodies='[nothing]') as process:
        probe.wait_for(lambda: 'no body matches' in process.stderr)


def test_two_simulations_run_side_by_side(probe, tmp_path, scene):
    first, second = tmp_path / 'first', tmp_path / 'second'
    with running(first, scene, name='left'), running(
            second, scene, name='right', real_time_factor=0.5, publish_clock=False):
        left, = probe.some(MultiDOFJointState, '/left/state')
        right, = probe.some(MultiDOFJointState, '/right/state')
        assert left.joint_names == right.joint_names
        assert probe.pause(True, '/left').success
        probe.some(MultiDOFJointState, '/right/state', 5)       # one is paused, the other runs
        topics = probe.wait_for(lambda: {'/left/state', '/clock'} <= (
            found := probe.publishers_of('left')).keys() and found, 'the topics of left')
        assert '/clock' in topics
        topics = probe.wait_for(lambda: '/right/state' in (
            found := probe.publishers_of('right')) and found, 'the topics of right')
        assert '/clock' not in topics


def test_a_motion_beyond_all_numbers_pauses_the_node(probe, tmp_path):
    scene = tmp_path / 'stiff.yaml'
    # A spring too stiff for the step: the amplitude grows without bound in an explicit method.
    scene.write_text(
        '{world: {integrator: euler, gravity: [0, 0, 0]}, bodies: [{name: rock, mass: 1, '
        'shape: {type: sphere, radius: 1}, pose: {position: [2, 0, 0]}}], forces: [{type: spring, '
        'a: rock, b: world, stiffness: 1.0e+12, rest_length: 1}]}', encoding='utf-8')
    with running(tmp_path, str(scene), name='stiff') as process:
        probe.wait_for(lambda: 'paused: ' in process.stderr)
        answer = probe.pause(False, '/stiff')
        assert not answer.success
        assert 'rock' in answer.message
        assert probe.trigger('/stiff/reset').success


@pytest.mark.skipif(importlib.util.find_spec('tf2_msgs') is not None,
                    reason='tf2_msgs is installed, so publish_tf works')
def test_publish_tf_without_tf2_msgs_is_one_line_and_code_2(ros, tmp_path, scene):
    line = complaint(simulate(tmp_path, scene, publish_tf=True))
    assert 'publish_tf' in line
    assert 'tf2_msgs is not installed' in line


@pytest.mark.skipif(importlib.util.find_spec('tf2_msgs') is None,
                    reason='tf2_msgs is not installed (it is not among the ROS wheels)')
def test_publish_tf_publishes_a_transform_for_each_body(probe, tmp_path, scene):
    from tf2_msgs.msg import TFMessage
    with running(tmp_path, scene, publish_tf=True):
        message, = probe.some(TFMessage, '/tf')
    assert [t.child_frame_id for t in message.transforms] == ['crate', 'ball', 'ground']
    assert {t.header.frame_id for t in message.transforms} == {'world'}
