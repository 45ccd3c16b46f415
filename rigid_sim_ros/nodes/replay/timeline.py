# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
When a message is due: times of the bag on the steady wall clock.

    due(t) = wall + (t - bag) / rate        (wall, bag): one pair of times that belong together

The pair stays until somebody pauses, seeks or sets the rate, so a late wake-up does not make
later messages late.
"""

_NEVER = 2 ** 63


class Timeline:
    """The time of a bag as it passes."""

    def __init__(self, rate: float) -> None:
        """Stand still at time 0."""
        self.rate = rate
        self.is_running = False
        self._bag_ns = 0
        self._wall_ns = 0

    def at(self, wall_ns: int) -> int:
        """Return the time of the bag at a time of the wall clock."""
        if not self.is_running:
            return self._bag_ns
        return self._bag_ns + int((wall_ns - self._wall_ns) * self.rate)

    def due(self, bag_ns: int) -> int:
        """Return the wall time at which a time of the bag comes; far away while it stands."""
        if not self.is_running:
            return _NEVER
        # Rounded up: at that time `at` has reached it.
        return self._wall_ns - int((self._bag_ns - bag_ns) / self.rate // 1)

    def jump(self, bag_ns: int, wall_ns: int) -> None:
        """Be at a time of the bag; a wall time in the future waits for it."""
        self._bag_ns, self._wall_ns = bag_ns, wall_ns

    def set_rate(self, rate: float, wall_ns: int) -> None:
        """Pass faster or slower from now on."""
        self.jump(self.at(wall_ns), wall_ns)
        self.rate = rate

    def run(self, wall_ns: int) -> None:
        """Go on from where it stands."""
        self._wall_ns = wall_ns
        self.is_running = True

    def stop(self, wall_ns: int) -> None:
        """Stand still."""
        self.jump(self.at(wall_ns), wall_ns)
        self.is_running = False

    def limit_delay(self, bag_ns: int, wall_ns: int, most_ns: int) -> int:
        """
        Shift the timeline so that a time of the bag is overdue by no more than this.

        Return the wall time that was given up by that.
        """
        given_up = max(0, wall_ns - self.due(bag_ns) - most_ns)
        self._wall_ns += given_up
        return given_up
