# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file of the replay starts the installed node, where launch is installed."""
from importlib.util import find_spec
import sys
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.foreign import mcap, texts
from nodes.launching import LAUNCH    # skips this too where there is no launch
from nodes.live import kept, Process, ROOT
from nodes.replays import hearing, texts_of
from std_msgs.msg import String

SECOND = 10 ** 9


def test_the_arguments_of_the_launch_file_are_those_of_the_node(probe, tmp_path) -> None:
    bag = mcap(tmp_path / 'a.mcap', sorted(
        texts('/chatter', 40, SECOND // 20) + texts('/other', 40, SECOND // 20)))
    file = str(ROOT / 'launch' / 'replay.launch.py')
    words = [f'bag:={bag}', 'rate:=5.0', 'start:=1.0', 'duration:=0.5', 'topics:=/chatter /o*']
    with hearing(probe, String, '/chatter') as received, hearing(probe, String, '/other') as other:
        with kept(Process([sys.executable, '-c', LAUNCH, file, *words], tmp_path / 'x')) as launch:
            assert launch.wait() == 0
        probe.wait_for(lambda: len(received) == len(other) == 11)
    assert texts_of(received) == [f'/chatter {k}' for k in range(20, 31)]
