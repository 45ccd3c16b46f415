# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading a bag from any time on: as playing it needs."""

from collections import defaultdict
from operator import itemgetter
from pathlib import Path
import shutil
import sqlite3
import tempfile

from bag.damage import damages, spoil
from bag.foreign import (
    BEST_EFFORT, LATCHED, LATCHED_TEXTS, LAYOUTS, mcap, rosbag2, texts)
from bag.sessions import shared_session
from effort import examples
from hypothesis import given, strategies as st
import pytest
from ruamel.yaml import YAML

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.playable_files import Message
from rigid_sim_ros.bag.playback import PlayableBag
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.messages.codec import encode_string

SECOND = 10 ** 9
STORAGES = [(storage, mode) for storage in ('mcap', 'sqlite3') for mode in ('none', 'zstd')]
MODES = [('mcap', 'NONE'), ('mcap', 'STORAGE'), ('mcap', 'FILE'), ('mcap', 'MESSAGE'),
         ('sqlite3', 'NONE'), ('sqlite3', 'FILE'), ('sqlite3', 'MESSAGE')]


def played(bag: PlayableBag, start_ns: int = 0, names: set[str] | None = None) -> list[Message]:
    return [message for _, group in bag.messages(start_ns, names or set(bag.topics))
            for message in group]


def in_order(path: Path) -> list[Message]:
    return [(stamp, name, data) for name, stamp, data in BagReader(path).messages()]


def latched_by_hand(messages: list[Message], until_ns: int, kept: dict[str, int]) -> list[Message]:
    by_name = defaultdict(list)
    for message in sorted(messages, key=itemgetter(0)):
        if message[0] <= until_ns:
            by_name[message[1]].append(message)
    return sorted((m for name, count in kept.items() for m in by_name[name][-count:]),
                  key=itemgetter(0))


@pytest.mark.parametrize('storage, mode', STORAGES)
def test_a_recording_is_played_as_it_was_recorded(storage: str, mode: str) -> None:
    path = shared_session(storage, mode)
    assert played(PlayableBag(path)) == in_order(path)


@examples(30)
@given(start=st.floats(0, 1), chosen=st.sets(st.sampled_from(
    ['/rigid_sim/state', '/rigid_sim/ball/pose', '/clock', '/rigid_sim/bag/event']), min_size=1),
    storage=st.sampled_from(['mcap', 'sqlite3']))
def test_reading_may_begin_anywhere_with_any_topics(start, chosen, storage) -> None:
    path = shared_session(storage)
    bag = PlayableBag(path)
    start_ns = bag.first_ns + round(start * (bag.last_ns - bag.first_ns))
    assert played(bag, start_ns, chosen) == [
        each for each in in_order(path) if each[0] >= start_ns and each[1] in chosen]


@examples(30)
@given(at=st.floats(0, 1), storage=st.sampled_from(['mcap', 'sqlite3']))
def test_what_is_latched_is_the_last_of_each_latched_topic(at, storage) -> None:
    path = shared_session(storage)
    bag = PlayableBag(path)
    until_ns = bag.first_ns + round(at * (bag.last_ns - bag.first_ns))
    names = ['/rigid_sim/scene', '/rigid_sim/bag/session', '/rigid_sim/bag/snapshot']
    assert bag.latched(until_ns, set(bag.topics)) == latched_by_hand(
        in_order(path), until_ns, dict.fromkeys(names, 1))


stamps = st.lists(
    st.tuples(st.integers(1, 60), st.sampled_from(['/a', '/b', '/map', '/tf_static'])),
    min_size=1, max_size=60)


@examples(60)
@given(drawn=stamps, until=st.integers(0, 61), layout=st.sampled_from(sorted(LAYOUTS)),
       depth=st.integers(1, 4))
