# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Let Numba remember what calls of its own functions return.

Of `a * b` Numba tries one definition after the other until one fits the types of a and b, for
every product in a program anew: twenty thousand times for the kernels of a scene, of which two
hundred differ. That was an eighth of the time to compile.
"""

from typing import Any

from numba import types


def remember_calls() -> None:
    """Find the type of a call of a function of Numba's, for arguments of some types, once."""
    kind: Any = types.Function
    find = kind.get_call_type

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws:
            return find(self, context, args, kws)
        # A definition that comes later makes another function type, which knows nothing yet.
        known = self.__dict__.setdefault('_known_calls', {})
        call = context, tuple(args)
        if call not in known:
            known[call] = find(self, context, args, kws)
        return known[call]

    kind.get_call_type = get_call_type
