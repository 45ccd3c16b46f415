# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinds of shapes: one file each, and a table of them all."""
