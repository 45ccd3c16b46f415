# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: what it prints, where, and with which exit code."""
from collections.abc import Callable
from pathlib import Path
import subprocess
import sys
from types import SimpleNamespace

from first_start import besides_compiling
import pytest

import rigid_sim_ros
from rigid_sim_ros import cli
from rigid_sim_ros.cli.options import split_ros_args
from rigid_sim_ros.cli.report import pace
from rigid_sim_ros.problems import counted

Run = Callable[..., SimpleNamespace]

PENDULUM = """
format: 1
world: {step: 0.002, integrator: rk4}
bodies:
  - name: bob
    shape: {type: sphere, radius: 0.05}
    mass: 0.5
    pose: {position: [0, 0, 1]}
forces:
  - {type: spring, a: bob, b: world, anchor: [0, 0, 2], stiffness: 40, rest_length: 1}
"""


@pytest.fixture
def run(capsys) -> Run:
    """Run the command line in this process."""
    def call(*args: str) -> SimpleNamespace:
        with pytest.raises(SystemExit) as leaving:
            cli.main(args)
        out, err = capsys.readouterr()
        return SimpleNamespace(code=leaving.value.code, out=out, err=besides_compiling(err))
    return call


@pytest.fixture
def scene(tmp_path) -> Callable[[str], str]:
    """Write a scene to a file and return its path."""
    def write(text: str) -> str:
        path = tmp_path / 'scene.yaml'
        path.write_text(text)
        return str(path)
    return write


def fails_in_one_line(result: SimpleNamespace, *words: str) -> None:
    """Check exit code 2, nothing on stdout, and one line on stderr that holds every word."""
    assert (result.code, result.out) == (2, '')
    assert result.err.startswith('rigid_sim: ')
    assert result.err.count('\n') == 1
    assert [word for word in words if word not in result.err] == []


def test_without_arguments_the_help_is_shown(run: Run) -> None:
    result = run()
    assert (result.code, result.err) == (0, '')
    assert 'rigid_sim run t_handle --duration 10' in result.out


@pytest.mark.parametrize('command', [None, *cli.rigid_sim.commands])
def test_every_help_text_has_examples(run: Run, command: str | None) -> None:
    result = run(*([command] if command else []), '--help')
    assert (result.code, result.err) == (0, '')
    assert 'Examples:\n  ' in result.out


def test_an_unknown_command_names_the_nearest(run: Run) -> None:
    fails_in_one_line(run('chek', 't_handle'), "'chek'", "did you mean 'check'?")


def test_an_unknown_option_names_the_nearest(run: Run) -> None:
    fails_in_one_line(run('run', '--duraton', '3'), '--duraton', '--duration')


def test_a_missing_scene_is_a_usage_error(run: Run) -> None:
    fails_in_one_line(run('check'), 'SCENE', 'rigid_sim check --help')


@pytest.mark.parametrize('duration', ['0', '-1', 'nan', 'inf', 'soon'])
def test_a_duration_must_be_positive_and_finite(run: Run, duration: str) -> None:
    fails_in_one_line(run('run', f'--duration={duration}'), '--duration', duration)


@pytest.mark.parametrize('command', [
    'run t_handle --duration', 'batch t_handle --output bag --duration', 'resume bag --at',
    'resume bag --at 0 --duration', 'replay bag --start', 'replay bag --duration',
    'plot bag --output p.png --start', 'plot bag --output p.png --duration',
    'render bag --output p.png --at', 'render bag --output p.mp4 --duration'])
@pytest.mark.parametrize('seconds', ['4.1e9', '1e300'])
def test_a_span_of_time_has_room_in_64_bits_of_nanoseconds(
        run: Run, command: str, seconds: str) -> None:
    words = command.split()
    fails_in_one_line(
        run(*words, seconds), f'{words[-1]!r}: {seconds} s, must be at most 4e+09 s')


@pytest.mark.parametrize(('command', 'unit'), [
    ('view --rate', ' Hz'), ('batch t_handle --output bag --duration 1 --rate', ' Hz'),
    ('render bag --output p.mp4 --speed', '')])
@pytest.mark.parametrize('number', ['0', '-1', 'nan', 'inf', '1e300', '1e-300', 'fast'])
def test_a_rate_or_a_factor_must_be_positive_and_has_its_own_unit(
        run: Run, command: str, unit: str, number: str) -> None:
    told = f'{number!r} is not a number' if number == 'fast' else f'{number}{unit}, must be > 0'
    fails_in_one_line(run(*command.split(), number), f'{command.split()[-1]!r}: {told}')


def test_the_page_shows_a_node_or_a_bag(run: Run) -> None:
    fails_in_one_line(run('view', 'session', '--node', 'lab'), '--node lab stands beside BAG')


