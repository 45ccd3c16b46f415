# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How far a step of the model `event` has come, and what happened in it so far.

The kernel comes back to Python for larger buffers and for OSQP, and then goes on at the stage that
it had to leave; see steps/event.py.
"""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.kernels.arrays import Array, IntArray

# The stages of a step, in their order: the groups of bodies are found; then, in a circle until no
# group has anything left of the step, what touches, the impulses of what collides, the contact
# forces (SETTLE: those of one group were found by OSQP), and the way to the next event.
BEGIN, GROUP, CONTACTS, IMPULSES, FORCES, SETTLE, MOVE = range(7)


class Progress(NamedTuple):
    """How far a step has come; each an array of one number, which kernels and Python write."""

    steps_left: IntArray
    stage: IntArray  # which is taken next
    group: IntArray  # with which it goes on
    needed: IntArray  # how much there has to be room for before it does
    width: IntArray  # rows of a point: 3, or 6 where anything resists rolling or spinning
    # Of the step
    tries: IntArray  # how often it began anew, with other groups
    groups: IntArray
    bounced: IntArray  # pairs of bodies that collided in it
    known: IntArray  # forces to begin from
    known_before: IntArray  # the same at its start
    forgets: IntArray  # 1: the manifolds still have the impulses of the step before
    # Of the contact problem of one group
    chosen: IntArray  # points that get a force
    touched: IntArray  # bodies that may move
    is_deep: IntArray  # 1: there are overlaps to be ended
    worst: Array  # how far the forces are from a solution (resting_qp.Outcome.residual)
    # What the report of the step says
    events: IntArray
    collisions: IntArray
    unsolved: IntArray  # contact problems
    cut_short: IntArray  # why part of the step ran without backtracking, see groups.py; 0: none
    residual: Array  # the largest of its problems
    deepest: Array  # [m] the deepest overlap, >= 0


def no_progress() -> Progress:
    """Return where a world stands whose steps are all taken."""
    return Progress._make(np.zeros(1, dtype=np.float64 if name in ('worst', 'residual', 'deepest')
                                   else np.int64) for name in Progress._fields)
