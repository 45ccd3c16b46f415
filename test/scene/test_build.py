# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A correct scene becomes the model and the state that it describes."""

from collections.abc import Callable
import math
from pathlib import Path

import numpy as np
import pytest

from rigid_sim_ros.engine.dynamics.forces import FORCES
from rigid_sim_ros.engine.model.model import WORLD
from rigid_sim_ros.engine.state.state import empty_motion, MotionArguments, read_motion
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from rigid_sim_ros.scene import read_scene, Scene, scene_from_dict, scene_from_text

Read = Callable[[str], Scene]

# The scene file of the documentation, with every section.
FULL = """
format: 1
world:
  gravity: [0, 0, -9.81]
  step: 0.001
  integrator: symplectic
  orientation: quaternion
  contact: timestep
  solver: sequential
materials:
  default: {friction: 0.5, restitution: 0.0}
  rubber:  {friction: 0.9, restitution: 0.8}
bodies:
  - name: crate
    shape: {type: box, size: [1, 1, 1]}
    mass: 2.0
    material: rubber
    pose: {position: [0, 0, 1], orientation: [0, 0, 0, 1]}
    twist: {linear: [0, 0, 0], angular: [0, 0, 0]}
    frames: {handle: {position: [0.5, 0, 0]}}
    fixed: false
forces:
  - {type: wind, velocity: [3, 0, 0], drag: 0.5}
  - {type: spring, a: crate/handle, b: world, anchor: [0, 0, 3], stiffness: 50, damping: 1,
     rest_length: 1}
"""
BALL = 'shape: {type: sphere, radius: 1}, mass: 1'


def test_a_scene_with_every_section_is_read(read: Read) -> None:
    scene = read(FULL)
    assert scene.names == ('crate',)
    assert dict(scene.frame_names) == {'crate': 0, 'crate/handle': 1}
    assert scene.spec.bodies[0].material == 'rubber'
    assert scene.spec.all_materials['rubber'].restitution == 0.8


def test_the_name_of_a_scene_is_that_of_its_file(read: Read) -> None:
    assert read(FULL).name == 'scene'


def test_what_is_left_out_has_the_documented_default(read: Read) -> None:
    scene = read(f'bodies: [{{name: a, {BALL}}}]')
    assert scene.model.gravity.tolist() == [0.0, 0.0, -9.81]
    assert (scene.model.h, scene.step_ns) == (0.001, 1_000_000)
    assert (scene.integrator, scene.orientation) == ('symplectic', 'quaternion')
    assert (scene.contact, scene.solver) == ('timestep', 'sequential')
    assert scene.spec.all_materials['default'].friction == 0.5


def test_a_step_that_is_no_whole_nanosecond_keeps_the_physics_and_rounds_the_clock(
        read: Read) -> None:
    scene = read(f'world: {{step: {1 / 240!r}}}\nbodies: [{{name: a, {BALL}}}]')
    assert (scene.model.h, scene.step_ns) == (1 / 240, 4_166_667)


def test_pose_and_twist_are_those_of_the_body_frame(read: Read) -> None:
    scene = read("""
bodies:
- name: a
  inertial: {mass: 2, com: [0.1, 0.2, 0.3], inertia: [3, 4, 5, 0.1, 0.2, 0.3]}
  pose: {position: [1, 2, 3], orientation: [0.5, 0.5, 0.5, 0.5]}
  twist: {linear: [4, 5, 6], angular: [0.7, 0.8, 0.9]}
""")
    motion = empty_motion(1)
    ArgumentPack(MotionArguments(scene.model, scene.state, motion)).run(read_motion)
    # Rounding: a few products of numbers below 10, each to 1.1e-16 of its size.
    assert motion.position[0] == pytest.approx([1, 2, 3], abs=1e-14)
    assert motion.linear[0] == pytest.approx([4, 5, 6], abs=1e-14)
    assert motion.angular[0] == pytest.approx([0.7, 0.8, 0.9], abs=1e-14)
    # q and -q are the same orientation.
    assert abs(motion.orientation[0] @ np.full(4, 0.5)) == pytest.approx(1.0, abs=1e-14)


def test_momentum_is_mass_times_velocity_of_the_centre_of_mass(read: Read) -> None:
    scene = read("""
bodies:
- name: a
  inertial: {mass: 2, com: [1, 0, 0], inertia: [1, 1, 1, 0, 0, 0]}
  twist: {linear: [0, 3, 0], angular: [0, 0, 5]}
""")
    # v = v_B + w x r = (0, 3 + 5, 0)
    assert scene.state.P[:, 0].tolist() == [0.0, 16.0, 0.0]


def test_a_quaternion_that_is_nearly_of_unit_length_is_normalised(read: Read) -> None:
    scene = read(f'bodies: [{{name: a, {BALL}, pose: {{orientation: [0.7071, 0, 0, 0.7071]}}}}]')
    assert np.linalg.norm(scene.state.q[:, 0]) == pytest.approx(1.0, abs=1e-15)


def test_a_fixed_body_needs_neither_mass_nor_shape(read: Read) -> None:
    scene = read('bodies: [{name: a, fixed: true}]')
    assert (scene.model.inv_m[0], scene.model.fixed.tolist()) == (0.0, [0])


def test_a_fixed_body_may_be_a_plane(read: Read) -> None:
    scene = read('bodies: [{name: ground, fixed: true, shape: {type: plane, normal: [0, 0, 1], '
                 'offset: 2}}]')
    (_, plane), = scene.spec.bodies[0].parts()
    assert (plane.type, plane.normal, plane.offset) == ('plane', (0.0, 0.0, 1.0), 2.0)


