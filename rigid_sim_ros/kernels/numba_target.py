# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A compiler target of our own: kernels are compiled by it, and nothing else in the process is.

Numba looks types, models and implementations up in the contexts of the target that a function is
compiled for. So what kernels do in another way than other functions is told to contexts of ours,
with models and registries of ours before Numba's own. What Numba declares for all targets is taken
over in copies, because it notes in a declaration what it compiled for it. Nothing is registered
with Numba, not even the target: a function of somebody else is compiled as if this package was not
there.

All of this is written against the insides of Numba. With a Numba outside of the range in which it
is tested, everything is registered with Numba's own target instead, and kernels are compiled by
`njit`: the results have the same bits, the first start takes minutes.
"""

from collections.abc import Callable, Sequence
from functools import cache, cached_property
import logging
import re
from typing import Any

import numba
from numba import extending, types
from numba.core import cpu, datamodel, dispatcher, errors, imputils, pythonapi, typing
from numba.core.descriptors import TargetDescriptor
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.target_extension import CPU
from numba.core.typing import templates

OLDEST, NEWEST = (0, 59), (0, 68)   # of Numba: major and minor version that are tested


def is_supported(version: str) -> bool:
    """Return whether kernels are compiled by our target with a version of Numba."""
    major, minor = re.findall(r'\d+', version)[:2]
    return OLDEST <= (int(major), int(minor)) <= NEWEST


SUPPORTED = is_supported(numba.__version__)
if not SUPPORTED:
    logging.getLogger(__name__).warning(
        'Numba %s is not one of %d.%d to %d.%d, which are tested: results are the same, but to '
        'compile the kernels of a scene for the first time takes minutes',
        numba.__version__, *OLDEST, *NEWEST)

_extending: Any = extending
_imputils: Any = imputils
_templates: Any = templates
_CPUContext: Any = cpu.CPUContext
_Descriptor: Any = TargetDescriptor
_Dispatcher: Any = dispatcher.Dispatcher
_PythonAPI: Any = pythonapi.PythonAPI
_TypingContext: Any = typing.Context

# Where everything of ours is declared: models of types, implementations and types of functions.
models: Any = datamodel.default_manager
lowerings, typings = _imputils.builtin_registry, _templates.builtin_registry
if SUPPORTED:
    models = datamodel.DataModelManager().chain(models)
    lowerings, typings = _imputils.Registry('rigid_sim_ros'), _templates.Registry()
_unboxers: dict[Any, Any] = {}      # by the class of a type


def register_model(kind: Any, model: Any) -> None:
    """Let values of a class of types be held as a model says, in kernels."""
    models.register(kind, model)


def register_unboxing(kind: Any, unbox: Any) -> None:
    """Let Python pass values of a class of types to kernels."""
    _unboxers[kind] = unbox
    if not SUPPORTED:
        _extending.unbox(kind)(unbox)


def intrinsic(define: Callable[..., Any]) -> Any:
    """
    Let kernels call what LLVM has instructions for.

    `define` gets the typing context and the types of the arguments, and returns the signature and
    what builds the instructions, as for `numba.extending.intrinsic`; or None.
    """
    if not SUPPORTED:
        return _extending.intrinsic(define)
    name = define.__name__
    handle = _extending._Intrinsic(name, define)
    template = _templates.make_intrinsic_template(handle, define, name)
    typings.register(template)
    typings.register_global(handle, types.Function(template))
    return handle


# --- types -------------------------------------------------------------------------------------

class Target(CPU):
    """What kernels are compiled for: all that is declared for a CPU holds here too."""


# What Numba notes in the template of a function: what it compiled for which types.
_NOTES = '_impl_cache', '_compiled_overloads', '_inline_overloads', '_overload_cache'


@cache
def _own_template(template: Any) -> Any:
    """Return a template that writes to nothing of Numba's, and compiles for our target."""
    notes: dict[str, Any] = {name: {} for name in _NOTES if hasattr(template, name)}
    if not notes:
        return template
    own = notes | {'_get_jit_decorator': lambda self: _jit,
                   '_get_target_registry': lambda self, reason: lowerings}
    return type(template)(template.__name__, (template,), own)


def _jit(**options: Any) -> Any:
    """Return a decorator that compiles what implements a function of Numba's, as Numba does."""
    return lambda function: OwnDispatcher(function, targetoptions=options)


