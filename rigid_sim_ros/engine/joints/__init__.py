# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joints: where they are, the articulated bodies that they make, and the impulses they exert."""
