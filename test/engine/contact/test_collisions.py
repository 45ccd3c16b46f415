# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Collisions with restitution: their energy, and where their friction acts."""

from engine.stepping import TimestepScene
from engine.touching import ball, box, ground
import numpy as np
import pytest

from rigid_sim_ros.engine.contact import colliding_body
from rigid_sim_ros.engine.contact.colliding_body import SPIN
from rigid_sim_ros.engine.contact.collisions import collide_bodies
from rigid_sim_ros.engine.contact.impact_offsets import has_collided, SHIFT
from rigid_sim_ros.engine.detection.detect import detect
from rigid_sim_ros.engine.detection.manifolds import StepImpulses
from rigid_sim_ros.engine.dynamics.free_rotation import turn_fast
from rigid_sim_ros.engine.model.shapes import Material
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.kernels.kernel import in_python
from rigid_sim_ros.world import World

SIZE = np.array((0.3, 0.2, 0.1))
# To compile it takes longer than it takes in Python.
turn_body = in_python(colliding_body.turn_body)


def collided(things, restitution, friction):
    """Let things collide once; return their scene, the normal impulses and that of friction."""
    scene = TimestepScene(things, Material(friction=friction, restitution=restitution), 1e-3,
                          (0.0, 0.0, 0.0))
    assert detect(scene.model, scene.state, scene.shapes, scene.memory, 0.02)
    manifolds, work = scene.manifolds(), scene.work.collision
    work.activity[:] = 0
    acted = StepImpulses(np.zeros_like(manifolds.impulse), np.zeros_like(manifolds.friction))
    count = collide_bodies(scene.model.h, scene.model.inv_m, scene.model.inv_I_C, scene.state,
                           np.zeros((3, len(things))), scene.shapes, scene.materials, manifolds,
                           acted, work)
    return scene, count, acted.normal[:manifolds.points[0], 0], acted.friction[0]


def corner_first(rng):
    """Return a box that comes down on a corner, some way or other."""
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    x, y, z, w = q
    down = np.array((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)))
    height = 0.5 * np.abs(down) @ SIZE
    return box(SIZE, 1.0, position=(0.0, 0.0, height + 1e-4), orientation=q,
               velocity=rng.normal(scale=3.0, size=3) - (0.0, 0.0, 4.0),
               spin=rng.normal(scale=10.0, size=3))


def turn_on(scene, t):
    """Let the body turn for t [s]."""
    L, inv_I = scene.state.L[:, 1], scene.model.inv_I_C[:, 1]
    scene.state.q[:, 1] = turn_fast(tuple(scene.state.q[:, 1]), tuple(L), tuple(inv_I), t)


def test_what_turns_bounces_with_the_inertia_that_it_has_by_then():
    rng = np.random.default_rng(7)
    for _ in range(40):
        scene = TimestepScene([ground(), corner_first(rng)],
                              Material(friction=0.0, restitution=1.0), 5e-3, (0.0, 0.0, 0.0))
        before = scene.energy()
        scene.step()
        # Up to 0.3 rad a step: `turn` errs by 2e-7 rad a quarter, and with the attitude errs the
        # energy of a momentum that stays. With the inertia of the start it was some 0.1 %.
        assert scene.energy() == pytest.approx(before, rel=1e-6)


def test_what_collided_later_in_the_step_collides_at_its_start_as_it_is_there():
    rng, collisions = np.random.default_rng(7), 0
    for _ in range(10):
        scene, count, _, _ = collided([ground(), corner_first(rng)], 1.0, 0.0)
        collisions += count
        line, state, inv_I_C = scene.work.collision.body[1], scene.state, scene.model.inv_I_C
        turn_body(inv_I_C, state, 1, 0.0, line)
        w = spin_of(tuple(state.q[:, 1]), tuple(state.L[:, 1]), tuple(inv_I_C[:, 1]))
        # Rounding of 20 rad/s.
        assert line[SPIN:SPIN + 3] == pytest.approx(np.array(w), abs=1e-12)
    assert collisions > 5


@pytest.mark.parametrize('restitution', [0.8, 1.0])
def test_a_collision_with_friction_makes_no_energy(restitution):
    rng, collisions, kept = np.random.default_rng(7), 0, 0
    for _ in range(300):
        thing, friction = corner_first(rng), rng.uniform(0.0, 2.0)
        start = TimestepScene([ground(), thing], Material())
        before = start.energy()
        scene, count, _, _ = collided([ground(), thing], restitution, friction)
        collisions += count
        # In the attitude of the collision: it is turned back a little, to where the step begins,
        # and displaced by what the impulse would have made of the time until then.
        moved, dv = (scene.state.x - start.state.x)[:, 1], (scene.v - start.v)[:, 1]
        turn_on(start, float(-(moved @ dv) / (dv @ dv)) if count else 0.0)
        scene.state.q[:] = start.state.q
        # Rounding of the energies of 20 J.
        assert scene.energy() <= before + 1e-12
        kept += count > 0 and scene.energy() > before - 1e-12
    assert collisions > 100
    # In some the law of Newton would have made some: these have as much as before.
    assert kept > 0


