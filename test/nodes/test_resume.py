# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node goes on from any moment of a recorded session."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.sessions import events_of, session_of, world
from geometry_msgs.msg import Wrench, WrenchStamped
from nodes.live import kept, nanoseconds, Process
import pytest
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.resume import find
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.world import load_scene, World


@pytest.fixture(scope='module')
def session(tmp_path_factory):
    """Record two seconds in which wrenches come, one of them for long; return bag and world."""
    bag = tmp_path_factory.mktemp('session') / 'session'
    batch = Batch(world(), bag, segment_s=0.5)
    batch.run(300)
    batch.tell('set_pose', name='ball', position=(3.0, 1.0, 0.5), orientation=(0.6, 0, 0, 0.8))
    batch.tell('apply_wrench', name='ball', force=(1.0, 0.0, 0.0), duration=5.0,
               source='wrenches[0]')
    batch.tell('apply_wrench', name='crate', force=(0.0, 2.0, 0.0), duration=0.5,
               frame='crate/handle', source='crate/wrench')
    batch.run(1700)
    batch.close()
    return bag, batch.world


def resume(folder, bag, *words, name='resumed'):
    command = ['rigid_sim', 'resume', str(bag), *map(str, words), '--ros-args', '-r',
               f'__node:={name}']
    return Process(command, folder, is_forked=True)


def test_without_new_inputs_it_goes_on_as_the_session_did(ros, session, tmp_path):
    bag, last = session
    branch = tmp_path / 'branch'
    with kept(resume(tmp_path, bag, '--at', 0.7, '--duration', 1.3, '--record',
                     branch)) as process:
        assert process.wait() == 0
    end = list(events_of(branch))[-1]
    assert (end.step, end.arguments['state_hash']) == (2000, last.state_hash())


def test_the_branch_is_a_session_of_its_own(ros, session, tmp_path):
    with kept(resume(tmp_path, session[0], '--at', 1.2345, '--duration', 0.5, '--record',
                     tmp_path / 'branch')) as process:
        assert process.wait() == 0
        assert 'from 1.234 s on' in process.stderr      # a whole step of 1 ms
    verdict = verify(tmp_path / 'branch')
    assert (verdict.difference, verdict.faults, verdict.note) == (None, (), '')
    assert verdict.steps == 500


@pytest.fixture(scope='module')
def collapse(tmp_path_factory):
    """Return the bag of a tower that is hit; nobody changes it."""
    bag = tmp_path_factory.mktemp('collapse') / 'bag'
    batch = Batch(load_scene('tower'), bag)
    batch.run(800)      # 1.6 s
    batch.close()
    return bag


@pytest.mark.parametrize('at', [1.3, 1.5])
def test_a_branch_amid_contacts_comes_out_again(ros, collapse, tmp_path, at):
    with kept(resume(tmp_path, collapse, '--at', at, '--duration', 0.4, '--record',
                     tmp_path / 'branch')) as process:
        assert process.wait() == 0
    verdict = verify(tmp_path / 'branch')
    assert (verdict.difference, verdict.faults, verdict.steps) == (None, (), 200)


def test_a_branch_can_be_branched(ros, session, tmp_path):
    for folder, bag, at in (('a', session[0], 0.9), ('b', tmp_path / 'a' / 'bag', 1.1)):
        with kept(resume(tmp_path / folder, bag, '--at', at, '--duration', 0.4, '--record',
                         tmp_path / folder / 'bag')) as process:
            assert process.wait() == 0
    there, moment = tmp_path / 'b' / 'bag', find(session[0], 1.4)
    expected = World(moment.scene)
    moment.apply(expected)
    assert find(there, 1.4).step == 1400
    branched = World(moment.scene)
    find(there, 1.4).apply(branched)
    assert branched.state_hash() == expected.state_hash()


def test_the_clock_goes_on_and_new_wrenches_take_the_place_of_the_old(probe, session, tmp_path):
    branch = tmp_path / 'branch'
    with kept(resume(tmp_path, session[0], '--at', 1.0, '--record', branch,
                     name='branched')) as process:
        state, = probe.some(MultiDOFJointState, '/branched/state')
        assert nanoseconds(state.header.stamp) >= 1_000_000_000
        message = MultiDOFJointState(joint_names=['crate'], wrench=[Wrench()])
        message.wrench[0].force.z = 2.0
        with probe.listening(WrenchStamped, '/branched/crate/applied_wrench') as echoes:
            probe.publish('/branched/wrenches', message)
            probe.wait_for(lambda: echoes, 'the echo of the wrench')
        probe.some(MultiDOFJointState, '/branched/state', 30)
        process.end()
        assert process.wait() == 0
    told = [(event.kind, event.arguments.get('source')) for event in events_of(branch)]
    assert told[:2] == [('cancel_wrenches', 'wrenches[0]'), ('apply_wrench', 'wrenches[0]')]
    assert verify(branch).holds


def test_parameters_are_those_of_the_session_unless_others_are_given(ros, session, tmp_path):
    first, second = tmp_path / 'first', tmp_path / 'second'
    for command in (
            ['simulate', 't_handle', '--duration', '0.3', '--record', str(first), '--ros-args',
             '-p', 'frame_id:=map', '-p', 'publish_rate:=50.0', '-p', 'real_time_factor:=0.0'],
            ['rigid_sim', 'resume', str(first), '--at', '0.2', '--duration', '0.1', '--record',
             str(second), '--ros-args', '-p', 'publish_rate:=20.0']):
        with kept(Process(command, tmp_path / 'log', is_forked=True)) as process:
            assert process.wait() == 0
    told = session_of(second).parameters
    assert [told[name] for name in ('frame_id', 'publish_rate', 'real_time_factor', 'scene')] == [
        'map', 20.0, 1.0, 't_handle']
    assert verify(second).holds


@pytest.mark.parametrize('words, expected', [
    (['--at', 2.5], 'must be from 0 s to 2 s'),
    (['--at', -1], 'must be >= 0'),
    (['--at', 'nan'], 'must be >= 0'),
    (['--at', 'noon'], 'not a number'),
    ([], '--at'),
    (['--at', 1, '--record', '.'], 'exists already'),
])
def test_wrong_usage_is_one_line_and_code_2(ros, session, tmp_path, words, expected):
    with kept(resume(tmp_path, session[0], *words)) as process:
        assert process.wait() == 2
        line, = process.stderr.splitlines()
        assert line.startswith('rigid_sim: ')
        assert expected in line


def test_a_bag_that_does_not_exist_is_one_line_and_code_2(ros, tmp_path):
    with kept(resume(tmp_path, tmp_path / 'nothing', '--at', 1)) as process:
        assert process.wait() == 2
        line, = process.stderr.splitlines()
        assert 'does not exist' in line
