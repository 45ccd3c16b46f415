# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sessions that the tests record, and bags that they change."""

import atexit
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
import shutil
import tempfile
from typing import Any

from rigid_sim_ros.bag import events, session as sessions, topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.mcap_file import McapFile
from rigid_sim_ros.bag.metadata import build, write
from rigid_sim_ros.bag.outputs import Outputs, state_topics
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.bag.topics import Topic
from rigid_sim_ros.messages import decode
from rigid_sim_ros.messages.codec import encode_string, encode_wrench
from rigid_sim_ros.world import World

NODE = '/rigid_sim'
SCENE = {
    'format': 1,
    'world': {'step': 0.001, 'contact': 'none', 'gravity': [0, 0, -9.81]},
    'bodies': [
        {'name': 'crate', 'shape': {'type': 'box', 'size': [1, 2, 3]}, 'mass': 2.0,
         'frames': {'handle': {'position': [0.5, 0, 0]}},
         'twist': {'angular': [0.1, 3.0, 0.2]}},
        {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.5}, 'mass': 1.0,
         'pose': {'position': [5, 0, 0]}},
    ],
}
WRENCHES = tuple(kinds.topic(kinds.APPLIED_WRENCH, f'{NODE}/{name}/applied_wrench', name)
                 for name in ('crate', 'ball'))


def world() -> World:
    """Return a new world of two bodies."""
    return World.from_dict(SCENE)


def record_all(batch: Batch, share: float = 1.0) -> None:
    """Let everything happen to a session that can: for 3.5 s of simulation, or a share of it."""
    def run(steps: int) -> None:
        batch.run(round(share * steps))

    run(313)
    batch.tell('apply_wrench', name='crate', force=(1.0, 0.25, -2.0), torque=(0.0, 0.5, 0.0),
               frame='crate/handle', duration=0.4, source='crate/wrench')
    run(500)
    batch.tell('apply_wrench', name='ball', force=(0.5, 0.0, 0.0), duration=5.0, source='wind')
    batch.tell('set_pose', name='ball', position=(4.0, 1.0, 0.5), orientation=(0.6, 0, 0, 0.8))
    run(700)
    batch.tell('cancel_wrenches', source='wind')
    batch.tell('reset')
    run(600)
    batch.tell('pause')
    batch.tell('set_twist', name='ball', linear=(0.0, 0.0, 1.0), angular=(1.0, 2.0, 3.0))
    batch.publish()
    batch.tell('step')
    batch.run(1)
    batch.tell('resume')
    batch.tell('speed', factor=2.0)
    run(500)
    batch.tell('apply_impulse', name='crate', impulse=(0.1, 0.2, 0.3))
    batch.tell('reset', keep_time=True)
    run(900)


def session(folder: Path, share: float = 1.0, **options: Any) -> Path:
    """Record such a session in several files and return the bag."""
    bag = folder / 'session'
    batch = Batch(world(), bag, **{'segment_s': share, 'hash_interval': round(250 * share),
                                   **options})
    record_all(batch, share)
    batch.close()
    return bag


@cache
def shared_session(storage: str = 'mcap', compression: str = 'none') -> Path:
    """Return a session that several tests look at, and none changes."""
    return session(lasting_folder(), storage=storage, compression=compression)


@cache
def brief_session(storage: str, compression: str) -> Path:
    """Return one of 0.7 s, for tests that read it a thousand times."""
    return session(lasting_folder(), 0.2, storage=storage, compression=compression)


