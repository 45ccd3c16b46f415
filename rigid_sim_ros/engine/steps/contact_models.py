# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contact models by name."""

from collections.abc import Callable
from typing import Any

from rigid_sim_ros.engine.model.shapes import can_meet
from rigid_sim_ros.engine.steps.contact_model import ContactModel, Setup
from rigid_sim_ros.engine.steps.divided_model import DividedTimestep, has_free_bodies
from rigid_sim_ros.engine.steps.jointed_models import (
    Jointed, JointedEvent, JointedPenalty, JointedTimestep)
from rigid_sim_ros.engine.steps.jointed_motion import JointSetup
from rigid_sim_ros.engine.steps.unjointed_models import (
    Event, FreeMotion, Penalty, Timestep, VelocityQp)

# By contact and solver; the others have but one way to solve, whatever the solver is called.
CONTACT_MODELS: dict[tuple[str, str], Callable[[Setup], Any]] = {
    ('none', ''): FreeMotion,
    ('event', ''): Event,
    ('penalty', ''): Penalty,
    ('timestep', 'sequential'): Timestep,
    ('timestep', 'qp'): VelocityQp,
}

# With joints all impulses of an island are solved for at once, whatever the solver is called; but
# the solver `sequential` has those for which there are no joints.
JOINTED_MODELS: dict[str, Callable[[Setup, JointSetup], Any]] = {
    'event': JointedEvent,
    'penalty': JointedPenalty,
    'timestep': JointedTimestep,
}


def make_contact_model(name: str, setup: Setup) -> ContactModel:
    """
    Return the contact model of this name.

    Where nothing can meet anything every model moves bodies by the method `symplectic`; another
    integrator, which only free motion has, is a choice of that.
    """
    if setup.joints is not None:
        if name == 'none' or not (can_meet(setup.shapes) or setup.sleep_after > 0.0):
            return Jointed(setup.model, setup.joints, setup.integrator)
        kind = JOINTED_MODELS[name]
        if (name, setup.solver) == ('timestep', 'sequential') and (
                setup.sleep_after > 0.0 or has_free_bodies(setup, setup.joints)):
            kind = DividedTimestep
        jointed: ContactModel = kind(setup, setup.joints)
        return jointed
    if setup.integrator != 'symplectic' and not can_meet(setup.shapes):
        name = 'none'
    solver = setup.solver if name == 'timestep' else ''
    contact_model: ContactModel = CONTACT_MODELS[name, solver](setup)
    return contact_model
