# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The shapes of the bodies, for detection.

A body has any number of convex shapes; several make a compound. The frame S of a shape is fixed in
its body. What the kinds of shapes are, and where the origin of S is in them, stands in `kinds/`.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.rotation_in_python import add, multiply, rotate
from rigid_sim_ros.engine.model.hulls import (
    bare_hulls, count_pieces, HullTable, make_hulls, Polyhedron, Prisms)
from rigid_sim_ros.engine.model.kinds.table import HULL, KINDS
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

ALL_GROUPS = -1  # every bit of a mask


class Shape(NamedTuple):
    """How to make one shape, or all pieces of one; its pose is in the frame B of its body."""

    body: int
    kind: int  # its row in `KINDS`
    size: tuple[float, float, float]  # as in `Shapes`; a hull's is found from its vertices
    p_BS: Sequence[float] = (0.0, 0.0, 0.0)  # [m]
    q_BS: Sequence[float] = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w
    material: int = 0
    group: int = 1  # bits of the groups that the shape belongs to
    mask: int = ALL_GROUPS  # bits of the groups that it collides with; 0: none, the body opts out
    hull: Polyhedron | Prisms | None = None


class Shapes(NamedTuple):
    """The shapes of a world, s of them, a row each."""

    body: IntArray  # (s,) the body that carries the shape
    after: IntArray  # (s,) the next shape that another body carries, s where there is none
    kind: IntArray  # (s,) row in `KINDS`
    size: Array  # (s, 3) [m] see the file of the kind
    p_CS: Array  # (s, 3) [m] origin of S from C of its body, axes of C
    q_CS: Array  # (s, 4) axes of S to axes of C, x, y, z, w
    aligned: IntArray  # (s,) 1 where q_CS is no rotation, so that S has the axes of C
    ball: IntArray  # (s,) 1 for a sphere about C: nobody asks how it is turned
    turning: IntArray  # (n,) 0 for a body that carries nothing but such balls
    mobility: Array  # (n,) [1/kg] of points of a body by turning, a bound; see `_mobility`
    bound: Array  # (s,) [m] radius of a sphere around the origin of S that holds the shape
    half_width: Array  # (s,) [m] half of the least that the shape measures across; of a plane inf
    material: IntArray  # (s,) row of the `Materials`
    group: IntArray  # (s,) bits
    mask: IntArray  # (s,) bits; two shapes collide when each mask has a bit of the other's group
    still: IntArray  # (s,) 1 for a shape of a fixed body: two of those never make a pair
    ignored: IntArray  # sorted keys a * n + b, a < b, of bodies that never collide
    hulls: HullTable  # vertices and faces of the hulls
    hull: IntArray  # (s,) row of the hull table, -1 for the other kinds


class Material(NamedTuple):
    """How a surface behaves."""

    friction: float = 0.5  # Coulomb's coefficient
    restitution: float = 0.0  # Newton's: 0 stays, 1 bounces without loss
    rolling: float = 0.0  # [m] lever of the normal force against rolling
    spinning: float = 0.0  # [m] lever against turning about the normal
    stiffness: float = 1e5  # [N/m] of the penalty model, at each contact point
    damping: float = 0.5  # [s/m] of the penalty model: force k d (1 + damping d')


class Materials(NamedTuple):
    """
    What two materials give together: k x k symmetric tables.

    Friction is the geometric mean, restitution and the levers against rolling and spinning are the
    larger of the two. Two stiffnesses act as springs in series, and the damping is the one that
    such springs have together: each weighted with the other's stiffness, because the softer one
    moves more.
    """

    friction: Array
    restitution: Array
    rolling: Array  # [m]
    spinning: Array  # [m]
    stiffness: Array  # [N/m]
    damping: Array  # [s/m]


def build_materials(materials: Sequence[Material],
                    overrides: Iterable[tuple[int, int, Material]] = ()) -> Materials:
    """
    Return the tables of combined values; `overrides` gives pairs (i, j) values of their own.

    ValueError, with the value, for a restitution outside [0, 1] or a number below 0.
    """
    overrides = list(overrides)
    for material in [*materials, *(line[2] for line in overrides)]:
        _check_material(material)
    table = np.array([tuple(material) for material in materials]).T
    friction, restitution, rolling, spinning, stiffness, damping = table[:, :, None]
    series = stiffness * stiffness.T / (stiffness + stiffness.T)
    shared = (damping * stiffness.T + damping.T * stiffness) / (stiffness + stiffness.T)
    combined = Materials(np.sqrt(friction * friction.T), np.maximum(restitution, restitution.T),
                         np.maximum(rolling, rolling.T), np.maximum(spinning, spinning.T),
                         series, shared)
    for i, j, material in overrides:
        for field, value in zip(combined, material, strict=True):
            field[i, j] = field[j, i] = value
    return combined


