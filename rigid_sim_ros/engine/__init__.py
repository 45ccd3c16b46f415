# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The physics: arrays in, arrays out; no ROS, no files, no clock."""
