# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can be wrong with a bag."""


class BagError(ValueError):
    """A bag that cannot be written, read or understood; the text says how to mend it."""


class Damaged(BagError):
    """A file of a bag whose bytes are not what was written."""
