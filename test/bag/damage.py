# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Damage to the bytes of bags, as properties draw it."""

from collections.abc import Callable
from pathlib import Path

from hypothesis import strategies as st

DAMAGES: dict[str, Callable[[bytearray, int, int], None]] = {
    'truncated': lambda raw, at, _: raw.__delitem__(slice(at, None)),
    'zeroed': lambda raw, at, size: raw.__setitem__(
        slice(at, at + size), bytes(len(raw[at:at + size]))),
    'flipped': lambda raw, at, size: raw.__setitem__(at, raw[at] ^ (1 << size % 8)),
    'a hole': lambda raw, at, size: raw.__delitem__(slice(at, at + size)),
    'doubled': lambda raw, at, size: raw.__setitem__(slice(at, at), raw[at:at + size]),
    'garbage': lambda raw, at, size: raw.__setitem__(
        slice(at, at + size), bytes((k * 197 + at) % 256 for k in range(size))),
}

damages = st.tuples(st.sampled_from(sorted(DAMAGES)), st.floats(0, 1, exclude_max=True),
                    st.integers(1, 300), st.integers(0, 10))


def spoil(bag: Path, suffix: str, damage: tuple[str, float, int, int]) -> bool:
    """Damage one file of a bag; return whether that changed anything."""
    kind, place, size, which = damage
    files = sorted(bag.glob(f'*{suffix}'))
    path = files[which % len(files)]
    raw = bytearray(path.read_bytes())
    before = bytes(raw)
    # Half of the places lie near the ends, where index and header are.
    at = int(place * len(raw)) if size % 2 else int((place - 0.5) * 4000) % len(raw)
    DAMAGES[kind](raw, at, size)
    path.write_bytes(raw)
    return bytes(raw) != before
