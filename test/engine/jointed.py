# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes with joints, and their motions by other means: in minimal coordinates."""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from rigid_sim_ros import World

G = 9.81


def scene(bodies, joints, h=1e-3, gravity=(0.0, 0.0, -G), **more):
    return {'world': {'contact': 'none', 'step': h, 'gravity': list(gravity)},
            'bodies': bodies, 'joints': joints, **more}


def world(bodies, joints, h=1e-3, gravity=(0.0, 0.0, -G), **more):
    return World.from_dict(scene(bodies, joints, h, gravity, **more))


def body(name, mass=1.0, com=(0.0, 0.0, 0.0), inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0),
         position=(0.0, 0.0, 0.0), orientation=(0.0, 0.0, 0.0, 1.0), **more):
    return {'name': name, 'inertial': {'mass': mass, 'com': list(com), 'inertia': list(inertia)},
            'pose': {'position': list(position), 'orientation': list(orientation)}, **more}


def joint(name, parent, child, kind='revolute', position=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0),
          **more):
    return {'name': name, 'type': kind, 'parent': parent, 'child': child,
            'pose': {'position': list(position)}, 'axis': list(axis), **more}


def rod(m, length, radius):
    """Return the inertia of a cylinder along z about its centre, in the order of a scene."""
    across = m * (3 * radius ** 2 + length ** 2) / 12
    return (across, across, 0.5 * m * radius ** 2, 0.0, 0.0, 0.0)


def hanging(count, length=1.0, m=1.0, radius=0.02, angle=math.pi / 2, end=0.0, h=1e-3, **more):
    """
    Return a world of rods that hang one below the other, the first turned up by an angle.

    `end` is the mass [kg] of a cube of 0.1 m that a fixed joint holds at the last tip.
    """
    bodies = [body(f'link{i}', m, (0, 0, -length / 2), rod(m, length, radius), (0, 0, -i * length))
              for i in range(count)]
    joints = [joint(f'joint{i}', f'link{i - 1}' if i else 'world', f'link{i}',
                    position=(0, 0, -length if i else 0), **({} if i else {'position_': angle}),
                    **more) for i in range(count)]
    joints[0]['position'] = joints[0].pop('position_')
    if end:
        side = end * 0.1 ** 2 / 6
        bodies.append(body('end', end, (0, 0, 0), (side, side, side, 0, 0, 0),
                           (0, 0, -count * length)))
        joints.append(joint('hold', f'link{count - 1}', 'end', 'fixed', (0, 0, -length)))
    return world(bodies, joints, h)


def planar_links(lengths, masses, coms, inertias, angles, times, rtol=3e-13, atol=1e-13):
    """
    Return the angles from the downward vertical of links that hang in a row, (n, times).

    Lagrange's equations of a chain in a plane: with C_ik the lever of angle k at centre of mass i,
    K = C^T m C, the kinetic energy is the sum of (K_ij cos(a_i - a_j) + I_i d_ij) w_i w_j / 2.
    """
    n = len(lengths)
    C = np.tril(np.ones((n, n)), -1) * np.array(lengths) + np.diag(coms)
    K = (C * np.array(masses)[:, None]).T @ C
    weight = (C * np.array(masses)[:, None]).sum(axis=0) * G

    def rates(t, y):
        a, w = y[:n], y[n:]
        d = a[:, None] - a[None, :]
        bias = (K * np.sin(d)) @ (w * w) + weight * np.sin(a)
        return np.r_[w, np.linalg.solve(K * np.cos(d) + np.diag(inertias), -bias)]

    done = solve_ivp(rates, (0, times[-1]), np.r_[angles, np.zeros(n)], method='DOP853', rtol=rtol,
                     atol=atol, t_eval=times)
    return done.y[:n]


def planar_tip(angles, lengths):
    """Return the tip of such a chain, (times, 3) [m]: a positive turn about y lifts it to -x."""
    lengths = np.array(lengths)[:, None]
    x, z = -(lengths * np.sin(angles)).sum(axis=0), -(lengths * np.cos(angles)).sum(axis=0)
    return np.column_stack([x, 0.0 * x, z])


