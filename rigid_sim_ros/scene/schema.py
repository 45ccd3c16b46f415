# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The scene file format: one class for each mapping in the file.

Each class holds what the user wrote, checked by itself; what needs two places of the file at once
(a body and its material, a force and its frames) is checked in build.py.
"""

from collections.abc import Iterator
import math
from typing import Annotated, Any, Literal, TypeAlias, Union

import numpy as np
from pydantic import (
    AfterValidator, create_model, Discriminator, field_serializer, model_validator, Tag)

from rigid_sim_ros.engine.dynamics.forces import ForceKind, FORCES, Parameter
from rigid_sim_ros.engine.dynamics.integrate import ORIENTATIONS
from rigid_sim_ros.engine.steps.free import FREE_MOTION
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene.errors import Path
from rigid_sim_ros.scene.joint_schema import (
    Joint, JointDrive, JointSpring, ModelFile, ONE_AXIS)
from rigid_sim_ros.scene.spec import AngularVelocity, Boolean, Pose, Position, Spec, Velocity
from rigid_sim_ros.scene.terrain import grid_surface
from rigid_sim_ros.scene.values import (
    Choice, Color, Count, Density, FieldSize, Format, Heights, index, Length, ListOf, Mass, Name,
    NamePair, Numbers, PartName, Quantity, Quaternion, refuse, Rows, Scale, Text, Vector)

# What is of this format too, and has a module of its own.
__all__ = ['ONE_AXIS', 'Joint', 'JointDrive', 'JointSpring', 'ModelFile', 'Pose', 'Spec']

INTEGRATORS = tuple(FREE_MOTION)
CONTACTS = ('none', 'penalty', 'event', 'timestep')
SOLVERS = ('sequential', 'qp')


def _not_empty(entries: tuple[Any, ...]) -> tuple[Any, ...]:
    if not entries:
        raise refuse('is empty, must have at least one entry')
    return entries


_NOT_EMPTY = AfterValidator(_not_empty)


# Times the bounds: no snapshot of a world that runs holds more.
FAR = 1e6


class Bounds(Spec):
    """What a body may be told, as the largest value of a component: beyond it nobody means it."""

    position: Annotated[float, Quantity('m', above=0.0, most=1e100)] = 1e9
    linear: Annotated[float, Quantity('m/s', above=0.0, most=1e100)] = 1e6
    angular: Annotated[float, Quantity('rad/s', above=0.0, most=1e100)] = 1e5


class World(Spec):
    """What holds for the whole scene."""

    gravity: Annotated[Vector, Numbers('x y z', Quantity('m/s^2'))] = (0.0, 0.0, -9.81)
    # A stamp counts nanoseconds: a step below half of one would not move the clock.
    step: Annotated[float, Quantity('s', above=0.0, least=1e-9, most=1e6)] = 0.001
    integrator: Annotated[str, Choice(INTEGRATORS)] = 'symplectic'
    orientation: Annotated[str, Choice(ORIENTATIONS)] = 'quaternion'
    contact: Annotated[str, Choice(CONTACTS)] = 'timestep'
    solver: Annotated[str, Choice(SOLVERS)] = 'sequential'
    bounds: Bounds = Bounds()


class Surface(Spec):
    """How surfaces slide, roll and bounce."""

    friction: Annotated[float, Quantity(least=0.0)] = 0.5
    restitution: Annotated[float, Quantity(least=0.0, most=1.0)] = 0.0
    # Levers of the normal force against rolling and against turning about the normal.
    rolling: Annotated[float, Quantity('m', least=0.0)] = 0.0
    spinning: Annotated[float, Quantity('m', least=0.0)] = 0.0
    # Of each contact point in the penalty model: stiffness * depth * (1 + damping * rate).
    stiffness: Annotated[float, Quantity('N/m', above=0.0)] = 1e5
    damping: Annotated[float, Quantity('s/m', least=0.0)] = 0.5


class Material(Surface):
    """A surface; two of them combine when they touch. Its colour is that of its bodies."""

    color: Annotated[tuple[float, ...], Color()] | None = None


class MaterialPair(Surface):
    """What two materials give together, in the place of what would follow from each."""

    a: Annotated[str, Text()]
    b: Annotated[str, Text()]


class Collision(Spec):
    """How contacts are found and solved."""

    # Pairs of bodies that never touch.
    ignore: tuple[Annotated[tuple[str, str], NamePair()], ...] = ()
    # Without effect: fast bodies are always stopped at what they would pass through in a step.
    continuous: Boolean = False
    # Of the sequential solver: more are stiffer and slower.
    substeps: Annotated[int, Count(1, 64)] = 4
    # s, of the sequential solver: what has been at rest for so long sleeps; 0: nothing does.
    sleep_after: Annotated[float, Quantity('s', least=0.0)] = 0.0


class Twist(Spec):
    """The velocity of the body frame's origin and of the body about it, in world axes."""

    linear: Velocity = (0.0, 0.0, 0.0)
    angular: AngularVelocity = (0.0, 0.0, 0.0)


