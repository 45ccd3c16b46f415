# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A snapshot may come from anybody: it is taken as a whole, or refused and nothing has changed."""

from collections.abc import Sequence
import contextlib
from functools import cache
import json
import struct
from typing import Any
import zlib

from effort import examples
from hypothesis import given, strategies as st
import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.engine.joints.buffers import PAST
from rigid_sim_ros.world.snapshot import pack, unpack
from rigid_sim_ros.world.snapshot_check import TABLE
from rigid_sim_ros.world.version import version

MODELS: dict[str, dict[str, Any]] = {
    'none': {'contact': 'none'},
    'timestep': {'contact': 'timestep'},
    'qp': {'contact': 'timestep', 'solver': 'qp'},
    'event': {'contact': 'event'},
    'penalty': {'contact': 'penalty'},
}
# The same with joints; in `timestep` bodies may sleep, which makes the state larger.
JOINTED = {f'{model} with joints': model for model in MODELS}
ALL = [*MODELS, *JOINTED]


def scene(model: str) -> dict[str, Any]:
    """Return bodies of several shapes that touch, with wrenches' frames."""
    return {
        'format': 1, 'world': {'step': 0.0005, **MODELS[model]},
        'bodies': [
            {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}},
            {'name': 'crate', 'mass': 2.0, 'shape': {'type': 'box', 'size': [1, 1, 1]},
             'pose': {'position': [0, 0, 0.5]},
             'frames': {'handle': {'position': [0.5, 0, 0]}}},
            {'name': 'lid', 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.8, 0.8, 0.2]},
             'pose': {'position': [0.1, 0, 1.1]}},
            {'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.2},
             'pose': {'position': [0, 0, 1.4]}},
        ]}


def jointed_scene(model: str) -> dict[str, Any]:
    """Return these beside an arm, two rods that close a loop, and a plate that moves."""
    def rod(name: str, x: float, z: float) -> dict[str, Any]:
        return {'name': name, 'mass': 1.0, 'shape': {'type': 'box', 'size': [0.2, 0.2, 0.4]},
                'pose': {'position': [x, 0, z]}}

    def joint(name: str, ends: tuple[str, str], place: Sequence[float], kind: str = 'revolute',
              axis: Sequence[float] = (0, 1, 0), **more: Any) -> dict[str, Any]:
        return {'name': name, 'type': kind, 'parent': ends[0], 'child': ends[1], 'axis': [*axis],
                'pose': {'position': [*place]}, **more}

    plain, drive = scene(model), {'mode': 'position', 'stiffness': 40.0, 'damping': 4.0}
    return {
        **plain, 'collision': {'sleep_after': 0.004} if model == 'timestep' else {},
        'materials': {'default': {'stiffness': 2000.0}},
        'bodies': [
            *plain['bodies'], rod('upper', 3, 1.0), rod('lower', 3, 0.6), rod('left', 5, 1.0),
            rod('right', 5.5, 1.0), rod('low', 8, 0.2),
            {'name': 'plate', 'kinematic': True, 'pose': {'position': [8, 0, -0.05]},
             'shape': {'type': 'box', 'size': [1, 1, 0.1]}}],
        'joints': [
            joint('shoulder', ('world', 'upper'), (3, 0, 1.2), position=0.7, drive=drive,
                  limits={'lower': -2, 'upper': 2}),
            joint('elbow', ('upper', 'lower'), (0, 0, -0.2), friction=0.05, drive=drive),
            joint('first', ('world', 'left'), (5, 0, 1.2)),
            joint('second', ('world', 'right'), (5.5, 0, 1.2)),
            {'name': 'bar', 'type': 'distance', 'parent': 'left', 'child': 'right', 'length': 0.5,
             'pose': {'position': [0, 0, -0.2]}, 'child_pose': {'position': [0, 0, -0.2]}},
            joint('lift', ('world', 'low'), (8, 0, 0.3), 'prismatic', (0, 0, 1))]}


def busy(model: str) -> World:
    """Return a world in contact, with wrenches in effect."""
    if model in JOINTED:
        return busy_with_joints(JOINTED[model])
    world = World.from_dict(scene(model))
    world.apply_wrench('crate', (1, 2, 3), frame='crate/handle', duration=1.0, source='hand')
    world.apply_wrench('ball', (0, 0, 1), frame='crate', point=(0.1, 0, 0), duration=2.0)
    world.step(15)
    return world


