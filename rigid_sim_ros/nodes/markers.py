# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The shapes of a scene as markers for RViz and Foxglove.

The namespace of a marker is the name of its body; the ids count the solids a body is drawn with.
A marker stays until it is deleted: that happens once, when the simulation ends.

Markers are sent again at each pose, so they show what touches, which has few triangles. The meshes
that a robot is drawn with are shown by RViz's RobotModel, from its description. What has many, as
the ground of a heightfield, is sent again when it has moved, and else once a second for those who
come later.
"""
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rigid_sim_ros.engine.maths.rotation_in_python import multiply_arrays, rotate_arrays
from rigid_sim_ros.engine.model.kinds.drawing import Surface
from rigid_sim_ros.engine.model.kinds.table import BY_TYPE, KINDS, UNIT_SURFACES
from rigid_sim_ros.messages.codec import Marker, MarkersEncoder
from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.appearance import body_color, with_alpha
from rigid_sim_ros.scene.build import Scene

_Array = npt.NDArray[np.float64]

# visualization_msgs/Marker
_CUBE, _SPHERE, _CYLINDER, _SPHERE_LIST, _TRIANGLE_LIST = 1, 2, 3, 7, 11
_DELETE = 2
# The markers of the forms that have one; a ball in the place of a dome is the same from outside.
_TYPES = {'box': _CUBE, 'sphere': _SPHERE, 'dome': _SPHERE, 'cylinder': _CYLINDER,
          'tube': _CYLINDER}
_SIDES = 32                 # around a form that is drawn as triangles

_MANY = 3000                # corners of triangles from which on a marker is not sent each time
_AGAIN = 10 ** 9            # ns, until it is all the same

_PLANE_EDGE = 20.0          # m, of the piece of a plane that is drawn
_PLANE_THICKNESS = 1e-3     # m; a cube without thickness is drawn with wrong shading
_PARTICLE_SHARE = 0.04      # diameter of a particle as a share of the extent of its body
_LEAST_PARTICLE = 1e-3      # m
_UNTURNED = (0.0, 0.0, 0.0, 1.0)


class _Solid(NamedTuple):
    """One marker in the frame of the solid that it draws."""

    type: int
    scale: tuple[float, float, float]
    position: Sequence[float] = (0.0, 0.0, 0.0)
    orientation: Sequence[float] = _UNTURNED
    points: Sequence[Sequence[float]] = ()


class SceneMarkers:
    """Encodes the shapes of all bodies at their poses as one visualization_msgs/MarkerArray."""

    def __init__(self, frame_id: str, scene: Scene) -> None:
        markers: list[Marker] = []
        bodies, positions, orientations = [], [], []
        for index, body in enumerate(scene.spec.bodies):
            solids = [
                (part.pose, solid, color or body_color(scene.spec, index))
                for part, color in _shown(body) for solid in _solids(part)]
            for number, (pose, solid, color) in enumerate(solids):
                markers.append(Marker(body.name, number, solid.type, solid.scale,
                                      with_alpha(color), solid.points))
                q_BP = np.array(pose.orientation)
                bodies.append(index)
                positions.append(pose.position + rotate_arrays(q_BP, np.array(solid.position)))
                orientations.append(multiply_arrays(q_BP, np.array(solid.orientation)))
        self._bodies = np.array(bodies, dtype=np.intp)
        p_BM, q_BM = np.array(positions).reshape(-1, 3), np.array(orientations).reshape(-1, 4)
        # Most are where their body is.
        self._placed = np.flatnonzero((p_BM != 0.0).any(axis=1) | (q_BM != _UNTURNED).any(axis=1))
        self._p_BM, self._q_BM = p_BM[self._placed], q_BM[self._placed]
        self._all = MarkersEncoder(frame_id, markers)
        heavy = np.array([len(marker.points) > _MANY for marker in markers], dtype=bool)
        self._heavy, self._light = np.flatnonzero(heavy), np.flatnonzero(~heavy)
        self._few = MarkersEncoder(frame_id, [markers[k] for k in self._light])
        # When and where the heavy ones were.
        self._sent: tuple[int, _Array, _Array] | None = None
        self._frame_id = frame_id
        self._markers = markers

    def encode(self, t_ns: int, p_WB: _Array, q_WB: _Array) -> bytes:
        """
        Encode the markers of the bodies at these poses.

        p_WB is (n, 3) in m, q_WB (n, 4) as x, y, z, w.
        """
        p, q = p_WB[self._bodies], q_WB[self._bodies]
        k = self._placed
        if len(k):
            p[k] += rotate_arrays(q[k], self._p_BM)
            q[k] = multiply_arrays(q[k], self._q_BM)
        if not self._is_due(t_ns, p[self._heavy], q[self._heavy]):
            return self._few.encode(t_ns, p[self._light], q[self._light])
        return self._all.encode(t_ns, p, q)

    def _is_due(self, t_ns: int, p: _Array, q: _Array) -> bool:
        """Return whether the markers with many triangles, at these poses, are to be sent."""
        sent = self._sent
        # A time that does not go on is that of a pause, or of another run.
        if sent is not None and sent[0] < t_ns < sent[0] + _AGAIN and (
                np.array_equal(p, sent[1]) and np.array_equal(q, sent[2])):
            return False
        self._sent = t_ns, p, q
        return True

    def encode_end(self, t_ns: int) -> bytes:
        """Encode that the bodies are gone: a DELETE for each marker."""
        return Deletes(self._frame_id, self._markers).encode(t_ns)


class Deletes:
    """Encodes a DELETE for each of some markers."""

    def __init__(self, frame_id: str, markers: Sequence[Marker]) -> None:
        self._encoder = MarkersEncoder(frame_id, [
            marker._replace(action=_DELETE, points=()) for marker in markers])
        self._poses = np.zeros((len(markers), 3)), np.tile(_UNTURNED, (len(markers), 1))

    def encode(self, t_ns: int) -> bytes:
        """Encode that they are gone from this time on."""
        return self._encoder.encode(t_ns, *self._poses)


def _shown(body: schema.Body) -> Iterable[tuple[Any, tuple[float, ...] | None]]:
    """Return the solids of a body, of one without any the simple ones that it is drawn with."""
    parts = body.parts()
    if parts:
        return [(part, None) for _, part in parts]
    return [(part, color) for part, color in body.drawn() if not isinstance(part, schema.Mesh)]


def _solids(part: Any) -> Iterable[_Solid]:
    """Return the markers of a part; what is no form that has one is drawn as triangles."""
    if isinstance(part, schema.Plane):
        yield from _plane(part)
    elif isinstance(part, schema.Points):
        yield from _points(part)
    else:
        kind = KINDS[BY_TYPE[part.type]]
        for form in kind.forms(part):
            if form.name in _TYPES:
                yield _Solid(_TYPES[form.name], form.scale, form.position)
            else:
                surface = UNIT_SURFACES[form.name](_SIDES // 2, _SIDES)
                yield _triangles(surface, form.scale)._replace(
                    position=form.position, orientation=form.orientation)
        if not kind.forms(part) and kind.surface is not None:
            yield _triangles(kind.surface(part, _SIDES), (1.0, 1.0, 1.0))


def _triangles(surface: Surface, scale: tuple[float, float, float]) -> _Solid:
    return _Solid(_TRIANGLE_LIST, scale,
                  points=surface.vertices[surface.faces.ravel()].tolist())


def _plane(shape: Any) -> Iterable[_Solid]:
    normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
    depth = shape.offset - _PLANE_THICKNESS / 2
    x, y, z = normal
    # The shortest turn from the z axis to the normal: axis z x n, half angle from 1 + cos. It is
    # not defined for n = -z, where half a turn about x does.
    turn = np.array([-y, x, 0.0, 1.0 + z]) if z > -1.0 + 1e-9 else np.array([1.0, 0.0, 0.0, 0.0])
    yield _Solid(
        _CUBE, (_PLANE_EDGE, _PLANE_EDGE, _PLANE_THICKNESS), tuple(depth * normal),
        tuple(turn / np.linalg.norm(turn)))


def _points(shape: Any) -> Iterable[_Solid]:
    extent = float(np.ptp(np.array(shape.positions), axis=0).max())
    diameter = max(_PARTICLE_SHARE * extent, _LEAST_PARTICLE)
    yield _Solid(_SPHERE_LIST, (diameter,) * 3, points=shape.positions)
