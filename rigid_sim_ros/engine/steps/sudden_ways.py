# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Bodies that joints let go farther on a way than their velocities at its start said.

Detection looks as far as bodies go by these. A drive of a high gain, dry friction or a limit may
give a body any other velocity within the way, and so it might pass what is thinner than that. The
way is then tried again by what is known of it now.
"""

from rigid_sim_ros.engine.constraints.articulated_points import MORE
from rigid_sim_ros.engine.detection.broad_phase import may_collide
from rigid_sim_ros.engine.detection.margins import fastest_point, standard_of_rest
from rigid_sim_ros.engine.maths.rotation import quaternion
from rigid_sim_ros.engine.maths.union_find import first_of
from rigid_sim_ros.engine.maths.vector import add_scaled, column, norm, scale, subtract
from rigid_sim_ros.engine.model.kinds.table import is_unbounded
from rigid_sim_ros.engine.state.rates import spin_of
from rigid_sim_ros.engine.steps.jointed_contact import CALLED, JointedContact
from rigid_sim_ros.kernels.kernel import kernel


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
        if gained[i] > c.buffers.sudden[i] and h * gained[i] > 0.5 * c.thinnest:
            for s in range(a, after):
                if not is_unbounded(shapes.kind[s]) and _may_have_passed_any(c, s, h):
                    c.buffers.sudden[i], found = MORE * gained[i], True
                    break
        a = after
    return found


@kernel
def outruns_detection(c: JointedContact, h: float) -> bool:
    """Return whether bodies that have collided go farther in h [s] than detection looked."""
    model, state, shapes = c.joints.model, c.joints.state, c.shapes
    rest, a = standard_of_rest(model, state, shapes.body), 0
    while a < shapes.body.shape[0]:
        i = shapes.body[a]
        if model.inv_m[i] > 0.0 and h * fastest_point(
                model, state, rest, c.radius, shapes, i) > c.memory.margin[a]:
            return True
        a = shapes.after[a]
    return False


@kernel
def reaches_others(c: JointedContact, h: float) -> bool:
    """
    Return whether what another solver moves may be met on a way of h [s], taken now; call that.

    Only what goes farther than its speed at the start of the step said can meet it: a drive, or
    what it hits, that starts from rest.
    """
    return _call_others(c, h, False)


@kernel
def bounces_at_others(c: JointedContact) -> bool:
    """
    Return whether what has just collided may meet what another solver moves; call that.

    It goes otherwise for the rest of the step than was known as bodies were given to solvers.
    """
    return _call_others(c, c.now.left[0], True)


@kernel
def _call_others(c: JointedContact, h: float, collided: bool) -> bool:
    """
    Call what another solver moves and bodies may meet in h [s]; return whether there is any.

    These bodies are those that have just collided, or all that go farther than they were looked
    for.
    """
    model, state, shapes, found = c.joints.model, c.joints.state, c.shapes, False
    if not _has_others(c):
        return False
    rest, a = standard_of_rest(model, state, shapes.body), 0
    while a < shapes.body.shape[0]:
        i, after = shapes.body[a], shapes.after[a]
        if model.inv_m[i] > 0.0 and (
                not collided or c.buffers.label[first_of(c.buffers.parent, i)] >= 0):
            way = h * fastest_point(model, state, rest, c.radius, shapes, i)
            if collided or way > c.looked[a]:
                for s in range(a, after):
                    found = _call_what_is_near(c, s, way) or found
        a = after
    return found


@kernel
def _has_others(c: JointedContact) -> bool:
    """Return whether another solver moves any bodies."""
    for k in range(c.elsewhere.shape[0]):
        if c.elsewhere[k] > 0:
            return True
    return False


@kernel
def _call_what_is_near(c: JointedContact, a: int, way: float) -> bool:
    """Call what shape a may have met that went so far [m]; return whether there is anything."""
    shapes, found = c.shapes, False
    for b in range(shapes.body.shape[0]):
        k = shapes.body[b]
        if c.elsewhere[k] > 0 and not is_unbounded(shapes.kind[a]) and _apart(c, a, b) <= (
                shapes.bound[a] + shapes.bound[b] + way + c.looked[b]) and may_collide(
                    shapes, c.elsewhere.shape[0], a, b):
            c.elsewhere[k], found = CALLED, True
    return found


@kernel
def _apart(c: JointedContact, a: int, b: int) -> float:
    """Return how far [m] shapes were from each other as what touches was found."""
    pose = c.memory.pose
    return norm((pose[a, 0] - pose[b, 0], pose[a, 1] - pose[b, 1], pose[a, 2] - pose[b, 2]))


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
def _may_have_passed_any(c: JointedContact, a: int, h: float) -> bool:
    """Return whether shape a may have gone through any other by what its body gained."""
    shapes, memory, gained = c.shapes, c.memory, c.buffers.gained
    i = shapes.body[a]
    for b in range(shapes.body.shape[0]):
        k = shapes.body[b]
        if h * gained[i] <= 0.5 * min(c.thickness[a], c.thickness[b]) or c.elsewhere[k] == 1:
            continue
        near = _apart(c, a, b) <= (shapes.bound[a] + shapes.bound[b] + memory.margin[a]
                                   + memory.margin[b] + h * (gained[i] + gained[k]))
        if near and not is_unbounded(shapes.kind[b]) and may_collide(
                shapes, gained.shape[0], a, b):
            return True
    return False
