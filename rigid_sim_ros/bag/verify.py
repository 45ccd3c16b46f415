# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Simulate a recorded session again, and compare with every state that was recorded.

The messages come in the order in which things happened. ~/bag/step says at which step the world
was, so each message that follows is one that the world can make again; events are applied to it
as they come. What differs by a bit differs.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
import contextlib
import os
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.bag import decode, events, session as sessions, topics as kinds
from rigid_sim_ros.bag.completeness import Tally, wrong_topics
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.events import Event
from rigid_sim_ros.bag.joint_messages import JointMessages
from rigid_sim_ros.bag.outputs import Outputs
from rigid_sim_ros.bag.pace import Pace
from rigid_sim_ros.bag.reader import BagReader, Message
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.bag.topics import Topic, typestore
from rigid_sim_ros.messages.codec import encode_wrench
from rigid_sim_ros.scene import scene_from_text, SceneError
from rigid_sim_ros.world import World
from rigid_sim_ros.world.commands import FRAME_ID
from rigid_sim_ros.world.snapshot import are_same
from rigid_sim_ros.world.version import version

# Comparable kinds that are made of the state alone.
_STATES = frozenset({kinds.CLOCK, kinds.POSE, kinds.TWIST, kinds.STATE, kinds.TRANSFORMS,
                     kinds.STATE_HASH, *kinds.OF_JOINTS})


class Difference(NamedTuple):
    """The first place where the session simulated again is not what was recorded."""

    step: int
    body: str       # '' if it cannot be told
    text: str       # what differs, and by how much

    def __str__(self) -> str:
        """Return it as one line."""
        of = f", body '{self.body}'" if self.body else ''
        return f'step {self.step}{of}: {self.text}'


class Verdict(NamedTuple):
    """What came of simulating a session again."""

    difference: Difference | None
    faults: tuple[str, ...]     # of the files: bytes that are not what was written
    messages: int               # compared
    steps: int                  # simulated
    seconds: float              # of simulation time in these
    gaps: int                   # stretches of which inputs are missing, and which were left out
    skipped: int                # messages after such, up to the next full state
    others: tuple[str, ...]     # topics that are not of the session
    unchecked: tuple[str, ...]  # topics of the session that are there and are not made again
    note: str                   # how this software differs from the one that recorded, or ''

    @property
    def holds(self) -> bool:
        """Whether everything that was recorded came out again."""
        return self.difference is None and not self.faults


class _Found(Exception):
    """Carries the first difference out of the comparison."""

    def __init__(self, difference: Difference) -> None:
        super().__init__(str(difference))
        self.difference = difference


def verify(path: str | os.PathLike[str], progress: Callable[[int], None] | None = None,
           prepare: Callable[[Callable[[], World]], World] | None = None) -> Verdict:
    """
    Simulate the session of a bag again and compare; BagError if it cannot be read.

    `progress` is called with the time of the bag [ns] now and then, `prepare` with what makes the
    world, which it returns.
    """
    reader = BagReader(path)
    run = Resimulation(prepare, may_have_lost=reader.may_have_lost,
                       is_part=reader.metadata is None)
    difference = None
    try:
        run.take_all(reader.messages(), progress)
        run.finish(reader.types)
    except _Found as found:
        difference = found.difference
    except BagError as error:
        if not reader.faults:
            raise
        # A checksum has already told that bytes were changed; this is how it shows.
        difference = Difference(run.step, '', str(error))
    return Verdict(difference, tuple(reader.faults), run.compared, run.steps,
                   run.steps * run.step_ns / 1e9, run.gaps, run.skipped, tuple(sorted(run.others)),
                   tuple(run.unchecked()), run.note)


