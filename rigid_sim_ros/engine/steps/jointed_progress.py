# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How far a step of bodies that joints hold and that touch each other has come.

A step may need what a kernel cannot make: a larger buffer, or bodies that another solver moves.
The kernel then returns the reason, Python does what is asked (jointed_contact.go_on), and calls it
again. So where a step stands is not in the flow of control, which a return forgets, but in memory:
a step is a list of stages, `Progress.stage` is the one that is taken next, and one that was
stopped is taken again from its beginning.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array, IntArray

# The stages of a step, in their order. From COLLIDE on they are a circle, until nothing is left of
# the step: what touches is found, and collides; the first half of a way; what met on it is looked
# for, and if something did it is tried again; the way is taken; the points that take part in its
# second half are chosen; the second half.
BEGIN, COLLIDE, FIRST_HALF, LOOK_BACK, ARRIVE, CHOOSE, SECOND_HALF = range(7)


class Progress(NamedTuple):
    """How far a step has come; each an array of one number, which kernels and Python write."""

    steps_left: IntArray
    stage: IntArray     # which is taken next
    left: Array         # [s] of the step
    way: Array          # [s] that is tried
    within: Array       # [s] within which what touches is to be found
    size: IntArray      # of a way, as the motion of joints is resolved by, in h / MOST_PARTS
    tries: IntArray     # of this way, each with another length
    looks: IntArray     # of this way, each with more that met on the one before
    searches: IntArray  # of what touches on this way, as bodies went farther than was known
    slowed: IntArray    # how often the motion of this way was slowed down
    events: IntArray    # of this step: ways that were cut by a meeting or a limit
    collisions: IntArray    # of this step
    cut_short: IntArray     # 1: the rest of the step is taken as one way


def no_progress() -> Progress:
    """Return where a world stands whose steps are all taken."""
    return Progress._make(np.zeros(1, dtype=np.float64 if name in ('left', 'way', 'within')
                                   else np.int64) for name in Progress._fields)
