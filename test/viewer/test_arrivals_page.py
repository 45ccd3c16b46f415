# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a bag shows what came into the session later, as long as it is there."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from free import free_port
from nodes.live import kept
import numpy as np
import pytest
from viewer.browsing import Page, scene_file, view

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.viewer.recording import Recording
from rigid_sim_ros.world import load_scene


@pytest.fixture(scope='module', name='bag')
def _bag(folder):
    """Give a session of the three bodies of the page: the green one comes at 1 s, goes at 2 s."""
    world = load_scene(scene_file(folder))
    green = world.scene.spec.bodies[1].model_dump(mode='json', exclude_none=True)
    world.remove('middle')
    batch = Batch(world, folder / 'session')
    for change in (lambda: world.add(green), lambda: world.remove('middle'), lambda: None):
        batch.run(1000)
        change()
    batch.close()
    return folder / 'session'


def test_a_body_is_there_from_when_it_comes_until_it_goes(bag):
    recording = Recording(bag)
    assert recording.scene.names == ('left', 'middle', 'right')
    table = recording.table(np.arange(len(recording)))
    there = np.isfinite(table[:, 1]).all(axis=1)
    np.testing.assert_array_equal(there, (recording.times > 1.0) & (recording.times <= 2.0))
    assert np.isfinite(table[:, (0, 2)]).all()
    # What is shown are numbers, always.
    for time in (0.5, 1.5, 2.5):
        motion = recording.motion(recording.row(time))
        assert np.isfinite(motion.position).all()
        assert (abs(motion.position[1, 2]) < 1.0) == (time == 1.5)
        assert len(motion.rotation) == 3
    told = [each.text for each in recording.happenings]
    assert told[:2] == ['add middle', 'remove middle']


def test_the_page_shows_it_as_long_as_it_is_there(bag, browser, folder):
    port = free_port()
    with kept(view(folder / 'view', str(bag), '--port', str(port))):
        page = Page(browser, f'http://127.0.0.1:{port}')
        page.wait_for(lambda: 'verified' in page.text(), 'the verdict')
        for time, wanted in ((0.5, (1, 0, 1)), (1.5, (1, 1, 1)), (2.5, (1, 0, 1))):
            page.fill_beside(0, time)
            page.wait_for(lambda: page.counts() == wanted, f'the bodies at {time} s')  # noqa: B023
        page.close()
