# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The web page that shows and drives a simulation, or plays a bag.

Nothing here knows ROS: nodes/ brings in what a running simulation says, and takes out what the
page wants of it.
"""
from importlib.util import find_spec

NEEDED = ("the page needs viser: `pip install '.[view]'` in a clone of rigid_sim_ros, or "
          "`pip install 'viser>=1.1,<2'`")


def is_installed() -> bool:
    """Return whether what the page is made with is there; the modules of this package need it."""
    return find_spec('viser') is not None
