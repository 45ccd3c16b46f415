# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""World as a Python user holds it."""

import math

from effort import examples
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World

STEP = 1e-3
HALF = math.sqrt(0.5)


def crate(**keys):
    """Return a crate whose centre of mass and principal axes are not those of its body frame."""
    return {'name': 'crate', 'shape': {'type': 'box', 'size': [1, 1, 1]},
            'inertial': {'mass': 2.0, 'com': [0.1, -0.2, 0.3],
                         'inertia': [0.4, 0.5, 0.6, 0.05, -0.03, 0.02]},
            'frames': {'handle': {'position': [0.5, 0, 0], 'orientation': [0, 0, HALF, HALF]}},
            **keys}


def make(*bodies, **world) -> World:
    return World.from_dict({
        'format': 1, 'world': {'contact': 'none', 'gravity': [0, 0, 0], 'step': STEP, **world},
        'bodies': list(bodies) or [crate()]})


def plain(name='b', **keys):
    return {'name': name, 'shape': {'type': 'sphere', 'radius': 0.5}, 'mass': 2.0, **keys}


def impulse_of_one_step(world: World, body: int = 0) -> tuple[np.ndarray, np.ndarray]:
    P, L = world.linear_momentum[body], world.angular_momentum[body]
    world.step(1)
    return world.linear_momentum[body] - P, world.angular_momentum[body] - L


# --- what enters leaves again -----------------------------------------------------------------

def test_pose_and_twist_of_the_body_frame_come_back():
    pose = {'position': [1, 2, 3], 'orientation': [0.1, 0.7, -0.1, 0.7]}
    q = np.array(pose['orientation']) / np.linalg.norm(pose['orientation'])
    world = make(crate(pose=pose | {'orientation': q.tolist()},
                       twist={'linear': [4, 5, 6], 'angular': [7, 8, 9]}))
    # A few products of numbers of order 10.
    assert np.allclose(world.position, [[1, 2, 3]], atol=1e-14)
    assert np.allclose(world.orientation, [q], atol=1e-14)
    assert np.allclose(world.linear_velocity, [[4, 5, 6]], atol=1e-13)
    assert np.allclose(world.angular_velocity, [[7, 8, 9]], atol=1e-13)


def test_the_twist_is_that_of_the_body_origin_not_of_the_centre_of_mass():
    world = make(crate(twist={'angular': [0, 0, 2.0]}))
    # v_com = w x (0.1, -0.2, 0.3) = (0.4, 0.2, 0)
    assert np.allclose(world.linear_momentum[0], 2.0 * np.array([0.4, 0.2, 0.0]), atol=1e-15)


def test_a_free_body_turns_about_its_centre_of_mass():
    world = make(crate(twist={'linear': [0, 0, 0], 'angular': [0, 0, 2.0]}))
    com, v = world.center_of_mass[0], world.linear_momentum[0] / 2.0
    world.step(500)
    assert np.allclose(world.center_of_mass[0], com + 0.5 * v, atol=1e-13)


def test_set_pose_keeps_the_twist():
    world = make(crate(twist={'linear': [4, 5, 6], 'angular': [7, 8, 9]}))
    world.set_pose('crate', (1, 1, 1), (0, HALF, 0, HALF))
    assert np.allclose(world.position, [[1, 1, 1]], atol=1e-15)
    assert np.allclose(world.orientation, [[0, HALF, 0, HALF]], atol=1e-15)
    assert np.allclose(world.linear_velocity, [[4, 5, 6]], atol=1e-13)
    assert np.allclose(world.angular_velocity, [[7, 8, 9]], atol=1e-13)


def test_set_twist_keeps_the_pose():
    world = make()
    world.set_twist('crate', (1, 2, 3), (4, 5, 6))
    assert np.allclose(world.linear_velocity, [[1, 2, 3]], atol=1e-14)
    assert np.allclose(world.angular_velocity, [[4, 5, 6]], atol=1e-14)
    assert np.allclose(world.position, [[0, 0, 0]], atol=1e-16)


def test_what_a_property_returns_is_the_users_own():
    world = make()
    world.position[:] = 7.0
    world.linear_momentum[:] = 7.0
    assert np.allclose(world.position, 0.0, atol=1e-15)
    assert not world.linear_momentum.any()


