# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contacts as markers: a ball at each point, a line along the normal, a line along the force.

Three markers hold all of them, in namespaces of their own, so that each can be switched off in
RViz. Lengths follow the scene: a normal is as long as half of a common body, and so is the force
that carries the weight of one.
"""
import numpy as np
import numpy.typing as npt

from rigid_sim_ros.codec import Marker, MarkersEncoder
from rigid_sim_ros.world import World

# visualization_msgs/Marker
_LINE_LIST, _SPHERE_LIST, _ADD, _DELETE = 5, 7, 0, 2
_LENGTHLESS = 0.1       # m: what a scene of planes alone is drawn with
_WEIGHTLESS = 1.0       # N: what a scene without gravity is drawn with

_Array = npt.NDArray[np.float64]


class ContactMarkers:
    """Encodes the contacts of a world as one visualization_msgs/MarkerArray."""

    def __init__(self, frame_id: str, world: World) -> None:
        shapes = world.scene.shapes
        sizes = shapes.bound[(shapes.still == 0) & np.isfinite(shapes.bound)]
        self._length = float(np.median(sizes)) if len(sizes) else _LENGTHLESS
        masses = world.mass[world.mass > 0.0]
        g = float(np.linalg.norm(world.scene.model.gravity))
        weight = float(np.median(masses)) * g if len(masses) else 0.0
        self._weight = weight or _WEIGHTLESS
        self._frame_id = frame_id

    def encode(self, world: World) -> bytes:
        """Encode the contact points that bear a force."""
        rows = world.contacts()
        rows = rows[rows['normal_force'] > 0.0]
        p = rows['point']
        force = rows['normal_force'][:, None] * rows['normal'] + rows['friction_force']
        normals = _lines(p, p + 0.5 * self._length * rows['normal'])
        forces = _lines(p, p + self._length / self._weight * force)
        action = _ADD if len(rows) else _DELETE
        size = self._length
        markers = [
            Marker('contact_points', 0, _SPHERE_LIST, (0.1 * size,) * 3, (0.8, 0.2, 0.1, 1.0),
                   p.tolist(), action),
            Marker('contact_normals', 0, _LINE_LIST, (0.02 * size, 0.0, 0.0),
                   (0.1, 0.1, 0.1, 1.0), normals.tolist(), action),
            Marker('contact_forces', 0, _LINE_LIST, (0.04 * size, 0.0, 0.0),
                   (0.9, 0.6, 0.0, 1.0), forces.tolist(), action)]
        still = np.zeros((len(markers), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(markers), 1))
        return bytes(MarkersEncoder(self._frame_id, markers).encode(world.time_ns, *still))


def _lines(start: _Array, end: _Array) -> _Array:
    """Return the ends of lines one after the other."""
    return np.stack([start, end], axis=1).reshape(-1, 3)
