# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a running simulation, in a real browser."""
from importlib.util import find_spec
import signal
import sys
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nodes.live import kept, Process, running
import numpy as np
import pytest
from sensor_msgs.msg import MultiDOFJointState
from viewer.browsing import (
    free_port, GREEN, MAGENTA, OTHER_SCENE, Page, RED, scene_file, view)

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.world import load_scene

LEFT, MIDDLE, RIGHT = range(3)


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('viewer')


@pytest.fixture(scope='module')
def sim(probe, folder):
    with running(folder / 'sim', str(scene_file(folder)), bag_path=folder / 'bag') as process:
        probe.some(MultiDOFJointState, '/rigid_sim/state')
        yield process


@pytest.fixture(scope='module')
def port():
    return free_port()


@pytest.fixture(scope='module')
def viewer(sim, folder, port):
    with kept(view(folder / 'view', '--port', str(port))) as process:
        yield process


@pytest.fixture(scope='module')
def shown(viewer, browser, port):
    page = Page(browser, f'http://127.0.0.1:{port}')
    yield page
    page.close()


@pytest.fixture
def page(shown, probe):
    """Give the page of a simulation that has just been reset."""
    probe.pause(False)
    probe.trigger('/rigid_sim/reset')
    return shown


def position(probe, body):
    """Return where a body is now, as the simulation says."""
    message, = probe.some(MultiDOFJointState, '/rigid_sim/state')
    p = message.transforms[body].translation
    return np.array([p.x, p.y, p.z])


def test_the_page_shows_each_body_once(page):
    page.wait_for(lambda: page.counts() == (1, 1, 1), 'three bodies')


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


def test_the_pause_button_stops_the_bodies(page, probe):
    page.click('Pause')
    page.wait_for(lambda: 'Go on' in page.text(), 'the button to turn')
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as received:
        before = page.spot(RED)
        page.page.wait_for_timeout(1000)
        assert page.spot(RED) == pytest.approx(before, abs=0.5)     # px
        assert not received


def test_the_step_button_makes_one_step(page, probe):
    probe.pause(True)
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as received:
        page.click('Step')
        probe.wait_for(lambda: received, 'a state')
        page.page.wait_for_timeout(500)
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
    page.drag(start, end, until=lambda: page.spot(GREEN) == pytest.approx(end, abs=40))     # px
    assert position(probe, MIDDLE)[2] > 0.2     # the mouse went up the screen
    assert abs(position(probe, RIGHT)).tolist() == pytest.approx([0.6, 0.6, 0.0], abs=1e-3)


def test_a_body_that_is_let_go_is_pulled_no_more(page, probe):
    start = page.spot(GREEN)
    page.drag(start, (start[0] + 60, start[1] - 60))
    with probe.listening(MultiDOFJointState, '/rigid_sim/state') as received:
        probe.wait_for(lambda: len(received) >= 50, 'half a second')
    v = [np.array([m.twist[MIDDLE].linear.x, m.twist[MIDDLE].linear.z]) for m in received[20:]]
    assert np.ptp(v, axis=0).max() < 1e-12      # nothing else acts on it


def test_a_clicked_body_is_put_where_the_fields_say(page, probe):
    start = page.spot(GREEN)
    page.page.mouse.click(*start)
    page.wait_for(lambda: 'angular velocity [0.000, 0.000, 0.000] rad/s' in page.text(),
                  'the figures of the body')
    page.drag(start, (start[0], start[1] - 120),
              until=lambda: position(probe, MIDDLE)[2] > 0.1)
    page.click('Set pose')      # the fields hold the pose at the click
    page.wait_for(lambda: abs(position(probe, MIDDLE)[2]) < 0.05, 'the body to be back')


def test_the_record_button_records(page, probe, folder):
    page.click('Record')
    page.wait_for(lambda: 'recording into' in page.text(), 'the recording')
    page.click('Stop recording')
    page.wait_for(lambda: 'recorded into' in page.text(), 'its end')
    bag, = folder.glob('bag*')
    assert info(bag).is_closed


def test_the_page_shows_the_next_simulation_by_itself(page, sim, probe, folder):
    page.wait_for(lambda: page.counts() == (1, 1, 1), 'three bodies')
    sim.signal(signal.SIGINT)
    assert sim.wait() == 0
    page.wait_for(lambda: 'not heard' in page.text(), 'the page to miss it')
    with running(folder / 'next', str(scene_file(folder / 'next', OTHER_SCENE))):
        page.wait_for(lambda: page.counts() == (0, 1, 0), 'one body')


def test_the_page_reconnects_when_its_program_restarts(shown, viewer, folder, port):
    viewer.signal(signal.SIGINT)
    assert viewer.wait() == 0
    with running(folder / 'last', str(scene_file(folder / 'last'))), kept(
            view(folder / 'again', '--port', str(port))):
        shown.wait_for(lambda: shown.counts() == (1, 1, 1), 'three bodies')


def test_the_page_shows_and_pauses_a_replay(browser, probe, folder):
    batch = Batch(load_scene(scene_file(folder)), folder / 'session', node='/recorded')
    batch.run(4000)
    batch.close()
    other = free_port()
    command = [sys.executable, '-m', 'rigid_sim_ros', 'replay', str(folder / 'session'), '--loop']
    with kept(Process(command, folder / 'replay')), kept(
            view(folder / 'view_replay', '--node', '/recorded', '--port', str(other))):
        page = Page(browser, f'http://127.0.0.1:{other}')
        page.wait_for(lambda: page.counts() == (1, 1, 1), 'three bodies')
        with probe.listening(MultiDOFJointState, '/recorded/state') as received:
            probe.wait_for(lambda: received, 'a state')
            page.click('Pause')
            page.wait_for(lambda: 'paused at' in page.page.text_content('body'), 'an answer')
            page.page.wait_for_timeout(500)
            received.clear()
            page.page.wait_for_timeout(1000)
            assert not received
        page.close()
