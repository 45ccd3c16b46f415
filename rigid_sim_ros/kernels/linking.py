# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One piece of machine code for each kernel that Python calls, and none for the others.

Numba compiles every function into a library of its own. Machine code is generated for each, and
each is optimised once more inside of everything that calls it, directly or not. Of some 250
kernels of a scene with contacts Python calls seven. So a kernel has two forms here. As a `_Part`,
for kernels that call it, it is a module of LLVM's that is optimised function by function and then
only waits to be linked. As a `_Whole`, for Python, it is linked with all parts below it, optimised
at once, translated and cached. From an empty cache the first step of the scene `tower` takes 62 s
so in one process, and 200 s as Numba does it by itself, with the same results and speed.

With a Numba that is not supported kernels are compiled as Numba does by itself.
"""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
import gc
from typing import Any

from llvmlite import binding, ir
from numba.core import codegen, compiler, typed_passes, types, untyped_passes
from numba.core.typing.templates import make_concrete_template

from rigid_sim_ros.kernels.numba_target import OwnDispatcher
from rigid_sim_ros.kernels.tuple_passing import refuse_kept_tuples

_Library: Any = codegen.JITCodeLibrary
_NumbasCompiler: Any = compiler.CompilerBase
_typed: Any = typed_passes
_untyped: Any = untyped_passes

# What says of a function that a call of it stays a call.
STAYS_APART = 'stays_apart'


class _Part(_Library):
    """A library that nobody runs: it is only ever linked into others."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.below: dict[Any, None] = {}    # what it calls, in a fixed order
        self.stays_apart = False            # it is called where LLVM would put it in place

    def add_linking_library(self, library: Any) -> None:
        library._ensure_finalized()
        self.below[library] = None

    def add_ir_module(self, module: Any) -> None:
        for function in module.functions if self.stays_apart else ():
            if not function.is_declaration:
                function.attributes.add('noinline')
        super().add_ir_module(module)

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True

    def module(self) -> Any:
        """Return what is in this library alone, to be linked."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        # A library of Numba's own asks, which knows of no parts.
        module = self.module().clone()
        for library in _below(self.below):
            module.link_in(_module(library), preserve=True)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        return 0


class _Whole(_Library):
    """A library that Python calls, with all parts that it needs."""

    def finalize(self) -> None:
        self._linking_libraries: list[Any]
        for library in _below(self._linking_libraries):
            self._final_module.link_in(_module(library), preserve=True)
            if hasattr(self, '_reload_init'):   # not in early Numbas
                self._reload_init.update(library._reload_init)
        self._linking_libraries = []
        super().finalize()

    def serialize_using_object_code(self) -> Any:
        """
        Return what the cache keeps: machine code, and for LLVM no more than names.

        Numba adds the module that the code was made of, for others to link. To read that again
        took longer than to load the code, and nobody links what has parts.
        """
        name, kind, (code, _) = super().serialize_using_object_code()
        return name, kind, (code, _names_in(self._get_module_for_linking()))


def _names_in(module: Any) -> Any:
    """Return the bitcode of a module that defines the same names, and nothing behind them."""
    names: Any = ir.Module()
    names.triple = module.triple
    for function in module.functions:
        if not function.is_declaration:
            kind = ir.FunctionType(ir.VoidType(), ())
            body = ir.Function(names, kind, function.name).append_basic_block()
            ir.IRBuilder(body).unreachable()
    for variable in module.global_variables:
        if not variable.is_declaration:
            place = ir.GlobalVariable(names, ir.IntType(8), variable.name)
            place.initializer = ir.IntType(8)(0)
    return binding.parse_assembly(str(names)).as_bitcode()


def _below(libraries: Any) -> list[Any]:
    """
    Return these libraries and all that parts among them call, each once, callers first.

    LLVM leaves out what nobody calls so far.
    """
    seen, found = set(), []

    def visit(library: Any) -> None:
        if library in seen:
            return
        seen.add(library)
        for called in library.below if isinstance(library, _Part) else []:
            visit(called)
        found.append(library)

    for library in libraries:
        visit(library)
    return found[::-1]


def _module(library: Any) -> Any:
    return (library.module() if isinstance(library, _Part)
            else library._get_module_for_linking())


class _Inference(_typed.NopythonTypeInference):

    def run_pass(self, state: Any) -> bool:
        super().run_pass(state)
        refuse_kept_tuples(state.func_ir, state.typemap)
        return True


# What is done to a kernel, in order. Numba has more passes: for closures, arrays that an
# expression makes, loops over tuples, and references that end with the life of a variable.
_PASSES = tuple(kind() for kind in (
    _untyped.TranslateByteCode, _untyped.FixupArgs, _untyped.IRProcessing,
    _untyped.RewriteSemanticConstants, _untyped.DeadBranchPrune, _untyped.GenericRewrites,
    _untyped.RewriteDynamicRaises, _untyped.InlineInlinables, _untyped.DeadBranchPrune,
    _untyped.ReconstructSSA, _untyped.DeadBranchPrune,
    _Inference, _typed.PreLowerStripPhis, _typed.InlineOverloads,
    _typed.NoPythonSupportedFeatureValidation, _typed.NativeLowering, _typed.NoPythonBackend))


class _Pipeline:
    """Does to a kernel what it takes; Numba's own would look passes up in a registry."""

    pipeline_name = 'kernel'

    def __init__(self) -> None:
        self.exec_times: Any = {}

    def run(self, state: Any) -> None:
        for one in _PASSES:
            one.analysis = defaultdict(set)
            one.run_initialization(state)
            one.run_pass(state)
            one.run_finalizer(state)


