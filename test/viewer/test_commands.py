# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command line of the page."""
from importlib.util import find_spec
import re
import signal
import sys
import time
from unittest import SkipTest
from urllib.error import URLError
from urllib.request import urlopen

if find_spec('rclpy') is None or find_spec('viser') is None:
    raise SkipTest('rclpy or viser is not installed: pip install .[ros]')

import fresh
from nodes.live import kept, PATIENCE, Process, ROOT
import pytest
from viewer.browsing import Page, scene_file

from rigid_sim_ros.nodes.view_process import name_of


@pytest.mark.parametrize(('ros_args', 'name'), [
    ([], '/rigid_sim'),
    (['--ros-args', '-r', '__node:=lab'], '/lab'),
    (['--ros-args', '--remap', '__name:=lab', '-r', '__ns:=/hall/two'], '/hall/two/lab'),
    (['--ros-args', '-r', 'rigid_sim:__node:=lab'], '/lab'),
    (['--ros-args', '-r', 'other:__node:=lab', '-p', 'scene:=tower'], '/rigid_sim'),
    (['--ros-args', '-r', '/clock:=/time', '-r', '__ns:=/'], '/rigid_sim'),
])
def test_the_page_of_a_run_knows_the_name_of_its_node(ros_args, name):
    assert name_of(ros_args) == name


@pytest.mark.parametrize('program', [['rigid_sim', 'view'], ['view']])
@pytest.mark.parametrize(('words', 'said'), [
    (['no_such_bag'], 'no_such_bag does not exist'),
    (['--host', '192.0.2.1'], 'must be an address of this machine'),
    (['--port', '70000'], '70000'),
    (['--rate', '0'], 'must be > 0'),
    (['--no-such-option'], '--no-such-option'),
])
def test_what_cannot_be_done_is_one_line(tmp_path, program, words, said):
    process = Process([*program, *words], tmp_path, is_forked=True)
    assert process.wait() == 2
    assert said in process.stderr
    assert len(process.stderr.splitlines()) == 1


@pytest.mark.parametrize('start', [
    'from rigid_sim_ros.nodes.view import main; sys.exit(main())',
    'from rigid_sim_ros.cli import main; sys.argv[1:] = ["view"]; main()',
    'from rigid_sim_ros.cli import main; sys.argv[1:] = ["run", "tower", "--view"]; main()',
])
def test_without_viser_one_line_says_what_to_install(start):
    code = f"import sys; sys.modules['viser'] = None; {start}"     # Python's mark for: not there
    result = fresh.run('-c', code, cwd=ROOT)
    assert result.returncode == 2
    said, = result.stderr.splitlines()
    assert said.startswith('rigid_sim: the page needs viser: `pip install')


def test_a_run_begins_with_its_page_and_ends_it(ros, browser, tmp_path):
    command = [sys.executable, '-m', 'rigid_sim_ros', 'run', str(scene_file(tmp_path)), '--view']
    with kept(Process(command, tmp_path / 'run')) as process:
        address = wait_for(lambda: re.search(
            r'the page is at (http://\S+)', (tmp_path / 'run/stdout').read_text('utf-8')))[1]
        with urlopen(address, timeout=60) as answer:
            assert answer.status == 200
        wait_for(lambda: 'paused: ~/pause lets it go on' in process.stderr)
        assert 'resumed' not in process.stderr      # nobody has looked yet
        page = Page(browser, address.rstrip('/'), (700, 400))
        wait_for(lambda: 'resumed at 0.000000000 s' in process.stderr)
        page.close()
        process.signal(signal.SIGINT)
        assert process.wait() == 0
    with pytest.raises(URLError, match='refused'):
        urlopen(address, timeout=60)


def wait_for(condition):
    end = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < end
        time.sleep(0.1)
    return value