class Inertial(Spec):
    """Mass properties as a data sheet has them: about the centre of mass, in body axes."""

    mass: Mass
    com: Position = (0.0, 0.0, 0.0)
    inertia: Annotated[tuple[float, float, float, float, float, float],
                       Numbers('ixx iyy izz ixy ixz iyz', Quantity('kg m^2'))]


class Shape(Spec):
    """A solid in the frame of its body."""

    type: str
    pose: Pose = Pose()
    # Of a part of a compound only: a body has its own.
    mass: Mass | None = None
    density: Density | None = None
    material: Annotated[str, Text()] | None = None


class Sphere(Shape):
    """A ball about the origin."""

    type: Literal['sphere']
    radius: Length


class Box(Shape):
    """A box about the origin, given by its full lengths."""

    type: Literal['box']
    size: Annotated[Vector, Numbers('x y z', Quantity('m', above=0.0))]


class Capsule(Shape):
    """A cylinder about z with half a ball on each end; the length is without them."""

    type: Literal['capsule']
    radius: Length
    length: Length


class Cylinder(Shape):
    """A cylinder about z."""

    type: Literal['cylinder']
    radius: Length
    length: Length


class Cone(Shape):
    """A cone about z, of its full height; the origin is half way between base and apex."""

    type: Literal['cone']
    radius: Length
    length: Length


class Ellipsoid(Shape):
    """An ellipsoid about the origin, given by its radii along the axes."""

    type: Literal['ellipsoid']
    radii: Annotated[Vector, Numbers('x y z', Quantity('m', above=0.0))]


class Plane(Shape):
    """The half space below the plane normal . r = offset; of a body that nothing pushes."""

    type: Literal['plane']
    normal: Annotated[Vector, Numbers('x y z')] = (0.0, 0.0, 1.0)
    offset: Annotated[float, Quantity('m')] = 0.0

    @model_validator(mode='after')
    def _has_direction(self) -> 'Plane':
        if not any(self.normal):
            raise refuse('[0, 0, 0] has no direction, must be such as [0, 0, 1]', 'normal')
        return self


class Mesh(Shape):
    """A closed surface, from a file beside the scene or as vertices and triangles in it."""

    type: Literal['mesh']
    file: Annotated[str, Text()] | None = None
    vertices: Annotated[tuple[Vector, ...], Rows(Quantity('m'), 'x y z')] | None = None
    faces: Annotated[tuple[tuple[int, int, int], ...], Rows(index, 'i j k')] | None = None
    scale: Annotated[Vector, Scale()] = (1.0, 1.0, 1.0)
    # False, of a body that nothing pushes: its triangles collide, not its convex hull.
    convex: Boolean = True

    @model_validator(mode='after')
    def _has_one_source(self) -> 'Mesh':
        inline = self.vertices is not None and self.faces is not None
        partly = self.vertices is not None or self.faces is not None
        if (self.file is None) != inline or (self.file is not None and partly):
            raise refuse('must have a file, or vertices and faces')
        return self

    @field_serializer('vertices', 'faces', when_used='unless-none')
    def _as_text(self, rows: tuple[tuple[float, ...], ...]) -> str:
        return ', '.join(' '.join(map(repr, row)) for row in rows)


class Heightfield(Shape):
    """
    The ground below a surface z(x, y) over a rectangle about the origin; nothing pushes its body.

    Heights [m] in rows along x, the first of them at the least y. With a third number in `size`
    they are shares of that.
    """

    type: Literal['heightfield']
    file: Annotated[str, Text()] | None = None
    heights: Annotated[tuple[tuple[float, ...], ...], Heights()] | None = None
    size: Annotated[tuple[float, ...], FieldSize()]

    @model_validator(mode='after')
    def _has_one_source(self) -> 'Heightfield':
        if (self.file is None) == (self.heights is None):
            raise refuse('must have a file, or heights')
        return self

    @field_serializer('heights', when_used='unless-none')
    def _as_text(self, rows: tuple[tuple[float, ...], ...]) -> str:
        return ', '.join(' '.join(map(repr, row)) for row in rows)

    @property
    def vertices(self) -> Array:
        """Return the corners [m] of its triangles, (v, 3), once its heights are in it."""
        return self._surface[0]

    @property
    def faces(self) -> IntArray:
        """Return its triangles, (t, 3) rows of the vertices."""
        return self._surface[1]

    @property
    def _surface(self) -> tuple[Array, IntArray]:
        return grid_surface(np.array(self.heights), (self.size[0], self.size[1]))


