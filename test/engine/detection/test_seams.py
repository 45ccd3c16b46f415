# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seams: a floor of flush pieces is a floor, and what is no floor stays what it is."""

from engine.detecting import Scene, UPRIGHT
from engine.flush_floors import Floor, random_turn, turned
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.detection.narrow_phase.boxes import PREFERENCE
from rigid_sim_ros.engine.model.kinds.table import BOX, PLANE, SPHERE

CUBE = (BOX, (0.5, 0.5, 0.5), None)
TILE = (BOX, (0.25, 1.0, 0.2), None)


@pytest.mark.parametrize('block', range(8))
def test_a_floor_of_flush_pieces_has_the_contacts_of_a_floor(block):
    """
    Bodies of any kind and size, from 1 mm to 100 m, are laid on random seams.

    The normals of a floor are those of its surface, but for what two boxes may prefer of each
    other's faces: an angle of `PREFERENCE` half extents over the half diagonal of a tile, twice
    that with the other box's. The least gap is that on one piece, to what corners stand out over
    faces, 1e-4 of the size, times the slope of an octahedron.
    """
    for seed in range(100 * block, 100 * block + 100):
        floor = Floor(seed)
        tilt, gap = floor.contacts(floor.tiles)
        tilt_of_one, gap_of_one = floor.contacts(floor.whole)
        assert tilt <= tilt_of_one + 2.0 * PREFERENCE, seed
        assert abs(gap - gap_of_one) <= 1e-4 * floor.size, seed


def normals_on(scene, body):
    """Return the normals on a body, rounded, of all manifolds."""
    return sorted(tuple(np.round(row['normal'] if row['pair'][1] == body else -row['normal'], 9)
                        + 0.0) for row in scene.rows())


def floor_of_two(*more, body=CUBE, at=(-0.6, 0.0, 0.5), turned=UPRIGHT):
    """Return a body on a long tile that ends at x = 0, with what lies beyond or on it."""
    shapes = [(BOX, (1.0, 1.0, 0.2), None), *(shape for shape, _ in more), body]
    poses = [((-1.0, 0.0, -0.2), UPRIGHT), *((place, UPRIGHT) for _, place in more), (at, turned)]
    return Scene(shapes, poses, range(len(shapes) - 1), margin=0.01)


# What a cube whose face is 1 mm before x = 0 meets there: a wall beside the tile or on it, a step
# of 1 cm, and one of 2 mm, more than the tolerance of 1e-3 half extents of the tile.
REAL = [((BOX, (0.25, 1.0, 1.0), None), (0.25, 0.0, 0.0)),
        ((BOX, (0.25, 1.0, 1.0), None), (0.25, 0.0, 1.0)),
        ((BOX, (0.25, 1.0, 0.2), None), (0.25, 0.0, -0.19)),
        ((BOX, (0.25, 1.0, 0.2), None), (0.25, 0.0, -0.198))]


