# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Take all figures of growth, start-up and the node again: `python benchmarks/budget.py`.

Writes the tables into docs/performance.md and the chart into docs/pictures/growth.png. Takes about
25 minutes, during which the machine should do nothing else.
"""

from pathlib import Path
import subprocess
import sys

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent / 'docs'
RUNS = (
    ('growth.py', '--chart', str(DOCS / 'pictures' / 'growth.png')),
    ('start_up.py',),
    ('node_speed.py',),
)


def main() -> int:
    """Run one after the other; return how many failed."""
    failed = 0
    for script, *options in RUNS:
        words = [sys.executable, str(HERE / script), *options, '--output',
                 str(DOCS / 'performance.md')]
        failed += subprocess.run(words, check=False).returncode != 0
    return failed


if __name__ == '__main__':
    sys.exit(main())
