# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Contacts as markers: a ball at each point, a line along the normal, an arrow along the force.

Three markers hold all of them, in namespaces of their own, so that each can be switched off in
RViz. Lengths follow the scene: a normal is as long as half of a common body, and an arrow as long
as a whole one is the force that carries its weight.
"""
import numpy as np
import numpy.typing as npt

from rigid_sim_ros.messages.codec import Marker, PointMarkersEncoder
from rigid_sim_ros.nodes.markers import Deletes
from rigid_sim_ros.world import World

# visualization_msgs/Marker
_LINE_LIST, _SPHERE_LIST = 5, 7
_LENGTHLESS = 0.1       # m: what a scene of planes alone is drawn with
_WEIGHTLESS = 1.0       # N: what a scene without gravity is drawn with
_BARB = 0.25            # length of the barbs of an arrow, as a share of the arrow
_LONGEST_BARB = 0.25    # the same at most, as a share of a common body

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
        size = self._length
        markers = [
            Marker('contact_points', 0, _SPHERE_LIST, (0.1 * size,) * 3, (0.8, 0.2, 0.1, 1.0)),
            Marker('contact_normals', 0, _LINE_LIST, (0.02 * size, 0.0, 0.0),
                   (0.1, 0.1, 0.1, 1.0)),
            Marker('contact_forces', 0, _LINE_LIST, (0.04 * size, 0.0, 0.0),
                   (0.9, 0.6, 0.0, 1.0))]
        self._encoder = PointMarkersEncoder(frame_id, markers)
        self._deletes = Deletes(frame_id, markers)

    def encode(self, world: World) -> bytes:
        """Encode the contact points that bear a force."""
        rows = world.contacts()
        rows = rows[rows['normal_force'] > 0.0]
        if not len(rows):
            return self.encode_end(world.time_ns)
        p = rows['point']
        force = rows['normal_force'][:, None] * rows['normal'] + rows['friction_force']
        normals = _lines(p, p + 0.5 * self._length * rows['normal'])
        forces = _arrows(p, self._length / self._weight * force, _LONGEST_BARB * self._length)
        return self._encoder.encode(world.time_ns, (p, normals, forces))

    def encode_end(self, t_ns: int) -> bytes:
        """Encode that there are no contacts any more: a DELETE for each marker."""
        return self._deletes.encode(t_ns)


def _lines(start: _Array, end: _Array) -> _Array:
    """Return the ends of lines one after the other."""
    return np.stack([start, end], axis=1).reshape(-1, 3)


def _arrows(start: _Array, vector: _Array, longest: float) -> _Array:
    """Return the ends of the lines of arrows: a shaft each, and four barbs at its head."""
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    along = vector / np.maximum(length, np.finfo(float).tiny)
    # The axis that an arrow is least along gives the first direction across it.
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=1)])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
    barb = np.minimum(_BARB * length, longest)
    head = start + vector
    barbs = [head + barb * (0.4 * sign * side - along)
             for sign in (-1.0, 1.0) for side in (across, np.cross(along, across))]
    return np.concatenate([_lines(start, head), *(_lines(head, end) for end in barbs)])