class Points(Shape):
    """Particles: they give a body its mass properties and collide with nothing."""

    type: Literal['points']
    positions: Annotated[tuple[Vector, ...], Rows(Quantity('m'), 'x y z')]
    masses: Annotated[tuple[float, ...], ListOf(Quantity('kg', above=0.0), 'masses [kg]')]

    @model_validator(mode='after')
    def _has_as_many(self) -> 'Points':
        if len(self.masses) != len(self.positions):
            raise refuse(f'{len(self.masses)} masses for {len(self.positions)} positions, '
                         'must be as many', 'masses')
        return self


def is_surface(part: Shape) -> bool:
    """Return whether a part is a surface without a mass: a heightfield, or a mesh as it is."""
    return isinstance(part, Heightfield) or (isinstance(part, Mesh) and not part.convex)


def _kind(data: Any) -> str:
    """
    Return which class reads a mapping, or has read it.

    It stands in angle brackets in the path of an error, which tell it from a key of the file.
    """
    if isinstance(data, dict):
        return f'<{data.get("type", "compound" if "compound" in data else "")}>'
    return f'<{getattr(data, "type", "")}>'


_Solid: TypeAlias = (
    Annotated[Sphere, Tag('<sphere>')] | Annotated[Box, Tag('<box>')]
    | Annotated[Capsule, Tag('<capsule>')] | Annotated[Cylinder, Tag('<cylinder>')]
    | Annotated[Cone, Tag('<cone>')] | Annotated[Ellipsoid, Tag('<ellipsoid>')]
    | Annotated[Plane, Tag('<plane>')] | Annotated[Mesh, Tag('<mesh>')]
    | Annotated[Heightfield, Tag('<heightfield>')] | Annotated[Points, Tag('<points>')])
Part: TypeAlias = Annotated[_Solid, Discriminator(_kind)]


class Compound(Spec):
    """Several solids that move as one."""

    type: Literal['compound'] = 'compound'
    compound: Annotated[tuple[Part, ...], _NOT_EMPTY]


class Visual(Spec):
    """What a body is drawn with; it has no part in the motion."""

    shape: Part
    color: Annotated[tuple[float, ...], Color()] | None = None    # None: that of the body


class Body(Spec):
    """One rigid body."""

    name: PartName
    shape: Annotated[_Solid | Annotated[Compound, Tag('<compound>')],
                     Discriminator(_kind)] | None = None
    # Short for shape: {compound: [...]}.
    compound: Annotated[tuple[Part, ...], _NOT_EMPTY] | None = None
    mass: Mass | None = None
    density: Density | None = None
    inertial: Inertial | None = None
    material: Annotated[str, Text()] = 'default'
    color: Annotated[tuple[float, ...], Color()] | None = None
    pose: Pose = Pose()
    twist: Twist = Twist()
    # A name with a slash is the whole name of a frame, another one stands behind the body's.
    frames: dict[PartName, Pose] = {}
    fixed: Boolean = False
    # It moves by its twist, and pushes without being pushed.
    kinematic: Boolean = False
    # Who touches whom: two bodies collide when each collides with a group of the other.
    collides: Boolean = True
    groups: Annotated[tuple[str, ...], ListOf(Text(), 'names of groups')] = ('default',)
    # None: with every group.
    collides_with: Annotated[tuple[str, ...] | None, ListOf(Text(), 'names of groups')] = None
    # What it is drawn with in the place of its solids; None: with these.
    visuals: tuple[Visual, ...] | None = None

    def named_frames(self) -> Iterator[tuple[str, Pose]]:
        """Yield the frames of the body, each with its whole name: BODY/FRAME or MODEL/FRAME."""
        for name, pose in self.frames.items():
            yield (name if '/' in name else f'{self.name}/{name}'), pose

    @property
    def is_pushed(self) -> bool:
        """Whether forces and contacts move the body."""
        return not self.fixed and not self.kinematic

    def parts(self) -> list[tuple[Path, Shape]]:
        """Return the solids of the body, each with its place below the body."""
        if self.compound is not None:
            return [(('compound', i), part) for i, part in enumerate(self.compound)]
        if isinstance(self.shape, Compound):
            return [(('shape', 'compound', i), part) for i, part in enumerate(self.shape.compound)]
        return [] if self.shape is None else [(('shape',), self.shape)]

    def drawn(self) -> list[tuple[Shape, tuple[float, ...] | None]]:
        """Return what the body is drawn with; a colour of None is that of the body."""
        parts = [part for _, part in self.parts()]
        if self.visuals is None:
            return [(part, None) for part in parts]
        # A plane has no surface of triangles, and is what others stand on.
        return [*((one.shape, one.color) for one in self.visuals),
                *((part, None) for part in parts if isinstance(part, Plane))]

    def with_parts(self, parts: list[Shape]) -> 'Body':
        """Return the body with other solids in the places of those that `parts` gave."""
        if self.compound is not None:
            return self.model_copy(update={'compound': tuple(parts)})
        if isinstance(self.shape, Compound):
            shape = self.shape.model_copy(update={'compound': tuple(parts)})
            return self.model_copy(update={'shape': shape})
        return self.model_copy(update={'shape': parts[0]}) if parts else self


