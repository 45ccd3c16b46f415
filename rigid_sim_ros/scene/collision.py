# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What of a scene can touch: its solids as shapes of the engine, its materials, its filters."""

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from rigid_sim_ros.engine.maths.rotation_in_python import multiply, rotate
from rigid_sim_ros.engine.model.hulls import Polyhedron
from rigid_sim_ros.engine.model.kinds.table import BY_TYPE, KINDS
from rigid_sim_ros.engine.model.shapes import ALL_GROUPS, Material, Shape
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.errors import Path, Report, shown
from rigid_sim_ros.scene.terrain import columns, sheets
from rigid_sim_ros.words import nearest

# Groups are bits of a 64-bit number whose sign stays free.
MAX_GROUPS = 62


def shapes(scene: schema.Scene, report: Report) -> tuple[list[Shape], list[Path]]:
    """
    Return the solids of all bodies, and where each is written; report what cannot collide.

    Those of bodies that collide with nothing are left out.
    """
    bits = _group_bits(scene)
    materials = list(scene.all_materials)
    found: list[Shape] = []
    places: list[Path] = []
    for i, body in enumerate(scene.bodies):
        mask = ALL_GROUPS
        if body.collides_with is not None:
            mask = sum(bits[name] for name in dict.fromkeys(body.collides_with))
        group = sum(bits[name] for name in dict.fromkeys(body.groups))
        for path, part in body.parts():
            if body.collides and part.type in BY_TYPE:
                material = materials.index(part.material or body.material)
                try:
                    shape = _shape(part)
                except ValueError as error:
                    report(('bodies', i, *path), str(error))
                    continue
                found.append(shape._replace(body=i, material=material, group=group, mask=mask))
                places.append(('bodies', i, *path))
    return found, places


def materials(scene: schema.Scene) -> list[Material]:
    """Return the materials in the order in which `shapes` numbers them."""
    return [_material(material) for material in scene.all_materials.values()]


def overrides(scene: schema.Scene) -> Iterator[tuple[int, int, Material]]:
    """Yield the pairs of materials that behave together in a way of their own."""
    names = list(scene.all_materials)
    for pair in scene.material_pairs:
        if pair.a in names and pair.b in names:
            yield names.index(pair.a), names.index(pair.b), _material(pair)


def ignored(scene: schema.Scene) -> Iterator[tuple[int, int]]:
    """Yield the pairs of bodies that never touch."""
    names = {body.name: i for i, body in enumerate(scene.bodies)}
    for a, b in (*scene.collision.ignore, *_jointed(scene)):
        if a in names and b in names:
            yield names[a], names[b]


def _jointed(scene: schema.Scene) -> Iterator[tuple[str, str]]:
    """
    Yield the pairs of bodies that joints join.

    Bodies that fixed joints hold together are one for this: a link and what is welded to its
    parent are as near each other as the link and its parent.
    """
    joints = [joint for joint in scene.joints or () if not joint.collides]
    whole: dict[str, list[str]] = {}    # the bodies that are one with each
    for joint in joints:
        for name in (joint.parent, joint.child):
            whole.setdefault(name, [name])
        if joint.type == 'fixed' and 'world' not in (joint.parent, joint.child):
            one = whole[joint.parent] + [name for name in whole[joint.child]
                                         if name not in whole[joint.parent]]
            for name in one:
                whole[name] = one
    for one in {id(one): one for one in whole.values()}.values():
        yield from combinations(one, 2)
    for joint in joints:
        if joint.type != 'fixed' and 'world' not in (joint.parent, joint.child):
            yield from product(whole[joint.parent], whole[joint.child])


