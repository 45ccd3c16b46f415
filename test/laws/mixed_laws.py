# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a floor gives, and what must not differ by a bit, where articulations are among others."""

import copy

from laws.jointed_scenes import FALLING, HUNG, HUNG_ABOVE_A_FLOOR
from laws.mixed_scenes import draw_mixed, loose_bodies
from laws.motion import Build, look, masses, Ours, Verdict, worst
from laws.scenes import Scene, Spec
from laws.solids import Generator
import numpy as np

FAR = 100.0  # [m] between what must not touch


def judge_ground(scene: Scene, build: Build) -> Verdict:
    """
    Compare in each step the force on the floor with what the momentum of all bodies tells.

    Nothing but gravity and the floor acts from outside: P grows by h (m g - F), F what the floor
    is told to feel, and at rest F is the weight. To rounding, 1e-15 of the momenta of the step for
    each of some hundred contacts, and of what an overlap that is pushed apart adds and takes back.
    """
    spec, of, h = scene.spec, masses(scene.spec), scene.h
    run, verdicts = build(spec), []
    floor = next(one['name'] for one in spec['bodies'] if one['shape']['type'] == 'plane')
    weight = of.m.sum() * np.asarray(spec['world']['gravity'])
    before = look(of, run.motion())
    for _ in range(scene.steps):
        run.step(1)
        now = look(of, run.motion())
        force = run.force_on(floor)
        gained = (now.P - before.P).sum(axis=0) - h * (weight - force)
        scale = (np.abs(now.P).sum() + np.abs(before.P).sum()
                 + h * (np.abs(force).sum() + np.abs(weight).sum()))
        verdicts.append(Verdict(float(np.abs(gained).max()) / scale, 1e-11,
                                'share of the momentum that the floor did not give'))
        before = now
    return worst(verdicts)


def draw_apart(rng: Generator) -> Scene:
    """Draw an articulation, and what never touches it, a hundred metres away."""
    scene = draw_mixed(rng, (FALLING, HUNG, HUNG_ABOVE_A_FLOOR))
    return scene._replace(spec=apart(scene))


def apart(scene: Scene) -> Spec:
    """Return a scene whose loose bodies are far away from all others, and not tied to them."""
    loose = scene.facts['loose']
    for one in scene.spec['bodies']:
        if one['name'] in loose:
            one['pose']['position'][0] += FAR
    return scene.spec | {'forces': [force for force in scene.spec.get('forces', ())
                                    if {force['a'], force['b']} <= set(loose)]}


def only(spec: Spec, loose: bool) -> Spec:
    """Return a scene with its loose bodies or with the others, and with what nothing pushes."""
    names = loose_bodies(spec)
    found = spec | {'bodies': [one for one in spec['bodies'] if 'inertial' not in one
                               or (one['name'] in names) == loose]}
    return found | ({'joints': []} if loose else {'forces': []})


def judge_apart(scene: Scene, build: Build) -> Verdict:
    """
    Compare the loose bodies with a world without joints, the others with one without them.

    What touches nothing of the other is solved as if it were alone: not a bit may differ. In the
    middle one of the worlds loses the articulation, one gets the loose bodies as they are then;
    what was there goes on as it would have.
    """
    spec, names = scene.spec, scene.facts['loose']
    both, fewer, loose, others, more = (build(one) for one in (
        spec, spec, only(spec, True), only(spec, False), only(spec, False)))
    assert isinstance(fewer, Ours) and isinstance(more, Ours)
    pairs = [(both, loose, 'beside joints'), (both, others, 'beside loose bodies')]
    verdicts = []
    for k in range(0, scene.steps, 10):
        for run in (both, fewer, loose, others, more):
            run.step(10)
        verdicts += [_apart(*pair) for pair in pairs]
        if k == scene.steps // 20 * 10:
            for one in spec['bodies']:
                if 'inertial' in one and one['name'] not in names:
                    fewer.world.remove(one['name'])
            more.world.add(as_now(loose, spec, names))
            pairs += [(fewer, loose, 'where an articulation went'),
                      (more, others, 'where loose bodies came')]
    return worst(verdicts)


def as_now(run: Ours, spec: Spec, names: list[str]) -> Spec:
    """Return bodies of a scene that begin as they are now, as a part that comes."""
    bodies = [copy.deepcopy(one) for one in spec['bodies'] if one['name'] in names]
    motion = dict(zip(run.world.names, run.motion(), strict=True))
    for one in bodies:
        p, q, v, w = np.split(motion[one['name']], [3, 7, 10])
        one['pose'] = {'position': p.tolist(), 'orientation': q.tolist()}
        one['twist'] = {'linear': v.tolist(), 'angular': w.tolist()}
    return {'bodies': bodies}


