# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A description becomes bodies and joints, as a user would write them in a scene.

A link with a mass is a body. One without cannot be, nor one with moments of inertia that no body
has, such as a camera that is written as a point: it becomes a frame of the body that fixed joints
hold it on. Its shapes are that body's, and so is its mass: what moves, moves as the file says.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
import math
import re
from typing import Any, Protocol

from rigid_sim_ros.models.description import Frame, Joint, Link, Model, MOST_LINKS, Shape
from rigid_sim_ros.models.findings import Findings, Place
from rigid_sim_ros.models.inertia import mended, mistake, together
from rigid_sim_ros.models.poses import combined, IDENTITY, inverse, Pose
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.words import similar

_ONE_AXIS = ('revolute', 'continuous', 'prismatic')


@dataclass(frozen=True)
class Wish:
    """What a scene says of a model beside its file."""

    name: str
    pose: Pose = IDENTITY
    fixed_base: bool | None = None      # None: as the file has it
    joints: Mapping[str, float] = field(default_factory=dict)   # positions at the start
    drives: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)   # by joint
    unlimited: frozenset[str] = frozenset()     # joints whose bounds are left out
    mend_inertia: bool = False
    material: str = 'default'
    visuals: bool = True    # whether bodies are drawn as the file says


@dataclass
class Parts:
    """Bodies, joints and pairs of bodies that never touch, in the words of a scene."""

    bodies: list[dict[str, Any]] = field(default_factory=list)
    joints: list[dict[str, Any]] = field(default_factory=list)
    ignore: list[list[str]] = field(default_factory=list)
    # Where each body and joint stands in the file.
    body_places: list[Place] = field(default_factory=list)
    joint_places: list[Place] = field(default_factory=list)
    notes: list[Problem] = field(default_factory=list)