def lasting_folder() -> Path:
    """Return a folder that lasts until the tests are done."""
    folder = Path(tempfile.mkdtemp(prefix='rigid_sim_ros_'))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def wrench_session(folder: Path) -> Path:
    """Record a session with a state, one wrench and its echo, as the node publishes them."""
    the_world = world()
    bag = folder / 'wrenches'
    recorder = Recorder(bag, the_world, [*state_topics(NODE, the_world.names), *WRENCHES],
                        waits=True)
    recorder.snapshot(the_world)
    outputs = Outputs(the_world, state_topics(NODE, the_world.names), 'world')
    (name, data), = outputs.encode(kinds.STATE)
    recorder.publish(0, [recorder.channel(name)], [data])
    given = {'name': 'crate', 'force': (0.1, 0.2, 0.3), 'torque': (0.0, 0.0, 0.0),
             'frame': 'crate', 'duration': 0.01, 'source': 'crate/wrench'}
    the_world.step(5)
    the_world.apply_wrench(**given)
    recorder.event(5, 'apply_wrench', frame_id='crate', **given)
    recorder.publish(5, [recorder.channel(WRENCHES[0].name)], [
        encode_wrench(the_world.time_ns, 'crate', given['force'], given['torque'])])
    the_world.step(20)
    recorder.close(the_world)
    return bag


def rewrite(bag: Path, folder: Path, change: Callable[[Topic, bytes], bytes | None]) -> Path:
    """Write a bag anew, checksums and all, with messages changed, or left out for None."""
    topics = _topics_of(bag)
    changed = folder / 'changed'
    changed.mkdir()
    file = McapFile(changed / 'changed_0.mcap', topics, compressed=False)
    index = {topic.name: k for k, topic in enumerate(topics)}
    for name, stamp, data in BagReader(bag).messages():
        new = change(topics[index[name]], data)
        if new is not None:
            file.write((index[name] + 1,), stamp, (new,))
    write(changed, build(topics, [file.close()], 'mcap'))
    return changed


def forge(
    bag: Path, folder: Path, *, change: Callable[[Topic, bytes], bytes | None] | None = None,
    relabel: Callable[[Topic], Topic] = lambda topic: topic,
    describe: Callable[[Session], Session] = lambda session: session, recount: bool = False,
) -> Path:
    """
    Write a bag anew as somebody who knows the format would, all digests and checksums right.

    `change` messages, `relabel` topics in the file, `describe` the session in another way, and
    `recount` the messages, so that the events that tell their number fit what is there.
    """
    known = {topic.name: topic for topic in _topics_of(bag)}
    labels = {name: relabel(topic) for name, topic in known.items()}
    topics = list({topic.name: topic for topic in labels.values()}.values())
    forged = folder / 'forged'
    forged.mkdir()
    file = McapFile(forged / 'forged_0.mcap', topics, compressed=False)
    index = {topic.name: k for k, topic in enumerate(topics)}
    counts: Counter[str] = Counter()
    for name, stamp, data in BagReader(bag).messages():
        new = change(known[name], data) if change else data
        if new is None:
            continue
        if known[name].kind == kinds.SESSION:
            new = encode_string(describe(sessions.decode(decode.string(new))).encode())
        elif known[name].kind == kinds.EVENT and recount:
            event = events.decode(decode.string(new))
            if event.kind in (events.WRITTEN, events.END):
                new = encode_string(event._replace(
                    arguments={**event.arguments, 'messages': dict(counts)}).encode())
        label = labels[name].name
        counts[label] += 1
        file.write((index[label] + 1,), stamp, (new,))
    write(forged, build(topics, [file.close()], 'mcap'))
    return forged


def _topics_of(bag: Path) -> list[Topic]:
    return list(session_of(bag).topics)


def session_of(bag: Path) -> Session:
    """Return what a bag says of its session."""
    return next(sessions.decode(decode.string(data)) for name, _, data
                in BagReader(bag).messages() if name.endswith('/bag/session'))


def messages_of(bag: Path, kind: str) -> list[tuple[str, int, bytes]]:
    """Return the messages on the topics of a kind."""
    names = {topic.name for topic in _topics_of(bag) if topic.kind == kind}
    return [message for message in BagReader(bag).messages() if message[0] in names]


def events_of(bag: Path) -> Iterator[events.Event]:
    """Give the events of a bag."""
    for _, _, data in messages_of(bag, kinds.EVENT):
        yield events.decode(decode.string(data))
