# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The models of a scene become bodies and joints of it: nothing behind this knows of models."""

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping
import math
from pathlib import Path
from typing import Any

import numpy as np

from rigid_sim_ros.engine.model.inertia import mesh_volume
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.models.description import MeshFile, Model, Shape
from rigid_sim_ros.models.findings import ModelError
from rigid_sim_ros.models.parts import make_parts, Parts, ros_name, Wish
from rigid_sim_ros.models.poses import Pose
from rigid_sim_ros.models.read import ending, read_model
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.scene import mesh, schema, terrain, visuals as visuals_of
from rigid_sim_ros.scene.collision import convex_hull
from rigid_sim_ros.scene.document import Source
from rigid_sim_ros.scene.errors import below, dotted, Path as Place, Report, SceneError, shown
from rigid_sim_ros.words import matching, nearest

# Part of its convex hull that a collision mesh may leave empty without a word.
_HOLLOW = 0.01
# Triangles of a mesh that collides as it is: each is a shape of its own.
_MOST_SHEETS = 20_000
# Corners of a convex hull that stay as they are. Contacts of hulls with thousands take time, which
# scanned or finely meshed shapes have: those lose corners ...
MOST_CORNERS = 256
# ... that stand out by less than this part of the largest extent: 0.4 mm of a link of 0.2 m.
COARSE = 2e-3


class Expansion:
    """
    The bodies and joints of a scene's models, as a source of their own.

    Mistakes in them are told with the place in the model's file.
    """

    def __init__(self, spec: schema.Scene, folder: Path | None, source: Source,
                 *, is_alone: bool) -> None:
        """Read all models of a scene; raises SceneError with what is wrong in them."""
        self.notes: list[str] = []
        self.world: dict[str, Any] = {}
        self._parts: list[Parts] = []
        self._descriptions: dict[str, str] = {}
        self._first_body = len(spec.bodies)
        self._first_joint = len(spec.joints or ())
        self._behind = source
        problems: list[Problem] = []

        def report(path: Place, message: str) -> None:
            problems.append(source.problem(path, message))

        for i, entry in enumerate(spec.models or ()):
            problems += self._tried(entry, folder, below(('models', i), report), is_alone)
        if problems:
            raise SceneError(problems)
        self.data: dict[str, Any] = {
            'bodies': [body for parts in self._parts for body in parts.bodies],
            'joints': [joint for parts in self._parts for joint in parts.joints],
            'collision': {'ignore': [pair for parts in self._parts for pair in parts.ignore]}}

    def _tried(self, entry: schema.ModelFile, folder: Path | None, report: Report,
               is_alone: bool) -> list[Problem]:
        """Add a model, or return what is wrong in its file."""
        try:
            self._add(entry, folder, report, is_alone=is_alone)
        except ModelError as error:
            return list(error.findings)
        return []

    def _add(self, entry: schema.ModelFile, folder: Path | None, report: Report, *,
             is_alone: bool) -> None:
        if folder is None:
            report(('file',), f'{shown(entry.file)} is not beside the scene, must be bodies and '
                   'joints in it')
            return
        if not ending(entry.file):
            # The reader's own words, at this place in the scene.
            try:
                read_model(Path(entry.file))
            except ModelError as error:
                report(('file',), f'{shown(entry.file)} {error.findings[0].message}')
            return
        model = read_model(
            folder / entry.file,
            {name: folder / path for name, path in entry.packages.items()},
            None if entry.srdf is None else folder / entry.srdf, entry.arguments)
        if model.urdf:
            self._descriptions[entry.name] = model.urdf
        wish = _wish(entry, model, report)
        meshes = _Meshes()
        if entry.visuals:
            meshes.look_at(shape for link in model.links for shape in link.visuals)
        parts = make_parts(model, wish, meshes)
        self._parts.append(parts)
        if is_alone:
            self.world = dict(model.world)
        elif model.world:
            parts.notes.append(Problem(f'its {" and ".join(model.world)} are ignored: those of '
                                       'the scene hold', '', model.place.file, model.place.line))
        notes = [*parts.notes]
        if meshes.hollow:
            notes.append(Problem('these meshes are not convex, or not closed, and collide as '
                                 f'their convex hulls: {", ".join(dict.fromkeys(meshes.hollow))}',
                                 '', model.place.file))
        if meshes.coarsest > 0.0:
            notes.append(Problem(f'convex hulls with more than {MOST_CORNERS} corners are made '
                                 f'simpler, by {1e3 * meshes.coarsest:.2g} mm at most', '',
                                 model.place.file))
        self.notes += map(str, notes)

    def merged(self, spec: schema.Scene, made: schema.Scene) -> schema.Scene:
        """Return the scene with the bodies and joints of its models, and without models."""
        collision = spec.collision.model_copy(update={
            'ignore': (*spec.collision.ignore, *made.collision.ignore)})
        world = spec.world.model_copy(update=self.world)
        joints = (*(spec.joints or ()), *(made.joints or ()))
        # What is written in the scene holds.
        descriptions = self._descriptions | (spec.descriptions or {})
        return spec.model_copy(update={
            'world': world, 'bodies': (*spec.bodies, *made.bodies), 'collision': collision,
            'descriptions': descriptions or None,
            'joints': joints if joints or spec.joints is not None else None, 'models': None})

    def problem(self, path: Place, message: str) -> Problem:
        """Return a problem of the bodies and joints of the models alone."""
        first = self._first_body if path[:1] == ('bodies',) else self._first_joint
        moved = (path[0], path[1] + first, *path[2:]) if (
            len(path) > 1 and isinstance(path[1], int)) else path
        return self.in_scene().problem(moved, message)

    def in_scene(self) -> 'MergedSource':
        """Return what names a place in the scene with its models."""
        return MergedSource(self._behind, self._first_body, self._first_joint, self._parts)


