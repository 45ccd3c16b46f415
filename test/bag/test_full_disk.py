# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A disk that fills up ends the recording, and nothing else."""

from collections.abc import Iterator
from pathlib import Path

from bag.flushing import wait_until_flushed
from bag.sessions import world
from bag.small_disk import make_read_only, mounted, SIZE
import pytest
from rosbags.highlevel import AnyReader

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.verify import verify


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    with mounted(tmp_path / 'disk') as folder:
        yield folder


def fill(batch: Batch) -> str:
    """Record until the disk is full and return what is said then."""
    with pytest.raises(BagError) as failed:
        batch.run(10_000_000)
    return str(failed.value)


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_full_disk_ends_the_recording_with_one_clear_error(small_disk, storage) -> None:
    said = fill(Batch(world(), small_disk / 'bag', storage=storage))
    assert str(small_disk / 'bag') in said
    assert 'full' in said or 'No space left' in said
    assert said.endswith('what was written can be read')
    assert '\n' not in said


@pytest.mark.parametrize('storage, compression', [
    ('mcap', 'none'), ('mcap', 'zstd'), ('sqlite3', 'none')])
def test_what_was_written_on_a_full_disk_is_read_without_recovery(
        small_disk, storage, compression) -> None:
    fill(Batch(world(), small_disk / 'bag', storage=storage, compression=compression))
    with AnyReader([small_disk / 'bag']) as reader:
        size = sum(len(data) for _, _, data in reader.messages())
    # The rest of the disk is index, metadata, and the megabyte that did not fit any more.
    assert size > SIZE / 4
    assert verify(small_disk / 'bag').holds


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_disk_that_others_fill_to_the_last_byte_leaves_room_for_the_index(
        small_disk, storage, monkeypatch) -> None:
    batch = Batch(world(), small_disk / 'bag', storage=storage)
    batch.run(1000)
    wait_until_flushed(batch.recorder, monkeypatch)
    with (small_disk / 'ballast').open('wb', buffering=0) as ballast, pytest.raises(OSError):
        while True:
            ballast.write(bytes(512))
    assert fill(batch).endswith('what was written can be read')
    verdict = verify(small_disk / 'bag')
    assert verdict.holds
    assert verdict.steps >= 1000


def test_several_files_on_a_full_disk_can_be_read(small_disk) -> None:
    fill(Batch(world(), small_disk / 'bag', segment_bytes=500_000))
    assert len(list((small_disk / 'bag').glob('*.mcap'))) > 3
    assert verify(small_disk / 'bag').holds


def test_a_disk_that_is_full_already_is_refused_and_left_clean(small_disk) -> None:
    with pytest.raises(OSError, match='No space'):
        (small_disk / 'ballast').write_bytes(bytes(2 * SIZE))
    with pytest.raises(BagError, match='cannot be'):
        Recorder(small_disk / 'bag', world(), [])
    assert [path.name for path in small_disk.iterdir()] == ['ballast']


def test_a_folder_that_may_not_be_written_is_refused(small_disk) -> None:
    make_read_only(small_disk)
    with pytest.raises(BagError, match='Read-only file system'):
        Recorder(small_disk / 'bag', world(), [])
