# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What never changes while a world moves: masses, inertia, shapes, the order of bodies."""
