# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What was taken out of a bag, renamed in it or put into it is missed, by all commands alike."""

from collections.abc import Callable
from pathlib import Path
import shutil
import sqlite3
import struct
import tempfile

from bag.sessions import forge, NODE, rewrite, session_of, shared_session, world
from effort import examples
from hypothesis import given, strategies as st
import pytest

from rigid_sim_ros.bag import events, topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.messages.codec import encode_string

POSE = f'{NODE}/crate/pose'


def far_away(topic: Topic, data: bytes) -> bytes:
    """Put the crate 1000 km away."""
    if topic.name != POSE:
        return data
    return data[:-56] + struct.pack('<7d', 1e6, 1e6, 1e6, 0.0, 0.0, 0.0, 1.0)


def listed(change: Callable[[Topic], Topic | None]) -> Callable[[Session], Session]:
    """Return what changes the list of topics of a session."""
    def describe(session: Session) -> Session:
        return session._replace(topics=tuple(
            new for topic in session.topics
            if (new := change(topic) if topic.name == POSE else topic) is not None))
    return describe


def renamed(name: str) -> Callable[[Topic], Topic]:
    return lambda topic: topic._replace(name=name) if topic.name == POSE else topic


STRING = 'std_msgs/msg/String'
FORGERIES = {
    'as it is': {},
    'renamed in the file': {'relabel': renamed(f'{NODE}/crate/nose')},
    'renamed in the file to elsewhere': {'relabel': renamed('/elsewhere/pose')},
    'renamed in both': {'relabel': renamed('/elsewhere/pose'),
                        'describe': listed(renamed('/elsewhere/pose'))},
    'of no kind': {'describe': listed(lambda topic: topic._replace(kind=''))},
    'of no kind and type': {'describe': listed(
        lambda topic: topic._replace(kind='', type=STRING))},
    'of no kind, and type in both': {
        'relabel': lambda topic: topic._replace(type=STRING) if topic.name == POSE else topic,
        'describe': listed(lambda topic: topic._replace(kind='', type=STRING))},
    'of another kind': {'describe': listed(lambda topic: topic._replace(kind=kinds.TWIST))},
    'of another body': {'describe': listed(lambda topic: topic._replace(body='ball'))},
    'of nobody': {'describe': listed(lambda topic: topic._replace(body='nobody'))},
    'not listed': {'describe': listed(lambda topic: None)},
    'not listed and elsewhere': {'describe': listed(lambda topic: None),
                                 'relabel': renamed('/elsewhere/pose')},
}


def refused_or_differs(bag: Path) -> bool:
    """Return whether `verify` does not let a bag pass."""
    try:
        return not verify(bag).holds
    except BagError as error:
        return str(error).isprintable()


@pytest.mark.parametrize('recount', [False, True])
@pytest.mark.parametrize('name', FORGERIES)
def test_poses_that_are_wrong_are_found_however_they_are_called(tmp_path, name, recount) -> None:
    assert refused_or_differs(forge(
        shared_session(), tmp_path, change=far_away, recount=recount, **FORGERIES[name]))


@pytest.mark.parametrize('name', FORGERIES)
def test_in_a_file_by_itself_they_are_found_or_told_of(tmp_path, name) -> None:
    bag = forge(shared_session(), tmp_path, change=far_away, recount=True, **FORGERIES[name])
    file, = bag.glob('*.mcap')
    # A body that was removed and came again says no more, so a topic may be silent in a part.
    assert refused_or_differs(file) or (
        name == 'renamed in the file to elsewhere' and verify(file).others == ('/elsewhere/pose',))


def test_what_is_written_anew_and_not_changed_holds(tmp_path) -> None:
    assert verify(forge(shared_session(), tmp_path, recount=True)).holds


def test_a_topic_that_is_listed_twice_is_told(tmp_path) -> None:
    def describe(session: Session) -> Session:
        return session._replace(topics=(
            *session.topics, Topic(POSE, STRING, '', '')))
    assert 'lists a topic twice' in str(verify(
        forge(shared_session(), tmp_path, describe=describe)).difference)


def changed_session(topic: Topic, data: bytes) -> bytes:
    return data.replace(b'"crate"', b'"crook"') if topic.kind == kinds.SESSION else data


def test_a_session_that_was_changed_is_refused(tmp_path) -> None:
    # Its length stays, its digest does not fit.
    bag = rewrite(shared_session(), tmp_path, changed_session)
    for command in (info, verify):
        with pytest.raises(BagError, match='was changed'):
            command(bag)


@pytest.mark.parametrize('kind', [kinds.POSE, kinds.TWIST, kinds.STATE, kinds.CLOCK,
                                  kinds.STATE_HASH, kinds.SNAPSHOT, kinds.STEP, kinds.EVENT])
@pytest.mark.parametrize('which', [0, 7, -1, None])
def test_a_message_that_was_taken_out_is_missed(tmp_path, kind, which) -> None:
    count = 0

    def change(topic: Topic, data: bytes) -> bytes | None:
        nonlocal count
        if topic.kind == kind and topic.body in ('', 'crate'):
            count += 1
            if which is None or count == (which + 1 if which >= 0 else total):
                return None
        return data

    names = {topic.name for topic in session_of(shared_session()).topics
             if topic.kind == kind and topic.body in ('', 'crate')}
    total = sum(info(shared_session()).topics[name][1] for name in names)
    if which is not None and which >= total:
        return
    bag = forge(shared_session(), tmp_path, change=change)
    if kind == kinds.EVENT and which in (-1, None):
        # Without its end it is a recording that was cut off, and says so.
        assert not verify(bag).holds or 'cut off' in verify(bag).note
    else:
        assert not verify(bag).holds


