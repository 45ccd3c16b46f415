# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rows that a solver works on, and the contacts that produce them."""