class Resimulation:
    """A world that goes through the messages of a session, one after another."""

    def __init__(self, prepare: Callable[[Callable[[], World]], World] | None = None, *,
                 may_have_lost: bool = False, is_part: bool = False) -> None:
        """
        Begin with nothing: scene, session and snapshot come first in the bag.

        It `may_have_lost` what nobody counted, if it was recovered; `is_part`: it may be a file
        that others came before.
        """
        self._is_part = is_part
        self._prepare = prepare
        self._may_have_lost = may_have_lost
        self.skipped = 0
        self.others: set[str] = set()
        self.compared = 0
        self.steps = 0
        self.gaps = 0
        self.note = ''
        self.step_ns = 0
        self._world: World | None = None
        self._session: Session | None = None
        self._scene_text: bytes | None = None
        self._outputs: Outputs
        self._pace: Pace
        self._topics: dict[str, Topic] = {}
        self._handlers: dict[str, Callable[[str, int, bytes], None]] = {}
        self._seen: Counter[str] = Counter()
        self._expected: dict[str, bytes] = {}   # what the topics say as the world is now
        self._echoes: dict[str, deque[bytes]] = {}
        self._number: int | None = 0            # of the next event, None if nobody knows
        self._is_lost = False                   # inputs are missing: wait for a snapshot
        self._may_skip = False                  # what comes before that
        self._tally: Tally | None = None
        self._ended = False
        self._knows_topics = False

    @property
    def step(self) -> int:
        """The step at which the world is."""
        return self._world.step_index if self._world else 0

    def take_all(self, messages: Iterable[Message],
                 progress: Callable[[int], None] | None = None) -> None:
        """Go through the messages and compare; raises _Found at the first difference."""
        expected, handlers, seen = self._expected, self._handlers, self._seen
        for topic, stamp, data in messages:
            seen[topic] += 1
            # Most messages end here: the world, as it is now, says the same.
            if expected.get(topic) == data:
                self.compared += 1
            elif topic in expected:
                self._differs(topic, data)
            elif topic in handlers:
                handlers[topic](topic, stamp, data)
                if progress is not None:
                    progress(stamp)
            elif self._world is None:
                self._begin(topic, data)
            elif topic not in self._topics:
                self._take_other(topic)

    def unchecked(self) -> list[str]:
        """Return the topics of the session that have messages of which none is compared."""
        return sorted(name for name in self._topics
                      if self._seen[name] and name not in self._handlers)

    def finish(self, types: Mapping[str, str]) -> None:
        """Compare what there is as a whole; `types` are those of the topics in the files."""
        if self._tally is None:
            raise BagError('this is no recording of rigid_sim_ros: it holds no scene with its '
                           'state, and only such can be verified')
        if wrong := self._tally.finish(types):
            self._found(wrong)
        if not self.compared:
            self._found('there is nothing that could be compared')
        if not self._ended:
            self.note = 'the recording was cut off' + (f'; {self.note}' if self.note else '')

    # --- the first messages: scene, session, snapshot ---------------------------------------

    def _begin(self, name: str, data: bytes) -> None:
        if name.endswith('/scene'):
            self._scene_text = data
        elif sessions.is_session(name) and self._scene_text is not None:
            self._session = sessions.read(name, data)
            self._make_world(self._session)
            self._tally = Tally(self._session, self._seen)
            if self._may_have_lost and self._began_before(self._session):
                self._tally.lose()
                self._number = None

    def _began_before(self, session: Session) -> bool:
        """Return whether it began before this description, so that the first one is lost."""
        return any(self._seen[topic.name] for topic in session.topics
                   if topic.kind not in (kinds.SCENE, kinds.SESSION))

    def _take_other(self, topic: str) -> None:
        assert self._session is not None
        if topic.startswith(f'{self._session.node}/'):
            self._found(f'there is a message on {topic}, which the session does not list')
        self.others.add(topic)

    def _make_world(self, session: Session) -> None:
        assert self._scene_text is not None
        try:
            text = decode.string(self._scene_text)

            def make() -> World:
                return World(scene_from_text(text, session.scene))
            world = self._prepare(make) if self._prepare is not None else make()
            if tuple(world.names) != session.bodies or world.step_ns != session.step_ns:
                raise BagError('the scene and the session in the bag do not fit together')
        except SceneError as error:
            raise BagError(f'the scene in the bag cannot be used: {error.summary}') from None
        except (KeyError, UnicodeEncodeError) as error:
            raise BagError(f'the session has a topic or a name that cannot be ({error})') from None
        self._world = world
        self.step_ns = world.step_ns
        self._pace = Pace(world.step_ns)
        self._topics = session.by_name
        theirs = (f"{session.software.get('rigid_sim_ros', '?')} "
                  f"({session.software.get('source', '?')})")
        if theirs != version():
            self.note = f'recorded with version {theirs}, simulated again with {version()}'
        self._is_lost = True
        by_kind = {
            kinds.STEP: self._take_step, kinds.EVENT: self._take_event,
            kinds.SNAPSHOT: self._take_snapshot, kinds.SCENE: self._take_scene,
            kinds.SESSION: self._take_session, kinds.APPLIED_WRENCH: self._take_echo,
            **dict.fromkeys(_STATES, self._take_state)}
        self._handlers.update({topic.name: by_kind[topic.kind] for topic in session.topics
                               if topic.kind in by_kind})
        self._echoes = {topic.body: deque() for topic in session.topics
                        if topic.kind == kinds.APPLIED_WRENCH}

    # --- one message each -------------------------------------------------------------------

    def _take_scene(self, topic: str, stamp: int, data: bytes) -> None:
        if data != self._scene_text:
            self._found('the scene is another than at the beginning')

    def _take_session(self, topic: str, stamp: int, data: bytes) -> None:
        if sessions.decode(decode.string(data)) != self._session:
            self._found('the session is another than at the beginning')

    def _take_step(self, topic: str, stamp: int, data: bytes) -> None:
        step = decode.uint64(data)
        self._expected.clear()
        if not self._is_lost:
            self._go_to(step, stamp)
        self._pace.note(stamp)

    def _take_snapshot(self, topic: str, stamp: int, data: bytes) -> None:
        world = self._known_world()
        state = decode.byte_array(data)
        if not self._is_lost:
            self.compared += 1
            saved = world.save()
            if are_same(state, saved):
                return
        try:
            world.restore(state)
        except (ValueError, KeyError, TypeError) as error:
            self._found(f'the saved state cannot be used ({error})')
        if not self._is_lost:
            self._snapshot_differs(world, saved)
        self._is_lost = False
        self._expected.clear()
        self._know_bodies()
        if not self._knows_topics:
            assert self._session is not None
            self._knows_topics = True
            if wrong := wrong_topics(self._session, world, self._is_part,
                                     JointMessages(world)):
                self._found(wrong)

    def _know_bodies(self) -> None:
        """Encode the topics of the bodies that there are now."""
        assert self._session is not None
        self._outputs = Outputs(self._known_world(), self._session.topics,
                                self._session.frame_id)

    def _snapshot_differs(self, world: World, saved: bytes) -> None:
        recorded = np.hstack([world.position, world.orientation, world.linear_velocity,
                              world.angular_velocity])
        world.restore(saved)
        again = np.hstack([world.position, world.orientation, world.linear_velocity,
                           world.angular_velocity])
        body, text = _largest(world.names, recorded, again)
        self._found(f'the saved state differs{text}', body)

    def _take_event(self, topic: str, stamp: int, data: bytes) -> None:
        try:
            event = events.decode(decode.string(data))
        except BagError as error:
            self._found(f'the event {self._number} {error}')
        if event.kind == events.GAP:
            self._take_gap(event)
            return
        if event.kind in (events.WRITTEN, events.END):
            self._compare_counts(event)
        self._ended = event.kind == events.END
        if event.kind == events.WRITTEN:
            return
        if self._number is not None and event.number != self._number:
            self._found(f'the event {self._number} is missing: {event.number} follows')
        self._number = (event.number or 0) + 1
        if self._is_lost:
            return
        self._expected.clear()
        self._go_to(event.step, stamp)
        self._apply(event)

    def _compare_counts(self, event: Event) -> None:
        assert self._tally is not None
        if self._is_part and event.kind == events.WRITTEN:
            self._is_part, self._number = False, None
            self._tally.lose()
        if missing := self._tally.mark(event.arguments['messages']):
            self._found(missing)

    def _take_gap(self, event: Event) -> None:
        lost = event.arguments['events']
        is_known = lost is not None and event.number is not None
        if not is_known and not self._may_have_lost:
            self._found('something is missing of which nobody knows how much, in a bag that was '
                        'not recovered')
        if is_known and self._number is not None and event.number != self._number + lost:
            self._found(f'a gap of {lost} events ends with the event {event.number}, and begins '
                        f'with {self._number}')
        if not is_known:
            assert self._tally is not None
            self._tally.lose()
        self._number = event.number
        for queue in self._echoes.values():
            queue.clear()
        # With no inputs missing the world is known all the same.
        if lost != 0:
            self.gaps += 1
            self._is_lost, self._may_skip = True, not is_known
            self._expected.clear()

    def _skip(self) -> None:
        """Leave a message out that comes after a gap and before the next full state."""
        if not self._may_skip:
            self._found('a message comes before the full state that it follows from')
        self.skipped += 1

    def _apply(self, event: Event) -> None:
        world = self._known_world()
        names = set(world.names)
        try:
            events.apply(event, world)
        except (ValueError, TypeError) as error:
            self._found(f'the event {event.number}, {event.kind}, is refused: {error}')
        if event.kind in ('add', 'remove'):
            self._know_bodies()
            assert self._tally is not None
            self._tally.gone |= names - set(world.names)
        if event.kind == 'apply_wrench':
            given = event.arguments
            session = self._session
            assert session is not None
            if given['name'] in self._echoes:
                self._echoes[given['name']].append(encode_wrench(
                    world.time_ns, given.get(FRAME_ID) or session.frame_id,
                    given.get('force', (0.0, 0.0, 0.0)), given.get('torque', (0.0, 0.0, 0.0))))
        elif event.kind == events.END:
            self.compared += 1
            if event.arguments['state_hash'] != world.state_hash():
                self._found(f"the last state's hash is {world.state_hash():#x}, recorded "
                            f'{event.arguments["state_hash"]:#x}')

    def _take_echo(self, topic: str, stamp: int, data: bytes) -> None:
        waiting = self._echoes[self._topics[topic].body]
        if self._is_lost:
            self._skip()
            return
        self.compared += 1
        if not waiting:
            self._found('a wrench was published that no event tells of',
                        self._topics[topic].body)
        expected = waiting.popleft()
        if data != expected:
            self._expected[topic] = expected
            self._differs(topic, data)

    def _take_state(self, topic: str, stamp: int, data: bytes) -> None:
        if self._is_lost:
            self._skip()
            return
        self._expected.update(self._outputs.encode(self._topics[topic].kind))
        self.compared += 1
        if topic not in self._expected:
            self._found('it was published of what is no longer there', self._topics[topic].body)
        if data != self._expected[topic]:
            self._differs(topic, data)

    # --- the world --------------------------------------------------------------------------

    def _known_world(self) -> World:
        assert self._world is not None
        return self._world

    def _go_to(self, step: int, stamp: int) -> None:
        world = self._known_world()
        count = step - world.step_index
        if count < 0:
            self._found(f'the recording goes back to step {step} without a reset')
        if wrong := self._pace.wrong(world.step_index, step, stamp):
            self._found(wrong)
        # Motion beyond all numbers was recorded too, if it was; the comparison tells.
        with contextlib.suppress(ArithmeticError):
            world.step(count)
        self.steps += count

    def _found(self, text: str, body: str = '') -> Any:
        raise _Found(Difference(self.step, body, text))

    def _differs(self, name: str, recorded: bytes) -> None:
        topic = self._topics[name]
        body, text = _compare(topic, recorded, self._expected[name], self._known_world().names)
        self._found(f'{topic.name} differs{text}',
                    topic.body or body if topic.kind not in kinds.OF_JOINTS else '')


