# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The laws of contact: what collides, what rests, with which impulses and forces."""
