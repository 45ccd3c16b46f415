# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a running simulation, in a real browser."""
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import pairwise
import re
import signal
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from effort import either
from geometry_msgs.msg import (
    Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3, Wrench, WrenchStamped)
from nodes.live import kept, nanoseconds, Process, running
import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from sensor_msgs.msg import MultiDOFJointState
from viewer.browsing import (
    GREEN, MAGENTA, Page, RED, scene_file, view)

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.world import load_scene

LEFT, MIDDLE, RIGHT = range(3)
# Hues of the overlays in the light of the page, in degrees.
VELOCITY, WRENCH, CONTACT, SPRING, Z_AXIS = 202, 35, 305, 164, 240
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


def show_tab(page, name):
    page.click_on(page.page.get_by_role('tab', name=name))


def position(probe, body):
    """Return where a body is now, as the simulation says."""
    message, = probe.some(MultiDOFJointState, '/rigid_sim/state')
    p = message.transforms[body].translation
    return np.array([p.x, p.y, p.z])


def pace(probe):
    """Return what the parameter says."""
    request = GetParameters.Request(names=['real_time_factor'])
    return probe.call(GetParameters, '/rigid_sim/get_parameters', request).values[0].double_value


def set_pace(probe, factor):
    assert probe.set_parameter('real_time_factor', factor).successful


def test_the_page_shows_each_body_once(page):
    page.wait_for(lambda: page.counts() == (1, 1, 1), 'three bodies')


def test_the_title_names_node_and_scene(page):
    page.wait_for(lambda: page.page.title() == '/rigid_sim: scene', 'the title')


def test_everything_comes_from_this_machine(page, port):
    page.spot(GREEN)
    foreign = [url for url in page.requests
               if not url.startswith((f'http://127.0.0.1:{port}', 'blob:', 'data:'))]
    assert foreign == []


def test_bodies_move_in_the_page(page):
    resting = page.spot(GREEN)
    heights = [page.spot(RED)[1]]

    def swing():
        heights.append(page.spot(RED)[1])
        return max(heights) - min(heights)

    page.wait_for(lambda: swing() > 20, 'the ball to swing')    # px
    assert page.spot(GREEN) == pytest.approx(resting, abs=0.5)


def test_the_name_of_a_body_stands_beside_the_mouse_over_it(page):
    for hue, name in ((GREEN, 'middle'), (MAGENTA, 'right')):
        page.page.mouse.move(*page.spot(hue))
        page.wait_for(lambda name=name: page.hovered() == name, f'the name of {name}')
    page.page.mouse.move(20, 20)
    page.wait_for(lambda: page.hovered() == '', 'the name to go')


def test_the_name_goes_when_the_body_leaves_the_mouse(page, probe):
    page.page.mouse.move(*page.spot(GREEN))
    page.wait_for(lambda: page.hovered() == 'middle', 'the name of the box')
    pose = Pose(position=Point(z=1.0), orientation=Quaternion(w=1.0))
    probe.publish('/rigid_sim/middle/set_pose', PoseStamped(pose=pose))
    page.wait_for(lambda: page.hovered() == '', 'the name to go')


@pytest.mark.long
def test_several_viewers_see_the_bodies_move(page, browser, port):
    more = [Page(browser, f'http://127.0.0.1:{port}') for _ in range(either(1, 4))]
    pages = [page, *more]
    for page in more:
        page.wait_for(lambda page=page: page.counts() == (1, 1, 1), 'three bodies')
    heights = [[] for _ in pages]

    def swing():
        for page, seen in zip(pages, heights, strict=True):
            seen += [y for _, y in page.spots(RED)]
        return min(max(seen, default=0) - min(seen, default=0) for seen in heights) > 12   # px

    pages[0].wait_for(swing, 'the ball to swing in all of them')
    for page in more:
        page.close()


def test_the_pause_button_stops_the_bodies(page, probe):
    page.turn('Pause', 'Go on')
    # What was said before the answer has come with it.
    assert probe.pause(True).message.startswith('already paused')
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as received:
        page.resting_spot(RED)      # in motion it comes back every 3.1 s
        assert not received


def test_the_step_button_makes_one_step(page, probe):
    assert probe.pause(True).success
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as received:
        page.click('Step')
        probe.wait_for(lambda: received, 'a state')
        probe.wait_for_silence(received)
        assert len(received) == 1


def test_the_reset_button_returns_the_bodies(page, probe):
    page.wait_for(lambda: position(probe, LEFT)[2] > 0.1, 'the ball to rise')
    probe.pause(True)
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as received:
        page.click('Reset')
        probe.wait_for(lambda: received and received[-1].transforms[LEFT].translation.z == 0.0,
                       'the ball where it was at the beginning')


