# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
When a step is due: absolute deadlines on the steady wall clock.

Deadlines are counted from one origin, so neither a late wake-up nor rounding adds up over time.
Steps shorter than a millisecond of wall time are taken in groups, which share a deadline:

    tick_ns = group * step_ns / factor        group: as many steps as fit into 1 ms, at least one
    deadline(k) = origin + k * tick_ns        the k-th group after the origin

An overrun is a step that begins more than one tick after its deadline. Steps that are late are
made up for at once, as long as the debt is below CATCH_UP_NS. What is beyond is dropped by moving
the origin: the simulation then falls behind the wall clock, and does not try ever harder to reach
a pace that this machine cannot hold.
"""
from typing import NamedTuple

MILLISECOND = 1_000_000

# Groups of steps: one wake-up costs some 20 us, so at most a few percent of a core go into waking.
_LEAST_TICK_NS = MILLISECOND

# Wall time that may be made up for. More survives longer stalls of the machine without losing
# time, but shows them as a longer burst of steps at full speed.
CATCH_UP_NS = 100 * MILLISECOND

# 146 years, in ns or in steps: what has a longer period does not happen. Counts up to here fit
# into 64 bits, while 1 / 5e-324 is beyond all numbers.
NEVER = 2 ** 62


class Lateness(NamedTuple):
    """How late the steps of one call to `start` were."""

    late_ns: int        # of the first of them; negative is early
    overruns: int       # how many of them were late by more than one tick


class Pacer:
    """Deadlines of steps of `step_ns` of simulation time at a real-time factor."""

    def __init__(self, step_ns: int, factor: float, now_ns: int) -> None:
        self._step_ns = step_ns
        self.steps = 0          # begun since the start
        self.overruns = 0
        self.dropped_ns = 0     # wall time given up because the debt was too large
        self.set_factor(factor, now_ns)

    def set_factor(self, factor: float, now_ns: int) -> None:
        """Change the pace from now on; 0 is as fast as possible."""
        self.factor = factor
        if factor:
            period_ns = self._step_ns / factor
            self._group = max(1, int(_LEAST_TICK_NS // period_ns))
            # Whole nanoseconds: the pace is off by less than 1e-6, as a crystal is.
            self.tick_ns = max(1, round(min(self._group * period_ns, NEVER)))
            self._most_ticks = max(1, CATCH_UP_NS // self.tick_ns)
        self.restart(now_ns)

    def restart(self, now_ns: int) -> None:
        """Forget every debt: the next group is due one tick from now."""
        self._origin_ns = now_ns
        self._done = 0          # steps since the origin

    def due(self, now_ns: int) -> int | None:
        """Return how many steps are due, or None for no limit."""
        if not self.factor:
            return None
        ticks = (now_ns - self._origin_ns) // self.tick_ns
        debt = ticks - self._done // self._group
        if debt > self._most_ticks:
            lost = (debt - self._most_ticks) * self.tick_ns
            self._origin_ns += lost
            self.dropped_ns += lost
            ticks -= debt - self._most_ticks
        return max(0, ticks * self._group - self._done)

    def wait_ns(self, now_ns: int) -> int:
        """Return the wall time until the next group is due; 0 if it is due already."""
        if not self.factor:
            return 0
        return max(0, self._deadline(self._done + 1) - now_ns)

    def start(self, count: int, now_ns: int) -> Lateness:
        """Note that `count` steps begin now."""
        self.steps += count
        if not self.factor:
            return Lateness(0, 0)
        late_ns = now_ns - self._deadline(self._done + 1)
        # Group k is an overrun if origin + (k + 1) * tick < now.
        groups = (now_ns - self._origin_ns - 1) // self.tick_ns - 1
        overruns = min(max(0, groups * self._group - self._done), count)
        self._done += count
        self.overruns += overruns
        return Lateness(late_ns, overruns)

    def _deadline(self, step: int) -> int:
        """Return the deadline of a step, counted from 1 at the origin."""
        return self._origin_ns + -(-step // self._group) * self.tick_ns
