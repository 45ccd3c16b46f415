# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which software moves a world: what the bits of its motion depend on."""

from functools import cache
from hashlib import blake2b
from pathlib import Path

from rigid_sim_ros import __version__

# Parts of the package in which a change may move bodies by other bits.
_PARTS = ('engine', 'kernels', 'scene', 'world')


@cache
def source_digest() -> str:
    """Return a digest of the source of all that moves bodies: other source, other bits."""
    package, digest = Path(__file__).parents[1], blake2b(digest_size=4)
    for part in _PARTS:
        for path in sorted((package / part).rglob('*.py')):
            digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def version() -> str:
    """Return the version of this package and the digest of its source, as one name."""
    return f'{__version__} ({source_digest()})'
