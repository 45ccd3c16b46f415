# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the arrays of a snapshot are such that a world can go on from them.

Kernels take the numbers in these arrays as places in others, without a question. A snapshot may
come from anybody, in a bag for example, so its arrays are compared with what the world itself
would save (names and types of numbers) and with the table below (shapes and ranges). A number of
floating point must be finite in any array.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.manifolds import POINTS
from rigid_sim_ros.engine.joints.buffers import PAST
from rigid_sim_ros.engine.model.model import WORLD
from rigid_sim_ros.engine.solver.joint_rest import TOLD
from rigid_sim_ros.kernels.arrays import IntArray

_MEND = 'it was changed, or saved by another version; run the scene from its start'

# Quaternions and normals in a snapshot are off unit length by rounding only; this is far more.
_UNIT_TOLERANCE = 1e-6
# Steps that are counted down or up, at most: a 64-bit integer cannot overflow by one more step.
_MANY = 2 ** 62


class Sizes(NamedTuple):
    """How many of each there are in a world, which numbers in a snapshot may name."""

    bodies: int
    frames: int
    fixed: int  # bodies that nothing pushes
    body_of_shape: IntArray  # (s,) the body of each shape


class Field(NamedTuple):
    """
    What an array of a snapshot must be.

    A letter as an axis is a length: 'n' that of the bodies, any other the same in all arrays that
    name it. The range of integers is inclusive; a letter as the upper end is a number of which
    one less is the last place: 'n' bodies, 'f' frames, 's' shapes, 'j' joints.
    """

    axes: tuple[int | str, ...]
    low: int = -2 ** 63
    high: int | str = 2 ** 63 - 1


# z bodies that nothing pushes; r wrenches; c manifolds with p points, k of them polyhedra with m
# points; d forces, b bristles; J joints that hold R bodies with K axes, C conditions of loops; P
# steps, or stages of them, whose curvature is remembered; t pieces of trajectories.
TABLE: dict[str, Field] = {
    'x': Field((3, 'n')),
    'q': Field((4, 'n')),
    'P': Field((3, 'n')),
    'L': Field((3, 'n')),
    'V': Field((6, 'z')),
    'left': Field(('z',), -1, _MANY),
    'posed_at': Field(('z',), -_MANY, _MANY),
    'posed_after': Field(('z',), -_MANY, _MANY),
    'body': Field(('r',), 0, 'n'),
    'frame': Field(('r',), WORLD, 'f'),
    'at_point': Field(('r',), 0, 1),
    'force': Field(('r', 3)),
    'torque': Field(('r', 3)),
    'point': Field(('r', 3)),
    'steps_left': Field(('r',), 0, _MANY),
    'manifold_count': Field((1,), 0),
    'manifold_shape_a': Field(('c',), 0, 's'),
    'manifold_shape_b': Field(('c',), 0, 's'),
    'manifold_body_a': Field(('c',), 0, 'n'),
    'manifold_body_b': Field(('c',), 0, 'n'),
    'manifold_points': Field(('c',), 1, POINTS),
    'manifold_normal': Field(('c', 3)),
    'manifold_r_A': Field(('p', 3)),
    'manifold_r_B': Field(('p', 3)),
    'manifold_gap': Field(('p',)),
    'manifold_feature': Field(('p',)),      # is only compared with others
    'manifold_impulse': Field(('p',)),
    'manifold_friction': Field(('c', 3)),
    'manifold_spin': Field(('c',)),
    'manifold_roll': Field(('c', 3)),
    'manifold_found_at': Field(('c', 5)),
    'manifold_normal_A': Field(('k', 3)),
    'manifold_p_A_C': Field(('m', 3)),
    'manifold_p_B_C': Field(('m', 3)),
    'cut_halved': Field((1,), 0, 1),
    'cut_by_place': Field((1,), 0, 1),
    'cut_axis': Field((1,), 0, 2),
    'cut_end': Field((1,)),
    'cut_left': Field((1,), 0, _MANY),
    'rest_steps': Field(('n',), -1, _MANY),
    'rest_asleep': Field(('n',), 0, 1),
    'rest_pose': Field((7, 'n')),
    'rest_load': Field((6, 'n')),
    'rest_told': Field((TOLD, 'K')),
    'carried_shape_a': Field(('d',), 0, 's'),
    'carried_shape_b': Field(('d',), 0, 's'),
    'carried_feature': Field(('d',)),
    'carried_force': Field(('d', 3)),
    'carried_torque': Field(('d', 3)),
    'bristle_shape_a': Field(('b',), 0, 's'),
    'bristle_shape_b': Field(('b',), 0, 's'),
    'bristle_feature': Field(('b',)),
    'bristle_stretch': Field(('b', 3)),
    'joint_position': Field(('J',)),
    'joint_rate': Field(('K',)),
    'joint_curvature': Field(('P', 'R', 6)),
    'joint_strain': Field(('P', 'C')),
    'joint_known': Field((2,), 0, 64),
    'joint_parts': Field((1,), 1, 64),
    'joint_held': Field(('K',), 0, 1),
    'joint_held_at': Field(('K',)),
    'joint_effort': Field(('K',)),
    'joint_wrench': Field(('J', 6)),
    'joint_drive_mode': Field(('K',), 0, 2),
    'joint_drive_stiffness': Field(('K',)),
    'joint_drive_damping': Field(('K',)),
    'joint_drive_position': Field(('K',)),
    'joint_drive_velocity': Field(('K',)),
    'joint_drive_effort': Field(('K',)),
    'joint_drive_steps_left': Field(('K',), -1, _MANY),
    'path_joint': Field(('t',), 0, 'j'),
    'path_begin': Field(('t',), 0, _MANY),
    'path_coefficient': Field(('t', 6)),
}


