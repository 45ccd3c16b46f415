# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Robots of random legs that land on a floor, with dry friction in their joints, and stand."""

import math

from laws.motion import Build, look, masses, Ours, Verdict, worst
from laws.scenes import between, body, G, plane, Scene, Spec
from laws.solids import box, capsule, Generator
import numpy as np

TIME = 4.0  # [s] in which a swing of some Hz dies out by viscous damping and dry friction
DEEP = 1e-3  # of the size, half of what feet yield that are as thick as 0.03 of it
LAST = 20  # steps at the end that are looked at


def draw_standing(rng: Generator) -> Scene:
    """
    Draw a trunk on three to six legs of one to three joints, which falls a little.

    Drives hold the legs, some of which give way where the effort is bounded; limits may be near.
    """
    size, mass = between(rng, 0.01, 1.0), between(rng, 1.0, 50.0)
    legs, links = int(rng.integers(3, 7)), int(rng.integers(1, 4))
    length = 0.8 * size / links
    trunk = box((0.5 * size, 0.4 * size, 0.1 * size))
    bodies, joints = [plane(), body('trunk', trunk, mass, (0.0, 0.0, 0.83 * size))], []
    load = mass * G * length / legs     # [N m] about what a joint bears
    friction = load * between(rng, 0.02, 1.0)
    drive = {'mode': 'position', 'stiffness': load * between(rng, 5.0, 50.0)}
    drive['damping'] = between(rng, 0.1, 0.5) * math.sqrt(size / G) * drive['stiffness']
    share = between(rng, 0.01, 0.1)     # of the mass of the trunk, that of a leg
    for leg in range(legs):
        angle = 2.0 * math.pi * (leg + rng.uniform(-0.2, 0.2)) / legs
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        parent, place = 'trunk', 0.3 * size * out + [0.0, 0.0, 0.83 * size]
        for link in range(links):
            name = f'leg{leg}_{link}'
            way = (0.25 * out - [0.0, 0.0, 1.0]) * length
            bodies.append(_link(name, share * mass / links, place, way, size))
            joints.append(_joint(rng, name, parent, place - _origin(bodies, parent), out, link,
                                 {'friction': friction, 'drive': drive}, load))
            parent, place = name, place + way
    h = float(rng.choice([1e-3, 2e-3, 4e-3, 1.0 / 60.0]))
    spec = {'format': 1,
            'world': {'gravity': [0.0, 0.0, -G], 'step': h},
            'materials': {'default': {'friction': float(rng.choice([0.5, 1.0])),
                                      'restitution': float(rng.choice([0.0, 0.4, 0.8]))}},
            'bodies': bodies, 'joints': joints}
    return Scene(spec, size, math.ceil(TIME / spec['world']['step']))


def _origin(bodies: list[Spec], name: str) -> np.ndarray:
    """Return where the frame of a body is."""
    return np.array(next(one for one in bodies if one['name'] == name)['pose']['position'])


def _link(name: str, mass: float, place: np.ndarray, way: np.ndarray, size: float) -> Spec:
    """Return a link from its joint along a way; its lower end is a ball."""
    long = float(np.linalg.norm(way))
    one = body(name, capsule(0.03 * size, long), mass, place)
    one['inertial']['com'] = (0.5 * way).tolist()
    one['shape'] = {'compound': [{'type': 'sphere', 'radius': 0.03 * size,
                                  'pose': {'position': way.tolist()}}]}
    return one


def _joint(rng: Generator, name: str, parent: str, at: np.ndarray, out: np.ndarray, link: int,
           laws: Spec, load: float) -> Spec:
    """Return a joint that turns about the way out, at a hip at times, or across it."""
    across = np.array([-out[1], out[0], 0.0])
    axis = out if link == 0 and rng.random() < 0.3 else across
    limits = {}
    if rng.random() < 0.3:
        limits |= {'lower': -float(rng.uniform(0.0, 0.2)), 'upper': float(rng.uniform(0.0, 0.2))}
    if rng.random() < 0.3:
        limits['effort'] = load * between(rng, 0.3, 3.0)
    return {'name': name, 'type': 'revolute', 'parent': parent, 'child': name,
            'pose': {'position': at.tolist()}, 'axis': axis.tolist(), **laws,
            **({'limits': limits} if limits else {})}


def judge_standing(scene: Scene, build: Build) -> Verdict:
    """
    Ask whether all is at rest at the end, on the floor, which bears the weight.

    What dry friction holds has stopped: what is left is what the solver leaves, which finds
    impulses to 1e-9 of those of a step under gravity. 1e-6 of the speed of a fall from the height
    of the robot is far above that, and far below what anybody would see. What came to rest has
    not sunk in: where a way is straight to first order it ends within its curvature of the floor.
    """
    run = build(scene.spec)
    assert isinstance(run, Ours)
    of = masses(scene.spec)
    run.step(scene.steps)
    weight, fast, verdicts = G * of.m.sum(), math.sqrt(G * scene.size), []
    for _ in range(LAST):
        run.step(1)
        now = look(of, run.motion())
        speed = np.abs(now.v).max() + scene.size * np.abs(now.w).max()
        verdicts.append(Verdict(speed / fast, 1e-6, 'of the speed of a fall is left'))
        borne = -run.world.contact_wrenches()[0, 2]
        verdicts.append(Verdict(abs(borne / weight - 1.0), 1e-6, 'of the weight is not borne'))
    verdicts.append(Verdict(run.deepest() / scene.size, DEEP, 'of the size is sunk in'))
    return worst(verdicts)
