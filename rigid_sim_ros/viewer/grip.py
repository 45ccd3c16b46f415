# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Hands that hold bodies: a spring and a damper from a point of a body to the mouse.

The force is chosen so that the held point, as the body lets it move, accelerates as a point on a
damped spring would:

    a = o^2 (target - p) - 2 o v,    F = K^-1 a - m g,    K = 1/m - [r] I^-1 [r]

o is how fast the hand is [1/s], critically damped; r leads from the centre of mass to the held
point, and K is the inverse of the mass that a force there feels. So a crumb and a crate, held in
the middle or at a corner, follow the mouse alike. The hand carries the weight too: what it holds
does not sag. A body that swings about the hand comes to rest by a torque against its turning.
"""
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from rigid_sim_ros.engine.state.world_inertia import world_inertia_of
from rigid_sim_ros.scene import Scene
from rigid_sim_ros.viewer.motion import Array, Motion
from rigid_sim_ros.viewer.simulation import BodyWrench, triple, Vector

# [1/s] A hand of 8 / s reaches the mouse in half a second. The force is renewed with each state
# that is heard; faster hands than a quarter of that rate begin to shake.
_FASTEST = 8.0
_STABLE = 0.25
_LATENCY = 0.01     # s of wall time from a state to the wrench that follows from it
_CALMING = 2.0      # [1/s] how fast the turning of a held body fades


class Grip(NamedTuple):
    """A hand that holds a body."""

    body: int
    point: Array        # (3,) [m] that it holds, in the body frame
    target: Vector      # [m] where the mouse is, in the world


def grip(body: int, held: Vector, motion: Motion) -> Grip:
    """Return a hand that takes a body at a point of the world."""
    offset = np.array(held) - motion.position[body]
    point = Rotation.from_quat(motion.orientation[body]).inv().apply(offset)
    return Grip(body, point, held)


def held_point(hand: Grip, motion: Motion) -> Array:
    """Return where in the world the held point is."""
    R_WB = Rotation.from_quat(motion.orientation[hand.body])
    return np.asarray(motion.position[hand.body] + R_WB.apply(hand.point))


class Masses:
    """What a hand has to know of the bodies that it holds."""

    def __init__(self, scene: Scene) -> None:
        model = scene.model
        self._names = scene.names
        self._gravity = model.gravity
        self.m = model.m
        self._I = model.I_C.T
        # q_CB takes axes of B to axes of C, and p_CB leads from C to B in axes of C.
        self._R_BC = Rotation.from_quat(model.q_CB).inv()
        self.p_BC = -self._R_BC.apply(model.p_CB)

    def centre(self, body: int, motion: Motion) -> Array:
        """Return where the centre of mass of a body is."""
        turn = Rotation.from_quat(motion.orientation[body])
        return np.asarray(motion.position[body] + turn.apply(self.p_BC[body]))

    def pull(self, hand: Grip, motion: Motion, interval: float) -> BodyWrench:
        """
        Return the wrench of a hand.

        interval [s] of simulation time goes by until the next.
        """
        k = hand.body
        speed = min(_FASTEST, _STABLE / max(interval, 1e-6))
        R_WB = Rotation.from_quat(motion.orientation[k])
        I_W = world_inertia_of((R_WB * self._R_BC[k]).as_quat(), self._I[k])
        p = held_point(hand, motion)
        v = motion.linear[k] + np.cross(motion.angular[k], p - motion.position[k])
        r = p - self.centre(k, motion)
        x, y, z = r
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        K = np.eye(3) / self.m[k] - cross @ np.linalg.solve(I_W, cross)
        a = speed ** 2 * (np.array(hand.target) - p) - 2.0 * speed * v
        force = np.linalg.solve(K, a) - self.m[k] * self._gravity
        calming = min(_CALMING, speed) * (I_W @ motion.angular[k])
        return BodyWrench(self._names[k], triple(force), triple(np.cross(r, force) - calming))


class Push(NamedTuple):
    """A wrench that somebody has typed in."""

    body: int
    force: Vector       # N
    torque: Vector      # Nm
    turns: bool         # in the axes of the body, and turns with it; else in those of the world
    duration_ns: int    # of simulation time, from the first state that it follows


class Hands:
    """Everything that the pages pull and push at present, as one list of wrenches."""

    def __init__(self, scene: Scene) -> None:
        self.grips: dict[int, Grip] = {}    # by page
        self.pushes: deque[Push] = deque()  # that are yet to begin
        self._acting: list[tuple[int, Push]] = []   # and when they end, simulation time [ns]
        self._masses = Masses(scene)
        self._names = scene.names
        self._interval = 0.01
        self._last: tuple[int, float] | None = None

    @property
    def are_idle(self) -> bool:
        """Whether nothing is held or pushed."""
        return not (self.grips or self.pushes or self._acting)

    def wrenches(self, motion: Motion, now: float) -> list[BodyWrench]:
        """Return what acts from now on; now [s] is steady wall time."""
        self._measure(motion.t_ns, now)
        # A clock that was set back ends them too.
        self._acting = [(end, push) for end, push in self._acting
                        if end - push.duration_ns <= motion.t_ns < end]
        while self.pushes:
            push = self.pushes.popleft()
            self._acting.append((motion.t_ns + push.duration_ns, push))
        grips: Mapping[int, Grip] = dict(self.grips)
        pulls = [self._masses.pull(hand, motion, self._interval) for hand in grips.values()]
        return pulls + [self._pushed(push, motion) for _, push in self._acting]

    def _pushed(self, push: Push, motion: Motion) -> BodyWrench:
        if not push.turns:
            return BodyWrench(self._names[push.body], push.force, push.torque)
        turn = Rotation.from_quat(motion.orientation[push.body])
        return BodyWrench(self._names[push.body], triple(turn.apply(push.force)),
                          triple(turn.apply(push.torque)))

    def _measure(self, t_ns: int, now: float) -> None:
        """Learn how much simulation time goes by until a wrench acts."""
        if self._last is not None and t_ns > self._last[0] and now > self._last[1]:
            passed = 1e-9 * (t_ns - self._last[0])
            speed = passed / (now - self._last[1])
            self._interval = 0.9 * self._interval + 0.1 * (passed + speed * _LATENCY)
        self._last = t_ns, now
