# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether all that a session published is in its bag, and nothing else.

That what is there is right does not say that nothing was taken out. The session lists the topics;
what each must carry follows from its type, and which bodies have topics from a parameter. At the
start of each file and at the end of the recording an event tells how many messages each topic had
by then. So a message, a topic or a file that was taken out is missed.
"""

from collections import Counter
from collections.abc import Iterable, Mapping

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.joint_messages import JointMessages
from rigid_sim_ros.bag.session import Session
from rigid_sim_ros.words import matching
from rigid_sim_ros.world import World

# Types that a node has on topics of certain kinds only.
_KINDS: dict[str, set[str]] = {}
for _kind in (kinds.CLOCK, kinds.POSE, kinds.TWIST, kinds.STATE, kinds.TRANSFORMS,
              kinds.STATE_HASH, kinds.STEP, kinds.SNAPSHOT, kinds.JOINT_STATES,
              kinds.ALL_JOINT_STATES):
    _KINDS.setdefault(kinds.TYPES[_kind], set()).add(_kind)

# Kinds with one topic, and the parameter that asks for it. A node has some in any case, and it has
# `bodies`.
_ASKED_FOR = (('bodies', kinds.STATE), ('bodies', kinds.STATE_HASH),
              ('publish_clock', kinds.CLOCK), ('publish_tf', kinds.TRANSFORMS),
              ('publish_joint_states', kinds.ALL_JOINT_STATES))
# Kinds with a topic for each body, all of which are published together.
_OF_BODIES = (kinds.POSE, kinds.TWIST)


def wrong_topics(session: Session, world: World, is_part: bool, joints: JointMessages) -> str:
    """
    Return what is wrong with the topics that a session lists, '' if nothing is.

    The world, and its `joints`, are as in the first full state: when the session begins, or later
    in a part of it. Then some bodies may have gone that had topics, and some have come that have
    none; sure to have some are those that the world began with and has never been without.
    """
    bodies = world.lasting_bodies if is_part else world.names
    for topic in session.topics:
        if topic.kind not in _KINDS.get(topic.type, {topic.kind}) or (
                topic.kind and topic.type != kinds.TYPES.get(topic.kind)):
            return (f'the session lists {topic.name} of the type {topic.type} as {topic.kind!r}, '
                    'which it cannot be')
        if topic.kind in (*_OF_BODIES, kinds.APPLIED_WRENCH) and not is_part and (
                topic.body not in bodies):
            return f'the session lists {topic.name} of the body {topic.body!r}, which there is not'
        if topic.kind in kinds.OF_JOINTS and not is_part and (
                topic.body not in joints.owners(topic.kind)):
            return f'the session lists {topic.name} of {topic.body!r}, which there is not'
    if len(session.by_name) < len(session.topics):
        return 'the session lists a topic twice'
    listed = Counter((topic.kind, topic.body) for topic in session.topics)
    for own in kinds.own_topics(session.node):
        if own not in session.topics or listed[own.kind, ''] != 1:
            return f'the session does not list {own.name} as it must be'
    for model in () if is_part else joints.models:
        if listed[kinds.JOINT_STATES, model] != 1:
            return f'the session does not list the joint states of {model!r}, as it must'
    return _not_listed(session, listed, bodies, () if is_part else joints.joints)


def _not_listed(session: Session, listed: Counter[tuple[str, str]], bodies: Iterable[str],
                joints: Iterable[str]) -> str:
    """Return which topic the parameters ask for that the session does not list, '' if none."""
    asked = session.parameters
    for parameter, kind in _ASKED_FOR:
        if asked.get(parameter) not in (None, False) and listed[kind, ''] != 1:
            return f'the session does not list the {kind}, as it must with {parameter!r}'
    for parameter, names, wanted in (('bodies', bodies, _OF_BODIES),
                                     ('joint_wrenches', joints, (kinds.JOINT_WRENCH,))):
        patterns = asked.get(parameter)
        for name in matching(names, map(str, patterns if isinstance(patterns, list) else ())):
            for kind in wanted:
                if listed[kind, name] != 1:
                    return f'the session does not list the {kind} of {name!r}, as it must'
    return ''


class Tally:
    """Compares how many messages there are with how many there must be."""

    def __init__(self, session: Session, seen: Counter[str]) -> None:
        """Take the counts of the messages by topic, which whoever reads them keeps."""
        self._seen = seen
        self._session = session
        self._is_sure = True        # nothing was lost that nobody counted, since the last mark
        self._was_sure = True       # nor before
        self.gone: set[str] = set()     # bodies that were removed, which say no more

    def lose(self) -> None:
        """Note that something is missing of which nobody knows how much."""
        self._is_sure = self._was_sure = False

    def mark(self, told: Mapping[str, int]) -> str:
        """
        Compare with what an event tells that was written before it.

        Returns what is missing, '' if nothing is.
        """
        event, = (t.name for t in self._session.topics if t.kind == kinds.EVENT)
        # The event itself is read already, and was not written then.
        seen = self._seen - Counter({event: 1})
        if not self._is_sure:
            self._seen.clear()
            self._seen.update({**told, event: told.get(event, 0) + 1})
            self._is_sure = True
            return ''
        for name in sorted({*seen, *told}):
            if name in self._session.by_name and seen[name] != told.get(name, 0):
                return (f'{told.get(name, 0)} messages on {name} were recorded so far, and '
                        f'{seen[name]} are there')
        return ''

    def finish(self, types: Mapping[str, str]) -> str:
        """Return what does not fit at the end, '' if all does; `types` are those in the files."""
        for topic in self._session.topics:
            if self._seen[topic.name] and types.get(topic.name) != topic.type:
                return (f'{topic.name} is of the type {types.get(topic.name)!r}, in the list of '
                        f'the session of {topic.type}')
        for kind in _OF_BODIES if self._was_sure else ():
            counts = {topic.name: self._seen[topic.name] for topic in self._session.topics
                      if topic.kind == kind and topic.body not in self.gone}
            least = min(counts, key=lambda name: counts[name], default='')
            if counts and counts[least] < max(counts.values()):
                return (f'{max(counts.values())} messages tell the {kind} of other bodies, and '
                        f'{counts[least]} are on {least}')
        return ''
