# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests."""

from hypothesis import settings

# The first example of a property compiles kernels: it takes seconds, and says nothing of the code.
settings.register_profile('rigid_sim_ros', deadline=None)
settings.load_profile('rigid_sim_ros')