def test_messages_and_latched_ones_are_right_whatever_the_order_in_the_file(
        drawn, until, layout, depth) -> None:
    messages = [(stamp, name, encode_string(str(k))) for k, (stamp, name) in enumerate(drawn)]
    with tempfile.TemporaryDirectory() as folder:
        path = mcap(Path(folder, 'a.mcap'), messages, chunk_size=200, latched={
            '/map': LATCHED_TEXTS[0],
            '/tf_static': LATCHED_TEXTS[1].replace('depth: 1', f'depth: {depth}'),
        }, **LAYOUTS[layout])
        bag = PlayableBag(path)
        found = played(bag, until)
        kept = {'/map': 1, '/tf_static': depth}
        latched = bag.latched(until, set(bag.topics))
    wanted = [each for each in messages if each[0] >= until]
    assert found == sorted(wanted, key=itemgetter(0))
    # Of one time any order of topics will do.
    by_hand = latched_by_hand(messages, until, kept)
    assert sorted(each[:2] for each in latched) == sorted(each[:2] for each in by_hand)
    assert [each[0] for each in latched] == [each[0] for each in by_hand]


@pytest.mark.parametrize('layout', LAYOUTS)
def test_an_mcap_file_of_any_layout_is_played(tmp_path, layout) -> None:
    messages = sorted(texts('/a', 300, 10) + texts('/b', 100, 30), key=itemgetter(0))
    path = mcap(tmp_path / 'a.mcap', messages, chunk_size=2000, **LAYOUTS[layout])
    assert played(PlayableBag(path)) == messages


@pytest.mark.parametrize('storage, mode', MODES)
def test_a_bag_of_rosbag2_is_played(tmp_path, storage, mode) -> None:
    messages = sorted(texts('/a', 300, 10) + texts('/b', 100, 30), key=itemgetter(0))
    path = rosbag2(tmp_path / 'bag', messages, storage=storage, mode=mode,
                   qos={'/a': [LATCHED], '/b': [BEST_EFFORT]})
    bag = PlayableBag(path)
    assert played(bag) == messages
    assert bag.latched(10 ** 9 + 55, {'/a', '/b'}) == [messages[7]]
    assert bag.qos['/b'].reliability == 'best_effort'


@pytest.mark.parametrize('version', [8, 9])
def test_the_qos_of_both_versions_of_the_metadata_is_understood(tmp_path, version) -> None:
    path = rosbag2(tmp_path / 'bag', texts('/a', 1, 1), version=version, qos={'/a': [LATCHED]})
    qos = PlayableBag(path).qos['/a']
    assert (qos.reliability, qos.durability, qos.kept) == ('reliable', 'transient_local', 1)


@pytest.mark.parametrize('text', LATCHED_TEXTS)
def test_the_qos_in_an_mcap_file_is_understood(tmp_path, text) -> None:
    path = mcap(tmp_path / 'a.mcap', texts('/a', 1, 1), latched={'/a': text})
    qos = PlayableBag(path).qos['/a']
    assert (qos.reliability, qos.durability, qos.kept) == ('reliable', 'transient_local', 1)


def test_several_publishers_of_a_latched_topic_keep_a_message_each(tmp_path) -> None:
    messages = texts('/tf_static', 5, 10)
    path = rosbag2(tmp_path / 'bag', messages, qos={'/tf_static': [LATCHED] * 3})
    assert PlayableBag(path).latched(2 * SECOND, {'/tf_static'}) == messages[2:]


def test_publishers_that_differ_are_stood_in_for_by_the_one_whom_all_can_hear(tmp_path) -> None:
    path = rosbag2(tmp_path / 'bag', texts('/a', 1, 1), qos={'/a': [BEST_EFFORT, LATCHED]})
    qos = PlayableBag(path).qos['/a']
    assert (qos.reliability, qos.durability) == ('reliable', 'transient_local')


def test_a_qos_that_makes_no_sense_is_noted_and_does_not_stop_anything(tmp_path) -> None:
    path = mcap(tmp_path / 'a.mcap', texts('/a', 3, 1), latched={'/a': '{]'})
    bag = PlayableBag(path)
    assert len(played(bag)) == 3
    assert len(bag.notes) == 1 and '/a' in bag.notes[0]


