# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes of the laws in MuJoCo: integrator implicitfast, the other settings as they come."""

from typing import Any

import mujoco
import numpy as np
from run_mujoco import contact_parameters, rotations, tag


def _geoms(shape: dict[str, Any], name: str, assets: list[str]) -> str:
    """Return the geoms of a shape; meshes go to the assets."""
    pose = shape.get('pose', {})
    x, y, z, w = pose.get('orientation', (0, 0, 0, 1))
    place = {'pos': pose.get('position', (0, 0, 0)), 'quat': (w, x, y, z)}
    kind = shape['type']
    if kind == 'compound':
        return ''.join(_geoms(part, f'{name}_{k}', assets)
                       for k, part in enumerate(shape['compound']))
    if kind == 'mesh':
        assets.append(tag('mesh', name=name, vertex=np.ravel(shape['vertices'])))
        return tag('geom', type='mesh', mesh=name, **place)
    size = {'plane': lambda: (0, 0, 1), 'sphere': lambda: [shape['radius']],
            'box': lambda: 0.5 * np.array(shape['size']),
            'cylinder': lambda: (shape['radius'], 0.5 * shape['length']),
            'capsule': lambda: (shape['radius'], 0.5 * shape['length'])}[kind]()
    return tag('geom', type=kind, size=size, **place)


def _model(spec: dict[str, Any]) -> mujoco.MjModel:
    bodies, assets = [], []
    for body in spec['bodies']:
        pose = body.get('pose', {})
        x, y, z, w = pose.get('orientation', (0, 0, 0, 1))
        inside = _geoms(body['shape'], body['name'], assets)
        if not body.get('fixed'):
            own = body['inertial']
            inside += tag('freejoint') + tag('inertial', pos=own['com'], mass=own['mass'],
                                             fullinertia=own['inertia'])
        bodies.append(tag('body', inside, name=body['name'],
                          pos=pose.get('position', (0, 0, 0)), quat=(w, x, y, z)))
    world, surface = spec['world'], spec['materials']['default']
    return mujoco.MjModel.from_xml_string(tag('mujoco', ''.join([
        # The least mass and inertia that it accepts are those of a small thing.
        tag('compiler', boundmass=0.0, boundinertia=0.0),
        tag('option', integrator='implicitfast', timestep=world['step'],
            gravity=world['gravity']),
        tag('size', memory='64M'), tag('default', tag('geom', **contact_parameters(surface))),
        tag('asset', ''.join(assets)), tag('worldbody', ''.join(bodies))])))


class Run:
    """A scene of the laws in MuJoCo."""

    def __init__(self, spec: dict[str, Any]) -> None:
        """Build the model; angular velocities are kept in body axes."""
        self._model = _model(spec)
        self._data = mujoco.MjData(self._model)
        self._start = np.zeros((len(spec['bodies']), 13))
        self._start[:, 6] = 1.0
        for row, body in zip(self._start, spec['bodies'], strict=True):
            pose = body.get('pose', {})
            row[:3] = pose.get('position', row[:3])
            row[3:7] = pose.get('orientation', row[3:7])
        moving = [body for body in spec['bodies'] if not body.get('fixed')]
        self._moves = [not body.get('fixed') for body in spec['bodies']]
        q, v = self._data.qpos.reshape(-1, 7), self._data.qvel.reshape(-1, 6)
        v[:, :3] = [body['twist']['linear'] for body in moving]
        v[:, 3:] = np.einsum('nji,nj->ni', rotations(q[:, 3:]),
                             [body['twist']['angular'] for body in moving])
        mujoco.mj_forward(self._model, self._data)

    def step(self, count: int) -> None:
        """Advance."""
        mujoco.mj_step(self._model, self._data, count)

    def motion(self) -> np.ndarray:
        """Return poses and twists; those of what is fixed are the first it had."""
        found = self._start.copy()
        q, v = self._data.qpos.reshape(-1, 7), self._data.qvel.reshape(-1, 6)
        w = np.einsum('nij,nj->ni', rotations(q[:, 3:]), v[:, 3:])
        found[self._moves] = np.hstack([q[:, :3], np.roll(q[:, 3:], -1, axis=1), v[:, :3], w])
        return found

    def deepest(self) -> float:
        """Return the deepest overlap [m]."""
        return float(max(0.0, -np.min(self._data.contact.dist, initial=0.0)))

    def force_on(self, name: str) -> np.ndarray:
        """Return the force of the contacts on a body [N]."""
        total, force = np.zeros(3), np.zeros(6)
        body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, name)
        for k in range(self._data.ncon):
            contact = self._data.contact[k]
            mujoco.mj_contactForce(self._model, self._data, k, force)
            for sign, geom in zip((-1.0, 1.0), contact.geom, strict=True):
                if self._model.geom_bodyid[geom] == body:
                    total += sign * (np.reshape(contact.frame, (3, 3)).T @ force[:3])
        return total
