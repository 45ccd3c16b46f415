# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `rigid_sim plot` does and prints; returns the exit code."""

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import click
import numpy as np
import numpy.typing as npt

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import Array, Motion, read_motion
from rigid_sim_ros.plots.contacts import simulate_contacts
from rigid_sim_ros.plots.diagram import Diagram
from rigid_sim_ros.plots.energies import energies
from rigid_sim_ros.plots.panels import OF_CONTACT, OF_JOINTS, OF_SCENE, QUANTITIES, Shown
from rigid_sim_ros.problems import counted
from rigid_sim_ros.words import matches, matching, nearest

# What writes a kind of file: its module in this package, its function, and the library it needs.
_WRITERS = {
    '.png': ('picture', 'write_picture', 'matplotlib'),
    '.svg': ('picture', 'write_picture', 'matplotlib'),
    '.html': ('page', 'write_page', 'plotly'),
}


def run_plot(bag: str, output: str, *, bodies: Sequence[str] = (), joints: Sequence[str] = (),
             quantities: Sequence[str] = (), start: float = 0.0,
             duration: float | None = None,
             announced: Callable[[Callable[[], Any]], Any] = lambda work: work()) -> int:
    """
    Draw what a bag holds into a file and say what was drawn.

    `announced` does what may have to compile kernels first, and says so.
    """
    path = Path(output)
    if path.suffix.lower() not in _WRITERS:
        raise BagError(f'--output {output}, must end in {", ".join(_WRITERS)}')
    module, function, library = _WRITERS[path.suffix.lower()]
    try:
        write = getattr(import_module(f'rigid_sim_ros.plots.{module}'), function)
    except ImportError as error:
        raise BagError(f"plot needs {library}: `pip install 'rigid_sim_ros[plot]'`, or `pip "
                       f'install {library}` ({error})') from None
    diagram, notes = announced(lambda: make_diagram(
        bag, bodies, quantities, start, duration, joints))
    try:
        write(diagram, path)
    except OSError as error:
        raise BagError(f'{error.filename or path}: {error.strerror or error}') from None
    for note in notes:
        click.echo(f'note: {note}')
    panels = len(diagram.panels)
    click.echo(f'{path}: {counted(panels, "panel")}, {diagram.title}')
    return 0


def make_diagram(bag: str, patterns: Sequence[str], quantities: Sequence[str], start: float,
                 duration: float | None, joints: Sequence[str] = ()) -> tuple[
                     Diagram, list[str]]:
    """Return what is to be drawn, and notes about what cannot be."""
    for name in quantities:
        if name not in QUANTITIES:
            raise BagError(f'--quantity {name}: {nearest(name, QUANTITIES)}')
    motion = read_motion(bag)
    wanted = list(dict.fromkeys(quantities)) or _usual(motion)
    bodies = choose_bodies(motion, patterns)
    rows = choose_rows(motion, start, duration)
    missing: dict[str, str] = {}
    shown = Shown(
        [motion.names[k] for k in bodies], motion.time[rows],
        [k - rows.start for k in motion.resets if rows.start < k < rows.stop],
        motion.position[rows][:, bodies], motion.linear_velocity[rows][:, bodies],
        motion.angular_velocity[rows][:, bodies], None, {}, {},
        choose_joints(motion, joints, motion.time[rows]), _slides(motion))
    if set(wanted) & set(OF_SCENE):
        shown = _with_energies(shown, motion, rows, bodies, missing)
    if set(wanted) & set(OF_CONTACT):
        shown = _with_contacts(bag, shown, motion, rows, bodies, missing)
    panels = []
    for name in wanted:
        made = QUANTITIES[name](shown)
        if not made:
            missing.setdefault(name, 'the bag tells nothing of it')
        panels += made
    notes = [*motion.notes, *(f'no {name.replace("_", " ")}: {why}'
                              for name, why in missing.items()
                              if name in wanted or name not in QUANTITIES)]
    if not panels:
        raise BagError(f'{bag}: nothing to plot: {"; ".join(notes)}')
    span = f'{shown.time[0]:g} to {shown.time[-1]:g} s'
    scene = motion.scene.name if motion.scene else Path(bag).resolve().name
    who = shown.names[0] if len(shown.names) == 1 else f'{len(shown.names)} bodies'
    resets = [float(motion.time[k]) for k in motion.resets if rows.start < k < rows.stop]
    return Diagram(f'{scene}: {who}, {span}', _time_label(motion), panels, resets), notes


def _usual(motion: Motion) -> list[str]:
    """Return what is drawn if nobody says what: all but what is missing in the scene."""
    absent = () if motion.joints else OF_JOINTS
    if not any(values[:, 2].any() for _, values in motion.joints.values()):
        absent = (*absent, 'joint_effort')      # nothing drives a joint, and no spring
    return [name for name in QUANTITIES if name not in absent]


