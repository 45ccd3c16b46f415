# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What tells the types of arguments apart, in this process and in those that come later."""

from typing import Any

from numba import types

_Tuple: Any = types.BaseTuple
_NamedTuple: Any = types.BaseNamedTuple


def description(kind: Any) -> str:
    """
    Return a text that two types share only if a kernel for one can take values of the other.

    The name that Numba gives to the type of a NamedTuple tells no names of its fields: machine
    code for a class whose fields stood in another order once would read another field.
    """
    if isinstance(kind, _NamedTuple):
        own = kind.instance_class
        members = (f'{name}: {description(member)}'
                   for name, member in zip(kind.fields, kind, strict=True))
        return f'{own.__module__}.{own.__qualname__}({", ".join(members)})'
    if isinstance(kind, _Tuple):
        return f'({", ".join(map(description, kind))})'
    return str(kind)
