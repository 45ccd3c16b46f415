# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joints in scene files: what is read, and what is wrong with one."""

from bag.hostile import limited_time
import numpy as np
import pytest

from rigid_sim_ros.engine.model import joints as engine
from rigid_sim_ros.scene import scene_from_text, SceneError, schema
from rigid_sim_ros.scene.joints import _check_mimic, _starts

BODIES = """
world: {contact: none}
bodies:
- {name: base, fixed: true}
- {name: arm, inertial: {mass: 1, inertia: [0.1, 0.1, 0.1, 0, 0, 0]}, pose: {position: [1, 0, 0]}}
- {name: hand, inertial: {mass: 1, inertia: [0.1, 0.1, 0.1, 0, 0, 0]}, pose: {position: [2, 0, 0]}}
"""


def read(*joints, text=BODIES):
    return scene_from_text(text + 'joints:\n' + ''.join(f'- {{{joint}}}\n' for joint in joints))


def mistakes(*joints, text=BODIES):
    with pytest.raises(SceneError) as error:
        read(*joints, text=text)
    return [f'{problem.key}: {problem.message}' for problem in error.value.problems]


SHOULDER = 'name: shoulder, type: revolute, parent: base, child: arm, axis: [0, 1, 0]'
ELBOW = ('name: elbow, type: revolute, parent: arm, child: hand, axis: [0, 1, 0], '
         'pose: {position: [0.5, 0, 0]}')


def test_a_scene_without_joints_says_nothing_of_them():
    scene = scene_from_text(BODIES)
    assert scene.joints is None
    assert 'joints' not in scene.text


def test_the_text_of_a_scene_with_joints_reads_back_the_same():
    scene = read(SHOULDER + ', position: 0.3', ELBOW + ', drive: {mode: effort}')
    again = scene_from_text(scene.text)
    assert again.text == scene.text
    np.testing.assert_array_equal(again.state.x, scene.state.x)


def test_bodies_are_written_at_positions_0_and_what_hangs_on_a_joint_moves_with_it():
    scene = read(SHOULDER + ', position: 1.5707963267948966', ELBOW)
    # About +y by a quarter turn: from along x to along -z.
    np.testing.assert_allclose(scene.state.x[:, 1:], [[0, 0], [0, 0], [-1, -2]], atol=1e-15)


def test_every_type_is_read():
    kinds = {'fixed': 0, 'revolute': 1, 'continuous': 1, 'prismatic': 1, 'spherical': 3,
             'universal': 2, 'planar': 3}
    for kind, axes in kinds.items():
        table = read(f'name: j, type: {kind}, parent: world, child: arm').joints.table
        assert len(table.translates) == axes


def test_a_second_way_from_body_to_body_closes_a_loop():
    rod = 'name: rod, type: spherical, parent: base, child: hand'
    table = read(SHOULDER, ELBOW, rod).joints.table
    assert table.row_of_joint.tolist() == [0, 1, engine.NONE]
    assert len(table.condition_joint) == 3


def test_a_joint_that_a_file_has_the_other_way_round_is_passed_backwards():
    table = read('name: shoulder, type: revolute, parent: arm, child: base').joints.table
    assert table.sense.tolist() == [-1.0]


