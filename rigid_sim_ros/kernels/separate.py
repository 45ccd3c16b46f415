# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Kernels that other kernels call by address, so that two processes can compile them.

To compile the kernels of a step takes half a minute, and Numba uses one core. So the largest
pieces of a step are compiled apart: each is called, with the step's argument pack and a number,
through a place in memory that holds its address. Before the first step, and as soon as a scene is
built, a helper, a process of its own, compiles some of them into the cache while this process
compiles the rest, which then loads what it finds there. Nothing rests on the helper: what the
cache does not hold when it ends, however it ends, is compiled here.

A piece that a world hardly ever calls need not be there when it begins to step: the helper goes on
with it, and a world that calls it sooner waits.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import threading
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import make_concrete_template

from rigid_sim_ros.kernels import helper_process
from rigid_sim_ros.kernels.argument_pack import ArgumentPack, PackType
from rigid_sim_ros.kernels.helper_process import HelperProcess
from rigid_sim_ros.kernels.kernel import Function, kernel
from rigid_sim_ros.kernels.linking import without_literals
from rigid_sim_ros.kernels.numba_target import intrinsic
from rigid_sim_ros.kernels.symbols import declare

NO_NUMBER = 0  # what a piece is called with that does not ask for a number
_INTEGER = ir.IntType(64)
_template: Any = make_concrete_template
_lock = threading.Lock()
_begun: list[HelperProcess] = []      # a helper that nobody has waited for yet
_behind: list[HelperProcess] = []     # helpers with pieces that worlds step without


def by_address(function: Function) -> Function:
    """
    Compile like `kernel` what other kernels call by its address.

    It takes an argument pack and an int, and returns an int. Before a kernel that calls it runs,
    `link` has to be called for the pack.
    """
    compiled: Any = kernel(function)
    keys: dict[Any, Any] = {}       # of the calls, by the types of the arguments

    def get_call_template(args: Any, kws: Any) -> Any:
        signature, folded = compiled._compiler.fold_argument_types(*without_literals(args, kws))
        arguments = tuple(folded)
        if arguments not in keys:
            keys[arguments] = object()
            compiled.targetctx.insert_func_defn(
                [(_call_of(compiled), keys[arguments], arguments)])
        template = _template(f'CallTemplate({function.__name__})', key=keys[arguments],
                             signatures=[types.int64(*arguments)])
        return template, signature, arguments, {}

    compiled.get_call_template = get_call_template
    compiled.get_overload = lambda arguments: keys[tuple(arguments)]
    return compiled


def symbol_of(piece: Any, pack: PackType) -> str:
    """Return the name of the place that holds the address of a piece."""
    return f'{piece.py_func.__module__}.{piece.py_func.__qualname__}.{pack.name}'


def _load_address(builder: Any, piece: Any, pack: PackType) -> Any:
    symbol = symbol_of(piece, pack)
    declare(symbol)
    if symbol not in builder.module.globals:
        ir.GlobalVariable(builder.module, _INTEGER, symbol)
    return builder.load(builder.module.globals[symbol])


def _call_of(piece: Any) -> Any:
    def call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _load_address(builder, piece, signature.args[0])
        return _called(context, builder, address, signature.args, arguments)
    return call


def _called(context: Any, builder: Any, address: Any, kinds: Any, arguments: Any) -> Any:
    """Return what the function at an address returns, an int."""
    convention = context.call_conv
    callee = builder.inttoptr(address, convention.get_function_type(
        types.int64, kinds).as_pointer())
    status, value = convention.call_function(builder, callee, types.int64, kinds, arguments)
    with cgutils.if_unlikely(builder, status.is_error):
        convention.return_status_propagate(builder, status)
    return value


