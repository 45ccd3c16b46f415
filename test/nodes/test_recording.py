# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When the node records, into what, and what happens when it cannot."""
from importlib.util import find_spec
import signal
import sys
import time
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.sessions import events_of, session_of
from bag.small_disk import make_read_only, mounted
from diagnostic_msgs.msg import DiagnosticArray
from nodes.live import kept, Process, running, simulate
from nodes.scenes import crates, free_bodies
import pytest
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.verify import verify


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return str(crates(tmp_path_factory.mktemp('scene')))


@pytest.fixture(scope='module')
def sim(probe, scene, tmp_path_factory):
    """Give the service names of a node that does not record from the start."""
    with running(tmp_path_factory.mktemp('sim'), scene, name='taped', diagnostics_rate=20.0):
        yield '/taped'


@pytest.fixture
def start(probe, sim):
    """Start recording into a path; end that, if it is still going on, after the test."""
    def begin(path, **parameters):
        for name, value in {'bag_path': str(path), **parameters}.items():
            assert probe.set_parameter(name, value, sim).successful
        return probe.trigger(f'{sim}/start_recording')
    yield begin
    probe.trigger(f'{sim}/stop_recording')


def recorder_status(probe, node, when):
    """
    Return what the diagnostics say of the recording as soon as something is true of it.

    `when` takes a status and its values. The first ones, that were under way, may be of before.
    """
    def of_node():
        found = [(status, {value.key: value.value for value in status.values})
                 for message in messages for status in message.status
                 if status.name == f'{node}: recording']
        return [(status, values) for status, values in found if when(status, values)]

    with probe.listening(DiagnosticArray, '/diagnostics') as messages:
        return probe.wait_for(of_node, f'diagnostics of {node}')[-1]


def goes_on(probe, node):
    """Wait for more states than were under way."""
    return len(probe.some(MultiDOFJointState, f'{node}/state', 20)) == 20


# --- services ---------------------------------------------------------------------------------

@pytest.mark.parametrize('storage, compression', [('mcap', 'none'), ('sqlite3', 'zstd')])
def test_a_recording_of_a_part_of_a_run_stands_on_its_own(
        probe, sim, start, tmp_path, storage, compression):
    answer = start(tmp_path / 'bag', bag_storage=storage, bag_compression=compression)
    assert answer.success
    assert str(tmp_path / 'bag') in answer.message
    assert goes_on(probe, sim)
    answer = probe.trigger(f'{sim}/stop_recording')
    assert answer.success
    assert str(tmp_path / 'bag') in answer.message
    verdict = verify(tmp_path / 'bag')
    assert (verdict.difference, verdict.faults, verdict.note) == (None, (), '')
    assert verdict.steps > 100
    assert session_of(tmp_path / 'bag').parameters['bag_storage'] == storage


def test_a_recording_that_begins_amid_contacts_stands_on_its_own(probe, tmp_path):
    # A ball hits a tower of blocks: 84 contacts, some of which are about to end.
    with running(tmp_path, 'tower', name='tower', real_time_factor=1.0):
        for k in range(3):
            assert probe.set_parameter('bag_path', str(tmp_path / f'bag{k}'), '/tower').successful
            assert probe.trigger('/tower/start_recording').success
            assert goes_on(probe, '/tower')
            assert probe.trigger('/tower/stop_recording').success
    for k in range(3):
        verdict = verify(tmp_path / f'bag{k}')
        assert (verdict.difference, verdict.faults) == (None, ())
        assert verdict.steps > 50


def test_the_bag_is_complete_when_the_service_answers(probe, sim, start, tmp_path):
    start(tmp_path / 'bag')
    probe.trigger(f'{sim}/stop_recording')
    assert info(tmp_path / 'bag').is_closed


def test_a_recording_of_a_pause_stands_on_its_own(probe, sim, start, tmp_path):
    probe.pause(True, sim)
    start(tmp_path / 'bag')
    probe.trigger(f'{sim}/step')
    probe.trigger(f'{sim}/stop_recording')
    probe.pause(False, sim)
    assert verify(tmp_path / 'bag').steps == 1
    assert [event.kind for event in events_of(tmp_path / 'bag')] == ['pause', 'step', 'end']