# Links of a Franka Emika Panda: mass [kg], centre of mass [m], and inertia about it [kg m^2] xx
# yy zz xy xz yz, in link frames (Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca, Dynamic
# Identification of the Franka Emika Panda Robot With Retrieval of Feasible Parameters Using
# Penalty-Based Optimization, IEEE RA-L 4(4), 4147-4154, 2019), to the last digit those in the URDF
# of franka_ros, as example-robot-data 6.0.0 has it; joints by a, d and alpha of modified
# Denavit-Hartenberg parameters (Franka Control Interface documentation).
PANDA_LINKS = (
    (4.970684, (3.875e-3, 2.081e-3, -0.04762),
     (0.70337, 0.70661, 9.1170e-3, -1.3900e-4, 6.7720e-3, 1.9169e-2)),
    (0.646926, (-3.141e-3, -2.872e-2, 3.495e-3),
     (7.9620e-3, 2.8110e-2, 2.5995e-2, -3.9250e-3, 1.0254e-2, 7.0400e-4)),
    (3.228604, (2.7518e-2, 3.9252e-2, -6.6502e-2),
     (3.7242e-2, 3.6155e-2, 1.0830e-2, -4.7610e-3, -1.1396e-2, -1.2805e-2)),
    (3.587895, (-5.317e-2, 1.04419e-1, 2.7454e-2),
     (2.5853e-2, 1.9552e-2, 2.8323e-2, 7.7960e-3, -1.3320e-3, 8.6410e-3)),
    (1.225946, (-1.1953e-2, 4.1065e-2, -3.8437e-2),
     (3.5549e-2, 2.9474e-2, 8.6270e-3, -2.1170e-3, -4.0370e-3, 2.2900e-4)),
    (1.666555, (6.0149e-2, -1.4117e-2, -1.0517e-2),
     (1.9640e-3, 4.3540e-3, 5.4330e-3, 1.0900e-4, -1.1580e-3, 3.4100e-4)),
    (0.735522, (1.0517e-2, -4.252e-3, 6.1597e-2),
     (1.2516e-2, 1.0027e-2, 4.8150e-3, -4.2800e-4, -1.1960e-3, -7.4100e-4)))
# The hand that a fixed joint holds at its flange, turned by -45 degrees (franka_description).
PANDA_HAND = (0.73, (-0.01, 0.0, 0.03), (0.001, 0.0025, 0.0017, 0.0, 0.0, 0.0))
PANDA_FRAMES = ((0.0, 0.333, 0.0), (0.0, 0.0, -math.pi / 2), (0.0, 0.316, math.pi / 2),
                (0.0825, 0.0, math.pi / 2), (-0.0825, 0.384, -math.pi / 2),
                (0.0, 0.0, math.pi / 2), (0.088, 0.0, math.pi / 2))
PANDA_START = (0.3, -0.785, 0.2, -2.0, 0.4, 1.571, 0.785)
PANDA_TIP = (0.0, 0.0, 0.107)


class Arm:
    """A serial arm of revolute joints about z of their frames, in minimal coordinates."""

    def __init__(self, frames, links):
        """Take modified Denavit-Hartenberg a [m], d [m], alpha [rad], and mass properties."""
        self.offsets = [np.array([a, -d * math.sin(alpha), d * math.cos(alpha)])
                        for a, d, alpha in frames]
        self.turns = [Rotation.from_rotvec([alpha, 0, 0]).as_matrix() for _, _, alpha in frames]
        self.m = np.array([link[0] for link in links])
        self.com = [np.array(link[1]) for link in links]
        self.inertia = [tensor(link[2]) for link in links]

    def poses(self, q):
        """Return rotation matrices and origins of the links."""
        R, p, found = np.eye(3), np.zeros(3), []
        for turn, offset, angle in zip(self.turns, self.offsets, q, strict=True):
            p = p + R @ offset
            c, s = math.cos(angle), math.sin(angle)
            R = R @ turn @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
            found.append((R, p))
        return found

    def dynamics(self, q, v):
        """Return the mass matrix and the bias forces, from the Jacobians of the links."""
        n = len(q)
        M, bias = np.zeros((n, n)), np.zeros(n)
        poses = self.poses(q)
        axes = np.array([R[:, 2] for R, _ in poses])
        origins = np.array([p for _, p in poses])
        w, dw, a, before = np.zeros(3), np.zeros(3), np.array([0, 0, G]), np.zeros(3)
        for i, (R, p) in enumerate(poses):
            # Acceleration of the origin of the link and angular acceleration for no acceleration
            # of the joints, with gravity as an acceleration upwards.
            r = p - before
            a = a + np.cross(dw, r) + np.cross(w, np.cross(w, r))
            dw = dw + np.cross(w, axes[i] * v[i])
            w, before = w + axes[i] * v[i], p
            c = R @ self.com[i]
            acceleration = a + np.cross(dw, c) + np.cross(w, np.cross(w, c))
            inertia = R @ self.inertia[i] @ R.T
            turning = np.zeros((3, n))
            turning[:, :i + 1] = axes[:i + 1].T
            moving = np.zeros((3, n))
            moving[:, :i + 1] = np.cross(axes[:i + 1], p + c - origins[:i + 1]).T
            M += self.m[i] * moving.T @ moving + turning.T @ inertia @ turning
            bias += moving.T @ (self.m[i] * acceleration) + turning.T @ (
                inertia @ dw + np.cross(w, inertia @ w))
        return M, bias

    def motion(self, q, times):
        """Return the angles at some times of the arm that is released at rest, (times, n)."""
        n = len(q)

        def rates(t, y):
            M, bias = self.dynamics(y[:n], y[n:])
            return np.r_[y[n:], np.linalg.solve(M, -bias)]

        # The flange errs by 3e-9 m, as ten thousand times smaller tolerances tell.
        done = solve_ivp(rates, (0, times[-1]), np.r_[q, np.zeros(n)], method='DOP853',
                         rtol=1e-8, atol=1e-8, t_eval=times)
        return done.y[:n].T


