# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""URDF: a tree of links, as the ROS packages `urdf` and `urdfdom` read it."""

import math
from pathlib import Path

from rigid_sim_ros.models.description import (
    Inertia, Joint, Link, MeshFile, Mimic, Model, Shape)
from rigid_sim_ros.models.files import Folders
from rigid_sim_ros.models.findings import Findings, ModelError
from rigid_sim_ros.models.poses import combined, from_rpy, IDENTITY, Pose, turned_tensor
from rigid_sim_ros.models.values import (
    attribute, check_attributes, check_children, several, vector)
from rigid_sim_ros.models.xml_tree import Element, parse
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.words import nearest

# Elements of a robot that say nothing of how it moves, or say it to another simulator.
_ROBOT = ('link', 'joint', 'material')
_LINK = ('inertial', 'visual', 'collision')
_LINK_IGNORED = ('gravity', 'kinematic', 'surface', 'contact', 'self_filter', 'sensor', 'origin',
                 'collision_checking', 'self_collide', 'velocity_decay', 'collision_geom')
_JOINT = ('origin', 'parent', 'child', 'axis', 'limit', 'dynamics', 'mimic')
_JOINT_IGNORED = ('calibration', 'safety_controller', 'hardwareInterface')
# The mass and the laws of a Gazebo model, which its own elements change.
_TYPES = {'revolute': 'revolute', 'continuous': 'continuous', 'prismatic': 'prismatic',
          'fixed': 'fixed', 'floating': 'free', 'planar': 'planar'}
_MOMENTS = ('ixx', 'iyy', 'izz', 'ixy', 'ixz', 'iyz')
_ONE_AXIS = ('revolute', 'continuous', 'prismatic')
# [rad] Beyond these a number looks like degrees: a turn in a pose, four of a joint.
_TURN, _MOST_TURN = 2.0 * math.pi + 1e-3, 8.0 * math.pi


def read_urdf(data: bytes, path: Path, folders: Folders) -> Model:
    """Return the model in a URDF file; raises ModelError with all that is wrong."""
    root = parse(data, str(path))
    findings = Findings()
    if root.tag != 'robot':
        raise ModelError([Problem(f'<{root.tag[:40]}> is no robot, the first element of a URDF '
                                  'file must be <robot>', '', root.file, root.line)])
    reader = _Reader(folders, findings)
    links = [reader.link(element) for element in root.each('link')]
    joints = [reader.joint(element) for element in root.each('joint')]
    for child in root.children:
        if child.tag.startswith('xacro:'):
            findings.error(child, 'stands in a file that is not expanded, must go through xacro: '
                           'name the file .xacro')
        elif child.tag not in _ROBOT:
            why = {'gazebo': 'it is for Gazebo',
                   'transmission': 'drives are written in the scene',
                   'ros2_control': 'drives are written in the scene'}.get(child.tag, '')
            findings.ignore(child, f'<{child.tag[:40]}>', why)
    if not links:
        findings.error(root, 'has no links, must have at least one')
    findings.stop()
    base = _place_links(links, joints, root, findings)
    findings.stop()
    # A model that hangs on nothing by a joint of its own stands where it is put; a base without a
    # mass is the world from which it floats.
    floats = any(joint.kind == 'free' and joint.parent == base for joint in joints) and any(
        link.name == base and link.inertia is not None for link in links)
    return Model(root.name or path.stem, links, joints, [], root, not floats,
                 notes=findings.notes)


