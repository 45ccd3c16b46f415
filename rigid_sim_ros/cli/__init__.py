# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `rigid_sim`."""

from rigid_sim_ros.cli.commands import main, rigid_sim

__all__ = ['main', 'rigid_sim']