def test_dragging_moves_a_body_to_the_mouse(page, probe):
    start = page.spot(GREEN)
    end = (start[0], start[1] - 120)
    seen = []

    def follows():
        seen[:] = page.spots(GREEN)
        return len(seen) == 1 and seen[0][1] < start[1] - 60      # px

    page.drag(start, end, until=follows)
    assert seen[0][0] == pytest.approx(end[0], abs=40)
    assert position(probe, MIDDLE)[2] > 0.2     # the mouse went up the screen
    assert abs(position(probe, RIGHT)).tolist() == pytest.approx([0.6, 0.6, 0.0], abs=1e-3)


def test_a_body_that_is_let_go_is_pulled_no_more(page, probe):
    start = page.spot(GREEN)
    with probe.listening(MultiDOFJointState, '/rigid_sim/wrenches') as pulls:
        page.drag(start, (start[0] + 60, start[1] - 60),
                  until=lambda: any(pull.joint_names for pull in pulls))
        page.wait_for(lambda: not pulls[-1].joint_names, 'the hand to let go')
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as received:

        def is_free():
            v = [[m.twist[MIDDLE].linear.x, m.twist[MIDDLE].linear.z] for m in received[-50:]]
            return len(v) == 50 and np.ptp(v, axis=0).max() < 1e-12    # nothing else acts on it

        probe.wait_for(is_free, 'half a second without a force')
        assert not pulls[-1].joint_names


def test_the_push_button_pushes_the_chosen_body(page, probe):
    page.touch(page.spot(GREEN))
    page.wait_for(lambda: 'angular velocity [0.000, 0.000, 0.000] rad/s' in page.text(),
                  'the figures of the body')
    page.fill('force [N]', 2.0, place=2)
    page.fill('for [s]', 0.2)
    echoed = '/rigid_sim/middle/applied_wrench'
    with probe.listening(WrenchStamped, echoed) as wrenches, probe.listening(
            MultiDOFJointState, '/rigid_sim/state') as states:
        page.click('Push')
        probe.wait_for(lambda: wrenches, 'the wrench, as other nodes hear it')
        assert wrenches[0].wrench.force == Vector3(z=2.0)
        probe.wait_for(lambda: len(states) > 50 and len(
            {message.twist[MIDDLE].linear.z for message in states[-50:]}) == 1
            and states[-1].twist[MIDDLE].linear.z > 0.0, 'the end of the push')
        after = states[-1].twist[MIDDLE]
        # One for each state of these 0.2 s, which come every 10 ms.
        assert len(wrenches) <= 21
        begin, end = (
            1e-9 * nanoseconds(each.header.stamp) for each in (wrenches[0], wrenches[-1]))
    # F t / m, with 2 N and 1 kg. How long it acts depends on how late the page hears of the time:
    # at the latest it ends 0.5 s after it was renewed last, so long the node holds a wrench.
    assert 0.0 < after.linear.z <= 2.0 * (end - begin + 0.5) + 1e-9
    assert [after.linear.x, after.linear.y] == [0.0, 0.0]
    assert [after.angular.x, after.angular.y, after.angular.z] == pytest.approx([0, 0, 0])


def test_the_speed_slider_sets_the_pace(page, probe):
    slider = page.page.get_by_role('slider').first
    slider.focus()
    for _ in range(4):
        slider.press('ArrowRight')      # 0.05 each

    def follows():
        shown = float(slider.get_attribute('aria-valuenow'))
        return shown > 1.0 and pace(probe) == pytest.approx(shown)

    page.wait_for(follows, 'the simulation to follow')


def test_a_speed_is_typed_beside_the_slider_or_left_open(page, probe):
    page.fill_beside(0, 0.5)
    probe.wait_for(lambda: pace(probe) == 0.5, 'half of real time')
    # The node tells once a second what it does with it.
    page.wait_for(lambda: 'at 0.5' in page.text(), 'the page to say so')
    box = page.tick('as fast as possible')
    probe.wait_for(lambda: pace(probe) == 0.0, 'no limit')
    page.wait_for(box.is_checked, 'the box')    # no report of before counts any more
    page.tick('as fast as possible')
    probe.wait_for(lambda: pace(probe) == 0.5, 'the limit again')


def test_the_slider_follows_what_others_set(page, probe):
    set_pace(probe, 2.0)
    slider = page.page.get_by_role('slider').first
    page.wait_for(lambda: slider.get_attribute('aria-valuenow') == '2', 'the slider')
    set_pace(probe, 1.0)
    page.wait_for(lambda: slider.get_attribute('aria-valuenow') == '1', 'the slider')


