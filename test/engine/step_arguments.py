# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The arguments of a step around bodies that are there for detection."""

from engine.detecting import Scene

from rigid_sim_ros.engine.contact.basis import Basis
from rigid_sim_ros.engine.detection.detect import detect_part
from rigid_sim_ros.engine.detection.pair_manifold import search
from rigid_sim_ros.engine.dynamics.wrenches import no_wrenches
from rigid_sim_ros.engine.model.shapes import build_materials, Material
from rigid_sim_ros.engine.solver.arguments import make_arguments, TimestepSettings
from rigid_sim_ros.engine.solver.parallel_detection import share_part
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from rigid_sim_ros.kernels.separate import link, Pieces

# Of the half thickness of a shape, 0.2 to 0.3 m: points are found up to 8 to 12 mm ahead.
MARGIN = 0.04


def pack_of(scene: Scene, by_number: bool) -> ArgumentPack:
    """
    Return the arguments of a step, for kernels that worlds have compiled already.

    Pairs are shared out by number, or else by the effort of the last step.
    """
    arguments = make_arguments(
        Basis(scene.model, scene.state, no_wrenches(), scene.shapes,
              build_materials([Material()]), scene.memory), TimestepSettings(margin=MARGIN))
    arguments.work.solver.sides.cut.halved[0] = by_number
    pack = ArgumentPack(arguments)
    link(detect_part, pack, Pieces(here=[search, share_part], helped=[]))
    return pack
