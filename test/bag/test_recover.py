# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is whole comes back, what is lost is said, and nothing is made up."""

from functools import cache
from pathlib import Path
import shutil
import sqlite3

from bag.sessions import events_of, lasting_folder, session, shared_session, world
from effort import examples
from hypothesis import given, HealthCheck, strategies as st
from mcap.opcode import Opcode
import pytest
from rosbags.highlevel import AnyReader

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.verify import verify


def copy(bag: Path, folder: Path) -> Path:
    """Return a copy of a bag that may be spoiled."""
    target = folder / 'copy'
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(bag, target)
    return target


def files_of(bag: Path) -> list[Path]:
    return sorted(path for path in bag.iterdir() if path.suffix in ('.mcap', '.db3'))


@cache
def long_files() -> Path:
    """Return two files of several chunks, with a snapshot at the start of each."""
    bag = lasting_folder() / 'long'
    batch = Batch(world(), bag, publish_rate=1000.0, segment_s=3.0)
    for k in range(10):
        batch.run(500)
        batch.tell('set_twist', name='ball', linear=(0, 0, k), angular=(0, 0, 0))
    batch.close()
    return bag


def inside_a_chunk(path: Path) -> int:
    """
    Return the offset of a byte among the messages, about in the middle of a file.

    Not of any byte there: an eighth of a file is index, and where chunks end depends on how fast
    they were written.
    """
    scan = McapScan(path)
    try:
        chunks = [(record.offset + record.end) // 2 for record in scan.records()
                  if record.opcode == Opcode.CHUNK]
    finally:
        scan.close()
    return min(chunks, key=lambda at: abs(at - path.stat().st_size // 2))


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_whole_bag_stays_as_it_is(tmp_path, storage) -> None:
    bag = copy(shared_session(storage), tmp_path)
    before = {path.name: path.read_bytes() for path in files_of(bag)}
    assert recover(bag).is_whole
    assert {path.name: path.read_bytes() for path in files_of(bag)} == before
    assert verify(bag).holds


def test_metadata_that_are_lost_are_made_anew(tmp_path) -> None:
    bag = copy(shared_session(), tmp_path)
    expected = info(bag)
    (bag / 'metadata.yaml').unlink()
    recover(bag)
    assert info(bag) == expected


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_what_a_kill_left_half_written_goes(tmp_path, storage) -> None:
    bag = copy(shared_session(storage), tmp_path)
    before = {path.name: path.read_bytes() for path in bag.iterdir()}
    (bag / '.metadata.yaml.part').write_text('rosbag2_bagf')
    (bag / f'{files_of(bag)[0].name}.part').write_bytes(b'\x89MCAP')
    recover(bag)
    assert {path.name: path.read_bytes() for path in bag.iterdir()} == before


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
@pytest.mark.parametrize('text', ['', '\0' * 400, 'rosbag2_bagfile_information: [', '- {a: 1}'])
def test_metadata_that_are_damaged_are_made_anew(tmp_path, storage, text) -> None:
    bag = copy(shared_session(storage), tmp_path)
    expected = info(bag)
    (bag / 'metadata.yaml').write_text(text)
    with pytest.raises(BagError, match='rigid_sim recover'):
        info(bag)
    recover(bag)
    assert info(bag) == expected


@examples(15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1))
def test_a_file_that_breaks_off_keeps_all_whole_chunks(tmp_path, share) -> None:
    bag = copy(shared_session(), tmp_path)
    everything = list(BagReader(bag).messages())
    last = files_of(bag)[-1]
    raw = last.read_bytes()
    last.write_bytes(raw[:int(share * len(raw))])
    result = recover(bag)
    kept = list(BagReader(bag).messages())
    assert kept == everything[:len(kept)]
    assert result.messages == len(kept)
    assert result.lost_bytes <= share * len(raw)
    assert verify(bag).difference is None


def test_a_damaged_chunk_in_the_middle_costs_only_itself(tmp_path) -> None:
    bag = copy(long_files(), tmp_path)
    total = info(bag).messages
    first = files_of(bag)[0]
    raw = bytearray(first.read_bytes())
    raw[inside_a_chunk(first)] ^= 1
    first.write_bytes(raw)
    result = recover(bag)
    assert (result.lost_places, len(result.kept_aside)) == (1, 1)
    assert result.loss.endswith(f'; {result.lost_bytes} bytes in 1 place')
    assert result._replace(lost_places=2).loss.endswith(' bytes in 2 places')
    assert (bag / result.kept_aside[0]).read_bytes() == raw
    # A chunk is 1 MB and a message 100 bytes: the chunk holds some 8000.
    assert total - 12_000 < result.messages < total
    assert [event.kind for event in events_of(bag)].count('gap') == 1
    verdict = verify(bag)
    assert (verdict.difference, verdict.gaps) == (None, 1)


def test_zeros_in_the_middle_cost_only_what_they_cover(tmp_path) -> None:
    bag = copy(long_files(), tmp_path)
    total = info(bag).messages
    first = files_of(bag)[0]
    raw = bytearray(first.read_bytes())
    middle = inside_a_chunk(first)
    raw[middle:middle + 4096] = bytes(4096)
    first.write_bytes(raw)
    result = recover(bag)
    assert total - 24_000 < result.messages < total
    assert verify(bag).difference is None
    with AnyReader([bag]) as reader:
        assert reader.message_count == result.messages


def test_a_file_that_lost_its_beginning_borrows_the_topics_of_its_neighbours(tmp_path) -> None:
    bag = copy(long_files(), tmp_path)
    second = files_of(bag)[1]
    raw = bytearray(second.read_bytes())
    raw[:512] = bytes(512)
    second.write_bytes(raw)
    result = recover(bag)
    assert second.name in result.rewritten
    assert verify(bag).difference is None


def test_a_recording_that_lost_its_beginning_is_verified_from_the_next_file_on(tmp_path) -> None:
    """What tells of the session stands in the first chunk, and again at the start of each file."""
    bag = copy(long_files(), tmp_path)
    path = files_of(bag)[0]
    scan = McapScan(path)
    end = next(record.end for record in scan.records() if record.opcode == Opcode.CHUNK)
    scan.close()
    raw = path.read_bytes()
    path.write_bytes(bytes(end) + raw[end:])
    assert recover(bag).lost_places == 1
    verdict = verify(bag)
    assert verdict.holds and verdict.messages > 0
    assert info(bag).messages > verdict.messages    # of the first file some are there, unverified


@pytest.mark.parametrize('whole_files', [0, 2])
def test_a_topic_whose_name_was_damaged_gets_it_back(tmp_path, whole_files) -> None:
    # From the neighbours, or, in a single file, from the index at its end.
    bag = copy(shared_session(), tmp_path)
    for path in files_of(bag)[1 + whole_files:]:
        path.unlink()
    recover_metadata = recover(bag)
    spoiled = files_of(bag)[-1]
    raw = spoiled.read_bytes()
    spoiled.write_bytes(raw.replace(b'/rigid_sim/crate/pose', b'/rigid_sim/crate/nose', 1))
    recover(bag)
    found = info(bag)
    assert found.messages == recover_metadata.messages
    assert '/rigid_sim/crate/nose' not in found.topics
    assert verify(bag).difference is None


def test_a_bag_that_is_being_recorded_is_left_alone(tmp_path) -> None:
    batch = Batch(world(), tmp_path / 'bag')
    with pytest.raises(BagError, match='is being recorded'):
        recover(tmp_path / 'bag')
    batch.run(100)
    batch.close()
    assert verify(tmp_path / 'bag').holds


def test_recovering_twice_changes_nothing_more(tmp_path) -> None:
    bag = session(tmp_path)
    last = files_of(bag)[-1]
    last.write_bytes(last.read_bytes()[:-5000])
    recover(bag)
    before = last.read_bytes()
    assert recover(bag).is_whole
    assert last.read_bytes() == before


@pytest.mark.parametrize('content', [b'', b'hello', bytes(5000)])
def test_a_bag_of_which_nothing_is_left_is_an_error(tmp_path, content) -> None:
    (tmp_path / 'bag_0.mcap').write_bytes(content)
    with pytest.raises(BagError, match='no message can be read'):
        recover(tmp_path)
    assert (tmp_path / 'bag_0.mcap').read_bytes() == content


def test_a_folder_that_is_no_bag_is_an_error_and_left_clean(tmp_path) -> None:
    with pytest.raises(BagError, match='is no bag'):
        recover(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_event_that_was_changed_is_no_more_whole_for_recover_than_for_info(tmp_path) -> None:
    bag = copy(shared_session('sqlite3'), tmp_path)
    path = files_of(bag)[0]
    with sqlite3.connect(path) as database:
        (row, data), = database.execute(
            'SELECT messages.id, data FROM messages JOIN topics ON topics.id = topic_id WHERE '
            "name LIKE '%/bag/event' ORDER BY messages.id LIMIT 1")
        database.execute('UPDATE messages SET data = ? WHERE id = ?',
                         (data.replace(b'"number": 0', b'"number": 9'), row))
        database.commit()
    database.close()
    with pytest.raises(Damaged, match='digest'):
        info(bag)
    result = recover(bag)
    assert result.rewritten == (path.name,)
    assert result.lost_places == 1
    assert info(bag).gaps
    verdict = verify(bag)
    assert verdict.holds
    assert verdict.gaps == 1
    assert verdict.skipped > 0      # up to the next full state


def test_an_index_that_leads_elsewhere_is_noticed_and_made_anew(tmp_path) -> None:
    bag = copy(shared_session('sqlite3'), tmp_path)
    path, count = files_of(bag)[0], info(bag).messages
    with sqlite3.connect(path) as database:
        database.execute('PRAGMA writable_schema = ON')
        database.execute('CREATE INDEX other ON messages (topic_id)')
        # Each of the two indices holds the entries of the other one.
        database.execute('UPDATE sqlite_master SET rootpage = (SELECT sum(rootpage) FROM '
                         "sqlite_master WHERE name IN ('timestamp_idx', 'other')) - rootpage "
                         "WHERE name IN ('timestamp_idx', 'other')")
        database.commit()
    database.close()
    for command in (info, verify):
        with pytest.raises(Damaged, match='damaged'):
            command(bag)
    assert recover(bag).rewritten == (path.name,)
    assert info(bag).messages == count
    assert verify(bag).holds
