# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A second thread that takes over one of two halves of a stage.

Who steps the world puts a piece of work in a job slot: the address of a kernel, its argument pack
and a number. Then it does the other half itself. What nobody has taken meanwhile it takes back, so
that nothing waits for a thread that sleeps or has ended, and the results are those of one thread:
both halves are done, whoever does them. What was taken is waited for: kernels raise no errors.

The second thread looks at the job slot all the time while the world is stepped, for a wake-up
takes longer than most stages, and sleeps when there was nothing to do for a millisecond.
"""

import platform
import threading
from typing import Any
import weakref

from llvmlite import ir
from numba import types
from numba.core import cgutils

from rigid_sim_ros.kernels.arrays import IntArray, integers
from rigid_sim_ros.kernels.bits import place
from rigid_sim_ros.kernels.kernel import apart, kernel
from rigid_sim_ros.kernels.numba_target import intrinsic
from rigid_sim_ros.kernels.separate import call_at

# Places in a job slot. In one cache line, which goes from core to core as a whole: how the work
# stands, and what it is. In lines of their own, for one thread writes what the other one reads:
# whether somebody looks, whether there will be more, and how much was taken.
_STATE, _ADDRESS, _PACK, _NUMBER, _PRESENT, _AWAITED, _TAKEN_SO_FAR, _SIZE = (
    0, 1, 2, 3, 8, 16, 24, 32)
_FREE, _OFFERED, _TAKEN, _DONE = range(4)
# Looks at an empty job slot before the helper sleeps: about a millisecond.
PATIENCE = 100_000
_INTEGER = ir.IntType(64)
_PAUSES = platform.machine() in ('x86_64', 'AMD64')


def make_job() -> IntArray:
    """Return an empty job slot at which nobody looks."""
    return integers(_SIZE)


@intrinsic
def read_acquire(context: Any, job: Any, at: Any) -> Any:
    """Return an entry, and see all that was written before it was."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        entry = place(builder, arguments)
        return builder.load_atomic(entry, 'acquire', 8)
    return types.int64(job, types.int64), build


@intrinsic
def write_release(context: Any, job: Any, at: Any, value: Any) -> Any:
    """Write an entry, after all that was written before."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        entry = place(builder, arguments)
        builder.store_atomic(arguments[2], entry, 'release', 8)
        return context.get_dummy_value()
    return types.void(job, types.int64, types.int64), build


@intrinsic
def _replace(context: Any, job: Any, at: Any, old: Any, new: Any) -> Any:
    """Write `new` where `old` stands; return whether it stood there."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        entry = place(builder, arguments)
        both = builder.cmpxchg(entry, arguments[2], arguments[3], 'acq_rel', 'acquire')
        return builder.extract_value(both, 1)
    return types.boolean(job, types.int64, types.int64, types.int64), build


@intrinsic
def _pause(context: Any) -> Any:
    """Tell the processor that this is a loop that waits."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if _PAUSES:
            builder.call(cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(ir.VoidType(), []), 'llvm.x86.sse2.pause'), [])
        return context.get_dummy_value()
    return types.void(), build


@intrinsic
def _address_of(context: Any, pack: Any) -> Any:
    """Return where a pack lies, as a number."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ptrtoint(arguments[0], _INTEGER)
    return types.int64(pack), build


@intrinsic
def _pack_at(context: Any, address: Any) -> Any:
    """Return a pack of any kind from a number."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())
    return types.voidptr(types.int64), build


@kernel
def is_helped(job: IntArray) -> bool:
    """Return whether somebody looks at a job slot."""
    return read_acquire(job, _PRESENT) == 1


@apart
def side_by_side(job: IntArray, address: int, pack: Any, here: int, there: int) -> None:
    """Call a kernel with two numbers: here and, if somebody helps, in another thread."""
    if not is_helped(job):
        call_at(address, pack, here)
        call_at(address, pack, there)
        return
    job[_ADDRESS], job[_PACK], job[_NUMBER] = address, _address_of(pack), there
    write_release(job, _STATE, _OFFERED)
    call_at(address, pack, here)
    # First by a look, which does not take the line from the other core.
    if read_acquire(job, _STATE) == _OFFERED and _replace(job, _STATE, _OFFERED, _FREE):
        call_at(address, pack, there)
        return
    while read_acquire(job, _STATE) != _DONE:
        _pause()


@kernel
def _assist(job: IntArray, patience: int) -> None:
    """Take what is offered, until nothing was for a while and nothing is to come."""
    idle = 0
    write_release(job, _PRESENT, 1)
    while idle < patience:
        if read_acquire(job, _STATE) == _OFFERED and _replace(job, _STATE, _OFFERED, _TAKEN):
            call_at(job[_ADDRESS], _pack_at(job[_PACK]), job[_NUMBER])
            job[_TAKEN_SO_FAR] += 1
            write_release(job, _STATE, _DONE)
            idle = 0
        else:
            _pause()
            idle = 0 if read_acquire(job, _AWAITED) == 1 else idle + 1
    write_release(job, _PRESENT, 0)


class Helper:
    """A thread that works on what is in a job slot, until the helper is no longer needed."""

    def __init__(self) -> None:
        """Start it; it sleeps until it is woken."""
        self.job = make_job()
        self._wanted = threading.Event()
        ended = threading.Event()
        threading.Thread(target=_work, args=(self.job, self._wanted, ended), daemon=True,
                         name='helper').start()
        weakref.finalize(self, _end, self.job, self._wanted, ended)

    @property
    def done(self) -> int:
        """How many halves it has taken over."""
        return int(self.job[_TAKEN_SO_FAR])

    def __enter__(self) -> 'Helper':
        """Let it look at the job slot until the end of the block, and a while longer."""
        if self.job[_PRESENT] == 0:
            self._wanted.set()
        self.job[_AWAITED] = 1
        return self

    def __exit__(self, *_: object) -> None:
        self.job[_AWAITED] = 0


def _work(job: IntArray, wanted: threading.Event, ended: threading.Event) -> None:
    while not ended.is_set():
        wanted.wait()
        wanted.clear()
        _assist(job, PATIENCE)
        # Who came while the helper turned away believed that it was there.
        while job[_AWAITED] == 1:
            _assist(job, PATIENCE)


def _end(job: IntArray, wanted: threading.Event, ended: threading.Event) -> None:
    job[_AWAITED] = 0
    ended.set()
    wanted.set()