def check(meta: Mapping[str, Any], arrays: Mapping[str, np.ndarray],
          present: Mapping[str, np.ndarray], sizes: Sizes, step_ns: int) -> None:
    """
    Raise ValueError unless a world can go on from these facts and arrays.

    `present` is what the world itself would save now; `step_ns` is its step [ns].
    """
    if arrays.keys() != present.keys():
        odd = sorted(arrays.keys() ^ present.keys())[0]
        raise ValueError(f'the snapshot {"lacks" if odd in present else "has"} an array '
                         f'{odd!r}: {_MEND}')
    lengths = {'n': sizes.bodies, 'z': sizes.fixed}
    # A snapshot has the joints of its scene: its arrays have the lengths of those of the world.
    for name in present:
        if name.startswith('joint_'):
            lengths |= {axis: length for axis, length in zip(
                TABLE[name].axes, present[name].shape, strict=True) if isinstance(axis, str)}
    ends = {'n': sizes.bodies, 'f': sizes.frames, 's': len(sizes.body_of_shape),
            'j': lengths.get('J', 0)}
    for name, array in arrays.items():
        _check_field(name, array, present[name].dtype, TABLE[name], lengths, ends)
    for holds, what in ((holds, what) for needed, what, holds in _RELATIONS
                        if needed in arrays):
        if not holds(arrays, sizes):
            raise ValueError(f'the snapshot makes no sense, {what}: {_MEND}')
    step, sources = meta.get('step_index'), meta.get('sources')
    if type(step) is not int or not 0 <= step * step_ns < 2 ** 63:
        raise ValueError(f'the snapshot is of step {step!r:.40}, must be a whole number of steps '
                         f'>= 0 with a time below 2^63 ns: {_MEND}')
    if not isinstance(sources, list) or len(sources) != lengths['r'] or not all(
            type(source) is str for source in sources):
        raise ValueError(f'the snapshot has {lengths["r"]} wrenches of other sources than a list '
                         f'of as many names: {_MEND}')


