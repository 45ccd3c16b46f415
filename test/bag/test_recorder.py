# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is recorded is what was published, and any tool can read it."""

from collections.abc import Sequence
from itertools import pairwise, product
import json
import os
from pathlib import Path
import signal
import threading
import time

from bag.flushing import wait_until_flushed
from bag.sessions import (
    events_of, messages_of, NODE, shared_session, world)
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import pytest
from rosbags.highlevel import AnyReader

from rigid_sim_ros import __version__
from rigid_sim_ros.bag import mcap_file, recorder as recorder_module, topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.mcap_file import McapFile
from rigid_sim_ros.bag.outputs import Outputs, state_topics
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.bag.writer import BagWriter
from rigid_sim_ros.messages import decode
from rigid_sim_ros.world import World

KINDS = list(product(('mcap', 'sqlite3'), ('none', 'zstd')))


def published(the_world: World, steps: int) -> list[tuple[str, bytes]]:
    """Return what the topics of a world say at each of some steps."""
    outputs = Outputs(the_world, state_topics(NODE, the_world.names), 'world')
    said = []
    for _ in range(steps):
        said += [pair for kind in (kinds.CLOCK, kinds.POSE, kinds.TWIST, kinds.STATE)
                 for pair in outputs.encode(kind)]
        the_world.step()
    return said


def record(recorder: Recorder, the_world: World, said: list[tuple[str, bytes]]) -> None:
    for name, data in said:
        recorder.publish(the_world.step_index, [recorder.channel(name)], [data])


@pytest.mark.parametrize('storage, compression', KINDS)
def test_a_bag_holds_the_published_bytes_in_their_order(tmp_path, storage, compression) -> None:
    the_world = world()
    said = published(the_world, 50)
    recorder = Recorder(tmp_path / 'bag', the_world, state_topics(NODE, the_world.names),
                        storage=storage, compression=compression, waits=True)
    recorder.snapshot(the_world)
    record(recorder, the_world, said)
    recorder.close(the_world)
    names = {name for name, _ in said}
    with AnyReader([tmp_path / 'bag']) as reader:
        found = [(c.topic, bytes(data)) for c, _, data in reader.messages() if c.topic in names]
    assert found == said


@pytest.mark.parametrize('storage, compression', KINDS)
def test_rosbags_deserializes_every_message(storage, compression) -> None:
    bag = shared_session(storage, compression)
    with AnyReader([bag]) as reader:
        counts = [reader.deserialize(data, c.msgtype) is not None
                  for c, _, data in reader.messages()]
        assert len(counts) == reader.message_count > 1000


@pytest.mark.parametrize('compression', ['none', 'zstd'])
def test_the_mcap_library_decodes_every_message(compression) -> None:
    bag = shared_session('mcap', compression)
    for path in sorted(bag.glob('*.mcap')):
        with path.open('rb') as file:
            reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
            total = reader.get_summary().statistics.message_count
            decoded = [channel.topic for _, channel, _, _ in reader.iter_decoded_messages()]
            assert len(decoded) == total > 100


def test_times_alone_give_the_order_of_recording() -> None:
    with AnyReader([shared_session()]) as reader:
        times = [stamp for _, stamp, _ in reader.messages()]
    assert all(a < b for a, b in pairwise(times))


def test_a_bag_tells_scene_parameters_and_version() -> None:
    bag = shared_session()
    told = json.loads(decode.string(messages_of(bag, kinds.SESSION)[0][2]))
    assert told['software']['rigid_sim_ros'] == __version__
    assert told['parameters']['publish_rate'] == 100.0
    assert decode.string(messages_of(bag, kinds.SCENE)[0][2]) == world().scene.text


def test_the_scene_is_offered_to_late_subscribers() -> None:
    with AnyReader([shared_session()]) as reader:
        latched = {c.topic for c in reader.connections for qos in c.ext.offered_qos_profiles
                   if qos.durability.name == 'TRANSIENT_LOCAL'}
    assert latched == {f'{NODE}/scene', f'{NODE}/bag/session', f'{NODE}/bag/snapshot'}


def test_every_input_is_recorded_with_its_step_and_arguments() -> None:
    found = {event.kind: event for event in events_of(shared_session())}
    wrench = found['set_pose']
    assert (wrench.step, wrench.arguments['position']) == (813, [4.0, 1.0, 0.5])
    assert set(found) == {
        'apply_wrench', 'set_pose', 'cancel_wrenches', 'reset', 'pause', 'set_twist', 'step',
        'resume', 'speed', 'apply_impulse', 'written', 'end'}


def test_the_last_file_alone_leads_to_the_last_state() -> None:
    bag = shared_session()
    last = sorted(bag.glob('*.mcap'))[-1]
    messages = list(BagReader(last).messages())
    assert [name for name, _, _ in messages[:2]] == [f'{NODE}/scene', f'{NODE}/bag/session']
    the_world = world()
    the_world.restore(decode.byte_array(next(
        data for name, _, data in messages if name.endswith('/snapshot'))))
    end = list(events_of(bag))[-1]
    the_world.step(end.step - the_world.step_index)
    assert the_world.state_hash() == end.arguments['state_hash']


