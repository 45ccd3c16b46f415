# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the tab Show switches on appears in the picture, and goes again."""
from contextlib import contextmanager
from importlib.util import find_spec
import signal
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from geometry_msgs.msg import Twist, TwistStamped, Vector3, Wrench, WrenchStamped
from nodes.live import running
import pytest
from sensor_msgs.msg import MultiDOFJointState
from viewer.browsing import MAGENTA, scene_file

# Hues of the overlays in the light of the page, in degrees.
VELOCITY, WRENCH, CONTACT, SPRING, Z_AXIS = 202, 35, 305, 164, 240
RIGHT = 2
# px: less is the edge of something else.
SOME, NONE = 12, 4
# How light lines of the ground are, and shadows on it, of 255; what is between is lines' edges in
# a shadow.
LINES, SHADOW = (180, 235), (100, 174)
# px: the lines are some 20 000 in the picture, the shadow of a box or of three bodies 400.
MANY = 150

RESTING = """
format: 1
bodies:
  - {name: floor, fixed: true, shape: {type: plane, normal: [0, 0, 1], offset: 0}}
  - name: crate
    shape: {type: box, size: [0.4, 0.4, 0.4]}
    mass: 1.0
    color: [0, 0.8, 0]
    pose: {position: [0, 0, 0.2]}
"""


@contextmanager
def switched_on(page, switch):
    """Switch something on and off again, also when what was waited for did not come."""
    page.switch(switch)
    try:
        yield
    finally:
        page.switch(switch)


def appears_and_goes(page, switch, hue, is_drawn=None):
    """Switch something on and off that has a colour of its own."""
    assert page.pixels(hue) < NONE
    with switched_on(page, switch):
        page.wait_for(is_drawn or (lambda: page.pixels(hue) > SOME), f'{switch} to appear')
    page.wait_for(lambda: page.pixels(hue) < NONE, f'{switch} to go')


def launch(probe, body, speed, height):
    """Let a body go up, and wait until it is at a height."""
    up = TwistStamped(twist=Twist(linear=Vector3(z=speed)))
    probe.publish(f'/rigid_sim/{body}/set_twist', up)
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        probe.wait_for(lambda: states and states[-1].transforms[RIGHT].translation.z > height)


def goes_and_comes_back(page, switch, greys):
    """Switch something off and on again that is grey."""
    page.wait_for(lambda: page.grey_pixels(*greys) > MANY, f'{switch}, on from the beginning')
    page.switch(switch)
    page.wait_for(lambda: page.grey_pixels(*greys) < NONE, f'{switch} to go')
    page.switch(switch)
    page.wait_for(lambda: page.grey_pixels(*greys) > MANY, f'{switch} again')


def check_shadows(page):
    """Check that they go and come back without the ground."""
    goes_and_comes_back(page, 'shadows', SHADOW)
    assert page.grey_pixels(*LINES) > MANY      # the ground stays


def test_the_ground_grid_is_shown_and_hidden_where_the_scene_has_no_ground(page):
    goes_and_comes_back(page, 'ground grid', LINES)


def test_shadows_are_cast_and_taken_away_where_the_scene_has_no_ground(page):
    check_shadows(page)


def test_body_axes_are_shown_and_hidden(page):
    appears_and_goes(page, 'body axes', Z_AXIS)


def test_velocities_are_arrows_in_a_pause_too(page, probe):
    def is_drawn():
        """Stop the simulation just after the body has set out; if that is late, it is away."""
        probe.trigger('/rigid_sim/reset')
        probe.pause(False)
        launch(probe, 'right', 2.0, 0.1)
        probe.pause(True)
        page.page.wait_for_timeout(500)
        return page.pixels(VELOCITY) > SOME

    appears_and_goes(page, 'velocities', VELOCITY, is_drawn)


def test_springs_are_shown_and_follow_their_bodies(page, probe):
    page.wait_for(lambda: page.pixels(SPRING) > SOME, 'the spring')
    counts = []

    def shrinks():
        counts.append(page.pixels(SPRING))
        return max(counts) > 1.3 * min(counts)

    page.wait_for(shrinks, 'the spring to become shorter as the ball rises')
    page.switch('springs')
    page.wait_for(lambda: page.pixels(SPRING) < NONE, 'the spring to go')
    probe.pause(True)
    page.switch('springs')
    page.wait_for(lambda: page.pixels(SPRING) > SOME, 'the spring again, in a pause too')


def test_names_are_shown_in_a_pause_too(page, probe):
    probe.pause(True)
    before = page.settled(page.dark_pixels, 'the picture of the pause')
    page.switch('names')
    page.wait_for(lambda: page.dark_pixels() > before + SOME, 'letters')
    page.switch('names')
    page.wait_for(lambda: page.dark_pixels() < before + NONE, 'no letters')


def test_trails_are_left_behind(page, probe):
    with switched_on(page, 'trails'):
        launch(probe, 'right', 0.4, 0.7)
        probe.pause(True)
        with_trail = page.settled(lambda: page.pixels(MAGENTA), 'the picture of the pause')
    page.wait_for(lambda: page.pixels(MAGENTA) < with_trail - SOME, 'the trail to go')


def test_an_applied_wrench_is_an_arrow(page, probe):
    wrench = WrenchStamped(wrench=Wrench(force=Vector3(z=10.0)))

    def is_drawn():
        """Stop the simulation just after it has taken a wrench."""
        probe.trigger('/rigid_sim/reset')
        probe.pause(False)
        with probe.listening(WrenchStamped, '/rigid_sim/right/applied_wrench') as taken:
            probe.publish('/rigid_sim/right/wrench', wrench)
            probe.wait_for(lambda: taken)
            probe.pause(True)
        page.page.wait_for_timeout(500)
        return page.pixels(WRENCH) > SOME

    assert page.pixels(WRENCH) < NONE
    page.switch('wrenches')
    page.wait_for(is_drawn, 'the arrow')
    page.switch('wrenches')
    page.wait_for(lambda: page.pixels(WRENCH) < NONE, 'the arrow to go with the switch')
    page.switch('wrenches')
    page.wait_for(is_drawn, 'the arrow again')
    probe.pause(False)
    page.wait_for(lambda: page.pixels(WRENCH) < NONE, 'the arrow to go with the wrench')
    page.switch('wrenches')


# --- a box that rests on a plane ----------------------------------------------------------------

@pytest.fixture(scope='module')
def resting(shown, sim, probe, folder):
    """Give the page of the next simulation, of the box."""
    sim.signal(signal.SIGINT)
    assert sim.wait() == 0
    with running(folder / 'rests', str(scene_file(folder / 'resting', RESTING))):
        probe.some(MultiDOFJointState, '/rigid_sim/state')
        shown.wait_for(lambda: shown.counts() == (0, 1, 0), 'the box alone')
        yield shown


def test_the_ground_grid_is_shown_and_hidden_where_a_plane_is_the_ground(resting):
    goes_and_comes_back(resting, 'ground grid', LINES)


def test_shadows_are_cast_and_taken_away_where_a_plane_is_the_ground(resting):
    check_shadows(resting)


def test_contact_forces_are_arrows(resting):
    appears_and_goes(resting, 'contacts', CONTACT)
