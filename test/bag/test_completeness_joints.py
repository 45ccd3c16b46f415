# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a session publishes of bodies and joints is missed, or told of, where it was changed."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
import struct
import tempfile
from typing import Any

from bag.sessions import forge, lasting_folder, NODE, session_of
from engine.jointed import body, joint, scene
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.outputs import joint_topics, Outputs, state_topics
from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.messages.topics import CONTACT_WRENCH, topic_name

# What is recorded, and not made again from the state.
CONTACT = Topic(topic_name(CONTACT_WRENCH, NODE, 'rod'), 'geometry_msgs/msg/WrenchStamped', '',
                'rod')
# As the node has them.
PARAMETERS = {'bodies': ['*'], 'joint_wrenches': ['*'], 'publish_clock': True, 'publish_tf': True,
              'publish_joint_states': True}
OTHERS = (kinds.published(kinds.TRANSFORMS, NODE), kinds.published(kinds.ALL_JOINT_STATES, NODE),
          kinds.published(kinds.JOINT_WRENCH, NODE, 'hinge'))


@cache
def recorded() -> Path:
    """Return a session of all that a node says of a rod on a hinge, for 20 steps."""
    world = World.from_dict(scene([body('rod')], [joint('hinge', 'world', 'rod')]))
    topics = [*state_topics(NODE, world.names), *joint_topics(NODE, world), *OTHERS]
    recorder = Recorder(lasting_folder() / 'bag', world, [*topics, CONTACT], waits=True,
                        parameters=PARAMETERS)
    recorder.snapshot(world)
    outputs = Outputs(world, topics, 'world')
    for _ in range(20):
        world.step()
        said = dict(pair for kind in kinds.TYPES for pair in outputs.encode(kind)
                    if kind not in kinds.OF_BODIES[2:])
        said[CONTACT.name] = said[topic_name(kinds.JOINT_WRENCH, NODE, 'hinge')]
        recorder.publish(world.step_index, [recorder.channel(name) for name in said],
                         list(said.values()))
    recorder.close(world)
    return recorder.path


def refused(**forgery) -> bool:
    """Return whether `verify` lets a forged session not pass."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            return not verify(forge(recorded(), Path(folder), recount=True, **forgery)).holds
        except BagError:
            return True


def changed(name: str) -> Callable[[Topic, bytes], bytes]:
    """Return what changes the last number of all messages on a topic."""
    return lambda topic, data: (data[:-8] + struct.pack('<d', 12345.678)
                                if topic.name == name else data)


def listed(name: str, /, **fields) -> Callable[[Session], Session]:
    """Return what describes a topic of the session in another way, or no more, without fields."""
    return lambda session: session._replace(topics=tuple(
        topic._replace(**fields) if topic.name == name else topic
        for topic in session.topics if fields or topic.name != name))


def relabelled(name: str, to: str) -> Callable[[Topic], Topic]:
    return lambda topic: topic._replace(name=to) if topic.name == name else topic


# By name: what is done to the topic of this name, besides that its messages are changed.
FORGERIES: dict[str, Callable[[str], dict[str, Any]]] = {
    'as it is': lambda name: {},
    'of no kind': lambda name: {'describe': listed(name, kind='')},
    'not listed': lambda name: {'describe': listed(name)},
    'not listed and elsewhere': lambda name: {
        'describe': listed(name), 'relabel': relabelled(name, '/elsewhere')},
    **{f'of no kind and called {to}': lambda name, to=to: {
        'describe': listed(name, kind='', name=to), 'relabel': relabelled(name, to)}
       for to in ('/elsewhere', f'{NODE}/elsewhere')},
    'of nobody': lambda name: {'describe': listed(name, kind='', body='')},
}


def test_what_is_written_anew_holds_and_tells_what_is_not_made_again() -> None:
    verdict = verify(recorded())
    assert verdict.holds, str(verdict.difference)
    assert verdict.unchecked == (CONTACT.name,)
    assert not refused()


@pytest.mark.parametrize('forgery', FORGERIES)
def test_what_was_changed_is_found_however_it_is_called(forgery) -> None:
    made_again = [topic for topic in session_of(recorded()).topics
                  if topic.kind in kinds.TYPES and topic not in kinds.own_topics(NODE)]
    assert len(made_again) == 9
    for topic in made_again:
        assert refused(change=changed(topic.name), **FORGERIES[forgery](topic.name)), topic.name


@pytest.mark.parametrize('kind', ['', kinds.APPLIED_WRENCH, kinds.JOINT_WRENCH])
def test_a_wrench_is_not_taken_for_that_of_something_else(kind) -> None:
    name = topic_name(kinds.JOINT_WRENCH, NODE, 'hinge')
    for other in ('', 'rod', 'hinge'):
        if (kind, other) != (kinds.JOINT_WRENCH, 'hinge'):
            assert refused(describe=listed(name, kind=kind, body=other))