class MergedSource:
    """Where the bodies and joints of a scene with models come from."""

    def __init__(self, behind: Source, first_body: int, first_joint: int,
                 parts: list[Parts]) -> None:
        """Keep the places."""
        self.data = behind.data
        self._behind = behind
        self._lists = {
            'bodies': (first_body, [(place, body['name']) for part in parts for place, body in zip(
                part.body_places, part.bodies, strict=True)]),
            'joints': (first_joint, [(place, one['name']) for part in parts for place, one in zip(
                part.joint_places, part.joints, strict=True)])}

    def problem(self, path: Place, message: str) -> Problem:
        """Return a problem with its place in the scene or in the file of a model."""
        first, made = self._lists.get(str(path[0]) if path else '', (0, []))
        if len(path) > 1 and isinstance(path[1], int) and first <= path[1] < first + len(made):
            place, name = made[path[1] - first]
            key = f'{name}: {dotted(path[2:])}' if len(path) > 2 else name
            return Problem(message, key, place.file, place.line)
        return self._behind.problem(path, message)


def alone(path: Path) -> dict[str, Any]:
    """Return the scene of a model that is given where a scene is asked for."""
    name = ros_name(path.name.partition('.')[0]).replace('/', '_') or 'model'
    return {'world': {'contact': 'none'}, 'models': [
        {'name': 'model' if name in ('world', '_') else name, 'file': path.name}]}


def _wish(entry: schema.ModelFile, model: Model, report: Report) -> Wish:
    """Return what the scene says of a model; report joints that it has not."""
    named = _Named(model, report)
    positions = {name: position for wanted, position in entry.joints.items()
                 for name in named.matching(wanted, ('joints', wanted))}
    # What follows another joint has a drive of its own where it is named, not where all are meant.
    follow = {joint.name for joint in model.joints if joint.mimic is not None}
    drives = {name: drive.model_dump(exclude_none=True) for pattern, drive in entry.drives.items()
              for name in named.matching(pattern, ('drives', pattern))
              if name not in follow or not set('*?[') & set(pattern)}
    unlimited = {name for i, pattern in enumerate(entry.unlimited)
                 for name in named.matching(pattern, ('unlimited', i))}
    return Wish(entry.name, Pose(entry.pose.position, entry.pose.orientation), entry.fixed_base,
                positions, drives, frozenset(unlimited), entry.mend_inertia, entry.material,
                entry.visuals)


