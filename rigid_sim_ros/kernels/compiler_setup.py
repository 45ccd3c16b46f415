# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What Numba does in another way than by itself, from the first kernel that is compiled on.

Not before: a process that finds all its kernels in the cache needs none of it, and what it imports
takes a twentieth of a second.
"""

from functools import cache


@cache
def set_up_compiler() -> None:
    """Let Numba compile our way in this process from now on."""
    from rigid_sim_ros.kernels.array_entries import find_entries_directly
    from rigid_sim_ros.kernels.counted_loops import count_plainly
    from rigid_sim_ros.kernels.numba_shortcuts import take_shortcuts
    from rigid_sim_ros.kernels.numba_without_scipy import spare_scipy
    from rigid_sim_ros.kernels.plain_values import see_through_tuples
    spare_scipy()
    take_shortcuts()
    find_entries_directly()
    see_through_tuples()
    count_plainly()
