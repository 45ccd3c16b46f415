# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The command `rigid_sim`.

A command is a function below that imports what it needs when it runs: `--help` answers at once,
and everything but `run` works where no ROS is installed.
"""
from collections.abc import Callable, Sequence
import math
from typing import Any, NoReturn

import click

from rigid_sim_ros import __version__
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.scene.errors import nearest, SceneError

# What a user can mend: wrong usage, a bad scene, a missing installation.
USAGE = 2
NO_ROS = ("needs ROS 2: `pip install '.[ros]'` in a clone of rigid_sim_ros, or, where ROS 2 is "
          'installed from apt, `source /opt/ros/jazzy/setup.bash`')


class Commands(click.Group):
    """A group of commands that knows which one a mistyped name was meant to be."""

    def resolve_command(
            self, ctx: click.Context, args: list[str],
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or name the nearest."""
        if args and self.get_command(ctx, args[0]) is None and not args[0].startswith('-'):
            raise click.UsageError(
                f'no command {args[0]!r}: {nearest(args[0], self.list_commands(ctx))}', ctx)
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the commands in the order in which a newcomer needs them."""
        return list(self.commands)


class NodeCommand(click.Command):
    """
    A command that starts a ROS node and passes on what belongs to ROS.

    As on every ROS 2 executable these are the words from `--ros-args` to the next `--`, or to the
    end; there may be several such stretches. The function gets them as its argument `ros_args`.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Set the arguments of ROS aside and parse the rest."""
        own, ros = split_ros_args(args)
        rest = super().parse_args(ctx, own)
        ctx.params['ros_args'] = ros
        return rest

    def collect_usage_pieces(self, ctx: click.Context) -> list[str]:
        """Show that arguments of ROS may follow."""
        return [*super().collect_usage_pieces(ctx), '[--ros-args ...]']


class Seconds(click.ParamType):
    """A span of time: finite and more than nothing."""

    name = 'seconds'

    def convert(
            self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        try:
            seconds = float(value)
        except ValueError:
            self.fail(f'{value!r} is not a number of seconds', param, ctx)
        if not 0 < seconds < math.inf:
            self.fail(f'{value} s, must be > 0 and finite', param, ctx)
        return seconds


def split_ros_args(args: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split a command line into our own arguments and those that belong to ROS."""
    own: list[str] = []
    ros: list[str] = []
    in_ros = False
    for arg in args:
        if arg == '--ros-args':
            in_ros = True
        (ros if in_ros else own).append(arg)
        if arg == '--':
            in_ros = False
    return own, ros


def examples(*lines: str) -> str:
    """Return the end of a help text: command lines that a newcomer can copy."""
    # A paragraph that begins with this character is not wrapped.
    return '\n'.join(['\b', 'Examples:', *(f'  {line}' for line in lines)])


def scene_argument(*, required: bool) -> Callable[..., Any]:
    """Return the argument SCENE, a path or the name of an example."""
    return click.argument('scene', required=required)


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

    SCENE is the path of a YAML file or the name of an example: `rigid_sim scenes` lists them.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


@rigid_sim.command(cls=NodeCommand, epilog=examples(
    'rigid_sim run tumbling_cubesat',
    'rigid_sim run my_scene.yaml --duration 60',
    'rigid_sim run t_handle --ros-args -p real_time_factor:=2.0 -r __node:=lab',
    'rigid_sim run t_handle --ros-args --params-file my_parameters.yaml'))
@scene_argument(required=False)
@click.option('--duration', type=Seconds(), metavar='SECONDS',
              help='Stop after this much simulation time. Without it the node runs until Ctrl-C.')