class _Named:
    """The joints with one axis of a model, by their names in the file or in the scene."""

    def __init__(self, model: Model, report: Report) -> None:
        self._names = [joint.name for joint in model.joints if joint.kind in schema.ONE_AXIS]
        self._report = report

    def matching(self, pattern: str, place: Place) -> list[str]:
        """Return the names in the file of joints that match; report a pattern that none does."""
        found = [name for name in self._names
                 if matching([name, ros_name(name)], [pattern])]
        if not found:
            self._report(place, f'{shown(pattern)} is no joint of the model with one axis, '
                         f'{nearest(pattern, self._names) if self._names else "must be none"}')
        return found


def _key(shape: Shape) -> Hashable:
    """Return what tells the mesh of a shape from others."""
    return shape.mesh if shape.mesh is not None else (id(shape.points), id(shape.faces))


def _field(shape: Shape) -> dict[str, Any]:
    """Return a heightfield in the words of a scene; ValueError for what cannot be read."""
    assert shape.mesh is not None
    heights = terrain.read_heights(shape.mesh.path)
    terrain.check_heights(heights)
    x, y, z = shape.mesh.scale
    return {'type': 'heightfield', 'heights': (z * heights).tolist(), 'size': [x, y]}


def _triangles(file: MeshFile) -> tuple[Array, IntArray]:
    """Return vertices [m] and triangles of a file; ValueError for what is no mesh."""
    surface = mesh.read(file.path)
    points = surface.vertices * file.scale
    if not np.isfinite(points).all():
        raise ValueError(f'{file.path} has a vertex that is not finite, must be numbers')
    # A scale that mirrors turns the surface inside out.
    faces = np.asarray(surface.faces)
    return points, faces if math.prod(file.scale) > 0.0 else faces[:, ::-1]


def _is_hollow(points: Array, faces: IntArray, corners: Array, sides: IntArray) -> bool:
    """Return whether triangles enclose much less than their hull does."""
    hull = mesh_volume(corners, np.asarray(sides))
    return abs(mesh_volume(points, np.asarray(faces))) < (1.0 - _HOLLOW) * hull


