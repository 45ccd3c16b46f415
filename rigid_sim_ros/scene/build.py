# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A checked description of a scene becomes the model and the state that the engine runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
import json
import logging
from pathlib import Path
from typing import Any

import numpy as np

from rigid_sim_ros.engine.contact.penalty_force import check_step
from rigid_sim_ros.engine.dynamics.kinematic import LASTS
from rigid_sim_ros.engine.model.hulls import HullError
from rigid_sim_ros.engine.model.inertia import check, MassProperties
from rigid_sim_ros.engine.model.model import Body, build_model, Frame, Model
from rigid_sim_ros.engine.model.shapes import build_materials, build_shapes, Materials, Shapes
from rigid_sim_ros.engine.state.state import BodyMotion, empty_state, State, write_motions
from rigid_sim_ros.engine.steps.precompile import compile_beforehand
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.reading import is_inside
from rigid_sim_ros.scene import collision, mass, mesh, schema, terrain, visuals
from rigid_sim_ros.scene.document import Source
from rigid_sim_ros.scene.errors import below, Path as Place, Report, SceneError, shown
from rigid_sim_ros.scene.forces import force_table
from rigid_sim_ros.scene.joints import build_scene_joints, check_joints, put_together, SceneJoints
from rigid_sim_ros.scene.reach import far_beyond
from rigid_sim_ros.words import nearest

_logger = logging.getLogger(__name__)

_EXTREME = 'mass, size or speed leave the range of numbers, must be less extreme'


@dataclass(frozen=True, eq=False)
class Scene:
    """All that a world starts from; two scenes with the same text are the same to the bit."""

    name: str
    spec: schema.Scene  # what the file says, with all defaults and meshes in it
    text: str  # YAML that says the same and needs nothing beside it
    model: Model
    state: State  # at the start
    shapes: Shapes  # of the bodies that can touch
    materials: Materials
    names: tuple[str, ...]  # of the bodies
    frame_names: Mapping[str, int]  # 'crate', 'crate/handle': the frame's index in the model
    joints: SceneJoints | None

    # How the engine is to run it, in the words of the file.
    integrator: str
    orientation: str
    contact: str
    solver: str

    # What was ignored in the files of models, a line each; no part of the text.
    notes: tuple[str, ...] = ()

    @property
    def descriptions(self) -> Mapping[str, str]:
        """Return the URDF of each model that has one, for ~/MODEL/robot_description."""
        return self.spec.descriptions or {}

    @cached_property
    def physics_text(self) -> str:
        """Return the text of all that has a part in the motion: without what is only drawn."""
        spec = visuals.without_visuals(self.spec)
        return self.text if spec is self.spec else to_text(spec)

    @property
    def step_ns(self) -> int:
        """Return what the clock advances by in a step [ns]; physics use the step as it is."""
        return round(self.spec.world.step * 1e9)


def build(spec: schema.Scene, name: str, folder: Path | None, source: Source,
          notes: tuple[str, ...] = ()) -> Scene:
    """
    Return the scene; raises SceneError with all that is wrong beyond a single value.

    Mesh files are looked for in `folder`; None: the scene must hold its meshes itself. `source`
    says where in the file a mistake stands. `notes` are kept as they are.
    """
    if (spec.world.contact, spec.world.solver) == ('timestep', 'sequential') and (
            len(spec.bodies) > 1) and not spec.joints:
        compile_beforehand()
    problems: list[Problem] = []

    def report(path: Place, message: str) -> None:
        problems.append(source.problem(path, message))

    bodies, masses = [], []
    for i, body in enumerate(spec.bodies):
        here = below(('bodies', i), report)
        solid = _with_files(body, folder, here)
        bodies.append(_with_visuals(solid or body, folder, here))
        masses.append(_mass_properties(solid, here) if solid else None)
    spec = spec.model_copy(update={'bodies': tuple(bodies)})
    _check_references(spec, report)
    _check_bounds(spec, report)
    collision.check(spec, report)
    check_joints(spec, report)
    frame_names = _frame_names(spec)
    frames = [Frame(i, np.array(pose.position), np.array(pose.orientation))
              for i, body in enumerate(spec.bodies) for pose in body.frames.values()]
    owners = [*range(len(spec.bodies)), *(frame.body for frame in frames)]
    forces = force_table(spec, frame_names, owners, report)
    if problems:
        raise SceneError(problems)
    with np.errstate(all='ignore'):  # What overflows is reported below, with its place.
        # What a kinematic body weighs says nothing about its motion, which is of its body frame.
        model = build_model([Body(None if body.kinematic else properties, not body.is_pushed)
                             for properties, body in zip(masses, spec.bodies, strict=True)],
                            frames, forces, spec.world.step, spec.world.gravity)
        state = _initial_state(spec, model)
    _check_finite(model, state, report)
    if problems:
        raise SceneError(problems)
    joints = build_scene_joints(spec, model, report)
    if joints is not None:
        put_together(spec, model, state, joints, report)
    if not problems:
        for i, text in far_beyond(spec.world.bounds, model, state):
            report(('bodies', i), text)
    shapes = _shapes(spec, model, report)
    if problems or shapes is None:
        raise SceneError(problems)
    materials = _materials(spec, source)
    if spec.world.contact == 'penalty':
        try:
            check_step(model, shapes, materials)
        except ValueError as error:
            raise SceneError([source.problem(('world', 'step'), str(error))]) from None
    return Scene(name, spec, to_text(spec), model, state, shapes, materials,
                 tuple(body.name for body in spec.bodies), frame_names, joints,
                 spec.world.integrator, spec.world.orientation, spec.world.contact,
                 spec.world.solver, notes)


