# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A replay as a process: wrong usage, damaged bags, and a person at a terminal."""
from collections.abc import Callable
from importlib.util import find_spec
import os
from pathlib import Path
import pty
import re
import shutil
import signal
import subprocess
import sys
import termios
import time
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.foreign import mcap, texts
from bag.sessions import shared_session
from nodes.live import kept, PATIENCE, Process, ROOT
from nodes.replays import hearing, replay, texts_of
import pytest
from std_msgs.msg import String

from rigid_sim_ros.messages.codec import encode_string

SECOND = 10 ** 9
QOS = 'qos_overrides./chatter.publisher'
COMMAND = [sys.executable, '-m', 'rigid_sim_ros', 'replay']


def complaint(process: Process) -> str:
    """Return the last line that a process wrote to stderr before it ended with code 2."""
    assert process.wait() == 2
    assert 'Traceback' not in process.stderr
    line = process.stderr.splitlines()[-1]
    assert line.startswith('rigid_sim: ')
    return line


@pytest.fixture
def chatter(tmp_path):
    """Give a bag with a message at each of a hundred seconds."""
    return mcap(tmp_path / 'a.mcap', texts('/chatter', 100, SECOND))


@pytest.mark.parametrize('words, expected', [
    ([], 'parameter bag: which one'),
    (['nowhere'], 'nowhere does not exist'),
    (['A', '--rate', '0'], 'parameter rate'),
    (['A', '--rate', 'nan'], 'rate'),
    (['A', '--rate', 'quick'], "'quick'"),
    (['A', '--start', '-1'], '-1'),
    (['A', '--start', '1000'], 'must be at most 99 s'),
    (['A', '--duration', '-1'], '-1'),
    (['A', '--topics', '/chater'], "did you mean '/chatter'"),
    (['A', '--ros-args', '-p', 'rate:=fast'], 'must be a number'),
    (['A', '--ros-args', '-p', f'{QOS}.reliability:=perfect'], 'perfect'),
    (['A', '--ros-args', '-p', f'{QOS}.depth:=deep'], 'depth'),
    (['A', '--qos-profile-overrides-path', 'nowhere.yaml'], 'nowhere.yaml'),
    (['A', '--ros-args', '-p', 'topics:=7'], 'list of texts'),
    (['A', '--loops'], '--loops'),
])
def test_wrong_usage_is_one_line_and_code_2(ros, tmp_path, chatter, words, expected) -> None:
    words = [str(chatter) if word == 'A' else word for word in words]
    process = Process(['rigid_sim', 'replay', *words], tmp_path / 'process', is_forked=True)
    line = complaint(process)
    assert expected in line
    assert process.stderr.splitlines() == [line]


def test_a_truncated_bag_is_one_line_and_code_2(ros, tmp_path) -> None:
    bag = shutil.copytree(shared_session(), tmp_path / 'bag')
    file = sorted(bag.glob('*.mcap'))[-1]
    file.write_bytes(file.read_bytes()[:5000])
    assert 'breaks off' in complaint(replay(tmp_path, bag))


def test_a_zeroed_bag_is_one_line_and_code_2(ros, tmp_path) -> None:
    bag = shutil.copytree(shared_session('sqlite3'), tmp_path / 'bag')
    file = sorted(bag.glob('*.db3'))[0]
    file.write_bytes(bytes(file.stat().st_size))
    assert 'is damaged' in complaint(replay(tmp_path, bag))