def _compare(topic: Topic, recorded: bytes, again: bytes, names: list[str]) -> tuple[str, str]:
    """Return the body whose numbers differ most, and by how much."""
    if topic.kind == kinds.STATE_HASH and len(recorded) == len(again):
        return '', f': {decode.uint64(recorded):#x} recorded, {decode.uint64(again):#x} now'
    is_of_joints = topic.kind in (kinds.JOINT_STATES, kinds.ALL_JOINT_STATES)
    try:
        messages = [typestore().deserialize_cdr(data, topic.type) for data in (recorded, again)]
        tables = [_numbers(topic, message) for message in messages]
        names = list(messages[1].name) if is_of_joints else names
    except Exception:       # bytes that were changed can break anything that reads them
        tables = []
    if len(tables) == 2 and tables[0].shape == tables[1].shape and tables[0].size:
        name, text = _largest(names, *tables)
        if text:
            return ('', f' at joint {name!r}{text}') if is_of_joints else (name, text)
    shorter = min(len(recorded), len(again))
    first = next((k for k in range(shorter) if recorded[k] != again[k]), shorter)
    return '', f' in byte {first} of {len(recorded)}, where no number of the motion stands'


def _numbers(topic: Topic, message: Any) -> np.ndarray:
    """Return the numbers of a message, a row for each body."""
    if topic.kind == kinds.POSE:
        return np.array([_pose(message.pose.position, message.pose.orientation)])
    if topic.kind == kinds.TWIST:
        return np.array([_vectors(message.twist.linear, message.twist.angular)])
    if topic.kind in (kinds.APPLIED_WRENCH, kinds.JOINT_WRENCH):
        return np.array([_vectors(message.wrench.force, message.wrench.torque)])
    if topic.kind in (kinds.JOINT_STATES, kinds.ALL_JOINT_STATES):
        return np.column_stack([message.position, message.velocity, message.effort])
    if topic.kind == kinds.TRANSFORMS:
        return np.array([_pose(each.transform.translation, each.transform.rotation)
                         for each in message.transforms])
    if topic.kind == kinds.STATE:
        return np.array([
            _pose(transform.translation, transform.rotation)
            + _vectors(twist.linear, twist.angular)
            for transform, twist in zip(message.transforms, message.twist, strict=True)])
    return np.empty((0, 0))


def _vectors(*vectors: Any) -> list[float]:
    return [number for v in vectors for number in (v.x, v.y, v.z)]


def _pose(position: Any, q: Any) -> list[float]:
    return [*_vectors(position), q.x, q.y, q.z, q.w]


def _largest(names: list[str], recorded: np.ndarray, again: np.ndarray) -> tuple[str, str]:
    """Return the body with the largest difference, and a text that says how large it is."""
    differs = recorded.view(np.int64) != again.view(np.int64)
    if not differs.any():
        return '', ''
    with np.errstate(all='ignore'):
        size = np.where(differs, np.nan_to_num(np.abs(recorded - again), nan=np.inf), -1.0)
    row, column = np.unravel_index(int(np.argmax(size)), size.shape)
    name = names[row] if row < len(names) else ''
    a, b = float(recorded[row, column]), float(again[row, column])
    return name, f' by {abs(a - b):.3g}: {a!r} recorded, {b!r} now'