def _check_finite(model: Model, state: State, report: Report) -> None:
    """Report the bodies whose masses or motion leave the range of numbers."""
    numbers = np.vstack([np.atleast_2d(field) for field in (model.inv_m, model.inv_I_C, *state)])
    for i in np.flatnonzero(~np.isfinite(numbers).all(axis=0)).tolist():
        report(('bodies', i), _EXTREME)


def _materials(spec: schema.Scene, source: Source) -> Materials:
    """Return the materials by pairs; SceneError if two together leave the range of numbers."""
    materials = build_materials(collision.materials(spec), collision.overrides(spec))
    if not all(np.isfinite(field).all() for field in materials):
        raise SceneError([source.problem(('materials',), 'numbers of two materials together '
                                         'leave the range of numbers, must be less extreme')])
    return materials


def to_text(spec: schema.Scene) -> str:
    """Return a scene as YAML, a body to a line, each number so that it reads back the same."""
    return _yaml(spec.model_dump(exclude_none=True))


def as_written(spec: schema.Scene) -> str:
    """Return a scene as a user would write it: `to_text` without what has its default anyway."""
    return _yaml({'format': 1, **spec.model_dump(exclude_none=True, exclude_defaults=True)})


def _yaml(data: Mapping[str, Any]) -> str:
    lines: list[str] = []
    for key, value in data.items():
        if isinstance(value, tuple) and value:
            lines += [f'{key}:', *(f'- {json.dumps(item)}' for item in value)]
        else:
            lines.append(f'{key}: {json.dumps(value)}')
    return '\n'.join(lines) + '\n'


def _with_files(body: schema.Body, folder: Path | None, report: Report) -> schema.Body | None:
    """Return the body with what files hold of it in it; None if one is no good."""
    found = body.parts()
    if not any(isinstance(part, schema.Mesh | schema.Heightfield) for _, part in found):
        return body     # and no copy: a scene may have many thousand
    parts: list[schema.Shape] = []
    for path, part in found:
        if not isinstance(part, schema.Mesh | schema.Heightfield):
            parts.append(part)
            continue
        try:
            parts.append(_whole_mesh(part, folder) if isinstance(part, schema.Mesh)
                         else _whole_field(part, folder))
        except ValueError as error:
            report(path if part.file is None else (*path, 'file'), str(error))
    return body.with_parts(parts) if len(parts) == len(found) else None


def _whole_mesh(part: schema.Mesh, folder: Path | None) -> schema.Mesh:
    """Return a mesh with its triangles in it; ValueError if they make no volume, or surface."""
    surface = _surface(part, folder)
    if part.convex:
        surface = mesh.closed(surface)
    else:
        terrain.check_triangles(surface)
    return part.model_copy(update={
        'file': None, 'scale': (1.0, 1.0, 1.0), 'vertices': _rows(surface.vertices),
        'faces': _rows(surface.faces)})


