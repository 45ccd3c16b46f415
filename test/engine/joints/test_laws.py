# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Laws that hold for joints of all types in random trees."""

import copy

from engine.jointed import body, energy, joint, rod, world
from engine.jointed_trees import gaps, mirrored, random_tree, scaled, shuffled
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_sim_ros import World

SEEDS = range(8)
STEPS = 100


def positions(world):
    """Return the positions of the bodies, (n, 3) [m], sorted by their names."""
    return world.position[np.argsort(world.names)]


def run(spec, steps=STEPS):
    world = World.from_dict(spec)
    world.step(steps)
    return world


@pytest.mark.parametrize('seed', SEEDS)
def test_joints_stay_closed_in_every_step(seed):
    world = World.from_dict(random_tree(np.random.default_rng(seed)))
    assert gaps(world) < 1e-14 * 10     # where the scene puts the bodies: rounding
    for _ in range(STEPS):
        world.step()
        # Closed to 1e-13 in each number, and rounding of some 1e-15 a metre.
        assert gaps(world) < 1e-12


@pytest.mark.parametrize('seed', SEEDS)
def test_the_motion_is_of_second_order(seed):
    spec = random_tree(np.random.default_rng(seed))
    found = []
    for part in (1, 2, 4):
        other = copy.deepcopy(spec)
        other['world']['step'] = 1e-3 / part
        found.append(positions(run(other, STEPS * part)))
    coarse, fine = found[0] - found[1], found[1] - found[2]
    # (1 - 1/4) / (1/4 - 1/16) = 4; terms of the fourth order are below a hundredth of those of the
    # second at 1 ms, and rounding far below.
    assert np.abs(coarse).max() / np.abs(fine).max() == pytest.approx(4.0, rel=1e-2)


@pytest.mark.parametrize('seed', SEEDS)
def test_energy_keeps_without_drives(seed):
    spec = random_tree(np.random.default_rng(seed))
    off = []
    for part in (1, 2):
        other = copy.deepcopy(spec)
        other['world']['step'] = 1e-3 / part
        world = World.from_dict(other)
        before, largest = energy(world), 0.0
        for _ in range(STEPS):
            world.step(part)
            largest = max(largest, abs(energy(world) - before))
        off.append(largest)
    # The method has an energy of its own, which it keeps, and which is off by the order of h^2.
    assert off[0] < 1e-4 * max(1.0, world.kinetic_energy())
    assert off[0] / off[1] == pytest.approx(4.0, rel=2e-2)


@pytest.mark.parametrize('seed', SEEDS)
def test_momentum_keeps_where_nothing_holds_the_tree(seed):
    world = World.from_dict(random_tree(np.random.default_rng(seed), on_world=False,
                                        gravity=(0, 0, 0)))
    P, L = world.total_momentum(), world.total_angular_momentum()
    size = np.abs(world.angular_momentum).sum() + np.abs(world.linear_momentum).sum()
    world.step(STEPS)
    # Impulses of joints come in pairs at one point; the pair is apart by the 1e-13 m to which the
    # joint is closed, and each of 100 steps rounds.
    assert np.abs(world.total_momentum() - P).max() < 1e-12 * max(1.0, size)
    assert np.abs(world.total_angular_momentum() - L).max() < 1e-12 * max(1.0, size)


@pytest.mark.parametrize('seed', SEEDS)
def test_the_order_of_bodies_and_joints_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    spec = random_tree(rng, on_world=seed % 2 == 0)
    one, other = run(spec), run(shuffled(rng, spec))
    # The same equations in another order; 1e-13 a step in the poses, which do not grow in 0.1 s.
    np.testing.assert_allclose(positions(other), positions(one), rtol=0, atol=1e-10)


@pytest.mark.parametrize('seed', SEEDS)
def test_a_mirror_shows_the_motion_of_the_mirrored_scene(seed):
    spec = random_tree(np.random.default_rng(seed), on_world=seed % 2 == 0)
    np.testing.assert_allclose(positions(run(mirrored(spec))), positions(run(spec)) * [1, -1, 1],
                               rtol=0, atol=1e-10)


@pytest.mark.parametrize('seed', SEEDS)
def test_a_scene_of_four_times_the_size_moves_in_twice_the_time(seed):
    spec = random_tree(np.random.default_rng(seed), on_world=seed % 2 == 0)
    np.testing.assert_allclose(positions(run(scaled(spec, 4.0))), 4.0 * positions(run(spec)),
                               rtol=0, atol=1e-9)


def test_two_halves_in_a_fixed_joint_are_one_body():
    # A rod of 1 m, and its halves; thrown and turned about no principal axis.
    turn = Rotation.from_rotvec([0.2, 0.5, -0.3])
    twist = {'linear': [0.3, 0.1, 2.0], 'angular': [1.0, 2.0, 5.0]}
    halves = []
    for side in (-1, 1):
        x = turn.apply([0, 0, 0.25 * side])
        halves.append(body(f'half{(side + 1) // 2}', 0.5, inertia=rod(0.5, 0.5, 0.05),
                           position=x.tolist(), orientation=turn.as_quat().tolist(), twist={
                               'linear': (np.array(twist['linear']) + np.cross(
                                   twist['angular'], x)).tolist(), 'angular': twist['angular']}))
    one = [body('rod', 1.0, inertia=rod(1.0, 1.0, 0.05), orientation=turn.as_quat().tolist(),
                twist=twist)]
    off = []
    for h in (1e-3, 5e-4):
        whole = World.from_dict({'world': {'contact': 'none', 'step': h}, 'bodies': one})
        split = world(halves, [joint('weld', 'half0', 'half1', 'fixed')], h)
        for both in (whole, split):
            both.step(round(1.0 / h))
        off.append(np.abs(split.position.mean(axis=0) - whole.position[0]).max())
        off.append(np.abs(Rotation.from_quat(split.orientation[0]).as_matrix()
                          - Rotation.from_quat(whole.orientation[0]).as_matrix()).max())
    # The centre falls exactly; the attitude of the halves is of second order, (h w)^2 w t / 24.
    assert max(off[0], off[2]) < 1e-11
    assert off[1] < 1e-6 * 30 * 5.5 / 24 * 4
    assert off[1] / off[3] == pytest.approx(4.0, rel=1e-2)
