# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `info` says of our bags, and of those of others."""

from itertools import pairwise
from pathlib import Path

from bag.sessions import messages_of, NODE, session, shared_session
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.topics import typestore
from rigid_sim_ros.messages.codec import encode_string


def test_topics_counts_duration_and_scene_are_told() -> None:
    bag = shared_session()
    found = info(bag)
    poses = len(messages_of(bag, kinds.POSE))
    assert found.topics[f'{NODE}/crate/pose'] == (kinds.TYPES[kinds.POSE], poses // 2)
    assert found.messages == sum(count for _, count in found.topics.values())
    # 3.514 s of steps, and a nanosecond for each of the messages that came at the end.
    assert (found.last_ns - found.first_ns) / 1e9 == pytest.approx(3.514, abs=1e-6)
    assert found.session.scene == 'scene'
    assert found.session.bodies == ('crate', 'ball')
    assert found.snapshots == found.files > 2
    assert found.happened['reset'] == 2
    assert found.gaps == ()
    assert found.is_closed


def foreign_bag(folder: Path, plugin: StoragePlugin, mode: CompressionMode) -> Path:
    """Write a bag as another program does, with times that lie crosswise on two topics."""
    writer = Writer(folder / 'foreign', version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        texts = [writer.add_connection(name, 'std_msgs/msg/String', typestore=typestore())
                 for name in ('/a', '/b')]
        for k in range(100):
            writer.write(texts[k % 2], 1_000_000_000 + k * 1000, encode_string(f'text {k}'))
    return folder / 'foreign'


@pytest.mark.parametrize('plugin, mode', [
    (StoragePlugin.MCAP, CompressionMode.NONE), (StoragePlugin.MCAP, CompressionMode.STORAGE),
    (StoragePlugin.MCAP, CompressionMode.MESSAGE), (StoragePlugin.SQLITE3, CompressionMode.NONE),
    (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    (StoragePlugin.SQLITE3, CompressionMode.FILE)])
def test_a_bag_of_another_program_is_shown(tmp_path, plugin, mode) -> None:
    found = info(foreign_bag(tmp_path, plugin, mode))
    assert found.topics == {'/a': ('std_msgs/msg/String', 50), '/b': ('std_msgs/msg/String', 50)}
    assert (found.last_ns - found.first_ns, found.session) == (99_000, None)


def test_a_single_file_is_shown() -> None:
    file = sorted(shared_session().glob('*.mcap'))[0]
    assert info(file).messages > 100


@pytest.mark.parametrize('name, words', [
    ('nothing', 'does not exist'), ('empty', 'is no bag'), ('text.txt', 'is no bag')])
def test_what_is_no_bag_is_an_error_that_says_so(tmp_path, name, words) -> None:
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'text.txt').write_text('hello')
    with pytest.raises(BagError, match=words):
        info(tmp_path / name)


def test_a_file_that_is_missing_is_named(tmp_path) -> None:
    bag = session(tmp_path)
    gone = sorted(bag.glob('*.mcap'))[1]
    gone.unlink()
    with pytest.raises(BagError, match=f'{gone.name} is missing'):
        info(bag)


def test_a_bag_that_was_not_closed_is_named_with_the_mend(tmp_path) -> None:
    bag = session(tmp_path)
    (bag / 'metadata.yaml').unlink()
    with pytest.raises(BagError, match=f'was not closed.*rigid_sim recover {bag}'):
        info(bag)


def test_the_files_follow_each_other_in_time() -> None:
    times = [(found.first_ns, found.last_ns) for found in map(
        info, sorted(shared_session().glob('*.mcap')))]
    assert all(before[1] < after[0] for before, after in pairwise(times))