def _check_material(material: Material) -> None:
    for name, value in material._asdict().items():
        if not (value >= 0.0 and np.isfinite(value)):
            raise ValueError(f'{name} {value!r}, must be a number >= 0')
    if material.restitution > 1.0:
        raise ValueError(f'restitution {material.restitution!r}, must be from 0 to 1')
    if material.stiffness == 0.0:
        raise ValueError('stiffness 0.0 N/m, must be > 0')


def build_shapes(model: Model, shapes: Sequence[Shape],
                 ignored: Iterable[tuple[int, int]] = ()) -> Shapes:
    """
    Return the table of all shapes, for bodies of `model`, with pairs of bodies to ignore.

    The shapes of a body stand side by side. ValueError, with the number, if they do not, for a
    size that is not > 0, a plane on a body that moves, and a hull without volume.
    """
    n = len(model.m)
    hulls, rows, centres, extents = make_hulls([shape.hull for shape in shapes])
    s = len(rows)
    size, half, p_CS, q_CS = (np.zeros((s, k)) for k in (3, 3, 3, 4))
    bound, half_width = np.zeros(s), np.zeros(s)
    end = 0
    for i, shape in enumerate(shapes):
        at, end = end, end + count_pieces(shape.hull)
        size[at:end] = shape.size if shape.hull is None else extents[at:end]
        _check_size(i, shape, size[at:end])
        if KINDS[shape.kind].is_unbounded and model.inv_m[shape.body] != 0.0:
            raise ValueError(f'{_named(i, shape)}: only a fixed body may carry a plane')
        p_CS[at:end], q_CS[at:end] = _pose_in_C(model, shape, centres[at:end])
        half[at:end] = _half_lengths(shape, size[at:end])
        bound[at:end], half_width[at:end] = _measures(shape, size[at], hulls, rows[at:end])
    q_CS /= np.linalg.norm(q_CS, axis=1)[:, None]
    keys = sorted({min(a, b) * n + max(a, b) for a, b in ignored})
    body, kind, material, group, mask = (
        _column(shapes, name) for name in ('body', 'kind', 'material', 'group', 'mask'))
    _check_order(body)
    still = (model.inv_m[body] == 0.0).astype(np.int64)
    is_ball = np.array([KINDS[k].is_ball for k in range(len(KINDS))])[kind]
    ball = (is_ball & (p_CS == 0.0).all(axis=1)).astype(np.int64)
    turning = np.zeros(n, dtype=np.int64)
    turning[body[ball == 0]] = 1
    return Shapes(body, next_of_another(body), kind, size, p_CS, q_CS,
                  (np.abs(q_CS[:, :3]).max(axis=1, initial=0.0) == 0.0).astype(np.int64), ball,
                  turning, _mobility(model, body, half, p_CS, q_CS), bound, half_width, material,
                  group, mask, still, np.array(keys, dtype=np.int64),
                  hulls if hulls.first.shape[0] else bare_hulls(), rows)


def _pose_in_C(model: Model, shape: Shape, centres: Array) -> tuple[Array, Any]:
    """
    Return where the pieces (t,) of a shape are: origins (t, 3) [m] in C, and one attitude.

    centres (t, 3) [m] are the origins of the pieces in the frame of the shape.
    """
    q_BS: Any = tuple(map(float, shape.q_BS))
    q_CB: Any = tuple(model.q_CB[shape.body].tolist())
    offset: Any = tuple(map(float, shape.p_BS))
    if shape.hull is not None:
        offset = add(offset, rotate(q_BS, tuple(centres.T)))
    p_CS = add(tuple(model.p_CB[shape.body].tolist()), rotate(q_CB, offset))
    return np.stack(np.broadcast_arrays(*p_CS), axis=-1), multiply(q_CB, q_BS)


