# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How many examples the fuzzers try: `FUZZ_BUDGET=10 pytest -k fuzz` tries ten times as many."""

import os

_BUDGET = float(os.environ.get('FUZZ_BUDGET', '1'))


def examples(usual: int) -> int:
    """Return how many examples a test tries that usually tries so many."""
    return max(1, round(usual * _BUDGET))
