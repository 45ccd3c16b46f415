# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Sessions whose inputs and steps somebody changed, with all digests and counts made to fit.

Whoever follows one, to compare, to go on from it or for its contact forces, says in one line what
cannot be, soon, or follows it.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
import tempfile
from typing import Any

from bag.hostile import limited_time
from bag.sessions import forge, lasting_folder
from effort import examples
from hypothesis import given, strategies as st
import pytest

from rigid_sim_ros.bag import events, topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.resume import find
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.messages import decode
from rigid_sim_ros.messages.codec import encode_string, encode_uint64
from rigid_sim_ros.plots.command import make_diagram
from rigid_sim_ros.world import World

SCENE: dict[str, Any] = {
    'format': 1, 'world': {'step': 0.005},
    'bodies': [
        {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}},
        {'name': 'crate', 'mass': 2.0, 'shape': {'type': 'box', 'size': [1, 1, 1]},
         'pose': {'position': [0, 0, 0.5]}, 'frames': {'handle': {'position': [0.5, 0, 0]}}},
        {'name': 'rod', 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.1, 0.1, 1]},
         'pose': {'position': [6, 0, 2]}}],
    'joints': [{'name': 'hinge', 'type': 'revolute', 'parent': 'world', 'child': 'rod',
                'axis': [0, 1, 0], 'pose': {'position': [6, 0, 2.5]},
                'drive': {'mode': 'position', 'stiffness': 5.0}}]}
NEWCOMER = {'name': 'newcomer', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
            'pose': {'position': [0, 4, 3]}}
# One input of each kind, in an order in which all of them are taken.
INPUTS: list[tuple[str, dict[str, Any]]] = [
    ('apply_wrench', {'name': 'crate', 'force': [1.0, 2.0, 3.0], 'torque': [0.0, 0.5, 0.0],
                      'frame': 'crate/handle', 'duration': 0.4, 'source': 'hand'}),
    ('add', {'part': NEWCOMER}),
    ('set_pose', {'name': 'crate', 'position': [0.0, 1.0, 0.5],
                  'orientation': [0.6, 0.0, 0.0, 0.8]}),
    ('set_twist', {'name': 'crate', 'linear': [0.0, 0.0, 1.0], 'angular': [1.0, 2.0, 3.0]}),
    ('set_joint_state', {'name': 'hinge', 'position': 0.3, 'velocity': 0.1}),
    ('set_joint_command', {'name': 'hinge', 'position': 0.1}),
    ('follow_trajectory', {'names': ['hinge'], 'times': [0.1, 0.2],
                           'positions': [[0.1], [0.2]]}),
    ('cancel_wrenches', {'source': 'hand'}),
    ('remove', {'name': 'newcomer'}),
    ('apply_impulse', {'name': 'crate', 'impulse': [0.1, 0.2, 0.3]}),
    ('reset', {'keep_time': True})]


def goes_on(bag: Path) -> None:
    moment = find(bag, 0.4)
    moment.apply(World(moment.scene))


# Whoever steps a world through a session.
FOLLOWERS: dict[str, Callable[[Path], Any]] = {
    'verify': verify, 'resume': goes_on,
    'plot': lambda bag: make_diagram(str(bag), (), (), 0.0, None)}


@cache
def recorded() -> Path:
    """Return a session in which a body lies on the ground, one hangs, and all is done to them."""
    bag = lasting_folder() / 'session'
    batch = Batch(World.from_dict(SCENE), bag, publish_rate=50.0)
    for kind, arguments in INPUTS:
        batch.run(10)
        batch.tell(kind, **arguments)
    batch.run(10)
    batch.close()
    return bag


def forged(folder: Path, change: Callable[[Topic, bytes], bytes | None]) -> Path:
    return forge(recorded(), folder, change=change, recount=True)


def with_event(folder: Path, number: int, change: Callable[[Event], Event]) -> Path:
    """Return the session with one of its events changed."""
    def changed(topic: Topic, data: bytes) -> bytes:
        if topic.kind == kinds.EVENT and (
                event := events.decode(decode.string(data))).number == number:
            return encode_string(change(event).encode())
        return data
    return forged(folder, changed)


