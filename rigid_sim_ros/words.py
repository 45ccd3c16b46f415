# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names that somebody wrote: which of those that there are were chosen, or meant."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase

# [characters] of a word that is compared, which may be of any length.
_COMPARED = 60
# [words] A longer choice is cut.
_LISTED = 12


def matches(name: str, patterns: Iterable[str]) -> bool:
    """Return whether a name is one of those that patterns such as `arm_*` choose."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def matching(names: Iterable[str], patterns: Iterable[str]) -> list[str]:
    """Return the names that patterns choose, in their own order."""
    patterns = tuple(patterns)
    return [name for name in names if matches(name, patterns)]


def similar(word: object, known: Iterable[str]) -> str:
    """Ask whether the most similar of the known words was meant; '' where none is similar."""
    match = get_close_matches(str(word)[:_COMPARED], list(known), n=1, cutoff=0.5)
    return f"did you mean '{match[0]}'?" if match else ''


def nearest(word: object, known: Iterable[str]) -> str:
    """
    Write the mend for a word that is not known.

    Names the most similar of the known words, or lists them all when none is similar.
    """
    names = list(dict.fromkeys(known))
    if not names:
        return 'must go'
    meant = similar(word, names)
    if len(names) > _LISTED:
        names[_LISTED - 1:] = [f'one of {len(names) - _LISTED + 1} more']
    return meant or f'must be {either(names)}'


def either(words: Sequence[str]) -> str:
    """Write a choice: ``a``, ``a or b``, ``a, b or c``."""
    *head, last = words
    return f'{", ".join(head)} or {last}' if head else last
