# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How soon a node hears what has not arrived."""
from importlib.util import find_spec
from unittest import SkipTest
from xml.etree import ElementTree

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

import pytest

from rigid_sim_ros.nodes import process
from rigid_sim_ros.nodes.delivery import HEARTBEATS

NAMES = 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'


@pytest.mark.parametrize('named', NAMES)
def test_fast_dds_is_told_by_the_file_of_the_user_or_of_the_package(monkeypatch, named):
    """The environment is what Fast DDS finds as ROS starts."""
    found = {}
    monkeypatch.setattr(process.rclpy, 'init', lambda **_: found.update(process.os.environ))
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    process.start_ros([])
    assert [found[name] for name in NAMES] == 2 * [str(HEARTBEATS)]
    for name in NAMES:
        monkeypatch.delenv(name)
    monkeypatch.setenv(named, 'own.xml')
    found.clear()
    process.start_ros([])
    assert [found.get(name) for name in NAMES] == ['own.xml' if name == named else None
                                                   for name in NAMES]


def test_every_publisher_asks_several_times_a_second():
    space = '{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}'
    profile, = ElementTree.parse(HEARTBEATS).getroot().iter(f'{space}publisher')
    assert profile.get('is_default_profile') == 'true'
    period, = profile.iter(f'{space}heartbeatPeriod')
    seconds, nanoseconds = (int(part.text) for part in period)
    assert 0 < seconds + 1e-9 * nanoseconds < 1     # the default is 3 s
