# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The impulse of a row that falls piecewise straight with its rate, against a search for it."""

from hypothesis import given, strategies as st
import numpy as np

from rigid_sim_ros.engine.contact.scalar_rows import KINKS, make_scalar_rows, resolve

steps = st.floats(0.0, 2.0)
rates = st.floats(-5.0, 5.0)


@st.composite
def laws(draw):
    """Return a law of one row: rates where its impulse falls or may fall, walls at the ends."""
    s = make_scalar_rows(1)
    count = draw(st.integers(1, KINKS))
    rate, impulse = draw(rates), draw(rates)
    s.kinks[0], s.slope[0] = count, draw(steps)
    for n in range(count):
        s.kink[0, n], s.below[0, n] = rate, impulse
        s.above[0, n] = impulse - draw(steps)
        rate, impulse = rate + draw(st.floats(0.01, 2.0)), s.above[0, n] - draw(steps)
    if draw(st.booleans()):
        s.below[0, 0] = np.inf
    if draw(st.booleans()):
        s.above[0, count - 1] = -np.inf
    return s


def bounds(s, v):
    """Return between which impulses the law is at a rate."""
    kink, below, above = (a[0, :s.kinks[0]] for a in (s.kink, s.below, s.above))
    if v < kink[0]:
        return (below[0] + s.slope[0] * (kink[0] - v),) * 2
    if v > kink[-1]:
        return (above[-1] - s.slope[0] * (v - kink[-1]),) * 2
    n = int(np.searchsorted(kink, v))
    if kink[n] == v:
        return above[n], below[n]
    share = (v - kink[n - 1]) / (kink[n] - kink[n - 1])
    return (above[n - 1] + share * (below[n] - above[n - 1]),) * 2


@given(laws(), rates, st.floats(0.1, 10.0))
def test_the_impulse_is_that_of_the_law_at_the_rate_it_makes(s, w, a):
    f, slope, start = resolve(s, 0, w, a)
    v = start if np.isinf(slope) else w + a * f
    low, high = bounds(s, v)
    # Numbers up to 40 with slopes up to 200 between kinks: rounding leaves 1e-12 of them.
    slack = 1e-10 * (1.0 + abs(f) + a)
    assert low - slack <= f <= high + slack
    assert abs(v - (w + a * f)) <= slack


@given(laws(), rates, st.floats(0.1, 10.0))
def test_the_piece_that_is_returned_goes_through_the_impulse(s, w, a):
    f, slope, start = resolve(s, 0, w, a)
    if np.isinf(slope):
        assert start in s.kink[0, :s.kinks[0]]
    else:
        assert abs(start - slope * (w + a * f) - f) <= 1e-10 * (1.0 + abs(f)) * (1.0 + slope)
