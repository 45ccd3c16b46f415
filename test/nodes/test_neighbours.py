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


def is_told_once(probe, process, text):
    """Wait for a warning, and for the looks of five more seconds, which say it no more."""
    probe.wait_for(lambda: warnings(process, text), f'a warning of {text}')
    probe.wait_for_silence([])
    assert len(warnings(process, text)) == 1, process.stderr


def test_two_clocks_are_told_to_both(probe, tmp_path, scene):
    with running(tmp_path / '1', scene, name='left') as left:
        probe.some(Clock, '/clock')
        assert not warnings(left, '/clock')
        with running(tmp_path / '2', scene, name='right') as right:
            is_told_once(probe, left, '/right publishes /clock too')
            is_told_once(probe, right, '/left publishes /clock too')


def test_two_nodes_of_a_name_are_told_to_both(probe, tmp_path, scene):
    with running(tmp_path / '1', scene, name='twin') as first, running(
            tmp_path / '2', scene, name='twin') as second:
        is_told_once(probe, first, 'another node is called /twin too')
        is_told_once(probe, second, 'another node is called /twin too')


def test_a_replay_beside_its_live_node_is_told_to_both(probe, tmp_path, scene):
    bag = mcap(tmp_path / 'a.mcap', texts('/live/state', 3, 10**9))
    with running(tmp_path / '1', scene, name='live', publish_clock=False), replaying(
            tmp_path / '2', bag, clock_rate=0.0) as replay:
        is_told_once(probe, replay, '/live publishes /live/state too')