class _OwnFunction(types.Function):
    """The type of a function of Numba's."""

    def __init__(self, known: Sequence[Any]) -> None:
        super().__init__(tuple(map(_own_template, known)))
        self._found: dict[Any, Any] = {}

    def augment(self, other: Any) -> Any:
        """Return the type of a function that has the templates of another type too."""
        return _OwnFunction(self.templates + other.templates)

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """
        Find the type of a call for arguments of some types, once.

        Of `a * b` Numba tries one template after the other until one fits the types of a and b,
        for every product in a program anew: twenty thousand times for the kernels of a scene, of
        which two hundred differ. That was 5 of 40 s of the processor for the first start of the
        scene `tower`, half of it in each of two processes.
        """
        if kws:
            return super().get_call_type(context, args, kws)
        key = tuple(args)
        if key not in self._found:
            self._found[key] = super().get_call_type(context, args, kws)
        return self._found[key]


class _Copies:
    """A growing list of declarations, each copied when it is read."""

    def __init__(self, items: Any, copy: Callable[[Any], Any]) -> None:
        self._items, self._copy = items, copy

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, part: slice) -> list[Any]:
        return [self._copy(item) for item in self._items[part]]


class _CopiedRegistry:
    """What a registry of types of functions declares, in copies."""

    def __init__(self, registry: Any) -> None:
        self.functions = _Copies(registry.functions, _own_template)
        self.attributes = _Copies(registry.attributes, _own_template)
        self.globals = _Copies(registry.globals, _own_global)


def _own_global(pair: Any) -> Any:
    value, kind = pair
    return (value, _OwnFunction(kind.templates)) if type(kind) is types.Function else pair


_copied_registry = cache(_CopiedRegistry)


class OwnTypingContext(_TypingContext):
    """Which types the functions in kernels return."""

    def install_registry(self, registry: Any) -> None:
        """Take over what a registry declares, in copies."""
        super().install_registry(_copied_registry(registry))

    def refresh(self) -> None:
        """Take over what was declared since the last time, by Numba and by us."""
        super().refresh()
        self.install_registry(typings)


# --- code --------------------------------------------------------------------------------------

class OwnContext(_CPUContext):
    """How types are held and functions are implemented in kernels."""

    def __init__(self, typing_context: Any) -> None:
        super().__init__(typing_context)
        self.target = Target
        self.data_model_manager = models

    def load_additional_registries(self) -> None:
        """Take over what Numba declares for a CPU."""
        # What counts references is compiled once in a process: for Numba's own target, as if this
        # one was not there.
        rtsys.initialize(cpu_target.target_context)
        super().load_additional_registries()

    def refresh(self) -> None:
        """Take over what was declared since the last time, by Numba and by us."""
        super().refresh()
        self.install_registry(lowerings)

    def post_lowering(self, module: Any, library: Any) -> None:
        """Link what counts references, which kernels do not do."""
        if self.enable_nrt:
            super().post_lowering(module, library)

    def make_tuple(self, builder: Any, kind: Any, values: Sequence[Any]) -> Any:
        """Return a tuple of values: a model of ours may make it itself."""
        model = models[kind]
        if hasattr(model, 'made'):
            return model.made(builder, values)
        return super().make_tuple(builder, kind, values)

    def get_python_api(self, builder: Any) -> Any:
        """Return what takes arguments from Python."""
        return _OwnPythonAPI(self, builder)


class _OwnPythonAPI(_PythonAPI):

    def to_native_value(self, kind: Any, value: Any) -> Any:
        unbox = _unboxers.get(type(kind))
        if unbox is None:
            return super().to_native_value(kind, value)
        return unbox(kind, value, pythonapi._UnboxContext(self.context, self.builder, self))


# --- functions ---------------------------------------------------------------------------------

class _OwnTarget(_Descriptor):

    options = cpu.CPUTargetOptions

    @cached_property
    def typing_context(self) -> Any:
        return OwnTypingContext()

    @cached_property
    def target_context(self) -> Any:
        return OwnContext(self.typing_context)


class _KernelType(types.Dispatcher):
    """The type of a kernel in functions that call it."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Return the type of a call; TypingError for a function that is no kernel."""
        if not isinstance(context, OwnTypingContext):
            raise errors.TypingError(
                f'{self.dispatcher.__name__} is a kernel of rigid_sim_ros, which Python and other '
                f'kernels can call: a function that numba.njit compiles cannot')
        return super().get_call_type(context, args, kws)


class OwnDispatcher(_Dispatcher):
    """A function that is compiled for our target when it is called."""

    targetdescr = _OwnTarget('rigid_sim_ros')

    @property
    def _numba_type_(self) -> Any:
        return _KernelType(self)


if SUPPORTED:
    for _own, _theirs in (_OwnFunction, types.Function), (_KernelType, types.Dispatcher):
        register_model(_own, models._handlers[_theirs])
