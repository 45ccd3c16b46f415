# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a bag, in a real browser, in an environment without ROS."""
from importlib.util import find_spec
import re
import time
from unittest import SkipTest

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

from free import free_port
import fresh
from nodes.live import kept
import pytest
from viewer.browsing import Page, RED, scene_file, view

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.world import load_scene


@pytest.fixture(scope='module')
def bag(folder):
    batch = Batch(load_scene(scene_file(folder)), folder / 'session')
    batch.run(400)
    batch.tell('set_pose', name='middle', position=(0.0, 0.0, 0.5), orientation=(0, 0, 0, 1))
    batch.run(400)
    batch.close()
    return folder / 'session'


@pytest.fixture(scope='module')
def page(bag, browser, folder):
    port = free_port()
    with kept(view(folder / 'view', str(bag), '--port', str(port))):
        page = Page(browser, f'http://127.0.0.1:{port}')
        # The verdict makes the timeline anew: a click just then may miss.
        page.wait_for(lambda: 'verified' in page.text(), 'the verdict')
        yield page
        page.close()


def seek(page, at):
    """Type a time beside the timeline."""
    page.fill_beside(0, at)
    page.wait_for(lambda: f'{at:.3f} s, state' in page.text(), f'the time {at} s')


def test_the_page_shows_each_body_of_the_bag(page):
    page.wait_for(lambda: page.counts() == (1, 1, 1), 'three bodies')


def test_the_timeline_seeks(page):
    seek(page, 0.0)
    _, y = page.spot(RED)
    seek(page, 4.0)
    page.wait_for(lambda: page.spot(RED)[1] < y - 10, 'the ball to be higher')
    seek(page, 0.0)
    page.wait_for(lambda: abs(page.spot(RED)[1] - y) < 1.0, 'the ball to be back')


def test_the_name_of_a_body_stands_beside_the_mouse_over_it(page):
    seek(page, 0.0)
    page.page.mouse.move(*page.spot(RED))
    page.wait_for(lambda: page.hovered() == 'left', 'the name of the ball')
    page.page.mouse.move(20, 20)
    page.wait_for(lambda: page.hovered() == '', 'the name to go')


def test_play_goes_on_to_the_end_and_stops(page):
    seek(page, 3.0)
    page.click('Play')
    page.wait_for(lambda: '4.000 s, state 401 of 401' in page.text(), 'the end')
    page.wait_for(lambda: page.page.get_by_role('button', name='Play', exact=True).count(), 'Play')


def shown_time(page):
    return float(re.search(r'([\d.]+) s, state', page.text())[1])


def test_the_bag_plays_at_the_chosen_rate(page):
    seek(page, 1.0)
    page.fill_beside(1, 0.05)
    begin = time.monotonic()
    page.click('Play')
    page.wait_for(lambda: shown_time(page) >= 1.05, 'a twentieth of a second')
    page.turn('Pause', 'Play')
    shown = shown_time(page) - 1.0
    # However slow the machine: never more than that share of the time that has passed.
    assert shown <= 0.05 * (time.monotonic() - begin) + 1e-3
    page.fill_beside(1, 1.0)


def test_a_loop_begins_anew(page):
    loop = page.tick('loop')
    page.wait_for(loop.is_checked, 'the loop')
    seek(page, 3.9)
    page.click('Play')
    page.wait_for(lambda: shown_time(page) < 3.5, 'the beginning')
    page.turn('Pause', 'Play')      # as long as it loops, it does not stop by itself
    page.tick('loop')


def test_steps_go_from_state_to_state(page):
    seek(page, 1.0)
    page.click('forward')
    page.wait_for(lambda: '1.010 s, state 102 of 401' in page.text(), 'the next state')
    page.click('back')
    page.wait_for(lambda: '1.000 s, state 101 of 401' in page.text(), 'the state before')


def test_what_happened_can_be_gone_to(page):
    seek(page, 0.0)
    page.click_on(page.page.locator('input[aria-haspopup=listbox]:visible').first)
    page.click_on(page.page.get_by_text('set pose middle').first)
    page.wait_for(lambda: '2.000 s, state' in page.text(), 'the time of the event')


def test_legends_of_charts_show_the_values_at_the_time_of_the_picture(page):
    page.click_on(page.page.get_by_role('tab', name='Charts'))
    legends = page.page.locator('div[style*="text-align: center"] b')
    curves = page.page.evaluate(
        '() => Object.values(window.__viserTestpoints.uplots)'
        '.map(({chart}) => chart.data.slice(1).map((line) => Array.from(line)))')
    for at, point in ((0.0, 0), (4.0, -1)):
        page.click_on(page.page.get_by_role('tab', name='Play'))
        seek(page, at)
        page.click_on(page.page.get_by_role('tab', name='Charts'))
        shown = [f'{line[point]:.4g}' for lines in curves for line in lines]
        page.wait_for(lambda shown=shown: legends.all_inner_texts() == shown, 'the values then')
    page.click_on(page.page.get_by_role('tab', name='Play'))


def test_the_session_is_verified(page):
    page.wait_for(lambda: 'verified: the same to the bit in 800 steps' in page.text(),
                  'the verdict')


def test_a_bag_is_shown_where_no_ros_is_installed(bag, folder):
    code = f"""
import sys, threading


class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0].endswith(('rclpy', '_msgs', '_srvs', 'ament_index_python')):
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)


sys.meta_path.insert(0, Block())
from rigid_sim_ros.viewer.bag import show_bag
stopped = threading.Event()
stopped.set()
show_bag({str(bag)!r}, stopped, port=0)
"""
    result = fresh.run('-c', code)
    assert result.returncode == 0, result.stderr
    assert 'the page is at http://127.0.0.1:' in result.stdout
