# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What Numba remembers, or leaves out, changes nothing."""

from llvmlite import ir
from numba import jit, njit, types
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.extending import overload
import pytest

from rigid_sim_ros.kernels.compiler_setup import set_up_compiler

set_up_compiler()


def twice(x):
    raise NotImplementedError


@overload(twice)
def _twice_of_numbers(x):
    return (lambda x: x + x) if isinstance(x, types.Number) else None


@njit
def four_times(x):
    return twice(twice(x))


def test_a_call_is_resolved_once_for_each_type():
    context = cpu_target.typing_context
    context.refresh()
    kind = context.resolve_value_type(abs)
    one, again, other = (kind.get_call_type(context, (argument,), {})
                         for argument in (types.float64, types.float64, types.int64))
    assert one is again
    assert (one.return_type, other.return_type) == (types.float64, types.int64)


def test_a_definition_that_comes_later_is_found():
    assert four_times(2) == 8
    assert four_times(2.5) == 10.0
    with pytest.raises(TypingError):
        four_times('ab')

    @overload(twice)
    def _twice_of_texts(x):
        return (lambda x: x + '+' + x) if x == types.unicode_type else None

    # Numba remembers itself what a function could not be compiled for.
    assert njit(four_times.py_func)('ab') == 'ab+ab+ab+ab'


def test_the_size_of_a_type_is_asked_for_once_unless_it_may_change(monkeypatch):
    context, asked = cpu_target.target_context, []
    size = ir.Type.get_abi_size
    monkeypatch.setattr(ir.Type, 'get_abi_size',
                        lambda *its: asked.append(its) or size(*its))
    pair = ir.LiteralStructType([ir.DoubleType(), ir.IntType(7), ir.IntType(17)])
    assert [context.get_abi_sizeof(pair) for _ in range(2)] == [16, 16]
    assert len(asked) == 1
    # Same name, other members: as a type has that gets them later.
    for members, bytes_ in (([ir.IntType(8)], 1), ([ir.DoubleType()] * 3, 24)):
        module = ir.Module(context=ir.Context())
        late = module.context.get_identified_type('late')
        late.set_body(*members)
        monkeypatch.setattr(ir.IdentifiedStructType, 'get_abi_size',
                            lambda *_, bytes_=bytes_: bytes_)
        assert context.get_abi_sizeof(late) == bytes_


@njit
def odd_numbers(stop):
    last = -1
    for i in range(stop):
        if i % 2 == 1:
            last = i
            yield last
    yield 2 * last


def test_generators_know_which_variables_are_alive():
    assert list(odd_numbers(6)) == list(odd_numbers.py_func(6)) == [1, 3, 5, 10]


def count_words(texts):
    counts, longest = {}, ''
    for text in texts:
        for word in text.split():
            if len(word) > len(longest):
                longest = word
            counts[word] = counts.get(word, 0) + 1
    return counts, longest


def test_what_numba_interprets_knows_it_too():
    texts = ['a body', 'a plane and a body']
    found = jit(forceobj=True, looplift=False)(count_words)(texts)
    assert found == count_words(texts) == ({'a': 3, 'body': 2, 'plane': 1, 'and': 1}, 'plane')