def test_a_clicked_body_is_put_where_the_fields_say(page, probe):
    # If it was chosen before, its figures say nothing about a click.
    page.touch(page.spot(MAGENTA))
    page.wait_for(lambda: 'position [0.600, 0.600, 0.000] m' in page.text(), 'another body')
    start = page.spot(GREEN)
    page.touch(start)
    page.wait_for(lambda: 'position [0.000, 0.000, 0.000] m' in page.text()
                  and 'angular velocity [0.000, 0.000, 0.000] rad/s' in page.text(),
                  'the figures of the body')
    page.drag(start, (start[0], start[1] - 120),
              until=lambda: position(probe, MIDDLE)[2] > 0.1)
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as states:
        page.click('Set pose')      # the fields hold the pose at the click

        def heights():
            return [message.transforms[MIDDLE].translation.z for message in list(states)]

        # With the twist that the mouse left it, which stays; so it is there for a moment only, and
        # it does not get there by itself: from one message to the next it would go 1 cm at 1 m/s.
        page.wait_for(lambda: any(before - after > 0.05 and abs(after) < 0.05
                                  for before, after in pairwise(heights())), 'the body to be back')


def test_the_record_button_records(page, probe, folder):
    page.click('Record')
    page.wait_for(lambda: 'recording into' in page.text(), 'the recording')
    grows = re.compile(r'recording into .*, (\d+\.\d) s, (\d+\.\d+) MB')

    def seen():
        return [float(number) for found in grows.findall(page.text()) for number in found]

    page.wait_for(lambda: seen() and min(seen()) > 0.0, 'elapsed time and size')
    before = seen()
    page.wait_for(lambda: all(now > then for now, then in zip(seen(), before, strict=True)),
                  'both to grow')
    page.click('Stop recording')
    page.wait_for(lambda: 'recorded into' in page.text(), 'its end')
    # The answer comes when all is written.
    page.wait_for(lambda: re.search('recorded [0-9]+ messages', page.notes()), 'the answer')
    bag, = folder.glob('bag*')
    assert info(bag).is_closed


# --- what the tab Show switches on appears in the picture, and goes again ------------------------

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


# --- the next simulation, of a box that rests on a plane -----------------------------------------

@pytest.fixture(scope='module')
def resting(shown, sim, probe, folder):
    """Give the page after the simulation was ended and another one started."""
    sim.signal(signal.SIGINT)
    assert sim.wait() == 0
    show_tab(shown, 'Drive')
    shown.wait_for(lambda: 'not heard' in shown.text(), 'the page to miss it')
    with running(folder / 'rests', str(scene_file(folder / 'resting', RESTING))):
        probe.some(MultiDOFJointState, '/rigid_sim/state')
        yield shown


def test_the_page_shows_the_next_simulation_by_itself(resting):
    resting.wait_for(lambda: resting.counts() == (0, 1, 0), 'the box alone')


def test_the_ground_grid_is_shown_and_hidden_where_a_plane_is_the_ground(resting):
    goes_and_comes_back(resting, 'ground grid', LINES)


def test_shadows_are_cast_and_taken_away_where_a_plane_is_the_ground(resting):
    check_shadows(resting)


def test_contact_forces_are_arrows(resting):
    appears_and_goes(resting, 'contacts', CONTACT)


# --- a replay, by another program of the page ----------------------------------------------------

@pytest.fixture(scope='module')
def replayed(shown, viewer, probe, folder, port):
    """Give the page after its program was ended and another one started, that shows a replay."""
    batch = Batch(load_scene(scene_file(folder)), folder / 'session', node='/recorded')
    batch.run(800)
    batch.close()
    viewer.signal(signal.SIGINT)
    assert viewer.wait() == 0
    with kept(Process(['replay', str(folder / 'session'), '--loop'], folder / 'replay',
                      is_forked=True)), kept(
            view(folder / 'again', '--node', '/recorded', '--port', str(port))):
        yield shown


def test_the_page_reconnects_when_its_program_restarts(replayed):
    replayed.wait_for(lambda: replayed.counts() == (1, 1, 1), 'three bodies')


def test_the_page_shows_and_pauses_a_replay(replayed, probe):
    with probe.listening(MultiDOFJointState, '/recorded/state') as received:
        probe.wait_for(lambda: received, 'a state')
        show_tab(replayed, 'Drive')
        replayed.turn('Pause', 'Go on')
        probe.wait_for_silence(received)
        received.clear()
        replayed.click('Go on')
        probe.wait_for(lambda: received, 'a state after the pause')
