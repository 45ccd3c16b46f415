# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every contact model is built from."""

from typing import NamedTuple

from rigid_sim_ros.engine.detection.manifolds import Memory
from rigid_sim_ros.engine.dynamics.wrenches import Wrenches
from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import Materials, Shapes
from rigid_sim_ros.engine.state.state import State


class Basis(NamedTuple):
    """The world of a contact model: what the arguments of its kernels begin with."""

    model: Model
    state: State
    wrenches: Wrenches
    shapes: Shapes
    materials: Materials
    memory: Memory
