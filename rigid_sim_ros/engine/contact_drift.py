# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How the geometry of contacts changes the relative velocities at them.

The second derivative of a gap, d'' = N . (p_a'' - p_b'') + 2 N' . (p_a' - p_b') (Meyer, Rigid Body
Dynamics, "Resting Contact"), has a part from accelerations and a part from velocities: the normal
turns, the points are carried around by the rotations, and on round bodies other points come to
touch. The second part is the rate of the contact velocity u at unchanged v and w. It is found here
as a difference quotient over the step, with the points that detection finds at its end. So it
holds for every pair of shapes: for a corner on a face it is the term above with N' = w x N and the
centripetal acceleration of the corner, for two balls |u_t|^2 / distance of the centres, and 0 for
a ball that rolls on a plane, where the acceleration of the material point would be wrong by w^2 r.
"""

from rigid_sim_ros.engine.algebra import cross, dot, norm, subtract
from rigid_sim_ros.engine.arrays import Array, IntArray, Vector
from rigid_sim_ros.engine.backtrack import place_ahead
from rigid_sim_ros.engine.contacts import Bodies, Contacts, relative, row, to_contact
from rigid_sim_ros.engine.kernel import kernel
from rigid_sim_ros.engine.loads import Loads
from rigid_sim_ros.engine.manifolds import Scratch
from rigid_sim_ros.engine.model import Model
from rigid_sim_ros.engine.narrow_phase.collide import collide
from rigid_sim_ros.engine.shapes import Shapes
from rigid_sim_ros.engine.state import State

# cos 25 deg: a normal that turns farther in one step has jumped to another feature, and says
# nothing.
SAME_NORMAL = 0.9
# Of the size of the smaller shape: a point that gets farther on both bodies in the time has jumped
# too, as the lowest point of a rim does from one side to the other when a disk falls flat. 2 would
# take the jump for a motion, and a force that stops it throws the disk up.
JUMP = 0.5


@kernel
def contact_drift(model: Model, state: State, still: Loads, shapes: Shapes, contacts: Contacts,
                  bodies: Bodies, chosen: IntArray, t: float, pose: Array, scratch: Scratch,
                  drift: Array) -> None:
    """
    Write the rate of u [m/s^2] from geometry alone, (3m,) triples (n, t1, t2).

    still: loads of 0; t [s]: the time over which the difference is taken. A point that is not
    found again gets 0, an error of first order in t which the next step sees as a velocity and
    takes back.
    """
    previous, count, n = -1, 0, (0.0, 0.0, 0.0)
    for c in range(chosen.shape[0]):
        k = chosen[c]
        a, b = contacts.shape_a[k], contacts.shape_b[k]
        if contacts.manifold[k] != previous:
            place_ahead(model, state, still, shapes, a, t, pose)
            place_ahead(model, state, still, shapes, b, t, pose)
            count, n = collide(pose, shapes, a, b,
                               shapes.bound[a] if shapes.bound[a] < shapes.bound[b]
                               else shapes.bound[b], scratch)
            previous = contacts.manifold[k]
        for i in range(3):
            drift[3 * c + i] = 0.0
        for p in range(count):
            if scratch.ids[p] != contacts.feature[k]:
                continue
            now = to_contact(contacts, k, relative(bodies.velocity, contacts, k))
            then, shift = _velocity(model, state, contacts, bodies, k, t, n, scratch.points, p)
            e = contacts.axes
            if (dot(n, (e[k, 0, 0], e[k, 0, 1], e[k, 0, 2])) > SAME_NORMAL
                    and shift < JUMP * min(shapes.bound[a], shapes.bound[b])):
                turned = to_contact(contacts, k, then)
                drift[3 * c] = (dot(n, then) - now[0]) / t
                drift[3 * c + 1] = (turned[1] - now[1]) / t
                drift[3 * c + 2] = (turned[2] - now[2]) / t
            break


@kernel
def _velocity(model: Model, state: State, contacts: Contacts, bodies: Bodies, k: int, t: float,
              n: Vector, points: Array, p: int) -> tuple[Vector, float]:
    """
    Return the velocity of B relative to A at point p after t [s] with the v and w of now.

    And how far [m] the point has moved from where it was, seen from the body on which it is less.
    """
    a, b = contacts.body_a[k], contacts.body_b[k]
    v = bodies.velocity
    half = 0.5 * points[p, 3]
    at = (points[p, 0] + half * n[0], points[p, 1] + half * n[1], points[p, 2] + half * n[2])
    r_A = (at[0] - state.x[0, a] - t * v[a, 0], at[1] - state.x[1, a] - t * v[a, 1],
           at[2] - state.x[2, a] - t * v[a, 2])
    r_B = (at[0] - state.x[0, b] - t * v[b, 0], at[1] - state.x[1, b] - t * v[b, 1],
           at[2] - state.x[2, b] - t * v[b, 2])
    at_A = cross((v[a, 3], v[a, 4], v[a, 5]), r_A)
    at_B = cross((v[b, 3], v[b, 4], v[b, 5]), r_B)
    on_A = norm(subtract(r_A, row(contacts.r_A, k)))
    on_B = norm(subtract(r_B, row(contacts.r_B, k)))
    return (v[b, 0] - v[a, 0] + at_B[0] - at_A[0], v[b, 1] - v[a, 1] + at_B[1] - at_A[1],
            v[b, 2] - v[a, 2] + at_B[2] - at_A[2]), min(on_A, on_B)
