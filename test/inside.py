# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What tests of the engine's parts see of a world and its users do not: the one home of this."""

from typing import Any

from rigid_sim_ros import World
from rigid_sim_ros.engine.detection.manifolds import Memory
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.engine.steps.jointed_motion import JointedMotion


def model_of(world: World) -> Model:
    """Return what never changes of the bodies."""
    return world._model


def state_of(world: World) -> State:
    """Return the state, which may be written to."""
    return world._state


def order_of(world: World) -> list[int]:
    """Return which body of the scene each row of the engine is."""
    return [int(place) for place in world._order]


def joints_of(world: World) -> JointedMotion:
    """Return the motion of the joints."""
    assert world._joints is not None
    return world._joints


def contact_of(world: World) -> Any:
    """Return the contact model."""
    return world._contact


def arguments_of(world: World) -> Any:
    """Return what the kernels of the contact model read and write."""
    return contact_of(world)._arguments


def pack_of(world: World) -> Any:
    """Return these arguments as kernels get them."""
    return contact_of(world)._pack


def solver_of(world: World) -> Any:
    """Return the memory of the sequential solver."""
    return arguments_of(world).work.solver


def memory_of(world: World) -> Memory:
    """Return the memory of detection."""
    memory: Memory = contact_of(world)._memory
    return memory


def helper_of(world: World) -> Any:
    """Return what the second core does."""
    return contact_of(world)._helper
