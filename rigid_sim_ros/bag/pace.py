# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How far a session can have gone in a time.

A bag may come from anybody, and the number of a step in it may be any. No world is stepped through
years of simulation because of a number: the times of the messages bound what is worth it.
"""

# [steps/s] No world is stepped faster.
_FASTEST = 2e7
_SLACK = 100_000        # steps, for clocks that stand still


class Pace:
    """Compares how many steps a session went on with the time that its messages say passed."""

    def __init__(self, step_ns: int) -> None:
        """Begin at time 0 of the bag; `step_ns` is the step of the world [ns]."""
        self._step_ns = step_ns
        self._stepped_at = 0        # [ns] when ~/bag/step came last

    def note(self, stamp: int) -> None:
        """Note that ~/bag/step came at this time of the bag [ns]."""
        self._stepped_at = stamp

    def wrong(self, now: int, step: int, stamp: int) -> str:
        """Return what is wrong with going on from a step to another, '' if it can be."""
        elapsed = max(0, stamp - self._stepped_at)
        if step - now > _SLACK + elapsed * max(_FASTEST / 1e9, 1.0 / self._step_ns):
            return (f'the recording goes on to step {step}, {step - now} further, within '
                    f'{elapsed / 1e9:.3f} s')
        return ''
