# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a body weighs: where its mass may be written, and the mass properties that follow.

Each part of a body gets its mass from one place: its own `mass` or `density`, its particles, the
`density` of the body, or its share by volume of the `mass` of the body. An `inertial` replaces all
of that.
"""

from collections.abc import Iterator

import numpy as np

from rigid_sim_ros.engine.maths.rotation_in_python import to_matrix
from rigid_sim_ros.engine.model import inertia
from rigid_sim_ros.engine.model.inertia import MassProperties
from rigid_sim_ros.engine.model.kinds.table import BY_TYPE, KINDS
from rigid_sim_ros.scene import schema
from rigid_sim_ros.scene.errors import dotted, Path
from rigid_sim_ros.words import either

_MEND = 'must have mass, density or inertial'
_STANDS = 'the body must be fixed: true or kinematic: true'

_AT_THE_ORIGIN = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)     # of nearly all parts that stand alone


def mistakes(body: schema.Body) -> Iterator[tuple[Path, str]]:
    """Yield each mistake in where the mass of a body is written: its place below it, and why."""
    given = [key for key in ('mass', 'density', 'inertial') if getattr(body, key) is not None]
    parts = body.parts()
    massless = [path for path, part in parts if _has_none(part)]
    for path, part in parts if body.is_pushed else ():
        if isinstance(part, schema.Plane):
            yield (*path, 'type'), f"'plane' has no end and no mass, {_STANDS}"
        elif isinstance(part, schema.Mesh) and not part.convex:
            yield (*path, 'convex'), f'False, a surface has no mass, {_STANDS}, or convex: true'
        elif schema.is_surface(part):
            yield (*path, 'type'), f"'{part.type}' is a surface without a mass, {_STANDS}"
    for key in given[1:]:
        yield (key,), f'stands beside {given[0]}, must be one of mass, density or inertial'
    for path, part in parts:
        if part.mass is not None and part.density is not None:
            yield (*path, 'density'), 'stands beside mass, must be one of them'
    if massless or len(given) > 1:
        return
    own = [path for path, part in parts if _has_own(part)]
    without = [path for path, part in parts if not _has_own(part)]
    if given and own and (given != ['density'] or not without):
        places = either([dotted(path) for path in own])
        yield (given[0],), f'stands beside the masses in {places}, must be one or the other'
    elif given and not parts and given != ['inertial']:
        yield (given[0],), 'needs a shape to distribute it, must have one, or inertial instead'
    elif not given and not parts and body.is_pushed:
        yield (), f'has neither shape nor mass, {_MEND}, or be fixed: true'
    elif not given and without and (own or body.is_pushed):
        for path in without if own else [()]:
            yield path, f'has no mass, {_MEND if not own else "must have mass or density"}'


def properties(body: schema.Body) -> MassProperties | None:
    """
    Return the mass properties of a body without `mistakes`; None for one without a mass.

    Raises ArithmeticError or ValueError when sizes are so extreme that the numbers leave the range
    of floats.
    """
    if body.inertial is not None:
        return inertia.inertial(body.inertial.mass, body.inertial.com, body.inertial.inertia)
    parts = [part for _, part in body.parts()]
    if any(map(_has_none, parts)):
        return None
    if body.mass is None and body.density is None and not any(map(_has_own, parts)):
        return None
    volume = sum(map(_volume, parts)) if body.mass is not None else 0.0
    placed = [_placed(part, body, volume) for part in parts]
    return placed[0] if len(placed) == 1 else inertia.combine(placed)


def _has_none(part: schema.Shape) -> bool:
    return isinstance(part, schema.Plane) or schema.is_surface(part)


def _has_own(part: schema.Shape) -> bool:
    return isinstance(part, schema.Points) or part.mass is not None or part.density is not None


def _volume(part: schema.Shape) -> float:
    volume = KINDS[BY_TYPE[part.type]].volume
    assert volume is not None, 'what has no volume is reported by mistakes()'
    return volume(part)


def _mass(part: schema.Shape, body: schema.Body, volume: float) -> float:
    """Return the mass [kg] of a solid part of a body of this volume [m^3]."""
    if part.mass is not None:
        return part.mass
    if body.mass is not None:
        return body.mass * (_volume(part) / volume)
    density = body.density if part.density is None else part.density
    assert density is not None, 'a part without a mass is reported by mistakes()'
    return density * _volume(part)


def _placed(part: schema.Shape, body: schema.Body, volume: float) -> MassProperties:
    """Return the mass properties of one part in the frame of the body."""
    if isinstance(part, schema.Points):
        own = inertia.points(np.array(part.positions), np.array(part.masses))
    else:
        solid = KINDS[BY_TYPE[part.type]].mass_properties
        assert solid is not None, 'what has no mass is left out by properties()'
        own = solid(_mass(part, body, volume), part)
    if (part.pose.position, part.pose.orientation) == _AT_THE_ORIGIN:
        return own
    R_BS = np.array(to_matrix(part.pose.orientation))
    return inertia.placed(own, np.array(part.pose.position), R_BS)
