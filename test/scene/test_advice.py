# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Warnings about scenes that are legal and will yet not go well."""
import pytest

from rigid_sim_ros.scene import scene_from_text
from rigid_sim_ros.scene.advice import advice

# A ball of 2 kg, 2/5 m r^2 = 0.008 kg m^2.
BALL = '{name: ball, shape: {type: sphere, radius: 0.1}, mass: 2}'


def advice_for(world: str = '', bodies: str = BALL, forces: str = '') -> list[str]:
    scene = f'world: {{step: 0.001, {world}}}\nbodies: [{bodies}]\nforces: [{forces}]\n'
    return advice(scene_from_text(scene))


def spring(stiffness: float, damping: float = 0.0) -> str:
    return f'{{type: spring, a: ball, stiffness: {stiffness}, damping: {damping}}}'


def test_a_scene_that_goes_well_has_no_warning() -> None:
    assert advice_for(forces=spring(100.0, 1.0)) == []


def test_a_spring_that_swings_by_half_a_radian_in_a_step_is_too_stiff() -> None:
    # sqrt(k / m) h = 0.5 at k = 2 * 500^2 = 5e5 N/m.
    assert advice_for(forces=spring(4.9e5)) == []
    assert 'oscillate' in advice_for(forces=spring(5.1e5))[0]


def test_a_spring_beyond_the_limit_of_stability_is_said_to_grow() -> None:
    # sqrt(k / m) h = 2 at k = 2 * 2000^2 = 8e6 N/m.
    assert 'grow without bound' in advice_for(forces=spring(8.1e6))[0]


def test_the_step_that_is_advised_brings_no_warning() -> None:
    line = advice_for(forces=spring(2.0e6))[0]
    step = line.split('at most ')[1].split()[0]
    scene = f'world: {{step: {step}}}\nbodies: [{BALL}]\nforces: [{spring(2.0e6)}]\n'
    assert advice(scene_from_text(scene)) == []


def test_a_damper_that_takes_half_the_speed_in_a_step_is_too_strong() -> None:
    # c h / m = 0.5 at c = 1000 N s/m.
    assert advice_for(forces=spring(1.0, 990.0)) == []
    assert 'velocity' in advice_for(forces=spring(1.0, 1010.0))[0]


def test_the_lever_arm_of_a_frame_counts() -> None:
    # At the arm r: 1/m + r^2 / I = 0.5 + 1 / 0.008 = 125.5 /kg instead of 0.5.
    ball = BALL.replace('mass: 2', 'mass: 2, frames: {tip: {position: [1, 0, 0]}}')
    tip = spring(1.0e4).replace('a: ball', 'a: ball/tip')
    assert advice_for(bodies=ball, forces=spring(1.0e4)) == []
    assert 'ball/tip' in advice_for(bodies=ball, forces=tip)[0]


def test_the_lever_arm_of_an_anchor_counts_beyond_that_of_its_frame() -> None:
    # At the arm of 1 + 1 m: 1/m + r^2 / I = 0.5 + 4 / 0.008 = 500.5 /kg, and that of the other
    # end; sqrt(k 501) h = 0.5 at k = 499 N/m. With an arm of 1 m it would be 1984 N/m.
    two = BALL.replace('mass: 2', 'mass: 2, frames: {tip: {position: [1, 0, 0]}}') + ', ' + (
        BALL.replace('ball', 'other').replace('mass: 2', 'mass: 2, pose: {position: [3, 0, 0]}'))
    force = '{type: spring, a: other, b: ball/tip, anchor: [1, 0, 0], stiffness: %s}'
    assert advice_for(bodies=two, forces=force % 490) == []
    assert 'oscillate' in advice_for(bodies=two, forces=force % 510)[0]


@pytest.mark.parametrize('force', [
    '{type: wind, drag: 1010}',
    '{type: wind, velocity: [10, 0, 0], quadratic_drag: 101}',
    '{type: wind, angular_drag: 4.1}',
    '{type: hold_point, a: ball, stiffness: 5.1e+5}',
    '{type: hold_orientation, a: ball, stiffness: 2040}',
])
def test_every_kind_of_force_is_watched(force: str) -> None:
    # m = 2 kg and I = 0.008 kg m^2 at 1 ms: limits 1000 N s/m, 4 N m s, 5e5 N/m and 2000 N m/rad.
    kind = force.split()[1].strip(',')
    assert advice_for(forces=force)[0].startswith(kind)


def test_avoidance_is_watched() -> None:
    # Two of 2 kg: sqrt(2 k / m) h = 0.5 at k = 2.5e5 N/m.
    pair = f'{BALL}, {BALL.replace("ball", "other")}'
    lines = advice_for('contact: none', pair, '{type: avoidance, range: 1, stiffness: 2.6e+5}')
    assert lines[0].startswith('avoidance between ball and other')


def test_a_fast_spin_is_no_matter_for_the_default_integrator_only() -> None:
    ball = BALL.replace('mass: 2', 'mass: 2, twist: {angular: [0, 0, 300]}')
    assert advice_for(bodies=ball) == []
    assert "body 'ball' turns by 0.3 rad" in advice_for('integrator: rk4', ball)[0]


