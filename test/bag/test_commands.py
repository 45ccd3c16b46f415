# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The commands for bags: what they print, where, and with which exit code."""

from pathlib import Path
import shutil
import subprocess
import sys
from types import SimpleNamespace

from bag.sessions import rewrite, shared_session
from first_start import besides_compiling
import fresh
import pytest

from rigid_sim_ros import cli
from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.verify import verify


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """Run the command line in this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def call(*args: object) -> SimpleNamespace:
        with pytest.raises(SystemExit) as leaving:
            cli.main([str(arg) for arg in args])
        out, err = capsys.readouterr()
        return SimpleNamespace(code=leaving.value.code, out=out, err=besides_compiling(err))
    return call


def fails_in_one_line(result: SimpleNamespace, *words: str) -> None:
    """Check exit code 2, nothing on stdout, and one line on stderr that holds every word."""
    assert (result.code, result.out) == (2, '')
    assert result.err.startswith('rigid_sim: ')
    assert result.err.count('\n') == 1
    assert [word for word in words if word not in result.err] == []


def test_batch_records_a_bag_that_verify_confirms(run) -> None:
    result = run('batch', 't_handle', '--duration', '0.5', '--output', 'bag')
    assert (result.code, result.err) == (0, '')
    assert 'bag: 0.5 s of t_handle in 500 steps' in result.out
    result = run('verify', 'bag')
    assert (result.code, result.err) == (0, '')
    assert 'the same to the bit' in result.out


def test_verify_says_where_and_by_how_much_and_leaves_with_1(run, tmp_path) -> None:
    def change(topic, data):
        return data[:-1] + bytes([data[-1] ^ 1]) if topic.kind == kinds.POSE else data
    result = run('verify', rewrite(shared_session(), tmp_path, change))
    assert (result.code, result.err) == (1, '')
    assert "differs at step 0, body 'crate': /rigid_sim/crate/pose differs by" in result.out


def test_info_shows_scene_events_gaps_and_health(run) -> None:
    result = run('info', shared_session())
    assert (result.code, result.err) == (0, '')
    for words in ('scene: scene, 2 bodies, step 0.001 s', 'reset 2', 'gaps: none',
                  'health: whole', '/rigid_sim/crate/pose', 'geometry_msgs/msg/PoseStamped'):
        assert words in result.out


def spoiled(tmp_path: Path) -> Path:
    bag = tmp_path / 'spoiled'
    shutil.copytree(shared_session(), bag)
    last = sorted(bag.glob('*.mcap'))[-1]
    last.write_bytes(last.read_bytes()[:-900])
    return bag


@pytest.mark.parametrize('command', [['info'], ['verify'], ['export', '--format', 'csv']])
def test_a_damaged_bag_is_one_line_and_exit_code_2(run, tmp_path, command) -> None:
    fails_in_one_line(run(*command, spoiled(tmp_path)), 'breaks off')


def test_recover_says_what_is_kept_and_lost(run, tmp_path) -> None:
    bag = spoiled(tmp_path)
    result = run('recover', bag)
    assert (result.code, result.err) == (0, '')
    assert 'kept' in result.out
    assert 'messages' in result.out
    assert 'nothing was lost' in result.out
    assert run('verify', bag).code == 0


@pytest.mark.parametrize('args, words', [
    (['verify', 'nothing'], ['nothing does not exist']),
    (['info', 'nothing'], ['nothing does not exist']),
    (['recover', 'nothing'], ['nothing is no folder']),
    (['batch', 't_handle', '--duration', '1', '--output', '.'], ['exists already']),
    (['batch', 't_handle', '--output', 'bag'], ['--duration', '--help']),
    (['batch', 't_handel', '--duration', '1', '--output', 'bag'], ['t_handle']),
    (['export', 'nothing', '--format', 'csv'], ['nothing does not exist']),
    (['export', 'nothing', '--format', 'xls'], ['csv', 'parquet'])])
def test_a_mistake_is_one_line_and_exit_code_2(run, args, words) -> None:
    fails_in_one_line(run(*args), *words)


def test_export_writes_a_table_named_like_the_bag(run, tmp_path) -> None:
    result = run('export', shared_session(), '--format', 'csv')
    assert (result.code, result.err) == (0, '')
    assert result.out.startswith('session.csv: ')
    assert (tmp_path / 'session.csv').exists()


def test_batch_and_verify_need_no_ros(tmp_path) -> None:
    code = f'''
import sys


class Block:
    """Makes every package of ROS look as if it were not installed."""

    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0].endswith(('rclpy', '_msgs', '_srvs', 'ament_index_python')):
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)


sys.meta_path.insert(0, Block())
from rigid_sim_ros import cli
for args in (['batch', 't_handle', '--duration', '0.1', '--output', r'{tmp_path / "bag"}'],
             ['verify', r'{tmp_path / "bag"}']):
    try:
        cli.main(args)
    except SystemExit as leaving:
        print(leaving.code)
'''
    result = fresh.run('-c', code)
    assert [line for line in result.stderr.splitlines() if 'compiling' not in line] == []
    assert result.stdout.splitlines()[1::2] == ['0', '0']


def test_a_bag_that_rosbags_converted_there_and_back_is_verified(tmp_path) -> None:
    bags = [shared_session(), tmp_path / 'sqlite', tmp_path / 'mcap']
    for source, target, storage in zip(bags, bags[1:], ('sqlite3', 'mcap'), strict=False):
        subprocess.run([sys.executable, '-m', 'rosbags.convert', '--src', str(source), '--dst',
                        str(target), '--dst-storage', storage], check=True, capture_output=True)
        assert verify(target).holds
