# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The RViz config and the Foxglove layout show a default run: their topics exist, of the right type.

The markers of the same run disappear with it.
"""
from collections import Counter
from importlib import import_module
from importlib.util import find_spec
import json
import signal
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from nodes.live import nanoseconds, ROOT, running
import pytest
from ruamel.yaml import YAML
from visualization_msgs.msg import Marker, MarkerArray

LAYOUT = json.loads((ROOT / 'msg_config' / 'foxglove_layout.json').read_text(encoding='utf-8'))
PANELS = LAYOUT['configById']
RVIZ = YAML(typ='safe').load((ROOT / 'msg_config' / 'rigid_sim.rviz').read_text(encoding='utf-8'))
MANAGER = RVIZ['Visualization Manager']
# What a display subscribes to, as rviz_default_plugins declares it.
DISPLAYS = {'rviz_default_plugins/MarkerArray': 'visualization_msgs/msg/MarkerArray'}
WITHOUT_TOPIC = {'rviz_default_plugins/Grid', 'rviz_default_plugins/Axes',
                 'rviz_default_plugins/TF'}


@pytest.fixture(scope='module')
def sim(ros, tmp_path_factory):
    """Run the default scene with default parameters."""
    with running(tmp_path_factory.mktemp('sim'), 'tower') as process:
        yield process


@pytest.fixture(scope='module')
def topics(probe, sim):
    """Return the topics of the node and their types, once those that layouts name are known."""
    named = {display['Topic']['Value'] for display in MANAGER['Displays']
             if display['Class'] in DISPLAYS}
    named |= {name for panel in panels_of('3D').values() for name in panel['topics']}
    named |= {path['value'].partition('.')[0] for panel in panels_of('Plot').values()
              for path in panel['paths']}
    probe.wait_for(lambda: named <= probe.publishers_of('rigid_sim').keys(), str(named))
    return {name: types[0] for name, types in probe.publishers_of('rigid_sim').items()}


def interface(name):
    """Return the class of geometry_msgs/msg/Pose, or of geometry_msgs/Pose as fields have it."""
    *package, last = name.split('/')
    return getattr(import_module('.'.join(package if len(package) > 1 else [*package, 'msg'])),
                   last)


def panels_of(kind):
    return {name: panel for name, panel in PANELS.items() if name.startswith(f'{kind}!')}


def test_each_rviz_display_shows_a_topic_that_the_node_publishes_with_that_type(topics):
    displays = {d['Class']: d for d in MANAGER['Displays']}
    assert displays.keys() == DISPLAYS.keys() | WITHOUT_TOPIC
    for kind, message in DISPLAYS.items():
        assert topics[displays[kind]['Topic']['Value']] == message


def test_rviz_s_fixed_frame_is_the_one_of_the_messages(probe, topics):
    message, = probe.some(MarkerArray, '/rigid_sim/markers')
    assert {m.header.frame_id for m in message.markers} == {
        MANAGER['Global Options']['Fixed Frame']}


def test_rviz_s_namespaces_are_those_of_the_contact_markers(probe, topics):
    namespaces = {m.ns for message in probe.some(MarkerArray, '/rigid_sim/markers', 4)
                  for m in message.markers if m.ns.startswith('contact_')}
    display, = (d for d in MANAGER['Displays'] if d['Name'] == 'Markers')
    assert set(display['Namespaces']) == namespaces


def test_foxglove_s_3d_panel_shows_the_markers(topics):
    (panel,) = panels_of('3D').values()
    assert {name: topics[name] for name in panel['topics']} == {
        '/rigid_sim/markers': 'visualization_msgs/msg/MarkerArray'}
    assert panel['followTf'] == MANAGER['Global Options']['Fixed Frame']


@pytest.mark.parametrize('path', [path['value'] for panel in panels_of('Plot').values()
                                  for path in panel['paths']])
def test_a_line_of_a_foxglove_plot_is_a_number_of_a_message(topics, path):
    topic, _, fields = path.partition('.')
    kind = topics[topic]
    for field in fields.split('.'):
        kind = interface(kind).get_fields_and_field_types()[field]
    assert kind == 'double'


def test_foxglove_s_diagnostics_are_a_topic_of_diagnostics(topics):
    (panel,) = panels_of('DiagnosticSummary').values()
    assert topics[panel['topicToRender']] == 'diagnostic_msgs/msg/DiagnosticArray'


@pytest.mark.parametrize('name', panels_of('CallService'))
def test_a_button_of_foxglove_calls_a_service_with_a_request_that_fits(probe, topics, name):
    service = PANELS[name]['serviceName']
    kind, = probe.wait_for(lambda: probe.services_of('rigid_sim').get(service), service)
    request = json.loads(PANELS[name]['requestPayload'])
    interface(kind).Request(**request)


def test_every_panel_of_the_foxglove_layout_has_its_place():
    def leaves(node):
        if isinstance(node, str):
            return [node]
        return leaves(node['first']) + leaves(node['second'])
    assert Counter(leaves(LAYOUT['layout'])) == Counter(list(PANELS))


def test_each_marker_is_deleted_once_when_the_simulation_ends(probe, sim, topics):
    with probe.listening(MarkerArray, '/rigid_sim/markers') as received:
        probe.wait_for(lambda: len(received) > 4, 'markers')
        sim.signal(signal.SIGINT)
        assert sim.wait() == 0
        shown = {(m.ns, m.id) for array in received for m in array.markers
                 if m.action == Marker.ADD}
        # All at once, in two messages: the bodies, and the contacts.
        probe.wait_for(lambda: deleted(received).keys() >= shown and {
            m.action for array in received[-2:] for m in array.markers} == {Marker.DELETE},
            'the deletes')
    found = deleted(received)
    assert shown
    assert {key: count for key, count in found.items()
            if not key[0].startswith('contact_')} == dict.fromkeys(
                [key for key in found if not key[0].startswith('contact_')], 1)
    last = received[-2:]
    assert {m.action for array in last for m in array.markers} == {Marker.DELETE}
    assert nanoseconds(last[0].markers[0].header.stamp) > 0


def deleted(received):
    return Counter((m.ns, m.id) for array in received for m in array.markers
                   if m.action == Marker.DELETE)