def tensor(values):
    """Return the matrix of an inertia in the order of a scene."""
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def together(parts):
    """Return mass, centre and inertia of parts (m, com, inertia) that are one body."""
    m = sum(part[0] for part in parts)
    com = sum(part[0] * np.array(part[1]) for part in parts) / m
    total = np.zeros((3, 3))
    for mass, centre, inertia in parts:
        d = np.array(centre) - com
        total += tensor(inertia) + mass * (d @ d * np.eye(3) - np.outer(d, d))
    return m, tuple(com), tuple(total[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])


FLANGE = Rotation.from_euler('z', -45, degrees=True)
_HELD = FLANGE.as_matrix() @ tensor(PANDA_HAND[2]) @ FLANGE.as_matrix().T
PANDA = Arm(PANDA_FRAMES, (*PANDA_LINKS[:6], together([PANDA_LINKS[6], (
    PANDA_HAND[0], PANDA_TIP + FLANGE.apply(PANDA_HAND[1]),
    _HELD[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])])))


def panda(h=1e-3, **more):
    """Return the world of a Panda that stands on the world, with its hand."""
    poses = PANDA.poses(np.zeros(7))
    bodies = [body(f'link{i}', *PANDA_LINKS[i], p, Rotation.from_matrix(R).as_quat())
              for i, (R, p) in enumerate(poses)]
    joints = []
    for i, (turn, offset) in enumerate(zip(PANDA.turns, PANDA.offsets, strict=True)):
        one = joint(f'joint{i}', f'link{i - 1}' if i else 'world', f'link{i}', axis=(0, 0, 1),
                    **more)
        one['pose'] = {'position': list(offset),
                       'orientation': list(Rotation.from_matrix(turn).as_quat())}
        joints.append(one | {'position': PANDA_START[i]})
    R, p = poses[6]
    turned = Rotation.from_matrix(R) * FLANGE
    bodies.append(body('hand', *PANDA_HAND, (p + R @ PANDA_TIP).tolist(), turned.as_quat()))
    joints.append(joint('flange', 'link6', 'hand', 'fixed', PANDA_TIP))
    return world(bodies, joints, h)


def pendulum_tips(times):
    """Return the tip of `hanging(1)`, (times, 3) [m]."""
    # A rod of 1 m about its end, L = (m l^2 / 3 + m r^2 / 4) / (m l / 2).
    length = (1 / 3 + 0.02 ** 2 / 4) / 0.5
    return planar_tip(planar_links([length], [1.0], [length], [0.0], [math.pi / 2], times), [1.0])


def double_pendulum_tips(times):
    """Return the tip of `hanging(2)`, (times, 3) [m]."""
    return planar_tip(planar_links([1, 1], [1, 1], [0.5, 0.5], [rod(1.0, 1.0, 0.02)[0]] * 2,
                                   [math.pi / 2] * 2, times), [1.0, 1.0])


def chain_tips(times):
    """Return the tip of `hanging(50, 0.1, 0.1, 0.01, end=10.0)`, (times, 3) [m]."""
    last = together([(0.1, (0, 0, -0.05), rod(0.1, 0.1, 0.01)),
                     (10.0, (0, 0, -0.1), (10 * 0.01 / 6,) * 3 + (0.0,) * 3)])
    masses, coms = [0.1] * 49 + [last[0]], [0.05] * 49 + [-last[1][2]]
    about = [rod(0.1, 0.1, 0.01)[0]] * 49 + [last[2][0]]
    # The tip errs by 2e-11 m, as ten thousand times smaller tolerances tell.
    return planar_tip(planar_links([0.1] * 50, masses, coms, about, [math.pi / 2] * 50, times,
                                   rtol=1e-8, atol=1e-8), [0.1] * 50)