class MeshReader(Protocol):
    """Gives what meshes are in the words of a scene."""

    def read(self, shape: Shape, is_fixed: bool) -> dict[str, Any]:
        """Return the keys of the solid that a shape is; ValueError where it is none."""

    def drawn(self, shape: Shape, pose: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Return what shows a shape, at its pose in a body; ValueError where nothing does."""


def make_parts(model: Model, wish: Wish, mesh: MeshReader) -> Parts:
    """Return what a model is in a scene; raises ModelError with all that cannot be."""
    return _Maker(model, wish, mesh).made()


class _Maker:
    """Makes the parts of one model."""

    def __init__(self, model: Model, wish: Wish, mesh: MeshReader) -> None:
        self._model, self._wish, self._mesh = model, wish, mesh
        self._findings = Findings()
        self._guests: dict[str, list[Link]] = {}
        if len(model.links) > MOST_LINKS:
            self._findings.error(model.place, f'has {len(model.links)} links, must have '
                                 f'{MOST_LINKS} or fewer')
            self._findings.stop()
        self._links = {link.name: link for link in model.links}
        self._names = self._ros_names()
        self._fixed = self._fixed_links()
        self._host = self._hosts()
        self._has_loops = self._closes_loops()
        self._bounds = self._joint_bounds()

    def made(self) -> Parts:
        self._findings.stop()
        parts = Parts()
        shapes = self._shapes()
        for link in self._model.links:
            if self._host[link.name] == link.name:
                parts.bodies.append(self._body(link, shapes.get(link.name, [])))
                parts.body_places.append(link.place)
        for joint in self._model.joints:
            parent = self._host.get(joint.parent, '')
            if joint.kind == 'fixed' and parent == self._host[joint.child]:
                continue    # it holds a frame on the body
            parts.joints.append(self._joint(joint))
            parts.joint_places.append(joint.place)
        parts.ignore = self._ignored(set(shapes))
        self._findings.stop()
        parts.notes = [*self._model.notes, *self._findings.notes]
        return parts

    # --- names ------------------------------------------------------------------------------

    def _ros_names(self) -> dict[tuple[str, str], str]:
        """Return the names in the scene by kind and name in the file; note those that differ."""
        names: dict[tuple[str, str], str] = {}
        changed: list[str] = []
        kinds: tuple[tuple[str, list[Link | Frame | Joint]], ...] = (
            ('link', [*self._model.links, *self._model.frames]),
            ('joint', [*self._model.joints]))
        for kind, things in kinds:
            taken: dict[str, str] = {}
            for thing in things:
                legal = ros_name(thing.name)
                if legal != thing.name:
                    changed.append(f'{thing.name[:60]!r} is {legal}')
                if taken.setdefault(legal, thing.name) != thing.name or (
                        (kind, thing.name) in names):
                    self._findings.error(thing.place, f'has the name {legal!r} of another '
                                         f'{kind}, as ROS writes it; must have one of its own')
                names[kind, thing.name] = f'{self._wish.name}/{legal}'
        if changed:
            self._findings.note(self._model.place, 'names are written as ROS allows them: '
                                f'{", ".join(changed[:6])}'
                                f'{f" and {len(changed) - 6} more" if len(changed) > 6 else ""}')
        return names

    # --- which links are bodies -------------------------------------------------------------

    def _fixed_links(self) -> set[str]:
        """Return the links that the world holds."""
        wanted = self._wish.fixed_base
        if wanted is None:
            wanted = self._model.is_fixed_by_default
        held = {joint.child for joint in self._model.joints}
        return {link.name for link in self._model.links
                if link.is_fixed or (wanted and link.name not in held)}

    def _hosts(self) -> dict[str, str]:
        """Return for each link the one whose body it belongs to: itself for most."""
        host = {link.name: link.name for link in self._model.links
                if link.name in self._fixed or (link.inertia is not None and not mistake(
                    link.inertia.mass, link.inertia.tensor))}
        children: dict[str, list[str]] = {}
        parents: dict[str, list[str]] = {}
        for joint in self._model.joints:
            if joint.kind == 'fixed' and joint.parent:
                children.setdefault(joint.parent, []).append(joint.child)
                parents.setdefault(joint.child, []).append(joint.parent)

        def spread(start: Iterable[str]) -> None:
            # Towards the base first: a tool frame belongs to the hand. Only what has no mass
            # there, as a base_footprint has none, belongs to what hangs on it.
            start = list(start)
            down, up = deque(start), deque(start)
            while down or up:
                link, ways = (down.popleft(), children) if down else (up.popleft(), parents)
                for neighbour in ways.get(link, ()):
                    if neighbour not in host:
                        host[neighbour] = host[link]
                        down.append(neighbour)
                        up.append(neighbour)

        spread(host)
        for link in self._model.links:
            # Several that are impossible may be possible together.
            if link.name not in host and link.inertia is not None:
                host[link.name] = link.name
                spread([link.name])
        for link in self._model.links:
            if link.name not in host:
                self._report_massless(link)
                host[link.name] = link.name
        return host

    def _report_massless(self, link: Link) -> None:
        by = next((joint for joint in self._model.joints if joint.child == link.name), None)
        if by is None:
            self._findings.error(link.place, 'has no mass and is the base of a free model: '
                                 'must have an <inertial>, or fixed_base: true in the scene')
        elif by.kind == 'fixed':
            self._findings.error(link.place, f'has no mass, and neither has what the fixed joint '
                                 f'{by.name!r} holds it on: one of them must have an <inertial>')
        else:
            self._findings.error(link.place, f'has no mass and hangs on the {by.kind} joint '
                                 f'{by.name!r}: must have an <inertial>, or be held by a fixed '
                                 'joint')

    def _in_host(self, link: str) -> Pose:
        """Return the pose of a link in the body that it belongs to."""
        host = self._host[link]
        if host == link:
            return IDENTITY
        return combined(inverse(self._links[host].pose), self._links[link].pose)

    def _closes_loops(self) -> bool:
        """Return whether joints close loops, whose passive joints must stay without forces."""
        ways = Groups(['', *self._links])
        return not all(ways.join(joint.parent if joint.parent and joint.parent not in self._fixed
                                 else '', joint.child) for joint in self._model.joints)

    # --- bodies -----------------------------------------------------------------------------

    def _shapes(self) -> dict[str, list[dict[str, Any]]]:
        """Return the solids of each body that has some."""
        found: dict[str, list[dict[str, Any]]] = {}
        for link in self._model.links:
            host = self._host[link.name]
            for shape in link.collisions:
                pose = combined(self._in_host(link.name), shape.pose)
                try:
                    values = (self._mesh.read(shape, host in self._fixed)
                              if shape.kind == 'mesh' or shape.mesh is not None
                              else {'type': shape.kind, **shape.values})
                except ValueError as error:
                    self._findings.error(shape.place, str(error))
                    continue
                if shape.kind in ('plane', 'heightfield') and host not in self._fixed:
                    self._findings.error(shape.place, f'is a {shape.kind} on a link that moves, '
                                         'must be another solid, or the link fixed')
                found.setdefault(host, []).append({**values, 'pose': _written(pose)})
        return found

    def _body(self, link: Link, shapes: list[dict[str, Any]]) -> dict[str, Any]:
        body: dict[str, Any] = {
            'name': self._names['link', link.name],
            'pose': _written(combined(self._wish.pose, link.pose)),
            'material': self._wish.material}
        if link.name in self._fixed:
            body['fixed'] = True
        self._add_inertia(link, body)
        if len(shapes) == 1:
            body['shape'] = shapes[0]
        elif shapes:
            body['shape'] = {'type': 'compound', 'compound': shapes}
        color = next((shape.color for shape in (*link.visuals, *link.collisions)
                      if shape.color is not None), None)
        if color is not None:
            body['color'] = list(color)
        visuals = self._visuals(link)
        if visuals:
            body['visuals'] = visuals
        frames = {name: _written(pose) for name, pose in self._frames(link.name)}
        if frames:
            body['frames'] = frames
        return body

    def _visuals(self, host: Link) -> list[dict[str, Any]]:
        """
        Return what a body is drawn with, nothing for its solids.

        A link of it that shows nothing is drawn with its own solids beside the others.
        """
        links = self._by_host()[host.name]
        seen = [shape for link in links for shape in link.visuals]
        if not self._wish.visuals or not seen:
            return []
        solids = [id(shape) for link in links for shape in link.collisions]
        if [id(shape) for shape in seen] == solids and len({one.color for one in seen}) == 1:
            return []       # they say no more than the solids and the colour of the body
        found: list[dict[str, Any]] = []
        for link in links:
            for shape in link.visuals or link.collisions:
                if shape.kind == 'plane' or (shape.color or (0, 0, 0, 1))[3] == 0.0:
                    continue
                pose = _written(combined(self._in_host(link.name), shape.pose))
                try:
                    found += self._mesh.drawn(shape, pose)
                except ValueError as error:
                    self._findings.ignore(shape.place, '<visual>', str(error))
        return found

    def _add_inertia(self, host: Link, body: dict[str, Any]) -> None:
        """Add the mass properties of a body: of its link, and of links that are parts of it."""
        weighing = [(self._in_host(link.name), link.inertia)
                    for link in self._by_host().get(host.name, ()) if link.inertia is not None]
        if not weighing:
            return
        for link in self._by_host()[host.name]:
            if link is not host and link.inertia is not None:
                self._findings.note(link.inertia.place, 'has moments that no body has, and is '
                                    f'taken as a part of {host.name!r}, which a fixed joint holds '
                                    'it on')
        inertia = weighing[0][1] if len(weighing) == 1 and weighing[0][0] == IDENTITY else (
            together(weighing))
        place = inertia.place if host.inertia is None else host.inertia.place
        # What never moves needs no moments, and yet has a mass.
        may_be_mended = self._wish.mend_inertia or host.name in self._fixed
        try:
            moments, how = mended(inertia.mass, inertia.tensor, is_allowed=may_be_mended)
        except ValueError as error:
            if inertia.mass > 0.0 or host.name not in self._fixed:
                self._findings.error(place, str(error))
            return
        body['inertial'] = {'mass': inertia.mass, 'com': list(inertia.com),
                            'inertia': list(moments)}
        if how:
            self._findings.note(place, how)

    def _frames(self, host: str) -> Iterator[tuple[str, Pose]]:
        """Yield the frames of a body: links without a mass, and frames of the file."""
        for link in self._by_host().get(host, ()):
            if link.name != host:
                yield self._names['link', link.name], self._in_host(link.name)
        for frame in self._model.frames:
            if self._host.get(frame.link) == host:
                yield (self._names['link', frame.name],
                       combined(self._in_host(frame.link), frame.pose))

    def _by_host(self) -> dict[str, list[Link]]:
        if not self._guests:
            for link in self._model.links:
                self._guests.setdefault(self._host[link.name], []).append(link)
        return self._guests

    # --- joints -----------------------------------------------------------------------------

    def _joint(self, joint: Joint) -> dict[str, Any]:
        wish = self._wish
        pose = combined(self._in_host(joint.parent), joint.pose) if joint.parent else (
            combined(wish.pose, joint.pose))
        made: dict[str, Any] = {
            'name': self._names['joint', joint.name], 'type': joint.kind,
            'parent': self._body_name(joint.parent), 'child': self._body_name(joint.child),
            'pose': _written(pose), 'axis': list(joint.axis)}
        if joint.axis2 is not None:
            made['axis2'] = list(joint.axis2)
        if joint.collides:
            made['collides'] = True
        if joint.kind in _ONE_AXIS:
            self._add_laws(joint, made)
        elif joint.damping:
            made['damping'] = joint.damping
        return made

    def _joint_bounds(self) -> dict[str, tuple[float | None, float | None]]:
        """
        Return the bounds of each joint.

        Those of a joint that follows another one are bounds of that one: two bounds that are met
        together would be the same condition twice, and nothing would tell the forces of both.
        """
        bounds = {joint.name: (None, None) if joint.name in self._wish.unlimited
                  else (joint.lower, joint.upper) for joint in self._model.joints}
        kinds = {joint.name: joint.kind for joint in self._model.joints}
        followers = {joint.name for joint in self._model.joints if joint.mimic is not None}
        for joint in self._model.joints:
            if joint.mimic is None or joint.mimic.joint in followers or not (
                    joint.mimic.multiplier) or kinds.get(joint.mimic.joint) not in (
                    'revolute', 'prismatic'):
                continue
            leader, multiplier, offset = joint.mimic
            ends = [None if bound is None else (bound - offset) / multiplier
                    for bound in bounds[joint.name]]
            low, high = ends if multiplier > 0.0 else reversed(ends)
            own_low, own_high = bounds[leader]
            lows = [bound for bound in (low, own_low) if bound is not None]
            highs = [bound for bound in (high, own_high) if bound is not None]
            both = max(lows, default=None), min(highs, default=None)
            bounds[joint.name] = None, None
            if both[0] is not None and both[1] is not None and both[0] >= both[1] and (
                    own_low != own_high):
                self._findings.note(joint.place, f'its limits are ignored: they leave {leader!r}, '
                                    'which it mimics, no way to go')
                continue
            bounds[leader] = both
        return bounds

    def _body_name(self, link: str) -> str:
        return self._names['link', self._host[link]] if link else 'world'

    def _add_laws(self, joint: Joint, made: dict[str, Any]) -> None:
        """Add what acts along the axis, and where the joint is at the start."""
        lower, upper = self._bounds[joint.name]
        limits = {key: value for key, value in (
            ('lower', lower), ('upper', upper), ('velocity', joint.velocity),
            ('effort', joint.effort)) if value is not None}
        if limits.get('velocity') == 0.0:
            self._findings.ignore(joint.place, 'a velocity limit of 0')
            del limits['velocity']
        if limits.get('effort') == 0.0:
            self._findings.ignore(joint.place, 'what a drive asks of a joint with the effort '
                                  'limit 0')
        if limits:
            made['limits'] = limits
        for key in ('damping', 'friction', 'armature'):
            if getattr(joint, key):
                made[key] = getattr(joint, key)
        if joint.stiffness:
            made['spring'] = {'stiffness': joint.stiffness, 'rest': joint.rest}
        position = self._wish.joints.get(joint.name)
        drive = self._wish.drives.get(joint.name, joint.drive)
        if drive is not None:
            made['drive'] = dict(drive)
            if position is not None and drive is joint.drive and joint.mimic is None:
                made['drive'].pop('position', None)     # it holds what the scene asks for
        if joint.mimic is not None:
            self._add_mimic(joint, made)
        elif drive is None and not self._has_loops:
            made['drive'] = {'mode': 'effort'}
        if joint.mimic is None and position is None and not (
                -math.inf if lower is None else lower) <= 0.0 <= (
                math.inf if upper is None else upper):
            position = lower if (lower or 0.0) > 0.0 else upper
            self._findings.ignore(joint.place, 'position 0 at the start', 'it is beyond the '
                                  'limits of this joint, which starts at the nearer one; '
                                  '`joints` of the model says another')
        if position is not None:
            made['position'] = position

    def _add_mimic(self, joint: Joint, made: dict[str, Any]) -> None:
        assert joint.mimic is not None
        other, multiplier, offset = joint.mimic
        if ('joint', other) not in self._names:
            near = similar(other, (one.name for one in self._model.joints))
            self._findings.error(joint.place, f'mimics {other[:60]!r}, must be a joint of the '
                                 f'model{f": {near}" if near else ""}')
            return
        made['mimic'] = {'joint': self._names['joint', other], 'multiplier': multiplier,
                         'offset': offset}

    # --- what does not collide --------------------------------------------------------------

    def _ignored(self, solid: set[str]) -> list[list[str]]:
        """
        Return the pairs of bodies that never touch.

        Parent and child of a joint do not, and what fixed joints hold together is one part here:
        a flange on a link overlaps the next link as that link does. To these come the pairs that
        the file names.
        """
        rigid = Groups(self._links)
        for joint in self._model.joints:
            if joint.kind == 'fixed' and joint.parent:
                rigid.join(joint.parent, joint.child)
        members: dict[str, list[str]] = {}
        for link in self._model.links:
            if link.name in solid:
                members.setdefault(rigid.root(link.name), []).append(link.name)
        touching = {(one, one) for one in members}
        touching |= {(rigid.root(joint.parent), rigid.root(joint.child))
                     for joint in self._model.joints if joint.parent and not joint.collides}
        pairs = {(a, b) for one, other in touching
                 for a in members.get(one, ()) for b in members.get(other, ())}
        pairs |= {(self._host[a], self._host[b]) for a, b in self._model.ignored_pairs}
        order = {link.name: i for i, link in enumerate(self._model.links)}
        kept = {(a, b) if order[a] < order[b] else (b, a) for a, b in pairs
                if a != b and a in solid and b in solid
                and not (a in self._fixed and b in self._fixed)}
        return [[self._names['link', a], self._names['link', b]]
                for a, b in sorted(kept, key=lambda pair: (order[pair[0]], order[pair[1]]))]


class Groups:
    """Names that belong together, by and by."""

    def __init__(self, names: Iterable[str]) -> None:
        """Begin with each by itself."""
        self._above = {name: name for name in names}

    def root(self, name: str) -> str:
        """Return the name that stands for a group."""
        above = self._above
        while above[name] != name:
            above[name] = above[above[name]]
            name = above[name]
        return name

    def join(self, a: str, b: str) -> bool:
        """Let two groups be one; whether they were two."""
        a, b = self.root(a), self.root(b)
        self._above[b] = a
        return a != b


def ros_name(name: str) -> str:
    """Return a name of tokens as ROS allows them, from one that a file may have."""
    tokens = []
    for token in name.replace('::', '/').split('/'):
        legal = re.sub('_+', '_', re.sub('[^A-Za-z0-9_]', '_', token)) if (
            re.search('[^A-Za-z0-9_]|__', token)) else token
        tokens.append(f'_{legal}'.replace('__', '_') if legal[:1].isdigit() or not legal
                      else legal)
    return '/'.join(tokens)


def _written(pose: Pose) -> dict[str, Any]:
    return {'position': list(pose.position), 'orientation': list(pose.orientation)}
