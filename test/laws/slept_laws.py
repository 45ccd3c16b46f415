# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What must hold of articulations and loose bodies that came to rest and sleep."""

import copy

from laws.jointed_scenes import FALLING, HUNG_ABOVE_A_FLOOR, ONE_AXIS
from laws.mixed_laws import apart
from laws.mixed_scenes import draw_mixed
from laws.motion import Build, masses, Ours, Verdict, worst
from laws.scenes import Scene, Spec, with_model
from laws.solids import Generator
import numpy as np

SLOW = 0.01  # [m/s] what is slower may be at rest, see sleeping.py
TIME = 3.0  # [s] in which most come to rest
LOOK = 10  # steps between two looks
WATCHED = 0.04  # [s] for which worlds are compared after they woke, 4 steps at least
MOST_STEPS = 1500  # of five worlds that are compared
MOMENTS = 3  # at which a scene is judged, at most


def draw_slept(rng: Generator) -> Scene:
    """Draw bodies that come to rest: nothing bounces, and most joints damp."""
    while True:
        scene = draw_mixed(rng, (FALLING, FALLING, HUNG_ABOVE_A_FLOOR), sleeps=False)
        if scene.h < 1e-3 or any(one.get('kinematic') for one in scene.spec['bodies']):
            continue
        spec = _damped(scene.spec, float(rng.uniform(0.5, 2.0)))
        for material in spec['materials'].values():
            material |= {'restitution': 0.0, 'friction': max(0.5, material['friction'])}
        for one in spec['bodies']:
            one.pop('twist', None)
        spec['collision'] = {'sleep_after': 2.0 * scene.h + float(rng.uniform(0.03, 0.2))}
        return scene._replace(spec=spec, steps=int(TIME / scene.h),
                              facts=scene.facts | {'push': rng.normal(size=3).tolist()})


def _damped(spec: Spec, damping: float) -> Spec:
    """Return a scene all of whose joints damp, if it has no loops, else those that may."""
    from rigid_sim_ros.scene.errors import SceneError

    damped = copy.deepcopy(spec)
    for joint in damped['joints']:
        if joint['type'] in ONE_AXIS or joint['type'] in ('spherical', 'universal'):
            joint['damping'] = joint.get('damping', 0.0) + damping
    try:
        Ours(with_model(damped, 'timestep'))
    except SceneError:
        return copy.deepcopy(spec)
    return damped


def draw_slept_apart(rng: Generator) -> Scene:
    """Draw bodies that come to rest, the loose ones far away from the articulations."""
    scene = draw_slept(rng)
    return scene._replace(spec=apart(scene), steps=min(scene.steps, MOST_STEPS))


def judge_slept(scene: Scene, build: Build) -> Verdict:
    """Judge a world each time that more of its bodies sleep than before."""
    run, before, verdicts, moments = build(scene.spec), 0, [Verdict(0.0, 1.0, 'of nothing')], 0
    assert isinstance(run, Ours)
    for _ in range(0, scene.steps, LOOK):
        now = run.world.contact_report().asleep
        if now > before and moments < MOMENTS:
            found, wanted = _judge_now(scene, run, build)
            run.step(LOOK)
            differs = float(run.world.state_hash() != wanted)
            verdicts += [*found, Verdict(differs, 0.0, 'another hash than from what was saved')]
            moments += 1
        else:
            run.step(LOOK)
        before = now
    return worst(verdicts)


def _judge_now(scene: Scene, run: Ours, build: Build) -> tuple[list[Verdict], int]:
    """
    Ask whether who sleeps is held, wakes, and goes on as if it had not slept.

    Returns with it the hash that the world should have after a look.
    """
    world, spec = run.world, scene.spec
    saved, moving = world.save(), [one['name'] for one in spec['bodies'] if 'inertial' in one]
    still, restored, threaded, awake = twins = [build(spec) for _ in range(4)]
    for twin in twins:
        assert isinstance(twin, Ours)
        twin.world.restore(saved)
    still.step(1)
    first, felt = still.motion(), _felt(still)
    still.step(LOOK - 1)
    slept = [name for name in moving if (
        still.motion() == first)[world.names.index(name)].all()]
    verdicts = []
    if world.contact_report().asleep == still.world.contact_report().asleep == len(moving):
        verdicts += [Verdict(float(len(moving) - len(slept)), 0.0, 'sleepers that moved'),
                     Verdict(_differ(felt, _felt(still)), 0.0, 'difference of what they feel'),
                     _judge_weight(scene, still)]
    threaded.world.threads = 2
    steps = max(4, int(WATCHED / scene.h))
    for twin in (restored, threaded, awake):
        _push(scene, twin, slept or moving)
    for name in moving:
        # A wrench of nothing lets a body begin to rest anew in each step.
        awake.world.apply_wrench(name, duration=(steps + 1) * scene.h)
    different = 0
    for _ in range(steps):
        for twin in (restored, threaded, awake):
            twin.step(1)
        different += restored.world.state_hash() != threaded.world.state_hash()
    verdicts.append(Verdict(float(different), 0.0, 'different hashes'))
    # As they fell asleep all were slower than SLOW, and so they go on where nothing sleeps but for
    # what accelerates them; what should have woken and did not would be off by the push.
    off = np.abs(restored.motion() - awake.motion())[:, :3].max()
    verdicts.append(Verdict(float(off), 10.0 * SLOW * steps * scene.h, 'm off what is awake'))
    return verdicts, still.world.state_hash()


def _push(scene: Scene, run: Ours, names: list[str]) -> None:
    """Give one of the bodies 0.5 m/s or so."""
    name = names[scene.facts['seed'] % len(names)]
    m = masses(scene.spec).m[run.world.names.index(name)]
    run.world.apply_impulse(name, 0.3 * m * np.array(scene.facts['push']))


def _felt(run: Ours) -> list[np.ndarray]:
    world = run.world
    return [world.joint_effort, world.contact_wrenches(),
            *(world.joint_wrench(name) for name in world.joint_names)]


def _differ(one: list[np.ndarray], other: list[np.ndarray]) -> float:
    return max(float(np.abs(a - b).max(initial=0.0)) for a, b in zip(one, other, strict=True))


def _judge_weight(scene: Scene, run: Ours) -> Verdict:
    """
    Compare the force on the floor with the weight of all, if nothing hangs on the world.

    Who is slower than SLOW for a time T of 0.03 s at least is accelerated by 2 SLOW / T in the
    mean of it, 0.07 g at most.
    """
    spec = scene.spec
    hangs = any('world' in (one['parent'], one['child']) for one in spec['joints']) or any(
        'world' in (one['a'], one['b']) for one in spec.get('forces', ()))
    weight = masses(spec).m.sum() * 9.81
    floor = next(one['name'] for one in spec['bodies'] if one['shape']['type'] == 'plane')
    lacks = 0.0 if hangs else abs(run.force_on(floor)[2] + weight) / weight
    return Verdict(lacks, 0.2, 'of the weight that the floor does not bear')
