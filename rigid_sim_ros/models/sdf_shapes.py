# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solids of an SDF link."""

from collections.abc import Callable

from rigid_sim_ros.models.description import MeshFile, Shape
from rigid_sim_ros.models.files import Folders
from rigid_sim_ros.models.findings import Findings
from rigid_sim_ros.models.poses import combined, IDENTITY, Pose
from rigid_sim_ros.models.values import check_children, number, several
from rigid_sim_ros.models.xml_tree import Element
from rigid_sim_ros.words import nearest


def read_shape(element: Element, pose: Pose, folders: Folders,
               findings: Findings) -> Shape | None:
    """
    Return the solid of a <collision> or a <visual>, None where there is none.

    What is wrong with a visual is no error: it has no effect on the motion.
    """
    is_physics = element.tag == 'collision'
    own = findings if is_physics else Findings()
    check_children(element, ('pose', 'geometry', 'material', 'surface'), (), findings,
                   is_physics=False)
    if is_physics and element.find('surface') is not None:
        findings.ignore(element, '<surface>', 'materials are those of the scene')
    geometry = element.find('geometry')
    solids = [] if geometry is None else geometry.children
    shape = None
    if len(solids) != 1:
        own.error(element, f'has {len(solids)} solids in its <geometry>, must have one')
    elif solids[0].tag in _SOLIDS:
        shape = _SOLIDS[solids[0].tag](solids[0], pose, folders, own)
    elif solids[0].tag != 'empty':
        own.error(solids[0], f'is not known here, {nearest(solids[0].tag, _SOLIDS)}')
    if not is_physics and own.errors:
        findings.ignore(element, '<visual>', 'its shape is not known or not found')
        return None
    return shape if shape is None else shape._replace(color=_color(element))


def _length(solid: Element, tag: str, findings: Findings) -> float:
    child = solid.find(tag)
    if child is None:
        findings.error(solid, f'has no <{tag}>, must have one')
        return 1.0
    return number(child.text.strip(), child, tag, findings, 1.0, above=0.0)


def _three(solid: Element, tag: str, findings: Findings, *, above: float = 0.0,
           default: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> list[float]:
    child = solid.find(tag)
    if child is None:
        return list(default)
    return list(several(child.text, 3, child, tag, findings, default, above=above))


def _box(solid: Element, pose: Pose, folders: Folders, findings: Findings) -> Shape:
    return Shape('box', {'size': _three(solid, 'size', findings)}, pose, solid)


def _sphere(solid: Element, pose: Pose, folders: Folders, findings: Findings) -> Shape:
    return Shape('sphere', {'radius': _length(solid, 'radius', findings)}, pose, solid)


def _round(solid: Element, pose: Pose, folders: Folders, findings: Findings) -> Shape:
    return Shape(solid.tag, {'radius': _length(solid, 'radius', findings),
                             'length': _length(solid, 'length', findings)}, pose, solid)


def _ellipsoid(solid: Element, pose: Pose, folders: Folders, findings: Findings) -> Shape:
    return Shape('ellipsoid', {'radii': _three(solid, 'radii', findings)}, pose, solid)


def _plane(solid: Element, pose: Pose, folders: Folders, findings: Findings) -> Shape:
    normal = _three(solid, 'normal', findings, above=float('-inf'), default=(0.0, 0.0, 1.0))
    if not any(normal):
        findings.error(solid, "normal '0 0 0' has no direction, must have one")
        normal = [0.0, 0.0, 1.0]
    return Shape('plane', {'normal': normal}, pose, solid)


def _mesh(solid: Element, pose: Pose, folders: Folders, findings: Findings) -> Shape | None:
    uri = solid.find('uri')
    check_children(solid, ('uri', 'scale'), ('convex_decomposition',), findings, is_physics=True)
    x, y, z = _three(solid, 'scale', findings, above=float('-inf'))
    if not x * y * z:
        findings.error(solid, 'scale has a 0, must have none')
    path = folders.find('' if uri is None else uri.text.strip(), solid, findings)
    return None if path is None else Shape('mesh', {}, pose, solid, MeshFile(path, (x, y, z)))


def _heightmap(solid: Element, pose: Pose, folders: Folders, findings: Findings) -> Shape | None:
    uri = solid.find('uri')
    check_children(solid, ('uri', 'size', 'pos'),
                   ('texture', 'blend', 'use_terrain_paging', 'sampling'), findings,
                   is_physics=True)
    x, y, z = _three(solid, 'size', findings)
    origin = _three(solid, 'pos', findings, above=float('-inf'), default=(0.0, 0.0, 0.0))
    path = folders.find('' if uri is None else uri.text.strip(), solid, findings)
    there = combined(pose, Pose((origin[0], origin[1], origin[2]), IDENTITY.orientation))
    return None if path is None else Shape(
        'heightfield', {}, there, solid, MeshFile(path, (x, y, z)))


_SOLIDS: dict[str, Callable[[Element, Pose, Folders, Findings], Shape | None]] = {
    'box': _box, 'sphere': _sphere, 'cylinder': _round, 'capsule': _round, 'cone': _round,
    'ellipsoid': _ellipsoid, 'plane': _plane, 'mesh': _mesh, 'heightmap': _heightmap}


def _color(element: Element) -> tuple[float, ...] | None:
    """Return red, green, blue and alpha of a material, None without one."""
    material = element.find('material')
    diffuse = None if material is None else material.find('diffuse')
    if diffuse is None:
        return None
    words = diffuse.text.split()
    color = several(' '.join([*words, '1'][:4]), 4, diffuse, 'diffuse', Findings(),
                    (-1.0, 0.0, 0.0, 0.0))
    return color if all(0.0 <= value <= 1.0 for value in color) else None