def test_a_flipped_bit_ends_the_replay_where_it_is_reached(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', texts('/chatter', 300, SECOND // 100), chunk_size=2000)
    data = bytearray(bag.read_bytes())
    data[data.index(b'/chatter 150')] ^= 1
    bag.write_bytes(data)
    with hearing(probe, String, '/chatter') as received:
        process = replay(tmp_path, bag)
        assert 'its checksum does not fit' in complaint(process)
        # The last may still be on their way.
        probe.wait_for(lambda: len(received) > 100)
        heard = texts_of(list(received))
    assert heard == [f'/chatter {k}' for k in range(len(heard))]
    assert len(heard) <= 150


# Prints 'found' once it has found who publishes on a topic, and then what it hears there.
LISTENER = """
import signal
import rclpy
from std_msgs.msg import String
signal.signal(signal.SIGINT, signal.SIG_DFL)
rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
node = rclpy.create_node('listener')

def hear(message):
    print(message.data[:20].strip(), flush=True)

heard = node.create_subscription(String, '/chatter', hear, 99)
while not heard.get_publisher_count():
    rclpy.spin_once(node, timeout_sec=0.1)
print('found', flush=True)
rclpy.spin(node)
"""


def lines_of(file: Path, count: int) -> list[str]:
    """Return the lines of a file, once there are so many."""
    end = time.monotonic() + PATIENCE
    while len(lines := file.read_text(encoding='utf-8').splitlines()) < count:
        assert time.monotonic() < end, f'waited {PATIENCE} s for {count} lines: {lines}'
        time.sleep(0.05)
    return lines


def test_a_subscriber_that_stands_still_at_the_end_still_gets_all(probe, tmp_path) -> None:
    # So large that they do not all find room in the buffers between the two.
    count, step = 40, 0.05
    bag = mcap(tmp_path / 'a.mcap', [
        (int((1.0 + k * step) * SECOND), '/chatter', encode_string(f'{k}'.ljust(200_000)))
        for k in range(count)])
    with kept(Process([sys.executable, '-c', LISTENER], tmp_path / 'listener')) as listener, \
            kept(replay(tmp_path, bag, paused=True)) as process:
        heard = tmp_path / 'listener' / 'stdout'
        lines_of(heard, 1)
        probe.pause(False, '/replay')
        lines_of(heard, 1 + count // 2)
        # Until six seconds after the last message was sent.
        listener.signal(signal.SIGSTOP)
        time.sleep(count // 2 * step + 6.0)
        listener.signal(signal.SIGCONT)
        assert process.wait() == 0
        assert lines_of(heard, 1 + count) == ['found', *(f'{k}' for k in range(count))]


def test_without_a_terminal_nothing_is_drawn(ros, tmp_path, chatter) -> None:
    done = subprocess.run(
        [*COMMAND, str(chatter), '--rate', '1000', '--ros-args', '-p', 'subscriber_timeout:=0.0'],
        stdin=subprocess.DEVNULL, capture_output=True, cwd=ROOT, timeout=PATIENCE, check=True)
    assert done.stdout == b''


class Terminal:
    """The command in a terminal of its own."""

    def __init__(self, *words: str) -> None:
        self.text = ''
        self._main, self.side = pty.openpty()
        self.before = termios.tcgetattr(self.side)
        # As a shell starts it: in the foreground of its own session.
        self._process = subprocess.Popen(
            [sys.executable, '-c', 'import os, sys, fcntl, termios; os.setsid(); '
             'fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execv(sys.argv[1], sys.argv[1:])',
             *COMMAND, *words], stdin=self.side, stdout=self.side, stderr=self.side, cwd=ROOT)
        os.set_blocking(self._main, False)

    def press(self, keys: str) -> None:
        os.write(self._main, keys.encode())

    def signal(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def shows(self, pattern: str) -> 're.Match[str]':
        """Wait until what was drawn since the last time matches."""
        end = time.monotonic() + PATIENCE
        while not (match := re.search(pattern, self._read())):
            assert time.monotonic() < end, self.text
            assert self._process.poll() is None, self.text
            time.sleep(0.02)
        self.text = self.text[match.end():]
        return match

    def waits_until(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, self._read()
            time.sleep(0.02)

    def is_raw(self) -> bool:
        return not termios.tcgetattr(self.side)[3] & termios.ICANON

    def wait(self) -> int:
        end = time.monotonic() + PATIENCE
        while self._process.poll() is None:
            self._read()
            assert time.monotonic() < end, self.text
            time.sleep(0.02)
        return self._process.returncode

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        os.close(self._main)
        os.close(self.side)

    def _read(self) -> str:
        try:
            data = os.read(self._main, 1 << 16).decode(errors='replace')
        except BlockingIOError:
            data = ''
        self.text += re.sub(r'\x1b\[[0-9;?]*[a-zA-Z]', '', data)
        return self.text


@pytest.fixture
def terminal(ros, chatter):
    terminals = []

    def start(*words: str) -> Terminal:
        terminals.append(Terminal(str(chatter), *words, '--ros-args', '-p',
                                  'subscriber_timeout:=0.0'))
        return terminals[-1]

    yield start
    for each in terminals:
        each.close()


def test_a_terminal_shows_elapsed_and_total_time_and_the_rate(terminal) -> None:
    shown = terminal('--rate', '2', '--start', '30').shows(r'(\d+\.\d\d) / 99\.00 s +x2')
    assert 30.0 <= float(shown[1]) < 99.0


def test_space_pauses_and_resumes(terminal) -> None:
    window = terminal()
    window.shows('/ 99.00 s +x1')
    window.press(' ')
    window.shows('/ 99.00 s paused')
    window.press(' ')
    window.shows('/ 99.00 s +x1')


def test_arrows_seek_by_five_seconds(terminal) -> None:
    window = terminal('--pause', '--start', '50')
    window.shows(' 50.00 / 99.00 s paused')
    window.press('\x1b[C')
    window.shows(' 55.00 / ')
    window.press('\x1bOC\x1bOC')
    window.shows(' 65.00 / ')
    window.press('\x1b[D')
    window.shows(' 60.00 / ')


def test_arrows_change_the_rate(terminal) -> None:
    window = terminal('--rate', '0.01')
    window.shows('x0.01')
    window.press('\x1b[A')
    window.shows('x0.02')
    window.press('\x1b[B')
    window.shows('x0.01')


@pytest.mark.parametrize('key', ['s', 'n'])
def test_a_key_steps(terminal, key) -> None:
    window = terminal('--pause', '--start', '50.5')
    window.shows(' 50.50 / 99.00 s paused')
    window.press(key)
    window.shows(' 51.00 / 99.00 s paused')


@pytest.mark.parametrize('end', ['q', '\x03'])
def test_the_terminal_is_as_before_at_the_end(terminal, end) -> None:
    window = terminal('--loop')
    window.shows('/ 99.00 s +x1')
    window.waits_until(window.is_raw)
    window.press(end)       # Ctrl-C comes as a signal
    assert window.wait() == 0
    assert termios.tcgetattr(window.side) == window.before


def test_the_terminal_is_as_before_when_the_bag_turns_out_damaged(ros, tmp_path) -> None:
    bag = mcap(tmp_path / 'b.mcap', texts('/chatter', 300, SECOND // 100), chunk_size=2000)
    data = bytearray(bag.read_bytes())
    data[data.index(b'/chatter 250')] ^= 1
    bag.write_bytes(data)
    window = Terminal(str(bag), '--pause', '--ros-args', '-p', 'subscriber_timeout:=0.0')
    try:
        window.waits_until(window.is_raw)
        window.press(' ')
        assert window.wait() == 2
        assert 'its checksum does not fit' in window.text
        assert termios.tcgetattr(window.side) == window.before
    finally:
        window.close()


def test_keys_work_again_after_a_stop_in_the_shell(terminal) -> None:
    window = terminal('--loop')
    window.waits_until(window.is_raw)
    window.signal(signal.SIGSTOP)
    termios.tcsetattr(window.side, termios.TCSANOW, window.before)     # as a shell does
    window.signal(signal.SIGCONT)
    window.waits_until(window.is_raw)
    window.press('q')
    assert window.wait() == 0
