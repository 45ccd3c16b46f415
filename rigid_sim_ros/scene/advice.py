# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is legal in a scene and yet will not go well: what the author should know before a run."""

from collections.abc import Callable, Iterator
import math
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.dynamics.forces import FORCES
from rigid_sim_ros.engine.model.inertia import mesh_volume
from rigid_sim_ros.engine.model.model import Model, WORLD
from rigid_sim_ros.engine.model.shapes import can_meet
from rigid_sim_ros.scene.build import Scene
from rigid_sim_ros.scene.contact_advice import below, describe_contact
from rigid_sim_ros.scene.overlap import describe_overlaps
from rigid_sim_ros.scene.schema import Mesh

# [rad] An oscillation may advance by this much in a step: 13 steps a swing, whose frequency is
# then off by 0.5**2 / 24 = 1 %. From 2 rad on no explicit method is stable. A damper may take the
# same part of a velocity in a step; from 2 on it would reverse and grow.
COARSE = 0.5
# [rad] A turn in a step from which the methods of first order show visible errors.
FAST_TURN = 0.25
# Part of its convex hull that a mesh may leave empty without a word.
HOLLOW = 0.01


class Rates(NamedTuple):
    """How fast a force acts on the bodies at its ends, as upper bounds."""

    oscillation: float = 0.0  # [rad/s]
    damping: float = 0.0  # [1/s]


class _Row:
    """One row of a scene's force table, with what its ends weigh."""

    def __init__(self, scene: Scene, r: int) -> None:
        self._model: Model = scene.model
        table = scene.model.forces
        self.kind = list(FORCES)[table.kind[r]]
        self.a, self.b = int(table.frame_a[r]), int(table.frame_b[r])
        self._values = table.parameters[r]
        self.state = scene.state

    def value(self, name: str) -> np.ndarray:
        """Return the numbers of a parameter."""
        start = 0
        for parameter in FORCES[self.kind].parameters:
            if parameter.name == name:
                return self._values[start:start + parameter.size]
            start += parameter.size
        raise KeyError(name)

    def scalar(self, name: str) -> float:
        """Return the number of a parameter."""
        return float(self.value(name)[0])

    def inv_m(self, frame: int) -> float:
        """Return 1 / mass [1/kg] of the body of a frame, 0 for what cannot move."""
        return 0.0 if frame == WORLD else float(self._model.inv_m[self._model.frame_body[frame]])

    def inv_I(self, frame: int) -> float:
        """Return 1 / moment of inertia [1/(kg m^2)] about the axis that turns most easily."""
        if frame == WORLD:
            return 0.0
        return float(self._model.inv_I_C[:, self._model.frame_body[frame]].max())

    def inv_m_at(self, frame: int, offset: float = 0.0) -> float:
        """Return the most that a point of a frame, `offset` [m] from its origin, yields [1/kg]."""
        if frame == WORLD:
            return 0.0
        arm = float(np.linalg.norm(self._model.p_CF[frame])) + offset
        return self.inv_m(frame) + arm * arm * self.inv_I(frame)


def _at_points(row: _Row) -> Rates:
    anchor = float(np.linalg.norm(row.value('anchor')))
    inv = row.inv_m_at(row.a) + row.inv_m_at(row.b, anchor)
    return Rates(math.sqrt(row.scalar('stiffness') * inv), row.scalar('damping') * inv)


def _between_centres(row: _Row) -> Rates:
    return Rates(math.sqrt(row.scalar('stiffness') * (row.inv_m(row.a) + row.inv_m(row.b))))


def _between_axes(row: _Row) -> Rates:
    inv = row.inv_I(row.a) + row.inv_I(row.b)
    return Rates(math.sqrt(row.scalar('stiffness') * inv), row.scalar('damping') * inv)


def _in_air(row: _Row) -> Rates:
    # Drag grows with the speed; the one at the start is the one that is known. Frames that wind
    # acts on are bodies.
    inv_m, inv_I = row.inv_m(row.a), row.inv_I(row.a)
    v = inv_m * row.state.P[:, row.a] - row.value('velocity')
    w = inv_I * np.linalg.norm(row.state.L[:, row.a])
    return Rates(damping=max(
        inv_m * (row.scalar('drag') + row.scalar('quadratic_drag') * float(np.linalg.norm(v))),
        inv_I * (row.scalar('angular_drag') + row.scalar('quadratic_angular_drag') * float(w))))


