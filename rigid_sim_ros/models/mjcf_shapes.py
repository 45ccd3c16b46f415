# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The geometries of a compiled MuJoCo model."""

from typing import Any

from rigid_sim_ros.models.description import Link, Shape
from rigid_sim_ros.models.findings import Findings
from rigid_sim_ros.models.poses import Pose, Vector


# MuJoCo shows geometries of the groups 0, 1 and 2 unless it is told otherwise; models keep what
# only touches in group 3.
_GROUPS_SEEN = 3
# What a geometry has whose colour the file does not say.
_UNSAID = (0.5, 0.5, 0.5, 1.0)


def read_shapes(mujoco: Any, m: Any, body: int, link: Link, findings: Findings) -> None:
    """Write the solids of a body to its link: those that touch, and those that are only seen."""
    start = int(m.body_geomadr[body])
    for g in range(start, start + int(m.body_geomnum[body])):
        kind = mujoco.mjtGeom(int(m.geom_type[g])).name[7:].lower()
        touches = bool(m.geom_contype[g]) or bool(m.geom_conaffinity[g])
        x, y, z = (float(value) for value in m.geom_pos[g])
        w, a, b, c = (float(value) for value in m.geom_quat[g])
        pose = Pose((x, y, z), (a, b, c, w))
        size = tuple(float(value) for value in m.geom_size[g])
        points = faces = None
        if kind == 'mesh':
            mesh = int(m.geom_dataid[g])
            first, count = int(m.mesh_vertadr[mesh]), int(m.mesh_vertnum[mesh])
            points = m.mesh_vert[first:first + count].astype(float)
            first, count = int(m.mesh_faceadr[mesh]), int(m.mesh_facenum[mesh])
            faces = m.mesh_face[first:first + count].astype(int)
        elif kind not in (*_VALUES, 'hfield'):
            if touches:
                findings.error(link.place, f'has a {kind}, which is not known here, must be '
                               f'{", ".join(_VALUES)}, hfield or mesh')
            continue
        values = (_field(m, int(m.geom_dataid[g])) if kind == 'hfield' else
                  {} if kind == 'mesh' else _VALUES[kind](size))
        shape = Shape('heightfield' if kind == 'hfield' else kind, values, pose, link.place,
                      points=points, faces=faces, color=_color(m, g))
        if touches:
            link.collisions.append(shape)
        if int(m.geom_group[g]) < _GROUPS_SEEN:
            link.visuals.append(shape)


def _color(m: Any, g: int) -> tuple[float, ...] | None:
    """Return what a geometry looks like: as itself or its material says, None if neither does."""
    color = tuple(float(value) for value in m.geom_rgba[g])
    if color == _UNSAID:
        material = int(m.geom_matid[g])
        if material < 0:
            return None
        color = tuple(float(value) for value in m.mat_rgba[material])
    return color if all(0.0 <= value <= 1.0 for value in color) else None


def _field(m: Any, k: int) -> dict[str, Any]:
    """Return heightfield k: its heights are shares of the third of its lengths."""
    x, y, z, _ = (float(value) for value in m.hfield_size[k])   # half lengths along x and y
    rows, columns, first = int(m.hfield_nrow[k]), int(m.hfield_ncol[k]), int(m.hfield_adr[k])
    shares = m.hfield_data[first:first + rows * columns].astype(float).reshape(rows, columns)
    return {'heights': (z * shares).tolist(), 'size': [2.0 * x, 2.0 * y]}


def _lengths(size: Vector) -> dict[str, Any]:
    # Half lengths in MuJoCo.
    return {'radius': size[0], 'length': 2.0 * size[1]}


_VALUES: dict[str, Any] = {
    'plane': lambda size: {},
    'sphere': lambda size: {'radius': size[0]},
    'capsule': _lengths,
    'cylinder': _lengths,
    'ellipsoid': lambda size: {'radii': list(size)},
    'box': lambda size: {'size': [2.0 * half for half in size]}}