class _Reader:
    """Reads elements, and keeps what is wrong with them."""

    def __init__(self, folders: Folders, findings: Findings) -> None:
        self._folders, self._findings = folders, findings

    def link(self, element: Element) -> Link:
        findings = self._findings
        check_children(element, _LINK, _LINK_IGNORED, findings, is_physics=True)
        if not element.name:
            findings.error(element, 'has no name, must have one')
        found = list(element.each('inertial'))
        if len(found) > 1:
            findings.error(found[1], 'is there twice, must be there once')
        link = Link(element.name, element, self._inertia(found[0]) if found else None)
        link.collisions = [shape for one in element.each('collision')
                           if (shape := self._shape(one, is_physics=True)) is not None]
        link.visuals = [shape for one in element.each('visual')
                        if (shape := self._shape(one, is_physics=False)) is not None]
        return link

    def _inertia(self, element: Element) -> Inertia | None:
        """Return the mass properties of a link, None for none."""
        findings = self._findings
        check_children(element, ('origin', 'mass', 'inertia'), (), findings, is_physics=True)
        mass, inertia = element.find('mass'), element.find('inertia')
        if mass is None or inertia is None:
            findings.error(element, f'has no <{"mass" if mass is None else "inertia"}>, must have '
                           'one')
            return None
        check_attributes(mass, ('value',), (), findings)
        check_attributes(inertia, _MOMENTS, (), findings)
        m = attribute(mass, 'value', findings, least=0.0)
        moments = [attribute(inertia, key, findings, 0.0 if key[1] != key[2] else None)
                   for key in _MOMENTS]
        if m == 0.0 and not any(moments):
            return None
        pose = self._origin(element)
        a, b, c, d, e, f = turned_tensor(pose.orientation, moments)
        return Inertia(m, pose.position, (a, b, c, d, e, f), element)

    def _origin(self, element: Element) -> Pose:
        origin = element.find('origin')
        if origin is None:
            return IDENTITY
        check_attributes(origin, ('xyz', 'rpy', 'quat_xyzw'), (), self._findings)
        xyz = vector(origin, 'xyz', self._findings)
        if 'quat_xyzw' in origin.attributes:
            x, y, z, w = several(origin.attributes['quat_xyzw'], 4, origin, 'quat_xyzw',
                                 self._findings, (0.0, 0.0, 0.0, 1.0))
            norm = math.hypot(x, y, z, w)
            if abs(norm - 1.0) > 1e-3:
                self._findings.error(origin, f'quat_xyzw has length {norm:g}, must be 1')
                return IDENTITY
            return Pose(xyz, (x / norm, y / norm, z / norm, w / norm))
        rpy = vector(origin, 'rpy', self._findings)
        if max(map(abs, rpy)) > _TURN:
            self._findings.note(origin, f'rpy {origin.attributes["rpy"]!r} is more than a turn: '
                                'angles are in radians')
        return Pose(xyz, from_rpy(*rpy))

    def _shape(self, element: Element, *, is_physics: bool) -> Shape | None:
        findings = self._findings if is_physics else Findings()
        known = ('origin', 'geometry', 'material')
        check_children(element, known, (), self._findings, is_physics=False)
        geometry = element.find('geometry')
        solids = [] if geometry is None else geometry.children
        if len(solids) != 1:
            findings.error(element, f'has {len(solids)} solids in its <geometry>, must have one')
            return self._kept(None, element, findings, is_physics)
        shape = self._solid(solids[0], self._origin(element), findings)
        if shape is not None:
            shape = shape._replace(color=self._color(element))
        return self._kept(shape, element, findings, is_physics)

    def _kept(self, shape: Shape | None, element: Element, findings: Findings,
              is_physics: bool) -> Shape | None:
        """Return a shape; one that is only seen may be missing, and then a line says so."""
        if not is_physics and findings.errors:
            self._findings.ignore(element, '<visual>', 'its shape is not known or not found')
            return None
        return shape

    def _solid(self, solid: Element, pose: Pose, findings: Findings) -> Shape | None:
        def length(key: str) -> float:
            return attribute(solid, key, findings, above=0.0)

        if solid.tag == 'box':
            size = several(solid.attributes.get('size', ''), 3, solid, 'size', findings,
                           (1.0, 1.0, 1.0), above=0.0)
            return Shape('box', {'size': list(size)}, pose, solid)
        if solid.tag == 'sphere':
            return Shape('sphere', {'radius': length('radius')}, pose, solid)
        if solid.tag in ('cylinder', 'capsule'):
            return Shape(solid.tag, {'radius': length('radius'), 'length': length('length')}, pose,
                         solid)
        if solid.tag == 'mesh':
            x, y, z = vector(solid, 'scale', findings, (1.0, 1.0, 1.0))
            if not x * y * z:
                findings.error(solid, 'scale has a 0, must have none')
            path = self._folders.find(solid.attributes.get('filename', ''), solid, findings)
            return None if path is None else Shape(
                'mesh', {}, pose, solid, MeshFile(path, (x, y, z)))
        known = ('box', 'sphere', 'cylinder', 'capsule', 'mesh')
        findings.error(solid, f'is no solid, {nearest(solid.tag, known)}')
        return None

    def _color(self, element: Element) -> tuple[float, ...] | None:
        """Return red, green, blue, alpha of a material here or at the top of the file."""
        material = element.find('material')
        if material is None:
            return None
        color = material.find('color')
        root = element.parent.parent if element.parent is not None else None
        if color is None and root is not None:
            named = [one.find('color') for one in root.each('material')
                     if one.name == material.name]
            color = next((one for one in named if one is not None), None)
        if color is None:
            return None
        found = several(color.attributes.get('rgba', ''), 4, color, 'rgba', Findings(),
                        (-1.0, 0.0, 0.0, 0.0))
        return found if all(0.0 <= value <= 1.0 for value in found) else None

    def joint(self, element: Element) -> Joint:
        findings = self._findings
        check_children(element, _JOINT, _JOINT_IGNORED, findings, is_physics=True)
        for tag in _JOINT:
            if len(list(element.each(tag))) > 1:
                findings.error(element, f'has <{tag}> twice, must have it once')
        if not element.name:
            findings.error(element, 'has no name, must have one')
        kind = element.attributes.get('type', '')
        if kind not in _TYPES:
            findings.error(element, f'type {kind[:40]!r}, {nearest(kind, _TYPES)}')
        ends = []
        for tag in ('parent', 'child'):
            end = element.find(tag)
            if end is None or not end.attributes.get('link'):
                findings.error(element, f'has no <{tag} link=...>, must have one')
            ends.append('' if end is None else end.attributes.get('link', ''))
        joint = Joint(element.name, _TYPES.get(kind, 'fixed'), ends[0], ends[1],
                      self._origin(element), element)
        if joint.kind in (*_ONE_AXIS, 'planar'):
            joint.axis = self._axis(element)
        if joint.kind in _ONE_AXIS:
            self._limits(joint, element)
            self._dynamics(joint, element)
            joint.mimic = self._mimic(element)
        elif joint.kind != 'fixed':
            self._without_one_axis(joint, element)
        return joint

    def _without_one_axis(self, joint: Joint, element: Element) -> None:
        """Read the damping of a planar joint, and tell what it and others have no use for."""
        findings = self._findings
        if joint.kind == 'planar':
            self._dynamics(joint, element)
            if joint.friction:
                findings.error(element, 'has dry friction, which a planar joint has not here: '
                               'make two prismatic joints and a revolute one of it')
        for tag in ('limit', 'mimic', *(() if joint.kind == 'planar' else ('dynamics',))):
            child = element.find(tag)
            if child is not None:
                findings.ignore(child, f'<{tag}>', f'a {joint.kind} joint has none here')

    def _axis(self, element: Element) -> tuple[float, float, float]:
        axis = element.find('axis')
        found = vector(axis, 'xyz', self._findings, (1.0, 0.0, 0.0))
        if not any(found) and axis is not None:
            self._findings.error(axis, "xyz '0 0 0' has no direction, must have one")
        return found if any(found) else (1.0, 0.0, 0.0)

    def _limits(self, joint: Joint, element: Element) -> None:
        """Read how far and how fast the joint goes."""
        findings, limit = self._findings, element.find('limit')
        is_bounded = joint.kind != 'continuous'
        if limit is None:
            if is_bounded:
                findings.error(element, f'has no <limit>, a {joint.kind} joint must have one with '
                               'lower, upper, effort and velocity')
            return
        check_attributes(limit, ('lower', 'upper', 'effort', 'velocity'), (
            'acceleration', 'deceleration', 'jerk', 'current', 'command_effort', 'gear_velocity'),
            findings)
        if not is_bounded and {'lower', 'upper'} & set(limit.attributes):
            findings.ignore(limit, 'lower and upper', 'a continuous joint has no bounds')
        if is_bounded:
            joint.lower = attribute(limit, 'lower', findings, 0.0)
            joint.upper = attribute(limit, 'upper', findings, 0.0)
            if joint.lower > joint.upper:
                findings.error(limit, f'lower {joint.lower:g} is above upper {joint.upper:g}, '
                               'must be below it: swap them')
            if not {'lower', 'upper'} & set(limit.attributes):
                findings.note(limit, 'has no lower and no upper, which are 0 then: the joint '
                              'cannot move; a continuous one has no bounds')
            elif joint.kind == 'revolute' and max(-joint.lower, joint.upper) > _MOST_TURN:
                findings.note(limit, f'lower {joint.lower:g} and upper {joint.upper:g} are '
                              'radians, and more than four turns')
        if 'effort' in limit.attributes:
            joint.effort = attribute(limit, 'effort', findings, least=0.0)
        if 'velocity' in limit.attributes:
            joint.velocity = attribute(limit, 'velocity', findings, least=0.0)

    def _dynamics(self, joint: Joint, element: Element) -> None:
        dynamics = element.find('dynamics')
        if dynamics is not None:
            check_attributes(dynamics, ('damping', 'friction'), (
                'D', 'K', 'mu_coulomb', 'mu_viscous'), self._findings)
            joint.damping = attribute(dynamics, 'damping', self._findings, 0.0, least=0.0)
            joint.friction = attribute(dynamics, 'friction', self._findings, 0.0, least=0.0)

    def _mimic(self, element: Element) -> Mimic | None:
        mimic = element.find('mimic')
        if mimic is None:
            return None
        check_attributes(mimic, ('joint', 'multiplier', 'offset'), (), self._findings)
        return Mimic(mimic.attributes.get('joint', ''),
                     attribute(mimic, 'multiplier', self._findings, 1.0),
                     attribute(mimic, 'offset', self._findings, 0.0))


