# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Caches that lack some kernels, for tests of compiling."""

from pathlib import Path
import shutil

import rigid_sim_ros
from rigid_sim_ros.kernels.cache import cache_folder

_ROOT = Path(rigid_sim_ros.__file__).parent


def cache_without(folder: Path, *kernels: str) -> None:
    """Fill a folder for NUMBA_CACHE_DIR with all that this machine has compiled but `kernels`."""
    lacking = shutil.ignore_patterns('*.tmp.*', *(f'*.{name}-*' for name in kernels))
    for source in (_ROOT / 'engine').rglob('*.py'):
        module = '.'.join(('rigid_sim_ros', *source.relative_to(_ROOT).with_suffix('').parts))
        kept = cache_folder(module)
        if kept.is_dir():
            shutil.copytree(kept, folder / 'rigid_sim_ros' / 'kernels' / kept.name, ignore=lacking)
