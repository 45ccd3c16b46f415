# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The numbers by which the engine knows the bodies of a world.

All that two cores share they share out by number. So the bodies of either half of a world get
numbers side by side: each core has the same bodies in all stages, and finds what it needs in its
own cache, and few contacts are across. In a half they are numbered by layers and rows: those that
touch have numbers close by, and the solver goes through a heap along the way of its weight. The
bodies of the scene keep their order wherever a user sees them.
"""

import math
from typing import Any

import numpy as np

from rigid_sim_ros.engine.model.model import Model
from rigid_sim_ros.engine.model.shapes import next_of_another, Shapes
from rigid_sim_ros.engine.state.state import State
from rigid_sim_ros.kernels.arrays import Array, IntArray

# Moving bodies from which on there may be enough manifolds for two cores.
MANY = 256
# How much less the spread along gravity counts: a heap collapses before it is cut.
_UPRIGHT = 0.5
# Places of a lattice to a body: fewer than one, as rows are never quite straight.
_PLACES = 0.9


def order_by_place(model: Model, state: State) -> IntArray:
    """
    Return the bodies (n,) in the order of their numbers.

    First those of one half, then those of the other, as a plane across the axis on which those
    that move are spread most cuts them; in a half layer by layer, upwards, and in a layer row by
    row; what does not move comes last. Few bodies stay in the order that they have.
    """
    moves = model.inv_m > 0.0
    moving = np.count_nonzero(moves)
    if moving < MANY:
        return np.arange(len(moves))
    g, x = model.gravity, state.x
    down = np.abs(g) / max(float(np.abs(g).max()), 1e-300)
    spread = [_spread(one) for one in x[:, moves]] * (1.0 - _UPRIGHT * down)
    widest = int(np.argmax(spread))
    # Of those at the same place along it others decide.
    along = np.lexsort((x[widest - 2], x[widest - 1], x[widest], ~moves))
    half = np.full(len(moves), 2)
    half[along[:moving]] = np.arange(moving) >= moving // 2
    up = int(np.argmax(down)) if g.any() else 2
    in_row, across = (k for k in range(3) if k != up)
    side = _distance(x[:, moves])
    layer, row = np.rint(x[up] / side), np.rint(x[across] / side)
    # Those of a row by their places in it, and by the others if these are the same.
    return np.lexsort((x[up], x[across], x[in_row], row, layer, half))


def middle_of(inv_m: Array) -> int:
    """Return the number of the first body of the second half of those that move."""
    moving = np.flatnonzero(inv_m > 0.0)
    return int(moving[len(moving) // 2]) if len(moving) > 0 else len(inv_m)


def _distance(x: Array) -> float:
    """
    Return how far apart bodies would be as a lattice in the box that holds them [m], about.

    A whole part of its longest side, which products and comparisons alone find: the same on every
    machine.
    """
    size, n = [float(one.max() - one.min()) for one in x], x.shape[1]
    longest, parts = max(*size, 1e-9), 1
    while parts < n and math.prod(parts * one / longest + 1.0 for one in size) < _PLACES * n:
        parts += 1
    return longest / parts


def _spread(x: Array) -> float:
    """Return the standard deviation, the same on every machine: how NumPy sums up may differ."""
    mean = math.fsum(x) / len(x)
    return math.sqrt(math.fsum((x - mean) ** 2) / len(x))


def renumbered(model: Model, state: State, shapes: Shapes, order: IntArray,
               row: IntArray) -> tuple[Model, State, Shapes]:
    """Return the same world with body order[k] in row k, body i in row[i]; frames stay."""
    if np.array_equal(order, np.arange(len(order))):
        return model, state, shapes
    return (_model(model, order, row), State._make(_columns(field, order) for field in state),
            _shapes(shapes, order, row))


def _columns(field: Any, order: IntArray) -> Any:
    """Return the columns of bodies, side by side in memory."""
    return np.ascontiguousarray(field[..., order])


def _model(model: Model, order: IntArray, row: IntArray) -> Model:
    return model._replace(
        m=model.m[order], inv_m=model.inv_m[order], I_C=_columns(model.I_C, order),
        inv_I_C=_columns(model.inv_I_C, order), p_CB=model.p_CB[order], q_CB=model.q_CB[order],
        fixed=np.sort(row[model.fixed]), frame_body=row[model.frame_body])


def _shapes(shapes: Shapes, order: IntArray, row: IntArray) -> Shapes:
    n = len(order)
    # Those of a body stay in their order.
    kept = np.argsort(row[shapes.body], kind='stable')
    a, b = row[shapes.ignored // n], row[shapes.ignored % n]
    body = row[shapes.body[kept]]
    own: dict[str, Any] = {'hulls': shapes.hulls, 'turning': shapes.turning[order],
                           'body': body, 'after': next_of_another(body),
                           'mobility': shapes.mobility[order],
                           'ignored': np.sort(np.minimum(a, b) * n + np.maximum(a, b))}
    moved = {name: field[kept] for name, field in shapes._asdict().items() if name not in own}
    return Shapes(**(moved | own))