def _check_field(name: str, array: np.ndarray, kind: Any, field: Field, lengths: dict[str, int],
                 ends: Mapping[str, int]) -> None:
    """Check one array; note the lengths of axes that are met for the first time."""
    if array.dtype != kind or array.ndim != len(field.axes):
        raise ValueError(f'{name} in the snapshot is of type {array.dtype} and shape '
                         f'{array.shape}, must be of {kind} with {len(field.axes)} axes: {_MEND}')
    needed = tuple(axis if isinstance(axis, int) else lengths.setdefault(axis, length)
                   for axis, length in zip(field.axes, array.shape, strict=True))
    if array.shape != needed:
        raise ValueError(f'{name} in the snapshot has the shape {array.shape}, must be {needed}: '
                         f'{_MEND}')
    if array.dtype.kind == 'f':
        if not np.isfinite(array).all():
            raise ValueError(f'{name} in the snapshot holds numbers that are not finite: {_MEND}')
        return
    high = field.high if isinstance(field.high, int) else ends[field.high] - 1
    if array.size and not (field.low <= array.min() and array.max() <= high):
        raise ValueError(f'{name} in the snapshot goes from {array.min()} to {array.max()}, must '
                         f'stay within {field.low} .. {high}: {_MEND}')


def _are_unit(vectors: np.ndarray) -> bool:
    """Return whether the columns are of unit length."""
    with np.errstate(over='ignore'):
        return bool((np.abs((vectors ** 2).sum(axis=0) - 1.0) <= _UNIT_TOLERANCE).all())


def _are_of_their_bodies(arrays: Mapping[str, np.ndarray], sizes: Sizes) -> bool:
    return all(np.array_equal(sizes.body_of_shape[arrays[f'manifold_shape_{side}']],
                              arrays[f'manifold_body_{side}']) for side in 'ab')


def _are_as_many_polyhedra(arrays: Mapping[str, np.ndarray], _: Sizes) -> bool:
    """Return whether what has an orientation has a normal, and places of all its points."""
    polyhedra = arrays['manifold_found_at'][:, :4].any(axis=1)
    return (len(arrays['manifold_normal_A']) == polyhedra.sum()
            and len(arrays['manifold_p_A_C']) == arrays['manifold_points'][polyhedra].sum())


def _are_found_where_they_last(arrays: Mapping[str, np.ndarray], _: Sizes) -> bool:
    """Return whether what has no orientation at which it was found has no gap of then either."""
    found_at = arrays['manifold_found_at']
    fleeting = found_at[~found_at[:, :4].any(axis=1)]
    return not np.ascontiguousarray(fleeting).view(np.uint8).any()      # not even -0.0


def _are_sorted(arrays: Mapping[str, np.ndarray], sizes: Sizes) -> bool:
    a, b = arrays['manifold_shape_a'], arrays['manifold_shape_b']
    rows = a.astype(np.int64) * len(sizes.body_of_shape) + b
    return bool((a < b).all() and (np.diff(rows) > 0).all())


# What holds between arrays: one that must be there for it, in words, and whether it does.
_RELATIONS: Sequence[
    tuple[str, str, Callable[[Mapping[str, np.ndarray], Sizes], bool]]] = (
    ('q', 'orientations are not of unit length', lambda arrays, _: _are_unit(arrays['q'])),
    ('joint_known', 'more is known of the past of joints than is kept', lambda arrays, _: (
        arrays['joint_known'][0] <= PAST)),
    ('joint_parts', 'a step is not in halves of halves', lambda arrays, _: (
        64 % int(arrays['joint_parts'][0]) == 0)),
    ('manifold_normal', 'normals are not of unit length', lambda arrays, _: (
        _are_unit(arrays['manifold_normal'].T) and _are_unit(arrays['manifold_normal_A'].T))),
    ('manifold_count', 'the manifolds are not as many as it says',
     lambda arrays, _: arrays['manifold_count'][0] == len(arrays['manifold_points'])),
    ('manifold_points', 'the points of the manifolds are not as many as they say',
     lambda arrays, _: arrays['manifold_points'].sum() == len(arrays['manifold_gap'])),
    ('manifold_found_at', 'manifolds of polyhedra are not as many as they say',
     _are_as_many_polyhedra),
    ('manifold_body_a', 'the shapes of a manifold belong to other bodies', _are_of_their_bodies),
    ('manifold_shape_a', 'the manifolds are not sorted', _are_sorted),
    ('manifold_found_at', 'a manifold has a gap from before, and no orientation',
     _are_found_where_they_last),
)
