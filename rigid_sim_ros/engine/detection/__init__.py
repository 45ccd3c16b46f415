# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the state to the manifolds of all shapes that are near each other."""
