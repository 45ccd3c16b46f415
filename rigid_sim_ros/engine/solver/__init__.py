# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sequential solver: colours, sweeps, substeps, islands, sleep."""
