# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The frames of a scene by their names, and in which body they are."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.scene import Scene
from rigid_sim_ros.viewer.motion import Array


class Frame(NamedTuple):
    """A frame in a body."""

    body: int           # its place in the scene
    position: Array     # (3,) [m] in the body frame
    orientation: Array  # (4,) x, y, z, w, frame to body


def frames_of(scene: Scene) -> dict[str, Frame]:
    """Return all bodies and their named frames: BODY, BODY/FRAME; of a model MODEL/LINK is one."""
    found = {}
    for k, body in enumerate(scene.spec.bodies):
        found[body.name] = Frame(k, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        for name, pose in body.frames.items():
            whole = name if '/' in name else f'{body.name}/{name}'
            found[whole] = Frame(k, np.array(pose.position), np.array(pose.orientation))
    return found
