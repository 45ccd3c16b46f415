# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the commands of `rigid_sim` are made of: their group, node commands, types of options."""

from collections.abc import Callable, Sequence
from typing import Any

import click

from rigid_sim_ros.problems import span
from rigid_sim_ros.words import nearest


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
    """A span of time that is more than nothing, or a point in time, which may be 0."""

    name = 'seconds'

    def __init__(self, *, may_be_zero: bool = False) -> None:
        """Allow 0 or not."""
        self._may_be_zero = may_be_zero

    def convert(
            self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        try:
            return span(value, may_be_zero=self._may_be_zero)
        except ValueError as error:
            self.fail(str(error), param, ctx)


class Positive(click.ParamType):
    """A number that is finite and more than nothing: a rate, or a factor."""

    name = 'number'

    def __init__(self, unit: str = '') -> None:
        """Take the unit that errors show."""
        self._unit = f' {unit}' if unit else ''

    def convert(
            self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        try:
            number = float(value)
        except ValueError:
            self.fail(f'{value!r} is not a number', param, ctx)
        # Beyond these, quotients and products with other such numbers leave the range of numbers.
        if not 1e-9 <= number <= 1e9:
            self.fail(f'{value}{self._unit}, must be > 0 and finite: 1e-9 to 1e9', param, ctx)
        return number


class Size(click.ParamType):
    """Width and height of a picture in pixels, such as 960x540."""

    name = 'size'

    def convert(self, value: Any, param: click.Parameter | None,
                ctx: click.Context | None) -> tuple[int, int]:
        """Return the two numbers, even as films need them."""
        if isinstance(value, tuple):
            return value
        width, _, height = str(value).lower().partition('x')
        if not (width.isdecimal() and height.isdecimal()):
            self.fail(f'{value!r}, must be WIDTHxHEIGHT such as 960x540', param, ctx)
        size = int(width), int(height)
        if any(number % 2 or not 16 <= number <= 8192 for number in size):
            self.fail(f'{value}, must be two even numbers from 16 to 8192', param, ctx)
        return size


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


duration_option = click.option(
    '--duration', type=Seconds(), metavar='SECONDS',
    help='Stop after this much simulation time. Without it the node runs until Ctrl-C.')
record_option = click.option(
    '--record', metavar='DIR', help='Record the session into this new folder, a ROS 2 bag.')
