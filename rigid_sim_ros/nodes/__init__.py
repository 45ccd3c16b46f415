# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes: thin, and the only place that imports rclpy."""
