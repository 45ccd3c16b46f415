# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Energy, momentum and closed joints, in scenes of bodies that joints hold."""

import math

from engine.jointed_trees import gaps
from laws.motion import Build, Look, look, Masses, masses, Ours, potential, Verdict, worst
from laws.scenes import matrix, Scene, Spec
import numpy as np


def stored(spec: Spec, world) -> float:
    """
    Return the energy [J] in armatures and springs of joints, and in drives that hold.

    A drive of stiffness k that gives up to E stores k e^2 / 2 in an error e like a spring, and
    E |e| - E^2 / 2k where it gives all it can: its force at rest is the slope of that. Whatever
    damps, saturates or brakes it takes energy from the motion compared with this, as its force
    falls with the velocity.
    """
    total = 0.0
    for j, joint in enumerate(spec['joints']):
        q, v = world.joint_position[j], world.joint_velocity[j]
        total += 0.5 * joint.get('armature', 0.0) * v * v
        if 'spring' in joint:
            total += 0.5 * joint['spring']['stiffness'] * (q - joint['spring']['rest']) ** 2
        drive = joint.get('drive', {})
        if drive.get('mode') == 'position':
            k, e = drive['stiffness'], abs(q - drive['position'])
            most = joint.get('limits', {}).get('effort', math.inf)
            total += 0.5 * k * e * e if k * e < most else most * e - 0.5 * most * most / k
    return total


class Carried:
    """The energy as one sees it who moves with the carrier; without one, who is at rest."""

    def __init__(self, spec: Spec, of: Masses) -> None:
        names = [one['name'] for one in spec['bodies']]
        self.spec, self.of = spec, of
        self.at = names.index('carrier') if 'carrier' in names else None
        twist = spec['bodies'][self.at]['twist'] if self.at is not None else {}
        self.u = np.array(twist.get('linear', (0.0, 0.0, 0.0)))
        self.w = np.array(twist.get('angular', (0.0, 0.0, 0.0)))

    def energy(self, motion: np.ndarray, now: Look) -> float:
        """
        Return T - W . L + V, which stays where a frame turns with a constant W.

        With T and L of the motions against a frame that only flies along; gravity must not change
        as it turns. (Jacobi's integral: Goldstein, Classical Mechanics, section 2.7.)
        """
        kinetic = now.kinetic.sum() - now.P.sum(axis=0) @ self.u + 0.5 * self.of.m.sum() * (
            self.u @ self.u)
        place = motion[self.at, :3] if self.at is not None else np.zeros(3)
        P = now.P - self.of.m[:, None] * self.u
        spin = (np.cross(now.x - place, P) + now.L).sum(axis=0)
        fall = self.of.m.sum() * (np.asarray(self.spec['world']['gravity']) @ place)
        return float(kinetic - self.w @ spin + potential(self.spec, self.of, now) + fall)