def test_energy_and_momenta_add_up_over_the_bodies():
    world = make(plain('a', twist={'linear': [1, 0, 0], 'angular': [0, 0, 2]}),
                 plain('b', pose={'position': [0, 3, 0]}, twist={'linear': [0, 0, 2]}),
                 gravity=[0, -10, 0])
    # m = 2, I = 2/5 m r^2 = 0.2: E = 1 + 0.4 + 4; P = (2, 0, 4); L = I w + x x P of b = (12, 0,
    # 0.4).
    assert world.kinetic_energy() == pytest.approx(5.4, rel=1e-15)
    assert world.potential_energy() == pytest.approx(60.0, rel=1e-15)
    assert np.allclose(world.total_momentum(), [2, 0, 4], rtol=1e-15)
    assert np.allclose(world.total_angular_momentum(), [12, 0, 0.4], atol=1e-14)


# --- wrenches ---------------------------------------------------------------------------------

def test_a_wrench_acts_for_the_next_step_only():
    world = make(plain())
    world.apply_wrench('b', force=(3, 0, 0))
    world.step(5)
    assert np.allclose(world.linear_momentum[0], [3 * STEP, 0, 0], rtol=1e-14)


def test_a_duration_is_rounded_to_whole_steps():
    world = make(plain())
    world.apply_wrench('b', force=(3, 0, 0), duration=0.0104)
    world.step(100)
    assert world.linear_momentum[0, 0] == pytest.approx(3 * 10 * STEP, rel=1e-13)


def test_wrenches_add_up():
    world = make(plain())
    world.apply_wrench('b', force=(1, 0, 0))
    world.apply_wrench('b', force=(2, 0, 0), torque=(0, 0, 1))
    dP, dL = impulse_of_one_step(world)
    assert np.allclose(dP, [3 * STEP, 0, 0], rtol=1e-14)
    assert np.allclose(dL, [0, 0, STEP], rtol=1e-14)


def test_a_source_replaces_what_it_applied_before():
    world = make(plain())
    world.apply_wrench('b', force=(1, 0, 0), duration=1.0, source='first')
    world.apply_wrench('b', force=(0, 1, 0), duration=1.0, source='second')
    world.apply_wrench('b', force=(0, 0, 1), duration=1.0, source='first')
    dP, _ = impulse_of_one_step(world)
    assert np.allclose(dP, [0, STEP, STEP], rtol=1e-14)


def test_cancelling_a_source_ends_its_wrenches():
    world = make(plain())
    world.apply_wrench('b', force=(1, 0, 0), duration=1.0, source='me')
    world.cancel_wrenches('me')
    dP, _ = impulse_of_one_step(world)
    assert not dP.any()


TURNED = {'orientation': [0, 0, HALF, HALF]}  # a quarter turn about z: body x is world y


@pytest.mark.parametrize(('frame', 'force', 'torque'), [
    # World axes, at the centre of mass.
    ('world', [1, 0, 0], [0, 0, 0]),
    ('', [1, 0, 0], [0, 0, 0]),
    # Body axes, at the body origin: the centre of mass is at (0.1, -0.2, 0.3) in B, so at (0.2,
    # 0.1, 0.3) in W; r = -(0.2, 0.1, 0.3), F = (0, 1, 0): r x F = (0.3, 0, -0.2).
    ('crate', [0, 1, 0], [0.3, 0, -0.2]),
    # Another quarter turn: F = (-1, 0, 0) at the handle (0, 0.5, 0): r = (-0.2, 0.4, -0.3), r x F
    # = (0, 0.3, 0.4).
    ('crate/handle', [-1, 0, 0], [0, 0.3, 0.4]),
    # Axes of another body, turned by half about z; at the centre of mass.
    ('b', [-1, 0, 0], [0, 0, 0]),
])
def test_the_frame_of_a_wrench_gives_its_axes_and_its_point(frame, force, torque):
    world = make(crate(pose=TURNED),
                 plain(pose={'position': [9, 9, 9], 'orientation': [0, 0, 1, 0]}))
    world.apply_wrench('crate', force=(1, 0, 0), frame=frame)
    dP, dL = impulse_of_one_step(world)
    # The step evaluates the wrench at both ends; a body at rest turns by tau h^2 / I = 1e-6 rad
    # meanwhile.
    assert np.allclose(dP / STEP, force, atol=2e-6)
    assert np.allclose(dL / STEP, torque, atol=2e-6)


