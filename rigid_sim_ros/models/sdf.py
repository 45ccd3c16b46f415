# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
SDF 1.6 and later: models with frames, models in models, and includes of local files.

A world is read as a model whose models are those of the world; these touch each other.
"""

import math
from pathlib import Path
from typing import NamedTuple

from rigid_sim_ros.models.description import Frame, Inertia, Joint, Link, Model, MOST_LINKS
from rigid_sim_ros.models.files import Folders
from rigid_sim_ros.models.findings import Findings, ModelError
from rigid_sim_ros.models.poses import (
    combined, from_rpy, IDENTITY, inverse, Pose, turned, turned_tensor)
from rigid_sim_ros.models.sdf_frames import FrameGraph, MODEL, WORLD
from rigid_sim_ros.models.sdf_joints import JOINT_TYPES, read_laws
from rigid_sim_ros.models.sdf_shapes import read_shape
from rigid_sim_ros.models.values import check_children, flag, number, several
from rigid_sim_ros.models.xml_tree import Element, parse, read
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.words import nearest

_OLDEST = 1.6
# Models in models in models; a file that includes itself would never end.
_MOST_LEVELS = 10
_MOST_INCLUDES = 200

_MODEL = ('pose', 'static', 'self_collide', 'link', 'joint', 'frame', 'model', 'include')
_MODEL_IGNORED = ('plugin', 'allow_auto_disable', 'enable_wind', 'gripper', 'description',
                  'author')
_WORLD = ('model', 'include', 'joint', 'frame', 'gravity', 'physics')
_WORLD_IGNORED = ('light', 'scene', 'gui', 'plugin', 'audio', 'wind', 'atmosphere', 'road',
                  'state', 'magnetic_field', 'spherical_coordinates')
_LINK = ('pose', 'inertial', 'collision', 'visual', 'gravity', 'kinematic', 'self_collide')
_LINK_IGNORED = ('enable_wind', 'velocity_decay', 'sensor', 'light', 'battery', 'projector',
                 'audio_source', 'audio_sink', 'particle_emitter', 'must_be_base_link', 'plugin')
_JOINT = ('pose', 'parent', 'child', 'axis', 'axis2')
_JOINT_IGNORED = ('physics', 'sensor', 'plugin')
_MOMENTS = ('ixx', 'iyy', 'izz', 'ixy', 'ixz', 'iyz')


class _Scope(NamedTuple):
    """A model that is being read."""

    prefix: str     # of whole names: '', 'gripper::'
    folders: Folders
    is_static: bool
    touches_itself: bool
    level: int
    is_world: bool = False
    own: str = MODEL    # the frame of the model, of a merged one another than `__model__`

    def local(self, name: str) -> str:
        """Return how a name is called here: that of the frame of a merged model is another."""
        return self.own if name == MODEL else name

    def whole(self, name: str) -> str:
        """Return a whole name that is resolved when all frames are known."""
        return name if name == WORLD else f'{self.prefix}{self.local(name)}'


def read_sdf(data: bytes, path: Path, folders: Folders) -> Model:
    """Return the model in an SDF file; raises ModelError with all that is wrong."""
    findings = Findings()
    root = parse(data, str(path))
    worlds = list(root.each('world'))
    is_world = len(worlds) == 1 and root.find('model') is None
    element = worlds[0] if is_world else _only_model(root, findings)
    _check_version(root)
    reader = _Reader(findings)
    model = Model(element.name or path.stem, [], [], [], element)
    reader.model(element, _Scope('', folders, False, False, 0, is_world), model)
    findings.stop()
    reader.finish(model)
    findings.stop()
    if not model.links:
        raise ModelError([Problem('has no links, must have at least one', element.path,
                                  element.file, element.line)])
    model.notes = findings.notes
    return model


def _stop(root: Element, message: str) -> ModelError:
    return ModelError([Problem(message, '', root.file, root.line)])


def _check_version(root: Element) -> None:
    """Raise ModelError for what is no SDF, or too old."""
    if root.tag != 'sdf':
        raise _stop(root, f'<{root.tag[:40]}> is no model, the first element must be <sdf>')
    version = root.attributes.get('version', '')
    try:
        is_old = not float(version) >= _OLDEST and version not in ('1.10', '1.11', '1.12', '1.13')
    except ValueError:
        is_old = True
    if is_old:
        raise _stop(root, f'version {version[:20]!r} of SDF, must be {_OLDEST} or later: '
                    '`gz sdf -p` writes a newer one')


def _only_model(root: Element, findings: Findings) -> Element:
    """Return the model in a file; ModelError where there is none, or more than one."""
    _check_version(root)
    models = list(root.each('model'))
    if len(models) != 1 or root.find('world') is not None:
        raise _stop(root, f'has {len(models)} models'
                    f'{" and a world" if root.find("world") else ""}, must have one model')
    return models[0]


class _Reader:
    """Reads elements, and keeps what is wrong with them."""

    def __init__(self, findings: Findings) -> None:
        self._findings = findings
        self._graph = FrameGraph(findings)
        self._includes = 0
        self._outermost = IDENTITY      # where the file puts its model
        self._joints: list[tuple[Element, _Scope]] = []
        self._frames: list[tuple[Element, str]] = []
        self._static: set[str] = set()
        self._is_world = False
        self._alone: set[str] = set()   # links that touch no other link of their model

    # --- a model and what is in it ----------------------------------------------------------

    def model(self, element: Element, outer: _Scope, model: Model) -> str:
        """
        Read a model whose own frame stands in the graph already, or is the outermost one.

        Returns the whole name of its canonical link, '' where it has none of its own.
        """
        findings, canonical = self._findings, ''
        if outer.is_world:
            check_children(element, _WORLD, _WORLD_IGNORED, findings, is_physics=True)
            self._read_world(element, model)
        else:
            check_children(element, _MODEL, _MODEL_IGNORED, findings, is_physics=True)
        scope = outer._replace(
            is_static=outer.is_static or self._flag(element, 'static', default=False),
            touches_itself=self._flag(element, 'self_collide', default=False))
        if outer.level > _MOST_LEVELS:
            findings.error(element, f'lies in more than {_MOST_LEVELS} models, must be fewer')
            return ''
        if scope.level == 0:
            self._outermost, _ = self._pose(element)
        for link in element.each('link'):
            self._link(link, scope, model)
        for child in element.children:
            if child.tag == 'frame':
                attached = child.attributes.get('attached_to', '') or (
                    WORLD if scope.is_world else MODEL)
                raw, base = self._pose(child)
                self._graph.add(f'{scope.prefix}{child.name}', scope.whole(base or attached), raw,
                                scope.whole(attached), child)
                self._frames.append((child, scope.prefix))
            elif child.tag == 'joint':
                self._add_joint(child, scope)
            elif child.tag == 'model':
                self._nested(child, child, scope, model)
            elif child.tag == 'include':
                canonical = self._include(child, scope, model) or canonical
        first = next(element.each('link'), None)
        own = element.attributes.get('canonical_link') or (first.name if first else '')
        canonical = f'{scope.prefix}{own}' if own else canonical
        if canonical:
            self._graph.canonical[scope.whole(MODEL)] = canonical
        return canonical

    def _read_world(self, element: Element, model: Model) -> None:
        """Write what a world says beside its models."""
        self._is_world = True
        self._graph.add_world()
        gravity, physics = element.find('gravity'), list(element.each('physics'))
        down: tuple[float, ...] = (0.0, 0.0, -9.8)
        if gravity is not None:
            down = several(gravity.text, 3, gravity, 'gravity', self._findings, down)
        chosen = next((one for one in physics if one.attributes.get('default') in ('true', '1')),
                      physics[0] if physics else None)
        step = 0.001 if chosen is None else self._number(chosen, 'max_step_size', 0.001)
        model.world = {'gravity': down, 'step': step, 'contact': 'timestep'}

    def _nested(self, element: Element, outside: Element, scope: _Scope, model: Model,
                merges: bool = False) -> str:
        """
        Read a model in a model; `outside` says where it is, and what it is called.

        What is in one that `merges` becomes a part of the model around it, with a frame
        `_merged__NAME__model__` where its own frame would be (sdformat.org, "Merging nested models
        via //include"). Returns the canonical link that the model around it gets so.
        """
        name = outside.name if outside.tag == 'model' else (
            _text(outside, 'name') or element.name)
        if not name or '::' in name:
            self._findings.error(outside, 'has no name without ::, must have one')
            return ''
        placed = outside if outside.find('pose') is not None else element
        raw, base = self._pose(placed)
        placement = (outside.attributes.get('placement_frame') or _text(outside, 'placement_frame')
                     or element.attributes.get('placement_frame', ''))
        inner = scope._replace(prefix=f'{scope.prefix}{name}::', level=scope.level + 1,
                               is_world=False, own=MODEL)
        if merges:
            inner = inner._replace(prefix=scope.prefix, own=f'_merged__{name}__model__')
        whole = inner.whole(MODEL)
        self._graph.add(whole, scope.whole(base or MODEL), raw, whole, outside,
                        f'{inner.prefix}{placement}' if placement else '')
        if outside is not element and self._flag(outside, 'static', default=False):
            inner = inner._replace(is_static=True)
        canonical = self.model(element, inner, model)
        return canonical if merges else ''

    def _include(self, element: Element, scope: _Scope, model: Model) -> str:
        """Read a model of another file; return what `_nested` does."""
        findings = self._findings
        check_children(element, ('uri', 'name', 'pose', 'static', 'placement_frame'), ('plugin',),
                       findings, is_physics=True)
        merges = flag(element.attributes.get('merge', 'false'), element, 'merge', findings)
        if merges and scope.is_world:
            findings.error(element, 'merge must be false in a world: only a model takes parts')
        self._includes += 1
        if self._includes > _MOST_INCLUDES or scope.level >= _MOST_LEVELS:
            findings.error(element, f'is one of more than {_MOST_INCLUDES} includes, or lies in '
                           f'more than {_MOST_LEVELS} models: a file must not include itself')
            findings.stop()
        path = self._included(element, _text(element, 'uri'), scope)
        if path is None:
            return ''
        inner = _only_model(read(path), findings)
        if merges:
            self._check_merged(inner, element, scope)
        folders = Folders(path.parent, scope.folders.packages)
        return self._nested(inner, element, scope._replace(folders=folders), model, merges)

    def _check_merged(self, inner: Element, include: Element, scope: _Scope) -> None:
        """Report what a model says of itself as a whole that the one around it says otherwise."""
        for element in (inner, include):
            for tag, around in (('static', scope.is_static),
                                ('self_collide', scope.touches_itself)):
                if self._flag(element, tag, default=around) is not around:
                    self._findings.error(element, f'its <{tag}> must be {str(around).lower()}, as '
                                         'in the model that it is merged into')

    def _included(self, element: Element, uri: str, scope: _Scope) -> Path | None:
        """Return the file of a model that is named by its own file or by its folder."""
        if uri.lower().endswith('.sdf'):
            return scope.folders.find(uri, element, self._findings)
        for name in ('model.config', 'manifest.xml'):
            attempt = Findings()
            config = scope.folders.find(f'{uri}/{name}', element, attempt)
            if config is not None:
                named = [one.text.strip() for one in read(config).each('sdf')]
                uri = f'{uri}/{named[-1]}' if named else f'{uri}/model.sdf'
                return scope.folders.find(uri, element, self._findings)
        return scope.folders.find(f'{uri}/model.sdf', element, self._findings)

    # --- links ------------------------------------------------------------------------------

    def _link(self, element: Element, scope: _Scope, model: Model) -> None:
        findings = self._findings
        check_children(element, _LINK, _LINK_IGNORED, findings, is_physics=True)
        if not element.name or '::' in element.name:
            findings.error(element, 'has no name without ::, must have one')
        for tag, value in (('gravity', True), ('kinematic', False)):
            if self._flag(element, tag, default=value) is not value:
                findings.error(element, f'<{tag}> is not known here, must be '
                               f'{str(value).lower()}')
        name = f'{scope.prefix}{element.name}'
        raw, base = self._pose(element)
        self._graph.add(name, scope.whole(base or MODEL), raw, '', element)
        link = Link(name, element, self._inertia(element), is_fixed=scope.is_static)
        if scope.is_static:
            self._static.add(name)
        if not self._flag(element, 'self_collide', default=scope.touches_itself):
            self._alone.add(name)
        for tag, shapes in (('collision', link.collisions), ('visual', link.visuals)):
            for one in element.each(tag):
                own, frame = self._pose(one)
                if frame:
                    findings.error(one, 'relative_to is not known for a shape here, must be left '
                                   'out: its pose is in the link')
                shape = read_shape(one, own, scope.folders, findings)
                if shape is not None:
                    shapes.append(shape)
        model.links.append(link)
        if len(model.links) > MOST_LINKS:
            findings.error(element, f'is one of more than {MOST_LINKS} links, must be fewer')
            findings.stop()

    def _inertia(self, link: Element) -> Inertia:
        """Return the mass properties of a link: 1 kg and 1 kg m^2 where the file has none."""
        findings, element = self._findings, link.find('inertial')
        if element is None:
            findings.ignore(link, 'a missing <inertial>', 'SDF takes 1 kg and 1 kg m^2 then')
            return Inertia(1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), link)
        check_children(element, ('pose', 'mass', 'inertia'), (), findings, is_physics=True)
        if element.attributes.get('auto', 'false') not in ('false', '0'):
            findings.error(element, 'auto is not known here, must be numbers')
        mass = self._number(element, 'mass', 1.0)
        inertia = element.find('inertia')
        moments = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
        if inertia is not None:
            check_children(inertia, _MOMENTS, (), findings, is_physics=True)
            moments = [self._number(inertia, key, default)
                       for key, default in zip(_MOMENTS, moments, strict=True)]
        pose, _ = self._pose(element)
        a, b, c, d, e, f = turned_tensor(pose.orientation, moments)
        return Inertia(mass, pose.position, (a, b, c, d, e, f), element)

    # --- joints -----------------------------------------------------------------------------

    def _add_joint(self, element: Element, scope: _Scope) -> None:
        """Add the frame of a joint, and keep the joint until all frames are known."""
        child = _text(element, 'child')
        raw, base = self._pose(element)
        self._graph.add(f'{scope.prefix}{element.name}', scope.whole(base or child), raw,
                        scope.whole(child), element)
        self._joints.append((element, scope))

    def finish(self, model: Model) -> None:
        """Place the links, and make joints and frames of what the frames between them are."""
        graph, at = self._graph, self._outermost
        for link in model.links:
            link.pose = combined(at, graph.pose(link.name, link.place))
        links = {link.name: link for link in model.links}
        for element, scope in self._joints:
            self._joint(element, scope, model, links)
        for element, prefix in self._frames:
            name = f'{prefix}{element.name}'
            on = graph.link(name, element)
            if on in links:
                pose = combined(inverse(graph.pose(on, element)), graph.pose(name, element))
                model.frames.append(Frame(name, on, pose, element))
        solid = [link.name for link in model.links if link.collisions]
        model.ignored_pairs = [(a, b) for i, a in enumerate(solid) for b in solid[i + 1:]
                               if a in self._alone and b in self._alone and (
                                   not self._is_world or a.split('::')[0] == b.split('::')[0])]

    def _joint(self, element: Element, scope: _Scope, model: Model,
               links: dict[str, Link]) -> None:
        findings, graph = self._findings, self._graph
        check_children(element, _JOINT, _JOINT_IGNORED, findings, is_physics=True)
        kind = element.attributes.get('type', '')
        if kind not in JOINT_TYPES:
            findings.error(element, f'type {kind[:40]!r}, {nearest(kind, JOINT_TYPES)}')
            return
        ends = []
        for tag in ('parent', 'child'):
            whole = graph.resolve(scope.local(_text(element, tag)), scope.prefix, element)
            ends.append(graph.link(whole, element) if whole else '')
        parent, child = ends
        if child not in links or not (parent == WORLD or parent in links):
            if not findings.errors:
                findings.error(element, 'its child must be a link, its parent a link or world')
            return
        if parent in self._static | {WORLD} and child in self._static:
            findings.ignore(element, 'a joint of a static model')
            return
        name = f'{scope.prefix}{element.name}'
        frame = combined(self._outermost, graph.pose(name, element))
        if parent == WORLD and kind == 'fixed':
            links[child].is_fixed = True
            return
        pose = frame if parent == WORLD else combined(inverse(links[parent].pose), frame)
        joint = Joint(name, JOINT_TYPES[kind], '' if parent == WORLD else parent, child, pose,
                      element)

        def axis(element: Element) -> tuple[float, float, float] | None:
            return self._axis(element, scope, name)

        read_laws(joint, element, scope.prefix, axis, findings)
        model.joints.append(joint)

    def _axis(self, element: Element, scope: _Scope,
              joint: str) -> tuple[float, float, float] | None:
        """Return the direction of an axis in the joint frame, None after a report."""
        findings, xyz = self._findings, element.find('xyz')
        if xyz is None:
            return 0.0, 0.0, 1.0
        x, y, z = several(xyz.text, 3, xyz, 'xyz', findings, (0.0, 0.0, 1.0))
        if not any((x, y, z)):
            findings.error(xyz, "'0 0 0' has no direction, must have one")
            return None
        frame = xyz.attributes.get('expressed_in', '')
        old = element.find('use_parent_model_frame')
        if old is not None and flag(old.text, old, 'use_parent_model_frame', findings):
            frame = MODEL
        if not frame:
            return x, y, z
        whole = self._graph.resolve(scope.local(frame), scope.prefix, xyz)
        if not whole:
            return None
        outer = IDENTITY if whole == WORLD else self._graph.pose(whole, xyz)
        own = self._graph.pose(joint, xyz)
        return turned(combined(inverse(own), outer), (x, y, z))

    # --- values -----------------------------------------------------------------------------

    def _flag(self, element: Element, tag: str, *, default: bool) -> bool:
        child = element.find(tag)
        return default if child is None else flag(child.text, child, tag, self._findings)

    def _number(self, element: Element, tag: str, default: float) -> float:
        child = element.find(tag)
        return default if child is None else number(
            child.text.strip(), child, tag, self._findings, default)

    def _pose(self, element: Element) -> tuple[Pose, str]:
        """Return the pose of an element, and the frame that it says to be relative to."""
        pose, findings = element.find('pose'), self._findings
        if pose is None:
            return IDENTITY, ''
        base = pose.attributes.get('relative_to', '') or pose.attributes.get('frame', '')
        if not pose.text.strip():
            return IDENTITY, base
        form = pose.attributes.get('rotation_format', 'euler_rpy')
        if form == 'quat_xyzw':
            values = several(pose.text, 7, pose, 'pose', findings, (0.0,) * 6 + (1.0,))
            norm = math.hypot(*values[3:])
            if not abs(norm - 1.0) < 1e-3:
                findings.error(pose, f'its quaternion has length {norm:g}, must be 1')
                return IDENTITY, base
            a, b, c, d = (value / norm for value in values[3:])
            return Pose((values[0], values[1], values[2]), (a, b, c, d)), base
        if form != 'euler_rpy':
            findings.error(pose, f'rotation_format {form[:40]!r}, must be euler_rpy or quat_xyzw')
        x, y, z, *angles = several(pose.text, 6, pose, 'pose', findings, (0.0,) * 6)
        if pose.attributes.get('degrees', 'false') in ('true', '1'):
            angles = [math.radians(angle) for angle in angles]
        return Pose((x, y, z), from_rpy(*angles)), base


def _text(element: Element, tag: str) -> str:
    """Return the text of a child, '' without one."""
    child = element.find(tag)
    return '' if child is None else child.text.strip()
