# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a scene in MuJoCo, integrator implicitfast, the other settings as they come."""

import math
from typing import Any
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
from runner import main, Running


def tag(name: str, inside: str = '', /, **attributes: Any) -> str:
    """Return an XML element; numbers and sequences of numbers become text with all digits."""
    def text(value: Any) -> str:
        return value if isinstance(value, str) else ' '.join(
            repr(float(entry)) for entry in np.atleast_1d(value))
    pairs = ''.join(f' {key}={quoteattr(text(value))}' for key, value in attributes.items())
    return f'<{name}{pairs}>{inside}</{name}>'


def contact_parameters(scene: dict[str, Any]) -> dict[str, Any]:
    """Return the parameters of a contact of this friction and restitution."""
    found = {'friction': (max(scene['friction'], 1e-6), 0, 0), 'condim': '3'}
    if scene['restitution'] > 0.0:
        # A contact is a damped oscillator whose half swing loses exp(-pi zeta / sqrt(1 - zeta^2)).
        # Negative solref: stiffness and damping per unit mass; 2e4 takes 22 ms for the half swing.
        loss = -math.log(scene['restitution'])
        zeta, stiffness = loss / math.hypot(math.pi, loss), 2e4
        found['solref'] = (-stiffness, -2.0 * zeta * math.sqrt(stiffness))
        found['solimp'] = (0.9999, 0.9999, 0.001)
    return found


def _model(scene: dict[str, Any]) -> mujoco.MjModel:
    bodies = []
    for body in scene['bodies']:
        x, y, z, w = body['orientation']
        size = body['size'] if body['shape'] == 'sphere' else [0.5 * s for s in body['size']]
        inside = (tag('freejoint') + tag('inertial', pos=(0, 0, 0), mass=body['mass'],
                                         diaginertia=body['moments'])
                  + tag('geom', type=body['shape'], size=size))
        bodies.append(tag('body', inside, pos=body['position'], quat=(w, x, y, z)))
    if scene['ground']:
        bodies.append(tag('geom', type='plane', size=(0, 0, 1)))
    return mujoco.MjModel.from_xml_string(tag('mujoco', ''.join([
        tag('option', integrator='implicitfast', timestep=scene['step'],
            gravity=scene['gravity']),
        tag('size', memory='2G'), tag('default', tag('geom', **contact_parameters(scene))),
        tag('worldbody', ''.join(bodies))])))


def rotations(q: np.ndarray) -> np.ndarray:
    """Return matrices, body to world, of quaternions w, x, y, z."""
    found = np.empty((len(q), 9))
    for row, quaternion in zip(found, q, strict=True):
        mujoco.mju_quat2Mat(row, quaternion)
    return found.reshape(-1, 3, 3)


def build(scene: dict[str, Any]) -> Running:
    """Return the scene; MuJoCo keeps angular velocities in body axes."""
    model = _model(scene)
    data = mujoco.MjData(model)
    q, v = data.qpos.reshape(-1, 7), data.qvel.reshape(-1, 6)
    v[:, :3] = [body['linear'] for body in scene['bodies']]
    v[:, 3:] = np.einsum('nji,nj->ni', rotations(q[:, 3:]),
                         [body['angular'] for body in scene['bodies']])

    def motion() -> np.ndarray:
        turn = np.einsum('nij,nj->ni', rotations(q[:, 3:]), v[:, 3:])
        return np.hstack([q[:, :3], q[:, 4:], q[:, 3:4], v[:, :3], turn])

    def ground_force() -> float | None:
        if not scene['ground']:
            return None
        wrench, total, ground = np.zeros(6), 0.0, model.ngeom
        for k in range(data.ncon):
            geoms = data.contact[k].geom
            if any(model.geom_type[g] == mujoco.mjtGeom.mjGEOM_PLANE for g in geoms if g < ground):
                mujoco.mj_contactForce(model, data, k, wrench)
                total += wrench[0]
        return total

    return Running(lambda count: mujoco.mj_step(model, data, count), motion, ground_force)


if __name__ == '__main__':
    main(build)
