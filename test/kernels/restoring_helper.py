# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A helper process that finds what it is to compile in another cache, the folder RESTORED_FROM.

In all else it is the helper of the package. What is not found for the types that it was told ends
it, with an exit code that is not 0: to compile these kernels takes half a minute. It begins when
there is a file RESTORED_AFTER, if that is set.
"""

import os
from pathlib import Path
import shutil
import time
from typing import Any

from numba.core import event

from rigid_sim_ros.kernels import helper_process


class _Refusal(event.Listener):
    """Ends the process when it compiles."""

    def on_start(self, event: Any) -> None:
        """End it."""
        os._exit(3)

    def on_end(self, event: Any) -> None:
        """Do nothing: it has ended."""


def _copy_missing(source: str, target: str) -> None:
    if not Path(target).exists():
        shutil.copy(source, target)


def main() -> None:
    """Bring back what is missing, and do what a helper does."""
    while not Path(os.environ.get('RESTORED_AFTER', '/')).exists():
        time.sleep(0.05)
    shutil.copytree(os.environ['RESTORED_FROM'], os.environ['NUMBA_CACHE_DIR'],
                    dirs_exist_ok=True, copy_function=_copy_missing)
    event.register('numba:compile', _Refusal())
    helper_process.main()


if __name__ == '__main__':
    main()
