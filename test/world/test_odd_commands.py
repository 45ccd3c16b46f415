# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever a command says: it is done, or refused and nothing has changed, without a warning."""

import contextlib
import copy
from typing import Any
import warnings

from bag.test_forged import INPUTS, NEWCOMER, SCENE
import pytest

from rigid_sim_ros.world import World
from rigid_sim_ros.world.commands import Command

ODD: list[Any] = [
    None, True, -1, 0, 7, 2 ** 63 - 1, 2 ** 64, 10 ** 400, -10 ** 400, 1e308, -1e308, 5e-324,
    float('nan'), float('inf'), '', 'x', 'crate', 'ground', 'world', [], [[]], [1], [1, 2, 3],
    [1e308] * 3, [10 ** 400] * 3, [1e308] * 4, [0, 0, 0, 0], [None] * 3, ['a'] * 3, [[1, 2], 3],
    {}, {'name': 'crate'}]
MORE: list[tuple[str, dict[str, Any]]] = [
    ('apply_wrench', {'name': 'crate', 'force': [1.0, 2.0, 3.0], 'point': [0.1, 0.0, 0.0]}),
    ('set_joint_command', {'name': 'hinge', 'position': 0.1, 'velocity': 0.2, 'effort': 0.3,
                           'duration': 0.5}),
    ('apply_impulse', {'name': 'crate', 'impulse': [0.1, 0.2, 0.3], 'point': [0.0, 0.0, 0.1],
                       'frame': 'crate'}),
    ('follow_trajectory', {'names': ['hinge'], 'times': [0.1, 0.2], 'positions': [[0.1], [0.2]],
                           'velocities': [[0.1], [0.0]], 'accelerations': [[0.1], [0.0]]})]
COMMANDS = [*INPUTS, *MORE]


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return where something stands in the arguments of a command."""
    inner = value.items() if isinstance(value, dict) else (
        enumerate(value) if isinstance(value, list) else ())
    return [*([path] if path else []),
            *(place for key, each in inner for place in places(each, (*path, key)))]


def with_odd(arguments: dict[str, Any], path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    """Return arguments with something else in one place."""
    changed: Any = copy.deepcopy(arguments)
    inner = changed
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return dict(changed)


def moving(kind: str) -> World:
    """Return a world that is on its way, with all that a command of this kind may end."""
    world = World.from_dict(SCENE)
    world.apply(Command(*COMMANDS[0]))      # as the first one, which it would take the place of
    world.step(5)
    if kind == 'remove':
        world.add(NEWCOMER)
    return world


@pytest.mark.parametrize('number', range(len(COMMANDS)), ids=[
    f'{kind}-{k}' for k, (kind, _) in enumerate(COMMANDS)])
def test_any_command_is_done_or_refused(number) -> None:
    kind, arguments = COMMANDS[number]
    world = moving(kind)
    begin = world.save()
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        for path in places(arguments):
            for odd in ODD:
                try:
                    world.apply(Command(kind, with_odd(arguments, path, odd)))
                except (ValueError, TypeError):
                    assert world.save() == begin    # so the next one finds the same world
                    continue
                world.restore(world.save())     # what it holds now can be saved
                with contextlib.suppress(ArithmeticError):  # of motion beyond all numbers
                    world.step(2)
                world.restore(begin)