@intrinsic
def address_of(context: Any, piece: Any, pack: Any) -> Any:
    """Return the address of a separate piece for a pack, 0 if it is not there yet."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _load_address(builder, piece.dispatcher, pack)
    return types.int64(piece, pack), build


@intrinsic
def call_at(context: Any, address: Any, pack: Any, number: Any) -> Any:
    """Return what the piece at an address returns for a pack and a number: an int."""
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _called(context, builder, arguments[0], signature.args[1:], arguments[1:])
    return types.int64(address, pack, types.int64), build


class Pieces(NamedTuple):
    """The separate pieces that the kernels of a step call."""

    here: Sequence[Any]  # compiled by this process
    helped: Sequence[Any]  # by a helper, meanwhile
    late: Sequence[Any] = ()  # by a helper, and nobody waits for them
    unused: Sequence[Any] = ()  # never called in this world

    def symbols(self, pack: PackType) -> list[str]:
        """Return the names of the places that hold their addresses."""
        return [symbol_of(piece, pack) for pieces in self for piece in pieces]


def link(caller: Any, pack: ArgumentPack, pieces: Pieces, numbers: int = 1) -> None:
    """
    Compile a kernel of a pack and some ints, or find it in the cache, and what it calls apart.

    `late` pieces are not there as long as a helper goes on with them; see `link_late`.
    """
    kinds = pack.type, types.int64
    symbols = pieces.symbols(pack.type)
    for symbol in symbols:
        declare(symbol)
    with _lock:
        missing, later = ([piece for piece in some if not _is_cached(piece, kinds)
                           and not _who_goes_on(piece, kinds)]
                          for some in (pieces.helped, pieces.late))
        with _helped(missing, later, kinds, symbols):
            _compile(caller, (pack.type, *[types.int64] * numbers))
            for one in pieces.here:
                _compile(one, kinds)
        for piece in (*pieces.here, *pieces.helped, *pieces.late):
            if piece not in pieces.late or not _who_goes_on(piece, kinds):
                _link(piece, kinds)
    pack.is_linked = True


def link_late(piece: Any, pack: ArgumentPack) -> None:
    """Wait for a piece that `link` did not wait for."""
    with _lock:
        _link(piece, (pack.type, types.int64))


def finish() -> None:
    """Wait until no helper goes on with anything: the next process finds all in the cache."""
    with _lock:
        for helper in _behind:
            helper.stop(helper_process.PATIENCE)


def begin(pieces: Pieces, pack: ArgumentPack) -> None:
    """Let a helper begin with its pieces now, for `link` to wait for it."""
    kinds = pack.type, types.int64
    with _lock:
        missing = [piece for piece in pieces.helped if not _is_cached(piece, kinds)]
        if missing and not _begun and (helper := helper_process.start()) is not None:
            helper.give(missing, kinds, pieces.symbols(pack.type))
            _begun.append(helper)


def _compile(one: Any, kinds: Any) -> None:
    """Compile a kernel, or load it, unless it is there: Numba takes 12 us to see that it is."""
    if kinds not in one.overloads:
        one.compile(kinds)


def _link(piece: Any, kinds: Any) -> None:
    """Write the address of a piece to its place."""
    for helper in _who_goes_on(piece, kinds):
        helper.wait(len(helper.given))
    _compile(piece, kinds)
    compiled = piece.overloads[kinds]
    unliteral: Any = types.unliteral
    if unliteral(compiled.signature.return_type) != types.int64:
        raise AssertionError(f'{piece.__name__} returns {compiled.signature.return_type}, no int')
    address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    if address == 0:
        raise AssertionError(f'{piece.__name__} has no machine code')
    declare(symbol_of(piece, kinds[0])).value = address


def _who_goes_on(piece: Any, kinds: Any) -> list[Any]:
    """Return helpers that nobody waited for, and that have not ended, if they have this piece."""
    _behind[:] = [helper for helper in _behind if helper.process.poll() is None]
    return [helper for helper in _behind if (piece, kinds) in helper.later]


def _is_cached(piece: Any, arguments: Any) -> bool:
    """Return whether a kernel need not be compiled, as far as the list of the cache tells."""
    if arguments in piece.overloads:
        return True
    try:
        key = piece._cache._index_key(arguments, piece.targetctx.codegen())
        return key in piece._cache._cache_file._load_index()
    except (AttributeError, OSError):   # another Numba, or a cache that cannot be read
        return True


@contextmanager
def _helped(missing: Sequence[Any], later: Sequence[Any], kinds: Any,
            symbols: Sequence[str]) -> Iterator[None]:
    """Let a helper compile some kernels meanwhile; wait for it in the end, but not for `later`."""
    helper = _begun.pop() if _begun else helper_process.start() if missing or later else None
    if helper is None:
        yield
        return
    helper.give(missing, kinds, symbols)
    awaited = len(helper.given)
    helper.give(later, kinds, symbols)
    patience = 0.0
    try:
        yield
        if helper.wait(awaited):
            helper.go_on(later, kinds)
            patience = helper_process.PATIENCE
            if later:
                _behind.append(helper)
    finally:
        if helper not in _behind:
            helper.stop(patience)
