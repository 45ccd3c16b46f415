# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bodies of one scene in the page."""
from collections.abc import Sequence
import math
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
import trimesh
import viser

from rigid_sim_ros.engine.model.kinds.drawing import Surface
from rigid_sim_ros.scene import Scene
from rigid_sim_ros.viewer.motion import Array, Motion
from rigid_sim_ros.viewer.picking import first_hit, is_near, line_of_sight
from rigid_sim_ros.viewer.server import PageServer
from rigid_sim_ros.viewer.shapes import Plane, Shapes, Solid

_SHADOW = 0.35      # how dark shadows are on the ground
_LENGTHLESS = 1.0   # m: the size of a scene of planes alone
_FEW = 8            # bodies of which each must be in the first picture
_SHARE = 0.8        # of many, which must
_AWAY = 1.6         # reaches of what is seen, in each of the directions below


class Batch:
    """All solids of one form: drawn in one go, and moved with two arrays."""

    def __init__(
        self, scene: viser.SceneApi, name: str, surface: Surface, solids: Sequence[Solid],
        colors: Array, opacity: float | None, own: np.ndarray | None = None,
    ) -> None:
        """Put the solids into the page; `own` are colours of the vertices (v, 3), 0 to 255."""
        self.bodies = np.array([solid.body for solid in solids], dtype=np.intp)
        self._p_BS = np.array([solid.position for solid in solids])
        self._q_BS = Rotation.from_quat([solid.orientation for solid in solids])
        self._shown: tuple[Array, Array] | None = None
        self._triangles = surface.vertices[surface.faces]
        self._radius = float(np.linalg.norm(surface.vertices, axis=1).max())
        self._scales = np.array([solid.scale for solid in solids], dtype=float)
        count = len(solids)
        poses = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.zeros((count, 3))
        self.handle: Any    # viser has two classes with the same attributes
        if own is not None:
            self.handle = scene.add_batched_meshes_trimesh(
                name, _painted(surface, own), *poses, batched_scales=self._scales, lod='off')
        else:
            self.handle = scene.add_batched_meshes_simple(
                name, surface.vertices, surface.faces, *poses, batched_scales=self._scales,
                batched_colors=np.round(255 * colors).astype(np.uint8), opacity=opacity,
                lod='off')

    def move(self, motion: Motion, rotation: Rotation) -> None:
        """Put the solids where their bodies are."""
        turn = rotation[self.bodies]
        p = motion.position[self.bodies] + turn.apply(self._p_BS)
        q = (turn * self._q_BS).as_quat()[:, [3, 0, 1, 2]]
        if self._shown is not None and np.array_equal(p, self._shown[0]) and np.array_equal(
                q, self._shown[1]):
            return
        self._shown = p, q
        self.handle.batched_positions = p.astype(np.float32)
        self.handle.batched_wxyzs = q.astype(np.float32)

    def meet(self, origin: Array, direction: Array) -> tuple[float, int]:
        """
        Return how far away a half-line first meets a solid, and its body.

        The distance is in lengths of `direction`; inf and -1 if it meets none.
        """
        shown = self._shown
        if shown is None:
            return float('inf'), -1
        p, q = shown
        back = Rotation.from_quat(q[:, [1, 2, 3, 0]]).inv()
        # In the unit form's own axes; a length along the line stays the same multiple of its
        # direction, whatever the scale.
        starts = back.apply(origin - p) / self._scales
        ways = back.apply(direction) / self._scales
        found = [(first_hit(starts[k], ways[k], self._triangles), int(self.bodies[k]))
                 for k in np.flatnonzero(is_near(starts, ways, self._radius))]
        return min(found, default=(float('inf'), -1))


