# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Positions, attitudes and momenta, what follows from them, and frames on bodies."""
