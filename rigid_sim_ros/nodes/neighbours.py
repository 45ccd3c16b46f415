# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether something is there twice that should be there once: this node's name, or its topics.

A second simulation or a replay beside its live node is easily started, and then whoever listens
hears both.
"""

from collections.abc import Callable, Iterable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

# Topics that many nodes publish by convention.
_SHARED = frozenset({'/diagnostics', '/parameter_events', '/rosout', '/tf', '/tf_static'})
_PERIOD = 1.0       # s of wall time between two looks
_MOST_NAMES = 3


class Neighbours:
    """Looks around once a second, and warns once of each neighbour that should not be there."""

    def __init__(self, node: Node, topics: Callable[[], Iterable[str]]) -> None:
        """Look after the name of a node, and after topics of its own by their full names."""
        self._node = node
        self._topics = topics
        self._known: set[str] = set()
        # A node with use_sim_time would not look while its time stands.
        node.create_timer(_PERIOD, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def look(self) -> None:
        """Warn of what was not there at the last look."""
        found = self._found()
        for who in sorted(found.keys() - self._known):
            self._node.get_logger().warning(found[who])
        self._known = set(found)

    def _found(self) -> dict[str, str]:
        """Return a line for each neighbour."""
        own = self._node.get_fully_qualified_name()
        names = [_full(*each) for each in self._node.get_node_names_and_namespaces()]
        lines = {}
        if names.count(own) > 1:
            lines[own] = (f'another node is called {own} too: what is sent to one may reach the '
                          'other; start one of them with `--ros-args -r __node:=NAME`')
        both: dict[str, list[str]] = {}
        for topic in sorted(set(self._topics()) - _SHARED):
            for who in self._others(topic, own):
                both.setdefault(who, []).append(topic)
        for who, topics in both.items():
            more = f' and {len(topics) - _MOST_NAMES} more' if len(topics) > _MOST_NAMES else ''
            lines[who] = (
                f'{who} publishes {", ".join(topics[:_MOST_NAMES])}{more} too: whoever listens '
                'hears both; end one of them, rename it, or remap the topics'
                + ('; publish_clock: false leaves /clock to the other'
                   if self._node.has_parameter('publish_clock') else ''))
        return lines

    def _others(self, topic: str, own: str) -> set[str]:
        if self._node.count_publishers(topic) < 2:
            return set()
        publishers = self._node.get_publishers_info_by_topic(topic)
        return {_full(each.node_name, each.node_namespace) for each in publishers} - {own}


def _full(name: str, namespace: str) -> str:
    return f'{namespace.rstrip("/")}/{name}'
