# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Times outside of the engine are whole nanoseconds."""

SECOND = 1_000_000_000      # [ns]
