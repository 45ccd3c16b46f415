# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a file or a command, or worth knowing of it: in words, on one line."""

import math
from typing import NamedTuple

# Characters of one line: what it quotes may be a name, or a list of numbers, of any length.
_BEGIN, _END = 600, 200
_CUT = ' [...] '

# [s] 127 years: the longest span of time that somebody may ask for. Stamps are the time of day
# plus such a span, in nanoseconds, which 64 bits hold until the year 2262.
LONGEST = 4e9


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


def counted(number: int, one: str, many: str = '') -> str:
    """Write a number and what there are so many of; `many` is `one` with an s by default."""
    return f'{number} {one if number == 1 else many or f"{one}s"}'


def span(text: str | float, *, may_be_zero: bool = False) -> float:
    """Return a span of time [s] that somebody asked for; ValueError where it makes no sense."""
    try:
        seconds = float(text)
    except ValueError:
        raise ValueError(f'{text!r} is not a number of seconds') from None
    least = '>= 0' if may_be_zero else '> 0'
    if not math.isfinite(seconds) or seconds < 0.0 or (seconds == 0.0 and not may_be_zero):
        raise ValueError(f'{text} s, must be {least} and finite')
    if seconds > LONGEST:
        raise ValueError(f'{text} s, must be at most {LONGEST:g} s')
    return seconds
