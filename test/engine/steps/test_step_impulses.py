# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the sequential solver says that acted in a step, and what it leaves out on its way back."""

from engine.stepping import pyramid, TimestepScene
from engine.touching import ball, box, G, ground
from kernels.own_kernels import of_the_engine
import numpy as np
import pytest

from rigid_sim_ros.engine.constraints.contact_blocks import (
    BLOCK_SIZE, GAP, POINT, POINT_ROWS, SIZE)
from rigid_sim_ros.engine.constraints.contact_rules import NEGLIGIBLE, SETTLED, Sweep
from rigid_sim_ros.engine.detection.manifolds import latest_impulses, slice_in_use
from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.solver import contact_sweep
from rigid_sim_ros.engine.solver.arguments import SequentialSettings, TimestepSettings
from rigid_sim_ros.engine.solver.coloring import CHANGED, first_block, OVERLAPPING
from rigid_sim_ros.engine.solver.contact_sweep import note_left
from rigid_sim_ros.engine.solver.solver_bodies import (
    begin_push, begin_push_astride, begin_push_inside, drift_bodies, INV_M, kick_bodies,
    mark_astride, STRIDE, TOUCHED)
from rigid_sim_ros.kernels.eight import LANES, load


def impulses_on_bodies(scene):
    """Return the sum of all impulses of contacts in the last step on each body [N s]."""
    manifolds, acted = scene.manifolds(), latest_impulses(scene.memory)
    total = np.zeros((len(scene.model.m), 3))
    rows = slice_in_use(manifolds)
    for r in range(rows.start, rows.stop):
        J = (acted.normal[:manifolds.points[r], r].sum() * manifolds.normal[r]
             + acted.friction[r])
        total[manifolds.body_b[r]] += J
        total[manifolds.body_a[r]] -= J
    return total


@pytest.mark.parametrize('restitution', [0.0, 0.5], ids=['dead', 'bouncing'])
@pytest.mark.parametrize('substeps', [1, 2, 4])
def test_the_impulses_of_every_step_are_what_changed_the_momenta(substeps, restitution):
    settings = TimestepSettings(sequential=SequentialSettings(substeps=substeps))
    things = [ground(), ball(0.1, 1.0, position=(0.0, 0.0, 0.12), velocity=(1.0, 0.0, -2.0)),
              ball(0.1, 2.0, position=(0.21, 0.0, 0.12), spin=(0.0, 20.0, 5.0)),
              box((0.2, 0.2, 0.1), 3.0, position=(0.9, 0.1, 0.11), velocity=(-1.0, 0.0, -1.0)),
              box((0.2, 0.2, 0.1), 1.0, position=(0.9, 0.1, 0.22), velocity=(0.3, 0.0, -1.0))]
    scene = TimestepScene(things, Material(friction=0.4, restitution=restitution), 1 / 240,
                          settings=settings)
    moves, largest = scene.model.inv_m > 0.0, 0.0
    for _ in range(240):
        before = scene.state.P.T.copy()
        scene.step()
        acted = impulses_on_bodies(scene)
        weight = np.outer(scene.model.m / 240, (0.0, 0.0, -G))
        largest = max(largest, np.abs(acted[moves]).max())
        off = np.linalg.norm(scene.state.P.T - before - weight - acted, axis=1)
        # The momenta of a direct solution and what its impulses do differ by rounding of rates of
        # 2 m/s, 4e-16 m/s, over its compliance of 1e-8, times masses of 3 kg.
        assert (off[moves] <= 2e-7).all()
    assert largest > 1.0    # N s: there were impacts


@of_the_engine(module=contact_sweep)
def note(blocks, block, residual, what):
    note_left(blocks, block, load(residual, 0), what)


