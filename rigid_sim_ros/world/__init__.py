# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The object that a Python user holds, what acts on it, and its state as bytes."""

from rigid_sim_ros.world.world import load_scene, World

__all__ = ['World', 'load_scene']
