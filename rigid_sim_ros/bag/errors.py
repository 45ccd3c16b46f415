# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can be wrong with a bag."""

from rigid_sim_ros.problems import printable


class BagError(ValueError):
    """A bag that cannot be written, read or understood; the text says how to mend it."""

    def __init__(self, text: str) -> None:
        """Take the text, which may quote what stands in a file."""
        super().__init__(printable(text))


class Damaged(BagError):
    """A file of a bag whose bytes are not what was written."""