def run(scene: str | None, duration: float | None, ros_args: list[str]) -> int | None:
    """
    Run SCENE in the ROS 2 node `simulate`.

    The node publishes the pose and the twist of every body and takes wrenches for them. Without
    SCENE it runs the one that its parameter `scene` names.
    """
    try:
        from rigid_sim_ros.nodes import simulate
    except ImportError as error:
        if (error.name or '').startswith('rigid_sim_ros'):
            raise
        raise click.ClickException(f'run {NO_ROS} ({error})') from error
    result: int | None = simulate.run(scene, duration=duration, ros_args=ros_args)
    return result


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
    from rigid_sim_ros.report import console, print_scene
    from rigid_sim_ros.scene import read_scene

    try:
        content = read_scene(scene)
    except SceneError as error:
        if len(error.problems) > 1:
            click.echo(str(error))
        raise
    print_scene(console(), content)


@rigid_sim.command(epilog=examples(
    'rigid_sim scenes',
    'rigid_sim run tumbling_cubesat'))
def scenes() -> None:
    """
    List the example scenes.

    Each can be used by its name wherever a command takes a SCENE.
    """
    from rigid_sim_ros.report import console, print_examples

    print_examples(console())


@rigid_sim.command(epilog=examples(
    'rigid_sim batch t_handle --duration 60 --output session',
    'rigid_sim batch my_scene.yaml --duration 10 --output session --compression zstd'))
@scene_argument(required=True)
@click.option('--duration', type=Seconds(), metavar='SECONDS', required=True,
              help='How much simulation time to run.')
@click.option('--output', metavar='DIR', required=True, help='The folder of the new bag.')
@click.option('--rate', type=Seconds(), metavar='HZ', default=100.0, show_default=True,
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
    from rigid_sim_ros.bag_commands import run_batch

    return run_batch(scene, duration, output, **options)


@rigid_sim.command(epilog=examples(
    'rigid_sim verify session'))
@click.argument('bag')
def verify(bag: str) -> int:
    """
    Simulate the session in BAG again and compare.

    Every recorded state and hash has to come out the same to the last bit. If one does not, the
    first step and body that differ are printed, and the exit code is 1.
    """
    from rigid_sim_ros.bag_commands import run_verify

    return run_verify(bag)


@rigid_sim.command(epilog=examples(
    'rigid_sim info session'))
@click.argument('bag')
def info(bag: str) -> int:
    """
    Show what BAG holds, and whether it is whole.

    BAG is the folder of any ROS 2 bag; of our own recordings it shows the scene, what happened and
    the gaps too. The whole bag is read: a damaged one is an error.
    """
    from rigid_sim_ros.bag_commands import run_info

    return run_info(bag)


@rigid_sim.command(epilog=examples(
    'rigid_sim recover session'))
@click.argument('bag')
def recover(bag: str) -> int:
    """
    Restore BAG after a crash, a full disk or damage.

    Keeps all that is whole, makes index and metadata anew, and says what is lost.
    """
    from rigid_sim_ros.bag_commands import run_recover

    return run_recover(bag)


@rigid_sim.command(epilog=examples(
    'rigid_sim export session --format csv',
    'rigid_sim export session --format parquet --output motion.parquet'))
@click.argument('bag')
@click.option('--format', 'file_format', type=click.Choice(['csv', 'parquet']), required=True)
@click.option('--output', metavar='FILE',
              help='Default: the name of the bag, in the working directory.')
def export(bag: str, file_format: str, output: str | None) -> int:
    """
    Write the motion in BAG as a table, a row for each body and time.

    The column names say the units. Accepted wrenches go to a second file beside it.
    """
    from rigid_sim_ros.bag_commands import run_export

    return run_export(bag, file_format, output)


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
    except BagError as error:
        fail(str(error))
    except click.Abort:
        raise SystemExit(130) from None      # 128 + SIGINT, as a shell reports it
    raise SystemExit(code if isinstance(code, int) else 0)


def fail(message: str) -> NoReturn:
    """Leave with one line on stderr."""
    click.echo(f'rigid_sim: {" ".join(message.split())}', err=True)
    raise SystemExit(USAGE)
