# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the commands for bags do and print; each returns the exit code."""

from collections.abc import Callable
from pathlib import Path
import time

import click
from rich.table import Table

from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.export import default_output, export, format_of
from rigid_sim_ros.bag.info import Info, info
from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.verify import verify
from rigid_sim_ros.bag.writer import check_path
from rigid_sim_ros.cli.report import console, pace, print_table
from rigid_sim_ros.problems import counted, printable
from rigid_sim_ros.times import SECOND
from rigid_sim_ros.warm_up import announced, warm_up
from rigid_sim_ros.world import load_scene, World
from rigid_sim_ros.world.values import some


def _say(text: str) -> None:
    """Print a line that may quote what stands in a file."""
    click.echo(printable(text))


def run_batch(scene: str, duration: float, output: str, *, rate: float, hash_interval: int,
              storage: str, compression: str) -> int:
    """Simulate a scene into a bag and say how fast that was."""
    world = announced(lambda: load_scene(scene))
    check_path(output)      # fails now, not after compiling
    warm_up(world.scene)
    steps = round(duration * SECOND / world.step_ns)
    begin = time.monotonic()
    batch = Batch(world, output, publish_rate=rate, hash_interval=hash_interval, storage=storage,
                  compression=compression)
    try:
        batch.run(steps)
    except ArithmeticError as error:
        batch.close()
        raise click.ClickException(f'{error}; {output} holds what came before') from None
    except KeyboardInterrupt:
        batch.close()
        raise
    status = batch.close()
    seconds = time.monotonic() - begin
    simulated = steps * world.step_ns / SECOND
    click.echo(f'{output}: {simulated:g} s of {world.scene.name} in {counted(steps, "step")} and '
               f'{counted(status.messages, "message")}, {pace(simulated, seconds)}')
    return 0


def run_verify(bag: str) -> int:
    """Simulate a session again and say whether all is as it was recorded."""
    compiling = 0.0

    def prepare(make: Callable[[], World]) -> World:
        nonlocal compiling
        before = time.monotonic()
        world = announced(make)
        warm_up(world.scene)
        compiling = time.monotonic() - before
        return world

    begin = time.monotonic()
    verdict = verify(bag, prepare=prepare)
    seconds = time.monotonic() - begin - compiling
    if verdict.note:
        _say(f'note: {verdict.note}')
    for fault in verdict.faults:
        _say(f'{bag}: {fault}')
    if verdict.difference is not None:
        _say(f'{bag} differs at {verdict.difference}')
    if not verdict.holds:
        return 1
    if verdict.gaps:
        _say(f'note: {counted(verdict.gaps, "gap")}, of which inputs are missing, and '
             f'{counted(verdict.skipped, "message")} up to the next full state were '
             'left out')
    if verdict.others:
        _say(f'note: not of the session, and not compared: {", ".join(verdict.others)}')
    if verdict.unchecked:
        _say(f'note: recorded, and not made again to be compared: {some(verdict.unchecked)}')
    _say(f'{bag}: the same to the bit: {counted(verdict.messages, "message")} of '
         f'{counted(verdict.steps, "step")}, {verdict.seconds:g} s, '
         f'{pace(verdict.seconds, seconds)}')
    return 0


def run_info(bag: str) -> int:
    """Print what a bag holds."""
    found = info(bag)
    out = console()
    out.print(f'{bag}: {counted(found.messages, "message")} in '
              f'{(found.last_ns - found.first_ns) / SECOND:.3f} s, '
              f'{counted(found.files, "file")}, '
              f'{found.size / 1e6:.2f} MB', soft_wrap=True)
    for line in _session_lines(found):
        out.print(printable(line), soft_wrap=True)
    table = Table('topic', 'type', box=None, header_style='bold')
    table.add_column('messages', justify='right')
    for name, (kind, count) in found.topics.items():
        table.add_row(printable(name), printable(kind), str(count))
    print_table(out, table)
    return 0


def _session_lines(found: Info) -> list[str]:
    # After a recovery what is there is whole, and something may be lost all the same.
    health = f'recovered, {found.note}' if found.note else (
        'whole: every byte is what was written')
    session = found.session
    if session is None:
        return ['no recording of rigid_sim_ros: it cannot be verified', f'health: {health}']
    software = ', '.join(f'{name} {version}' for name, version in session.software.items())
    happened = ', '.join(f'{kind} {count}' for kind, count in sorted(found.happened.items()))
    return [
        f'scene: {session.scene}, {counted(len(session.bodies), "body", "bodies")}, '
        f'step {session.step_ns / 1e9:g} s',
        f'software: {software}',
        f'events: {happened or "none"}',
        f'full states: {found.snapshots}',
        f'gaps: {"; ".join(found.gaps) or "none"}',
        f'health: {health}' + ('' if found.is_closed else '; the recording was cut off'),
    ]


def run_recover(bag: str) -> int:
    """Restore a bag and say what is kept and what is lost."""
    result = recover(bag)
    kept = (f'{counted(result.messages, "message")}, {result.seconds:.3f} s, in '
            f'{counted(result.files, "file")}')
    if result.is_whole:
        _say(f'{bag} is whole: {kept}')
        return 0
    _say(f'{bag}: kept {kept}; {result.loss}')
    if result.rewritten:
        _say(f'written anew: {", ".join(result.rewritten)}')
    for name in result.kept_aside:
        _say(f'the damaged file is kept as {name}')
    return 0


def run_export(bag: str, file_format: str | None, output: str | None, *, units: bool) -> int:
    """Write the motion and the wrenches of a bag as tables."""
    file_format = file_format or format_of(output)
    path = Path(output) if output else default_output(Path(bag), file_format)
    for written, count in export(bag, file_format, path, units=units):
        _say(f'{written}: {counted(count, "row")}')
    return 0