def test_the_way_back_looks_at_what_changed_and_at_what_overlaps():
    scene = pyramid(4, 1 / 240)
    scene.step(2)
    blocks, what = scene.work.solver.blocks, Sweep(960.0, True, 0.0)
    block = first_block(blocks, 0)
    rows = blocks.numbers[blocks.start[block]:][:BLOCK_SIZE].reshape(-1, LANES)
    # Of boxes, whose manifolds have four points. The last of these is of another size.
    sizes = np.ones(LANES)
    sizes[5] = 3.0
    rows[SIZE] = sizes
    settled, negligible = 3.0 * SETTLED * what.inv_h, 3.0 * NEGLIGIBLE
    for point, residual, gap, left in (
            (0, 0.9 * settled, -0.9 * negligible, 0),
            (0, 1.1 * settled, -0.9 * negligible, CHANGED << 5),
            (3, 0.9 * settled, -1.1 * negligible, OVERLAPPING),
            (3, 1.1 * settled, -1.1 * negligible, CHANGED << 5 | OVERLAPPING)):
        rows[POINT + GAP:POINT + 4 * POINT_ROWS:POINT_ROWS] = 1.0
        # One lane, and of its points one.
        changes = np.zeros(LANES)
        changes[5] = residual
        rows[POINT + point * POINT_ROWS + GAP, 5] = gap
        note(blocks, block, changes, what)
        assert blocks.left[block] == left


def test_both_halves_and_what_is_across_begin_to_push_everybody_once():
    rng = np.random.default_rng(2)
    slots, first, last = 20, 2, 17
    motion, drifted = rng.normal(0.0, 1.0, (2, slots * STRIDE))
    alone, together = drifted.copy(), drifted.copy()
    begin_push(first, last, motion, alone)
    at_A, at_B = STRIDE * np.array([[5, 3, 9, 16], [3, 2, 12, 9]])
    # The first lane is no longer in use.
    astride = np.zeros(slots, dtype=np.int8)
    mark_astride(1, 4, at_A, at_B, astride)
    assert np.flatnonzero(astride).tolist() == [2, 3, 9, 12, 16]
    begin_push_astride(1, 4, at_A, at_B, motion, together)
    # Those inside keep what those astride were pushed meanwhile.
    together[3 * STRIDE] = alone[3 * STRIDE] = 0.5
    begin_push_inside(first, last, astride, motion, together)
    assert (together == alone).all()


@pytest.mark.parametrize('pushed', [False, True])
def test_what_nobody_pushed_drifts_as_it_moves(pushed):
    rng = np.random.default_rng(1)
    slots = 5
    used = np.full(5, slots)
    motion, drifted = rng.normal(0.0, 1.0, (2, slots * STRIDE))
    u = motion.copy()
    if pushed:
        begin_push(0, slots, motion, drifted)
        by_mass = np.arange(slots) * STRIDE + INV_M
        assert (drifted[by_mass] == motion[by_mass]).all() and np.count_nonzero(drifted) == slots
        drifted[STRIDE:] = rng.normal(0.0, 1.0, (slots - 1) * STRIDE)
        u += drifted
    total, base, smooth = rng.normal(0.0, 1.0, (3, slots * STRIDE))
    sums, without, h = total.copy(), base.copy(), 0.1
    drift_bodies(0, used, motion, drifted, total, smooth, False, base, h, pushed)
    u -= 0.5 * (h * smooth + (motion - without))
    # Nobody is touched yet, and the first slot stands still.
    moves = slice(STRIDE, None)
    assert (drifted[STRIDE + TOUCHED::STRIDE] == 0.0).all()
    # Roundings of numbers of about 1.
    assert total[moves] == pytest.approx((sums + u)[moves], abs=1e-14)
    drifted[TOUCHED::STRIDE] = u[TOUCHED::STRIDE]
    assert drifted[moves] == pytest.approx(u[moves], abs=1e-14)
    # What contacts added; a push only displaces.
    assert (base[moves] == (motion - without)[moves]).all()


@pytest.mark.parametrize('alike', [False, True])
def test_forces_kick_each_by_its_own_or_all_alike(alike):
    rng = np.random.default_rng(2)
    slots, h = 5, 0.1
    used = np.full(5, slots)
    start, smooth, contacts = rng.normal(0.0, 1.0, (3, slots * STRIDE))
    motion, base = start.copy(), contacts.copy()
    felt = np.tile(smooth[:STRIDE], slots) if alike else smooth
    moves = slice(STRIDE, None)
    kick_bodies(0, used, motion, smooth, alike, base, h)
    assert (base[moves] == (start + h * felt)[moves]).all()
    assert (motion[moves] == (base + contacts)[moves]).all()