def busy_with_joints(model: str) -> World:
    """Return one in which drives have been told something too, and a plate moves."""
    world = World.from_dict(jointed_scene(model))
    world.set_twist('plate', (0.1, 0, 0), (0, 0, 0.2))
    world.apply_wrench('lower', (1, 2, 3), frame='crate/handle', duration=1.0, source='hand')
    world.follow_trajectory(['shoulder'], [0.1, 0.5], [[0.5], [0.2]])
    world.set_joint_command('elbow', position=0.3, duration=0.5)
    world.step(15)
    return world


@cache
def saved_world(model: str) -> bytes:
    """Return the same as bytes."""
    return busy(model).save()


@cache
def went_on(model: str) -> bytes:
    """Return what comes of it after three more steps."""
    world = busy(model)
    world.step(3)
    return world.save()


@cache
def shared_world(model: str) -> World:
    """Return a world that the tests restore, and that is nowhere else used."""
    return busy(model)


def check(model: str, data: bytes, steps: int = 3) -> bool:
    """Restore and go on, or be refused and go on as if nothing had been; return whether taken."""
    world = shared_world(model)
    world.restore(saved_world(model))
    try:
        world.restore(data)
    except ValueError as error:
        assert '\n' not in str(error)
        assert world.save() == saved_world(model)
        world.step(3)
        assert world.save() == went_on(model)
        return False
    assert world.save() == data
    # Finite numbers may be so large that their sums are not.
    with contextlib.suppress(ArithmeticError):
        world.step(steps)
    return True


def changed(model: str, name: str, place: int, value: float) -> bytes:
    """Return a snapshot with one number of an array changed, and a checksum that fits."""
    meta, arrays = unpack(saved_world(model))
    array = arrays[name].copy()
    array.flat[place % array.size] = value
    return pack(meta, arrays | {name: array})


@pytest.mark.parametrize('model', ALL)
def test_a_world_takes_back_what_it_saved(model) -> None:
    assert check(model, saved_world(model))
    assert set(unpack(saved_world(model))[1]) <= TABLE.keys()


@pytest.mark.parametrize('model', ALL)
def test_a_number_that_names_something_else_is_refused(model) -> None:
    for name, array in unpack(saved_world(model))[1].items():
        if array.size == 0 or array.dtype.kind != 'i':
            continue
        field, most = TABLE[name], np.iinfo(array.dtype)
        for value in (-2**31, -2, 1000, 2**30):
            if not (isinstance(field.high, int) and field.low <= value <= field.high):
                assert not check(model, changed(
                    model, name, 0, np.clip(value, most.min, most.max))), (name, value)


@pytest.mark.parametrize('model', ALL)
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_a_number_that_is_not_finite_is_refused(model, value) -> None:
    for name, array in unpack(saved_world(model))[1].items():
        if array.dtype.kind == 'f' and array.size:
            assert not check(model, changed(model, name, 3, value)), name


@pytest.mark.parametrize('model', JOINTED)
@pytest.mark.parametrize('known', [PAST + 1, 64])
def test_more_of_the_past_of_joints_than_is_kept_is_refused(model, known) -> None:
    # Within the range that holds for the number beside it.
    assert not check(model, changed(model, 'joint_known', 0, known))
    check(model, changed(model, 'joint_known', 0, PAST))


def test_a_trajectory_stays_where_what_else_is_said_is_refused() -> None:
    model = 'timestep with joints'
    meta, arrays = unpack(saved_world(model))
    for name, array in arrays.items():
        if name.startswith('path_'):
            arrays[name] = array[:0]
    normals = arrays['manifold_normal_A']
    assert not check(model, pack(meta, {**arrays, 'manifold_normal_A': normals[:-1]}))
    assert not check(model, pack(meta, {**arrays, 'manifold_p_A_C': normals[:0],
                                        'manifold_p_B_C': normals[:0]}))
    assert check(model, pack(meta, arrays))


@pytest.mark.parametrize('value', [1.0, -1.0, -0.0])
def test_a_gap_without_the_orientation_at_which_it_was_found_is_refused(value) -> None:
    # A sphere's contact is found anew in each step, and has neither: a world would save them as 0.
    found_at = unpack(saved_world('timestep'))[1]['manifold_found_at']
    row = int(np.flatnonzero(~found_at[:, :4].any(axis=1))[0])
    assert not check('timestep', changed('timestep', 'manifold_found_at', 5 * row + 4, value))


