# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""By what a reader knows that a text of a bag is the one that was written."""

import hashlib


def digest_of(text: str) -> str:
    """Return 16 letters that another text has with a chance of 2^-64."""
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