def test_a_bag_without_messages_lasts_no_time(tmp_path) -> None:
    bag = PlayableBag(mcap(tmp_path / 'a.mcap', []))
    assert (bag.first_ns, bag.last_ns, played(bag)) == (0, 0, [])


def test_the_topic_that_marks_steps_is_found_in_own_recordings_only(tmp_path) -> None:
    assert PlayableBag(shared_session()).step_topic == '/rigid_sim/bag/step'
    path = mcap(tmp_path / 'a.mcap', texts('/bag/step', 1, 1))
    assert PlayableBag(path).step_topic == ''


def test_a_time_with_a_wrong_bit_is_found_by_the_metadata(tmp_path) -> None:
    path = rosbag2(tmp_path / 'bag', texts('/a', 10, SECOND), storage='sqlite3')
    file, = path.glob('*.db3')
    with sqlite3.connect(file) as database:
        database.execute('UPDATE messages SET timestamp = timestamp + (1 << 50) WHERE id = 5')
    database.close()
    with pytest.raises(BagError, match=r'metadata.yaml tells of 9 s, the files hold 1\.12'):
        PlayableBag(path)


def test_a_file_that_breaks_off_is_refused_with_the_mend(tmp_path) -> None:
    path = shutil.copytree(shared_session(), tmp_path / 'bag')
    file = sorted(path.glob('*.mcap'))[-1]
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(BagError, match=r'breaks off.*rigid_sim recover'):
        PlayableBag(path)


def test_a_chunk_that_was_changed_is_noticed_where_it_is_reached(tmp_path) -> None:
    messages = texts('/a', 300, 10)
    path = mcap(tmp_path / 'a.mcap', messages, chunk_size=2000)
    data = bytearray(path.read_bytes())
    data[data.index(b'/a 250')] ^= 1
    path.write_bytes(data)
    found = []
    with pytest.raises(BagError, match='checksum'):
        for _, group in PlayableBag(path).messages(0, {'/a'}):
            found += group
    assert found == messages[:len(found)]
    assert 100 < len(found) < 250


def test_metadata_that_are_older_than_their_lists_of_files_do_for_packed_files(tmp_path) -> None:
    messages = texts('/a', 30, 10)
    path = rosbag2(tmp_path / 'bag', messages, storage='sqlite3', mode='FILE')
    yaml = YAML(typ='safe', pure=True)
    metadata = yaml.load(path / 'metadata.yaml')
    del metadata['rosbag2_bagfile_information']['files']
    yaml.dump(metadata, path / 'metadata.yaml')
    assert played(PlayableBag(path)) == messages


def check(storage: str, mode: str, suffix: str, damage, strict: bool) -> None:
    """Play a damaged bag: what is played is what was recorded, or a BagError ends it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'bag')
        shutil.copytree(shared_session(storage, mode), path)
        spoil(path, suffix, damage)
        recorded, found = in_order(shared_session(storage, mode)), []
        try:
            bag = PlayableBag(path)
            bag.latched(bag.last_ns, set(bag.topics))
            for _, group in bag.messages(0, set(bag.topics)):
                found += group
        except BagError as error:
            assert '\n' not in str(error)
            recorded = recorded[:len(found)]
        assert found == recorded or not strict


@pytest.mark.parametrize('mode', ['none', 'zstd'])
@examples(60)
@given(damage=damages)
def test_no_change_of_an_mcap_file_is_played(mode, damage) -> None:
    check('mcap', mode, '.mcap', damage, strict=True)


@pytest.mark.parametrize('mode', ['none', 'zstd'])
@examples(25)
@given(damage=damages)
def test_a_changed_sqlite_file_is_played_or_refused(mode, damage) -> None:
    check('sqlite3', mode, '.db3', damage, strict=False)


@examples(30)
@given(damage=damages)
def test_with_changed_metadata_a_bag_is_played_or_refused(damage) -> None:
    check('mcap', 'none', 'metadata.yaml', damage, strict=False)