def panda_tips(times):
    """Return the flange of `panda()`, (times, 3) [m]."""
    found = [PANDA.poses(q)[-1] for q in PANDA.motion(np.array(PANDA_START), times)]
    return np.array([p + R @ PANDA_TIP for R, p in found])


def point_of(world, name, p=(0.0, 0.0, 0.0)):
    """Return a point of a body [m] in the world."""
    i = world.names.index(name)
    return world.position[i] + Rotation.from_quat(world.orientation[i]).apply(p)


def energy(world):
    return world.kinetic_energy() + world.potential_energy()


# A four-bar linkage in the plane x, z: crank, coupler and rocker [m], and where the rocker hangs.
CRANK, COUPLER, ROCKER, BASE = 0.3, 1.0, 0.8, 1.0


def _four_bar_tips(a, b, c):
    """Return the tips of coupler and rocker for absolute angles, (x, z)."""
    def along(length, angle):
        return -length * np.array([math.sin(angle), math.cos(angle)])
    return along(CRANK, a) + along(COUPLER, b), np.array([BASE, 0.0]) + along(ROCKER, c)


def four_bar_angles(crank=-1.2):
    """Return the absolute angles of the three links at a crank angle [rad]."""
    def gap(x):
        coupler, rocker = _four_bar_tips(crank, *x)
        return coupler - rocker
    b, c = fsolve(gap, [-2.2, 0.3], xtol=1e-15)
    return np.array([crank, b, c])


def four_bar(h=1e-3, closing='revolute', **more):
    """Return the world of the linkage at rest, each link as heavy as it is long."""
    a, b, c = four_bar_angles()
    links = (('crank', CRANK, (0, 0, 0)), ('coupler', COUPLER, (0, 0, -CRANK)),
             ('rocker', ROCKER, (BASE, 0, 0)))
    bodies = [body(name, length, (0, 0, -length / 2), rod(length, length, 0.02), position)
              for name, length, position in links]
    joints = [joint('a', 'world', 'crank') | {'position': a},
              joint('b', 'crank', 'coupler', position=(0, 0, -CRANK)) | {'position': b - a},
              joint('c', 'world', 'rocker', position=(BASE, 0, 0)) | {'position': c},
              joint('d', 'coupler', 'rocker', closing, (0, 0, -COUPLER),
                    child_pose={'position': [0, 0, -ROCKER]})]
    return world(bodies, joints, h, **more)


def four_bar_motion(times):
    """
    Return the crank angles of the linkage, released at rest.

    Lagrange's equations of crank and coupler as a chain and the rocker, with multipliers of the
    closed loop, whose second derivative is 0: the loop stays closed to the integrator's accuracy.
    """
    lengths = (CRANK, COUPLER, ROCKER)
    about = [rod(length, length, 0.02)[0] for length in lengths]
    C = np.array([[CRANK / 2, 0, 0], [CRANK, COUPLER / 2, 0], [0, 0, ROCKER / 2]])
    m = np.array(lengths)
    K = (C * m[:, None]).T @ C
    weight = (C * m[:, None]).sum(axis=0) * G
    signed = np.array([CRANK, COUPLER, -ROCKER])

    def rates(t, y):
        q, w = y[:3], y[3:]
        d = q[:, None] - q[None, :]
        J = np.array([-signed * np.cos(q), signed * np.sin(q)])
        drift = np.array([(signed * np.sin(q) * w * w).sum(), (signed * np.cos(q) * w * w).sum()])
        A = np.block([[K * np.cos(d) + np.diag(about), J.T], [J, np.zeros((2, 2))]])
        bias = (K * np.sin(d)) @ (w * w) + weight * np.sin(q)
        return np.r_[w, np.linalg.solve(A, np.r_[-bias, -drift])[:3]]

    done = solve_ivp(rates, (0, times[-1]), np.r_[four_bar_angles(), 0, 0, 0], method='DOP853',
                     rtol=1e-12, atol=1e-13, t_eval=times)
    return done.y[0]


def wheels(h=1e-3, **more):
    """Return two wheels of 0.01 and 0.02 kg m^2, coupled 1 : -2, driven with 1 N m."""
    return world(
        [body('w0', 1.0, inertia=(0.01,) * 3 + (0,) * 3),
         body('w1', 1.0, inertia=(0.02,) * 3 + (0,) * 3, position=(0.3, 0, 0))],
        [joint('g0', 'world', 'w0', drive={'mode': 'effort', 'effort': 1.0}),
         joint('g1', 'world', 'w1', position=(0.3, 0, 0),
               mimic={'joint': 'g0', 'multiplier': -2.0, **more})], h)
