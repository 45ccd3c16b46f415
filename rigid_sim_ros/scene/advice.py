# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is legal in a scene and yet will not go well: what the author should know before a run."""

from collections.abc import Iterator
import math

import numpy as np

from rigid_sim_ros.engine.dynamics.force_rates import ForceRow
from rigid_sim_ros.engine.dynamics.forces import force_row, FORCES
from rigid_sim_ros.engine.model.inertia import mesh_volume
from rigid_sim_ros.engine.model.model import WORLD
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
        kind, row = force_row(scene.model, scene.state, r)
        rates = FORCES[kind].rates(row)
        fastest = max(rates.oscillation, rates.damping)
        if fastest * h > COARSE and fastest > worst.get(kind, (0.0,))[0]:
            worst[kind] = fastest, rates.oscillation, _ends(kind, row, names)
    for kind, (fastest, oscillation, ends) in worst.items():
        if fastest == oscillation:
            what = f'may oscillate at {fastest / math.tau:.3g} Hz'
        else:
            what = f'takes a velocity away at {fastest:.3g} /s'
        effect = 'and will grow without bound' if fastest * h >= 2.0 else 'coarsely'
        yield (f'{kind} {ends}: {what}, which a step of {h:g} s follows {effect}; '
               f'use a step of at most {below(COARSE / fastest)} s or softer parameters'
               .replace('follows and will', 'does not follow: it will'))


def _ends(kind: str, row: ForceRow, names: dict[int, str]) -> str:
    if FORCES[kind].ends == 'each':
        return f'on {names[row.a]}'
    return f'between {names[row.a]} and {names[row.b]}'


def _of_spin(scene: Scene) -> Iterator[str]:
    if scene.spec.world.integrator in ('symplectic', 'symplectic4'):
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
    if scene.orientation != 'quaternion' and scene.integrator in (
            'symplectic', 'symplectic4', 'rk4'):
        yield (f'orientation {scene.orientation} is how euler and semi_implicit turn a body: '
               f'integrator {scene.integrator} does not ask for it; leave it out')
    for joint in scene.spec.joints or () if scene.integrator == 'symplectic4' else ():
        if joint.friction > 0.0:
            yield (f"joint '{joint.name}' has dry friction, which integrator symplectic4 does not "
                   'follow: all steps are those of symplectic; write that, or leave friction out')
            break


def _of_contact(scene: Scene) -> Iterator[str]:
    touches = can_meet(scene.shapes) or (
        scene.joints is not None and scene.spec.collision.sleep_after > 0.0)
    if scene.contact != 'none' and touches and scene.integrator != 'symplectic':
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
