# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The web page that shows and drives a simulation, or plays a bag.

Nothing here knows ROS: nodes/ brings in what a running simulation says, and takes out what the
page wants of it.
"""