class Force(Spec):
    """A force between frames or on bodies; its parameters are those of its kind in the engine."""

    type: str


class BodyForce(Force):
    """A force on each of the chosen bodies, or on each pair of them."""

    # Names, or patterns such as 'link_*'; what nothing pushes is left out.
    bodies: Annotated[tuple[str, ...], ListOf(Text(), "names, as in ['crate', 'link_*']")] = ('*',)


class FrameForce(Force):
    """A force between frame a and a point of frame b."""

    a: Annotated[str, Text()]
    b: Annotated[str, Text()] = 'world'


def _force_class(name: str, kind: ForceKind) -> type[Force]:
    """Return the class of the mapping that describes a force of this kind."""
    fields: dict[str, Any] = {'type': (Literal[name], ...)}
    for parameter in kind.parameters:
        fields[parameter.name] = _field(parameter)
    base = FrameForce if kind.ends == 'ab' else BodyForce
    return create_model(name.title().replace('_', ''), __base__=base, **fields)


def _field(parameter: Parameter) -> tuple[Any, Any]:
    """Return the type and the default of a parameter of a force; ... when it must be given."""
    least = -math.inf if parameter.minimum is None else parameter.minimum
    number = Quantity(parameter.unit.removeprefix('1'), least=least)
    default: Any = parameter.default or ...
    if parameter.size == 1:
        return Annotated[float, number], default if default is ... else default[0]
    if parameter.size == 4:
        return Quaternion, default
    return Annotated[Vector, Numbers('x y z', number)], default


_FORCE_CLASSES = {name: _force_class(name, kind) for name, kind in FORCES.items()}

_ANY_FORCE: Any = Union[tuple(  # noqa: UP007, the members are known at run time only
    Annotated[cls, Tag(f'<{name}>')] for name, cls in _FORCE_CLASSES.items())]


class Scene(Spec):
    """A whole scene file."""

    format: Annotated[int, Format()] = 1
    world: World = World()
    materials: dict[Name, Material] = {}
    material_pairs: tuple[MaterialPair, ...] = ()
    collision: Collision = Collision()
    bodies: tuple[Body, ...] = ()
    forces: tuple[Annotated[_ANY_FORCE, Discriminator(_kind)], ...] = ()
    # URDF of models, by their names, for those who show them; the simulation does without.
    descriptions: dict[Name, Annotated[str, Text()]] | None = None
    # None, and not an empty list: a scene without joints has the text that it always had.
    joints: tuple[Joint, ...] | None = None
    # Of a scene in a file; in one that is read they have become bodies and joints.
    models: tuple[ModelFile, ...] | None = None

    @model_validator(mode='after')
    def _has_bodies(self) -> 'Scene':
        if not self.bodies and not self.models:
            raise refuse('is empty, must have at least one entry'
                         if 'bodies' in self.model_fields_set else
                         'is missing, must be given', 'bodies')
        return self

    def all_frames(self) -> dict[str, tuple[int, Pose]]:
        """Return bodies and named frames by their whole names: which body, and where on it."""
        frames = {body.name: (i, Pose()) for i, body in enumerate(self.bodies)}
        for i, body in enumerate(self.bodies):
            frames.update((name, (i, pose)) for name, pose in body.named_frames())
        return frames

    @property
    def all_materials(self) -> dict[str, Material]:
        """Return the materials by name, with the default one even where the file has none."""
        return {'default': Material(), **self.materials}