def test_a_file_that_grows_too_large_is_followed_by_another(tmp_path) -> None:
    batch = Batch(world(), tmp_path / 'bag', segment_bytes=20_000)
    batch.run(2000)
    batch.close()
    # 200 times, at 100 Hz, a clock, two poses, two twists and a state, of 1 kB in all.
    assert len(list((tmp_path / 'bag').glob('*.mcap'))) >= 8
    assert verify(tmp_path / 'bag').holds


def test_a_clock_that_goes_back_does_not_turn_the_order(tmp_path) -> None:
    the_world = world()
    times = iter([5_000_000_000 - 1000 * k for k in range(1000)])
    recorder = Recorder(tmp_path / 'bag', the_world, state_topics(NODE, the_world.names),
                        clock=lambda: next(times))
    said = published(the_world, 20)
    recorder.snapshot(the_world)
    record(recorder, the_world, said)
    recorder.close(the_world)
    names = {name for name, _ in said}
    with AnyReader([tmp_path / 'bag']) as reader:
        assert [(c.topic, data) for c, _, data in reader.messages() if c.topic in names] == said


class Stalled:
    """A disk that stands still until it is let go."""

    def __init__(self, monkeypatch) -> None:
        self._go = threading.Event()
        write = BagWriter.write

        def stalled(writer, *args) -> None:
            self._go.wait()
            write(writer, *args)
        monkeypatch.setattr(BagWriter, 'write', stalled)

    def release(self) -> None:
        self._go.set()


def stalled_recording(tmp_path, monkeypatch) -> tuple[Stalled, World, Recorder]:
    """Begin a recording onto a disk that stands still."""
    disk = Stalled(monkeypatch)
    the_world = world()
    recorder = Recorder(tmp_path / 'bag', the_world, state_topics(NODE, the_world.names))
    recorder.snapshot(the_world)
    return disk, the_world, recorder


def fill_queue(recorder: Recorder, the_world: World, events: int = 0) -> None:
    """Publish more than the queue takes."""
    channel = [recorder.channel(f'{NODE}/state')]
    outputs = Outputs(the_world, state_topics(NODE, the_world.names), 'world')
    for _ in range(100):
        (_, data), = outputs.encode(kinds.STATE)
        recorder.publish(the_world.step_index, channel, [data])
        the_world.step()
    for _ in range(events):
        the_world.set_twist('ball', (0, 0, 1), (0, 0, 0))
        recorder.event(the_world.step_index, 'set_twist', name='ball', linear=(0, 0, 1),
                       angular=(0, 0, 0))


@pytest.mark.parametrize('events', [0, 400])
def test_a_disk_that_stands_still_makes_a_gap_that_is_marked(
        tmp_path, monkeypatch, events) -> None:
    # 100 states of 600 bytes do not fit; 400 events of 200 do not even fit into twice the room.
    monkeypatch.setattr(recorder_module, 'REAL_TIME_QUEUE', 20_000)
    disk, the_world, recorder = stalled_recording(tmp_path, monkeypatch)
    fill_queue(recorder, the_world, events)
    lost = recorder.status()
    assert lost.lost_messages > 50
    assert (lost.lost_events > 0) == (events > 0)
    assert not recorder.wants_snapshot      # it would be lost again soon: the queue is full
    disk.release()
    recorder.wait_for_room()
    fill_queue(recorder, the_world)     # is lost as well, until a snapshot ends the gap
    assert recorder.wants_snapshot
    assert recorder.is_in_gap
    recorder.snapshot(the_world)
    assert not recorder.is_in_gap
    lost = recorder.status()
    recorder.close(the_world)
    gap = next(event for event in events_of(tmp_path / 'bag') if event.kind == 'gap')
    assert gap.arguments['messages'] == lost.lost_messages
    assert gap.arguments['events'] == lost.lost_events
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds
    assert verdict.gaps == (1 if events else 0)


