# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The number of threads changes no bit of what a world does."""

import time
from typing import Any

from dropping import SHAPES
from inside import contact_of, helper_of, memory_of, solver_of
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World
from rigid_sim_ros.engine.detection.manifolds import current_manifolds, slice_in_use
from rigid_sim_ros.kernels.helper_process import cores
from rigid_sim_ros.world.snapshot import pack, unpack

# [s] until the helper must have done so much; on a busy machine it seldom has a core.
LONGEST, SOME = 180.0, 50


def crowd(kinds: list[str], restitution: float = 0.0, spacing: float = 0.2,
          **collision: Any) -> World:
    """Return 300 bodies that fall onto the ground and each other; at 0.2 m they overlap."""
    rng = np.random.default_rng(5)
    bodies = []
    for k in range(300):
        q, shape = rng.normal(size=4), SHAPES[kinds[k % len(kinds)]]
        place = spacing * np.array([k % 8 - 3.5, k // 8 % 8 - 3.5, k // 64 + 0.6])
        bodies.append({
            'name': f'b{k}', 'density': 500.0,
            **(shape if 'compound' in shape else {'shape': shape}),
            'pose': {'position': (place + rng.uniform(-0.01, 0.01, 3)).tolist(),
                     'orientation': (q / np.linalg.norm(q)).tolist()},
            'twist': {'linear': rng.normal(0, 0.3, 3).tolist()}})
    surface = {'friction': 0.4, 'restitution': restitution}
    return World.from_dict({
        'format': 1, 'world': {'contact': 'timestep', 'step': 1 / 240},
        'collision': collision, 'materials': {'default': surface},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}, *bodies]})


@pytest.mark.parametrize('kinds, more', [
    (['sphere'], {}), (['box'], {}), (sorted(SHAPES), {'sleep_after': 0.1}),
    (['sphere', 'box', 'capsule'], {'restitution': 0.1, 'spacing': 0.3})])
@pytest.mark.skipif(cores() < 2, reason='a second thread needs a second core')
def test_two_threads_give_the_hash_of_one_at_every_step(kinds, more):
    one, two = crowd(kinds, **more), crowd(kinds, **more)
    two.threads = 2
    helper, begun, steps, start = helper_of(two), time.monotonic(), 0, one.save()
    # The helper compiles its part first. Bodies that have parted meanwhile would have no halves.
    while steps < 40 or (helper.done < SOME and time.monotonic() - begun < LONGEST):
        if steps % 40 == 0:
            one.restore(start)
            two.restore(start)
        one.step()
        two.step()
        steps += 1
        assert one.state_hash() == two.state_hash(), f'step {steps}'
        assert has_halves(two) or steps % 40 < 5    # which meet nobody yet
    assert helper.done >= SOME
    # Who wakes up in a step helps with the next ones from their beginning: the rows of manifolds
    # then lie elsewhere in their page.
    rows = slice(0, 0)
    while rows.start == 0 and time.monotonic() - begun < 2 * LONGEST:
        one.step(10)
        two.step(10)
        rows = slice_in_use(current_manifolds(memory_of(two)))
    assert rows.start > 0
    assert one.contacts().tobytes() == two.contacts().tobytes()
    assert one.contact_report() == two.contact_report()
    assert one.save() == two.save()


def test_a_world_that_is_no_longer_cut_forgets_its_halves():
    # Balls that meet roughly, until most of them are taken away.
    rng = np.random.default_rng(6)
    places = np.stack(np.indices((8, 8, 6)), -1).reshape(-1, 3) - 3.5
    balls = [{'name': f'b{k}', 'shape': SHAPES['sphere'], 'density': 500.0,
              'pose': {'position': (0.3 * place).tolist()},
              'twist': {'linear': (rng.normal(0, 1.0, 3) - 2.0 * place).tolist()}}
             for k, place in enumerate(places)]
    scene = {'format': 1, 'bodies': balls, 'world': {
        'contact': 'timestep', 'step': 1 / 240, 'gravity': [0, 0, 0]}}
    world = World.from_dict(scene)
    world.step(3)
    assert solver_of(world).blocks.count.all()
    for k in range(100, len(balls)):
        world.set_pose(f'b{k}', (10.0 * k, 0, 0), (0, 0, 0, 1))
    fresh = World.from_dict(scene)
    fresh.restore(world.save())
    # Whether a step has halves follows from the manifolds of the one before.
    for halves in (2, 1):
        world.step()
        fresh.step()
        assert solver_of(world).sides.cut.halved[0] == halves - 1
        assert world.state_hash() == fresh.state_hash()
        assert contact_of(world).report() == contact_of(fresh).report()
    # What is left there would be visited when an impact is calmed.
    assert solver_of(world).blocks.count.tolist()[1:] == [0, 0]
    assert not solver_of(world).notes[1:].any()


