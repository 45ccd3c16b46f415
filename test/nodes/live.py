# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Real nodes for the tests: processes of the package, and a node of the test that talks to them.

Everything runs over real DDS in a ROS domain that nobody else on this machine uses, and on this
machine only.
"""
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import ctypes
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any
import warnings

from free import free_domain
from nodes.forked import Fork
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from rigid_sim_ros.nodes.delivery import ask_often

# s: far more than anything here takes, so that only what never happens fails. With eight busy
# processes beside on two cores the longest of all waits took 75 s.
PATIENCE = 180.0
AGAIN = 0.5     # s after which a question that changes nothing is asked again
LOST = 20.0     # s after which an answer of a service will not come any more
# s: what was lost on its way is missed at the next heartbeat, every 0.1 s: nodes/delivery.py.
SILENCE = 2.0

# Deep enough for everything that a test waits for.
DEEP = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)

ROOT = Path(__file__).parents[2]
PROGRAMS = [sys.executable, '-m', 'rigid_sim_ros.programs']


class Process:
    """A program of the package in a process of its own."""

    def __init__(
        self, command: Sequence[str], folder: Path, stdin: int = subprocess.DEVNULL,
        cwd: Path = ROOT, *, is_forked: bool = False,
    ) -> None:
        """Start a command, or fork the program of the package that its first word names."""
        folder.mkdir(parents=True, exist_ok=True)
        self._out, self._err = folder / 'stdout', folder / 'stderr'
        self._process: subprocess.Popen[bytes] | Fork
        with self._out.open('wb') as out, self._err.open('wb') as err:
            if is_forked:
                self._process = Fork(command, self._out, self._err, cwd)
            else:
                self._process = subprocess.Popen(
                    command, stdin=stdin, stdout=out, stderr=err, cwd=cwd)

    @property
    def stderr(self) -> str:
        return self._err.read_text(encoding='utf-8')

    def signal(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def signal_other_thread(self, number: int) -> None:
        """Send a signal to a thread that is not the main one, as a system may do."""
        pid = self._process.pid
        others = [int(name) for name in os.listdir(f'/proc/{pid}/task') if int(name) != pid]
        # The youngest that has not ended meanwhile: the oldest, of BLAS, hold back all signals.
        youngest = sorted(others, reverse=True)
        assert any(ctypes.CDLL(None).tgkill(pid, other, number) == 0 for other in youngest)

    def has_children(self) -> bool:
        """Return whether it has started a process that has not ended."""
        found = subprocess.run(['ps', '-o', 'pid=', '--ppid', str(self._process.pid)],
                               capture_output=True, text=True, check=False)
        return found.stdout != ''

    def wait(self) -> int:
        """Wait for the end and return the exit code; what does not end in time is killed."""
        try:
            return self._process.wait(PATIENCE)
        except (subprocess.TimeoutExpired, TimeoutError):
            self._process.kill()
            self._process.wait()
            raise

    def is_running(self) -> bool:
        return self._process.poll() is None

    def has_failed(self) -> bool:
        return self._process.poll() not in (None, 0)

    def end(self) -> None:
        """End it if it still runs, by force if need be."""
        if self.is_running():
            self.signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired, TimeoutError):
                self.wait()


# What the tests have started and not yet ended.
_RUNNING: list[Process] = []


def simulate(
    log: Path, scene: str, *, name: str = 'rigid_sim', words: Sequence[str] = (),
    folder: Path = ROOT, is_forked: bool = True, **parameters: Any,
) -> Process:
    """
    Start the node in a folder, with a scene file or name, further words, and parameters.

    If it is not forked, it starts as for a user and imports all that it needs.
    """
    ros = ['--ros-args', '-r', f'__node:={name}']
    for key, value in parameters.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        ros += ['-p', f'{key}:={text}']
    start = [] if is_forked else PROGRAMS
    return Process([*start, 'simulate', scene, *words, *ros], log, cwd=folder,
                   is_forked=is_forked)


@contextmanager
def kept(process: Process) -> Iterator[Process]:
    """End a process with the block; nobody waits for anything once it has failed."""
    _RUNNING.append(process)
    try:
        yield process
    finally:
        _RUNNING.remove(process)
        process.end()
    assert 'Traceback' not in process.stderr, process.stderr


@contextmanager
def running(*args: Any, **options: Any) -> Iterator[Process]:
    """Start the node as `simulate` does and end it with the block."""
    with kept(simulate(*args, **options)) as process:
        yield process


def _known(look: Callable[[str, str], list[tuple[str, list[str]]]],
           node: str) -> dict[str, list[str]]:
    # What a node offers may be known before its name is: the two travel on topics of their own.
    try:
        return dict(look(node, '/'))
    except NodeNameNonExistentError:
        return {}


class _Meeting:
    """A question to a node that changes nothing, asked until it is answered."""

    def __init__(self, node: Node, other: str) -> None:
        self.client = node.create_client(GetParameters, f'{other}/get_parameters')
        self._asked: float | None = None
        self.is_answered = False

    def is_over(self) -> bool:
        """Ask if it is time to, and return whether there was an answer."""
        now = time.monotonic()
        is_due = self._asked is None or now > self._asked + AGAIN
        if not self.is_answered and is_due and self.client.service_is_ready():
            self._asked = now
            self.client.call_async(GetParameters.Request()).add_done_callback(self._take)
        return self.is_answered

    def _take(self, _: Any) -> None:
        self.is_answered = True


class Probe:
    """The node of the test: it listens, publishes and calls from a thread of its own."""

    def __init__(self) -> None:
        self.node = Node(f'probe_{os.getpid()}')
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self._changed = threading.Condition()
        self._stopped = False
        self._publishers: dict[str, Any] = {}
        self._received: dict[str, list[Any]] = {}
        self._clients: dict[str, Any] = {}
        # How many subscriptions and clients were made, and, by node, how many it knows: as long as
        # the same processes run.
        self._made = 0
        self._met: dict[str, tuple[int, list[Process]]] = {}
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stopped = True
        self._executor.wake()
        self._thread.join(PATIENCE)
        # As long as the executor knows it, the node and its subscriptions stay in the domain.
        self._executor.shutdown()
        self.node.destroy_node()

    def _spin(self) -> None:
        while not self._stopped:
            self._executor.spin_once(timeout_sec=0.2)

    @contextmanager
    def listening(self, message: type, topic: str, qos: QoSProfile = DEEP) -> Iterator[list[Any]]:
        """
        Collect what arrives on a topic from now on.

        The subscription stays for the next time. Those who publish know of it: from now on nothing
        gets lost.
        """
        if topic not in self._received:
            self._subscribe(message, topic, qos)
        received = self._received[topic]
        with self._changed:
            received.clear()
        yield received

    def _subscribe(self, message: type, topic: str, qos: QoSProfile) -> None:
        received = self._received[topic] = []

        def keep(item: Any) -> None:
            with self._changed:
                received.append(item)
                self._changed.notify_all()

        self.subscribe(message, topic, keep, qos)
        self._meet(lambda: self._publishers_of_topic(topic), f'a publisher of {topic}')

    def subscribe(
        self, message: type, topic: str, callback: Callable[[Any], object],
        qos: QoSProfile = DEEP, *, raw: bool = False,
    ) -> Any:
        """Subscribe to a topic that nobody needs to publish yet."""
        self._made += 1
        return self.node.create_subscription(message, topic, callback, qos, raw=raw)

    def meet(self, *nodes: str) -> None:
        """
        Wait until nodes know all subscriptions and clients that this one has made so far.

        Either side of DDS hears of the other in its own time, and what a node says, or answers,
        before it has heard of who listens does not get there. It hears of subscriptions, those to
        answers among them, in the order in which they were made: they are announced by one
        reliable writer of the participant (DDSI-RTPS 2.5, 8.5.4.2). So whose answer reaches a
        client that was made last knows all that was made before.
        """
        news = {name for name in nodes if self._met.get(name) != (self._made, _RUNNING)}
        if news:
            self._meet(lambda: news, f'an answer of {", ".join(news)}')

    def _meet(self, nodes: Callable[[], set[str]], what: str) -> None:
        """Meet those that a function returns; it may return others later, but must some."""
        known = self._made, list(_RUNNING)
        meetings: dict[str, _Meeting] = {}

        def are_over() -> bool:
            names = nodes()
            for name in names - meetings.keys():
                meetings[name] = _Meeting(self.node, name)
            over = {name for name in names if meetings[name].is_over()}
            return bool(names) and over == names

        try:
            self.wait_for(are_over, what)
        finally:
            for meeting in meetings.values():
                self.node.destroy_client(meeting.client)
        self._met.update({name: known for name, each in meetings.items() if each.is_answered})

    def _publishers_of_topic(self, topic: str) -> set[str]:
        """Return the nodes that publish a topic, none as long as a name is not known yet."""
        names = {f'{end.node_namespace.rstrip("/")}/{end.node_name}'
                 for end in self.node.get_publishers_info_by_topic(topic)}
        return set() if any('_NODE_NAME_UNKNOWN_' in name for name in names) else names

    def wait_for(self, condition: Callable[[], Any], what: str = 'a condition') -> Any:
        """Wait until the condition is true and return its value."""
        end = time.monotonic() + PATIENCE
        with self._changed:
            while not (value := condition()):
                assert time.monotonic() < end, f'waited {PATIENCE} s for {what}'
                for process in _RUNNING:
                    assert not process.has_failed(), process.stderr
                self._changed.wait(0.02)
        return value

    def publishers_of(self, node: str) -> dict[str, list[str]]:
        """Tell the topics that a node publishes, as far as is known, and their types."""
        return _known(self.node.get_publisher_names_and_types_by_node, node)

    def subscriptions_of(self, node: str) -> dict[str, list[str]]:
        """Tell the topics that a node subscribes to, as far as is known, and their types."""
        return _known(self.node.get_subscriber_names_and_types_by_node, node)

    def services_of(self, node: str) -> dict[str, list[str]]:
        """Tell the services of a node, as far as is known, and their types."""
        return _known(self.node.get_service_names_and_types_by_node, node)

    def wait_for_silence(self, received: list[Any]) -> None:
        """Wait until no message has come for a while; the last may come late."""
        seen, since = -1, 0.0

        def is_silent() -> bool:
            nonlocal seen, since
            if len(received) != seen:
                seen, since = len(received), time.monotonic()
            return time.monotonic() - since > SILENCE

        self.wait_for(is_silent, 'silence')

    def some(
        self, message: type, topic: str, count: int = 1, qos: QoSProfile = DEEP,
    ) -> list[Any]:
        """Return the next messages of a topic."""
        with self.listening(message, topic, qos) as received:
            self.wait_for(lambda: len(received) >= count, f'{count} messages on {topic}')
            return received[:count]

    def publish(self, topic: str, message: Any) -> None:
        """Publish to a topic, once somebody subscribes to it."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(type(message), topic, 10)
        publisher = self._publishers[topic]
        self.wait_for(lambda: publisher.get_subscription_count() > 0, f'a subscriber of {topic}')
        publisher.publish(message)

    def client(self, service_type: type, name: str, **options: Any) -> Any:
        """Make a client of a service that nobody needs to offer yet."""
        self._made += 1
        return self.node.create_client(service_type, name, **options)

    def call(self, service_type: type, name: str, request: Any) -> Any:
        """Call a service and return its response."""
        if name not in self._clients:
            self._clients[name] = self.client(service_type, name)
        client = self._clients[name]
        self.meet(name.rpartition('/')[0])
        self.wait_for(client.service_is_ready, f'service {name}')
        answer: list[Any] = []
        asked: list[float] = []

        def ask() -> None:
            if asked:
                # It went to a process that has ended, of which the end is not known yet; no other
                # is lost, so nothing is done twice.
                warnings.warn(f'no answer of {name}, asked again', stacklevel=2)
            asked.append(time.monotonic())
            client.call_async(request).add_done_callback(
                lambda done: answer.append(done.result()))

        def answered() -> list[Any]:
            if not asked or (not answer and time.monotonic() > asked[-1] + LOST):
                ask()
            return answer

        self.wait_for(answered, f'an answer of {name}')
        return answer[0]

    def trigger(self, name: str) -> Any:
        return self.call(Trigger, name, Trigger.Request())

    def set_parameter(self, name: str, value: Any, node: str = '/rigid_sim') -> Any:
        """Set a parameter of a node from outside and return the answer."""
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call(SetParameters, f'{node}/set_parameters', request).results[0]

    def pause(self, paused: bool, node: str = '/rigid_sim') -> Any:
        return self.call(SetBool, f'{node}/pause', SetBool.Request(data=paused))


def start_ros() -> None:
    """Put this process and its children into a domain of their own."""
    os.environ['ROS_DOMAIN_ID'] = str(free_domain())
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    ask_often()
    # The kernels compile at their first use, which takes longer than any patience below.
    with tempfile.TemporaryDirectory() as folder:
        first = Process(['simulate', '--duration', '0.001'], Path(folder), is_forked=True)
        assert first.wait() == 0, first.stderr
    rclpy.init()


def stop_ros() -> None:
    rclpy.try_shutdown()


def nanoseconds(stamp: Any) -> int:
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)