@pytest.mark.parametrize(('joint', 'message'), [
    ('name: j, type: hinge, parent: base, child: arm',
     "joints[0].type: 'hinge', must be fixed, revolute, continuous, prismatic, spherical, "
     'universal, planar, distance or free'),
    ('name: j, type: fixed, parent: bas, child: arm',
     "joints[0].parent: 'bas' is no body, did you mean 'base'?"),
    ('name: j, type: fixed, parent: arm, child: arm',
     "joints[0].child: 'arm' is the parent too, must be another body"),
    ('name: j, type: fixed, parent: world, child: base',
     "joints[0].child: neither 'world' nor 'base' can move, must be a body that is not fixed, or "
     'no joint'),
    (SHOULDER.replace('[0, 1, 0]', '[0, 0, 0]'),
     'joints[0].axis: [0, 0, 0] has no direction, must be such as [0, 0, 1]'),
    (SHOULDER + ', limits: {lower: 1, upper: -1}',
     'joints[0].limits.lower: 1 is above upper -1, must be below it'),
    (SHOULDER + ', limits: {lower: 1}',
     'joints[0].position: 0 is beyond the limits, must be within 1 .. inf'),
    (SHOULDER + ', damping: -1', 'joints[0].damping: -1 N m s/rad or N s/m, must be >= 0'),
    (SHOULDER + ', drive: {mode: position}',
     'joints[0].drive.stiffness: is missing, must be given for the mode position'),
    (SHOULDER + ', drive: {mode: velocity}',
     'joints[0].drive.gain: is missing, must be given for the mode velocity'),
    (SHOULDER + ', mimic: {joint: elbow}',
     "joints[0].mimic.joint: 'elbow' is no joint with one axis, must be shoulder"),
    (SHOULDER + ', mimic: {joint: shoulder}',
     "joints[0].mimic.joint: 'shoulder' leads back to this joint, must not"),
    ('name: j, type: spherical, parent: base, child: arm, friction: 1',
     'joints[0].friction: stands in a spherical joint, must stand in one of the type revolute, '
     'continuous, prismatic'),
    ('name: j, type: continuous, parent: base, child: arm, limits: {upper: 1}',
     'joints[0].limits: has bounds in a continuous joint, must have none, or the type be '
     'revolute'),
    ('name: j, type: distance, parent: base, child: arm',
     'joints[0].child_pose: is missing, must say to which point of the child the distance is'),
    ('name: j, type: distance, parent: base, child: arm, child_pose: {position: [-1, 0, 0]}',
     'joints[0].child_pose: is where the frame in the parent is, must be away from it: the '
     'distance between both is kept'),
    ('name: j, type: universal, parent: base, child: arm, axis2: [0, 1, 1]',
     'joints[0].axis2: [0.0, 1.0, 1.0] is not at right angles to the axis [0.0, 0.0, 1.0], must '
     'be'),
    (SHOULDER + ', child_pose: {position: [-0.9, 0, 0]}',
     "joints[0]: its frames in 'base' and 'arm' are 0.1 m or rad apart where these bodies are "
     'written, must meet at position 0: leave child_pose out, move a body, or write brings_child: '
     'true'),
], ids=lambda value: None)
def test_a_mistake_is_named_with_its_value_and_its_mend(joint, message):
    assert mistakes(joint) == [message]


def test_two_joints_of_a_name_are_a_mistake():
    assert mistakes(SHOULDER, ELBOW.replace('elbow', 'shoulder')) == [
        "joints[1].name: 'shoulder' is the name of joints[0] too, must be unique"]


def test_forces_along_a_joint_that_can_only_close_a_loop_are_a_mistake():
    rod = 'name: rod, type: revolute, parent: base, child: hand, axis: [0, 1, 0], damping: 1'
    assert mistakes(SHOULDER + ', damping: 1', ELBOW + ', damping: 1', rod) == [
        'joints[2]: closes a loop and has forces along its axis, must have none: let a joint '
        'without forces close the loop']


def test_a_joint_without_forces_closes_the_loop_wherever_it_stands():
    rod = 'name: rod, type: revolute, parent: base, child: hand, axis: [0, 1, 0], damping: 1'
    table = read(SHOULDER, ELBOW + ', damping: 1', rod).joints.table
    assert table.row_of_joint[0] == engine.NONE


def test_a_loop_that_cannot_close_is_a_mistake():
    far = ('name: rod, type: spherical, parent: base, child: hand, pose: {position: [0, 0, 5]}, '
           'child_pose: {position: [0, 0, 0]}')
    found = mistakes(SHOULDER, ELBOW, far)
    assert len(found) == 1
    assert found[0].startswith('joints[2]: does not close: its frames stay ')


