# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies that cannot meet within a step go through it by themselves, in the model `event`."""

from engine.touching import ball, box, EventScene, ground
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.model.shapes import Material

R = 0.1


def heap(x: float) -> list:
    """Return bodies that fall on each other at x."""
    rng = np.random.default_rng(3)
    return [box((0.2, 0.15, 0.1), 1.0, position=(x + rng.uniform(-0.05, 0.05), 0.03 * k,
                                                 0.1 + 0.2 * k), spin=rng.normal(size=3))
            for k in range(4)]


def test_a_heap_far_away_changes_no_bit():
    material = Material(friction=0.5, restitution=0.4)
    alone = EventScene([*heap(0.0), ground()], material)
    both = EventScene([*heap(0.0), *heap(0.0 + 50.0), ground()], material)
    events = 0
    for _ in range(400):
        alone.step()
        both.step()
        events += alone.work.report.events
        for field in ('x', 'q', 'P', 'L'):
            mine, other = getattr(alone.state, field), getattr(both.state, field)
            assert (mine[:, :4] == other[:, :4]).all()
    assert events > 20


def test_a_floor_joins_no_groups():
    scene = EventScene([ground(), *(ball(R, 1.0, position=(x, 0, R)) for x in (0.0, 1.0, 2.0)),
                        ball(R, 1.0, position=(2.0, 0, 3.01 * R))], Material())
    scene.step()
    # The two that are on top of each other are one.
    assert scene.work.buffers.now.groups[0] == 3


def test_bodies_that_a_spring_ties_go_through_a_step_together():
    """Else its force would act on each for other times once one of them bounces in a step."""
    balls = [{'name': name, 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': R},
              'pose': {'position': [x, 0.0, z]}}
             for name, x, z in (('a', 0.0, 0.3), ('b', 2.0, 1.0))]
    spring = {'type': 'spring', 'a': 'a', 'b': 'b', 'stiffness': 100.0, 'rest_length': 1.0}
    world = World.from_dict({
        'format': 1, 'world': {'contact': 'event', 'step': 0.01}, 'forces': [spring],
        'materials': {'default': {'friction': 0.0, 'restitution': 1.0}},
        'bodies': [{'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}, *balls]})
    fastest = 0.0
    for _ in range(100):
        world.step()
        fastest = max(fastest, float(world.linear_momentum[1, 0]))
        # Without friction nothing pushes the two aside: rounding of some 10 kg m/s.
        assert abs(world.linear_momentum[:, 0].sum()) < 1e-13
    assert fastest > 5.0


def test_a_step_in_which_a_body_gets_farther_than_thought_begins_anew():
    heavy, light = 1000.0, 1.0
    # Within a step of 10 ms the heavy ball goes 0.1 m, hits the light one after 2 ms, and that
    # gets twice as far as it in the rest: 0.16 m, to a third ball 0.1 m away.
    things = [ball(R, heavy, position=(0, 0, 0), velocity=(10.0, 0, 0)),
              ball(R, light, position=(2 * R + 0.02, 0, 0)),
              ball(R, heavy, position=(4 * R + 0.12, 0, 0))]
    scene = EventScene(things, Material(restitution=1.0), h=0.01, gravity=(0, 0, 0))
    P, energy = scene.state.P.sum(axis=1), scene.energy()
    scene.step()
    assert scene.work.buffers.now.tries[0] > 0
    expected = on_a_line([0.0, 2 * R + 0.02, 4 * R + 0.12], [10.0, 0.0, 0.0],
                         [heavy, light, heavy], 0.01)
    assert scene.v[0] == pytest.approx(expected, rel=1e-10)  # meetings are known to 1e-12 s
    assert scene.state.P.sum(axis=1) == pytest.approx(P, rel=1e-14)
    assert scene.energy() == pytest.approx(energy, rel=1e-13)


def test_what_gets_farther_than_thought_within_its_group_meets_what_is_there():
    heavy, light, x = 1000.0, 1.0, (0.0, 2 * R + 0.02, 4 * R + 0.12)
    # As above, along a plank 0.5 mm beside all three, which are one group by it from the start.
    things = [ball(R, heavy, position=(x[0], 0, 0), velocity=(10.0, 0, 0)),
              ball(R, light, position=(x[1], 0, 0)), ball(R, heavy, position=(x[2], 0, 0)),
              box((1.0, 0.1, 0.1), heavy, position=(0.26, R + 0.0505, 0))]
    scene = EventScene(things, Material(restitution=1.0), h=0.01, gravity=(0, 0, 0))
    scene.step()
    assert scene.work.buffers.now.tries[0] == 0
    expected = on_a_line(x, [10.0, 0.0, 0.0], [heavy, light, heavy], 0.01)
    assert scene.v[0, :3] == pytest.approx(expected, rel=1e-10)
    assert (scene.v[:, 3] == 0.0).all()


def on_a_line(x, v, m, t) -> list[float]:
    """Return the velocities of elastic balls on a line after t, shock by shock."""
    while True:
        first, which = t, -1
        for k in range(len(x) - 1):
            closing, gap = v[k] - v[k + 1], x[k + 1] - x[k] - 2 * R
            if closing > 0.0 and gap / closing < first:
                first, which = gap / closing, k
        x, t = [a + first * b for a, b in zip(x, v, strict=True)], t - first
        if which < 0:
            return v
        k, total = which, m[which] + m[which + 1]
        mean = (m[k] * v[k] + m[k + 1] * v[k + 1]) / total
        v = [*v[:k], 2 * mean - v[k], 2 * mean - v[k + 1], *v[k + 2:]]
