# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Models of robots: files of other formats in, one neutral description out (description.py)."""