@pytest.mark.parametrize(('frame', 'torque'), [
    ('world', [0, 0, 1]), ('crate', [0, 0, 1]), ('crate/handle', [0, 0, 1]), ('b', [0, -1, 0])])
def test_the_frame_of_a_wrench_turns_its_torque(frame, torque):
    world = make(crate(pose=TURNED), plain(pose={'orientation': [HALF, 0, 0, HALF]}))
    world.apply_wrench('crate', torque=(0, 0, 1), frame=frame)
    dP, dL = impulse_of_one_step(world)
    assert not dP.any()
    assert np.allclose(dL / STEP, torque, atol=2e-6)


@pytest.mark.parametrize(('frame', 'point'), [
    ('world', (0.0, 0.0, 2.0)), ('crate', (0.0, 0.0, 2.0)), ('b', (-5.0, 0.0, 2.0))])
def test_a_point_is_given_in_the_frame(frame, point):
    world = make(plain('crate'), plain('b', pose={'position': [5, 0, 0]}))
    world.apply_wrench('crate', force=(1, 0, 0), frame=frame, point=point)
    _, dL = impulse_of_one_step(world)
    assert np.allclose(dL / STEP, [0, 2, 0], atol=1e-5)


def test_a_force_in_body_axes_turns_with_the_body():
    world = make(plain(twist={'angular': [0, 0, 2 * math.pi]}))
    world.apply_wrench('b', force=(1, 0, 0), frame='b', duration=1.0)
    world.step(1000)
    # Over a whole turn the force averages to nothing; the trapezoidal rule is exact for a period.
    assert np.allclose(world.linear_momentum[0], 0.0, atol=1e-12)


def test_an_impulse_changes_the_momenta_at_once():
    world = make(plain())
    world.apply_impulse('b', (0, 0, 3), point=(1, 0, 0), frame='b')
    assert np.allclose(world.linear_momentum[0], [0, 0, 3])
    assert np.allclose(world.angular_momentum[0], [0, -3, 0])
    assert world.time_ns == 0


def test_an_impulse_without_a_point_acts_at_the_centre_of_mass():
    world = make()
    world.apply_impulse('crate', (1, 2, 3))
    assert np.allclose(world.linear_momentum[0], [1, 2, 3])
    assert np.allclose(world.angular_momentum[0], 0.0, atol=1e-15)


def test_a_fixed_body_takes_no_impulse():
    world = make(plain(fixed=True))
    world.apply_impulse('b', (1, 2, 3))
    assert not world.linear_momentum.any()


# --- bad input --------------------------------------------------------------------------------

@pytest.mark.parametrize(('call', 'message'), [
    (lambda w: w.step(-1), r'step count -1, must be a whole number >= 0'),
    (lambda w: w.step(1.5), r'step count 1.5'),
    (lambda w: w.step(True), r'step count True'),
    (lambda w: w.apply_wrench('crat'), r"body 'crat' does not exist, must be one of: crate"),
    (lambda w: w.apply_wrench('crate', frame='crate/knob'), r"frame 'crate/knob' does not exist"),
    (lambda w: w.apply_wrench('crate', (math.nan, 0, 0)), r'force \[nan, 0.0, 0.0\], must be'),
    (lambda w: w.apply_wrench('crate', torque=(0, math.inf, 0)), r'torque \[0.0, inf, 0.0\]'),
    (lambda w: w.apply_wrench('crate', (1, 2)), r'force \[1.0, 2.0\], must be three'),
    (lambda w: w.apply_wrench('crate', 'up'), r"force 'up', must be three numbers"),
    (lambda w: w.apply_wrench('crate', duration=-1.0), r'duration -1.0 s, must be'),
    (lambda w: w.apply_wrench('crate', duration=math.nan), r'duration nan s, must be'),
    (lambda w: w.apply_impulse('crate', (0, 0, math.inf)), r'impulse \[0.0, 0.0, inf\]'),
    (lambda w: w.set_pose('crate', (0, 0, 0), (0, 0, 0, 2)), r'orientation .* of length 1'),
    (lambda w: w.set_pose('crate', (0, 0, 0), (0, 0, 1)), r'orientation .* of length 1'),
    (lambda w: w.set_pose('crate', (0, math.nan, 0), (0, 0, 0, 1)), r'position'),
    (lambda w: w.set_twist('crate', (0, 0, 0), (0, 0, math.nan)), r'angular velocity'),
    (lambda w: w.set_twist('wall', (0, 0, 1), (0, 0, 0)), r"body 'wall' is fixed"),
    (lambda w: w.restore(b'nothing'), r'7 bytes are not a snapshot'),
])
def test_bad_input_is_refused_with_its_value_and_changes_nothing(call, message):
    world = make(crate(), plain('wall', fixed=True))
    before = world.state_hash()
    with pytest.raises(ValueError, match=message):
        call(world)
    assert world.state_hash() == before


