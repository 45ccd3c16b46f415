# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a command says when it is the first on a machine."""

import re


def besides_compiling(text: str) -> str:
    """Return what was said, but for the line that kernels are compiled."""
    return re.sub(r'compiling the physics kernels[^\n]*\n', '', text)