def test_a_second_start_is_refused_and_the_first_recording_goes_on(probe, sim, start, tmp_path):
    start(tmp_path / 'bag')
    answer = start(tmp_path / 'other')
    assert not answer.success
    assert 'already recording' in answer.message
    assert not (tmp_path / 'other').exists()
    assert probe.trigger(f'{sim}/stop_recording').success
    assert verify(tmp_path / 'bag').holds


def test_a_stop_without_a_recording_is_refused(probe, sim, start, tmp_path):
    answer = probe.trigger(f'{sim}/stop_recording')
    assert not answer.success
    assert 'not recording' in answer.message


@pytest.mark.parametrize('name, expected', [
    ('exists', 'exists already: choose another folder'), ('file/bag', 'cannot be made')])
def test_a_path_that_cannot_be_used_is_refused_and_the_simulation_goes_on(
        probe, sim, start, tmp_path, name, expected):
    (tmp_path / 'exists').mkdir()
    (tmp_path / 'file').write_text('', encoding='utf-8')
    answer = start(tmp_path / name)
    assert not answer.success
    assert expected in answer.message
    assert goes_on(probe, sim)


def test_a_folder_that_may_not_be_written_is_refused_and_the_simulation_goes_on(
        probe, sim, start, tmp_path):
    with mounted(tmp_path / 'disk') as disk:
        make_read_only(disk)
        answer = start(disk / 'bag')
        assert not answer.success
        assert 'Read-only file system' in answer.message
        assert goes_on(probe, sim)


def test_an_unknown_storage_is_refused(probe, sim):
    result = probe.set_parameter('bag_storage', 'tape', sim)
    assert not result.successful
    assert 'must be mcap or sqlite3' in result.reason


def test_the_diagnostics_tell_of_the_recording(probe, sim, start, tmp_path):
    start(tmp_path / 'bag')
    status, values = recorder_status(
        probe, sim, lambda _, values: float(values.get('size [MB]', 0.0)) > 0.0)
    assert (status.level, status.message) == (b'\x00', f'recording into {tmp_path / "bag"}')
    assert values['path'] == str(tmp_path / 'bag')
    assert int(values['messages']) > 0
    assert (values['gaps'], values['messages lost'], values['inputs lost']) == ('0', '0', '0')
    probe.trigger(f'{sim}/stop_recording')
    recorder_status(probe, sim, lambda status, _: (
        status.message == f'recorded into {tmp_path / "bag"}'))


# --- from the start -----------------------------------------------------------------------------

@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_closes_the_bag(probe, tmp_path, scene, number):
    with running(tmp_path, scene, name=f'rec_{number}', record=True,
                 bag_path=tmp_path / 'bag') as process:
        assert goes_on(probe, f'/rec_{number}')
        process.signal(number)
        assert process.wait() == 0
    assert info(tmp_path / 'bag').is_closed
    assert verify(tmp_path / 'bag').holds


@pytest.mark.parametrize('factor', [1.0, 0.0])
def test_a_run_of_a_given_duration_is_recorded_to_its_last_step(ros, tmp_path, scene, factor):
    process = simulate(tmp_path, scene, words=['--duration', '1.5', '--record',
                                               str(tmp_path / 'bag')], real_time_factor=factor)
    assert process.wait() == 0
    assert 'rigid_sim verify' in process.stderr
    verdict = verify(tmp_path / 'bag')
    assert (verdict.difference, verdict.note, verdict.steps) == (None, '', 1500)
    assert list(events_of(tmp_path / 'bag'))[-1].step == 1500


def test_the_bodies_without_topics_can_be_simulated_again_too(ros, tmp_path, scene):
    process = simulate(tmp_path, scene, words=['--duration', '0.3', '--record',
                                               str(tmp_path / 'bag')], bodies="['nobody']")
    assert process.wait() == 0
    assert verify(tmp_path / 'bag').holds


@pytest.mark.parametrize('place, expected', [
    ('exists', 'exists already'), ('file/bag', 'cannot be made'), ('disk/bag', 'cannot be made')])
