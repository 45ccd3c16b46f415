# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The forces that a scene can name.

Each is a function (model, state, frame_a, frame_b, parameters, loads) that adds what it exerts
to the loads and returns its potential energy [J], 0 for what has none. A new force is one
function and one line in FORCES: the scene reads its keys, units and bounds from there.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from rigid_sim_ros.engine.dynamics.force_and_torque import add_force, add_torque, Loads
from rigid_sim_ros.engine.dynamics.force_rates import (
    at_points, between_axes, between_centres, ForceRow, in_air, Rates)
from rigid_sim_ros.engine.maths.rotation import conjugate, logarithm, multiply
from rigid_sim_ros.engine.maths.vector import (
    add_scaled, add_to_column, column, dot, norm, scale, subtract)
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.frames import frame_pose, frame_spin, point_on_frame
from rigid_sim_ros.engine.state.state import body_spin, body_velocity, State
from rigid_sim_ros.kernels.arrays import Array
from rigid_sim_ros.kernels.kernel import kernel

# Room for the parameters of one force: a point, a direction or quaternion, and some scalars.
WIDTH = 12


class Parameter(NamedTuple):
    """One key of a force in a scene; it fills `size` columns of the row, in the table's order."""

    name: str
    size: int  # 1 scalar, 3 vector, 4 quaternion x, y, z, w
    unit: str
    default: tuple[float, ...] | None  # None: the key must be given
    minimum: float | None  # of each component; None: any finite number
    meaning: str


class ForceKind(NamedTuple):
    """How a force is written in a scene and computed."""

    add: Callable[..., float]
    # 'each': a row for each of `bodies`; 'pairs': for each pair of them; 'ab': keys a and b
    ends: str
    rates: Callable[[ForceRow], Rates]
    parameters: tuple[Parameter, ...]


@kernel
def wind(model: Model, state: State, a: int, b: int, p: Array, loads: Loads) -> float:
    """
    Drag in a steady wind at the centre of mass, and damping of the rotation.

    F = -(c_1 + c_2 |u|) u with u = v - v_wind, tau = -(k_1 + k_2 |w|) w.
    """
    body = model.frame_body[a]
    u = subtract(body_velocity(model, state, body), (p[0], p[1], p[2]))
    w = body_spin(model, state, body)
    add_to_column(loads.F, body, scale(-(p[3] + p[4] * norm(u)), u))
    add_to_column(loads.tau, body, scale(-(p[5] + p[6] * norm(w)), w))
    return 0.0


@kernel
def spring(model: Model, state: State, a: int, b: int, p: Array, loads: Loads) -> float:
    """
    Spring and damper along the line from the origin of a to the anchor, a point of b.

    With d the vector between them, e = d / |d| and the tension T = k (|d| - l_0) + c d/dt |d|:
    F = T e on a and -T e on b. A line of length 0 has no direction and exerts nothing.
    """
    p_a, v_a = point_on_frame(model, state, a, (0.0, 0.0, 0.0))
    p_b, v_b = point_on_frame(model, state, b, (p[0], p[1], p[2]))
    d = subtract(p_b, p_a)
    length = norm(d)
    stretch = length - p[5]
    if length > 0.0:
        e = scale(1.0 / length, d)
        tension = p[3] * stretch + p[4] * dot(e, subtract(v_b, v_a))
        add_force(model, state, loads, a, p_a, scale(tension, e))
        add_force(model, state, loads, b, p_b, scale(-tension, e))
    return 0.5 * p[3] * stretch * stretch


@kernel
def avoidance(model: Model, state: State, a: int, b: int, p: Array, loads: Loads) -> float:
    """
    Repulsion of two bodies that grows linearly inside a range.

    F = k (range - d) along the line between the centres of mass while their distance d is
    smaller than the range, else nothing. Two centres in one place are not pushed.
    """
    x_a = column(state.x, model.frame_body[a])
    x_b = column(state.x, model.frame_body[b])
    d = subtract(x_b, x_a)
    distance = norm(d)
    inside = p[0] - distance
    if inside <= 0.0:
        return 0.0
    if distance > 0.0:
        push = scale(p[1] * inside / distance, d)
        add_to_column(loads.F, model.frame_body[a], scale(-1.0, push))
        add_to_column(loads.F, model.frame_body[b], push)
    return 0.5 * p[1] * inside * inside


@kernel
def hold_point(model: Model, state: State, a: int, b: int, p: Array, loads: Loads) -> float:
    """
    Soft constraint: the origin of a stays at the anchor, a point of b; F = k d + c d/dt d.

    Unlike a spring it resists in every direction. Between two bodies it changes neither P nor L of
    the pair: the spring acts along d, and both forces of the damper act at the origin of a.
    """
    p_a, v_a = point_on_frame(model, state, a, (0.0, 0.0, 0.0))
    p_b, v_b = point_on_frame(model, state, b, (p[0], p[1], p[2]))
    d = subtract(p_b, p_a)
    damping = scale(p[4], subtract(v_b, v_a))
    add_force(model, state, loads, a, p_a, scale(p[3], d))
    add_force(model, state, loads, b, p_b, scale(-p[3], d))
    add_force(model, state, loads, a, p_a, damping)
    add_force(model, state, loads, b, p_a, scale(-1.0, damping))
    return 0.5 * p[3] * dot(d, d)