def test_as_fast_as_possible_waits_for_the_disk_and_loses_nothing(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(recorder_module, 'WAITING_QUEUE', 20_000)
    disk = Stalled(monkeypatch)
    timer = threading.Timer(0.3, disk.release)
    timer.start()
    the_world = world()
    recorder = Recorder(tmp_path / 'bag', the_world, state_topics(NODE, the_world.names),
                        waits=True)
    recorder.snapshot(the_world)
    fill_queue(recorder, the_world)
    recorder.close(the_world)
    timer.join()
    assert len(messages_of(tmp_path / 'bag', kinds.STATE)) == 100


def test_a_reset_to_the_same_step_does_not_hide_the_steps_after_it(tmp_path) -> None:
    the_world = world()
    recorder = Recorder(tmp_path / 'bag', the_world, state_topics(NODE, the_world.names))
    recorder.snapshot(the_world)
    outputs = Outputs(the_world, state_topics(NODE, the_world.names), 'world')
    channel = [recorder.channel(f'{NODE}/state')]
    for _ in range(2):
        the_world.step(30)
        (_, data), = outputs.encode(kinds.STATE)
        recorder.publish(30, channel, [data])
        the_world.reset()
        recorder.event(30, 'reset')
    recorder.close(the_world)
    verdict = verify(tmp_path / 'bag')
    assert verdict.difference is None
    assert verdict.steps == 60


def test_a_recording_ends_without_waiting_for_a_disk_that_stands_still(
        tmp_path, monkeypatch) -> None:
    disk, the_world, recorder = stalled_recording(tmp_path, monkeypatch)
    fill_queue(recorder, the_world)
    recorder.end(the_world)
    assert recorder.status().queued_bytes > 0
    disk.release()
    recorder.wait()
    assert len(messages_of(tmp_path / 'bag', kinds.STATE)) == 100
    assert verify(tmp_path / 'bag').note == ''


def test_ctrl_c_while_it_waits_does_not_make_a_recording_look_ended(
        tmp_path, monkeypatch) -> None:
    disk, the_world, recorder = stalled_recording(tmp_path, monkeypatch)
    recorder.end(the_world)
    # As SIGINT does, which would end what other tests of this process have of ROS.
    before = signal.signal(signal.SIGUSR1, signal.default_int_handler)
    main = threading.get_ident()
    threading.Timer(0.2, signal.pthread_kill, (main, signal.SIGUSR1)).start()
    try:
        with pytest.raises(KeyboardInterrupt):
            recorder.wait()
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert not recorder.wait(0.0)
    disk.release()
    assert recorder.wait()
    assert verify(tmp_path / 'bag').note == ''


def test_a_path_that_exists_is_refused(tmp_path) -> None:
    with pytest.raises(BagError, match='exists already: choose another'):
        Recorder(tmp_path, world(), [])


def test_a_folder_that_cannot_be_made_is_refused(tmp_path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(BagError, match='cannot be made'):
        Recorder(tmp_path / 'file' / 'bag', world(), [])


def test_a_type_that_nobody_can_describe_is_refused_before_a_file_is_made(tmp_path) -> None:
    with pytest.raises(BagError, match='no_msgs/msg/None'):
        Recorder(tmp_path / 'bag', world(), [kinds.Topic('/x', 'no_msgs/msg/None')])
    assert not (tmp_path / 'bag').exists()


def test_a_write_that_fails_ends_the_recording_and_nothing_else(tmp_path, monkeypatch) -> None:
    told: list[str] = []
    batch = Batch(world(), tmp_path / 'bag', on_error=told.append)
    batch.run(500)
    wait_until_flushed(batch.recorder, monkeypatch)

    def fail(writer, *args) -> None:
        raise OSError(5, 'Input/output error')
    monkeypatch.setattr(BagWriter, 'write', fail)
    with pytest.raises(BagError, match='Input/output error'):
        while True:
            batch.run(10)
    step = batch.world.step_index
    batch.world.step(10)
    assert batch.world.step_index == step + 10
    assert told == [batch.recorder.error]
    verdict = verify(tmp_path / 'bag')
    assert verdict.holds
    assert (verdict.steps, verdict.note) == (500, 'the recording was cut off')


@pytest.mark.parametrize('compression', ['none', 'zstd'])
def test_a_system_that_takes_a_little_at_a_time_gets_everything(
        tmp_path, monkeypatch, compression) -> None:
    def write(name: str) -> bytes:
        topic = kinds.topic(kinds.STATE, 'somebody')
        file = McapFile(tmp_path / name, [topic], compressed=compression == 'zstd')
        for k in range(2000):       # more pieces than one call takes
            file.write([1], 1 + k, [b'%d' % k * (k % 50)])
        file.close()
        return (tmp_path / name).read_bytes()

    def write_some(handle: int, parts: Sequence[bytes]) -> int:
        assert len(parts) <= os.sysconf('SC_IOV_MAX')
        return os.write(handle, b''.join(parts)[:1000])

    whole = write('whole.mcap')
    monkeypatch.setattr(mcap_file.os, 'writev', write_some)
    assert write('pieces.mcap') == whole


def test_recording_leaves_the_simulation_as_it_is(tmp_path) -> None:
    alone, recorded = world(), world()
    alone.step(600)
    batch = Batch(recorded, tmp_path / 'bag')
    batch.run(600)
    batch.close()
    assert recorded.state_hash() == alone.state_hash()


def test_no_metadata_are_ever_half_written(tmp_path) -> None:
    batch = Batch(world(), tmp_path / 'bag', segment_bytes=10_000)
    path = Path(tmp_path / 'bag' / 'metadata.yaml')
    seen = set()
    for _ in range(60):
        batch.run(50)
        while batch.recorder.status().queued_bytes:
            time.sleep(0.001)
        if path.exists():
            text = path.read_text()
            seen.add(text)
            assert text.endswith('ros_distro: "jazzy"\n')
    batch.close()
    assert len(seen) > 1
