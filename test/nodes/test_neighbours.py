# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is there twice is told so once, at the start and later."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from bag.foreign import mcap, texts
from nodes.live import running
from nodes.replays import replaying
from nodes.scenes import crates
import pytest
from rosgraph_msgs.msg import Clock


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return str(crates(tmp_path_factory.mktemp('scene')))


def warnings(process, text):
    return [line for line in process.stderr.splitlines() if '[WARN]' in line and text in line]


def are_told_once(probe, *told):
    """Wait for warnings, and for the looks of five more seconds, which say no more."""
    for process, text in told:
        probe.wait_for(lambda: warnings(process, text), f'a warning of {text}')    # noqa: B023
    probe.wait_for_silence([])
    for process, text in told:
        assert len(warnings(process, text)) == 1, process.stderr


def test_two_clocks_are_told_to_both(probe, tmp_path, scene):
    with running(tmp_path / '1', scene, name='left') as left:
        probe.some(Clock, '/clock')
        assert not warnings(left, '/clock')
        with running(tmp_path / '2', scene, name='right') as right:
            are_told_once(probe, (left, '/right publishes /clock too'),
                          (right, '/left publishes /clock too'))


def test_two_nodes_of_a_name_are_told_to_both(probe, tmp_path, scene):
    with running(tmp_path / '1', scene, name='twin') as first, running(
            tmp_path / '2', scene, name='twin') as second:
        are_told_once(probe, (first, 'another node is called /twin too'),
                      (second, 'another node is called /twin too'))


def test_a_replay_beside_its_live_node_is_told_to_both(probe, tmp_path, scene):
    bag = mcap(tmp_path / 'a.mcap', texts('/live/state', 3, 10**9))
    with running(tmp_path / '1', scene, name='live', publish_clock=False), replaying(
            tmp_path / '2', bag, clock_rate=0.0) as replay:
        are_told_once(probe, (replay, '/live publishes /live/state too'))
