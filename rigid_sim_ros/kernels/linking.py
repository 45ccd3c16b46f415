# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One piece of machine code for each kernel that Python calls, and none for the others.

Numba compiles every function into a library of its own. Machine code is generated for each, and
each is optimised once more inside of everything that calls it, directly or not. Of some 250
kernels of a scene with contacts Python calls seven. So a kernel has two forms here. As a `_Part`,
for kernels that call it, it is a module of LLVM's that is optimised function by function and then
only waits to be linked. As a `_Whole`, for Python, it is linked with all parts below it, optimised
at once, translated and cached. That halves the time to compile, with the same results and speed.

Where Numba lacks one of the names that this takes, kernels are compiled as Numba does by itself.
"""

from typing import Any

from llvmlite import binding, ir
from numba.core import cgutils, codegen, compiler, types
from numba.core.typing.templates import make_concrete_template

from rigid_sim_ros.kernels.compiler_setup import set_up_compiler
from rigid_sim_ros.kernels.tuple_lifetimes import AFTER, TupleLifetimes

_Library: Any = codegen.JITCodeLibrary
_Flags: Any = compiler.Flags
_NumbasCompiler: Any = compiler.Compiler

# What says of a function that a call of it stays a call.
STAYS_APART = 'stays_apart'
# Whether this Numba has what is overridden and called here.
SUPPORTED = (
    all(hasattr(_Library, name) for name in (
        '_ensure_finalized', '_finalize_dynamic_globals', '_get_module_for_linking',
        '_raise_if_finalized', 'add_ir_module', 'add_linking_library', 'enable_object_caching',
        'finalize', 'get_pointer_to_function', 'serialize_using_object_code'))
    and all(name in _Flags.options for name in ('no_compile', 'no_cpython_wrapper')))


class _Part(_Library):
    """A library that nobody runs: it is only ever linked into others."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.below: dict[Any, None] = {}    # what it calls, in a fixed order
        self.stays_apart = False            # it is called where LLVM would put it in place
        self.succeeds = True                # it returns no error

    def add_linking_library(self, library: Any) -> None:
        library._ensure_finalized()
        self.below[library] = None

    def add_ir_module(self, module: Any) -> None:
        for function in module.functions if self.stays_apart else ():
            if not function.is_declaration:
                function.attributes.add('noinline')
        self.succeeds = self.succeeds and not any(map(_may_fail, module.functions))
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


def _may_fail(function: Any) -> bool:
    """Return whether a function may return another number than 0, which says that all is well."""
    ends = [block.terminator for block in function.blocks]
    return any(end.opname == 'ret' and not _is_success(end.operands) for end in ends)


def _is_success(returned: Any) -> bool:
    return all(isinstance(one, ir.Constant) and one.constant == 0 for one in returned)


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


class _QuickFlags(_Flags):
    """Options that are told apart a million times while a scene's kernels are compiled."""

    _DEFAULTS = _Flags().values()
    _HASH = hash(_Flags())  # of the names alone

    def values(self) -> dict[str, Any]:
        return {**self._DEFAULTS, **self._values}

    def __hash__(self) -> int:
        return self._HASH


# Passes for what kernels do not have: closures, arrays that an expression makes, and references
# that end with the life of a variable.
_NEEDLESS = ('inline_closure_likes', 'nopython_rewrites', 'ir_legalization')


def _passes(known: Any) -> Any:
    """Return what takes the place of a pass."""
    name = getattr(known[0], '_name', '')
    if name in _NEEDLESS:
        return ()
    return (known, (TupleLifetimes, 'lifetimes of tuples')) if name == AFTER else (known,)


class _Compiler(_NumbasCompiler):

    def __init__(self, *arguments: Any) -> None:
        set_up_compiler()
        super().__init__(*arguments)
        self.state.flags = _QuickFlags(self.state.flags)

    def _library(self, kind: Any) -> Any:
        return kind(self.state.targetctx.codegen(), self.state.func_id.func_qualname)

    def define_pipelines(self) -> Any:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            # Between two passes Numba looks for variables that a pass left behind, which takes as
            # long as the passes themselves.
            pipeline._ENFORCING = False
            pipeline.passes = [one for known in pipeline.passes for one in _passes(known)]
        return pipelines


class _PartCompiler(_Compiler):

    def define_pipelines(self) -> Any:
        flags = self.state.flags
        flags.no_compile = flags.no_cpython_wrapper = True
        self.state.library = self._library(_Part)
        self.state.library.stays_apart = getattr(self.state.func_id.func, STAYS_APART, False)
        return super().define_pipelines()


class WholeCompiler(_Compiler):
    """Numba's compiler for a kernel that Python calls."""

    def define_pipelines(self) -> Any:
        """Return Numba's own passes, with a library that links parts."""
        self.state.library = self._library(_Whole)
        self.state.library.enable_object_caching()
        return super().define_pipelines()


def called_as_part(compiled: Any) -> Any:
    """
    Let kernels that call this one, compiled with `WholeCompiler`, take its parts; return it.

    Numbers that a caller writes are numbers of a type, not constants: Numba would compile once
    more for each.
    """
    own = compiled._compiler
    name = own.py_func.__name__
    parts: dict[Any, Any] = {}      # by the types of the arguments: key of the part, signature

    def get_call_template(args: Any, kws: Any) -> Any:
        signature, folded = own.fold_argument_types(*without_literals(args, kws))
        arguments = tuple(folded)
        if arguments not in parts:
            as_part = type(own)(own.py_func, own.targetdescr, own.targetoptions, own.locals,
                                _PartCompiler)
            result = as_part.compile(arguments, None)
            key = object()
            _make_callable(compiled.targetctx, key, result)
            parts[arguments] = key, result.signature
        template = make_concrete_template(f'CallTemplate({name})', key=name,
                                          signatures=[parts[arguments][1]])
        return template, signature, arguments, {}

    compiled.get_call_template = get_call_template
    compiled.get_overload = lambda arguments: parts[tuple(arguments)][0]
    return compiled


def _make_callable(context: Any, key: Any, result: Any) -> None:
    """
    Let kernels call a part that was compiled.

    After a call Numba looks whether the part failed, and hands an error on: 25 instructions in
    three blocks. Of what cannot fail nobody needs to ask.
    """
    part = result.fndesc
    if not getattr(result.library, 'succeeds', False) or isinstance(part.restype, types.Optional):
        context.insert_user_function(key, part, [result.library])
        return

    def call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        convention = context.call_conv
        function = context.declare_function(builder.module, part)
        room = cgutils.alloca_once(builder, convention.get_return_type(part.restype).pointee)
        given = convention._get_arg_packer(part.argtypes).as_arguments(builder, arguments)
        error = convention._get_excinfo_argument(builder.function)
        builder.call(function, [room, error, *given])
        return context.get_returned_value(builder, part.restype, builder.load(room))

    implementation: Any = call
    implementation.libs = (result.library,)
    context.insert_func_defn([(implementation, key, part.argtypes)])


def without_literals(args: Any, kws: Any) -> Any:
    """Return types of arguments, in order and by name, none of them that of a constant."""
    unliteral: Any = types.unliteral
    return (tuple(unliteral(arg) for arg in args),
            {name: unliteral(arg) for name, arg in kws.items()})
