# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The command `rigid_sim`.

A command is a function below that imports what it needs when it runs: `--help` answers at once,
and everything but `run` works where no ROS is installed.
"""
from collections.abc import Sequence
from contextlib import nullcontext
import errno
from importlib import import_module
import os
from typing import Any, NoReturn

import click

from rigid_sim_ros import __version__
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.cli.options import (
    Commands, duration_option, examples, NodeCommand, Positive, record_option, scene_argument,
    Seconds, Size)
from rigid_sim_ros.environment import check_engine, check_pictures, EnvironmentProblem
from rigid_sim_ros.scene.errors import SceneError
from rigid_sim_ros.signals import ended_by_ctrl_c, INTERRUPTED
from rigid_sim_ros.viewer import is_installed, NEEDED

# What a user can mend: wrong usage, a bad scene, a missing installation.
USAGE = 2
NO_ROS = ("needs ROS 2: `pip install '.[ros]'` in a clone of rigid_sim_ros, or, where ROS 2 is "
          'installed from apt, `source /opt/ros/jazzy/setup.bash`')


@click.group(cls=Commands, invoke_without_command=True, context_settings={
    'help_option_names': ['-h', '--help'], 'max_content_width': 99}, epilog=examples(
        'rigid_sim scenes                        what there is to look at',
        'rigid_sim check t_handle                what a scene holds, and whether it is right',
        'rigid_sim run t_handle --duration 10    the node, for ten seconds',
        'rigid_sim batch t_handle --duration 10 --output session    offline, into a bag'))
@click.version_option(__version__, prog_name='rigid_sim', message='%(prog)s %(version)s')
@click.pass_context
def rigid_sim(ctx: click.Context) -> None:
    """
    Simulate rigid bodies in a ROS 2 node.

    SCENE is the path of a YAML file, of a model (URDF, SDF, MJCF, xacro), or the name of an
    example: `rigid_sim scenes` lists them.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
    else:
        check_engine()


@rigid_sim.command(cls=NodeCommand, epilog=examples(
    'rigid_sim run tumbling_cubesat',
    'rigid_sim run tower --view',
    'rigid_sim run my_scene.yaml --duration 60 --record session',
    'rigid_sim run t_handle --ros-args -p real_time_factor:=2.0 -r __node:=lab',
    'rigid_sim run t_handle --ros-args --params-file my_parameters.yaml'))
@scene_argument(required=False)
@duration_option
@record_option
@click.option('--view', 'is_viewed', is_flag=True,
              help='Open a web page that shows and drives the simulation, which begins when '
                   'somebody looks at it.')
def run(scene: str | None, duration: float | None, record: str | None, is_viewed: bool,
        ros_args: list[str]) -> int | None:
    """
    Run SCENE in the ROS 2 node `simulate`.

    The node publishes the pose and the twist of every body and takes wrenches for them. Without
    SCENE it runs the one that its parameter `scene` names.
    """
    simulate = _import_node('run', 'simulate')
    page: Any = nullcontext()
    if is_viewed:
        _check_viewer()
        page = _import_node('run', 'view_process').viewing(ros_args)
    with page:
        result: int | None = simulate.run(
            scene, duration=duration, record=record, paused=is_viewed, ros_args=ros_args)
    return result


@rigid_sim.command(cls=NodeCommand, epilog=examples(
    'rigid_sim view                         whatever simulation runs',
    'rigid_sim view --node /lab',
    'rigid_sim view session                 a bag; no ROS is needed',
    'rigid_sim view --host 0.0.0.0          for other machines too, with a token'))
@click.argument('bag', required=False)
@click.option('--node', metavar='NAME', default='',
              help='The simulation or replay to show. Default: the first that is found.')
@click.option('--host', metavar='ADDRESS', default='127.0.0.1', show_default=True,
              help='Where to open the page. Anywhere but here it is guarded by a token.')
@click.option('--port', type=click.IntRange(0, 65535), metavar='PORT', default=8080,
              show_default=True, help='Or the next that is free.')
@click.option('--rate', type=Positive('Hz'), metavar='HZ', default=40.0, show_default=True,
              help='Pictures a second at most.')
def view(bag: str | None, node: str, ros_args: list[str], **options: Any) -> int:
    """
    Show and drive a running simulation, or play BAG, in a web page.

    The page pauses, steps, resets, paces and records the simulation; bodies are dragged with the
    mouse. It shows the scene again when the simulation restarts.
    """
    _check_viewer()
    if bag is None:
        result: int = _import_node('view', 'view_node').run(node, ros_args=ros_args, **options)
        return result
    if node:
        raise click.UsageError(f'--node {node} stands beside BAG: show one of them')
    from rigid_sim_ros.viewer.address import AddressError
    from rigid_sim_ros.viewer.bag import run as show

    try:
        return show(bag, **options)
    except AddressError as error:
        raise click.ClickException(str(error)) from None


