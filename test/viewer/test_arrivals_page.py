# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The page of a bag with a body that comes and goes, and is drawn with more than its solid.

A message of the bag was changed after the recording: the page, which all tests share, shows that.
"""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from bag.sessions import messages_of, rewrite
from free import free_port
from nodes.live import kept
import numpy as np
import pytest
from viewer.browsing import GREEN, Page, RED, scene_file, view

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.viewer.recording import Recording
from rigid_sim_ros.world import load_scene

# The solid of the robot would be yellow; a red and a green box beside each other are drawn.
YELLOW = 60
SCENE = """
format: 1
world: {gravity: [0, 0, 0], step: 0.001, contact: none}
bodies:
- name: left
  shape: {type: sphere, radius: 0.2}
  mass: 1
  color: [0, 0, 1]
  pose: {position: [-1, -1, 0]}
- name: robot
  shape: {type: sphere, radius: 0.4}
  mass: 1
  color: [1, 1, 0]
  pose: {position: [0, 0, 0.5]}     # above the lines of the ground
  visuals:
  - shape: {type: box, size: [0.4, 0.4, 0.4], pose: {position: [-0.4, -0.4, 0]}}
    color: [1, 0, 0]
  - shape: {type: box, size: [0.4, 0.4, 0.4], pose: {position: [0.4, 0.4, 0]}}
    color: [0, 0.8, 0]
- name: right
  shape: {type: sphere, radius: 0.2}
  mass: 1
  color: [1, 0, 1]
  pose: {position: [1, 1, 0]}
"""


@pytest.fixture(scope='module', name='bag')
def _bag(folder):
    """Give a session of these bodies: the robot comes at 1 s, is put up at 1.5 s, goes at 2 s."""
    world = load_scene(scene_file(folder, SCENE))
    robot = world.scene.spec.bodies[1].model_dump(mode='json', exclude_none=True)
    world.remove('robot')
    batch = Batch(world, folder / 'session')
    batch.run(1000)
    world.add(robot)
    batch.run(500)
    batch.tell('set_pose', name='robot', position=(0, 0, 1), orientation=(0, 0, 0, 1))
    batch.run(500)
    world.remove('robot')
    batch.run(1000)
    batch.close()
    return folder / 'session'


@pytest.fixture(scope='module')
def page(bag, browser, folder):
    """Give the page of that session, of which a bit of the state at 2.5 s was turned over."""
    (folder / 'other').mkdir()
    changed = [data for _, _, data in messages_of(bag, kinds.STATE)][250]

    def change(topic, data):
        if data != changed:
            return data
        return data[:-60] + bytes([data[-60] ^ 1]) + data[-59:]

    port, other = free_port(), rewrite(bag, folder / 'other', change)
    with kept(view(folder / 'view', str(other), '--port', str(port))):
        page = Page(browser, f'http://127.0.0.1:{port}')
        # The verdict makes the timeline anew: a click just then may miss.
        page.wait_for(lambda: 'differs at step 2500' in page.text(), 'the verdict')
        yield page
        page.close()


def test_a_body_is_there_from_when_it_comes_until_it_goes(bag):
    recording = Recording(bag)
    assert recording.scene.names == ('left', 'robot', 'right')
    table = recording.table(np.arange(len(recording)))
    there = np.isfinite(table[:, 1]).all(axis=1)
    np.testing.assert_array_equal(there, (recording.times > 1.0) & (recording.times <= 2.0))
    assert np.isfinite(table[:, (0, 2)]).all()
    # What is shown are numbers, always.
    for time in (0.5, 1.25, 2.5):
        motion = recording.motion(recording.row(time))
        assert np.isfinite(motion.position).all()
        assert (abs(motion.position[1, 2]) < 1.0) == (time == 1.25)
        assert len(motion.rotation) == 3
    told = [each.text for each in recording.happenings]
    assert told[:3] == ['add robot', 'set pose robot', 'remove robot']


def test_the_first_difference_is_marked(page):
    page.wait_for(lambda: 'difference' in page.text(), 'the mark')


def test_the_page_shows_it_as_long_as_it_is_there(page):
    for time, wanted in ((0.5, (0, 0, 1)), (1.25, (1, 1, 1)), (2.5, (0, 0, 1))):
        page.fill_beside(0, time)
        page.wait_for(lambda: page.counts() == wanted, f'the bodies at {time} s')  # noqa: B023


def test_a_body_has_the_colours_of_what_it_is_drawn_with(page):
    page.fill_beside(0, 1.25)
    page.wait_for(lambda: page.counts() == (1, 1, 1), 'both boxes')
    assert page.spots(YELLOW) == []
    heights = page.spot(RED)[1], page.spot(GREEN)[1]
    page.fill_beside(0, 1.75)
    # Both go up together: on the screen by as many pixels, seen from nearly the same distance.
    page.wait_for(lambda: page.spot(RED)[1] < heights[0] - 10, 'the red box to be higher')
    page.wait_for(lambda: page.spot(GREEN)[1] < heights[1] - 10, 'the green one as well')
    assert page.spots(YELLOW) == []
