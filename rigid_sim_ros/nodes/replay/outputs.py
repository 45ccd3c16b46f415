# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay publishes: the bytes of the bag, and the clock."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
import re
from typing import NamedTuple

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from rigid_sim_ros.bag.offered_qos import OfferedQos
from rigid_sim_ros.bag.playable_files import Message, RecordedTopic
from rigid_sim_ros.bag.playback import PlayableBag
from rigid_sim_ros.messages.codec import encode_clock
from rigid_sim_ros.nodes.delivery import await_delivery
from rigid_sim_ros.nodes.replay.qos import CLOCK_QOS, make_publisher, profile

CLOCK = '/clock'
_TYPE = re.compile(r'([a-z][a-z0-9_]*)/(?:msg/)?([A-Z][A-Za-z0-9_]*)')


class _Output:
    """A topic."""

    def __init__(self, publisher: Publisher, kept: int) -> None:
        self.publisher = publisher
        # Publisher.publish would check types and lock the handle for each message: 1.2 us instead
        # of 0.6. Nothing destroys a publisher while the replay runs.
        self.send: Callable[[bytes], None] = publisher.handle.publish_raw
        self.kept: deque[bytes] | None = deque(maxlen=kept) if kept else None
        self.begins_file = False    # only repetitions so far


class Skipped(NamedTuple):
    """Topics that cannot be published for the same reason."""

    reason: str
    topics: list[str]


class Outputs:
    """The publishers of a replay; after the start only the thread that plays calls them."""

    def __init__(self, node: Node, bag: PlayableBag, names: Iterable[str]) -> None:
        """Make a publisher for each of the topics; `skipped` says which that could not be."""
        self.messages = 0               # sent so far
        self.skipped: list[Skipped] = []
        self._node = node
        self._outputs: dict[str, _Output] = {}
        self._latched_until_ns = 0
        self._file: int | None = None
        reasons: dict[str, list[str]] = {}
        for name in sorted(names):
            if reason := self._add(bag.topics[name], bag.qos[name]):
                reasons.setdefault(reason, []).append(name)
        self.skipped = [Skipped(*each) for each in reasons.items()]
        self._bag_has_clock = CLOCK in bag.topics
        self._clock: Publisher | None = None

    @property
    def names(self) -> frozenset[str]:
        """The topics of the bag that are published."""
        return frozenset(self._outputs)

    def is_latched(self, name: str) -> bool:
        """Whether a topic is published and latched."""
        return name in self._outputs and self._outputs[name].kept is not None

    def begin(self, at_ns: int, latched: Sequence[Message]) -> None:
        """Publish what was latched at the time at which the replay goes on."""
        self._file = None
        self._latched_until_ns = at_ns
        for _, name, data in latched:
            output = self._outputs[name]
            output.send(data)
            if output.kept is not None:
                output.kept.append(data)
        self.messages += len(latched)

    def publish(self, file: int, messages: Sequence[Message]) -> int:
        """Publish messages of a file and return how many were new."""
        if messages and file != self._file:
            self._begin_file(file)
        sent = 0
        outputs = self._outputs
        for stamp, name, data in messages:
            output = outputs.get(name)
            if output is None:
                continue
            if output.kept is not None and self._is_known(output, stamp, data):
                continue
            output.send(data)
            sent += 1
        self.messages += sent
        return sent

    def make_clock(self) -> bool:
        """
        Get ready to publish the time of the bag; return whether that makes sense.

        A bag that holds a clock has messages with times that fit to that one.
        """
        if self._clock is None and not self._bag_has_clock:
            self._clock = make_publisher(self._node, Clock, CLOCK, CLOCK_QOS)
        return self._clock is not None

    def publish_clock(self, t_ns: int) -> None:
        """Publish the time of the bag."""
        if self._clock is not None:
            self._clock.handle.publish_raw(encode_clock(t_ns))

    def subscriptions(self) -> int:
        """Return how many subscriptions there are to all topics and the clock together."""
        return sum(publisher.get_subscription_count() for publisher in self._publishers())

    def flush(self, seconds: float) -> bool:
        """Wait, at most this long, until reliable subscribers have what was sent; if they have."""
        return await_delivery(self._publishers(), seconds)

    def topics(self) -> list[str]:
        """Return the full names of the topics that are published."""
        return [publisher.topic_name for publisher in self._publishers()]

    def _publishers(self) -> Iterator[Publisher]:
        for output in self._outputs.values():
            yield output.publisher
        if self._clock is not None:
            yield self._clock

    def _begin_file(self, file: int) -> None:
        # What a bag repeats at the start of each file, so that the file is of use by itself, is
        # nothing new to those who heard it before.
        for output in self._outputs.values():
            output.begins_file = self._file is not None
        self._file = file

    def _is_known(self, output: _Output, stamp: int, data: bytes) -> bool:
        """Return whether a latched message was published already; else keep it in mind."""
        assert output.kept is not None
        if stamp <= self._latched_until_ns or (output.begins_file and data in output.kept):
            return True
        output.begins_file = False
        output.kept.append(data)
        return False

    def _add(self, topic: RecordedTopic, qos: OfferedQos) -> str:
        """Make a publisher; return why that cannot be, or ''."""
        if topic.encoding != 'cdr':
            return f'the messages are encoded as {topic.encoding!r}, not as cdr'
        message = message_type(topic.type)
        if message is None:
            return f'{topic.type} is not installed'
        try:
            publisher = make_publisher(self._node, message, topic.name, profile(qos))
        except InvalidTopicNameException:
            return 'that is no name of a ROS topic'
        if reason := self._mismatch(publisher, topic):
            self._node.destroy_publisher(publisher)
            return reason
        self._outputs[topic.name] = _Output(publisher, qos.kept)
        return ''

    def _mismatch(self, publisher: Publisher, topic: RecordedTopic) -> str:
        if publisher.topic_name == self._node.resolve_topic_name('~/seek'):
            return 'that would steer this replay'
        installed = self._type_hash(publisher)
        if topic.type_hash and installed and installed != topic.type_hash:
            return (f'{topic.type} was recorded in another version than the one installed '
                    f'({topic.type_hash[:19]}..., {installed[:19]}...)')
        return ''

    def _type_hash(self, publisher: Publisher) -> str:
        own = self._node.get_name(), self._node.get_namespace()
        for info in self._node.get_publishers_info_by_topic(publisher.topic_name):
            if (info.node_name, info.node_namespace) == own:
                return str(info.topic_type_hash)
        return ''


def message_type(name: str) -> type | None:
    """Return the class of a type such as std_msgs/msg/String, None where it is not installed."""
    match = _TYPE.fullmatch(name)
    # Only packages with a folder `msg` are imported: a bag may name anything.
    spec = find_spec(match[1]) if match else None
    if match is None or spec is None or not any(
            Path(place, 'msg').is_dir() for place in spec.submodule_search_locations or ()):
        return None
    try:
        found: type = getattr(import_module(f'{match[1]}.msg'), match[2])
    except (ImportError, AttributeError):
        return None
    return found if hasattr(type(found), '__import_type_support__') else None