def _check_viewer() -> None:
    if not is_installed():
        raise click.ClickException(NEEDED)


def _import_node(command: str, name: str) -> Any:
    """Return a module of `nodes`; a ClickException where no ROS is installed."""
    try:
        with ended_by_ctrl_c():
            return import_module(f'rigid_sim_ros.nodes.{name}')
    except ImportError as error:
        if (error.name or '').startswith('rigid_sim_ros'):
            raise
        raise click.ClickException(f'{command} {NO_ROS} ({error})') from error


@rigid_sim.command(epilog=examples(
    'rigid_sim check t_handle',
    'rigid_sim check my_scene.yaml'))
@scene_argument(required=True)
def check(scene: str) -> None:
    """
    Check SCENE and show what it holds.

    Shows the mass, the centre of mass and the principal moments of inertia of every body, the
    forces and the step, and warns of what is legal and will yet not go well, such as a spring that
    is too stiff for the step. Mistakes are listed with file, line, key and value; the exit code is
    then 2.
    """
    from rigid_sim_ros.cli.report import console, print_scene
    from rigid_sim_ros.scene import read_scene
    from rigid_sim_ros.scene.overlap import initial_overlaps
    from rigid_sim_ros.warm_up import announced

    try:
        content = announced(lambda: read_scene(scene))
    except SceneError as error:
        if len(error.problems) > 1:
            click.echo(str(error))
        raise
    announced(lambda: initial_overlaps(content))
    print_scene(console(), content)


@rigid_sim.command(epilog=examples(
    'rigid_sim convert panda.urdf --output panda.yaml',
    'rigid_sim convert robot.sdf --output -'))
@click.argument('model')
@click.option('--output', metavar='FILE', required=True,
              help='The new scene file; - for the terminal.')
def convert(model: str, output: str) -> None:
    """
    Write MODEL, a URDF, SDF, MJCF or xacro file, as a scene.

    The scene holds bodies, joints and meshes, and needs no other file. What is ignored in the
    model is told in a line each.
    """
    from rigid_sim_ros.cli.converting import convert_model

    convert_model(model, output)


@rigid_sim.command('compile', epilog=examples(
    'rigid_sim compile                      whatever a scene may need',
    'rigid_sim compile tower my_scene.yaml'))
@click.argument('scenes', nargs=-1, metavar='[SCENE ...]')
def compile_kernels(scenes: tuple[str, ...]) -> None:
    """
    Compile the physics before they are needed: what each SCENE calls, or everything.

    The first start on a machine compiles by itself; an image of a container, or a CI, does so in
    advance. The kernels are kept below NUMBA_CACHE_DIR if that is set, else in the user's cache.
    They are made for the processor on which this runs.
    """
    from rigid_sim_ros.cli.precompile import precompile
    from rigid_sim_ros.cli.report import console

    precompile(scenes, console())


@rigid_sim.command(epilog=examples(
    'rigid_sim scenes',
    'rigid_sim run tumbling_cubesat'))
def scenes() -> None:
    """
    List the example scenes.

    Each can be used by its name wherever a command takes a SCENE.
    """
    from rigid_sim_ros.cli.report import console, print_examples

    print_examples(console())


@rigid_sim.command(epilog=examples(
    'rigid_sim batch t_handle --duration 60 --output session',
    'rigid_sim batch my_scene.yaml --duration 10 --output session --compression zstd'))
@scene_argument(required=True)
@click.option('--duration', type=Seconds(), metavar='SECONDS', required=True,
              help='How much simulation time to run.')
@click.option('--output', metavar='DIR', required=True, help='The folder of the new bag.')
@click.option('--rate', type=Positive('Hz'), metavar='HZ', default=100.0, show_default=True,
              help='How often poses and twists are recorded, in simulation time.')
@click.option('--hash-interval', type=click.IntRange(min=0), metavar='STEPS', default=1000,
              show_default=True, help='Steps from one state hash to the next; 0: none.')
@click.option('--storage', type=click.Choice(['mcap', 'sqlite3']), default='mcap',
              show_default=True)
@click.option('--compression', type=click.Choice(['none', 'zstd']), default='none',
              show_default=True)
def batch(scene: str, duration: float, output: str, **options: Any) -> int:
    """
    Simulate SCENE offline, as fast as possible, into a bag.

    The bag holds what the node would publish and record. No ROS is needed.
    """
    from rigid_sim_ros.cli.bag_commands import run_batch

    return run_batch(scene, duration, output, **options)


