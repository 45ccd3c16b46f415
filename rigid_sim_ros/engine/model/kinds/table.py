# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The table of the kinds of shapes, and the kernels that choose by the kind of a shape.

A new kind is a file that ends in a `KIND`, and a line here.
"""

import inspect
from typing import Any

from rigid_sim_ros.engine.model.kinds import (
    box, capsule, cone, cylinder, ellipsoid, hull, plane, sphere)
from rigid_sim_ros.engine.model.kinds.kind import Kind
from rigid_sim_ros.kernels.kernel import inlined, kernel

KINDS: tuple[Kind, ...] = (
    sphere.KIND, box.KIND, capsule.KIND, cylinder.KIND, hull.KIND, plane.KIND, cone.KIND,
    ellipsoid.KIND)
SPHERE, BOX, CAPSULE, CYLINDER, HULL, PLANE, CONE, ELLIPSOID = range(len(KINDS))
# As a scene file calls it; a heightfield is many hulls.
BY_TYPE = {**{kind.type: number for number, kind in enumerate(KINDS)}, 'heightfield': HULL}
UNIT_SURFACES = {name: unit for kind in KINDS for name, unit in kind.units.items()}


def _compiled(name: str, source: str, functions: dict[str, Any], decorator: Any) -> Any:
    """Return the function of this name that `source` defines, compiled, in this module."""
    names = {'__name__': __name__, **functions}
    exec(compile(source, __file__, 'exec'), names)
    return decorator(names[name])


def _is_any_of(numbers: list[int]) -> str:
    return ' or '.join(f'kind == {number}' for number in numbers)


def _which(flag: str) -> Any:
    """Return the kernel that says whether kinds of a number have a flag of `Kind`."""
    # A sum of comparisons, without a branch: it is asked in loops over all pairs.
    one_of = ' | '.join(f'(kind == {k})' for k, kind in enumerate(KINDS) if getattr(kind, flag))
    return _compiled(flag, f'def {flag}(kind):\n    return {one_of}\n', {}, inlined)


def _chosen(role: str) -> Any:
    """
    Return the kernel `role(kind, ...)` that calls the function of that name of a kind.

    A chain of comparisons, as one would write it by hand; the last function, which is that of all
    kinds that are left, needs none.
    """
    numbers: dict[Any, list[int]] = {}
    for k, kind in enumerate(KINDS):
        if getattr(kind, role) is not None:
            numbers.setdefault(getattr(kind, role), []).append(k)
    # What most kinds have in common comes last.
    ordered = sorted(numbers, key=lambda function: len(numbers[function]))
    first = ordered[0]
    given = ', '.join(inspect.signature(getattr(first, 'py_func', first)).parameters)
    lines = [f'def {role}(kind, {given}):']
    for k, function in enumerate(ordered[:-1]):
        lines += [f'    if {_is_any_of(numbers[function])}:', f'        return f{k}({given})']
    lines += [f'    return f{len(ordered) - 1}({given})', '']
    functions = {f'f{k}': function for k, function in enumerate(ordered)}
    return _compiled(role, '\n'.join(lines), functions, kernel)


is_ball, is_rounded = _which('is_ball'), _which('is_rounded')
is_unbounded, is_flat, is_faceted = _which('is_unbounded'), _which('is_flat'), _which('is_faceted')
is_curved, is_smooth, has_disc = _which('is_curved'), _which('is_smooth'), _which('has_disc')

reach_along, extreme, from_point = (_chosen('reach_along'), _chosen('extreme'),
                                    _chosen('from_point'))
height, way_out = _chosen('height'), _chosen('way_out')
face_count, face, face_along = _chosen('face_count'), _chosen('face'), _chosen('face_along')
outline, on_plane = _chosen('outline'), _chosen('on_plane')
