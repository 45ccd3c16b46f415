# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of the sequential solver: blocks, colours, sweeps."""

from engine.stepping import pyramid, TimestepScene, tower
from engine.touching import about_y, ball, box, ground, Thing
from kernels.own_kernels import of_the_engine
import numpy as np
import pytest

from rigid_sim_ros.engine.constraints.contact_blocks import (
    ARM_A, ARM_B, BALLS_BEGIN, BALLS_SIZE, BASIS, BLOCK_SIZE, FRICTION, IMPULSE, INV_I_A, INV_I_B,
    INV_SPIN, INV_TT, K_NN, K_SPIN, K_TN, NORMAL, POINT, POINT_ROWS, S, SPIN, T)
from rigid_sim_ros.engine.constraints.contact_rules import Sweep
from rigid_sim_ros.engine.model.kinds.table import BOX
from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.solver import contact_sweep
from rigid_sim_ros.engine.solver.coloring import (
    BALLS, begin_blocks, BETWEEN, color_piece, COLORS, first_block, make_blocks, make_coloring,
    make_room, PIECE, QUIET, QUIET_BALLS, REGIONS)
from rigid_sim_ros.engine.solver.contact_sweep import visit
from rigid_sim_ros.engine.solver.solver_bodies import STRIDE
from rigid_sim_ros.engine.state.state import copy_state
from rigid_sim_ros.kernels.eight import EVERY, LANES, lanes_in, store


def colored(pairs, points=4, n=200):
    """Return the colouring of manifolds between bodies, whose slots are their numbers."""
    a, b = np.array(pairs, dtype=np.int64).T
    work, blocks = make_coloring(n, len(pairs)), make_blocks(len(pairs))
    work.kind[0], work.members[0] = min(points - 1, 2), len(pairs)
    work.member[0] = np.arange(len(pairs))
    begin_blocks(0, blocks)
    for begin in range(0, len(pairs), PIECE):
        end = min(begin + PIECE, len(pairs))
        colors = color_piece(0, begin, end, a, b, np.arange(n, dtype=np.int64), work)
        make_room(0, begin, end, colors, work, blocks)
    return work.lane[0], blocks.count[0]


