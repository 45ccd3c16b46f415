# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The node `replay`: it publishes what a bag holds, when it was recorded.

node.py puts it together. player.py decides what is published when, on the clock of timeline.py,
from what read_ahead.py has ready; outputs.py publishes it. controls.py takes what other nodes
ask for, terminal.py what a person at the keyboard does.
"""
