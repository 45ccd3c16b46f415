# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""After a stall a replay goes on where it was: what would have come meanwhile is no burst."""
from collections.abc import Sequence
from importlib.util import find_spec
import threading
import time
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.foreign import mcap, texts

from rigid_sim_ros.bag.playable_files import Message
from rigid_sim_ros.bag.playback import PlayableBag
from rigid_sim_ros.nodes.pacing import CATCH_UP_NS
from rigid_sim_ros.nodes.replay.player import Player, Settings

SECOND = 10 ** 9
STALL = 0.5                 # s
PERIOD_NS = SECOND // 100


class SlowOutputs:
    """Stands in for publishers of which one call takes long, as with a full network."""

    def __init__(self, slow: int) -> None:
        self.names = frozenset({'/chatter'})
        self.arrived: list[tuple[int, int]] = []    # time of the bag, wall time
        self._slow = slow

    def begin(self, at_ns: int, latched: Sequence[Message]) -> None:
        pass

    def publish(self, file: int, messages: Sequence[Message]) -> int:
        for stamp, _, _ in messages:
            if len(self.arrived) == self._slow:
                time.sleep(STALL)
            self.arrived.append((stamp, time.monotonic_ns()))
        return len(messages)

    def make_clock(self) -> bool:
        return False


class Log:
    """Keeps warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warning(self, text: str) -> None:
        self.warnings.append(text)


def play(folder, outputs: SlowOutputs, during=lambda player: None) -> tuple[Log, list[int]]:
    """Play a second of messages and return how late each was beside the most punctual [ns]."""
    bag = PlayableBag(mcap(folder / 'a.mcap', texts('/chatter', 100, PERIOD_NS)))
    log = Log()
    player = Player(bag, outputs, Settings(0, None, 1.0, False, 0.0, False), log)
    thread = threading.Thread(target=player.run)
    thread.start()
    during(player)
    thread.join()
    # Not beside the first: on a busy machine that one may be late itself.
    offsets = [wall - bag for bag, wall in outputs.arrived]
    return log, [offset - min(offsets) for offset in offsets]


def test_after_a_stall_all_comes_in_order_and_later(tmp_path) -> None:
    outputs = SlowOutputs(slow=50)
    log, behind = play(tmp_path, outputs)
    assert [stamp for stamp, _ in outputs.arrived] == [
        SECOND + k * PERIOD_NS for k in range(100)]
    # Had it been made up for, the last would be as punctual as those before it. Nothing here can
    # make a message early, however busy the machine is.
    assert behind[-1] >= STALL * SECOND - CATCH_UP_NS - PERIOD_NS
    assert len(log.warnings) == 1 and 'behind' in log.warnings[0]


def test_after_a_pause_nothing_is_made_up_for(tmp_path) -> None:
    outputs = SlowOutputs(slow=-1)

    def pause(player: Player) -> None:
        while len(outputs.arrived) < 20:
            time.sleep(0.001)
        assert player.ask('pause', True)[0]
        time.sleep(STALL)
        assert player.ask('pause', False)[0]

    _, behind = play(tmp_path, outputs, pause)
    # Had time gone on in the pause, a catch-up of it would be made up for; as it is, all of it is
    # left, less how late the most punctual message was.
    assert behind[-1] >= STALL * SECOND - CATCH_UP_NS // 2


def test_a_question_after_the_end_is_answered(tmp_path) -> None:
    players: list[Player] = []
    play(tmp_path, SlowOutputs(slow=-1), players.append)
    assert players[0].ask('step') == (False, 'the replay has ended')
