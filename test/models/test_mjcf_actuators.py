# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Actuators of MJCF files move joints as in MuJoCo, and what is none of the known ones is told."""
from models.robots import write
import mujoco
import numpy as np
import pytest

from rigid_sim_ros import load_scene, World

ARM = """<mujoco model="arm">
  <option timestep="0.0005"/>
  <default><geom contype="0" conaffinity="0" type="capsule" size=".03"/></default>
  <worldbody>
    <body name="a" pos="0 0 1"><joint name="j1" axis="0 1 0"/><geom fromto="0 0 0 0 0 -.5"/>
      <body name="b" pos="0 0 -.5"><joint name="j2" axis="0 1 0" ref="10"/>
        <geom fromto="0 0 0 0 0 -.4"/>
        <body name="c" pos="0 0 -.4"><joint name="j3" axis="0 1 0"/>
          <geom fromto="0 0 0 0 0 -.4"/></body></body></body>
  </worldbody>
  <actuator>
{actuators}
  </actuator>
</mujoco>
"""


def arm(folder, actuators):
    """Return a world, and MuJoCo's model, of an arm with these actuators."""
    path = write(folder, 'arm.xml', ARM.format(actuators=actuators))
    return load_scene(path), mujoco.MjModel.from_xml_path(str(path))


def joints(world):
    return {joint.name.removeprefix('arm/'): joint for joint in world.scene.spec.joints}


def test_servos_and_motors_move_an_arm_as_in_mujoco(tmp_path):
    world, model = arm(tmp_path, """
      <position joint="j1" kp="20" kv="1" gear="2" ctrlrange="0.4 1"/>
      <velocity joint="j2" kv="1.5" gear="1.5"/>
      <motor joint="j3" gear="3" armature="0.001" damping="0.002"/>""")
    scene = world.scene.spec.model_dump(exclude_none=True)
    scene['world'] = {**scene['world'], 'step': 0.001}
    coarse = World.from_dict(scene)
    for one, steps in ((world, 1000), (coarse, 500)):
        # With gear g a servo of the velocity u / g, and a motor of the effort g u.
        one.set_joint_command('arm/j2', velocity=0.6)
        one.set_joint_command('arm/j3', effort=0.3)
        one.step(steps)
    # The truth: a method of fourth order with a fiftieth of the step. Its first control is 0,
    # which MuJoCo keeps within the range of the servo: 0.4.
    model.opt.timestep, model.opt.integrator = 1e-5, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.0, 0.6 * 1.5, 0.1
    mujoco.mj_step(model, data, nstep=50000)
    # Second order: steps of 1 ms have four times the error e of those of 0.5 ms, so that both are
    # 3 e apart; half of that leaves room for the next order.
    apart = np.abs(coarse.joint_position - world.joint_position).max()
    assert 1e-7 < apart < 1e-4
    np.testing.assert_allclose(world.joint_position, data.qpos - model.qpos0, atol=0.5 * apart)


def test_gains_and_limits_are_those_at_the_joint(tmp_path):
    world, _ = arm(tmp_path, """
      <position joint="j1" kp="20" kv="1" gear="2" forcerange="-8 5"/>
      <velocity joint="j2" kv="2" gear="3"/>
      <motor joint="j3" gear="3" ctrlrange="-2 1"/>""")
    j1, j2, j3 = joints(world).values()
    assert (j1.drive.mode, j1.drive.stiffness, j1.drive.damping) == ('position', 80.0, 4.0)
    assert (j2.drive.mode, j2.drive.gain) == ('velocity', 18.0)
    assert j3.drive.mode == 'effort'
    # Bounds here are the same in both senses: the smaller one of a servo, since it pulls both
    # ways; of a motor what it can give at all.
    assert [joint.limits.effort for joint in (j1, j2, j3)] == [10.0, None, 6.0]


def test_general_actuators_are_what_their_terms_say(tmp_path):
    world, _ = arm(tmp_path, """
      <general joint="j1" gainprm="50" biastype="affine" biasprm="0 -50 -2"/>
      <general joint="j2" gainprm="3" biastype="affine" biasprm="0 0 -3"/>
      <general joint="j3" gainprm="7"/>""")
    j1, j2, j3 = joints(world).values()
    assert (j1.drive.mode, j1.drive.stiffness, j1.drive.damping) == ('position', 50.0, 2.0)
    assert (j2.drive.mode, j2.drive.gain) == ('velocity', 3.0)
    assert (j3.drive.mode, j3.drive.stiffness) == ('effort', None)


def test_several_actuators_of_a_joint_are_one_drive_with_the_gains_of_each(tmp_path):
    world, _ = arm(tmp_path, """
      <velocity joint="j1" kv="3" forcerange="-1 1"/>
      <position joint="j1" kp="20" kv="1" forcerange="-4 4"/>
      <motor joint="j1" gear="2" ctrlrange="-1 1"/>""")
    joint = joints(world)['j1']
    assert (joint.drive.mode, joint.drive.stiffness) == ('position', 20.0)
    # Led to a position both servos damp, and all three may pull: 1 + 4 + 2 N m.
    assert (joint.drive.damping, joint.drive.gain, joint.limits.effort) == (4.0, 3.0, 7.0)


