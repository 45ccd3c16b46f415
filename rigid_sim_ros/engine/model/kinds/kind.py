# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What there is to know of a kind of shape: a record of numbers and functions.

The frame S of a shape has its origin where the file of the kind says. `size` is a row of
`Shapes.size`, three numbers [m] whose meaning the file of the kind gives too. A solid of a scene
file (`schema.Sphere` and its like) is called a part here; its attributes are the keys of the file.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
import math
from typing import Any, TypeAlias

from rigid_sim_ros.engine.model.hulls import HullTable
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.kinds.drawing import Form, Surface
from rigid_sim_ros.kernels.arrays import Array, Vector
from rigid_sim_ros.kernels.kernel import kernel

Size: TypeAlias = tuple[float, float, float]


@kernel
def no_faces(hulls: HullTable, hull: int) -> int:
    """Return how many flat faces a round shape has: none."""
    return 0


@kernel
def no_face(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
            f: int) -> tuple[Vector, float]:
    """Stand in the place of `Kind.face` for a shape without a flat face; it is never called."""
    return (0.0, 0.0, 0.0), math.inf


@kernel
def same_normal(pose: Array, size: Array, hulls: HullTable, hull: int, s: int,
                n_W: Vector) -> Vector:
    """Return n: a shape without a flat face has none that looks along it."""
    return n_W


@kernel
def no_outline(pose: Array, size: Array, s: int, hulls: HullTable, hull: int, n_W: Vector,
               corners: Array) -> tuple[int, int]:
    """Return that there is no face and no line to clip: the nearest point alone will do."""
    return 0, 0


@dataclass(frozen=True, kw_only=True)
class Kind:
    """
    A kind of shape.

    The kernels get `size` (s, 3), the row s of their shape, the hull table and the row `hull` of
    it, and pose (s, 12) where they work in world axes. p, d and n are a point, a direction and a
    unit vector in the frame S, or in world axes with _W.
    """

    name: str
    type: str  # as a scene file calls it

    # Of a part: its row of `size`; its volume [m^3] and its mass properties at a mass [kg] in S,
    # None where it has no end; its dimensions in a few words.
    size: Callable[[Any], Size]
    volume: Callable[[Any], float] | None = None
    mass_properties: Callable[[float, Any], MassProperties] | None = None
    summary: Callable[[Any], str] = lambda part: ''

    # Of a row of `size` [m]: the radius of a sphere around the origin of S that holds the shape
    # (that of a hull follows from its vertices), and half of the least that it measures across.
    bounding_radius: Callable[[Size], float]
    half_width: Callable[[Size], float]
    # Of the same: half the lengths of a box around the origin of S that holds the shape.
    half_lengths: Callable[[Size], Size] = lambda size: size
    sizes: int  # how many entries of `size` must be above 0

    is_ball: bool = False  # a sphere: its bounding box is a cube, and turning changes nothing
    is_rounded: bool = False  # `extreme` is of a core, around which `size[0]` [m] lies
    is_unbounded: bool = False  # a half space: only a body that nothing pushes may carry it
    is_flat: bool = False  # all of its surface is flat: points of contact stay where they are
    is_faceted: bool = False  # it has flat faces with edges around them
    is_curved: bool = False  # the surface around `extreme` is curved: a search ends near it only
    is_smooth: bool = False  # that surface is curved in all directions, without an edge
    has_disc: bool = False  # a flat face is a disc of the radius `size[0]`
    most_points: int = 4  # of a manifold with a plane

    # Of a part: the forms that it is drawn with, none for what is drawn with its own surface; and
    # that surface, with so many sides around, None for what has no end. `units` are the forms that
    # this kind brings along: their surfaces, with so many rings from pole to pole and sides.
    forms: Callable[[Any], Sequence[Form]] = lambda part: ()
    surface: Callable[[Any, int], Surface] | None = None
    units: Mapping[str, Callable[[int, int], Surface]] = field(default_factory=dict)
    has_octants: bool = False  # every other octant is darker in films: one sees it roll

    # (size, s, x, y, z): how far [m] it reaches from the origin of S against, and along, an axis
    # of the world, which has the components x, y, z in S.
    reach_along: Any
    # (size, first, count, vertices, hull, s, d): the point [m] of the core farthest along d; the
    # fields of the hull table one by one, for a search asks often.
    extreme: Any = None
    # (size, s, p): signed distance [m] of p, outward normal, nearest point of the surface. None:
    # there is no formula, and with a sphere it is searched as with any other shape.
    from_point: Any = None
    # (size, hulls, hull, s, p): how far p is outside [m], below 0 inside; see surface.py.
    height: Any
    # (size, hulls, hull, s, p, d): how far [m] p has to go along d to leave the shape.
    way_out: Any
    # (hulls, hull): how many flat faces it has.
    face_count: Any = no_faces
    # (pose, size, hulls, hull, s, f): normal of face f in world axes, and max n . x [m] on it,
    # from the origin of S.
    face: Any = no_face
    # (pose, size, hulls, hull, s, n_W): the normal of the flat face that looks along n; else n.
    face_along: Any = same_normal
    # (pose, size, s, hulls, hull, n_W, corners): writes the corners, world axes, of the face or
    # the line that meets another shape along n; returns how many, and the name of the face.
    outline: Any = no_outline
    # (pose, size, s, hulls, hull, n, p, margin, points, ids): writes the points that are nearer
    # than the margin [m] to the plane through p with the normal n, world axes; their number.
    on_plane: Any = None
