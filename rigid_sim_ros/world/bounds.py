# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a body may be told: numbers so large that they end the simulation are refused before.

A position, a velocity or an angular velocity that is set lies within the bounds of the scene. A
wrench or a drive changes the velocities within a step, and an impulse at once, by no more than
these.
"""

from typing import NamedTuple

from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.scene.schema import Bounds


class _Quantity(NamedTuple):
    """What is compared with a bound of the scene."""

    text: str
    unit: str
    bound: str      # its key in `world: {bounds: {}}`


_POSITION = _Quantity('position', 'm', 'position')
_LINEAR = _Quantity('linear velocity', 'm/s', 'linear')
_ANGULAR = _Quantity('angular velocity', 'rad/s', 'angular')


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
