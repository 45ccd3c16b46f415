# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Run a scene in ODE: its quick step, the other settings as they come.

ODE asks back for every pair that may touch. Numba compiles the answer, and the loop over steps, so
that no Python runs in a step, as in a program in C.
"""

from collections.abc import Callable
import ctypes
from typing import Any

import numba
from numba import types
import numpy as np
from ode_library import (BOUNCES, CONTACT, function, INT, MU_IS_A_COEFFICIENT, NUMBERS_OF_A_MASS,
                         POINTER, REAL)
from runner import main, Running

MOST = 8  # contacts of a pair: as many as ODE finds between two boxes


def _stepping(world: int, space: int, surface: np.ndarray) -> Callable[[int, float], None]:
    """Return what takes so many steps of so many seconds, with one surface for all contacts."""
    collide = function('dCollide', INT, POINTER, POINTER, INT, POINTER, INT)
    joint = function('dJointCreateContact', POINTER, POINTER, POINTER, POINTER)
    attach = function('dJointAttach', None, POINTER, POINTER, POINTER)
    body_of = function('dGeomGetBody', POINTER, POINTER)
    collide_all = function('dSpaceCollide', None, POINTER, POINTER, POINTER)
    quick_step = function('dWorldQuickStep', INT, POINTER, REAL)
    forget_joints = function('dJointGroupEmpty', None, POINTER)
    group = function('dJointGroupCreate', POINTER, INT)(0)
    contacts = np.zeros(MOST, CONTACT)
    contacts['surface'] = surface
    size, first = CONTACT.itemsize, contacts.ctypes.data
    geometry = first + CONTACT.fields['geometry'][1]

    @numba.cfunc(types.void(types.uintp, types.uintp, types.uintp))
    def near(_: int, a: int, b: int) -> None:
        """Give a pair that may touch a joint for each contact."""
        for i in range(collide(a, b, MOST, geometry, size)):
            attach(joint(world, group, first + i * size), body_of(a), body_of(b))

    asked = near.address

    @numba.njit
    def advance(count: int, step: float) -> None:
        for _ in range(count):
            collide_all(space, 0, asked)
            quick_step(world, step)
            forget_joints(group)

    # What the library writes to, and calls, lives as long as what steps it.
    advance.kept = contacts, near
    advance(0, 1.0)
    return advance


def _add_body(world: int, space: int, body: dict[str, Any]) -> int:
    handle = function('dBodyCreate', POINTER, POINTER)(world)
    mass = np.zeros(NUMBERS_OF_A_MASS)
    function('dMassSetParameters', None, POINTER, *[REAL] * 10)(
        mass.ctypes.data, body['mass'], 0.0, 0.0, 0.0, *body['moments'], 0.0, 0.0, 0.0)
    function('dBodySetMass', None, POINTER, POINTER)(handle, mass.ctypes.data)
    x, y, z, w = body['orientation']
    quaternion = np.array([w, x, y, z])
    function('dBodySetQuaternion', None, POINTER, POINTER)(handle, quaternion.ctypes.data)
    for name, vector in (('dBodySetPosition', body['position']),
                         ('dBodySetLinearVel', body['linear']),
                         ('dBodySetAngularVel', body['angular'])):
        function(name, None, POINTER, *[REAL] * 3)(handle, *vector)
    shape = 'dCreateSphere' if body['shape'] == 'sphere' else 'dCreateBox'
    geometry = function(shape, POINTER, POINTER, *[REAL] * len(body['size']))(space, *body['size'])
    function('dGeomSetBody', None, POINTER, POINTER)(geometry, handle)
    return int(handle)


def build(scene: dict[str, Any]) -> Running:
    """Return the scene; friction is along two directions, each up to mu times the normal force."""
    function('dInitODE2', INT, ctypes.c_uint)(0)
    world = function('dWorldCreate', POINTER)()
    space = function('dHashSpaceCreate', POINTER, POINTER)(0)
    function('dWorldSetGravity', None, POINTER, *[REAL] * 3)(world, *scene['gravity'])
    if scene['ground']:
        function('dCreatePlane', POINTER, POINTER, *[REAL] * 4)(space, 0.0, 0.0, 1.0, 0.0)
    bodies = [_add_body(world, space, body) for body in scene['bodies']]
    surface = np.zeros((), CONTACT['surface'])
    surface['mode'] = MU_IS_A_COEFFICIENT | (BOUNCES if scene['restitution'] > 0.0 else 0)
    surface['mu'], surface['bounce'] = scene['friction'], scene['restitution']
    advance = _stepping(world, space, surface)
    read = [(function(f'dBodyGet{name}', ctypes.POINTER(REAL), POINTER), order)
            for name, order in (('Position', [0, 1, 2]), ('Quaternion', [1, 2, 3, 0]),
                                ('LinearVel', [0, 1, 2]), ('AngularVel', [0, 1, 2]))]

    def motion() -> np.ndarray:
        return np.array([[get(body)[k] for get, order in read for k in order] for body in bodies])

    return Running(lambda count: advance(count, scene['step']), motion)


if __name__ == '__main__':
    main(build)