def test_a_folder_on_the_command_line_that_cannot_be_used_is_one_line_and_code_2(
        ros, tmp_path, scene, place, expected):
    (tmp_path / 'exists').mkdir()
    (tmp_path / 'file').write_text('', encoding='utf-8')
    with mounted(tmp_path / 'disk') as disk:
        make_read_only(disk)
        process = simulate(tmp_path / 'log', scene, words=['--record', str(tmp_path / place)])
        assert process.wait() == 2
    line, = process.stderr.splitlines()
    assert line.startswith('rigid_sim: ')
    assert expected in line


def test_a_parameter_that_cannot_be_used_is_an_error_and_the_simulation_goes_on(
        probe, tmp_path, scene):
    with running(tmp_path, scene, name='unlucky', record=True, bag_path=tmp_path) as process:
        assert goes_on(probe, '/unlucky')
        process.signal(signal.SIGINT)
        # It ran, and yet it did not do all that was asked for.
        assert process.wait() == 1
        assert f'not recording: {tmp_path} exists already' in process.stderr


@pytest.mark.parametrize('parameters, expected', [
    ({'bag_storage': 'tape'}, "bag_storage: 'tape', must be mcap or sqlite3"),
    ({'bag_compression': 'lots'}, "bag_compression: 'lots', must be none or zstd"),
    ({'bag_segment_duration': -1.0}, 'bag_segment_duration')])
def test_a_bad_parameter_is_one_line_and_code_2(ros, tmp_path, scene, parameters, expected):
    process = simulate(tmp_path, scene, **parameters)
    assert process.wait() == 2
    line, = process.stderr.splitlines()
    assert expected in line


# --- disks ------------------------------------------------------------------------------------

def test_a_full_disk_ends_the_recording_and_not_the_simulation(probe, tmp_path):
    scene = free_bodies(tmp_path, 100)
    with mounted(tmp_path / 'disk') as disk:
        with running(tmp_path, str(scene), name='full', diagnostics_rate=20.0, record=True,
                     bag_path=disk / 'bag') as process:
            probe.wait_for(lambda: 'recording has ended' in process.stderr, 'a full disk')
            status, _ = recorder_status(probe, '/full', lambda status, _: status.level == b'\x02')
            assert 'No space left on device' in status.message
            assert goes_on(probe, '/full')
            answer = probe.trigger('/full/stop_recording')
            assert not answer.success
            assert 'No space left on device' in answer.message
            process.signal(signal.SIGINT)
            assert process.wait() == 1
        found = info(disk / 'bag')
        assert found.messages > 1000
        assert not found.is_closed
        assert verify(disk / 'bag').holds


def test_after_a_full_disk_another_one_can_be_recorded_to(probe, tmp_path):
    scene = free_bodies(tmp_path, 100)
    with mounted(tmp_path / 'disk') as disk, running(
            tmp_path, str(scene), name='again', record=True, bag_path=disk / 'bag') as process:
        probe.wait_for(lambda: 'recording has ended' in process.stderr, 'a full disk')
        assert probe.set_parameter('bag_path', str(tmp_path / 'bag'), '/again').successful
        assert probe.trigger('/again/start_recording').success
        assert goes_on(probe, '/again')
        assert probe.trigger('/again/stop_recording').success
        assert verify(tmp_path / 'bag').holds


# --- the command --------------------------------------------------------------------------------

def test_the_command_records_what_the_parameters_would(ros, tmp_path, scene):
    command = [sys.executable, '-m', 'rigid_sim_ros', 'run', scene, '--duration', '0.2',
               '--record', str(tmp_path / 'bag')]
    with kept(Process(command, tmp_path)) as process:
        assert process.wait() == 0
    assert verify(tmp_path / 'bag').steps == 200


def test_without_a_path_the_bag_is_named_after_node_and_time(ros, tmp_path, scene):
    begin = time.strftime('%Y_%m_%d')
    with kept(simulate(tmp_path / 'log', scene, name='nameless', folder=tmp_path,
                       words=['--duration', '0.1'], record=True)) as process:
        assert process.wait() == 0
    bag, = tmp_path.glob('nameless_*')
    assert bag.name.startswith(f'nameless_{begin[:7]}')
    assert verify(bag).holds
