# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers and words of a model's file, each with its limits and its mend."""

import math

from rigid_sim_ros.models.findings import Findings
from rigid_sim_ros.models.xml_tree import Element
from rigid_sim_ros.words import nearest

# Largest number that a file may hold: nobody means more, and products of a few do not overflow.
MOST = 1e30
_SHOWN = 40
# Why a known element has no effect.
_WHY = dict.fromkeys(('contact', 'surface'), 'materials are those of the scene') | dict.fromkeys(
    ('gravity', 'kinematic', 'velocity_decay', 'self_collide'), 'it is for Gazebo')


def number(text: str, element: Element, key: str, findings: Findings, default: float = 0.0, *,
           above: float = -math.inf, least: float = -math.inf) -> float:
    """Return a number, or report what is none and return the default."""
    try:
        value = float(text)
    except ValueError:
        findings.error(element, f'{key} {_shown(text)}, must be a number')
        return default
    if not abs(value) <= MOST:
        findings.error(element, f'{key} {_shown(text)}, must be finite and at most {MOST:g}')
    elif value <= above:
        findings.error(element, f'{key} {_shown(text)}, must be > {above:g}')
    elif value < least:
        findings.error(element, f'{key} {_shown(text)}, must be >= {least:g}')
    else:
        return value
    return default


def attribute(element: Element, key: str, findings: Findings, default: float | None = None, *,
              above: float = -math.inf, least: float = -math.inf) -> float:
    """Return the number in an attribute; without a default it must be there."""
    text = element.attributes.get(key)
    if text is None:
        if default is None:
            findings.error(element, f'{key} is missing, must be a number')
        return default or 0.0
    return number(text, element, key, findings, default or 0.0, above=above, least=least)


def several(text: str, count: int, element: Element, key: str, findings: Findings,
            default: tuple[float, ...], *, above: float = -math.inf) -> tuple[float, ...]:
    """Return numbers with spaces between them, or report what is not that and give the default."""
    words = text.split()
    if len(words) != count:
        findings.error(element, f'{key} {_shown(text)}, must be {count} numbers with spaces '
                       'between them')
        return default
    return tuple(number(word, element, key, findings, default[i], above=above)
                 for i, word in enumerate(words))


def vector(element: Element | None, key: str, findings: Findings,
           default: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, float, float]:
    """Return three numbers of an attribute, the default without it."""
    if element is None or key not in element.attributes:
        return default
    x, y, z = several(element.attributes[key], 3, element, key, findings, default)
    return x, y, z


def flag(text: str, element: Element, key: str, findings: Findings) -> bool:
    """Return a truth value."""
    word = text.strip().lower()
    if word not in ('true', '1', 'false', '0'):
        findings.error(element, f'{key} {_shown(text)}, must be true or false')
    return word in ('true', '1')


def check_children(element: Element, known: tuple[str, ...], ignored: tuple[str, ...],
                   findings: Findings, *, is_physics: bool) -> None:
    """
    Report the children of an element that nobody knows.

    Where physics are written such a child is an error: it may be a slip of the pen that changes
    them. Elsewhere, and for those that are known to have no effect here, it is ignored, and so is
    one with a prefix, such as <gz:policies>: it is for who has the prefix.
    """
    for child in element.children:
        if child.tag in known:
            continue
        is_custom = ':' in child.tag and not child.tag.startswith('xacro:')
        if child.tag in ignored or not is_physics or is_custom:
            findings.ignore(child, f'<{child.tag[:_SHOWN]}>', _WHY.get(child.tag, ''))
        else:
            findings.error(child, f'is not known in <{element.tag}>, {nearest(child.tag, known)}')


def check_attributes(element: Element, known: tuple[str, ...], ignored: tuple[str, ...],
                     findings: Findings) -> None:
    """Report the attributes of an element that nobody knows: they may change its physics."""
    for key in element.attributes:
        if key in known or ':' in key:
            continue
        if key in ignored:
            findings.ignore(element, f'{key} of <{element.tag}>')
        else:
            findings.error(element, f'attribute {_shown(key)} is not known, {nearest(key, known)}')


def _shown(text: str) -> str:
    shown = repr(text)
    return shown if len(shown) <= _SHOWN else f'{shown[:_SHOWN - 4]}...{shown[-1]}'