@pytest.mark.parametrize('meta', [
    {'step_index': -1}, {'step_index': 2 ** 63}, {'step_index': 2 ** 200}, {'step_index': 1.5},
    {'step_index': None}, {'step_index': True}, {'step_index': '7'}, {'sources': None},
    {'sources': []}, {'sources': ['hand']}, {'sources': ['hand', 1]}, {'sources': 'hands'},
    {'scene': None}, {'order': 7}, {'bodies': ['x' * 10000]}])
def test_facts_that_make_no_sense_are_refused(meta) -> None:
    facts, arrays = unpack(saved_world('timestep'))
    new = {**facts, **meta}
    if 'bodies' in meta:
        new['scene'] = 'another'
    assert not check('timestep', pack(new, arrays))


def of_another_version(model: str, arrays: dict[str, np.ndarray]) -> bytes:
    return pack({**unpack(saved_world(model))[0], 'version': '0.0.7 (12345678)'}, arrays)


@pytest.mark.parametrize('model', ['timestep', 'event with joints'])
def test_what_another_version_saved_goes_on_with_a_warning(model, caplog) -> None:
    world = shared_world(model)
    world.restore(saved_world(model))
    assert not caplog.records
    before = world.state_hash()
    world.step(3)
    world.restore(of_another_version(model, unpack(saved_world(model))[1]))
    assert world.state_hash() == before
    text, = (record.getMessage() for record in caplog.records)
    assert "'0.0.7 (12345678)'" in text
    assert version() in text


def test_what_another_version_saved_and_does_not_fit_is_refused_with_both_versions() -> None:
    _, arrays = unpack(saved_world('timestep'))
    del arrays['manifold_spin']
    with pytest.raises(ValueError, match='lacks an array') as refusal:
        shared_world('timestep').restore(of_another_version('timestep', arrays))
    assert "'0.0.7 (12345678)'" in str(refusal.value)
    assert version() in str(refusal.value)


SHAPES = st.lists(st.integers(-1, 5), max_size=3).map(tuple)
KINDS = st.sampled_from(['<f8', '<i8', '<i4', '|i1'])
NUMBERS = st.one_of(st.floats(), st.integers(-2 ** 63, 2 ** 63 - 1).map(float),
                    st.sampled_from([0.0, -1.0, 1.0, 2.0, 5.0, 1e308, -1e308, 5e-324, 1e200]))


@pytest.mark.parametrize('model', ALL)
@examples(60)
@given(data=st.data())
def test_fuzzed_arrays_are_taken_or_refused(model, data) -> None:
    meta, arrays = unpack(saved_world(model))
    for _ in range(data.draw(st.integers(1, 3))):
        name = data.draw(st.sampled_from(sorted(arrays)))
        how = data.draw(st.sampled_from(['value', 'values', 'length', 'shape', 'kind', 'gone']))
        array = arrays[name].copy()
        with np.errstate(all='ignore'):
            if how == 'value' and array.size:
                array.flat[data.draw(st.integers(0, array.size - 1))] = np.array(
                    data.draw(NUMBERS)).astype(array.dtype)
            elif how == 'values':
                array[...] = np.array(data.draw(NUMBERS)).astype(array.dtype)
            elif how == 'length' and array.ndim:
                array = np.resize(array, (data.draw(st.integers(0, 9)), *array.shape[1:]))
            elif how == 'shape':
                array = np.zeros([max(0, length) for length in data.draw(SHAPES)], array.dtype)
            elif how == 'kind':
                array = array.astype(data.draw(KINDS))
        if how == 'gone':
            arrays.pop(name)
        else:
            arrays[name] = array
        if not arrays:
            break
    check(model, pack(meta, arrays), steps=3)


HEADERS = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
        st.sampled_from(['meta', 'arrays', 'scene', 'x']), inner, max_size=3), max_leaves=12)


ODD_KINDS = st.sampled_from(['|O', '<U9', '<M8[ns]', '<f2', '|V100000', 'x', 7, None])
LAYOUTS = st.builds(
    lambda shape, kind, name: {'meta': {}, 'arrays': [[name, kind, list(shape)]]},
    SHAPES | st.just((2 ** 62, 4)) | st.just((2 ** 70,)), KINDS | ODD_KINDS, st.text(max_size=3))


@examples(60)
@given(header=HEADERS | LAYOUTS, rest=st.binary(max_size=40))
def test_fuzzed_headers_are_refused(header, rest) -> None:
    text = json.dumps(header).encode()
    data = struct.pack('<8sII', b'RSIMSNAP', len(text), zlib.crc32(text + rest, len(text)))
    with pytest.raises(ValueError, match='snapshot'):
        shared_world('none').restore(data + text + rest)