def mixed(world: World) -> World:
    """Let bodies change places until their numbers say nothing about these."""
    places, turns = world.position, world.orientation
    bodies = np.flatnonzero(world.mass > 0.0)
    for body, other in zip(bodies, np.random.default_rng(7).permutation(bodies), strict=True):
        world.set_pose(world.names[body], places[other], turns[other])
    return world


def has_halves(world: World) -> bool:
    """Return whether the last step had halves."""
    return bool(solver_of(world).sides.cut.halved[0] == 1)


def cut_by_place(world: World) -> bool | None:
    """Return whether a plane cuts a world, and not the numbers of the bodies; None: nothing."""
    cut = solver_of(world).sides.cut
    return bool(cut.by_place[0]) if has_halves(world) else None


@pytest.mark.parametrize('sleep_after', [0.0, 0.1])
def test_bodies_that_have_mixed_are_cut_by_a_plane(sleep_after):
    one, two = (mixed(crowd(['sphere', 'box'], sleep_after=sleep_after)) for _ in range(2))
    two.threads = 2
    assert cut_by_place(one) is None
    one.step(20)
    two.step(20)
    assert cut_by_place(one) is cut_by_place(two) is True
    for _ in range(60):
        one.step()
        two.step()
        assert one.state_hash() == two.state_hash()
    # Neither half has all of them.
    counts = solver_of(one).blocks.count[:2]
    assert min(counts) > 0.3 * max(counts)


@pytest.mark.parametrize('by_place', [False, True])
def test_a_world_is_restored_with_its_halves(by_place):
    world = crowd(['sphere'])
    if by_place:
        mixed(world)
    world.step(60)  # at first the cut of those that did not mix is now one, now the other
    saved, hashes = [], []
    for _ in range(40):     # twice as long as a cut stays
        world.step()
        assert cut_by_place(world) == by_place
        saved.append(world.save())
        hashes.append(world.state_hash())
    fresh = crowd(['sphere'])
    for before, after in zip(saved[:20:3], hashes[20::3], strict=True):
        fresh.step()    # it was elsewhere
        fresh.restore(before)
        fresh.step(20)
        assert fresh.state_hash() == after


def test_a_world_saved_without_halves_is_refused_and_nothing_changes():
    world = crowd(['sphere'])
    world.step(40)
    meta, arrays = unpack(world.save())
    before = pack(meta, {k: v for k, v in arrays.items() if not k.startswith('cut_')})
    world.step(5)
    after = world.state_hash()
    with pytest.raises(ValueError, match="lacks an array 'cut_"):
        world.restore(before)
    assert world.state_hash() == after


def test_halves_stay_when_a_world_needs_more_room():
    # Balls that the walls push together: the number of manifolds grows.
    places = np.stack(np.indices((8, 8, 10)), -1).reshape(-1, 3) - (3.5, 3.5, -0.6)
    walls = [{'name': f'wall{k}', 'fixed': True,
              'shape': {'type': 'plane', 'normal': normal, 'offset': offset}}
             for k, (normal, offset) in enumerate([
                 ((0, 0, 1), 0.0), ((1, 0, 0), -0.9), ((-1, 0, 0), -0.9), ((0, 1, 0), -0.9),
                 ((0, -1, 0), -0.9)])]
    world = World.from_dict({
        'format': 1, 'world': {'contact': 'timestep', 'step': 1 / 240},
        'bodies': walls + [{'name': f'b{k}', 'shape': {'type': 'sphere', 'radius': 0.1},
                            'mass': 1.0, 'pose': {'position': (0.26 * place).tolist()}}
                           for k, place in enumerate(places)]})
    world.step()
    grown_when_halved = 0
    for _ in range(400):
        rows = len(memory_of(world).pages[0].shape_a)
        left = int(solver_of(world).sides.cut.left[0])
        world.step()
        if left > 0:
            # As if nothing had happened: who is restored may have the room already.
            assert solver_of(world).sides.cut.left[0] == left - 1
            grown_when_halved += len(memory_of(world).pages[0].shape_a) > rows
    assert grown_when_halved > 0


def test_a_world_may_change_its_mind_about_threads():
    one, other = crowd(['sphere']), crowd(['sphere'])
    for threads in (1, 2, 2, 1, 2):
        other.threads = threads
        one.step(20)
        other.step(20)
        assert other.threads == threads
        assert one.state_hash() == other.state_hash()


@pytest.mark.parametrize('threads', [0, -1, 1.5, True, '2', None])
def test_wrong_numbers_of_threads_are_refused(threads):
    world = load_scene('tower')
    with pytest.raises(ValueError, match='must be a whole number > 0'):
        world.threads = threads
    assert world.threads == 1
