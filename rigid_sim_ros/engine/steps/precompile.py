# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiling begins while the first world is still being built."""

from functools import cache

import numpy as np

from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.detection.manifolds import empty_memory
from rigid_sim_ros.engine.dynamics.forces import WIDTH
from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches
from rigid_sim_ros.engine.model.model import build_model, ForceTable
from rigid_sim_ros.engine.model.shapes import build_materials, build_shapes, Material
from rigid_sim_ros.engine.solver.arguments import make_arguments, TimestepSettings
from rigid_sim_ros.engine.state.state import empty_state
from rigid_sim_ros.engine.steps.timestep import pieces_of
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from rigid_sim_ros.kernels.separate import begin


@cache
def compile_beforehand() -> None:
    """
    Let a helper begin with what every world of the model `timestep` needs, if it is not cached.

    Once in a process.

    Kernels are compiled for the types of their arguments, and those of a world without bodies are
    the same as of any other.
    """
    none = np.zeros(0, dtype=np.int64)
    model = build_model([], [], ForceTable(none, none, none, np.zeros((0, WIDTH))), 0.001,
                        (0.0, 0.0, 0.0))
    c = make_arguments(
        Basis(model, empty_state(0), no_wrenches(), build_shapes(model, []),
              build_materials([Material()]), empty_memory(0, 0)), TimestepSettings())
    begin(pieces_of(c, helped=False), ArgumentPack(c))
