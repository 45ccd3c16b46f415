# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a file, or worth knowing of it: with its place, on one line."""

from typing import NamedTuple

# Characters of one line: what it quotes may be a name, or a list of numbers, of any length.
_BEGIN, _END = 600, 200
_CUT = ' [...] '


class Problem(NamedTuple):
    """One remark on a scene or on a model; as text it is always one line."""

    message: str
    key: str = ''       # which value or element, such as `bodies[0].mass`
    file: str = ''
    line: int = 0       # 0: unknown

    def __str__(self) -> str:
        """Show 'FILE:LINE: bodies[0].mass: -2.0 kg, must be > 0'."""
        place = f'{self.file}:{self.line}' if self.line else self.file
        return printable(': '.join(part for part in (place, self.key, self.message) if part))


def printable(text: str) -> str:
    """
    Write what cannot be printed as Python does.

    Files and names may come from strangers: a line break would begin a line that nobody wrote, and
    other characters move a cursor or turn the direction of writing. The middle of what is far too
    long for a line is left out.
    """
    if len(text) > _BEGIN + len(_CUT) + _END:
        text = text[:_BEGIN] + _CUT + text[-_END:]
    return ''.join(c if c.isprintable() else repr(c)[1:-1] for c in text)