@kernel
def hold_orientation(model: Model, state: State, a: int, b: int, p: Array,
                     loads: Loads) -> float:
    """
    Soft constraint: the axes of a keep an orientation in b; tau = -k r - c (w_a - w_b).

    r [rad] is the rotation vector from the wanted to the present orientation, the shorter way.
    """
    _, q_Wa = frame_pose(model, state, a)
    _, q_Wb = frame_pose(model, state, b)
    wanted = multiply(q_Wb, (p[0], p[1], p[2], p[3]))
    r = logarithm(multiply(q_Wa, conjugate(wanted)))
    w = subtract(frame_spin(model, state, a), frame_spin(model, state, b))
    torque = add_scaled(scale(-p[4], r), -p[5], w)
    add_torque(model, loads, a, torque)
    add_torque(model, loads, b, scale(-1.0, torque))
    return 0.5 * p[4] * dot(r, r)


_ANCHOR = Parameter('anchor', 3, 'm', (0.0, 0.0, 0.0), None, 'point in the axes of b')

FORCES: dict[str, ForceKind] = {
    'wind': ForceKind(wind, 'each', in_air, (
        Parameter('velocity', 3, 'm/s', (0.0, 0.0, 0.0), None, 'of the air, world axes'),
        Parameter('drag', 1, 'N s/m', (0.0,), 0.0, 'linear, at the centre of mass'),
        Parameter('quadratic_drag', 1, 'N s^2/m^2', (0.0,), 0.0, 'grows with the square'),
        Parameter('angular_drag', 1, 'N m s', (0.0,), 0.0, 'linear damping of the rotation'),
        Parameter('quadratic_angular_drag', 1, 'N m s^2', (0.0,), 0.0, 'grows with the square'))),
    'spring': ForceKind(spring, 'ab', at_points, (
        _ANCHOR,
        Parameter('stiffness', 1, 'N/m', None, 0.0, 'force per stretch'),
        Parameter('damping', 1, 'N s/m', (0.0,), 0.0, 'force per rate of stretch'),
        Parameter('rest_length', 1, 'm', (0.0,), 0.0, 'length without a force'))),
    'avoidance': ForceKind(avoidance, 'pairs', between_centres, (
        Parameter('range', 1, 'm', None, 0.0, 'distance of the centres where it begins'),
        Parameter('stiffness', 1, 'N/m', None, 0.0, 'force per depth inside the range'))),
    'hold_point': ForceKind(hold_point, 'ab', at_points, (
        _ANCHOR,
        Parameter('stiffness', 1, 'N/m', None, 0.0, 'force per distance'),
        Parameter('damping', 1, 'N s/m', (0.0,), 0.0, 'force per relative velocity'))),
    'hold_orientation': ForceKind(hold_orientation, 'ab', between_axes, (
        Parameter('orientation', 4, '1', (0.0, 0.0, 0.0, 1.0), None, 'of a in the axes of b'),
        Parameter('stiffness', 1, 'N m/rad', None, 0.0, 'torque per angle'),
        Parameter('damping', 1, 'N m s/rad', (0.0,), 0.0, 'torque per relative spin'))),
}


def force_row(model: Model, state: State, r: int) -> tuple[str, ForceRow]:
    """Return the kind and the contents of a row of the force table."""
    table, values, start = model.forces, {}, 0
    kind = list(FORCES)[table.kind[r]]
    for parameter in FORCES[kind].parameters:
        values[parameter.name] = table.parameters[r, start:start + parameter.size]
        start += parameter.size
    return kind, ForceRow(model, state, int(table.frame_a[r]), int(table.frame_b[r]), values)


@kernel
def _nothing(kind: int, model: Model, state: State, a: int, b: int, p: Array,
             loads: Loads) -> float:
    return 0.0


def _dispatch(index: int, functions: list[Callable[..., float]]) -> Callable[..., float]:
    """Return a kernel that calls the force whose index in the table is `kind`."""
    if index == len(functions):
        return _nothing
    head, tail = functions[index], _dispatch(index + 1, functions)

    @kernel
    def add_row(kind: int, model: Model, state: State, a: int, b: int, p: Array,
                loads: Loads) -> float:
        if kind == index:
            return head(model, state, a, b, p, loads)
        return tail(kind, model, state, a, b, p, loads)

    return add_row


_add_row: Any = _dispatch(0, [force.add for force in FORCES.values()])


@kernel
def add_scene_forces(model: Model, state: State, loads: Loads) -> float:
    """Add every row of the model's force table to the loads; return the potential energy [J]."""
    energy = 0.0
    table = model.forces
    for r in range(table.kind.shape[0]):
        energy += _add_row(table.kind[r], model, state, table.frame_a[r], table.frame_b[r],
                           table.parameters[r], loads)
    return energy


@kernel
def add_gravity(model: Model, state: State, loads: Loads) -> float:
    """Add M g to each body; return the potential energy -sum M g . x [J]."""
    energy = 0.0
    for k in range(3):
        for i in range(model.m.shape[0]):
            weight = model.m[i] * model.gravity[k]
            loads.F[k, i] += weight
            energy -= weight * state.x[k, i]
    return energy