def _whole_field(part: schema.Heightfield, folder: Path | None) -> schema.Heightfield:
    """Return a heightfield with its heights [m] in it; ValueError if they make no surface."""
    heights = (np.array(part.heights) if part.file is None
               else terrain.read_heights(_beside(part.file, folder, 'heights')))
    heights = heights * part.size[2] if len(part.size) == 3 else heights
    terrain.check_heights(heights)
    return part.model_copy(update={
        'file': None, 'heights': _rows(heights), 'size': part.size[:2]})


def _with_visuals(body: schema.Body, folder: Path | None, report: Report) -> schema.Body:
    """Return the body with the triangles of what it is drawn with in it."""
    if body.visuals is None:
        return body
    found: list[schema.Visual] = []
    for i, visual in enumerate(body.visuals):
        shape, place = visual.shape, ('visuals', i, 'shape')
        given = [key for key in ('mass', 'density', 'material') if getattr(shape, key) is not None]
        if given:
            report((*place, given[0]), 'stands in a visual, which is only drawn: must stand in '
                   'the shape of the body')
        if isinstance(shape, schema.Plane | schema.Points):
            report((*place, 'type'), f'{shown(shape.type)}, must be another one: of a visual '
                   'triangles are drawn')
        if not isinstance(shape, schema.Mesh | schema.Heightfield):
            found.append(visual)
            continue
        try:
            found += (_drawn(visual, shape, folder) if isinstance(shape, schema.Mesh) else
                      [visual.model_copy(update={'shape': _whole_field(shape, folder)})])
        except ValueError as error:
            report(place if shape.file is None else (*place, 'file'), str(error))
    return body.model_copy(update={'visuals': tuple(found)})


def _drawn(visual: schema.Visual, part: schema.Mesh, folder: Path | None) -> list[schema.Visual]:
    """Return what is drawn of a mesh: as it is, or of a file in each of its colours."""
    if part.file is None:
        assert part.vertices is not None and part.faces is not None
        last = max(map(max, part.faces))
        if last >= len(part.vertices):
            raise ValueError(f'a face has the vertex {last}, must be below {len(part.vertices)}')
        if part.scale == (1.0, 1.0, 1.0):
            return [visual]
        scaled = _rows(np.array(part.vertices) * part.scale)
        return [visual.model_copy(update={'shape': part.model_copy(update={
            'vertices': scaled, 'scale': (1.0, 1.0, 1.0)})})]
    if folder is None:
        raise ValueError(f'{shown(part.file)} is not beside the scene, must be vertices '
                         'and faces in it')
    return [visual.model_copy(update={
        'shape': part.model_copy(update={
            'file': None, 'scale': (1.0, 1.0, 1.0), 'vertices': _rows(one.vertices),
            'faces': _rows(one.faces)}),
        'color': visual.color or one.color}) for one in visuals.drawn(
            visuals.read(folder / part.file, part.scale), visuals.MOST_FACES)]


def _surface(part: schema.Mesh, folder: Path | None) -> mesh.Mesh:
    """Return the triangles that a mesh names or holds, scaled."""
    if part.file is None:
        surface = mesh.Mesh(np.array(part.vertices), np.array(part.faces))
    else:
        surface = mesh.read(_beside(part.file, folder, 'vertices and faces'))
    return surface._replace(vertices=surface.vertices * part.scale)


def _beside(file: str, folder: Path | None, instead: str) -> Path:
    """Return where a file beside the scene lies; ValueError for a scene that has no place."""
    if folder is None:
        raise ValueError(f'{shown(file)} is not beside the scene, must be {instead} in it')
    path = folder / file
    # In the working directory a program looks for its own files.
    if folder != Path() and path.is_file() and not is_inside(path, folder):
        _logger.warning('the file %s lies outside of the folder of the scene', path)
    return path


def _rows(array: Array | IntArray) -> tuple[tuple[float | int, ...], ...]:
    return tuple(map(tuple, array.tolist()))