@pytest.mark.parametrize('obstacle', REAL)
@pytest.mark.parametrize('depth', [0.0, 1e-5, 1e-3])
def test_a_wall_and_a_step_still_stop_a_cube(obstacle, depth):
    """The cube lies on the floor, or has sunk into it; the wall pushes back, the floor up."""
    scene = floor_of_two(obstacle, at=(-0.501, 0.0, 0.5 - depth))
    assert normals_on(scene, 2) == [(-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]


@pytest.mark.parametrize('depth', [0.0, 1e-5, 1e-3])
@pytest.mark.parametrize('ahead', [0.001, -1e-7, -1e-5])
def test_the_side_of_a_flush_tile_stops_nothing(ahead, depth):
    """Before the seam, and just beyond it, there is only the floor."""
    scene = floor_of_two((TILE, (0.25, 0.0, -0.2)), at=(-0.5 - ahead, 0.0, 0.5 - depth))
    assert set(normals_on(scene, 2)) == {(0.0, 0.0, 1.0)}


def test_a_box_that_is_sunk_into_a_plane_is_part_of_it():
    """A cube moves over the ground to the top of a box in it."""
    scene = Scene([(PLANE, (0.0, 0.0, 0.0), None), TILE, CUBE],
                  [(place, UPRIGHT) for place in ((0, 0, 0), (0.25, 0, -0.2), (-0.501, 0, 0.49))],
                  [0, 1], margin=0.01)
    assert set(normals_on(scene, 2)) == {(0.0, 0.0, 1.0)}


def test_a_tilted_cube_in_a_corner_is_held_by_the_wall_and_the_floor():
    """Only its lower edge is near both."""
    scene = floor_of_two(REAL[0], at=(-0.5 * np.sqrt(2.0) - 1e-6, 0.0, 0.5 * np.sqrt(2.0)),
                         turned=(0.0, np.sin(np.pi / 8), 0.0, np.cos(np.pi / 8)))
    # Its left edge and its right one are 1.4 m apart: the wall meets the right one.
    assert {(-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)} == set(normals_on(scene, 2))


def test_a_ball_in_a_valley_keeps_both_contacts():
    """Two boxes, turned by 30 degrees either way, meet in an edge under it."""
    tilt = np.pi / 12
    left, right = (0, np.sin(tilt), 0, np.cos(tilt)), (0, -np.sin(tilt), 0, np.cos(tilt))
    half, c, s = 1.0, np.cos(2 * tilt), np.sin(2 * tilt)
    scene = Scene([(BOX, (half, 1.0, 0.2), None), (BOX, (half, 1.0, 0.2), None),
                   (SPHERE, (0.3, 0, 0), None)],
                  [((-half * c - 0.2 * s, 0, half * s - 0.2 * c), left),
                   ((half * c + 0.2 * s, 0, half * s - 0.2 * c), right),
                   ((0, 0, 0.3 / c), UPRIGHT)], [0, 1], margin=0.01)
    assert normals_on(scene, 2) == [(round(-s, 9), 0, round(c, 9)), (round(s, 9), 0, round(c, 9))]


def test_a_ball_on_the_edge_that_two_tiles_share_leans_outwards():
    """Outside of both, beside the corner that they have in common, the normal points to it."""
    scene = Scene([(BOX, (1.0, 0.5, 0.2), None), (BOX, (1.0, 0.5, 0.2), None),
                   (SPHERE, (0.3, 0, 0), None)],
                  [((-1.0, -0.5, -0.2), UPRIGHT), ((-1.0, 0.5, -0.2), UPRIGHT),
                   ((0.18, 0.0, 0.24), UPRIGHT)], [0, 1], margin=0.01)
    assert set(normals_on(scene, 2)) == {(0.6, 0.0, 0.8)}


def sliding(contact, shape, place, floor):
    """Return a body that slides over the seams of a floor at 2 m/s, without friction."""
    return World.from_dict({
        'format': 1, 'world': {'contact': contact},
        'materials': {'default': {'friction': 0.0}},
        'bodies': [*floor, {'name': 'body', 'mass': 1.0, 'shape': shape,
                            'pose': {'position': place}, 'twist': {'linear': [2.0, 0.0, 0.0]}}]})


def separate(fixed=True, mass=1e4):
    """Return six flush boxes 0.5 m long."""
    kind = {'fixed': True} if fixed else {'mass': mass}
    return [{'name': f'tile{k}', **kind, 'shape': {'type': 'box', 'size': [0.5, 2.0, 0.4]},
             'pose': {'position': [0.5 * k, 0.0, -0.2]}} for k in range(6)]


def compound():
    """Return the same as one body."""
    parts = [{'type': 'box', 'size': [0.5, 2.0, 0.4],
              'pose': {'position': [0.5 * k, 0.0, -0.2]}} for k in range(6)]
    return [{'name': 'floor', 'fixed': True, 'shape': {'compound': parts}}]


def dynamic():
    """Return heavy boxes that lie on the ground side by side."""
    ground = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane', 'offset': -0.4}}
    return [ground, *separate(fixed=False)]


SLIDING = [({'type': 'box', 'size': [0.6, 0.6, 0.6]}, 0.3),
           ({'type': 'sphere', 'radius': 0.2}, 0.2),
           ({'type': 'cylinder', 'radius': 0.2, 'length': 0.4}, 0.2)]


@pytest.mark.parametrize('contact', ['timestep', 'event'])
@pytest.mark.parametrize('floor', [separate, compound, dynamic])
@pytest.mark.parametrize('shape, height', SLIDING, ids=['box', 'sphere', 'cylinder'])
def test_what_slides_over_flush_boxes_slides_on(contact, floor, shape, height):
    """
    Over four seams it keeps its speed and its height.

    To a millimetre a second: a body that sinks by 1e-5 m is lifted by g h^2 = 1e-5 m in a step at
    most. Heavy boxes lie as deep as each other to 1e-5 m too. A ball may spin as it likes.
    """
    world = sliding(contact, shape, [0.1, 0.05, height], floor())
    for _ in range(10):
        world.step(100)
        assert np.abs(world.linear_velocity[-1] - (2.0, 0.0, 0.0)).max() < 1e-3
        assert shape['type'] == 'sphere' or np.abs(world.angular_velocity[-1]).max() < 1e-2
        assert abs(world.position[-1, 2] - height) < 1e-4


@pytest.mark.parametrize('first', ['leaning', 'turned'])
def test_an_edge_on_a_face_just_above_the_ground_keeps_the_normal_of_that_face(first):
    """
    A box on the ground leans against the edge of another one that is turned by 0.13 rad.

    Its foot overlaps by 0.6 mm, and is a corner with the ground; its top edge is 0.04 mm away.
    Neither face of the turned one beside that edge is a way out: the box is 0.15 m inside of it.
    Boxes of which no face comes first have normals to `PREFERENCE`.
    """
    yaw, lean, height = 0.13, 2.8e-4, 2.3
    edge = 1.15 * np.cos(yaw) + 0.5 * np.sin(yaw)
    turned = {'name': 'turned', 'shape': {'type': 'box', 'size': [2.3, 1.0, 2.4]}, 'mass': 1.0,
              'pose': {'position': [0, 0, 1.2],
                       'orientation': [0, 0, -np.sin(yaw / 2), np.cos(yaw / 2)]}}
    leaning = {'name': 'leaning', 'shape': {'type': 'box', 'size': [1.0, 2.4, height]},
               'mass': 1.0,
               'pose': {'position': [edge + 0.5 + 4e-5 - 0.5 * height * lean, 0.6,
                                     0.5 * (height + lean)],
                        'orientation': [0, np.sin(lean / 2), 0, np.cos(lean / 2)]}}
    boxes = [leaning, turned] if first == 'leaning' else [turned, leaning]
    world = World.from_dict({'format': 1, 'world': {'contact': 'timestep', 'step': 4e-3},
                             'bodies': [*boxes, {'name': 'ground', 'shape': {'type': 'plane'},
                                                 'fixed': True}]})
    world.step()
    normals = [row['normal'] for row in world.contacts() if row['body_b'] == 1]
    assert len(normals) > 0
    assert np.abs(np.array(normals)[:, 0]) == pytest.approx(1.0, abs=PREFERENCE)


# An angle: sizes and places of its two boxes.
ANGLE = [((3.0, 1.0, 1.0), (-0.4, 0.0, -0.6)), ((1.0, 1.0, 2.0), (0.6, 0.0, 0.9))]
ANGLE_SHAPE = {'compound': [{'type': 'box', 'size': size, 'pose': {'position': at}}
                            for size, at in ANGLE]}


def test_an_angle_in_the_ground_has_the_normal_of_the_ground():
    """Two boxes of a body that moves on, at any attitude: the gap is that of its lowest corner."""
    rng = np.random.default_rng(3)
    ground = {'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}
    for _ in range(40):
        q = random_turn(rng)
        lowest = min(turned(q, at + 0.5 * signs * size)[2] for size, at in ANGLE
                     for signs in np.array(np.meshgrid(*[(-1, 1)] * 3)).T.reshape(-1, 3))
        height = rng.uniform(-0.3, -0.01) - lowest
        world = World.from_dict({
            'format': 1, 'world': {'contact': 'timestep', 'step': 5e-3},
            'bodies': [ground, {
                'name': 'angle', 'mass': 1.0, 'shape': ANGLE_SHAPE,
                'pose': {'position': [0.0, 0.0, height], 'orientation': list(q)},
                'twist': {'linear': list(rng.normal(size=3) * (6.0, 6.0, 1.0)),
                          'angular': list(rng.normal(size=3) * 8.0)}}]})
        world.step()
        assert set(map(tuple, world.contacts()['normal'])) == {(0.0, 0.0, 1.0)}
        assert world.contact_report().deepest == pytest.approx(-height - lowest, abs=1e-9)


def test_an_edge_across_the_inner_corner_of_an_angle_does_not_sink():
    """
    A beam lies with its edge in the corner, where each box covers what the other one has there.

    It overlaps both, one by 0.125 m and one by 0.08 m; what is left has to hold it as far.
    """
    angle = {'name': 'angle', 'mass': 1.0, 'shape': ANGLE_SHAPE}
    beam = {'name': 'beam', 'mass': 1.0, 'shape': {'type': 'box', 'size': [2.76, 0.745, 1.067]},
            'pose': {'position': [-0.58, 0.073, 0.811],
                     'orientation': [-0.21755825, -0.16091733, -0.84419321, 0.46272221]}}
    world = World.from_dict({'format': 1, 'world': {'contact': 'timestep', 'gravity': [0, 0, 0]},
                             'bodies': [angle, beam]})
    world.step()
    assert 0.05 < world.contact_report().deepest < 0.25


def wall_of_cubes(rng, backwards):
    """Return the contacts of a small wall of cubes that lie a little askew, by pairs of cubes."""
    half, places = 0.5, [(0, 0), (1, 0), (2, 0), (0.5, 1), (1.5, 1), (1, 2)]
    # As the solver leaves them: within the skin in which contacts rest, 2e-5 of the size.
    poses = [((2 * half * x + half * 1e-5 * rng.normal(), half * 1e-5 * rng.normal(),
               half * (2 * z + 1) + half * 1e-5 * rng.normal()),
              (*(1e-5 * rng.normal(size=3)), 1.0)) for x, z in places]
    order = list(range(len(places)))[::-1 if backwards else 1]
    rows = Scene([(BOX, (half,) * 3, None)] * len(places), [poses[k] for k in order],
                 margin=0.01 * half).rows()
    return {tuple(sorted(order[k] for k in row['pair'])): (
        np.sort(row['gap']), np.sort(np.abs(row['normal']))) for row in rows}


@pytest.mark.parametrize('seed', range(20))
def test_the_contacts_of_a_wall_do_not_depend_on_the_order_of_its_cubes(seed):
    """Each cube is a piece of what others lie on, and lies on pieces itself."""
    found, other = (wall_of_cubes(np.random.default_rng(seed), backwards)
                    for backwards in (False, True))
    assert found.keys() == other.keys()
    for pair, (gaps, normal) in found.items():
        # Of the size 1: rounding.
        assert gaps == pytest.approx(other[pair][0], abs=1e-12), pair
        assert normal == pytest.approx(other[pair][1], abs=1e-9), pair


@pytest.mark.parametrize('seed', range(20))
def test_a_cube_lies_on_both_cubes_below_it(seed):
    """They are tilted against each other by 1e-5 rad, and each bears a part."""
    pairs = wall_of_cubes(np.random.default_rng(seed), False)
    assert {(0, 3), (1, 3), (1, 4), (2, 4), (3, 5), (4, 5)} <= pairs.keys()