def test_a_servo_holds_the_position_that_a_scene_asks_for(tmp_path):
    path = write(tmp_path, 'arm.xml', ARM.format(
        actuators='<position joint="j1" kp="20"/><position joint="j2" kp="20"/>'))
    entry = {'name': 'r', 'file': str(path), 'joints': {'j1': 0.3}}
    j1, j2, _ = World.from_dict({'models': [entry]}).scene.spec.joints
    # Without a wish the servo pulls to the control 0, which is -10 degrees from where j2 is drawn.
    assert j1.drive.position is None
    assert j2.drive.position == pytest.approx(-np.deg2rad(10), abs=1e-15)
    entry['drives'] = {'j1': {'mode': 'effort'}}
    assert World.from_dict({'models': [entry]}).scene.spec.joints[0].drive.mode == 'effort'


def test_a_joint_that_follows_another_has_its_motor_as_well(tmp_path):
    text = ARM.format(actuators='<motor joint="j2" gear="3"/>').replace(
        '</mujoco>', '<equality><joint joint1="j2" joint2="j1"/></equality></mujoco>')
    world = World.from_dict({'models': [{'name': 'r', 'file': str(write(
        tmp_path, 'arm.xml', text))}]})
    _, follower, *_ = world.scene.spec.joints
    assert follower.mimic.joint == 'r/j1' and follower.drive.mode == 'effort'


# Both fingers of a gripper are pulled by one tendon, and coupled.
SPLIT = ARM.replace('</mujoco>', """
  <tendon><fixed name="one"><joint joint="j1" coef="2"/></fixed>
    <fixed name="split"><joint joint="j2" coef="0.5"/><joint joint="j3" coef="0.5"/></fixed>
  </tendon>
  <equality><joint joint1="j3" joint2="j2" polycoef="0 1 0 0 0"/></equality></mujoco>""")


def test_an_actuator_on_a_fixed_tendon_drives_the_joint_that_the_tendon_follows(tmp_path):
    path = write(tmp_path, 'arm.xml', SPLIT.format(actuators="""
      <position tendon="one" kp="3" kv="0.2" gear="3"/>
      <general tendon="split" gainprm="5" biastype="affine" biasprm="0 -5 -0.1"/>"""))
    j1, j2, j3 = joints(load_scene(path)).values()
    # The tendon is twice as long as j1 turns, and 0.5 q + 0.5 q with j2 at q and j3 at 1 q.
    assert (j1.drive.stiffness, j1.drive.damping) == pytest.approx((3 * 36, 0.2 * 36))
    assert (j2.drive.stiffness, j2.drive.damping) == (5.0, 0.1)
    assert j3.drive is None and j3.mimic.joint == 'arm/j2'


def test_actuators_of_a_disabled_group_do_nothing(tmp_path):
    text = ARM.format(actuators='<motor name="odd" joint="j1" group="2"/><motor joint="j2"/>')
    path = write(tmp_path, 'arm.xml', text.replace(
        '<option ', '<option actuatorgroupdisable="2" '))
    world = load_scene(path)
    assert any("'odd' is ignored: its group is disabled" in note for note in world.scene.notes)


@pytest.mark.parametrize(('actuator', 'why'), [
    ('<motor name="odd" joint="j1" damping="0.1 0.2 0.3"/>', 'no servo'),
    ('<position name="odd" joint="j1" kp="9" timeconst="0.1"/>', 'no servo'),
    ('<intvelocity name="odd" joint="j1" kp="9" actrange="-1 1"/>', 'no servo'),
    ('<damper name="odd" joint="j1" kv="1" ctrlrange="0 1"/>', 'no servo'),
    ('<muscle name="odd" joint="j1" lengthrange="0.1 1"/>', 'no servo'),
    ('<general name="odd" joint="j1" gainprm="5" biastype="affine" biasprm="1 -5 0"/>',
     'no servo'),
    ('<general name="odd" joint="j1" gainprm="5" biastype="affine" biasprm="0 5 0"/>',
     'no servo'),
    ('<adhesion name="odd" body="c" ctrlrange="0 1"/>', 'acts on no joint'),
    ('<motor joint="j1"/><motor name="odd" joint="j1"/>', 'another one of the mode effort'),
], ids=lambda value: value[:30])
def test_an_actuator_that_is_no_drive_is_told_on_one_line(tmp_path, actuator, why):
    world, _ = arm(tmp_path, f'{actuator}<motor joint="j2"/>')
    line, = [note for note in world.scene.notes if "actuator '" in note]
    assert "actuator 'odd' is ignored" in line and why in line and 'arm.xml:' in line
    assert joints(world)['j2'].drive.mode == 'effort'
