# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page shows bodies with what they are drawn with, in a real browser."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from free import free_port
from nodes.live import kept
from viewer.browsing import GREEN, MAGENTA, Page, RED, scene_file, view

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.world import load_scene

# The solid of the body would be magenta; a red and a green box beside each other are drawn.
SCENE = """
world: {gravity: [0, 0, 0], contact: none}
bodies:
- name: robot
  shape: {type: sphere, radius: 0.4}
  mass: 1
  color: [1, 0, 1]
  visuals:
  - shape: {type: box, size: [0.4, 0.4, 0.4], pose: {position: [-0.4, -0.4, 0]}}
    color: [1, 0, 0]
  - shape: {type: box, size: [0.4, 0.4, 0.4], pose: {position: [0.4, 0.4, 0]}}
    color: [0, 0.8, 0]
"""


def test_a_body_has_the_colours_of_what_it_is_drawn_with(browser, tmp_path):
    batch = Batch(load_scene(scene_file(tmp_path, SCENE)), tmp_path / 'session')
    batch.run(500)
    batch.tell('set_pose', name='robot', position=(0, 0, 0.5), orientation=(0, 0, 0, 1))
    batch.run(500)
    batch.close()
    port = free_port()
    with kept(view(tmp_path / 'view', str(tmp_path / 'session'), '--port', str(port))):
        page = Page(browser, f'http://127.0.0.1:{port}')
        page.wait_for(lambda: 'verified' in page.text(), 'the verdict')
        page.wait_for(lambda: page.counts() == (1, 1, 0), 'both boxes, and no ball')
        heights = page.spot(RED)[1], page.spot(GREEN)[1]
        page.fill_beside(0, 0.8)
        # Both go up together: on the screen by as many pixels, seen from nearly the same distance.
        page.wait_for(lambda: page.spot(RED)[1] < heights[0] - 10, 'the red box to be higher')
        page.wait_for(lambda: page.spot(GREEN)[1] < heights[1] - 10, 'the green one as well')
        assert page.spots(MAGENTA) == []
        page.close()
