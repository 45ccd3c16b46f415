# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compile kernels that own nothing: what every kernel now is."""

from rigid_sim_ros.engine.kernel import kernel as bare

__all__ = ['bare']
