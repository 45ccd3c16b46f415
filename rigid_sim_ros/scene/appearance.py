# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The colours of bodies, the same wherever they are shown."""

from collections.abc import Sequence
from typing import TypeAlias

from rigid_sim_ros.scene import schema

# Red, green, blue and alpha, each 0 to 1.
Rgba: TypeAlias = tuple[float, float, float, float]

# Okabe and Ito's colours, which colour-blind people tell apart; fixed bodies are grey.
PALETTE = (
    (0.90, 0.62, 0.00), (0.34, 0.71, 0.91), (0.00, 0.62, 0.45), (0.94, 0.89, 0.26),
    (0.00, 0.45, 0.70), (0.84, 0.37, 0.00), (0.80, 0.47, 0.65),
)
FIXED = (0.6, 0.6, 0.6)


def with_alpha(color: Sequence[float]) -> Rgba:
    """Return a colour of three or four numbers with its alpha."""
    red, green, blue, *alpha = color
    return red, green, blue, alpha[0] if alpha else 1.0


def body_color(scene: schema.Scene, index: int) -> Rgba:
    """
    Return red, green, blue and alpha, each 0 to 1, of the body at this place in the scene.

    Its own colour, or that of its material, or one that tells it from its neighbours.
    """
    body = scene.bodies[index]
    material = scene.materials.get(body.material)
    color = body.color or (material.color if material else None)
    if color is not None:
        return with_alpha(color)
    return *(FIXED if body.fixed else PALETTE[index % len(PALETTE)]), 1.0