@pytest.mark.parametrize('contact', ['none', 'event', 'penalty', 'timestep, solver: qp'])
def test_joints_are_seen_by_every_model_of_contact(contact):
    text = BODIES.replace('contact: none', f'contact: {contact}')
    assert read(SHOULDER, text=text).joints.table.first_row.tolist() == [0, 1]


def test_a_follower_begins_where_the_joint_that_it_mimics_has_it():
    scene = read(SHOULDER + ', position: 0.4', ELBOW + ', mimic: {joint: shoulder, multiplier: -1,'
                 ' offset: 0.1}')
    assert scene.joints.position.tolist() == [0.4, pytest.approx(-0.3)]


def test_joints_that_mimic_one_another_may_be_more_than_python_calls_functions_deep():
    count = 5000
    chain = [schema.Joint(name=f'j{i}', type='revolute', parent='world', child=f'b{i}',
                          mimic={'joint': f'j{i + 1}', 'multiplier': 1.0, 'offset': 0.25})
             for i in range(count)]
    first = schema.Joint(name=f'j{count}', type='revolute', parent='world', child='b',
                         position=1.0)
    # Quarters of integers are exact.
    assert _starts([*chain, first]).tolist() == [
        1.0 + 0.25 * i for i in range(count, -1, -1)]


def test_who_mimics_itself_by_way_of_others_is_named_with_all_who_follow():
    turning = 'type: revolute, parent: world, child: arm, axis: [0, 1, 0]'
    found = mistakes(*(f'name: {name}, {turning}, mimic: {{joint: {other}}}' for name, other in (
        ('before', 'a'), ('a', 'b'), ('b', 'c'), ('c', 'a'), ('after', 'before'))),
        f'name: free, {turning}', f'name: good, {turning}, mimic: {{joint: free}}')
    assert found == [
        f'joints[{i}].mimic.joint: {other!r} leads back to this joint, must not'
        for i, other in enumerate(('a', 'b', 'c', 'a', 'before'))]


@pytest.mark.parametrize('is_ring', [True, False])
def test_to_follow_joints_that_follow_joints_takes_no_time(is_ring):
    """Each is followed once: to go along a chain from each of its joints took its square."""
    count = 40_000
    joints = [schema.Joint(name=f'j{i}', type='revolute', parent='world', child='a',
                           mimic={'joint': f'j{(i + 1) % count}'}) for i in range(count)]
    if not is_ring:
        joints[-1] = joints[-1].model_copy(update={'mimic': None})
    others, known, found = {joint.name: joint for joint in joints}, {}, []
    with limited_time():
        for joint in joints:
            _check_mimic(joint, others, known, lambda *problem: found.append(problem))
    assert len(found) == (count if is_ring else 0)


def test_a_child_is_brought_to_where_its_joint_wants_it_wherever_it_is_written():
    scene = read(SHOULDER + ', child_pose: {position: [-0.4, 0, 0]}, brings_child: true',
                 ELBOW)
    # The hand was written a metre away from the arm, and goes along.
    np.testing.assert_allclose(scene.state.x[:, 1:], [[0.4, 1.4], [0, 0], [0, 0]], atol=1e-15)


def test_a_distance_may_have_a_length_of_its_own():
    rope = ('name: rope, type: distance, parent: base, child: arm, length: 0.25, '
            'child_pose: {position: [0, 0, 0]}')
    scene = read(rope)
    assert np.linalg.norm(scene.state.x[:, 1]) == pytest.approx(0.25, abs=1e-12)
    assert mistakes(SHOULDER + ', length: 1') == [
        'joints[0].length: stands in a revolute joint, must stand in one of the type distance']


def test_an_integrator_that_does_not_close_joints_is_a_mistake():
    text = BODIES.replace('contact: none', 'contact: none, integrator: %s')
    assert mistakes(SHOULDER, text=text % 'rk4') == [
        "world.integrator: 'rk4' beside joints, must be symplectic or symplectic4, which keep "
        'them closed']
    assert read(SHOULDER, text=text % 'symplectic4').integrator == 'symplectic4'