def _check_references(spec: schema.Scene, report: Report) -> None:
    """Report what does not fit together although each value is right by itself."""
    first: dict[str, int] = {}
    names = {body.name for body in spec.bodies}
    for i, body in enumerate(spec.bodies):
        if first.setdefault(body.name, i) != i:
            report(('bodies', i, 'name'), f'{shown(body.name)} is the name of bodies'
                   f'[{first[body.name]}] too, must be unique')
        above = body.name.partition('/')[0]
        if above != body.name and above in first:
            report(('bodies', i, 'name'), f'{shown(body.name)} begins with the name of bodies'
                   f'[{first[above]}], must begin with another one')
        if body.shape is not None and body.compound is not None:
            report(('bodies', i, 'compound'), 'stands beside shape, must be one of them: '
                   'the parts of a compound are all that a body has')
        if body.fixed and body.kinematic:
            report(('bodies', i, 'kinematic'), 'stands beside fixed: true, must be one of them: a '
                   'kinematic body moves by its twist')
        elif body.fixed and any((*body.twist.linear, *body.twist.angular)):
            report(('bodies', i, 'twist'), 'of a fixed body, must be 0, or the body kinematic: '
                   'true in place of fixed')
        for key, (name, _) in zip(body.frames, body.named_frames(), strict=True):
            if name in names:
                report(('bodies', i, 'frames', key), f'{shown(name)} is the name of a body or of '
                       'another frame, must be unique')
            names.add(name)
        named = [((), body.material), *((path, part.material) for path, part in body.parts())]
        for path, material in named:
            if material is not None and material not in spec.all_materials:
                report(('bodies', i, *path, 'material'), f'{shown(material)} is no material, '
                       f'{nearest(material, spec.all_materials)}')


def _check_bounds(spec: schema.Scene, report: Report) -> None:
    """Report motion at the start that is so far beyond the bounds that it could not be saved."""
    bounds = spec.world.bounds
    for i, body in enumerate(spec.bodies):
        for place, numbers, key, unit in (
                (('pose', 'position'), body.pose.position, 'position', 'm'),
                (('twist', 'linear'), body.twist.linear, 'linear', 'm/s'),
                (('twist', 'angular'), body.twist.angular, 'angular', 'rad/s')):
            bound: float = schema.FAR * getattr(bounds, key)
            if max(map(abs, numbers)) > bound:
                report(('bodies', i, *place), f'{shown(list(numbers))} {unit}, must be within '
                       f'{bound:g} {unit}, {schema.FAR:g} times what '
                       f'`world: {{bounds: {{{key}: ...}}}}` says')


def _mass_properties(body: schema.Body, report: Report) -> MassProperties | None:
    """Return what the body weighs, None for nothing; report why it cannot be had."""
    mistakes = list(mass.mistakes(body))
    for path, message in mistakes:
        report(path, message)
    if mistakes:
        return None
    place = 'inertial' if body.inertial else 'compound' if body.compound else 'shape'
    try:
        with np.errstate(all='ignore'):
            properties = mass.properties(body)
            if properties is not None:
                check(properties)
    except ArithmeticError:
        report((place,), _EXTREME)
    except ValueError as error:
        report((place,), str(error))
    else:
        return properties
    return None


def _shapes(spec: schema.Scene, model: Model, report: Report) -> Shapes | None:
    """Return what can touch, None after a report of what cannot be built."""
    solids, places = collision.shapes(spec, report)
    try:
        built = build_shapes(model, solids, collision.ignored(spec))
    except HullError as error:
        report(places[error.index], str(error))
    except ValueError as error:
        report(('bodies',), str(error))
    else:
        with np.errstate(over='ignore'):
            reach = np.linalg.norm(built.p_CS, axis=1)
        for k in np.flatnonzero(~np.isfinite(reach)).tolist():
            report(('bodies', int(built.body[k])), _EXTREME)
        return built
    return None


def _frame_names(spec: schema.Scene) -> dict[str, int]:
    """Return the index in the model of each frame: those of the bodies, then the named ones."""
    names = [body.name for body in spec.bodies]
    names += [name for body in spec.bodies for name, _ in body.named_frames()]
    return {name: index for index, name in enumerate(names)}


def _initial_state(spec: schema.Scene, model: Model) -> State:
    n = len(spec.bodies)
    motion = BodyMotion(
        np.array([body.pose.position for body in spec.bodies]),
        np.array([body.pose.orientation for body in spec.bodies]),
        np.array([body.twist.linear for body in spec.bodies]),
        np.array([body.twist.angular for body in spec.bodies]))
    state = empty_state(n)
    write_motions(model, state, motion)
    state.twist_steps_left[[body.kinematic for body in spec.bodies]] = LASTS
    return state