def test_a_motion_beyond_all_numbers_stops_with_the_body_and_the_step():
    world = make(plain(), gravity=[0, 0, -1e300], step=1.0)
    with pytest.raises(ArithmeticError, match=r"body 'b': .* at step \d+; use a step smaller"):
        for _ in range(100):
            world.step(1_000_000)


# --- the state as a whole ---------------------------------------------------------------------

def busy_world() -> World:
    world = make(crate(twist={'linear': [1, 2, 3], 'angular': [3, 2, 1]}), plain(),
                 gravity=[0, 0, -9.81])
    world.apply_wrench('crate', (1, 2, 3), frame='crate/handle', duration=0.05, source='hand')
    world.apply_wrench('b', (0, 0, 1), frame='crate', duration=0.02)
    return world


@examples(20)
@given(st.integers(0, 80), st.integers(0, 80))
def test_a_restored_world_goes_on_bit_for_bit(before, after):
    world, other = busy_world(), busy_world()
    world.step(before)
    saved = world.save()
    world.step(after)
    other.restore(saved)
    other.step(after)
    assert other.state_hash() == world.state_hash()
    assert other.time_ns == world.time_ns
    assert np.array_equal(other.position, world.position)


def test_a_restored_source_is_still_replaced():
    world, other = busy_world(), busy_world()
    other.restore(world.save())
    for w in (world, other):
        w.apply_wrench('crate', (0, 0, 0), source='hand')
        w.step(3)
    assert world.state_hash() == other.state_hash()


@given(st.data())
@examples(50)
def test_a_damaged_snapshot_is_refused(data):
    saved = bytearray(busy_world().save())
    i = data.draw(st.integers(0, len(saved) - 1))
    saved[i] ^= 1 << data.draw(st.integers(0, 7))
    world = busy_world()
    with pytest.raises(ValueError, match='snapshot'):
        world.restore(bytes(saved))


def test_a_snapshot_of_another_scene_is_refused():
    heavier = make(plain(mass=3.0))
    with pytest.raises(ValueError, match='of another scene'):
        heavier.restore(make(plain()).save())


def test_reset_returns_everything():
    world = busy_world()
    start = make(crate(twist={'linear': [1, 2, 3], 'angular': [3, 2, 1]}), plain(),
                 gravity=[0, 0, -9.81])
    world.step(10)
    world.reset()
    assert world.time_ns == 0
    assert world.state_hash() == start.state_hash()


def test_reset_can_keep_the_time():
    world = busy_world()
    world.step(10)
    world.reset(keep_time=True)
    assert world.step_index == 10
    assert world.time_ns == 10_000_000


@pytest.mark.parametrize('change', [
    lambda w: w.step(1),
    lambda w: w.set_pose('b', (0, 0, 1e-300), (0, 0, 0, 1)),
    lambda w: w.apply_impulse('b', (1e-300, 0, 0)),
    lambda w: w.apply_wrench('b', (1, 0, 0)),
    lambda w: w.cancel_wrenches('hand')])
def test_the_hash_notices_every_change(change):
    world = busy_world()
    before = world.state_hash()
    change(world)
    assert world.state_hash() != before


def test_the_hash_has_64_bits():
    assert 0 <= busy_world().state_hash() < 2 ** 64


def test_a_step_count_may_be_one_of_numpys_integers():
    world = make(plain())
    for count in (np.int64(2), np.uint8(1), np.int32(0)):
        world.step(count)
    assert world.step_index == 3
    assert type(world.step_index) is int


def test_time_is_the_number_of_steps_times_the_step():
    world = make(plain(), step=1 / 240)
    world.step(240)
    assert world.step_ns == 4_166_667
    assert world.time_ns == 240 * 4_166_667


def test_load_scene_takes_the_name_of_an_example():
    world = load_scene('t_handle')
    world.step(10)
    assert world.step_index == 10
