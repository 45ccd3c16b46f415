# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The forces of a scene as rows of the engine's table."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np

from rigid_sim_ros.engine.dynamics.forces import FORCES, WIDTH
from rigid_sim_ros.engine.model.model import ForceTable, WORLD
from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.errors import below, Report, shown
from rigid_sim_ros.words import matches, matching, nearest

_Ends = tuple[int, int]


def force_table(scene: schema.Scene, frame_names: Mapping[str, int], bodies: Sequence[int],
                report: Report) -> ForceTable:
    """
    Return the forces of a scene, a row for each pair of ends.

    `bodies` gives the body of each frame. What names a frame or a body that does not exist, or
    acts on nothing that moves, is reported and left out.
    """
    kinds = list(FORCES)
    rows = [(kinds.index(force.type), a, b, _parameters(force))
            for i, force in enumerate(scene.forces)
            for a, b in _ends(force, scene, frame_names, bodies, below(('forces', i), report))]
    kind, frame_a, frame_b, parameters = zip(*rows, strict=True) if rows else ((), (), (), ())
    return ForceTable(np.array(kind, dtype=np.int64), np.array(frame_a, dtype=np.int64),
                      np.array(frame_b, dtype=np.int64),
                      np.array(parameters, dtype=np.float64).reshape(-1, WIDTH))


def _parameters(force: schema.Force) -> list[float]:
    row: list[float] = []
    for parameter in FORCES[force.type].parameters:
        row.extend(np.atleast_1d(getattr(force, parameter.name)))
    return row + [0.0] * (WIDTH - len(row))


def _ends(force: schema.Force, scene: schema.Scene, frame_names: Mapping[str, int],
          bodies: Sequence[int], report: Report) -> Iterable[_Ends]:
    if isinstance(force, schema.FrameForce):
        return _frame_ends(force, scene, frame_names, bodies, report)
    assert isinstance(force, schema.BodyForce)
    pairs = FORCES[force.type].ends == 'pairs'
    chosen = _chosen(force, scene, 2 if pairs else 1, report)
    return combinations(chosen, 2) if pairs else [(body, WORLD) for body in chosen]


def _frame_ends(force: schema.FrameForce, scene: schema.Scene, frame_names: Mapping[str, int],
                bodies: Sequence[int], report: Report) -> Iterable[_Ends]:
    ends = []
    for key, name in (('a', force.a), ('b', force.b)):
        if name != 'world' and name not in frame_names:
            report((key,), f'{shown(name)} is no frame, {nearest(name, [*frame_names, "world"])}')
            return []
        ends.append(frame_names.get(name, WORLD))
    a, b = (WORLD if end == WORLD else bodies[end] for end in ends)
    if a == b:
        report(('b',), f'{shown(force.b)} is on the same body as a: {shown(force.a)}, '
               'must be on another')
    elif all(end == WORLD or not scene.bodies[end].is_pushed for end in (a, b)):
        report(('a',), f'neither {shown(force.a)} nor {shown(force.b)} can be pushed, '
               'one of them must')
    return [(ends[0], ends[1])]


def _chosen(force: schema.BodyForce, scene: schema.Scene, least: int,
            report: Report) -> list[int]:
    """Return the bodies that can move and whose names match, in the order of the scene."""
    names = [body.name for body in scene.bodies]
    chosen = {i for i, name in enumerate(names) if scene.bodies[i].is_pushed
              and matches(name, force.bodies)}
    strangers = [(i, pattern) for i, pattern in enumerate(force.bodies)
                 if not matching(names, [pattern])]
    for i, pattern in strangers:
        report(('bodies', i), f'{shown(pattern)} matches no body, {nearest(pattern, names)}')
    # Not for '*': a force on all is right for a scene that has few bodies or none that moves.
    if len(chosen) < least and not strangers and force.bodies != ('*',):
        report(('bodies',), f'{shown(list(force.bodies))} chooses {len(chosen)} bodies that move, '
               f'must be {least} or more')
    return sorted(chosen)
