# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bodies of a scene as triangles that move."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyvista
from scipy.spatial.transform import Rotation

from rigid_sim_ros.bag.motion import Array
from rigid_sim_ros.engine.model.kinds.table import BY_TYPE, KINDS
from rigid_sim_ros.scene import Scene, schema
from rigid_sim_ros.scene.appearance import body_color, with_alpha

# Corners around a ball or a cylinder; fewer where there are hundreds of them.
_FINE, _COARSE = 40, 20
_MANY = 150
# [deg] Faces that meet at a larger angle keep their edge; the others look round.
_CREASE = 30.0
_SHADE = 0.72               # of every other octant of a ball: one sees it roll
_PARTICLE_SHARE = 0.05      # diameter of a particle as a share of the extent of its body
_LEAST_PARTICLE = 1e-3      # m


class Plane(NamedTuple):
    """The half space below normal . r = offset in the frame of its body."""

    body: int
    position: Array         # of the body [m]
    orientation: Array      # of the body, x, y, z, w
    normal: Array           # of unit length
    offset: float           # [m]
    color: tuple[float, float, float]


class Bodies:
    """All solids but planes as one mesh, whose corners are where the bodies are."""

    def __init__(self, scene: Scene) -> None:
        bodies = scene.spec.bodies
        corners = _COARSE if len(bodies) > _MANY else _FINE
        pieces = [(index, _colored(piece, part, color or body_color(scene.spec, index)))
                  for index, body in enumerate(bodies) for part, color in body.drawn()
                  if (piece := _solid(part, corners)) is not None]
        self.mesh = pyvista.PolyData()
        self._owner = np.repeat([index for index, _ in pieces],
                                [piece.n_points for _, piece in pieces]).astype(int)
        if not pieces:
            return
        self._p_B, self._n_B = (
            np.concatenate([piece.point_data[name] for _, piece in pieces]).astype(np.float64)
            for name in ('place', 'Normals'))
        # Not pyvista.merge: the order of what it merges differs between its versions.
        first = np.cumsum([0, *(piece.n_points for _, piece in pieces)])
        triangles = np.concatenate([
            piece.faces.reshape(-1, 4)[:, 1:] + start
            for (_, piece), start in zip(pieces, first[:-1], strict=True)])
        self.mesh = pyvista.PolyData(
            self._p_B.astype('f4'), np.insert(triangles, 0, 3, axis=1).ravel())
        self.mesh.cell_data['color'] = np.concatenate(
            [piece.cell_data['color'] for _, piece in pieces])
        self.mesh.point_data['Normals'] = self._n_B.astype('f4')
        self.mesh.point_data.active_normals_name = 'Normals'

    def move(self, p_WB: Array, q_WB: Array) -> None:
        """
        Put every body at its pose: (n, 3) in m and (n, 4) as x, y, z, w.

        One whose pose is not a number is not there: its triangles shrink to a point among others.
        """
        if not len(self._owner):
            return
        is_there = np.isfinite(q_WB[:, :1])
        R = Rotation.from_quat(np.where(is_there, q_WB, (0.0, 0.0, 0.0, 1.0))).as_matrix()
        R *= is_there[:, :, None]
        p_WB = np.where(is_there, p_WB, p_WB[is_there[:, 0]][:1] if is_there.any() else 0.0)
        R = R[self._owner]
        self.mesh.points = (np.einsum('pij,pj->pi', R, self._p_B) + p_WB[self._owner]).astype('f4')
        self.mesh.point_data['Normals'] = np.einsum('pij,pj->pi', R, self._n_B).astype('f4')


def extents(scene: Scene) -> Array:
    """Return how far each body reaches from the origin of its frame, (n,) [m]; planes are 0."""
    found = np.zeros(len(scene.spec.bodies))
    for index, body in enumerate(scene.spec.bodies):
        for part, _ in body.drawn():
            piece = _solid(part, _COARSE)
            if piece is not None:
                _place(piece, part.pose)
                found[index] = max(found[index], np.linalg.norm(piece.points, axis=1).max())
    return found


def _colored(piece: Any, part: schema.Shape, rgba: Sequence[float]) -> Any:
    """Return a solid at its place in the body and in the colour of that."""
    _place(piece, part.pose)
    red, green, blue, alpha = with_alpha(rgba)
    tint = np.asarray(piece.cell_data['shade'])[:, None]
    color = np.hstack([tint * (red, green, blue), np.full_like(tint, alpha)])
    piece.cell_data['color'] = np.rint(255 * color).astype(np.uint8)
    piece.point_data['place'] = piece.points
    return piece


def _place(piece: Any, pose: Any) -> None:
    turn = Rotation.from_quat(pose.orientation)
    piece.points = (turn.apply(piece.points) + pose.position).astype('f4')
    piece.point_data['Normals'] = turn.apply(piece.point_data['Normals']).astype('f4')


def _finished(surface: Any, crease: float = _CREASE) -> Any:
    """Return triangles with normals, and full colour everywhere."""
    surface = surface.triangulate()
    surface.clear_data()
    surface = surface.compute_normals(
        cell_normals=False, split_vertices=True, feature_angle=crease, consistent_normals=False)
    surface.cell_data['shade'] = np.ones(surface.n_cells)
    return surface


def _solid(part: Any, corners: int) -> Any:
    """Return a part as triangles in its own frame; None for one without an end."""
    if isinstance(part, schema.Points):
        return _points(part)
    kind = KINDS[BY_TYPE[part.type]]
    if kind.surface is None:
        return None
    surface = kind.surface(part, corners)
    table = np.insert(surface.faces, 0, 3, axis=1)
    piece = _finished(pyvista.PolyData(surface.vertices.astype('f4'), table.ravel()),
                      180.0 if kind.has_octants else _CREASE)
    if kind.has_octants:
        x, y, z = piece.cell_centers().points.T
        piece.cell_data['shade'] = np.where((x > 0) ^ (y > 0) ^ (z > 0), 1.0, _SHADE)
    return piece


def _points(shape: schema.Points) -> Any:
    positions = np.array(shape.positions)
    diameter = max(_PARTICLE_SHARE * float(np.ptp(positions, axis=0).max()), _LEAST_PARTICLE)
    balls = [pyvista.Sphere(radius=diameter / 2, center=p, theta_resolution=16, phi_resolution=9)
             for p in positions]
    return _finished(pyvista.merge(balls, merge_points=False), 180.0)


def planes(scene: Scene) -> Iterable[Plane]:
    """Give the planes of a scene; only fixed bodies have such."""
    for index, body in enumerate(scene.spec.bodies):
        for _, part in body.parts():
            if isinstance(part, schema.Plane):
                turn = Rotation.from_quat(part.pose.orientation)
                n_B = turn.apply(np.array(part.normal) / np.linalg.norm(part.normal))
                yield Plane(
                    index, np.array(body.pose.position), np.array(body.pose.orientation), n_B,
                    float(part.offset + n_B @ np.array(part.pose.position)),
                    body_color(scene.spec, index)[:3])