_RATES: dict[str, Callable[[_Row], Rates]] = {
    'wind': _in_air,
    'spring': _at_points,
    'avoidance': _between_centres,
    'hold_point': _at_points,
    'hold_orientation': _between_axes,
}


def advice(scene: Scene) -> list[str]:
    """Return a line, with what to do, for each thing in a scene that will not go well."""
    return [*_of_forces(scene), *_of_spin(scene), *_of_integrator(scene), *_of_contact(scene),
            *describe_contact(scene), *_of_materials(scene), *_of_meshes(scene),
            *describe_overlaps(scene)]


def _of_forces(scene: Scene) -> Iterator[str]:
    h = scene.model.h
    worst: dict[str, tuple[float, float, str]] = {}
    names = {index: name for name, index in scene.frame_names.items()} | {WORLD: 'world'}
    for r in range(scene.model.forces.kind.shape[0]):
        row = _Row(scene, r)
        rates = _RATES[row.kind](row)
        fastest = max(rates.oscillation, rates.damping)
        if fastest * h > COARSE and fastest > worst.get(row.kind, (0.0,))[0]:
            worst[row.kind] = fastest, rates.oscillation, _ends(row, names)
    for kind, (fastest, oscillation, ends) in worst.items():
        if fastest == oscillation:
            what = f'may oscillate at {fastest / math.tau:.3g} Hz'
        else:
            what = f'takes a velocity away at {fastest:.3g} /s'
        effect = 'and will grow without bound' if fastest * h >= 2.0 else 'coarsely'
        yield (f'{kind} {ends}: {what}, which a step of {h:g} s follows {effect}; '
               f'use a step of at most {below(COARSE / fastest)} s or softer parameters'
               .replace('follows and will', 'does not follow: it will'))


def _ends(row: _Row, names: dict[int, str]) -> str:
    if FORCES[row.kind].ends == 'each':
        return f'on {names[row.a]}'
    return f'between {names[row.a]} and {names[row.b]}'


def _of_spin(scene: Scene) -> Iterator[str]:
    if scene.spec.world.integrator == 'symplectic':
        return
    for body in scene.spec.bodies:
        angle = math.hypot(*body.twist.angular) * scene.model.h
        if angle > FAST_TURN:
            step = below(FAST_TURN / angle * scene.model.h)
            yield (f"body '{body.name}' turns by {angle:.2g} rad in a step; use a step of at most "
                   f'{step} s or integrator: symplectic')


def _of_integrator(scene: Scene) -> Iterator[str]:
    if scene.spec.world.integrator == 'euler':
        yield ('integrator euler adds energy to whatever swings or spins: use another one but to '
               'compare')
    if scene.orientation != 'quaternion' and scene.integrator in ('symplectic', 'rk4'):
        yield (f'orientation {scene.orientation} is how euler and semi_implicit turn a body: '
               f'integrator {scene.integrator} does not ask for it; leave it out')


def _of_contact(scene: Scene) -> Iterator[str]:
    if scene.contact != 'none' and can_meet(scene.shapes) and scene.integrator != 'symplectic':
        yield (f'integrator {scene.integrator} runs worlds without contact only: with contact: '
               f'{scene.contact} bodies fly by the symplectic one; write contact: none, or '
               'integrator: symplectic')


def _of_materials(scene: Scene) -> Iterator[str]:
    if scene.contact != 'timestep' or scene.solver != 'qp':
        return
    for name, material in scene.spec.all_materials.items():
        if material.rolling > 0.0 or material.spinning > 0.0:
            yield (f"material '{name}' resists rolling or spinning, which solver qp does not "
                   'know: use solver: sequential, or contact: event')


def _of_meshes(scene: Scene) -> Iterator[str]:
    for body in scene.spec.bodies if scene.contact != 'none' else ():
        for _, part in body.parts():
            if isinstance(part, Mesh) and part.convex and body.collides:
                # SciPy: 0.6 s that a scene without a mesh does not wait for.
                from scipy.spatial import ConvexHull

                vertices = np.array(part.vertices)
                volume = mesh_volume(vertices, np.array(part.faces))
                hull = float(ConvexHull(vertices).volume)
                if volume < (1.0 - HOLLOW) * hull:
                    yield (f"body '{body.name}' has a mesh of {volume:.3g} m^3 in a convex hull "
                           f'of {hull:.3g} m^3: it collides as the hull; use a compound of convex '
                           'meshes where that matters')
