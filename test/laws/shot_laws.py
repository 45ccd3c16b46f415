# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Articulations and loose bodies that are shot at a sheet: nothing gets through, joints hold."""

from typing import NamedTuple

from laws.ground_scenes import draw_ground, Ground, inner_points
from laws.jointed_laws import Holding
from laws.jointed_scenes import begins_apart, draw_articulations, FREE
from laws.mixed_scenes import add_loose
from laws.motion import Build, look, masses, Ours, Verdict, worst
from laws.scenes import between, body, direction, fixed, G, matrix, Scene, Spec
from laws.solids import box, Generator
import numpy as np

SIZE = 0.2  # [m] of bodies of an articulation
# [m] Half of what a sheet is wide, and how near to its edge a body counts as having left it: no
# shot goes around the edge and as far back within a step.
HALF_WIDTH, EDGE = 4.0, 1.8
# [m] Of what may be shot through: a thousandth of a way of a step, up to half of a body.
THICKNESS = 0.005, 0.1
FASTEST = 3.0   # sizes in a step
TURN = 0.1  # [rad] of a sheet in a step


class Sheet(NamedTuple):
    """A plate, of which one side is up."""

    name: str
    half_thickness: float


def draw_shots(rng: Generator) -> Scene:
    """
    Draw articulations and loose bodies that fly at a sheet by up to three sizes a step.

    The sheet is a plate that is fixed, that they push away or turn about a hinge, or a ground of
    triangles.
    """
    while True:
        spec = draw_articulations(rng, FREE)
        if rng.random() < 0.5:
            add_loose(rng, spec, FREE)
        if begins_apart(spec):
            break
    h = float(rng.choice([1e-3, 4e-3, 1 / 60]))
    spec['world'] |= {'step': h, 'gravity': [0.0, 0.0, -G]}
    lowest = min(one['pose']['position'][2] - 0.7 for one in spec['bodies'])
    for one in spec['bodies']:
        one['pose']['position'][2] -= lowest
    speed = SIZE / h * between(rng, 1e-2, FASTEST)
    slant = 0.3 * speed * rng.normal(size=2) if rng.random() < 0.5 else np.zeros(2)
    for one in spec['bodies']:
        for key in {'groups', 'collides_with'} & set(one):
            del one[key]    # dust would fly through the sheet
        one['twist']['linear'] = np.add(one['twist']['linear'], (*slant, -speed)).tolist()
    # As they fly on, they hit the middle of the sheet.
    middle = np.mean([one['pose']['position'] for one in spec['bodies']], axis=0)
    return _with_sheet(rng, spec, middle[:2] + slant * middle[2] / speed)


def _with_sheet(rng: Generator, spec: Spec, at: np.ndarray) -> Scene:
    """Put a sheet below all, with its middle at a place (2,) [m]."""
    kind, facts = str(rng.choice(['fixed', 'pushed', 'hinged', 'ground'])), {}
    if kind == 'ground':
        ground = draw_ground(rng, SIZE, wide=2 * HALF_WIDTH / SIZE)
        place = np.append(at, -ground.highest)
        below = ground.spec() | {'pose': {'position': place.tolist()}}
        facts = {'ground': ground, 'place': place}
    else:
        thick = between(rng, *THICKNESS)
        solid = box((2 * HALF_WIDTH, 2 * HALF_WIDTH, thick))
        place = np.append(at, -0.5 * thick)
        below = fixed('sheet', solid, place)
        if kind in ('pushed', 'hinged'):
            spin = between(rng, 1e-3, TURN) / spec['world']['step'] * rng.normal(size=3)
            below = body('sheet', solid, between(rng, 10.0, 1e3), place, angular=spin)
        if kind == 'hinged':
            axis = direction(rng)
            below['twist']['angular'] = (spin @ axis * axis).tolist()
            spec['joints'].append({
                'name': 'hinge', 'type': 'revolute', 'parent': 'world', 'child': 'sheet',
                'pose': {'position': place.tolist()}, 'axis': axis.tolist()})
        facts = {'sheet': Sheet('sheet', 0.5 * thick)}
    spec['bodies'].append(below)
    return Scene(spec, SIZE, 60, facts)


def judge_shots(scene: Scene, build: Build) -> Verdict:
    """
    Look for a body with a point of its inside beyond the sheet, and for joints that do not hold.

    That is half a body deep, far above any overlap that a contact leaves. What has left over the
    edge, once, may be where it likes.
    """
    run, of = build(scene.spec), masses(scene.spec)
    assert isinstance(run, Ours)
    held, verdicts, there, deepest = Holding(scene.spec, run.world), [], None, -np.inf
    for _ in range(scene.steps):
        run.step(1)
        motion = run.motion()
        if not np.isfinite(motion).all():
            return Verdict(np.inf, 0.0, 'of the scene itself: not finite')
        above = _above(scene, look(of, motion), motion)
        there = np.isfinite(above) if there is None else there & np.isfinite(above)
        deepest = max(deepest, -float(above[there].min(initial=np.inf)))
        verdicts.append(held.verdict(resolved=False))
    return worst([*verdicts, Verdict(max(deepest, 0.0) / scene.size, 0.0,
                                     'sizes that the inside of a body is beyond')])


def _above(scene: Scene, now, motion: np.ndarray) -> np.ndarray:
    """Return how far above the sheet [m] a point inside of each body is; nan: beside it."""
    spec = scene.spec
    inside = inner_points(spec | {'bodies': [one for one in spec['bodies']
                                             if one['name'] != 'sheet']}, now, motion[:, 3:7])
    if 'ground' in scene.facts:
        ground: Ground = scene.facts['ground']
        points = inside - scene.facts['place']
        height = points[:, 2] - ground.height(points)
        edge = ground.vertices[:, :2]
        inner = ((points[:, :2] > edge.min(axis=0) + EDGE)
                 & (points[:, :2] < edge.max(axis=0) - EDGE)).all(axis=1)
        return np.where(inner, height, np.nan)
    sheet: Sheet = scene.facts['sheet']
    points = (inside - motion[-1, :3]) @ matrix(motion[-1, 3:7])
    inner = (np.abs(points[:, :2]) < HALF_WIDTH - EDGE).all(axis=1)
    return np.where(inner, points[:, 2] + sheet.half_thickness, np.nan)