class Stage:
    """Shapes, planes and the ground of a scene."""

    def __init__(self, server: PageServer, scene: Scene) -> None:
        self.scene = scene
        self.moving = np.flatnonzero(scene.model.inv_m > 0.0)
        self._server = server
        shapes = Shapes(scene)
        self.colors = np.array([color[:3] for color in shapes.colors])
        self.extents = _extents(scene, shapes)
        self.batches: list[Batch] = []
        self._add_batches(shapes)
        self.size = self._median_size()
        self._planes = [(plane, self._grid(f'/planes/{k}'))
                        for k, plane in enumerate(shapes.planes)]
        self.ground = self._grid('/ground')
        self.show_ground(True)
        self._aim(scene)
        server.hover.name_at = self.name_at

    def move(self, motion: Motion) -> None:
        """Put every body where it is."""
        rotation = motion.rotation
        for batch in self.batches:
            batch.move(motion, rotation)
        for plane, grid in self._planes:
            _place(grid, plane, motion, rotation)

    def body_at(self, origin: Array, direction: Array) -> int | None:
        """Return the body that a half-line from (3,) towards (3,) meets first, planes aside."""
        distance, body = min((batch.meet(origin, direction) for batch in self.batches),
                             default=(float('inf'), -1))
        return body if distance < float('inf') else None

    def name_at(self, page: int, x: float, y: float) -> str:
        """
        Return the name of the body that a page shows at a point, '' where there is none.

        x and y go from 0 to 1, from the left and from the top.
        """
        client = self._server.get_clients().get(page)
        body = self.body_at(*line_of_sight(client.camera, x, y)) if client is not None else None
        return '' if body is None else self.scene.names[body]

    def is_moving(self, batch: Batch) -> bool:
        """Return whether the bodies of a batch move."""
        return bool(self.scene.model.inv_m[batch.bodies[0]] > 0.0)

    def show_ground(self, wanted: bool) -> None:
        """Show the planes, or where there are none a grid in their place."""
        for _, grid in self._planes:
            grid.visible = wanted
        self.ground.visible = wanted and not self._planes

    def show_shadows(self, wanted: bool) -> None:
        """Let bodies cast shadows on each other and the ground."""
        self._server.scene.configure_default_lights(cast_shadow=wanted)
        for grid in (self.ground, *(grid for _, grid in self._planes)):
            grid.shadow_opacity = _SHADOW if wanted else 0.0

    def remove(self) -> None:
        """Take everything out of the page."""
        for batch in self.batches:
            batch.handle.remove()
        for _, grid in self._planes:
            grid.remove()
        self.ground.remove()

    def _add_batches(self, shapes: Shapes) -> None:
        fixed = self.scene.model.inv_m == 0.0
        groups: dict[tuple[str, bool, float], list[Solid]] = {}
        for solid in shapes.solids:
            opacity = shapes.colors[solid.body][3]
            groups.setdefault((solid.form, bool(fixed[solid.body]), opacity), []).append(solid)
        for (form, is_fixed, opacity), solids in groups.items():
            name = f'/{"fixed" if is_fixed else "bodies"}/{form}_{round(100 * opacity)}'
            colors = self.colors[[solid.body for solid in solids]]
            self.batches.append(Batch(
                self._server.scene, name, shapes.surfaces[form], solids, colors,
                opacity if opacity < 1.0 else None, shapes.vertex_colors.get(form)))

    def _median_size(self) -> float:
        sizes = self.extents[self.moving] if len(self.moving) else self.extents
        sizes = sizes[sizes > 0.0]
        return float(np.median(sizes)) if len(sizes) else _LENGTHLESS

    def _grid(self, name: str) -> viser.GridHandle:
        # About two bodies wide, in a unit that is easy to read off: 1, 0.1, 10 m.
        cell = 10.0 ** round(math.log10(2.0 * self.size))
        return self._server.scene.add_grid(
            name, infinite_grid=True, cell_size=cell, section_size=10 * cell,
            cell_color=(195, 200, 205), section_color=(150, 158, 166),
            fade_distance=200 * cell, shadow_opacity=_SHADOW)

    def _aim(self, scene: Scene) -> None:
        """Look at the bodies that move from the front, the right and above."""
        rows = self.moving if len(self.moving) else np.arange(len(scene.names))
        centre, reach = _whereabouts(_places(scene)[rows], self.extents[rows])
        reach = _AWAY * max(reach, 2.0 * self.size)
        position = centre + reach * np.array([0.95, -1.15, 0.6])
        self._server.initial_camera.look_at = centre
        self._server.initial_camera.position = position
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = position, centre


def _places(scene: Scene) -> Array:
    """Return where the body frames are at the start, (n, 3) [m]: joints have put them together."""
    turn = Rotation.from_quat(scene.state.q.T)
    return np.asarray(scene.state.x.T + turn.apply(scene.model.p_CB))


def _whereabouts(places: Array, extents: Array) -> tuple[Array, float]:
    """
    Return the middle of what is to be seen, and how far that reaches [m].

    Of few bodies each counts. Of many the heap does, not the ball that comes flying from far away.
    """
    if len(places) <= _FEW:
        low, high = places - extents[:, None], places + extents[:, None]
        centre, share = 0.5 * (low.min(axis=0) + high.max(axis=0)), 1.0
    else:
        centre, share = np.median(places, axis=0), _SHARE
    return centre, float(np.quantile(np.linalg.norm(places - centre, axis=1) + extents, share))


def _painted(surface: Surface, colors: np.ndarray) -> trimesh.Trimesh:
    """Return a surface with a colour at each vertex, neither glossy nor of metal."""
    look: Any = trimesh.visual.ColorVisuals(vertex_colors=colors)
    look.material = trimesh.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=0.8)
    return trimesh.Trimesh(surface.vertices, surface.faces, visual=look, process=False)


def _extents(scene: Scene, shapes: Shapes) -> Array:
    """Return how far the solids of each body reach from its frame, planes aside [m]."""
    reach = np.zeros(len(scene.names))
    bound = {form: float(np.linalg.norm(surface.vertices, axis=1).max())
             for form, surface in shapes.surfaces.items()}
    for solid in shapes.solids:
        radius = bound[solid.form] * max(solid.scale)
        if solid.form in ('box', 'cylinder'):
            radius = 0.5 * float(np.linalg.norm(solid.scale))
        far = float(np.linalg.norm(solid.position)) + radius
        reach[solid.body] = max(reach[solid.body], far)
    return reach


def _place(grid: viser.GridHandle, plane: Plane, motion: Motion, rotation: Rotation) -> None:
    turn = rotation[plane.body]
    p = motion.position[plane.body] + turn.apply(plane.position)
    q = (turn * Rotation.from_quat(plane.orientation)).as_quat()[[3, 0, 1, 2]]
    if not (np.array_equal(p, grid.position) and np.array_equal(q, grid.wxyz)):
        grid.position, grid.wxyz = p, q