def check(scene: schema.Scene, report: Report) -> None:
    """Report names of bodies, materials and groups that do not exist."""
    names = [body.name for body in scene.bodies]
    for i, pair in enumerate(scene.collision.ignore):
        for k, name in enumerate(pair):
            if name not in names:
                report(('collision', 'ignore', i, k),
                       f'{shown(name)} is no body, {nearest(name, names)}')
    for i, line in enumerate(scene.material_pairs):
        for key, name in (('a', line.a), ('b', line.b)):
            if name not in scene.all_materials:
                report(('material_pairs', i, key),
                       f'{shown(name)} is no material, {nearest(name, scene.all_materials)}')
    world = scene.world
    if scene.collision.sleep_after > 0.0 and (world.contact, world.solver) != ('timestep',
                                                                               'sequential'):
        report(('collision', 'sleep_after'),
               f'{scene.collision.sleep_after:g} s, must be 0: only the contact model timestep '
               'with the solver sequential lets bodies sleep')
    groups = _group_bits(scene)
    for i, body in enumerate(scene.bodies):
        for k, name in enumerate(body.collides_with or ()):
            if name not in groups:
                report(('bodies', i, 'collides_with', k),
                       f'{shown(name)} is no group of any body, {nearest(name, groups)}')
    if len(groups) > MAX_GROUPS:
        report(('bodies',), f'{len(groups)} groups, must be {MAX_GROUPS} or fewer')


def _group_bits(scene: schema.Scene) -> dict[str, int]:
    """Return the bit of each group, in the order in which the bodies name them."""
    names = dict.fromkeys(['default', *(name for body in scene.bodies for name in body.groups)])
    return {name: 1 << k for k, name in enumerate(names)}


def _material(line: schema.Surface) -> Material:
    return Material(line.friction, line.restitution, line.rolling, line.spinning, line.stiffness,
                    line.damping)


def _shape(part: schema.Shape) -> Shape:
    """Return what a part collides as: one convex shape, or the many pieces of a surface."""
    kind = BY_TYPE[part.type]
    shape = Shape(0, kind, KINDS[kind].size(part), part.pose.position, part.pose.orientation)
    if isinstance(part, schema.Plane):
        return _placed(shape, part)
    if isinstance(part, schema.Heightfield):
        return shape._replace(hull=columns(np.array(part.heights), (part.size[0], part.size[1])))
    if isinstance(part, schema.Mesh):
        vertices = np.array(part.vertices)
        if part.convex:
            return shape._replace(hull=Polyhedron(*convex_hull(vertices)))
        return shape._replace(hull=sheets(vertices, np.array(part.faces)))
    return shape


def _placed(shape: Shape, part: schema.Plane) -> Shape:
    """Return the plane normal . r = offset, whose shape frame has z along the normal."""
    n = np.array(part.normal) / np.linalg.norm(part.normal)
    # Half way between z and n lies the axis of a half turn from one to the other; beside -z, any.
    axis = n + np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(axis) < 1e-9:
        axis = np.array([1.0, 0.0, 0.0])
    x, y, z = (axis / np.linalg.norm(axis)).tolist()
    q = (0.0, 0.0, 0.0, 1.0) if n[2] == 1.0 else (x, y, z, 0.0)
    x, y, z = (n * part.offset).tolist()
    origin = rotate(part.pose.orientation, (x, y, z))
    position = tuple(np.add(part.pose.position, origin).tolist())
    return shape._replace(p_BS=position, q_BS=multiply(part.pose.orientation, q))


def convex_hull(points: Array, tolerance: float = 0.0) -> tuple[Array, IntArray]:
    """
    Return vertices (v, 3) and triangles (t, 3), anticlockwise from outside, of a convex hull.

    No point (n, 3) lies farther outside than the tolerance [m]: with one above 0 many points are
    left out. Raises ValueError for points in a plane.
    """
    # SciPy: 0.6 s that a scene without a mesh does not wait for.
    from scipy.spatial import ConvexHull, QhullError

    try:
        # Qhull's option W: it adds no point that is nearer to the hull so far.
        hull = ConvexHull(points, qhull_options=f'W{tolerance!r}' if tolerance else None)
    except (QhullError, ValueError):
        raise ValueError(f'the mesh of {len(points)} vertices is too flat for a convex hull, '
                         'must have a volume, or collides: false') from None
    corners, triangles = np.unique(hull.simplices, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    vertices = points[corners]
    # The hull's equations give the outside; its triangles run either way round.
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    inward = np.einsum('ti,ti->t', np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return vertices, triangles.astype(np.int64)
