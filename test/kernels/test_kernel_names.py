# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Machine code of several processes meets in one: each kernel needs a name of its own."""

from collections import Counter
import gc

from numba.core.dispatcher import Dispatcher

from rigid_sim_ros.engine.dynamics import forces
from rigid_sim_ros.engine.steps import contact_models


def test_no_two_kernels_of_a_module_have_the_same_name():
    assert contact_models and forces    # all kernels are made when these are imported
    gc.unfreeze()   # conftest.py hides what was there when the tests were collected
    kernels = {id(found.py_func): found.py_func for found in gc.get_objects()
               if issubclass(type(found), Dispatcher)      # isinstance would ask dead proxies
               and found.py_func.__module__.startswith('rigid_sim_ros.')}
    names = Counter((f.__module__, f.__qualname__) for f in kernels.values())
    assert len(names) > 100
    assert [name for name, count in names.items() if count > 1] == []
