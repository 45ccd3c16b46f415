# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can be read of a world: motion, energies, momenta and contacts."""

import numpy as np

from rigid_sim_ros.engine.dynamics.force_and_torque import empty_loads
from rigid_sim_ros.engine.dynamics.forces import add_gravity, add_scene_forces
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import (
    BodyMotion, kinetic_energy, read_motion, State, total_angular_momentum)
from rigid_sim_ros.engine.steps.contact_model import ContactModel, ContactReport
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from rigid_sim_ros.kernels.arrays import Array, IntArray


class Readings:
    """
    The part of World that changes nothing.

    Rows are those of `names`; vectors are in world axes and SI units.
    """

    names: list[str]
    _model: Model
    _state: State
    _contact: ContactModel
    _motion: BodyMotion     # of the body frames, in the order of the engine's rows
    _motion_is_current: bool
    _pack: ArgumentPack     # of model, state and motion
    _order: IntArray        # which body is in a row of the engine's arrays
    _row: IntArray          # the row of a body

    # --- motion -------------------------------------------------------------------------------

    def _current_motion(self) -> BodyMotion:
        if not self._motion_is_current:
            self._pack.run(read_motion)
            self._motion_is_current = True
        return self._motion

    def _by_body(self, columns: Array) -> Array:
        """Return a row for each body, in the order of `names`."""
        return np.take(columns.T, self._row, axis=0)

    @property
    def position(self) -> Array:
        """Origins of the body frames, (n, 3) [m], world axes."""
        return self._current_motion().position[self._row]

    @property
    def orientation(self) -> Array:
        """Orientations of the body frames, (n, 4) x, y, z, w, body to world."""
        return self._current_motion().orientation[self._row]

    @property
    def linear_velocity(self) -> Array:
        """Velocities of the origins of the body frames, (n, 3) [m/s], world axes."""
        return self._current_motion().linear[self._row]

    @property
    def angular_velocity(self) -> Array:
        """Angular velocities, (n, 3) [rad/s], world axes."""
        return self._current_motion().angular[self._row]

    @property
    def linear_momentum(self) -> Array:
        """Linear momenta P = M v, (n, 3) [kg m/s], world axes."""
        return self._by_body(self._state.P)

    @property
    def angular_momentum(self) -> Array:
        """Angular momenta L = I w about the centres of mass, (n, 3) [kg m^2/s], world axes."""
        return self._by_body(self._state.L)

    @property
    def center_of_mass(self) -> Array:
        """Centres of mass, (n, 3) [m], world axes."""
        return self._by_body(self._state.x)

    @property
    def mass(self) -> Array:
        """Masses, (n,) [kg]; 0 for a fixed body that was given none."""
        return self._model.m[self._row]

    def kinetic_energy(self) -> float:
        """Return the kinetic energy of all bodies [J]."""
        return float(kinetic_energy(self._model, self._state))

    def potential_energy(self) -> float:
        """Return the potential energy of gravity and of the scene's forces [J]."""
        loads = empty_loads(len(self.names))
        return float(add_gravity(self._model, self._state, loads)
                     + add_scene_forces(self._model, self._state, loads))

    def total_momentum(self) -> Array:
        """Return the linear momentum of all bodies, (3,) [kg m/s]."""
        return np.asarray(self._state.P.sum(axis=1))

    def total_angular_momentum(self) -> Array:
        """Return the angular momentum of all bodies about the world origin, (3,) [kg m^2/s]."""
        return np.array(total_angular_momentum(self._state))

    # --- contacts -----------------------------------------------------------------------------

    def contacts(self) -> np.ndarray:
        """
        Return the contact points of the latest step as a structured array.

        Its fields are body_a and body_b (indices into `names`), point [m], normal (unit vector
        from a to b), gap [m] (below 0: overlap), normal_force [N] and friction_force (3) [N on b],
        all in world axes. Forces are means over the step. A point without a force is near, but
        does not touch.
        """
        rows = self._contact.contacts(self._state)
        for body in ('body_a', 'body_b'):
            rows[body] = self._order[rows[body]]
        return rows

    def contact_wrenches(self) -> Array:
        """
        Return force [N] and torque [N m] of the contacts on each body, (n, 6), world axes.

        The torques are about the centres of mass.
        """
        rows = self.contacts()
        force = rows['normal_force'][:, None] * rows['normal'] + rows['friction_force']
        wrenches, x = np.zeros((len(self.names), 6)), self.center_of_mass
        for sign, body in ((-1.0, rows['body_a']), (1.0, rows['body_b'])):
            arm = rows['point'] - x[body]
            np.add.at(wrenches, body, sign * np.concatenate(
                [force, np.cross(arm, force)], axis=1))
        return wrenches

    def contact_report(self) -> ContactReport:
        """Return counts of pairs and contacts, the deepest overlap and the solver's residual."""
        return self._contact.report()
