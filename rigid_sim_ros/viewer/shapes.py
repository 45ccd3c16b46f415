# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the bodies of a scene are drawn with.

All spheres, boxes and cylinders of a scene are one unit sphere, box and cylinder, scaled: the
page draws those of one form in one go, however many they are. What is no scaled form, as a mesh,
is a form of its own, shared by the bodies that have the same one. What a body shows in the place
of its solids is one form with colours, in the axes of the body. Planes are not here: they are
drawn as grids.
"""
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
import trimesh

from rigid_sim_ros.engine.maths.rotation_in_python import add, multiply, rotate
from rigid_sim_ros.engine.model.kinds.drawing import Form, Surface
from rigid_sim_ros.engine.model.kinds.table import BY_TYPE, KINDS, UNIT_SURFACES
from rigid_sim_ros.kernels.arrays import Quaternion, Vector
from rigid_sim_ros.scene import Scene, schema
from rigid_sim_ros.scene.appearance import body_color

_PARTICLE_SHARE = 0.04      # diameter of a particle as a share of the extent of its body
_LEAST_PARTICLE = 1e-3      # m
# How round a ball is: its rings from pole to pole, and the sides of each ring. Scenes of many
# round bodies take the next coarser ones: without a graphics card a thousand triangles are a
# millisecond.
_ROUNDNESS = ((16, 24), (12, 18), (8, 12), (6, 10))
_TRIANGLES = 12_000
# [rad] Edges where faces meet at less than this are shaded round.
_ROUND = 0.6


class Solid(NamedTuple):
    """One form at a place of a body."""

    body: int
    form: str
    scale: Sequence[float]                                  # m, along the axes of the form
    position: Sequence[float] = (0.0, 0.0, 0.0)             # m, in the body frame
    orientation: Sequence[float] = (0.0, 0.0, 0.0, 1.0)     # form to body, x, y, z, w


class Plane(NamedTuple):
    """A plane of a fixed body."""

    body: int
    position: Sequence[float]       # m, in the body frame
    orientation: Sequence[float]    # turns z to the normal, x, y, z, w


class Shapes:
    """The solids of a scene, the surfaces that they refer to, and the colours of the bodies."""

    def __init__(self, scene: Scene) -> None:
        self.solids: list[Solid] = []
        self.planes: list[Plane] = []
        self.surfaces: dict[str, Surface] = {}
        # Of forms that have colours of their own, red, green and blue of each vertex, 0 to 255.
        self.vertex_colors: dict[str, np.ndarray] = {}
        self._meshes: dict[tuple[bytes, ...], str] = {}
        for index, body in enumerate(scene.spec.bodies):
            if body.visuals:
                self.solids.append(self._look(index, body, body_color(scene.spec, index)))
            for _, part in body.parts():
                if isinstance(part, schema.Plane):
                    self.planes.append(_plane(index, part))
                elif body.visuals is not None:
                    continue
                elif isinstance(part, schema.Points):
                    self.solids += _points(index, part)
                else:
                    self.solids += self._solids(index, part)
        rings, sides = _roundness(self.solids)
        for form in sorted({solid.form for solid in self.solids} - set(self.surfaces)):
            self.surfaces[form] = _shaded(UNIT_SURFACES[form](rings, sides))
        self.colors = [body_color(scene.spec, k) for k in range(len(scene.spec.bodies))]

    def _solids(self, index: int, part: schema.Shape) -> Iterable[Solid]:
        kind = KINDS[BY_TYPE[part.type]]
        forms = kind.forms(part)
        if not forms and kind.surface is not None:
            surface = kind.surface(part, _ROUNDNESS[0][1])
            form = self._form('mesh', surface.vertices, surface.faces)
            if form not in self.surfaces:
                self.surfaces[form] = _shaded(surface)
            forms = [Form(form, (1.0, 1.0, 1.0))]
        return [_placed(index, form, part) for form in forms]

    def _form(self, kind: str, *arrays: np.ndarray) -> str:
        """Return the name of the form that consists of some arrays."""
        key = (kind.encode(), *(array.tobytes() for array in arrays))
        return self._meshes.setdefault(key, f'{kind}_{len(self._meshes)}')

    def _look(self, index: int, body: schema.Body, own: Sequence[float]) -> Solid:
        """Return all that a body shows, as one form: it is sent once, and moved as one."""
        vertices, faces, colors, count = [], [], [], 0
        for visual in body.visuals or ():
            part = visual.shape
            draw = KINDS[BY_TYPE[part.type]].surface
            if draw is None:
                continue
            shaded = _shaded(draw(part, _ROUNDNESS[0][1]))
            turn = Rotation.from_quat(part.pose.orientation)
            vertices.append(turn.apply(shaded.vertices) + part.pose.position)
            faces.append(shaded.faces + count)
            count += len(shaded.vertices)
            rgb = np.round(255.0 * np.array((visual.color or own)[:3])).astype(np.uint8)
            colors.append(np.tile(rgb, (len(shaded.vertices), 1)))
        surface = Surface(np.concatenate(vertices), np.concatenate(faces))
        color = np.concatenate(colors)
        form = self._form('visual', surface.vertices, surface.faces, color)
        self.surfaces[form], self.vertex_colors[form] = surface, color
        return Solid(index, form, (1.0, 1.0, 1.0))


def _place(part: Any) -> tuple[Vector, Quaternion]:
    return part.pose.position, part.pose.orientation


def _placed(body: int, form: Form, part: Any) -> Solid:
    """Return a form of a part, which has a place of its own in the body."""
    p, q = _place(part)
    return Solid(body, form.name, form.scale, add(rotate(q, form.position), p),
                 multiply(q, form.orientation))


def _points(body: int, part: Any) -> Iterable[Solid]:
    extent = float(np.ptp(np.array(part.positions), axis=0).max())
    diameter = max(_PARTICLE_SHARE * extent, _LEAST_PARTICLE)
    p, q = _place(part)
    for point in part.positions:
        yield Solid(body, 'sphere', (diameter,) * 3, add(rotate(q, point), p))


def _plane(body: int, part: Any) -> Plane:
    normal = np.array(part.normal) / np.linalg.norm(part.normal)
    x, y, z = normal
    # The shortest turn from the z axis to the normal: axis z x n, half angle from 1 + cos. It is
    # not defined for n = -z, where half a turn about x does.
    turn = np.array([-y, x, 0.0, 1.0 + z]) if z > -1.0 + 1e-9 else np.array([1.0, 0.0, 0.0, 0.0])
    return Plane(body, part.offset * normal, turn / np.linalg.norm(turn))


def _shaded(surface: Surface) -> Surface:
    """Give the faces on both sides of a sharp edge vertices, and so normals, of their own."""
    mesh = trimesh.Trimesh(surface.vertices, surface.faces)
    smooth = trimesh.graph.smooth_shade(mesh, angle=_ROUND)
    return Surface(np.array(smooth.vertices), np.array(smooth.faces))


def _roundness(solids: Sequence[Solid]) -> tuple[int, int]:
    """Return rings and sides of a ball that such a number of round solids can afford."""
    share = {'sphere': 1.0, 'dome': 0.5}
    balls = sum(share.get(solid.form, 0.0) for solid in solids)
    for rings, sides in _ROUNDNESS:
        if 2 * rings * sides * balls <= _TRIANGLES:
            break
    return rings, sides