def test_what_there_is_one_of_is_not_in_the_plural(run: Run, tmp_path: Path) -> None:
    bag = str(tmp_path / 'bag')
    made = run('batch', 't_handle', '--duration', '0.001', '--hash-interval', '0', '--output', bag)
    assert 'in 1 step and ' in made.out
    assert 'of 1 step, ' in run('verify', bag).out
    assert counted(1, 'message') == '1 message'
    assert counted(0, 'message') == '0 messages'
    assert counted(2, 'body', 'bodies') == '2 bodies'


def test_an_unknown_scene_names_the_nearest_example(run: Run) -> None:
    fails_in_one_line(run('check', 't_handel'), 't_handel', 't_handle')


def test_a_scene_with_a_mistake_is_reported_with_line_key_and_value(run: Run, scene) -> None:
    path = scene(PENDULUM.replace('mass: 0.5', 'mass: -0.5'))
    fails_in_one_line(run('check', path), f'{path}:7', 'bodies[0].mass', '-0.5')


def test_several_mistakes_are_listed_and_summed_up_in_one_line(run: Run, scene) -> None:
    path = scene(PENDULUM.replace('0.002', '0').replace('stiffness: 40', 'stiffness: stiff'))
    result = run('check', path)
    assert [line.split(': ')[1] for line in result.out.splitlines()] == [
        'world.step', 'forces[0].stiffness']
    assert result.code == 2
    assert result.err.count('\n') == 1
    assert 'world.step' in result.err


def test_check_shows_mass_inertia_forces_and_step(run: Run, scene) -> None:
    result = run('check', scene(PENDULUM))
    assert (result.code, result.err) == (0, '')
    # 2/5 m r^2 = 0.4 * 0.5 kg * (0.05 m)^2
    words = ('bob', 'sphere r 0.05', '0.5', '[0.0005, 0.0005, 0.0005]', 'spring', 'stiffness 40',
             'step 0.002 s', 'rk4', '[0, 0, -9.81] m/s^2')
    assert [word for word in words if word not in result.out] == []
    assert 'warning' not in result.out


def test_check_warns_of_a_spring_too_stiff_for_the_step(run: Run, scene) -> None:
    result = run('check', scene(PENDULUM.replace('stiffness: 40', 'stiffness: 4.0e+7')))
    assert result.code == 0
    assert 'warning: spring between bob and world' in result.out


def test_scenes_lists_every_example_with_a_description(run: Run) -> None:
    result = run('scenes')
    folder = Path(rigid_sim_ros.__file__).parent / 'example_scenes'
    names = {path.stem for path in folder.glob('*.yaml')}
    lines = {line.split()[0]: line.split()[1:] for line in result.out.splitlines() if line.strip()}
    assert (result.code, result.err) == (0, '')
    assert names <= set(lines)
    assert [name for name in names if len(lines[name]) < 3] == []


def test_ros_arguments_are_told_from_our_own() -> None:
    own, ros = split_ros_args(
        ['a', '--ros-args', '-p', 'x:=1', '--', '--duration', '3', '--ros-args', '-r', 'b:=c'])
    assert own == ['a', '--duration', '3']
    assert ros == ['--ros-args', '-p', 'x:=1', '--', '--ros-args', '-r', 'b:=c']


def test_run_without_ros_names_both_ways_to_install_it() -> None:
    result = subprocess.run(
        [sys.executable, '-c', """
import sys
sys.modules['rclpy'] = None
from rigid_sim_ros.cli import main
main(['run', 't_handle', '--duration', '1'])
"""], capture_output=True, text=True, check=False, timeout=300)
    fails_in_one_line(
        SimpleNamespace(code=result.returncode, out=result.stdout, err=result.stderr),
        "pip install '.[ros]'", 'source /opt/ros/jazzy/setup.bash')


def test_the_module_is_the_same_command() -> None:
    result = subprocess.run(
        [sys.executable, '-m', 'rigid_sim_ros', '--version'], capture_output=True, text=True,
        check=True, timeout=300)
    assert result.stdout.startswith('rigid_sim ')


@pytest.mark.parametrize('command', [
    ['scenes'], ['check', 'tower'], ['check', 'drone_in_wind'], ['check', 'arm']])
def test_piped_tables_have_no_blanks_at_the_ends_of_lines(run: Run, command) -> None:
    lines = run(*command).out.splitlines()
    assert len(lines) > 5
    assert [line for line in lines if line != line.rstrip()] == []
    assert lines[-1]


@pytest.mark.parametrize('simulated, expected', [
    (0.3, '0.3'), (0.0021, '0.0021'), (2.04, '2'), (9.96, '10'), (1234.4, '1234')])
def test_what_is_slower_than_real_time_is_not_said_to_stand_still(simulated, expected):
    assert pace(simulated, 1.0) == f'{expected} times real time'
