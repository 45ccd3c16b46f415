# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sliders of the page move the joints of a running simulation, and stand where these are."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from nodes.jointed import jointed
from nodes.live import running
import pytest
from sensor_msgs.msg import JointState
from viewer.browsing import Page

ARM, OWN = '/rigid_sim/arm/joint_states', '/rigid_sim/joint_states'
# The sliders, in the order of the scene.
SHOULDER, ELBOW, SLIDE, PIVOT = range(4)
# Half a step of the slider: 0.01 for 2 pi, as for the 3 rad of the shoulder 0.001.
NEAR = 0.0051
SAG = 0.05      # rad


@pytest.fixture(scope='module')
def sim(probe, folder):
    """Run the scene with joints in the place of the one of the other tests."""
    with running(folder / 'sim', str(jointed(folder)), reset_time=True) as process:
        probe.some(JointState, ARM)
        yield process


@pytest.fixture(scope='module')
def page(viewer, browser, port):
    page = Page(browser, f'http://127.0.0.1:{port}', (900, 900))
    page.click_on(page.page.get_by_role('tab', name='Joints'))
    page.wait_for(lambda: slider(page, PIVOT).count(), 'the sliders')
    yield page
    page.close()


def slider(page, place):
    return page.page.locator('input[inputmode]:visible').nth(place)


def wait_for_button(page, name):
    """Wait until the page has heard whether the simulation is paused."""
    page.click_on(page.page.get_by_role('tab', name='Drive'))
    button = page.page.get_by_role('button', name=name, exact=True)
    page.wait_for(button.count, f'the button {name}')
    page.click_on(page.page.get_by_role('tab', name='Joints'))
    page.wait_for(lambda: slider(page, PIVOT).count(), 'the sliders')


def position(probe, topic, place):
    return probe.some(JointState, topic)[0].position[place]


def test_a_slider_lets_a_drive_lead_its_joint_which_stays(page, probe):
    assert probe.trigger('/rigid_sim/reset').success
    assert probe.pause(False).success
    page.fill_beside(SHOULDER, 0.7)
    # Gravity lets the drive sag: by 3 kg * 9.81 N/kg * 3 m / 2000 N m/rad, were the sled to slide
    # for a minute.
    page.wait_for(lambda: abs(position(probe, ARM, SHOULDER) - 0.7) < SAG, 'the shoulder')
    probe.some(JointState, ARM, 150)    # 1.5 s: three times as long as a command would hold
    assert position(probe, ARM, SHOULDER) == pytest.approx(0.7, abs=SAG)


def test_a_slider_stands_where_its_joint_is(page, probe):
    assert probe.pause(True).success
    probe.publish('/rigid_sim/arm/set_joint_states', JointState(
        name=['shoulder', 'elbow'], position=[-0.4, 7.0]))
    # Of a continuous joint without its turns: 7 - 2 pi.
    page.wait_for(lambda: slider(page, SHOULDER).input_value() == '-0.4'
                  and float(slider(page, ELBOW).input_value()) == pytest.approx(0.717, abs=NEAR),
                  'the sliders')


def test_in_a_pause_a_slider_puts_a_joint_also_one_without_a_drive(page, probe):
    assert probe.pause(True).success
    wait_for_button(page, 'Go on')
    with probe.listening(JointState, OWN) as states:
        page.fill_beside(PIVOT, -0.5)

        def is_put():
            """Take a step, after which the position is published: perhaps the first from there."""
            assert probe.trigger('/rigid_sim/step').success
            return any(before_the_step(state, 0) == pytest.approx(-0.5, abs=1e-12)
                       for state in list(states))

        page.wait_for(is_put, 'the pivot')


def before_the_step(state, place):
    """Return a position less the motion of one step from rest, to six digits."""
    # The step has turned it by its velocity: v h / 2 in constant acceleration.
    return round(state.position[place] - 0.5e-3 * state.velocity[place], 6)


def test_a_joint_without_a_drive_stays_as_it_is_while_the_simulation_runs(page, probe):
    assert probe.trigger('/rigid_sim/reset').success
    assert probe.pause(False).success
    wait_for_button(page, 'Pause')
    page.fill_beside(PIVOT, 0.25)
    page.wait_for(lambda: 'pivot has no drive that leads it' in page.notes(), 'the reason')
