# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every value that a parameter may have works, and every call of a service is answered."""
from importlib.util import find_spec
import signal
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from nodes.live import running
from nodes.scenes import crates
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

SMALLEST = 5e-324       # the smallest number above 0
FLOOD = 3000            # calls that wait at the same time


@pytest.fixture(scope='module')
def sim(probe, tmp_path_factory):
    folder = tmp_path_factory.mktemp('sim')
    with running(folder, str(crates(folder)), publish_rate=50, real_time_factor=1) as process:
        yield process


def range_of(probe, name):
    described = probe.call(DescribeParameters, '/rigid_sim/describe_parameters',
                           DescribeParameters.Request(names=[name])).descriptors[0]
    found, = described.floating_point_range
    return found


@pytest.mark.parametrize('name', [
    'real_time_factor', 'publish_rate', 'clock_rate', 'marker_rate', 'diagnostics_rate',
    'wrench_timeout', 'bag_segment_duration'])
def test_the_node_lives_with_every_value_of_a_range(probe, sim, name):
    allowed = range_of(probe, name)
    for value in (SMALLEST, allowed.to_value, allowed.from_value, 1):
        answer = probe.set_parameter(name, value)
        assert answer.successful, answer.reason
        assert probe.pause(True).success        # the step thread has taken the value, and lives
        assert probe.trigger('/rigid_sim/step').success
        assert probe.pause(False).success


def test_the_node_starts_with_tiny_numbers(probe, tmp_path):
    # ROS reads numbers below 2.2e-308 as text.
    with running(tmp_path, str(crates(tmp_path)), name='slow', real_time_factor=1e-307,
                 publish_rate=1e-307, diagnostics_rate=1e-307):
        assert probe.pause(True, '/slow').success
        assert probe.trigger('/slow/step').success


@pytest.mark.parametrize('text', ['\x1b[2J', 'a\nb', '\u202e'])
def test_a_text_that_would_move_the_cursor_is_refused(probe, sim, text):
    answer = probe.set_parameter('bag_path', text)
    assert not answer.successful
    assert answer.reason.isprintable()


def test_a_parameter_of_a_type_that_there_is_not_does_not_end_the_node(probe, sim):
    client = probe.client(SetParameters, '/rigid_sim/set_parameters')
    probe.wait_for(client.service_is_ready)
    odd = Parameter(name='publish_rate', value=ParameterValue(type=99))
    client.call_async(SetParameters.Request(parameters=[odd]))
    probe.wait_for(lambda: 'cannot read: 99' in sim.stderr)
    probe.node.destroy_client(client)
    assert probe.set_parameter('publish_rate', 50.0).successful


def test_a_flood_of_calls_is_answered_to_the_last(probe, sim):
    client = probe.client(Trigger, '/rigid_sim/step', qos_profile=QoSProfile(depth=2 * FLOOD))
    try:
        probe.wait_for(client.service_is_ready)
        probe.meet('/rigid_sim')
        # While the node stands still: what it cannot take at once waits.
        sim.signal(signal.SIGSTOP)
        futures = [client.call_async(Trigger.Request()) for _ in range(FLOOD)]
        sim.signal(signal.SIGCONT)
        probe.wait_for(lambda: all(future.done() for future in futures), f'{FLOOD} answers')
    finally:
        probe.node.destroy_client(client)
