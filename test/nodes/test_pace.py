# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters that change while the node runs, the real-time factor above all.

No wall time is asserted: what the node says about its pace is compared with wide margins, which
only a factor that is not followed leaves.
"""
from importlib.util import find_spec
from itertools import pairwise
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from diagnostic_msgs.msg import DiagnosticArray
from nodes.live import nanoseconds, running
from nodes.scenes import crates
import pytest
from rcl_interfaces.srv import DescribeParameters
from sensor_msgs.msg import MultiDOFJointState

from rigid_sim_ros.nodes.parameters import default_parameters, is_live


@pytest.fixture(scope='module')
def sim(probe, tmp_path_factory):
    folder = tmp_path_factory.mktemp('sim')
    with running(folder, str(crates(folder))):
        yield


def pace(probe):
    """Return the pace of a whole window of diagnostics that begins now."""
    message = probe.some(DiagnosticArray, '/diagnostics', 2)[1]
    status = next(s for s in message.status if s.name.endswith('pace'))
    return {v.key: v.value for v in status.values}


def test_the_real_time_factor_follows_its_parameter(probe, sim):
    for factor in (0.2, 3.0):
        assert probe.set_parameter('real_time_factor', factor).successful

        def follows(factor: float = factor) -> bool:
            """On a machine that has no time for the node, it does so later."""
            values = pace(probe)
            return values['real-time factor wanted'] == f'{factor:g}' and (
                factor / 2 < float(values['real-time factor']) < factor * 1.5)

        probe.wait_for(follows, f'a pace of about {factor}')


def test_factor_0_is_as_fast_as_possible(probe, sim):
    assert probe.set_parameter('publish_rate', 1.0).successful
    assert probe.set_parameter('real_time_factor', 0.0).successful

    def is_fast():
        values = pace(probe)
        return values['real-time factor wanted'] == 'unlimited' and float(
            values['real-time factor']) > 4.0

    probe.wait_for(is_fast, 'four times real time without a limit')
    assert probe.set_parameter('real_time_factor', 1.0).successful
    assert probe.set_parameter('publish_rate', 100.0).successful


def test_the_publish_rate_follows_its_parameter(probe, sim):
    assert probe.set_parameter('publish_rate', 250.0).successful
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:

        def periods():
            stamps = [nanoseconds(m.header.stamp) for m in states[-20:]]
            return {b - a for a, b in pairwise(stamps)} if len(stamps) == 20 else set()

        # The step thread takes the rate over when it gets to it, after the answer.
        probe.wait_for(lambda: periods() == {4_000_000}, '20 states, 4 ms after each other')
    assert probe.set_parameter('publish_rate', 100.0).successful


@pytest.mark.parametrize('name, value', [
    ('real_time_factor', -1.0), ('real_time_factor', float('nan')),
    ('real_time_factor', float('inf')), ('publish_rate', -1.0), ('wrench_timeout', -0.1),
    ('hash_interval', -1), ('scene', 'other'), ('frame_id', 'map'), ('qos.pose.depth', 5),
    ('publish_tf', True),
])
def test_a_value_out_of_range_or_read_only_is_refused(probe, sim, name, value):
    assert not probe.set_parameter(name, value).successful


def test_every_parameter_has_a_description_and_says_whether_it_is_live(probe, sim):
    names = list(default_parameters())
    answer = probe.call(DescribeParameters, '/rigid_sim/describe_parameters',
                        DescribeParameters.Request(names=names))
    assert [d.name for d in answer.descriptors] == names
    assert all(d.description for d in answer.descriptors)
    assert [d.name for d in answer.descriptors if not d.read_only] == [
        name for name in names if is_live(name)]


def test_the_parameters_of_the_contract_are_in_the_file():
    assert {'scene', 'frame_id', 'real_time_factor', 'publish_rate', 'wrench_timeout',
            'publish_clock', 'publish_tf', 'publish_markers', 'bodies',
            'hash_interval'} <= default_parameters().keys()