@rigid_sim.command(cls=NodeCommand, epilog=examples(
    'rigid_sim replay session',
    'rigid_sim replay session --rate 0.5 --loop --start 12 --duration 3',
    "rigid_sim replay session --topics '/rigid_sim/*/pose' --topics /clock",
    'rigid_sim replay session --ros-args -r /rigid_sim/state:=/recorded/state'))
@click.argument('bag', required=False)
@click.option('--rate', type=float, metavar='R', help='Seconds of the bag per second.')
@click.option('--loop', is_flag=True, default=None, help='Begin again at the end.')
@click.option('--start', type=Seconds(may_be_zero=True), metavar='SECONDS',
              help='Begin this far into the bag.')
@click.option('--duration', type=Seconds(), metavar='SECONDS', help='Play so much of the bag.')
@click.option('--topics', multiple=True, metavar='GLOB',
              help='Publish only the topics that match; may be given several times.')
@click.option('--pause', 'paused', is_flag=True, default=None, help='Begin paused.')
@click.option('--qos-profile-overrides-path', 'qos_path', metavar='FILE',
              help='Other QoS than was recorded, in the YAML file of `ros2 bag play`.')
def replay(bag: str | None, topics: tuple[str, ...], ros_args: list[str],
           **options: Any) -> int | None:
    """
    Publish what BAG holds, when it was recorded.

    BAG is the folder of any ROS 2 bag. Keys in a terminal: space pauses, arrows seek by 5 s and
    change the rate, s steps, q quits.
    """
    node = _import_node('replay', 'replay.node')
    result: int | None = node.run(
        bag, topics=list(topics) or None, ros_args=ros_args, **options)
    return result


@rigid_sim.command(epilog=examples(
    'rigid_sim verify session'))
@click.argument('bag')
def verify(bag: str) -> int:
    """
    Simulate the session in BAG again and compare.

    Every recorded state and hash has to come out the same to the last bit. If one does not, the
    first step and body that differ are printed, and the exit code is 1.
    """
    from rigid_sim_ros.cli.bag_commands import run_verify

    return run_verify(bag)


@rigid_sim.command(cls=NodeCommand, epilog=examples(
    'rigid_sim resume session --at 12.5',
    'rigid_sim resume session --at 12.5 --duration 10 --record branch'))
@click.argument('bag')
@click.option('--at', type=Seconds(may_be_zero=True), metavar='SECONDS', required=True,
              help='Simulation time from which to go on.')
@duration_option
@record_option
def resume(bag: str, at: float, duration: float | None, record: str | None,
           ros_args: list[str]) -> int | None:
    """
    Run the node from a moment of the session in BAG, to branch off.

    Everything is as it was then, after all that the world was told at that time: motion, contacts,
    wrenches with the time that they have left. Parameters are those of the session too, but for
    the pace; `--ros-args` overrides them.
    """
    from rigid_sim_ros.bag.resume import find

    simulate = _import_node('resume', 'simulate')
    result: int | None = simulate.run(
        duration=duration, record=record, moment=find(bag, at), ros_args=ros_args)
    return result


@rigid_sim.command(epilog=examples(
    'rigid_sim info session'))
@click.argument('bag')
def info(bag: str) -> int:
    """
    Show what BAG holds, and whether it is whole.

    BAG is the folder of any ROS 2 bag; of our own recordings it shows the scene, what happened and
    the gaps too. The whole bag is read: a damaged one is an error.
    """
    from rigid_sim_ros.cli.bag_commands import run_info

    return run_info(bag)


@rigid_sim.command(epilog=examples(
    'rigid_sim recover session'))
@click.argument('bag')
def recover(bag: str) -> int:
    """
    Restore BAG after a crash, a full disk or damage.

    Keeps all that is whole, makes index and metadata anew, and says what is lost.
    """
    from rigid_sim_ros.cli.bag_commands import run_recover

    return run_recover(bag)


@rigid_sim.command(epilog=examples(
    'rigid_sim export session --output motion.csv',
    'rigid_sim export session --output motion.parquet'))
@click.argument('bag')
@click.option('--format', 'file_format', type=click.Choice(['csv', 'parquet']),
              help='Default: what the ending of FILE says, else csv.')
@click.option('--output', metavar='FILE',
              help='Default: the name of the bag, in the working directory.')
@click.option('--units', is_flag=True, help='Name each column with its unit: position_x [m].')
def export(bag: str, file_format: str | None, output: str | None, *, units: bool) -> int:
    """
    Write the motion in BAG as a table, a row for each body and time.

    Columns are called position_x, linear_velocity_z, and so on, in SI units, which Parquet files
    hold as metadata. Accepted wrenches and joint states go to files beside it.
    """
    from rigid_sim_ros.cli.bag_commands import run_export

    return run_export(bag, file_format, output, units=units)


