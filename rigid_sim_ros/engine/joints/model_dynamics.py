# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Mass matrix, Jacobians and inverse dynamics of a tree of bodies.

Worked out from where the bodies are and how they move, in world axes: each coordinate of the tree
moves the bodies behind its joint, and what it does to them are the columns of their Jacobians
(Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2 to 6).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.state.world_inertia import world_inertia_of
from rigid_sim_ros.kernels.arrays import Array

FREE = 6   # coordinates of a base that is free


class Link(NamedTuple):
    """A body of a tree, behind its parent in the list."""

    body: int
    parent: int     # in the list, -1: the world
    is_base: bool   # no joint holds it
    slides: bool    # along the axis of its joint, which otherwise turns it
    first: int      # its first coordinate
    number: int     # of its coordinates
    axes: Array     # (number, 3) world axes of its joint
    point: Array    # (3,) origin of its joint [m], of a base that of its body
    armature: float  # [kg] or [kg m^2] on the coordinate of its joint, if that is one


class Poses(NamedTuple):
    """Where the l bodies of a tree are and how they move, world axes."""

    com: Array      # (l, 3) centres of mass [m]
    q_WC: Array     # (l, 4) attitudes of the principal axes, x, y, z, w
    p: Array        # (l, 3) origins of the body frames [m]
    v: Array        # (l, 3) their velocities [m/s]
    w: Array        # (l, 3) angular velocities [rad/s]


class Tree(NamedTuple):
    """A tree of l bodies with nv coordinates, and its Jacobians."""

    links: Sequence[Link]
    poses: Poses
    v: Array    # (l, 3, nv) of the velocity of each link's centre of mass [m/s]
    w: Array    # (l, 3, nv) of its angular velocity [rad/s]
    m: Array    # (l,) [kg]
    I: Array    # noqa: E741, (l, 3, 3) about the centre of mass, world axes [kg m^2]
    armature: Array     # (nv,)


def make_tree(links: Sequence[Link], poses: Poses, m: Array, I_C: Array) -> Tree:
    """Return a tree of links with masses m, (l,) [kg], and principal moments I_C, (l, 3)."""
    l, nv = len(links), sum(link.number for link in links)  # noqa: E741
    tree = Tree(links, poses, np.zeros((l, 3, nv)), np.zeros((l, 3, nv)), m,
                np.array([world_inertia_of(q, moments)
                          for q, moments in zip(poses.q_WC, I_C, strict=True)]), np.zeros(nv))
    for k, link in enumerate(links):
        if link.parent >= 0:
            arm = poses.com[k] - poses.com[link.parent]
            tree.w[k] = tree.w[link.parent]
            tree.v[k] = velocity_columns(tree, link.parent, arm)
        mine = slice(link.first, link.first + link.number)
        if link.is_base:
            if link.number:
                arm = poses.com[k] - poses.p[k]
                tree.v[k][:, mine] = np.hstack([np.eye(3), np.cross(np.eye(3), arm).T])
                tree.w[k][:, mine] = np.hstack([np.zeros((3, 3)), np.eye(3)])
            continue
        if link.slides:
            tree.v[k][:, mine] += link.axes.T
        else:
            tree.w[k][:, mine] += link.axes.T
            tree.v[k][:, mine] += np.cross(link.axes, poses.com[k] - link.point).T
        tree.armature[mine] = link.armature
    return tree


def velocity_columns(tree: Tree, k: int, arm: Array) -> Array:
    """Return the Jacobian (3, nv) of a point of link k, `arm` (3,) [m] from its centre of mass."""
    return np.asarray(tree.v[k] + np.cross(tree.w[k], arm, axisa=0, axisc=0))


def mass_matrix(tree: Tree) -> Array:
    """Return the mass matrix, (nv, nv) [kg, kg m, kg m^2], with armatures."""
    M = (np.einsum('l,lik,lij->kj', tree.m, tree.v, tree.v)
         + np.einsum('lak,lab,lbj->kj', tree.w, tree.I, tree.w))
    return np.asarray(0.5 * (M + M.T) + np.diag(tree.armature))


def jacobian(tree: Tree, k: int, p_W: Array) -> Array:
    """Return what gives the twist at p_W [m] of link k, (6, nv): velocity, angular velocity."""
    return np.vstack([velocity_columns(tree, k, p_W - tree.poses.com[k]), tree.w[k]])


def inverse_dynamics(tree: Tree, acceleration: Array, gravity: Array) -> Array:
    """
    Return the generalized forces, (nv,), that give a tree these accelerations now.

    They balance inertia, gravity, (3,) [m/s^2], and what velocities make. `acceleration` (nv,) are
    the time derivatives of the velocities of the coordinates.
    """
    a, alpha = accelerations(tree, acceleration)
    w = tree.poses.w
    f = tree.m[:, None] * (a - gravity)
    n = np.einsum('lab,lb->la', tree.I, alpha)
    n += np.cross(w, np.einsum('lab,lb->la', tree.I, w))
    forces = np.einsum('lak,la->k', tree.v, f) + np.einsum('lak,la->k', tree.w, n)
    return np.asarray(forces + tree.armature * acceleration)


def accelerations(tree: Tree, given: Array) -> tuple[Array, Array]:
    """
    Return how the centres of mass accelerate, (l, 3) [m/s^2], and the angles, (l, 3) [rad/s^2].

    `given` (nv,) is how the velocities of the coordinates change.
    """
    _, _, p, v, w = tree.poses
    a, alpha = np.zeros_like(p), np.zeros_like(p)   # of the origins of the body frames
    for k, link in enumerate(tree.links):
        mine = given[link.first:link.first + link.number]
        if link.is_base:
            if link.number:
                a[k], alpha[k] = mine[:3], mine[3:]
            continue
        i = link.parent
        w_p, alpha_p, a_p, p_p, v_p = (
            (np.zeros(3),) * 5 if i < 0 else (w[i], alpha[i], a[i], p[i], v[i]))
        if link.slides:
            arm = p[k] - p_p
            # The rate along the axis, which turns with the parent.
            along = v[k] - v_p - np.cross(w_p, arm)
            alpha[k] = alpha_p
            a[k] = (_acceleration_at(a_p, alpha_p, w_p, arm) + mine @ link.axes
                    + 2.0 * np.cross(w_p, along))
            continue
        alpha[k] = alpha_p + mine @ link.axes + np.cross(w_p, w[k] - w_p)
        at_joint = _acceleration_at(a_p, alpha_p, w_p, link.point - p_p)
        a[k] = _acceleration_at(at_joint, alpha[k], w[k], p[k] - link.point)
    return _acceleration_at(a, alpha, w, tree.poses.com - p), alpha


def _acceleration_at(a: Array, alpha: Array, w: Array, r: Array) -> Array:
    """Return a + alpha x r + w x (w x r) [m/s^2]: the acceleration of a point r [m] away."""
    return np.asarray(a + np.cross(alpha, r) + np.cross(w, np.cross(w, r)))
