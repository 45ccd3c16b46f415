# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes as tables for a terminal."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from rigid_sim_ros.engine.model.kinds.table import BY_TYPE, KINDS
from rigid_sim_ros.problems import counted
from rigid_sim_ros.scene import describe, example_names, mass, schema
from rigid_sim_ros.scene.advice import advice
from rigid_sim_ros.scene.build import Scene

# [columns] What a table may take where there is no terminal that says how wide it is.
_PIPE_WIDTH = 120
# Bodies that are shown one by one; a scene of thousands would bury the rest.
_MOST_ROWS = 40


def console() -> Console:
    """Return what prints to stdout, without colours or cut columns when that is no terminal."""
    out = Console(highlight=False, markup=False, emoji=False)
    return out if out.is_terminal else Console(
        highlight=False, markup=False, emoji=False, width=_PIPE_WIDTH)


def print_table(out: Console, table: Table) -> None:
    """Print a table; without the blanks that fill its last column when that is no terminal."""
    if out.is_terminal:
        out.print(table)
        return
    with out.capture() as text:
        out.print(table)
    lines = [line.rstrip() for line in text.get().splitlines()]
    out.print('\n'.join(lines).rstrip('\n'), soft_wrap=True)


def print_examples(out: Console) -> None:
    """Print the name of each example scene and what one sees in it."""
    table = _table(('scene', 'left'), ('what it shows', 'left'))
    for name in example_names():
        table.add_row(name, describe(name))
    print_table(out, table)


def print_scene(out: Console, scene: Scene) -> None:
    """Print what a scene holds, and what its author should know before a run."""
    world = scene.spec.world
    out.print(f'{scene.name}: {counted(len(scene.names), "body", "bodies")}, '
              f'{_joint_count(scene.spec)}{counted(len(scene.spec.forces), "force")}, '
              f'step {world.step:g} s, '
              f'gravity {_numbers(world.gravity)} m/s^2')
    out.print(f'integrator {world.integrator}, orientation {world.orientation}, '
              f'contact {world.contact}')
    print_table(out, _bodies(scene))
    if scene.spec.forces:
        print_table(out, _forces(scene.spec.forces))
    if scene.spec.joints:
        print_table(out, _joints(scene.spec.joints))
    for line in scene.notes:
        out.print(f'note: {line}', soft_wrap=True)
    for line in advice(scene):
        out.print(f'warning: {line}', soft_wrap=True)


def _bodies(scene: Scene) -> Table:
    table = _table(('body', 'left'), ('shape', 'left'), ('mass [kg]', 'right'),
                   ('centre of mass [m]', 'left'), ('principal moments [kg m^2]', 'left'),
                   ('frames', 'left'))
    for i, body in enumerate(scene.spec.bodies[:_MOST_ROWS]):
        properties = None if body.kinematic else mass.properties(body)
        shapes = Counter(_shape(part) for _, part in body.parts())
        shape = ' + '.join(f'{count} x {text}' if count > 1 else text
                           for text, count in shapes.items()) or '-'
        table.add_row(
            body.name,
            shape + (', fixed' if body.fixed else ', kinematic' if body.kinematic else ''),
            f'{properties.m:.6g}' if properties else '-',
            _numbers(properties.p_BC) if properties else '-',
            _numbers(scene.model.I_C[:, i]) if properties else '-',
            ' '.join(body.frames) or '-')
    hidden = len(scene.names) - _MOST_ROWS
    if hidden > 0:
        table.add_row(f'... {hidden} more')
    return table


def _forces(forces: Sequence[schema.Force]) -> Table:
    table = _table(('force', 'left'), ('on', 'left'), ('parameters', 'left'))
    for force in forces[:_MOST_ROWS]:
        if isinstance(force, schema.FrameForce):
            own, on = {'type', 'a', 'b'}, f'{force.a} - {force.b}'
        else:
            own, on = {'type', 'bodies'}, ' '.join(getattr(force, 'bodies', ()))
        # A parameter of 0 is one that the kind of force has and this force does not use.
        values = {key: np.atleast_1d(value) for key, value in force if key not in own}
        table.add_row(force.type, on, ', '.join(
            f'{key} {_numbers(value)}' for key, value in values.items() if value.any()))
    hidden = len(forces) - _MOST_ROWS
    if hidden > 0:
        table.add_row(f'... {hidden} more')
    return table


def _joint_count(spec: schema.Scene) -> str:
    return f'{counted(len(spec.joints), "joint")}, ' if spec.joints else ''


def _joints(joints: Sequence[schema.Joint]) -> Table:
    table = _table(('joint', 'left'), ('type', 'left'), ('between', 'left'), ('axis', 'left'),
                   ('range [rad, m]', 'left'), ('at the start', 'left'))
    for joint in joints[:_MOST_ROWS]:
        has_axis = joint.type in schema.ONE_AXIS
        bounds = [joint.limits.lower, joint.limits.upper]
        at = '-'
        if joint.mimic is not None:
            at = f'follows {joint.mimic.joint}'
        elif has_axis:
            at = f'{joint.position or 0.0:.4g}'
        table.add_row(
            joint.name, joint.type, f'{joint.parent} - {joint.child}',
            _numbers(joint.axis) if has_axis else '-',
            ' .. '.join('' if bound is None else f'{bound:.4g}' for bound in bounds)
            if bounds != [None, None] else '-', at)
    hidden = len(joints) - _MOST_ROWS
    if hidden > 0:
        table.add_row(f'... {hidden} more')
    return table


def _shape(part: schema.Shape) -> str:
    """Write a solid in a few words."""
    if isinstance(part, schema.Points):
        return f'{len(part.masses)} {part.type}'
    return f'{part.type} {KINDS[BY_TYPE[part.type]].summary(part)}'.rstrip()


def _numbers(values: Iterable[float]) -> str:
    words = [f'{value + 0.0:.4g}' for value in values]     # + 0.0: no -0
    return words[0] if len(words) == 1 else f'[{", ".join(words)}]'


def _table(*columns: tuple[str, str]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name, side in columns:
        table.add_column(name, justify='right' if side == 'right' else 'left', overflow='fold')
    return table


def pace(simulated: float, seconds: float) -> str:
    """Say how fast a time [s] was simulated; of what is slow two digits."""
    factor = simulated / seconds
    return f'{factor:.0f} times real time' if factor >= 10.0 else f'{factor:.2g} times real time'