def _place_links(links: list[Link], joints: list[Joint], root: Element,
                 findings: Findings) -> str:
    """Write the pose of each link with all joints at 0, and return the link that has no parent."""
    by_name = {link.name: link for link in links}
    children: dict[str, list[Joint]] = {}
    held: dict[str, Joint] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)
        for name in (joint.parent, joint.child):
            if name not in by_name:
                findings.error(joint.place, f'{name[:60]!r} is no link, '
                               f'{nearest(name, by_name)}')
        if held.setdefault(joint.child, joint) is not joint:
            findings.error(joint.place, f'{joint.child!r} is the child of '
                           f'{held[joint.child].name!r} too, in URDF a link must have one parent')
    if len(by_name) != len(links):
        seen: set[str] = set()
        for link in links:
            if link.name in seen:
                findings.error(link.place, 'is there twice, must have a name of its own')
            seen.add(link.name)
    names: set[str] = set()
    for joint in joints:
        if joint.name in names:
            findings.error(joint.place, 'is there twice, must have a name of its own')
        names.add(joint.name)
    bases = [name for name in by_name if name not in held]
    if not bases and not findings.errors:
        findings.error(root, 'its joints form a ring: each link is the child of one, URDF must '
                       'have one link that is not')
    elif len(bases) != 1 and not findings.errors:
        findings.error(root, f'{len(bases)} links have no parent: {", ".join(bases[:6])}; must be '
                       'one')
    if findings.errors:
        return ''
    waiting, reached = list(bases), set(bases)
    while waiting:
        parent = by_name[waiting.pop()]
        for joint in children.get(parent.name, ()):
            by_name[joint.child].pose = combined(parent.pose, joint.pose)
            waiting.append(joint.child)
            reached.add(joint.child)
    for link in links:
        if link.name not in reached:
            findings.error(link.place, f'hangs on itself by a ring of joints, must hang on '
                           f'{bases[0]!r}')
    return bases[0]
