# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What messages/decode.py has, for messages in a bag: bytes that are no message are damage."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from rigid_sim_ros.bag.errors import Damaged
from rigid_sim_ros.messages import decode

_P = ParamSpec('_P')
_T = TypeVar('_T')


def _in_a_bag(read: Callable[_P, _T]) -> Callable[_P, _T]:
    @wraps(read)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        try:
            return read(*args, **kwargs)
        except decode.Malformed as error:
            raise Damaged(str(error)) from None
    return checked


byte_array = _in_a_bag(decode.byte_array)
joint_state = _in_a_bag(decode.joint_state)
multi_dof_state = _in_a_bag(decode.multi_dof_state)
string = _in_a_bag(decode.string)
uint64 = _in_a_bag(decode.uint64)
wrench = _in_a_bag(decode.wrench)
