# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests."""

import os

from hypothesis import settings

# The first example of a property compiles kernels: it takes seconds, and says nothing of the code.
settings.register_profile('rigid_sim_ros', deadline=None)
# A change is judged by the same examples each time; elsewhere they are new ones.
settings.register_profile('same_examples', deadline=None, derandomize=True)
settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'rigid_sim_ros'))