def shared_bodies(pairs) -> int:
    """Return how many blocks hold a moving body twice; body 0 does not move."""
    bad, (lane, count) = 0, colored(pairs)
    for block in range(count):
        rows = [r for r in range(len(pairs)) if lane[r] // LANES == block]
        bodies = [body for r in rows for body in pairs[r] if body != 0]
        bad += len(bodies) != len(set(bodies))
    return bad


def test_no_block_holds_a_moving_body_twice():
    rng = np.random.default_rng(3)
    pairs = [tuple(sorted(rng.choice(100, 2, replace=False))) for _ in range(400)]
    assert shared_bodies(pairs) == 0


def test_manifolds_with_the_ground_share_blocks():
    pairs = [(0, k) for k in range(1, 65)]
    assert colored(pairs)[1] == 8


def test_a_body_with_more_contacts_than_colours_is_solved_one_by_one():
    pairs = [(1, k) for k in range(2, 2 + COLORS + 20)]
    lane, _ = colored(pairs)
    assert shared_bodies(pairs) == 0
    assert len(set(lane.tolist())) == len(pairs)


def test_each_piece_of_many_manifolds_is_coloured_by_itself():
    # A row of touching bodies takes two colours, so the blocks of a piece are full.
    pairs = [(k, k + 1) for k in range(1, 3 * PIECE + 1)]
    lane, count = colored(pairs, n=3 * PIECE + 2)
    assert count == 3 * PIECE // LANES
    blocks = lane // LANES
    per_piece = PIECE // LANES
    for piece in range(3):
        inside = blocks[piece * PIECE:(piece + 1) * PIECE]
        assert set(inside.tolist()) == set(range(piece * per_piece, (piece + 1) * per_piece))
    assert sorted(lane.tolist()) == list(range(3 * PIECE))


def test_blocks_of_a_cut_world_lie_side_by_side():
    side = 12
    # Two layers: enough manifolds for a cut.
    balls = [ball(0.1, 1.0, position=(0.199 * (k % side), 0.199 * (k // side % side),
                                      0.099 + 0.198 * (k // side ** 2)))
             for k in range(2 * side ** 2)]
    scene = TimestepScene([ground(), *balls], Material(friction=0.4), 1 / 240)
    scene.step(3)
    blocks = scene.work.solver.blocks
    assert scene.work.solver.sides.cut.halved[0] == 1 and (blocks.count > 0).all()
    for region in range(REGIONS):
        first = first_block(blocks, region)
        used = range(first, first + blocks.count[region])
        assert set(blocks.kind[used].tolist()) <= {BALLS, QUIET_BALLS}
        begins = blocks.start[used] + BALLS_BEGIN * LANES
        assert (np.diff(begins) == BALLS_SIZE).all()
        assert begins[-1] + BALLS_SIZE == blocks.end[region]
    across = first_block(blocks, BETWEEN)
    assert blocks.start[across] + BALLS_BEGIN * LANES == blocks.end[0]


def axes(rows, lane):
    """Return n, t1 and t2 of a lane."""
    n, k = rows[NORMAL:NORMAL + 3, lane], rows[BASIS, lane]
    sign = 1.0 if n[2] >= 0.0 else -1.0
    t1 = np.array([1.0 + sign * k * n[0] ** 2, sign * k * n[0] * n[1], -sign * n[0]])
    assert abs(t1 @ n) < 1e-14 and abs(t1 @ t1 - 1.0) < 1e-14   # some roundings
    return n, t1, np.cross(n, t1)


def read_twist(rows, lane, blocks, bodies):
    """Return the twist of B relative to A at c as the bodies have it now, N before T."""
    u, w = np.zeros(3), np.zeros(3)
    for at, arm, inertia, sign in ((blocks.at_A, ARM_A, INV_I_A, -1),
                                   (blocks.at_B, ARM_B, INV_I_B, 1)):
        motion = bodies.motion[at[lane]:at[lane] + 6]
        xx, xy, xz, yy, yz, zz = rows[inertia:inertia + 6, lane]
        spin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ motion[3:]
        w += sign * spin
        u += sign * (motion[:3] + np.cross(spin, rows[arm:arm + 3, lane]))
    n, t1, t2 = axes(rows, lane)
    return np.array([u @ n, w @ t1, w @ t2, u @ t1, u @ t2, w @ n])


def read_wrench(rows, lane):
    """Return the sum of the impulses of a lane, N before T."""
    N = np.zeros(3)
    for p in range(4):
        point = rows[POINT + p * POINT_ROWS:POINT + (p + 1) * POINT_ROWS, lane]
        N += point[IMPULSE] * np.array([1.0, point[T], -point[S]])
    return np.concatenate((N, rows[FRICTION:FRICTION + 2, lane], rows[SPIN, lane:lane + 1]))


@of_the_engine(module=contact_sweep)
def visit_four_points(block, motion, blocks, what, changes):
    store(changes, 0, visit(block, motion, blocks.at_A[:LANES], blocks.at_B[:LANES], 3, False,
                            what, lanes_in(EVERY)))


def response(rows, lane):
    """Return the 6 x 6 matrix K of a lane, N before T."""
    upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    K = np.zeros((6, 6))
    for k, (i, j) in enumerate(upper):
        K[i, j] = K[j, i] = rows[K_NN + k, lane]
    a, b, c = rows[INV_TT:INV_TT + 3, lane]
    K[3:5, 3:5] = np.linalg.inv([[a, b], [b, c]])
    K[3:5, 5] = K[5, 3:5] = rows[K_SPIN:K_SPIN + 2, lane]
    K[5, 5] = 1.0 / rows[INV_SPIN, lane]
    K[3:, :3] = rows[K_TN:K_TN + 9, lane].reshape(3, 3)
    K[:3, 3:] = K[3:, :3].T
    return K


def test_the_response_of_a_manifold_is_that_of_its_bodies():
    scene = pyramid(5, 1 / 240)
    scene.step(30)
    blocks, bodies = scene.work.solver.blocks, scene.work.solver.bodies
    rng = np.random.default_rng(0)
    for slot in range(1, bodies.used[0]):
        for k in range(6):
            bodies.motion[slot * STRIDE + k] = rng.normal(0, 1e-2)
    block = blocks.numbers[blocks.start[0]:][:BLOCK_SIZE]
    rows, lanes = block.reshape(-1, LANES), np.nonzero(blocks.row[:LANES] >= 0)[0]
    twist = {lane: read_twist(rows, lane, blocks, bodies) for lane in lanes}
    wrench = {lane: read_wrench(rows, lane) for lane in lanes}
    changes = np.zeros(LANES)
    visit_four_points(block, bodies.motion, blocks, Sweep(960.0, True, 0.0), changes)
    assert (changes[lanes] > 1e-6).all()    # m/s
    for lane in lanes:
        added = read_wrench(rows, lane) - wrench[lane]
        assert np.abs(added).max() > 1e-6       # N s
        foreseen = twist[lane] + response(rows, lane) @ added
        # Rounding of 0.1 m/s.
        assert read_twist(rows, lane, blocks, bodies) == pytest.approx(foreseen, abs=1e-14)


@pytest.mark.parametrize('last', [False, True], ids=['fixed is A', 'fixed is B'])
def test_what_moves_on_a_fixed_body_does_so_wherever_that_is(last):
    """The arms of both bodies begin at the common point, also where one of them has no slot."""
    def moved_by_then(where):
        def at(*place):
            return where + np.array(place)

        table = Thing(BOX, (2.0, 2.0, 0.1), position=at(0.0, 0.0, -0.1))
        things = [ball(0.1, 1.0, position=at(-0.5, 0.0, 0.1), velocity=(1.0, 0.2, 0.0),
                       spin=(0.0, 5.0, 3.0)),
                  box((0.2, 0.1, 0.1), 2.0, position=at(0.3, 0.3, 0.05),
                      velocity=(0.5, 0.3, 0.0), spin=(0.0, 0.0, 4.0)),
                  box((0.1, 0.1, 0.1), 1.0, position=at(-0.3, -0.5, 0.1),
                      orientation=about_y(0.3))]
        scene = TimestepScene([*things, table] if last else [table, *things],
                              Material(friction=0.4), 1 / 240)
        scene.step(60)
        which = slice(0, 3) if last else slice(1, 4)
        return np.vstack((scene.state.x[:, which] - where[:, None], scene.state.q[:, which],
                          scene.state.P[:, which], scene.state.L[:, which]))

    here, there = moved_by_then(np.zeros(3)), moved_by_then(np.array([3.0, -2.0, 1.0]))
    assert np.abs(here[:3]).max() > 0.3     # m
    # Places round to 4e-16 m there, gaps over a substep of 1 ms to 4e-13 m/s; a corner that falls
    # lets that grow by a thousand.
    assert there == pytest.approx(here, abs=1e-9)


def test_the_residual_goes_to_rounding_at_rest():
    scene = tower(5, 1 / 240)
    scene.step(600)
    assert scene.work.solver.residual[0] < 1e-12


def heap_of_balls(material):
    rng = np.random.default_rng(4)
    balls = [ball(rng.uniform(0.06, 0.1), rng.uniform(1.0, 5.0), spin=rng.normal(0, 5, 3),
                  position=(0.17 * (k % 4), 0.17 * (k // 4 % 4), 0.1 + 0.19 * (k // 16)))
             for k in range(64)]
    scene = TimestepScene([ground(), *balls], material, 1 / 240)
    scene.step(60)
    return scene


def test_balls_that_resist_spinning_have_the_blocks_of_any_shape():
    blocks = heap_of_balls(Material(friction=0.4, spinning=1e-3)).work.solver.blocks
    assert set(blocks.kind[:blocks.count[0]].tolist()) <= {0, QUIET}


def test_balls_move_as_they_do_in_blocks_for_any_shape():
    scene = heap_of_balls(Material(friction=0.4))
    other = scene.twin()
    other.work.round_shapes[:] = 0
    before = copy_state(scene.state)
    scene.step()
    other.step()
    kinds, others = (set(s.work.solver.blocks.kind[:20].tolist()) for s in (scene, other))
    assert BALLS in kinds and kinds.isdisjoint({0, QUIET})
    assert others == {0, QUIET}
    changed = np.abs(scene.state.L - before.L).max()
    assert changed > 1e-3       # kg m^2/s: friction acts
    for one, same in zip(scene.state, other.state, strict=True):
        # Rounding of 10 kg m/s, times the 60 visits that a block gets in a step.
        assert one == pytest.approx(same, rel=0, abs=1e-13)
