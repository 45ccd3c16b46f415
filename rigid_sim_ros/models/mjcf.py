# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
MJCF, through MuJoCo itself: it knows its defaults, classes and attachments.

MuJoCo opens the files that a model names, so their places are checked before, and it compiles in a
process of its own (mjcf_compile.py). What it has compiled is taken: masses, frames and geometries
as it would simulate them.
"""

from collections.abc import Iterable
from itertools import pairwise
import os
from pathlib import Path
from typing import Any

import numpy as np

from rigid_sim_ros.models.description import Frame, Inertia, Joint, Link, Mimic, Model
from rigid_sim_ros.models.files import Folders
from rigid_sim_ros.models.findings import Findings, ModelError
from rigid_sim_ros.models.mjcf_actuators import read_actuators
from rigid_sim_ros.models.mjcf_compile import compiled, placed
from rigid_sim_ros.models.mjcf_shapes import read_shapes
from rigid_sim_ros.models.poses import (
    combined, IDENTITY, inverse, Pose, Quaternion, turned_tensor, Vector)
from rigid_sim_ros.models.values import MOST
from rigid_sim_ros.models.xml_tree import contents, Element, MAX_BYTES, parse
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.reading import is_inside

NEEDED = ("needs MuJoCo, which is not installed: `pip install '.[mjcf]'` in a clone of "
          'rigid_sim_ros, or `pip install mujoco`')
# The body of the world in MuJoCo, and our name of it where it has shapes.
_WORLD, WORLD_LINK = 0, 'world'
_MOST_FILES = 200
_HINGE, _SLIDE, _BALL, _FREE = 'hinge', 'slide', 'ball', 'free'
# Of its mass, each of the bodies that are put between the joints of one: as little as that changes
# the motion, and far more than rounding.
_BETWEEN = 1e-6
# [m or rad] What is written with six digits is closed.
_CLOSED = 1e-5
# What contacts have in MuJoCo where the file says nothing: sliding, torsional, rolling; condim.
_FRICTION, _CONDIM = (1.0, 0.005, 0.0001), 3
# Flags that change the motion, besides that of gravity.
_DISABLED = ('constraint', 'equality', 'frictionloss', 'limit', 'spring', 'damper', 'actuation')


def read_mjcf(data: bytes, path: Path, folders: Folders) -> Model:
    """Return the model in an MJCF file; raises ModelError with what is wrong."""
    root = _check_files(data, path, folders)
    try:
        model = compiled(path)
        import mujoco
    except ImportError:
        raise ModelError([Problem(NEEDED, '', str(path))]) from None
    except ValueError as error:
        raise ModelError([placed(str(error), root)]) from None
    return _Reader(mujoco, model, root, path).model()


def _check_files(data: bytes, path: Path, folders: Folders) -> Element:
    """Return the tree of the file, in which each other file lies in a folder of the model."""
    findings = Findings()
    root = parse(data, str(path))
    if root.tag not in ('mujoco', 'mujocoinclude'):
        raise ModelError([Problem(f'<{root.tag[:40]}> is no MJCF, the first element must be '
                                  '<mujoco>', '', root.file, root.line)])
    waiting, seen = [root], {path}
    named: list[tuple[str, Element]] = []
    folders_named = {''}
    while waiting:
        tree = waiting.pop()
        for element in tree.every():
            if element.tag == 'plugin' or element.tag == 'extension':
                findings.error(element, 'is code of another library, must go')
            for key, value in element.attributes.items():
                if not _is_sound(value):
                    findings.error(element, f'{key} {value[:40]!r}, must be finite and at most '
                                   f'{MOST:g}')
                if key.endswith('dir'):
                    folders_named.add(value)
                if not (key.startswith('file') or key.endswith('dir')):
                    continue
                found = _allowed(value, element, folders, findings)
                if key.startswith('file'):
                    named.append((value, element))
                # Of these MuJoCo reads further names.
                if element.tag in ('include', 'model') and found is not None and found not in seen:
                    seen.add(found)
                    waiting.append(parse(contents(found), str(found)))
        if len(seen) > _MOST_FILES or len(folders_named) > _MOST_FILES:
            findings.error(tree, f'names more than {_MOST_FILES} files or folders, must be fewer')
            break
    findings.stop()
    for name, element in named:
        _check_file(name, element, folders_named, folders, findings)
    findings.stop()
    return root


def _check_file(name: str, element: Element, inner: Iterable[str], folders: Folders,
                findings: Findings) -> None:
    """Report a file that is none, or lies elsewhere, wherever MuJoCo may look for it."""
    for folder in inner:
        path = _allowed(os.path.join(folder, name), element, folders, findings)
        if path is not None and path.exists() and not path.is_file():
            findings.error(element, f'{name[:80]!r} is not a regular file, must be one')
            return
        if path is not None and path.is_file() and path.stat().st_size > MAX_BYTES:
            findings.error(element, f'{name[:80]!r} is larger than {MAX_BYTES / 1e6:g} MB, must '
                           'be smaller')
            return


def _is_sound(value: str) -> bool:
    """Return whether numbers are of a sane size: with others MuJoCo may not come back."""
    try:
        return all(abs(float(word)) <= MOST for word in value.split())
    except ValueError:
        return True     # no numbers


def _allowed(name: str, element: Element, folders: Folders, findings: Findings) -> Path | None:
    """Return the path of a file that MuJoCo may open; report one that lies elsewhere."""
    if Path(name).is_absolute() or '..' in Path(name).parts or '\0' in name:
        findings.error(element, f'{name[:80]!r} may lie outside of the folder of the model, must '
                       'be a path in it')
        return None
    path = folders.model / name
    if not is_inside(path, folders.model):
        findings.error(element, f'{name[:80]!r} lies outside of the folder of the model, must lie '
                       'in it')
        return None
    return path


class _Reader:
    """Reads what MuJoCo has compiled."""

    def __init__(self, mujoco: Any, compiled: Any, root: Element, path: Path) -> None:
        self._mj, self._m, self._root = mujoco, compiled, root
        self._findings = Findings()
        self._path = path
        # Where bodies and joints with a name stand; of an included one the file that includes it.
        self._places: dict[tuple[str, str], Element] = {}
        self._axes: dict[int, Joint] = {}   # joints with one axis, by their rows in MuJoCo
        for element in root.every():
            if element.name:
                self._places.setdefault((element.tag, element.name), element)

    def model(self) -> Model:
        m, findings = self._m, self._findings
        self._ignore()
        poses = self._body_poses()
        links = [self._link(b, poses[b]) for b in range(m.nbody)]
        joints = [joint for b in range(1, m.nbody) for joint in self._joints(b)]
        between = self._put_between(links, joints)
        joints += self._equalities(poses)
        read_actuators(self._mj, m, self._axes, self._actuator_place, findings)
        frames = [self._frame(s, links) for s in range(m.nsite)]
        if not links[_WORLD].collisions:
            frames = [frame for frame in frames if frame.link != links[_WORLD].name]
            links = links[1:]
        if not links:
            findings.error(self._root, 'has no bodies, must have at least one')
        findings.stop()
        model = Model(self._root.attributes.get('model') or self._path.stem, links, joints, frames,
                      self._root)
        names = {link.name for link in links}
        model.ignored_pairs = [pair for pair in [*self._ignored_pairs(), *between]
                               if names.issuperset(pair)]
        falls = not m.opt.disableflags & int(self._mj.mjtDisableBit.mjDSBL_GRAVITY)
        model.world = {'gravity': tuple(falls * float(g) for g in m.opt.gravity),
                       'step': float(m.opt.timestep)}
        model.notes = findings.notes
        return model

    # --- bodies -----------------------------------------------------------------------------

    def _name(self, kind: str, index: int) -> str:
        name = str(getattr(self._m, kind)(index).name)
        if kind == 'body' and index == _WORLD:
            return WORLD_LINK
        return name or f'{ {"jnt": "joint"}.get(kind, kind)}{index}'

    def _place(self, tag: str, name: str) -> Element:
        return self._places.get((tag, name), self._root)

    def _body_poses(self) -> list[Pose]:
        """Return the pose of each body where the model is written."""
        m = self._m
        poses = [IDENTITY]
        for b in range(1, m.nbody):
            outer = poses[int(m.body_parentid[b])]
            poses.append(combined(outer, _pose(m.body_pos[b], m.body_quat[b])))
        return poses

    def _link(self, b: int, pose: Pose) -> Link:
        m, name = self._m, self._name('body', b)
        link = Link(name, self._place('body', name), pose=pose, is_fixed=self._is_welded(b))
        mass = float(m.body_mass[b])
        if mass > 0.0:
            com = _pose(m.body_ipos[b], m.body_iquat[b])
            x, y, z = (float(moment) for moment in m.body_inertia[b])
            a, b_, c, d, e, f = turned_tensor(com.orientation, (x, y, z, 0.0, 0.0, 0.0))
            link.inertia = Inertia(mass, com.position, (a, b_, c, d, e, f), link.place)
        read_shapes(self._mj, m, b, link, self._findings)
        return link

    def _frame(self, s: int, links: list[Link]) -> Frame:
        """Return the frame of a site; bodies and sites may have the same names in MJCF alone."""
        m, name = self._m, self._name('site', s)
        place = self._place('site', name)
        if any(link.name == name for link in links):
            self._findings.note(place, f'is {name}_site here, as a body has its name')
            name = f'{name}_site'
        return Frame(name, links[int(m.site_bodyid[s])].name,
                     _pose(m.site_pos[s], m.site_quat[s]), place)

    def _is_welded(self, b: int) -> bool:
        return int(self._m.body_weldid[b]) == _WORLD and int(self._m.body_mocapid[b]) < 0

    # --- joints -----------------------------------------------------------------------------

    def _joints(self, b: int) -> list[Joint]:
        """Return what holds a body to its parent, none if the world does or it is free."""
        m, findings = self._m, self._findings
        name = self._name('body', b)
        place = self._place('body', name)
        parent = self._name('body', int(m.body_parentid[b]))
        if int(m.body_mocapid[b]) >= 0:
            findings.error(place, 'is a mocap body, must be a kinematic body of the scene')
            return []
        rows = [int(m.body_jntadr[b]) + k for k in range(int(m.body_jntnum[b]))]
        body = _pose(m.body_pos[b], m.body_quat[b])
        if not rows:
            if self._is_welded(b):
                return []
            return [Joint(f'{name}_fixed', 'fixed', parent, name, body, place)]
        kinds = [self._mj.mjtJoint(int(m.jnt_type[row])).name[6:].lower() for row in rows]
        if kinds == [_FREE]:
            first = int(m.jnt_dofadr[rows[0]])
            free = slice(first, first + 6)
            if any(np.any(values[free]) for values in (
                    m.dof_damping, m.dof_armature, m.dof_frictionloss)):
                findings.ignore(place, 'damping, armature or frictionloss of a free joint')
            return []
        outer = '' if int(m.body_parentid[b]) == _WORLD else parent
        found: list[Joint] = []
        for row, kind in zip(rows, kinds, strict=True):
            at = Pose(_vector(m.jnt_pos[row]), IDENTITY.orientation)
            joint = Joint(self._name('jnt', row), 'spherical', name, name,
                          at if found else combined(body, at), place)
            if kind == _BALL:
                self._ball(joint, row)
            else:
                self._one_axis(joint, row, kind)
            found.append(joint)
        found[0].parent = outer
        return found

    def _put_between(self, links: list[Link], joints: list[Joint]) -> list[tuple[str, str]]:
        """
        Let each joint of a body that has several have a body of its own, with a share of the mass.

        Returns pairs that do not touch, as parent and child do not: there is something in between.
        """
        by_name, pairs = {link.name: link for link in links}, []
        for link in list(links):
            own = [joint for joint in joints if joint.child == link.name]
            if len(own) < 2 or link.inertia is None:
                continue
            whole, count = link.inertia, len(own) - 1
            link.inertia = _share(whole, 1.0 - count * _BETWEEN)
            for joint, after in pairwise(own):
                name = f'{link.name}_{joint.name}'
                while name in by_name:
                    name += '_'
                by_name[name] = Link(name, link.place, _share(whole, _BETWEEN), link.pose)
                links.append(by_name[name])
                joint.child = after.parent = name
            pairs.append((own[0].parent, link.name))
            self._findings.note(link.place, f'has {len(own)} joints: in between are bodies with '
                                f'{_BETWEEN:g} of its mass')
        return pairs

    def _ball(self, joint: Joint, row: int) -> None:
        """Write the damping of a ball, and tell what else it has."""
        m, dof = self._m, int(self._m.jnt_dofadr[row])
        joint.damping = self._damping(row)
        self._check_linear(joint, row)
        if m.jnt_limited[row] or m.jnt_stiffness[row] or m.dof_frictionloss[dof]:
            self._findings.error(joint.place, f'its ball joint {joint.name!r} has a range, a '
                                 'stiffness or a frictionloss, must have none')
        if m.dof_armature[dof]:
            self._findings.ignore(joint.place, f'armature of the ball joint {joint.name!r}')

    def _damping(self, row: int) -> float:
        return float(self._m.dof_damping[int(self._m.jnt_dofadr[row])])

    def _check_linear(self, joint: Joint, row: int) -> None:
        """Report a spring or a damper whose force is no multiple of the motion (MuJoCo 4)."""
        m, dof = self._m, int(self._m.jnt_dofadr[row])
        for what, field, index in (
                ('stiffness', 'jnt_stiffnesspoly', row), ('damping', 'dof_dampingpoly', dof)):
            if hasattr(m, field) and np.any(getattr(m, field)[index]):
                self._findings.error(joint.place, f'joint {joint.name!r}: its {what} has further '
                                     'terms, must be one number')
        if hasattr(m, 'jnt_springyield') and m.jnt_springyield[row]:
            self._findings.error(joint.place, f'joint {joint.name!r}: its spring yields, must not')

    def _one_axis(self, joint: Joint, row: int, kind: str) -> None:
        """Write the laws of a hinge or a slide, whose coordinate here is 0 where it is written."""
        m, dof = self._m, int(self._m.jnt_dofadr[row])
        self._axes[row] = joint
        is_limited = bool(m.jnt_limited[row])
        low, high = (float(bound) for bound in m.jnt_range[row])
        if low > high:
            self._findings.error(joint.place, f'joint {joint.name!r}: range {low:g} {high:g}, its '
                                 'first number must be the smaller one: swap them')
        joint.kind = ('prismatic' if kind == _SLIDE else 'revolute' if is_limited
                      else 'continuous')
        joint.axis = _vector(m.jnt_axis[row])
        zero = float(m.qpos0[int(m.jnt_qposadr[row])])
        if zero:
            self._findings.note(joint.place, f'joint {joint.name!r}: its positions count from its '
                                f'ref, {zero:g}, where the model is written')
        self._check_linear(joint, row)
        if is_limited:
            joint.lower, joint.upper = (float(bound) - zero for bound in m.jnt_range[row])
        joint.damping = self._damping(row)
        joint.friction = float(m.dof_frictionloss[dof])
        joint.armature = float(m.dof_armature[dof])
        joint.stiffness = float(m.jnt_stiffness[row])
        joint.rest = float(m.qpos_spring[int(m.jnt_qposadr[row])]) - zero
        if m.jnt_actfrclimited[row]:
            joint.effort = float(np.abs(m.jnt_actfrcrange[row]).min())

    def _equalities(self, poses: list[Pose]) -> list[Joint]:
        """Return the joints that equalities are; those between two joints are written to them."""
        m, mj, made = self._m, self._mj, []
        for e in range(m.neq):
            if not m.eq_active0[e]:
                continue
            kind = mj.mjtEq(int(m.eq_type[e])).name[5:].lower()
            name = self._name('equality', e)
            place = self._equality_place(kind, e)
            a, b, data = int(m.eq_obj1id[e]), int(m.eq_obj2id[e]), m.eq_data[e]
            if kind == 'joint':
                self._couple(self._axes.get(a), b, data, place)
                continue
            if kind not in ('connect', 'weld'):
                self._findings.error(place, f'is an equality of a kind that is not known here '
                                     f'({kind}), must go')
                continue
            if int(m.eq_objtype[e]) == int(mj.mjtObj.mjOBJ_SITE):
                ends = [_pose(m.site_pos[site], m.site_quat[site]) for site in (a, b)]
                a, b = int(m.site_bodyid[a]), int(m.site_bodyid[b])
            elif kind == 'connect':
                ends = [Pose(_vector(data[i:i + 3]), IDENTITY.orientation) for i in (0, 3)]
            else:
                ends = [_pose(data[3:6], data[6:10]),
                        Pose(_vector(data[0:3]), IDENTITY.orientation)]
            if not (self._is_welded(a) and self._is_welded(b)):
                made.append(self._loop(name, kind, a, b, ends, poses, place))
        return made

    def _couple(self, joint: Joint | None, other: int, terms: Any, place: Element) -> None:
        """Let a joint follow another one; one that follows none has no way to go."""
        if joint is None or (other >= 0 and other not in self._axes):
            self._findings.error(place, 'is of a joint that is no hinge and no slide, must be of '
                                 'these')
        elif other < 0:
            joint.kind = 'prismatic' if joint.kind == 'prismatic' else 'revolute'
            joint.lower = joint.upper = float(terms[0])
        elif np.any(terms[2:5]):
            self._findings.error(place, 'its polycoef has terms beyond the first two, must have '
                                 'none: a joint follows another one by a multiple and an offset')
        else:
            joint.mimic = Mimic(self._axes[other].name, float(terms[1]), float(terms[0]))

    def _equality_place(self, kind: str, e: int) -> Element:
        """Return where an equality stands, also of one without a name: they keep their order."""
        written = [one for every in self._root.every() if every.tag == 'equality'
                   for one in every.children]
        return written[e] if len(written) == self._m.neq else self._place(
            kind, self._name('equality', e))

    def _loop(self, name: str, kind: str, a: int, b: int, ends: list[Pose], poses: list[Pose],
              place: Element) -> Joint:
        """Return the joint that holds a frame in the body a on one in the body b."""
        outer, inner = (b, a) if self._is_welded(b) else (a, b)
        at, there = combined(poses[a], ends[0]), combined(poses[b], ends[1])
        off = combined(inverse(there), at)
        turned = off.orientation[:3] if kind == 'weld' else ()
        if max(map(abs, (*off.position, *turned))) > _CLOSED:
            self._findings.error(place, 'holds its bodies elsewhere than they are written: write '
                                 'them there, or leave relpose out')
        parent = '' if outer == _WORLD else self._name('body', outer)
        pose = at if not parent else combined(inverse(poses[outer]), at)
        return Joint(name, 'spherical' if kind == 'connect' else 'fixed', parent,
                     self._name('body', inner), pose, place)

    def _actuator_place(self, name: str) -> Element:
        for (_, known), element in self._places.items():
            if known == name and element.parent is not None and element.parent.tag == 'actuator':
                return element
        return self._root

    # --- the rest ---------------------------------------------------------------------------

    def _ignored_pairs(self) -> list[tuple[str, str]]:
        """Return the pairs that touch each other by none of their geometries, or are excluded."""
        m = self._m
        pairs = [(int(code) >> 16, int(code) & 0xFFFF) for code in m.exclude_signature]
        masks: dict[int, list[tuple[int, int]]] = {}
        for g in range(m.ngeom):
            bits = int(m.geom_contype[g]), int(m.geom_conaffinity[g])
            if any(bits):
                masks.setdefault(int(m.geom_bodyid[g]), []).append(bits)
        solid = sorted(masks)
        pairs += [(a, b) for i, a in enumerate(solid) for b in solid[i + 1:]
                  if not any(p & s or q & r for p, q in masks[a] for r, s in masks[b])]
        return [(self._name('body', a), self._name('body', b)) for a, b in pairs]

    def _first(self, word: str) -> Element:
        """Return the first element with this tag or attribute in the file itself."""
        return next((one for one in self._root.every()
                     if one.tag == word or word in one.attributes), self._root)

    def _ignore(self) -> None:
        """Tell what has no effect here, or refuse what would change the motion."""
        m, findings = self._m, self._findings
        for tag, count, why in (
                ('sensor', m.nsensor, ''), ('keyframe', m.nkey, ''), ('camera', m.ncam, ''),
                ('pair', m.npair, 'contype and conaffinity tell what touches')):
            if count:
                findings.ignore(self._first(tag), f'<{tag}>', why)
        if m.ngeom and (np.any(m.geom_friction != _FRICTION) or np.any(m.geom_condim != _CONDIM)):
            word = 'friction' if np.any(m.geom_friction != _FRICTION) else 'condim'
            findings.ignore(self._first(word), word, 'materials are those of the scene')
        for word, why in (
                ('surfacevel', 'a kinematic body carries what lies on it'), ('adhesion', '')):
            if np.any(getattr(m, f'geom_{word}', 0.0)):
                findings.ignore(self._first(word), word, why)
        for bit in ('contact', 'filterparent'):
            if m.opt.disableflags & int(getattr(self._mj.mjtDisableBit, f'mjDSBL_{bit.upper()}')):
                findings.ignore(self._first('flag'), f'the flag {bit}',
                                'the scene tells what touches')
        if any(np.any(getattr(m, f'tendon_{key}', 0.0)) for key in (
                'stiffness', 'damping', 'limited', 'frictionloss', 'armature')):
            findings.error(self._first('tendon'), 'has tendons with forces, which are not known '
                           'here, must have none')
        elif m.ntendon:
            findings.ignore(self._first('tendon'), '<tendon>',
                            'only what actuators do by it counts')
        for bit in _DISABLED:
            if m.opt.disableflags & int(getattr(self._mj.mjtDisableBit, f'mjDSBL_{bit.upper()}')):
                findings.error(self._root, f'disables {bit} by a <flag>, must not: leave out what '
                               'it disables')
        if np.any(m.body_gravcomp):
            findings.error(self._first('gravcomp'), 'has gravcomp, which is not known here, must '
                           'have none: drives bear the weight, World.inverse_dynamics says how')
        if m.nflex or m.nskin:
            findings.error(self._first('flex'), 'has soft bodies, which are not known here, must '
                           'have none')
        if m.opt.density or m.opt.viscosity:
            findings.error(self._root, 'has a medium (density, viscosity), must have none: write '
                           'wind in the scene')


def _pose(position: Any, quaternion: Any) -> Pose:
    """Return a pose from MuJoCo's, whose quaternions have w first."""
    w, x, y, z = (float(value) for value in quaternion)
    q: Quaternion = (x, y, z, w)
    return Pose(_vector(position), q)


def _share(whole: Inertia, part: float) -> Inertia:
    """Return the mass properties of a part of a body that is like the whole."""
    xx, yy, zz, xy, xz, yz = (part * moment for moment in whole.tensor)
    return whole._replace(mass=part * whole.mass, tensor=(xx, yy, zz, xy, xz, yz))


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