@rigid_sim.command(epilog=examples(
    'rigid_sim plot session --output session.png',
    'rigid_sim plot session --output ball.svg --bodies ball --quantity position --quantity gap',
    "rigid_sim plot session --output blocks.html --bodies 'block_*' --start 2 --duration 3"))
@click.argument('bag')
@click.option('--output', metavar='FILE', required=True,
              help='A picture, .png or .svg, or a page to zoom into, .html.')
@click.option('--bodies', metavar='GLOB', multiple=True,
              help='Names or patterns, may be repeated. Default: the bodies that are not fixed.')
@click.option('--joints', metavar='GLOB', multiple=True,
              help='Names or patterns, may be repeated. Default: all joints.')
@click.option('--quantity', 'quantities', metavar='NAME', multiple=True,
              help='position, path, velocity, angular_velocity, energy, momentum, '
                   'angular_momentum, contact_force, gap, joint_position, joint_velocity or '
                   'joint_effort; may be repeated. Default: all.')
@click.option('--start', type=Seconds(may_be_zero=True), metavar='SECONDS', default=0.0,
              help='Leave out so much at the beginning.')
@click.option('--duration', type=Seconds(), metavar='SECONDS', help='Show no more than this.')
def plot(bag: str, output: str, **options: Any) -> int:
    """
    Draw trajectories, velocities, energy, momentum, contacts and joints of BAG.

    BAG is the folder of any ROS 2 bag: one without a scene shows poses and twists. Contact forces
    and gaps come from simulating the session again with its recorded inputs.
    """
    from rigid_sim_ros.plots.command import run_plot
    from rigid_sim_ros.warm_up import announced

    return run_plot(bag, output, announced=announced, **options)


@rigid_sim.command(epilog=examples(
    'rigid_sim render session --output session.mp4',
    'rigid_sim render session --output moment.png --at 1.5 --size 1920x1080',
    'rigid_sim render session --output slow.mp4 --start 2 --duration 1 --speed 0.1',
    'rigid_sim render session --output near.mp4 --camera 2 -1 0.5 --look-at 0 0 0.3'))
@click.argument('bag')
@click.option('--output', metavar='FILE', required=True, help='A film, .mp4, or a picture, .png.')
@click.option('--at', type=Seconds(may_be_zero=True), metavar='SECONDS',
              help='The moment of a picture. Default: the beginning.')
@click.option('--start', type=Seconds(may_be_zero=True), metavar='SECONDS', default=0.0,
              help='Leave out so much at the beginning of a film.')
@click.option('--duration', type=Seconds(), metavar='SECONDS', help='Show no more than this.')
@click.option('--speed', type=Positive(), metavar='FACTOR', default=1.0, show_default=True,
              help='Simulated seconds in a second of film.')
@click.option('--fps', type=click.FloatRange(1.0, 240.0), default=30.0, show_default=True,
              help='Pictures in a second of film.')
@click.option('--size', type=Size(), metavar='WxH', default='960x540', show_default=True)
@click.option('--camera', type=float, nargs=3, metavar='X Y Z',
              help='Where the camera stands [m]. Default: where it sees all that moves.')
@click.option('--look-at', type=float, nargs=3, metavar='X Y Z',
              help='What the camera looks at [m]. Default: the middle of what moves.')
def render(bag: str, output: str, **options: Any) -> int:
    """
    Film BAG, or draw one moment of it, without a display.

    BAG holds a scene, as recordings of `batch` and of the node do. No GPU is needed.
    """
    check_pictures()
    from rigid_sim_ros.render.command import run_render

    return run_render(bag, output, **options)


def main(argv: Sequence[str] | None = None) -> NoReturn:
    """
    Run the command line and leave the process.

    Exit codes: 0 done; 1 it ran and the answer is no; 2 wrong usage or bad input, with one line on
    stderr.
    """
    try:
        code = rigid_sim.main(argv, prog_name='rigid_sim', standalone_mode=False)
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else 'rigid_sim'
        fail(f'{error.format_message()} (see `{where} --help`)')
    except click.ClickException as error:
        fail(error.format_message())
    except SceneError as error:
        fail(error.summary)
    except (BagError, EnvironmentProblem) as error:
        fail(str(error))
    except click.Abort:
        raise SystemExit(INTERRUPTED) from None
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        # Python would write what is left of it at the end, and say once more that it cannot.
        with open(os.devnull, 'wb') as nothing:
            os.dup2(nothing.fileno(), 1)
        fail(f'the output cannot be written: {os.strerror(error.errno)}')
    raise SystemExit(code if isinstance(code, int) else 0)


def fail(message: str) -> NoReturn:
    """Leave with one line on stderr."""
    click.echo(f'rigid_sim: {" ".join(message.split())}', err=True)
    raise SystemExit(USAGE)