def choose_bodies(motion: Motion, patterns: Sequence[str]) -> npt.NDArray[np.intp]:
    """Return the indices of the bodies that a pattern matches; without one of those that move."""
    names = motion.names
    if not patterns:
        still = {body.name for body in motion.scene.spec.bodies if body.fixed} if (
            motion.scene) else set()
        found = [k for k, name in enumerate(names) if name not in still]
        return np.array(found or range(len(names)), dtype=np.intp)
    for pattern in patterns:
        if not matching(names, [pattern]):
            some = ', '.join(names[:8]) + (', ...' if len(names) > 8 else '')
            raise BagError(f'--bodies {pattern!r} matches no body, must be one of {some}, or a '
                           "pattern such as 'block_*'")
    return np.array([k for k, name in enumerate(names) if matches(name, patterns)], dtype=np.intp)


def choose_joints(motion: Motion, patterns: Sequence[str],
                  time: Array) -> dict[str, tuple[Array, Array]]:
    """Return the series of the joints that a pattern matches, of all without one, in a span."""
    for pattern in patterns:
        if not matching(motion.joints, [pattern]):
            some = ', '.join(list(motion.joints)[:8])
            raise BagError(f'--joints {pattern!r} matches no joint, '
                           + (f'must be one of {some}' if some else 'the bag tells of none'))
    found = {}
    for name, (at, values) in motion.joints.items():
        if not patterns or matches(name, patterns):
            inside = (at >= time[0]) & (at <= time[-1])
            found[name] = (at[inside], values[inside])
    return found


def _slides(motion: Motion) -> frozenset[str]:
    """Return the joints whose position is a length, as far as the scene tells."""
    joints = motion.scene.spec.joints if motion.scene else None
    return frozenset(joint.name for joint in joints or () if joint.type == 'prismatic')


def choose_rows(motion: Motion, start: float, duration: float | None) -> slice:
    """Return the rows of the motion in a span of time; `start` counts from the first row."""
    begin = motion.time[0] + start
    end = np.inf if duration is None else begin + duration
    # Half a nanosecond of grace: a time that was typed need not be the sum of two others.
    first, last = np.searchsorted(motion.time, [begin - 5e-10, end + 5e-10])
    if first == last:
        raise BagError(f'--start {start:g} s: the bag holds nothing from there on, it is '
                       f'{motion.time[-1] - motion.time[0]:g} s long')
    return slice(int(first), int(last))


def _with_energies(shown: Shown, motion: Motion, rows: slice, bodies: npt.NDArray[np.intp],
                   missing: dict[str, str]) -> Shown:
    if motion.scene is None:
        missing.update(dict.fromkeys(OF_SCENE, 'the bag has no scene with masses'))
        return shown
    found = energies(motion, motion.scene, rows, bodies)
    if found.potential is None:
        missing['potential energy'] = 'forces join the chosen bodies with others'
    return shown._replace(energies=found)


def _with_contacts(bag: str, shown: Shown, motion: Motion, rows: slice,
                   bodies: npt.NDArray[np.intp], missing: dict[str, str]) -> Shown:
    """Add contacts: simulated again in a session of ours, else as far as they were published."""
    if motion.session is None or motion.scene is None:
        missing['gap'] = 'only sessions that rigid_sim_ros recorded can be simulated again for it'
        forces = {name: (time - 0.0, np.linalg.norm(wrench[:, :3], axis=1))
                  for name, (time, wrench) in motion.wrenches.items() if name in shown.names}
        if not forces:
            missing['contact_force'] = 'the bag has no topic BODY/contact_wrench'
        return shown._replace(forces=forces)
    if motion.scene.contact == 'none':
        missing.update(dict.fromkeys(OF_CONTACT, 'the scene has `contact: none`'))
        return shown
    contacts = simulate_contacts(bag, motion.origin or motion.scene, float(shown.time[-1]),
                                 motion.names)
    if contacts.note:
        motion.notes.append(contacts.note)
    inside = (contacts.time >= shown.time[0]) & (contacts.time <= shown.time[-1])
    time = contacts.time[inside]
    if not np.isfinite(contacts.gap[inside][:, bodies]).any():
        missing.update(dict.fromkeys(OF_CONTACT, 'nothing came near a chosen body'))
        return shown
    return shown._replace(
        forces={motion.names[k]: (time, contacts.force[inside, k]) for k in bodies},
        gaps={motion.names[k]: (time, contacts.gap[inside, k]) for k in bodies})


def _time_label(motion: Motion) -> str:
    if motion.starts_at_date:
        return 'time since the first message [s]'
    return 'simulated time, resets not counted back [s]' if motion.resets else (
        'simulation time [s]')