# New objects after which Python's collector of cycles looks at them, 700 by itself: it stays on
# for other threads, but hardly ever runs while kernels are compiled.
_SELDOM = 10_000_000, 10, 10


@contextmanager
def _few_collections() -> Iterator[None]:
    """
    Let the collector of cycles run hardly ever until the end of the block.

    The compiler makes millions of objects and keeps most of them: to look through them again and
    again takes 1 s of 20 s of the first start of the scene `tower` on a calm machine, and 3 of 30
    s where others use the memory too.
    """
    usual = gc.get_threshold()
    if not 0 < usual[0] < _SELDOM[0]:   # it is off, or seldom already
        yield
        return
    gc.set_threshold(*_SELDOM)
    try:
        yield
    finally:
        if gc.get_threshold() == _SELDOM:   # nobody else has changed it
            gc.set_threshold(*usual)


class _Compiler(_NumbasCompiler):

    def compile_extra(self, function: Any) -> Any:
        # Only a process that compiles needs it.
        from rigid_sim_ros.kernels import array_entries     # noqa: F401
        with _few_collections():
            return super().compile_extra(function)

    def _library(self, kind: Any) -> Any:
        return kind(self.state.targetctx.codegen(), self.state.func_id.func_qualname)

    def define_pipelines(self) -> Any:
        return [_Pipeline()]


class _PartCompiler(_Compiler):

    def define_pipelines(self) -> Any:
        flags = self.state.flags
        flags.no_compile = flags.no_cpython_wrapper = True
        self.state.library = self._library(_Part)
        self.state.library.stays_apart = getattr(self.state.func_id.func, STAYS_APART, False)
        return super().define_pipelines()


class _WholeCompiler(_Compiler):

    def define_pipelines(self) -> Any:
        self.state.library = self._library(_Whole)
        self.state.library.enable_object_caching()
        return super().define_pipelines()


class Kernel(OwnDispatcher):
    """
    A kernel that Python calls as a whole, and kernels as a part.

    Numbers that a caller writes are numbers of a type, not constants: Numba would compile once
    more for each.
    """

    def __init__(self, function: Any, kinds: Any = None, options: Any = None) -> None:
        """Take a function, types of its variables, if any, and the options of `numba.njit`."""
        super().__init__(function, kinds or {}, options or {}, _WholeCompiler)
        self._parts: dict[Any, Any] = {}    # by the types of the arguments: key, signature

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return what tells a kernel that calls this one what it returns; compile it as a part."""
        own = self._compiler
        signature, folded = own.fold_argument_types(*without_literals(args, kws))
        arguments = tuple(folded)
        if arguments not in self._parts:
            as_part = type(own)(own.py_func, own.targetdescr, own.targetoptions, own.locals,
                                _PartCompiler)
            result = as_part.compile(arguments, None)
            key = object()
            self.targetctx.insert_user_function(key, result.fndesc, [result.library])
            self._parts[arguments] = key, result.signature
        name = own.py_func.__name__
        template = make_concrete_template(f'CallTemplate({name})', key=name,
                                          signatures=[self._parts[arguments][1]])
        return template, signature, arguments, {}

    def get_overload(self, signature: Any) -> Any:
        """Return by what a kernel that calls this one finds its part."""
        return self._parts[tuple(signature)][0]


def without_literals(args: Any, kws: Any) -> Any:
    """Return types of arguments, in order and by name, none of them that of a constant."""
    unliteral: Any = types.unliteral
    return (tuple(unliteral(arg) for arg in args),
            {name: unliteral(arg) for name, arg in kws.items()})
