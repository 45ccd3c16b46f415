# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
No tuple in memory is asked for after the line that made it has made the next.

`tuple_passing.py` gives each place of a kernel that makes a tuple, by its constructor or by a
call, room for one. A loop that makes one each time around may use it until it comes there again.
What lasts from one time around to the next meets, where the loop begins, what came before it: in
the form in which Numba names each value once, that is a choice between both (a phi) at its head.
So a kernel is refused that has one there which is a tuple in memory.
"""

from typing import Any

from numba.core import analysis, errors, ir
from numba.core.compiler_machinery import AnalysisPass, register_pass

from rigid_sim_ros.kernels.tuple_passing import is_in_memory

_analysis: Any = analysis
_errors: Any = errors
_ir: Any = ir
_AnalysisPass: Any = AnalysisPass
_register: Any = register_pass
AFTER = 'nopython_type_inference'   # the pass that finds the types


@_register(mutates_CFG=False, analysis_only=True)
class TupleLifetimes(_AnalysisPass):
    """Refuse a kernel that keeps a tuple for the next time around a loop."""

    _name = 'tuple_lifetimes'

    def __init__(self) -> None:
        _AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Look through a kernel whose types are known; return that nothing was changed."""
        blocks = state.func_ir.blocks
        chosen = {label: names for label, block in blocks.items()
                  if (names := _chosen(block, state.typemap))}
        if chosen:
            loops = _analysis.compute_cfg_from_blocks(blocks).loops().values()
            for label in {loop.header for loop in loops} & set(chosen):
                raise _errors.UnsupportedError(
                    f'{chosen[label][0]} is a tuple with arrays, kept for the next time around a '
                    f'loop, which makes it anew in the same place: keep its arrays',
                    loc=blocks[label].loc)
        return False


def _chosen(block: Any, kinds: Any) -> list[str]:
    """Return the names of the tuples in memory that are one of several."""
    return [one.target.name for one in block.find_insts(_ir.Assign)
            if getattr(one.value, 'op', '') == 'phi' and is_in_memory(kinds[one.target.name])]