def _measures(shape: Shape, size: Array, hulls: HullTable, rows: IntArray) -> tuple[Any, Any]:
    """Return the radius [m] of the ball about each piece of a shape, and its half width [m]."""
    extent = tuple(size.tolist())
    half_width: Any = (shape.hull.half_width if isinstance(shape.hull, Prisms)
                       else KINDS[shape.kind].half_width(extent))
    if shape.hull is None:
        return KINDS[shape.kind].bounding_radius(extent), half_width
    first, count = hulls.first[rows[0]], hulls.count[rows[0]]
    vertices = hulls.vertices[first:first + len(rows) * count].reshape(len(rows), count, 3)
    return np.linalg.norm(vertices, axis=2).max(axis=1), half_width


def next_of_another(body: IntArray) -> IntArray:
    """Return for each shape, whose bodies these are, the next one that another body carries."""
    ends = np.append(np.flatnonzero(body[1:] != body[:-1]) + 1, len(body))
    return ends[np.searchsorted(ends, np.arange(len(body)), side='right')].astype(np.int64)


def _half_lengths(shape: Shape, size: Array) -> Any:
    """Return half the lengths [m] of a box around each piece, 0 for what none is asked for."""
    kind = KINDS[shape.kind]
    if kind.is_ball or kind.is_unbounded:
        return 0.0
    return size if shape.hull is not None else kind.half_lengths(tuple(size[0].tolist()))


def _mobility(model: Model, body: IntArray, half: Array, p_CS: Array, q_CS: Array) -> Array:
    """
    Return sums over the principal axes of d^2 / I, (n,) [1/kg]: a bound for each body.

    I is the moment about an axis, d [m] how far from it the shapes of the body reach. Where
    turning moves a point by v = w x r, v <= sum |w_k| d_k, so by the inequality of Cauchy-Schwarz
    v^2 <= (sum I_k w_k^2) (sum d_k^2 / I_k): twice the energy of rotation times this. Spheres look
    alike however they turn, so what counts is where their middle is: of these half (s, 3) [m], of
    a box around each of the shapes of `body` (s,), is 0.
    """
    q: Any = tuple(q_CS.T)
    axes = np.array([np.broadcast_arrays(*rotate(q, unit)) for unit in
                     ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))])
    # Of the box around the shape along the axes of C.
    reach = np.abs(p_CS.T) + np.einsum('kjs,sk->js', np.abs(axes), half)
    square = np.zeros((3, len(model.m)))
    for k in range(3):
        far = reach[k - 1] ** 2 + reach[k - 2] ** 2
        np.maximum.at(square[k], body, far)
    return np.asarray((model.inv_I_C * square).sum(axis=0))


def _column(shapes: Sequence[Shape], name: str) -> IntArray:
    """Return a number of each piece."""
    values = np.array([getattr(shape, name) for shape in shapes], dtype=np.int64)
    return np.repeat(values, [count_pieces(shape.hull) for shape in shapes])


def _check_order(body: IntArray) -> None:
    firsts = body[np.flatnonzero(np.diff(body, prepend=-1))]
    if len(firsts) > len(np.unique(firsts)):
        apart = firsts[np.flatnonzero(np.bincount(firsts)[firsts] > 1)[0]]
        raise ValueError(f'the shapes of body {apart} are apart, must be side by side')


def _named(i: int, shape: Shape) -> str:
    return f'shape {i} ({KINDS[shape.kind].name}) of body {shape.body}'


def _check_size(i: int, shape: Shape, size: Array) -> None:
    if shape.kind == HULL and shape.hull is None:
        raise ValueError(f'{_named(i, shape)}: no vertices')
    sizes = size[:, :KINDS[shape.kind].sizes].ravel()
    if (wrong := np.flatnonzero(~((sizes > 0.0) & np.isfinite(sizes)))).size:
        raise ValueError(f'{_named(i, shape)}: size {float(sizes[wrong[0]])!r} m, must be > 0')


@kernel
def smaller(shapes: Shapes, a: int, b: int) -> float:
    """Return the size [m] of the smaller of two shapes: the radius about its middle."""
    return min(shapes.bound[a], shapes.bound[b])


@kernel
def least_lever(shapes: Shapes, a: int, b: int) -> float:
    """
    Return the half width [m] of the thinner of two shapes of which one moves, of those that move.

    As short may the levers be with which forces between them turn a body.
    """
    least = np.inf
    for s in (a, b):
        if shapes.still[s] == 0:
            least = min(least, shapes.half_width[s])
    return least


def can_meet(shapes: Shapes) -> bool:
    """Return whether there are two shapes of which one moves."""
    return len(shapes.body) > 1 and bool((shapes.still == 0).any())