def test_frames_are_numbered_after_the_bodies(read: Read) -> None:
    scene = read(f'bodies: [{{name: a, {BALL}, frames: {{x: {{}}, y: {{}}}}}},'
                 f'{{name: b, {BALL}, frames: {{x: {{}}}}}}]')
    assert dict(scene.frame_names) == {'a': 0, 'b': 1, 'a/x': 2, 'a/y': 3, 'b/x': 4}
    assert scene.model.frame_body.tolist() == [0, 1, 0, 0, 1]


def test_a_frame_is_placed_in_the_body_frame(read: Read) -> None:
    scene = read('bodies: [{name: a, inertial: {mass: 1, com: [1, 0, 0], inertia: [1, 1, 1, 0, 0,'
                 '0]}, frames: {x: {position: [1, 2, 3]}}}]')
    assert scene.model.p_CF[1].tolist() == [0.0, 2.0, 3.0]


@pytest.mark.parametrize('name', ['state', 'scene', 'markers', 'reset', 'pose', '_hidden', 'A1'])
def test_names_of_topics_of_the_node_are_free_for_bodies(read: Read, name: str) -> None:
    assert read(f'bodies: [{{name: {name}, {BALL}}}]').names == (name,)


def test_wind_blows_on_every_body_that_moves(read: Read) -> None:
    scene = read(f'bodies: [{{name: a, {BALL}}}, {{name: b, fixed: true}}, {{name: c, {BALL}}}]\n'
                 'forces: [{type: wind, velocity: [3, 0, 0], drag: 0.5}]')
    table = scene.model.forces
    assert table.frame_a.tolist() == [0, 2]
    assert table.frame_b.tolist() == [WORLD, WORLD]
    assert table.parameters[:, :4].tolist() == [[3.0, 0.0, 0.0, 0.5]] * 2


def test_a_pattern_chooses_bodies(read: Read) -> None:
    scene = read(f'bodies: [{{name: link_1, {BALL}}}, {{name: base, {BALL}}},'
                 f'{{name: link_2, {BALL}}}]\nforces: [{{type: wind, bodies: ["link_*"]}}]')
    assert scene.model.forces.frame_a.tolist() == [0, 2]


def test_avoidance_acts_between_each_pair(read: Read) -> None:
    bodies = ', '.join(f'{{name: {name}, {BALL}}}' for name in 'abc')
    scene = read(f'bodies: [{bodies}]\nforces: [{{type: avoidance, range: 2, stiffness: 3}}]')
    table = scene.model.forces
    assert list(zip(table.frame_a, table.frame_b, strict=True)) == [(0, 1), (0, 2), (1, 2)]


def test_a_spring_joins_a_frame_and_the_world(read: Read) -> None:
    table = read(FULL).model.forces
    row = table.kind.tolist().index(list(FORCES).index('spring'))
    assert (table.frame_a[row], table.frame_b[row]) == (1, WORLD)
    # anchor, stiffness, damping, rest length: the order of the engine's table
    assert table.parameters[row, :6].tolist() == [0.0, 0.0, 3.0, 50.0, 1.0, 1.0]


def test_every_force_of_the_engine_can_be_written(read: Read) -> None:
    for name, kind in FORCES.items():
        force: dict[str, object] = {'type': name}
        if kind.ends == 'ab':
            force |= {'a': 'a', 'b': 'b'}
        force |= {p.name: [1.0, 0.0, 0.0, 0.0][:p.size] if p.size > 1 else 1.0
                  for p in kind.parameters}
        ball = {'shape': {'type': 'sphere', 'radius': 1}, 'mass': 1}
        scene = scene_from_dict({'bodies': [{'name': 'a', **ball}, {'name': 'b', **ball}],
                                 'forces': [force]})
        width = sum(p.size for p in kind.parameters)
        row = scene.model.forces.parameters[0]
        assert np.count_nonzero(row) == len(kind.parameters)
        assert not row[width:].any()


def test_numbers_may_be_written_in_every_way_of_yaml(read: Read) -> None:
    scene = read('bodies: [{name: a, shape: {type: sphere, radius: 1e-1}, mass: 0x10,'
                 'pose: {position: [+.5, 1_000, -0.0]}}]')
    assert scene.model.m[0] == 16.0
    assert scene.spec.bodies[0].pose.position == (0.5, 1000.0, -0.0)
    assert math.copysign(1, scene.spec.bodies[0].pose.position[2]) == -1.0


def test_anchors_and_merges_save_writing(read: Read) -> None:
    scene = read(f'bodies:\n- &a {{name: a, {BALL}}}\n- {{<<: *a, name: b}}')
    assert scene.names == ('a', 'b')
    assert scene.model.m.tolist() == [1.0, 1.0]


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    path = tmp_path / 'scene.yaml'
    path.write_text(f'\ufeffbodies: [{{name: a, {BALL}}}]', encoding='utf-8')
    assert read_scene(path).names == ('a',)


def test_a_dict_may_hold_tuples_and_numpy_arrays() -> None:
    scene = scene_from_dict({'bodies': [{
        'name': 'a', 'shape': {'type': 'box', 'size': np.array([1, 2, 3])},
        'mass': np.float32(0.5), 'pose': {'position': (1, 2, 3)}, 'fixed': np.bool_(False)}]})
    assert scene.state.x[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert scene.model.m[0] == 0.5


def test_reading_does_not_change_the_dict() -> None:
    data = {'bodies': [{'name': 'a', 'fixed': True, 'pose': {'position': (1, 2, 3)}}]}
    scene_from_dict(data)
    assert data == {'bodies': [{'name': 'a', 'fixed': True, 'pose': {'position': (1, 2, 3)}}]}


def test_text_and_file_give_the_same_scene(read: Read) -> None:
    assert scene_from_text(FULL).text == read(FULL).text
