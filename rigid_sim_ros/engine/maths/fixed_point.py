# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixed points x = g(x) of a few numbers, found faster than by repeating g."""

from typing import NamedTuple

import numpy as np

from rigid_sim_ros.engine.maths.elimination import solve_symmetric
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.kernels.kernel import kernel

# Changes of the rounds before that are made use of, at most.
DEPTH = 4
# Added to the squares of these changes, as a part of them: changes that are alike up to the root
# of it count as one.
ALIKE = 1e-10


class Rounds(NamedTuple):
    """What is known of g from the rounds before."""

    e: Array  # (n,) w (g(x) - x) of the last round
    g: Array  # (n,)
    d_e: Array  # (DEPTH, n) how e changed from one round to the next, the newest anywhere
    d_g: Array  # (DEPTH, n)
    K: Array  # (DEPTH * DEPTH,) scratch
    share: Array  # (DEPTH,) scratch
    last: IntArray  # (DEPTH,) scratch


def make_rounds(n: int) -> Rounds:
    """Return memory for up to n numbers."""
    return Rounds(np.zeros(n), np.zeros(n), np.zeros((DEPTH, n)), np.zeros((DEPTH, n)),
                  np.zeros(DEPTH * DEPTH), np.zeros(DEPTH), np.zeros(DEPTH, dtype=np.int64))


@kernel
def next_round(turn: int, n: int, x: Array, g: Array, w: Array, rounds: Rounds) -> None:
    """
    Replace x, of which g is g(x), by what to try next; `turn` counts the rounds from 0 on.

    With e = w (g - x) and the changes D_e, D_g of the rounds before, x becomes g - D_g s, where s
    makes |e - D_e s| least: of linear g the fixed point, once there are as many changes as
    directions. It is found, too, where repeating g would lead away from it (Anderson, Iterative
    procedures for nonlinear integral equations, J. ACM 12 (1965); Walker, Ni, SIAM J. Numer.
    Anal. 49 (2011)). `w` (n,) makes the numbers comparable.
    """
    used = min(turn, DEPTH)
    if turn > 0:
        _note_change((turn - 1) % DEPTH, n, x, g, w, rounds)
    for i in range(n):
        rounds.e[i], rounds.g[i], x[i] = w[i] * (g[i] - x[i]), g[i], g[i]
    if used > 0 and _find_shares(used, n, rounds):
        for j in range(used):
            for i in range(n):
                x[i] -= rounds.share[j] * rounds.d_g[j, i]


@kernel
def _note_change(to: int, n: int, x: Array, g: Array, w: Array, rounds: Rounds) -> None:
    for i in range(n):
        rounds.d_e[to, i] = w[i] * (g[i] - x[i]) - rounds.e[i]
        rounds.d_g[to, i] = g[i] - rounds.g[i]


@kernel
def _find_shares(used: int, n: int, rounds: Rounds) -> bool:
    """Find s that makes |e - D_e s| least; return False if there was no change."""
    K, share = rounds.K[:used * used].reshape((used, used)), rounds.share[:used]
    most = 0.0
    for j in range(used):
        share[j] = _product(n, rounds.d_e[j], rounds.e)
        for k in range(used):
            K[j, k] = _product(n, rounds.d_e[j], rounds.d_e[k])
        most = max(most, K[j, j])
    for j in range(used):
        K[j, j] += ALIKE * most
    return most > 0.0 and solve_symmetric(K, share, rounds.last)


@kernel
def _product(n: int, x: Array, y: Array) -> float:
    total = 0.0
    for i in range(n):
        total += x[i] * y[i]
    return total
