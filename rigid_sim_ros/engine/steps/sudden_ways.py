# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Bodies that joints let go farther on a way than their velocities at its start said.

Detection looks as far as bodies go by these. A drive of a high gain, dry friction or a limit may
give a body any other velocity within the way, and so it might pass what is thinner than that. The
way is then tried again by what is known of it now.
"""

from rigid_sim_ros.engine.detection.broad_phase import may_collide
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.vector import add_scaled, column, norm, scale, subtract
from rigid_sim_ros.engine.model.kinds.table import is_unbounded
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.engine.steps.jointed_contact import JointedContact
from rigid_sim_ros.kernels.kernel import kernel

# Of what was noted: a body that is faster than that is noted again.
MORE = 1.1
# Of how fast a body was: detection looks so much farther that less in addition passes nothing.
SUDDEN = 0.5


@kernel
def forget_sudden(c: JointedContact) -> None:
    """Begin a way of which nothing is known but the velocities at its start."""
    c.buffers.sudden[:], c.buffers.gained[:] = 0.0, 0.0


@kernel
def goes_suddenly(c: JointedContact, h: float) -> bool:
    """
    Return whether bodies may have passed something on a way of h [s], of which detection knew not.

    The first half of it has been taken; what they gained in it is noted.
    """
    shapes, gained, found = c.shapes, c.buffers.gained, False
    for i in range(gained.shape[0]):
        gained[i] = _gained(c, i, h)
    a = 0
    while a < shapes.body.shape[0]:
        i, after = shapes.body[a], shapes.after[a]
        if gained[i] > max(c.buffers.sudden[i], SUDDEN * _speed(c, i)):
            for s in range(a, after):
                if not is_unbounded(shapes.kind[s]) and _may_have_passed_any(c, s, h):
                    c.buffers.sudden[i], found = MORE * gained[i], True
                    break
        a = after
    return found


@kernel
def _gained(c: JointedContact, i: int, h: float) -> float:
    """Return how much faster [m/s] points of body i go than its loads let them, at most."""
    model, before, now = c.joints.model, c.joints.start, c.joints.state
    if model.inv_m[i] == 0.0 or c.elsewhere[i] == 1:
        return 0.0
    loads, inv_I = c.joints.work.loads, column(model.inv_I_C, i)
    P = add_scaled(column(before.P, i), 0.5 * h, column(loads.F, i))
    L = add_scaled(column(before.L, i), 0.5 * h, column(loads.tau, i))
    v = scale(model.inv_m[i], subtract(column(now.P, i), P))
    w = subtract(spin_of(quaternion(now.q, i), column(now.L, i), inv_I),
                 spin_of(quaternion(before.q, i), L, inv_I))
    return norm(v) + c.radius[i] * norm(w)


@kernel
def _speed(c: JointedContact, i: int) -> float:
    """Return how fast [m/s] points of body i are at the start of a way, at most."""
    model, before = c.joints.model, c.joints.start
    w = spin_of(quaternion(before.q, i), column(before.L, i), column(model.inv_I_C, i))
    return model.inv_m[i] * norm(column(before.P, i)) + c.radius[i] * norm(w)


@kernel
def _may_have_passed_any(c: JointedContact, a: int, h: float) -> bool:
    """Return whether shape a may have gone through any other by what its body gained."""
    shapes, memory, gained = c.shapes, c.memory, c.buffers.gained
    i = shapes.body[a]
    for b in range(shapes.body.shape[0]):
        k = shapes.body[b]
        if h * gained[i] <= 0.5 * min(c.thickness[a], c.thickness[b]) or c.elsewhere[k] == 1:
            continue
        apart = norm((memory.pose[a, 0] - memory.pose[b, 0], memory.pose[a, 1] - memory.pose[b, 1],
                      memory.pose[a, 2] - memory.pose[b, 2]))
        near = apart <= (shapes.bound[a] + shapes.bound[b] + memory.margin[a] + memory.margin[b]
                         + h * (gained[i] + gained[k]))
        if near and not is_unbounded(shapes.kind[b]) and may_collide(
                shapes, gained.shape[0], a, b):
            return True
    return False