class _Meshes:
    """Reads the meshes of a model, each once: hulls of those that touch, and what is seen."""

    def __init__(self) -> None:
        """Begin without any."""
        self._seen: dict[Hashable, list[visuals_of.Drawn] | str] = {}   # or why there is none
        self._surfaces: dict[MeshFile, tuple[Array, IntArray]] = {}
        self._hulls: dict[MeshFile, tuple[Array, IntArray]] = {}
        self._grounds: dict[MeshFile, tuple[Array, IntArray] | None] = {}
        self.hollow: list[str] = []     # those that leave a part of their hull empty
        self.coarsest = 0.0     # [m] by which hulls are smaller than those of the files

    def read(self, shape: Shape, is_fixed: bool) -> dict[str, Any]:
        """
        Return what is in a file in the words of a scene; ValueError if that cannot touch.

        Of a mesh that is its convex hull, but of a body that is fixed the mesh itself where it has
        no hull that is like it: buildings, and grounds.
        """
        if shape.kind == 'heightfield':
            return _field(shape)
        ground = self._ground_of(shape.mesh) if is_fixed and shape.mesh is not None else None
        if ground is not None:
            return {'type': 'mesh', 'vertices': ground[0].tolist(), 'faces': ground[1].tolist(),
                    'convex': False}
        vertices, faces = self.hull_of(shape)
        return {'type': 'mesh', 'vertices': vertices.tolist(), 'faces': faces.tolist()}

    def _surface_of(self, file: MeshFile) -> tuple[Array, IntArray]:
        """Return vertices [m] and triangles of a file; ValueError for what is no mesh."""
        if file not in self._surfaces:
            self._surfaces[file] = _triangles(file)
        return self._surfaces[file]

    def _ground_of(self, file: MeshFile) -> tuple[Array, IntArray] | None:
        """Return vertices and triangles of a mesh that is not like its hull, and not too large."""
        if file not in self._grounds:
            self._grounds[file] = self._ground(file)
        return self._grounds[file]

    def _ground(self, file: MeshFile) -> tuple[Array, IntArray] | None:
        points, faces = self._surface_of(file)
        if len(faces) > _MOST_SHEETS:
            return None
        try:
            is_hollow = _is_hollow(points, faces, *convex_hull(points))
        except ValueError:      # it is flat
            is_hollow = True
        return (points, faces) if is_hollow else None

    def look_at(self, shapes: Iterable[Shape]) -> None:
        """Read all meshes that are seen: they share the triangles that a model may have."""
        sources: dict[Hashable, visuals_of.Source] = {}
        uses: Counter[Hashable] = Counter()
        for shape in shapes:
            key = _key(shape)
            uses[key] += 1
            if shape.kind != 'mesh' or key in self._seen or key in sources:
                continue
            try:
                sources[key] = self._source(shape)
            except ValueError as error:
                self._seen[key] = str(error)
        shares = visuals_of.shares(list(sources.values()), [uses[key] for key in sources])
        for (key, source), most in zip(sources.items(), shares, strict=True):
            self._seen[key] = visuals_of.drawn(source, most)

    def _source(self, shape: Shape) -> visuals_of.Source:
        if shape.mesh is not None:
            return visuals_of.read(*shape.mesh)
        vertices, faces = (self.hull_of(shape) if shape.faces is None else
                           (np.asarray(shape.points), np.asarray(shape.faces)))
        return visuals_of.Source(vertices, faces, np.zeros(len(faces), int), [None])

    def drawn(self, shape: Shape, pose: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Return what shows a shape, in the words of a scene; ValueError for a broken file."""
        if shape.kind != 'mesh':
            color = {} if shape.color is None else {'color': list(shape.color)}
            values = {'type': shape.kind, **shape.values} if shape.mesh is None else _field(shape)
            return [{'shape': {**values, 'pose': pose}, **color}]
        # What is no visual, and stands in for one, is drawn as what it is to others.
        found = self._seen.get(_key(shape)) or [visuals_of.Drawn(*self.hull_of(shape), None)]
        if isinstance(found, str):
            raise ValueError(found)
        return [visuals_of.words(one, pose, shape.color) for one in found if len(one.faces)]

    def hull_of(self, shape: Shape) -> tuple[Array, IntArray]:
        """Return corners and triangles of the convex hull; ValueError if there is none."""
        if shape.mesh is None:
            return self._few(np.asarray(shape.points, dtype=np.float64))
        if shape.mesh not in self._hulls:
            self._hulls[shape.mesh] = self._hull(shape.mesh)
        return self._hulls[shape.mesh]

    def _hull(self, file: MeshFile) -> tuple[Array, IntArray]:
        points, faces = self._surface_of(file)
        hull = self._few(points)
        if _is_hollow(points, faces, *hull):
            self.hollow.append(file.path.name)
        return hull

    def _few(self, points: Array) -> tuple[Array, IntArray]:
        """Return a convex hull, with fewer corners where it has very many."""
        hull = convex_hull(points)
        if len(hull[0]) > MOST_CORNERS:
            tolerance = COARSE * float(np.ptp(hull[0], axis=0).max())
            self.coarsest = max(self.coarsest, tolerance)
            return convex_hull(hull[0], tolerance)
        return hull
