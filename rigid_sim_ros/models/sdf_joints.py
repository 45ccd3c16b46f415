# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What acts along the axes of an SDF joint: limits, dampers, springs, and what it mimics."""

from collections.abc import Callable
import math

from rigid_sim_ros.models.description import Joint, Mimic
from rigid_sim_ros.models.findings import Findings
from rigid_sim_ros.models.values import check_children, number
from rigid_sim_ros.models.xml_tree import Element

JOINT_TYPES = {'revolute': 'revolute', 'continuous': 'continuous', 'prismatic': 'prismatic',
               'fixed': 'fixed', 'ball': 'spherical', 'universal': 'universal'}
# From here on a bound means that there is none.
_NO_BOUND = 1e16
# cos of the angle between the axes of a universal joint.
_SQUARE = 1e-6

_AXIS = ('xyz', 'limit', 'dynamics', 'mimic', 'use_parent_model_frame')
_LIMIT = ('lower', 'upper', 'effort', 'velocity')
_DYNAMICS = ('damping', 'friction', 'spring_reference', 'spring_stiffness')

Vector = tuple[float, float, float]


def read_laws(joint: Joint, element: Element, prefix: str,
              axis_of: Callable[[Element], Vector | None], findings: Findings) -> None:
    """Write the axes and the laws of a joint; `axis_of` gives a direction in the joint frame."""
    axes = [axis for tag in ('axis', 'axis2') if (axis := element.find(tag)) is not None]
    needed = {'fixed': 0, 'spherical': 0, 'universal': 2}.get(joint.kind, 1)
    if len(axes) < needed:
        findings.error(element, f'has {len(axes)} axes, a {element.attributes.get("type")} joint '
                       f'must have {needed}')
        return
    for axis in axes:
        check_children(axis, _AXIS, ('initial_position',), findings, is_physics=True)
    if joint.kind == 'spherical' and axes:
        _of_all_axes(joint, axes[:1], findings)     # Gazebo takes the first for all of them
    for axis in axes[1 if joint.kind == 'spherical' else needed:]:
        findings.ignore(axis, f'<{axis.tag}>', f'a {joint.kind} joint has none')
    if needed == 0:
        return
    joint.axis = axis_of(axes[0]) or joint.axis
    if joint.kind == 'universal':
        joint.axis2 = axis_of(axes[1])
        if joint.axis2 is not None and abs(_cosine(joint.axis, joint.axis2)) > _SQUARE:
            findings.error(axes[1], 'is not at right angles to the first axis, must be')
        _of_all_axes(joint, axes, findings)
        return
    _limits(joint, axes[0], findings)
    _dynamics(joint, axes[0], findings)
    mimic = axes[0].find('mimic')
    if mimic is not None:
        check_children(mimic, ('multiplier', 'offset', 'reference'), (), findings, is_physics=True)
        multiplier = _value(mimic, 'multiplier', 1.0, findings)
        # follower = multiplier * (leader - reference) + offset
        offset = (_value(mimic, 'offset', 0.0, findings)
                  - multiplier * _value(mimic, 'reference', 0.0, findings))
        joint.mimic = Mimic(f'{prefix}{mimic.attributes.get("joint", "")}', multiplier, offset)


def _of_all_axes(joint: Joint, axes: list[Element], findings: Findings) -> None:
    """Write the damping of a joint with several axes, which must be one for all."""
    found = set()
    for axis in axes[:2]:
        one = Joint('', 'revolute', '', '', joint.pose, axis)
        _limits(one, axis, findings)
        _dynamics(one, axis, findings)
        found.add(one.damping)
        if (one.lower, one.upper) != (None, None) or one.friction or one.stiffness:
            findings.error(axis, f'has limits, friction or a spring, which a {joint.kind} joint '
                           'has not here: make revolute joints of it')
    if len(found) > 1:
        findings.error(axes[1], 'has another damping than the first axis, must have the same')
    joint.damping = max(found)


def _limits(joint: Joint, axis: Element, findings: Findings) -> None:
    limit = axis.find('limit')
    if limit is None:
        return
    check_children(limit, _LIMIT, ('stiffness', 'dissipation'), findings, is_physics=True)
    lower = _value(limit, 'lower', -_NO_BOUND, findings)
    upper = _value(limit, 'upper', _NO_BOUND, findings)
    if lower > upper:
        findings.error(limit, f'lower {lower:g} is above upper {upper:g}, must be below it: swap '
                       'them')
    if joint.kind != 'continuous':
        joint.lower = lower if lower > -_NO_BOUND else None
        joint.upper = upper if upper < _NO_BOUND else None
    # Below 0 SDF means that there is none.
    effort = _value(limit, 'effort', -1.0, findings)
    velocity = _value(limit, 'velocity', -1.0, findings)
    joint.effort = effort if 0.0 <= effort < _NO_BOUND else None
    joint.velocity = velocity if 0.0 <= velocity < _NO_BOUND else None


def _dynamics(joint: Joint, axis: Element, findings: Findings) -> None:
    dynamics = axis.find('dynamics')
    if dynamics is None:
        return
    check_children(dynamics, _DYNAMICS, (), findings, is_physics=True)
    joint.damping = _value(dynamics, 'damping', 0.0, findings, least=0.0)
    joint.friction = _value(dynamics, 'friction', 0.0, findings, least=0.0)
    joint.stiffness = _value(dynamics, 'spring_stiffness', 0.0, findings, least=0.0)
    joint.rest = _value(dynamics, 'spring_reference', 0.0, findings)


def _value(element: Element, tag: str, default: float, findings: Findings, *,
           least: float = -math.inf) -> float:
    """Return the number of a child; infinite and huge ones are bounds that there are not."""
    child = element.find(tag)
    if child is None:
        return default
    text = child.text.strip()
    try:
        # SDFormat's own writer gives the largest double, 1.79769e+308, for no bound.
        if tag in _LIMIT and abs(float(text)) >= _NO_BOUND:
            return math.copysign(_NO_BOUND, float(text))
    except ValueError:
        pass    # what is no number is reported below
    return number(text, child, tag, findings, default, least=least)


def _cosine(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True)) / (math.hypot(*a) * math.hypot(*b))
