# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a body may be told: numbers so large that they end the simulation are refused before.

A position, a velocity or an angular velocity that is set lies within the bounds of the scene. A
wrench or a drive changes the velocities within a step, and an impulse at once, by no more than
these. What forces make of these in time may be more; a snapshot is refused only where it is far
more.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.frames import point_on_frame, vector_on_frame
from rigid_sim_ros.engine.state.state import MOVING_FIELDS, State
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.scene.reach import QUANTITIES, reached
from rigid_sim_ros.scene.schema import Bounds, FAR


class _Quantity(NamedTuple):
    """What is compared with a bound of the scene."""

    text: str
    unit: str
    bound: str      # its key in `world: {bounds: {}}`


_POSITION, _LINEAR, _ANGULAR = _QUANTITIES = tuple(
    _Quantity(text, unit, bound) for bound, (text, unit) in QUANTITIES.items())


def check_position(bounds: Bounds, body: str, p_WB: Array) -> None:
    """Raise ValueError for a position [m] with a coordinate beyond the bound."""
    _check(bounds, body, 'is put to', _POSITION, p_WB)


def check_twist(bounds: Bounds, body: str, v_WB: Array, w_WB: Array) -> None:
    """Raise ValueError for a velocity [m/s] or an angular one [rad/s] beyond the bound."""
    _check(bounds, body, 'is given', _LINEAR, v_WB)
    _check(bounds, body, 'is given', _ANGULAR, w_WB)


def check_change(bounds: Bounds, body: str, linear: Array, angular: Array) -> None:
    """Raise ValueError for a change of the velocities [m/s], [rad/s] that is beyond the bound."""
    _check(bounds, body, 'would change by', _LINEAR, linear)
    _check(bounds, body, 'would change by', _ANGULAR, angular)


def check_joint(bounds: Bounds, joint: str, is_slide: bool, position: float,
                velocity: float) -> None:
    """Raise ValueError for a position [rad or m] or a velocity [rad/s or m/s] beyond the bound."""
    for what, value, quantity in (('position', position, _POSITION),
                                  ('velocity', velocity, _LINEAR if is_slide else _ANGULAR)):
        bound: float = getattr(bounds, quantity.bound)
        if not abs(value) <= bound:
            raise ValueError(
                f"joint '{joint}' is given the {what} {value:g}, must be within {bound:g}, which "
                f'`world: {{bounds: {{{quantity.bound}: ...}}}}` of the scene changes')


def check_joint_change(bounds: Bounds, joint: str, is_slide: bool, change: float) -> None:
    """Raise ValueError for a change of a joint's velocity [rad/s or m/s] beyond the bound."""
    quantity = _LINEAR if is_slide else _ANGULAR
    bound: float = getattr(bounds, quantity.bound)
    if not change <= bound:
        raise ValueError(
            f"joint '{joint}' would change its velocity by {change:g} {quantity.unit} in a step, "
            f'must be within {bound:g} {quantity.unit}, which `world: {{bounds: '
            f'{{{quantity.bound}: ...}}}}` of the scene changes; `limits: {{effort: ...}}` of the '
            'joint bounds what its drive exerts')


def _check(bounds: Bounds, body: str, verb: str, quantity: _Quantity, vector: Array) -> None:
    bound: float = getattr(bounds, quantity.bound)
    # Not `> bound`: what has grown to NaN on the way here is not within the bound either.
    if not (abs(vector) <= bound).all():
        raise ValueError(
            f"body '{body}' {verb} the {quantity.text} {vector.tolist()} {quantity.unit}, must be "
            f'within {bound:g} {quantity.unit}, which '
            f'`world: {{bounds: {{{quantity.bound}: ...}}}}` of the scene changes')


def changes_of_twist(model: Model, state: State, body: int, frame: int, p_F: Array | None,
                     J_F: Array, K_F: Array) -> tuple[Array, Array]:
    """
    Return the changes of v [m/s] and w [rad/s] by an impulse J [N s] and an angular one K [N m s].

    Both in the axes of a frame, J at the point p_F [m] of it, None: at the centre of mass. The
    latter change is with the largest of the body's inverse moments of inertia.
    """
    J = np.array(vector_on_frame(model, state, frame, tuple(J_F)))
    K = np.array(vector_on_frame(model, state, frame, tuple(K_F)))
    with np.errstate(over='ignore', invalid='ignore'):      # which is beyond all bounds too
        if p_F is not None:
            p, _ = point_on_frame(model, state, frame, tuple(p_F))
            K += np.cross(np.array(p) - state.x[:, body], J)
        return J * model.inv_m[body], K * model.inv_I_C[:, body].max()


def check_reach(bounds: Bounds, model: Model, like: State,
                arrays: Mapping[str, np.ndarray]) -> None:
    """Raise ValueError for motion or wrenches in a snapshot that are far beyond the bounds."""
    state = like._replace(**{name: arrays[name] for name in MOVING_FIELDS})
    with np.errstate(over='ignore', invalid='ignore'):
        found = reached(model, state._replace(V=np.zeros_like(state.V)))
        reaches = [(quantity, found[quantity.bound]) for quantity in _QUANTITIES]
        for r in range(len(arrays['body'])):
            p_F = arrays['point'][r] if arrays['at_point'][r] == 1 else None
            v, w = changes_of_twist(
                model, state, int(arrays['body'][r]), int(arrays['frame'][r]), p_F,
                model.h * arrays['force'][r], model.h * arrays['torque'][r])
            reaches += [(_LINEAR, v), (_ANGULAR, w)]
        if 'V' in arrays:
            reaches += [(_LINEAR, arrays['V'][:3]), (_ANGULAR, arrays['V'][3:])]
        for quantity, values in reaches:
            bound = FAR * getattr(bounds, quantity.bound)
            if not (abs(values) <= bound).all():
                raise ValueError(
                    f'the snapshot holds or makes a {quantity.text} of {abs(values).max():g} '
                    f'{quantity.unit}, must be within {bound:g}: it was changed; run the scene '
                    'from its start')