def test_friction_of_a_collision_acts_at_the_centre_of_pressure_of_its_normals():
    # All corners of the lower face come down, each at its own speed, and slide about.
    def landing():
        return box(SIZE, 1.0, position=(0.0, 0.0, 0.5 * SIZE[2]), velocity=(1.0, 0.5, -2.0),
                   spin=(1.5, -1.0, 20.0))

    smooth, count, alone, none = collided([ground(), landing()], 0.5, 0.0)
    assert count == 1 and len(alone) == 4 and (none == 0.0).all()
    r = smooth.manifolds().r_B[:4, 0]
    centre = alone @ r / alone.sum()
    assert np.linalg.norm(centre[:2]) > 1e-3     # m
    scene, _, impulses, slide = collided([ground(), landing()], 0.5, 0.4)
    assert np.linalg.norm(slide) > 0.1      # N s
    start = TimestepScene([ground(), landing()], Material()).state.L[:, 1]
    n = np.array((0.0, 0.0, 1.0))
    torque = np.cross(r, np.outer(impulses, n)).sum(axis=0) + np.cross(centre, slide)
    # Rounding of 0.1 kg m^2/s, and of the 1e-12 of an impulse to which visits go on.
    assert scene.state.L[:, 1] - start == pytest.approx(torque, abs=1e-12)


@pytest.mark.parametrize('friction', [0.0, 0.6])
def test_a_ball_that_falls_between_two_boxes_rises_straight(friction):
    """All that touches at once is solved at once, also where friction presses on itself."""
    size = (0.2, 0.16, 0.11)
    boxes = [box(size, 50.0, position=(x, 0.0, 0.055)) for x in (0.13, -0.13)]
    scene = TimestepScene([ground(), *boxes, ball(0.09, 0.1, position=(0.0, 0.0, 0.25),
                                                  velocity=(0.0, 0.0, -3.0))],
                          Material(friction=friction, restitution=1.0), 1e-3)
    scene.step(60)
    v, w = scene.state.P[:, 3] / 0.1, scene.state.L[:, 3]
    assert v[2] > 1.0
    # Rounding of 3 m/s, and of 1e-8 of it in the compliance of the points that share the impulse.
    assert np.abs(v[:2]).max() < 1e-7 and np.abs(w).max() < 1e-9


def test_a_ball_that_is_a_part_of_a_body_is_hit_where_it_is_then():
    """It turns until it is hit: whether that body is A or B of the pair decides nothing."""
    rod = {'name': 'rod', 'mass': 2.0, 'pose': {'position': [0.0, 0.0, 0.0]},
           'twist': {'angular': [0.0, 0.0, 40.0]}, 'compound': [
               {'type': 'sphere', 'radius': 0.1, 'pose': {'position': [0.3, 0.0, 0.0]}},
               {'type': 'sphere', 'radius': 0.1, 'pose': {'position': [-0.3, 0.0, 0.0]}}]}
    ball_ = {'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
             'pose': {'position': [0.33, 0.33, 0.02]}, 'twist': {'linear': [-1.0, -4.0, 0.0]}}
    found = []
    for bodies in ((rod, ball_), (ball_, rod)):
        world = World.from_dict({
            'format': 1, 'world': {'contact': 'timestep', 'step': 0.002, 'gravity': [0, 0, 0]},
            'materials': {'default': {'friction': 0.5, 'restitution': 0.9}},
            'bodies': list(bodies)})
        world.step(40)
        found.append(world.linear_velocity[[world.names.index(name) for name in ('rod', 'ball')]])
    assert np.abs(found[0][0]).max() > 0.5      # m/s: it was hit
    assert found[1] == pytest.approx(found[0], abs=1e-12)     # rounding


def test_what_collides_as_the_step_begins_has_collided():
    things = [ground(), ball(0.1, 1.0, position=(0.0, 0.0, 0.1), velocity=(0.0, 0.0, -1.0))]
    scene, count, _, _ = collided(things, 1.0, 0.0)
    line = scene.work.collision.body[1]
    assert count == 1 and not line[SHIFT:SHIFT + 6].any()
    assert has_collided(line)


def test_it_does_not_matter_which_of_two_balls_that_overlap_is_a():
    # Each is a part of a body whose centre of mass is elsewhere, and friction has a lever.
    def half(name, x, v):
        parts = [{'type': 'sphere', 'radius': 0.1},
                 {'type': 'sphere', 'radius': 0.05, 'pose': {'position': [0.0, 0.3, 0.0]}}]
        return {'name': name, 'mass': 1.0, 'shape': {'compound': parts},
                'pose': {'position': [x, 0.0, 0.0]}, 'twist': {'linear': [v, 1.0 + v, 0.0]}}

    found = []
    for order in (1, -1):
        # They overlap by 0.01 m.
        bodies = [half('left', -0.095, 1.0), half('right', 0.095, -2.0)][::order]
        world = World.from_dict({
            'format': 1, 'world': {'gravity': [0, 0, 0], 'step': 0.001, 'contact': 'timestep'},
            'materials': {'default': {'friction': 0.5, 'restitution': 1.0}}, 'bodies': bodies})
        world.step()
        found.append(np.hstack([world.linear_velocity, world.angular_velocity])[::order])
    # Visits end where one changes 1e-12 of the impulse; of what is left some hundred of them.
    assert found[0] == pytest.approx(found[1], abs=1e-9)