@pytest.mark.parametrize('number, lost', [(0, 0), (0, 3), (3, 3), (None, None), (None, 3)])
def test_a_gap_that_was_put_in_does_not_hide_what_follows(tmp_path, number, lost) -> None:
    is_done = False

    def change(topic: Topic, data: bytes) -> bytes | None:
        nonlocal is_done
        # The first event becomes the gap.
        if topic.kind == kinds.EVENT and not is_done:
            is_done = True
            return encode_string(Event(number, 313, events.GAP, {
                'since_step': 0, 'messages': lost, 'events': lost}).encode())
        return far_away(topic, data) if is_done else data

    verdict = verify(forge(shared_session(), tmp_path, change=change, recount=True))
    assert not verdict.holds
    if number is None:
        assert 'of which nobody knows how much' in verdict.difference.text


def test_a_bag_of_which_nothing_can_be_compared_does_not_hold(tmp_path) -> None:
    keeps = (kinds.SCENE, kinds.SESSION)
    bag = forge(shared_session(), tmp_path, recount=True,
                change=lambda topic, data: data if topic.kind in keeps else None)
    verdict = verify(bag)
    assert not verdict.holds
    assert 'nothing' in verdict.difference.text


def copy(tmp_path: Path, storage: str = 'mcap') -> Path:
    return Path(shutil.copytree(shared_session(storage), tmp_path / 'session'))


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
@pytest.mark.parametrize('which', [0, 1, -1])
@pytest.mark.parametrize('how', ['gone', 'empty'])
def test_a_file_that_is_lost_is_named(tmp_path, storage, which, how) -> None:
    bag = copy(tmp_path, storage)
    path = sorted(path for path in bag.iterdir() if path.suffix in ('.mcap', '.db3'))[which]
    if how == 'gone':
        path.unlink()
    else:
        path.write_bytes(b'')
    for command in (info, verify):
        with pytest.raises(BagError, match=path.name):
            command(bag)
    result = recover(bag)
    assert path.name in result.loss
    assert not result.is_whole
    assert path.name in info(bag).note
    assert recover(bag).is_whole
    verdict = verify(bag)
    assert verdict.difference is None
    # Behind the last file there is nothing that could be wrong, and no end.
    assert verdict.gaps == (0 if which == -1 else 1) or which == 0
    assert ('cut off' in verdict.note) == (which == -1)


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_file_that_was_taken_out_and_out_of_the_metadata_is_missed(tmp_path, storage) -> None:
    bag = copy(tmp_path, storage)
    path = sorted(path for path in bag.iterdir() if path.suffix in ('.mcap', '.db3'))[1]
    path.unlink()
    (bag / 'metadata.yaml').unlink()
    recover(bag)
    assert not verify(bag).holds


@examples(25)
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7),
       topic=st.sampled_from(sorted(topic.name for topic in session_of(
           shared_session()).topics)))
def test_fuzzed_names_of_topics_in_sqlite_are_missed(place, bit, topic) -> None:
    with tempfile.TemporaryDirectory() as folder:
        bag = copy(Path(folder), 'sqlite3')
        name = bytearray(topic.encode())
        name[int(place * len(name))] ^= 1 << bit
        path = sorted(bag.glob('*.db3'))[0]
        with sqlite3.connect(path) as database:
            database.execute('UPDATE topics SET name = CAST(? AS TEXT) WHERE name = ?',
                             (bytes(name), topic))
            database.commit()
        database.close()
        with pytest.raises(BagError):
            info(bag)
        assert refused_or_differs(bag)


def with_topic(folder: Path, name: str) -> Path:
    """Return a copy of the session with a message on a topic that it does not list."""
    bag = copy(folder, 'sqlite3')
    path = sorted(bag.glob('*.db3'))[0]
    with sqlite3.connect(path) as database:
        database.execute("INSERT INTO topics VALUES (99, ?, 'std_msgs/msg/String', 'cdr', '', '')",
                         (name,))
        database.execute(
            'INSERT INTO messages (topic_id, timestamp, data) SELECT 99, max(timestamp), ? '
            'FROM messages', (encode_string('click'),))
        database.commit()
    database.close()
    (bag / 'metadata.yaml').unlink()
    recover(bag)
    return bag


def test_a_topic_of_somebody_else_is_noted_and_harms_nothing(tmp_path) -> None:
    verdict = verify(with_topic(tmp_path, '/camera'))
    assert verdict.holds
    assert verdict.others == ('/camera',)


def test_a_topic_of_the_node_that_the_session_does_not_list_is_a_difference(tmp_path) -> None:
    verdict = verify(with_topic(tmp_path, f'{NODE}/camera'))
    assert not verdict.holds
    assert 'which the session does not list' in verdict.difference.text


def test_a_body_that_was_removed_says_no_more(tmp_path) -> None:
    batch = Batch(world(), tmp_path / 'bag')
    batch.run(100)
    batch.world.remove('ball')
    batch.run(100)
    batch.close()
    assert verify(tmp_path / 'bag').holds