def test_the_explicit_euler_method_is_for_comparison() -> None:
    assert 'euler' in advice_for('integrator: euler')[0]


def test_an_orientation_that_the_integrator_does_not_ask_for_is_said() -> None:
    assert 'integrator symplectic does not ask' in advice_for('orientation: matrix')[0]
    assert 'integrator rk4 does not ask' in advice_for(
        'orientation: axis_angle, integrator: rk4')[0]
    assert advice_for('orientation: matrix, integrator: semi_implicit') == []


def test_an_integrator_that_contact_does_not_use_is_said() -> None:
    pair = f'{BALL}, {BALL.replace("ball", "other")}'
    assert 'runs worlds without contact only' in advice_for('integrator: rk4', pair)[0]
    assert advice_for('integrator: rk4, contact: none', pair) == []
    assert advice_for('integrator: rk4') == []  # a body alone touches nothing


def test_a_robot_with_dry_friction_is_told_what_symplectic4_does() -> None:
    joint = ('{name: axle, type: revolute, parent: world, child: ball, axis: [0, 0, 1], '
             'friction: %g}')
    for friction, beginnings in ((0.0, []), (0.1, ["joint 'axle' has dry friction"])):
        said = advice(scene_from_text(
            f'world: {{contact: none, integrator: symplectic4}}\nbodies: [{BALL}]\n'
            f'joints: [{joint % friction}]\n'))
        assert [line.split(', which')[0] for line in said] == beginnings


def test_symplectic4_is_of_worlds_without_contact() -> None:
    robot = scene_from_text(
        'world: {integrator: symplectic4}\ncollision: {sleep_after: 0.5}\n'
        f'bodies: [{BALL}]\njoints: [{{name: axle, type: revolute, parent: world, child: ball, '
        'axis: [0, 0, 1]}]\n')
    assert 'integrator symplectic4 runs worlds without contact only' in advice(robot)[0]


def touching(depth: float, more: str = '') -> list[str]:
    bodies = ', '.join(
        f'{{name: {name}, shape: {{type: box, size: [1, 1, 1]}}, mass: 1, '
        f'pose: {{position: [{x}, 0, 0]}}}}' for name, x in (('a', 0.0), ('b', 1.0 - depth)))
    return advice(scene_from_text(f'bodies: [{bodies}]\n{more}\n'))


def test_a_lever_that_the_solver_does_not_know_is_named() -> None:
    scene = 'world: {{solver: {}}}\nmaterials: {{felt: {{rolling: 0.01}}}}\nbodies: [{}]\n'
    lines = advice(scene_from_text(scene.format('qp', BALL)))
    assert len(lines) == 1 and "material 'felt' resists rolling" in lines[0]
    assert advice(scene_from_text(scene.format('sequential', BALL))) == []


# A cube of 1 m whose upper face goes down to a point at the height z.
DENTED = """{{name: die, mass: 1, shape: {{type: mesh, vertices: "0 0 0, 1 0 0, 1 1 0, 0 1 0, \
0 0 1, 1 0 1, 1 1 1, 0 1 1, 0.5 0.5 {z}", faces: "0 2 1, 0 3 2, 0 1 5, 0 5 4, 1 2 6, 1 6 5, \
2 3 7, 2 7 6, 3 0 4, 3 4 7, 4 5 8, 5 6 8, 6 7 8, 7 4 8"}}}}"""


def test_a_mesh_that_collides_as_something_larger_is_named_with_both_volumes() -> None:
    # The dent is a pyramid of 0.75 m: 1 - 0.75 / 3.
    lines = advice_for(bodies=DENTED.format(z=0.25))
    assert len(lines) == 1
    assert "'die' has a mesh of 0.75 m^3 in a convex hull of 1 m^3" in lines[0]
    assert advice_for(bodies=DENTED.format(z=0.99)) == []
    assert advice_for('contact: none', bodies=DENTED.format(z=0.25)) == []


def test_bodies_that_overlap_at_the_start_are_named_with_the_depth() -> None:
    line, = touching(0.0125)
    assert line.startswith("bodies 'a' and 'b' overlap by 0.0125 m")


@pytest.mark.parametrize('depth, more', [
    (-0.1, ''), (0.0, ''), (1e-4, ''), (0.1, 'world: {contact: none}'),
    (0.1, 'collision: {ignore: [[a, b]]}')])
def test_bodies_that_only_touch_or_cannot_are_no_overlap(depth: float, more: str) -> None:
    assert touching(depth, more) == []


def test_of_many_overlaps_the_deepest_are_named_and_the_rest_is_counted() -> None:
    bodies = ', '.join(
        f'{{name: b{k}, shape: {{type: sphere, radius: 0.5}}, mass: 1, '
        f'pose: {{position: [{0.9 * k + 0.002 * k * k}, 0, 0]}}}}' for k in range(9))
    lines = advice(scene_from_text(f'bodies: [{bodies}]\n'))
    # The distance from k to k + 1 is 0.9 + 0.002 (2 k + 1): the first two are the nearest.
    assert "'b0' and 'b1' overlap by 0.098 m" in lines[0]
    assert lines[5:] == ['3 more pairs of bodies overlap at the start, less deep']
