# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Manifolds and distances of two shapes: one file for each family of pairs, chosen by a table."""