def _apart(one: Ours, other: Ours, what: str) -> Verdict:
    """Return the largest difference of the motions of those bodies that both worlds have."""
    names = [name for name in one.world.names if name in other.world.names]
    found, wanted = (run.motion()[[run.world.names.index(name) for name in names]]
                     for run in (one, other))
    return Verdict(float(np.abs(found - wanted).max()), 0.0, f'difference, SI units, {what}')


def judge_restored(scene: Scene, build: Build) -> Verdict:
    """
    Compare worlds that go on from what one saved in the middle, bit for bit.

    A new world, one that was elsewhere, and one with two threads; and one in which the last loose
    body came before the first step.
    """
    last = scene.facts['loose'][-1]
    late = only_without(scene.spec, last)
    runs = [build(scene.spec) for _ in range(3)] + ([build(late)] if late else [])
    assert all(isinstance(run, Ours) for run in runs)
    one, *others = (run.world for run in runs)
    if late:
        others[2].add(next(body for body in scene.spec['bodies'] if body['name'] == last))
        others[2].step(scene.steps // 2)
    others[1].threads = 2
    others[1].step(scene.steps // 4)
    one.step(scene.steps // 2)
    saved = one.save()
    for other in others[:2]:
        other.restore(saved)
    different = 0
    for k in range(10):
        different += sum(other.state_hash() != one.state_hash() for other in others)
        for world in (one, *others):
            world.step(1 + k)
    return Verdict(float(different), 0.0, 'different hashes')


def only_without(spec: Spec, name: str) -> Spec | None:
    """Return a scene without a body, if it is the last one and no force is on it."""
    if spec['bodies'][-1]['name'] != name or any(
            name in (force['a'], force['b']) for force in spec.get('forces', ())):
        return None
    return spec | {'bodies': spec['bodies'][:-1]}


def draw_asleep(rng: Generator) -> Scene:
    """Draw bodies that lie and sleep on a floor before an articulation falls on them."""
    while True:
        scene = draw_mixed(rng, (FALLING,))
        lie = [name for name in scene.facts['loose'] if _is_at_rest(scene.spec, name)]
        if scene.h < 1e-3 or not lie:
            continue
        for one in scene.spec['bodies']:
            if 'inertial' in one and one['name'] not in lie:
                one['twist']['linear'][2] -= 3.0    # it lands within 0.4 s
        scene.spec['collision'] = {'sleep_after': 2.0 * scene.h + float(rng.uniform(0, 0.05))}
        return scene


def _is_at_rest(spec: Spec, name: str) -> bool:
    one = next(one for one in spec['bodies'] if one['name'] == name)
    return not np.any([one['twist']['linear'], one['twist']['angular']])


def judge_asleep(scene: Scene, build: Build) -> Verdict:
    """
    Ask of each loose body that stays where it is whether it is held, and of all whether they sink.

    What has not moved by a bit for 20 steps sleeps. As it fell asleep it was slower than 0.01 m/s
    for 2 steps at least, so that what did not hold it was small: the floor and the others give
    half of its weight, if no spring does. What wakes too late sinks in: a hundredth of the size of
    the bodies more than where nothing sleeps is what a step at 10 m/s and 1 ms would do.
    """
    spec = scene.spec
    run, awake = build(spec), build(spec | {'collision': {}})
    assert isinstance(run, Ours)
    of, names = masses(spec), run.world.names
    hung = {force[end] for force in spec.get('forces', ()) for end in 'ab'}
    before, still, verdicts, deepest = run.motion(), np.zeros(len(names)), [], 0.0
    for _ in range(scene.steps):
        run.step(1)
        awake.step(1)
        now = run.motion()
        still = np.where((now == before).all(axis=1), still + 1, 0)
        before = now
        wrenches = run.world.contact_wrenches()
        for name in set(scene.facts['loose']) - hung:
            k = names.index(name)
            if still[k] >= 20:
                lacks = max(0.0, 1.0 - wrenches[k, 2] / of.m[k] / 9.81)
                verdicts.append(Verdict(lacks, 0.5, 'of its weight that nothing bears'))
        deepest = max(deepest, awake.deepest())
        verdicts.append(Verdict(run.deepest(), deepest + 0.01 * scene.size, 'm of overlap'))
    return worst(verdicts)