def with_step(folder: Path, place: int, change: Callable[[int], int]) -> Path:
    """Return the session with one of the numbers on ~/bag/step changed."""
    seen = 0

    def changed(topic: Topic, data: bytes) -> bytes:
        nonlocal seen
        if topic.kind == kinds.STEP:
            seen += 1
            if seen == place:
                return encode_uint64(change(decode.uint64(data)))
        return data
    return forged(folder, changed)


def follow(name: str, bag: Path) -> None:
    """Follow a session, or be told in one line that it cannot be."""
    try:
        with limited_time():
            FOLLOWERS[name](bag)
    except BagError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 1000


def test_each_follows_what_was_not_changed(tmp_path) -> None:
    bag = forged(tmp_path, lambda topic, data: data)
    assert verify(bag).holds
    goes_on(bag)
    _, notes = make_diagram(str(bag), (), (), 0.0, None)
    assert not any('contact' in note for note in notes)


@pytest.mark.parametrize('follower', FOLLOWERS)
@pytest.mark.parametrize('step', [10 ** 9, 2 ** 62, 2 ** 63 - 1])
def test_a_step_far_ahead_is_not_worth_years(tmp_path, follower, step) -> None:
    follow(follower, with_step(tmp_path, 30, lambda _: step))


@pytest.mark.parametrize('follower', FOLLOWERS)
@pytest.mark.parametrize('step', [10 ** 9, 2 ** 62, 2 ** 63 - 1])
def test_an_input_far_ahead_is_not_worth_years(tmp_path, follower, step) -> None:
    follow(follower, with_event(tmp_path, 2, lambda event: event._replace(step=step)))


@pytest.mark.parametrize('follower', FOLLOWERS)
def test_a_step_that_goes_back_is_no_reset(tmp_path, follower) -> None:
    bag = with_step(tmp_path, 30, lambda step: step - 20)
    if follower == 'verify':
        difference = verify(bag).difference
        assert difference is not None
        assert 'goes back' in difference.text
    elif follower == 'resume':
        with pytest.raises(BagError, match='goes back'):
            goes_on(bag)
    else:
        follow(follower, bag)


@pytest.mark.parametrize('name', ['crate', 'rod', 'hinge'])
def test_what_goes_on_after_a_forged_end_of_it_is_a_difference(tmp_path, name):
    number = next(k for k, (kind, _) in enumerate(INPUTS) if kind == 'remove')
    bag = with_event(tmp_path, number, lambda event: event._replace(arguments={'name': name}))
    assert verify(bag).difference is not None


ODD = st.sampled_from([
    None, True, -1, 0, 7, 2 ** 31, 2 ** 63 - 1, 2 ** 64, 10 ** 400, 1e308, -1e308, 5e-324,
    float('nan'), float('inf'), '', 'x', 'crate', 'ground', 'world', 'hinge', 'a\nb', '\x1b[2J',
    [], [[]], [1], [1, 2, 3], [1e308] * 3, [0, 0, 0, 0], [None] * 3, ['a'] * 3, {},
    {'name': 'crate'}, NEWCOMER | {'mass': 1e-320},
    NEWCOMER | {'shape': {'type': 'mesh', 'file': '/etc/passwd'}}])


def changed_within(value: Any, draw: Callable[[Any], Any]) -> Any:
    """Return a value of JSON with one odd thing somewhere in it."""
    inner = sorted(value) if isinstance(value, dict) else (
        range(len(value)) if isinstance(value, list) else ())
    if not inner or draw(st.integers(0, 3)) == 0:
        return draw(ODD)
    place = draw(st.sampled_from(inner))
    if isinstance(value, list):
        return [*value[:place], changed_within(value[place], draw), *value[place + 1:]]
    if draw(st.integers(0, 5)) == 0:
        return {key: each for key, each in value.items() if key != place}
    return {**value, place: changed_within(value[place], draw)}


@examples(25)
@given(number=st.integers(0, len(INPUTS) - 1), data=st.data())
def test_fuzzed_inputs_are_followed_or_refused(number, data) -> None:
    def change(event: Event) -> Event:
        if data.draw(st.integers(0, 4)) == 0:
            return event._replace(kind=data.draw(st.sampled_from(sorted(events.INPUTS))))
        name = data.draw(st.sampled_from(sorted(event.arguments)))
        return event._replace(arguments={
            **event.arguments, name: changed_within(event.arguments[name], data.draw)})
    with tempfile.TemporaryDirectory() as folder:
        bag = with_event(Path(folder), number, change)
        for name in FOLLOWERS:
            follow(name, bag)
