# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The dynamic state of a world, in the places that it has after bodies came or went.

The state is that of a snapshot, whose arrays and what their axes and numbers count are listed in
`snapshot_check.TABLE`. Rows of what is left keep their order, so that sums are formed as before.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.engine.detection.manifolds import POINTS
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.scene.additions import names_a_file, with_parts, without
from rigid_sim_ros.world.joint_numbering import GONE, JointNumbering, JointPlaces, joints_between
from rigid_sim_ros.world.snapshot_check import TABLE

# Arrays about pairs of shapes, and about what lies on each other by these.
_OF_PAIRS = ('manifold_', 'carried_', 'bristle_', 'cut_', 'rest_')


class Numbering(NamedTuple):
    """How a world numbers its things."""

    bodies: Sequence[str]  # names, in the order of the engine's rows
    body_of_shape: IntArray  # (s,) sorted
    frames: Mapping[str, int]  # names, in the order of their numbers
    fixed: IntArray  # (z,) rows of bodies that nothing pushes
    joints: JointNumbering


class Places(NamedTuple):
    """Where things are afterwards: the new number of each old one, GONE if there is none."""

    body: IntArray  # (n,) rows of the engine's arrays
    shape: IntArray  # (s,)
    frame: IntArray  # (f,)
    fixed: IntArray  # (z,) among those that nothing pushes
    joints: JointPlaces


def moved(arrays: Mapping[str, np.ndarray], fresh: Mapping[str, np.ndarray],
          places: Places) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """
    Return the arrays of a snapshot for the world afterwards, and which wrenches are left (r,).

    `fresh` are the arrays of that world at its beginning: what came begins with them.
    """
    keep = _kept(arrays, places)
    numbers = {'n': places.body, 's': places.shape, 'f': places.frame, 'j': places.joints.joint}
    there_of = {'n': places.body, 'z': places.fixed, **places.joints.by_axis()}
    found: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        field = TABLE[name]
        for axis, length in enumerate(field.axes):
            if length in there_of:
                if name not in fresh:
                    break       # of joints, and there are none any more
                array = _placed(array, fresh[name], axis, there_of[str(length)])
            elif length in keep:
                array = np.compress(keep[str(length)], array, axis)
        if field.high in numbers:
            # The frame of the world, below 0, stays what it is.
            there = numbers[str(field.high)]
            array = np.where(array >= 0, there[array] if len(there) else array,
                             array).astype(array.dtype)
        found[name] = array
    if 'manifold_count' in found:
        found['manifold_count'] = np.array([np.count_nonzero(keep['c'])],
                                           arrays['manifold_count'].dtype)
    if (np.diff(places.body[places.body != GONE]) < 0).any():
        # Pairs are sorted by the numbers of their shapes: in another order they are found anew.
        found = {name: array for name, array in found.items()
                 if not name.startswith(_OF_PAIRS)}
    return found, keep['r']


def _placed(array: np.ndarray, fresh: np.ndarray, axis: int, there: IntArray) -> np.ndarray:
    """Return an array with the rows along an axis where they are now, beside those that came."""
    result, old = fresh.copy(), np.moveaxis(array, axis, 0)
    new = np.moveaxis(result, axis, 0)
    new[there[there != GONE]] = old[there != GONE]
    return result


def _kept(arrays: Mapping[str, np.ndarray], places: Places) -> dict[str, np.ndarray]:
    """Return which rows are left of the axes that a body takes along when it goes."""
    frame = arrays['frame']
    on_frame = np.where(frame >= 0, places.frame[frame], 0) != GONE
    keep = {'r': (places.body[arrays['body']] != GONE) & on_frame}
    for axis, name in (('c', 'manifold'), ('d', 'carried'), ('b', 'bristle')):
        if f'{name}_shape_a' in arrays:
            keep[axis] = ((places.shape[arrays[f'{name}_shape_a']] != GONE)
                          & (places.shape[arrays[f'{name}_shape_b']] != GONE))
    if 'path_joint' in arrays:
        keep['t'] = places.joints.joint[arrays['path_joint']] != GONE
    if 'c' in keep:
        there = np.arange(POINTS)[:, None] < arrays['manifold_points']
        polyhedra = arrays['manifold_found_at'][:, :4].any(axis=1)
        # The first points of all manifolds first; of polyhedra those of a manifold together.
        keep['p'] = np.broadcast_to(keep['c'], there.shape)[there]
        keep['k'] = keep['c'][polyhedra]
        keep['m'] = np.broadcast_to(keep['c'], there.shape).T[(there & polyhedra).T]
    return keep


def wake(arrays: dict[str, np.ndarray], bodies: Iterable[int], linked: IntArray) -> None:
    """
    Wake bodies, by their rows in the arrays, and what lies against them or is tied to them.

    They are about to go, or to get or lose a joint; `linked` (l, 2) is what ties bodies together.
    """
    if 'rest_asleep' not in arrays:
        return
    a = np.concatenate([arrays['manifold_body_a'], linked[:, 0]])
    b = np.concatenate([arrays['manifold_body_b'], linked[:, 1]])
    asleep = arrays['rest_asleep']
    seen = set(bodies)
    waiting = list(seen)
    asleep[waiting] = arrays['rest_steps'][waiting] = 0
    while waiting:
        i = waiting.pop()
        for j in {*b[a == i].tolist(), *a[b == i].tolist()} - seen:
            seen.add(j)
            # Islands end at what does not move, which never sleeps.
            if asleep[j]:
                asleep[j], arrays['rest_steps'][j] = 0, 0
                waiting.append(j)


def places_between(before: Numbering, after: Numbering) -> Places:
    """Return where the things of one numbering are in another one, by the names of the bodies."""
    row = {name: i for i, name in enumerate(after.bodies)}
    body = np.array([row.get(name, GONE) for name in before.bodies], dtype=np.int64)
    first = np.searchsorted(after.body_of_shape, np.arange(len(after.bodies) + 1))
    shape = np.full(len(before.body_of_shape), GONE, dtype=np.int64)
    begins = np.searchsorted(before.body_of_shape, before.body_of_shape)
    for s, i in enumerate(before.body_of_shape.tolist()):
        if body[i] != GONE:
            shape[s] = first[body[i]] + s - begins[s]
    frame = np.array([after.frames.get(name, GONE) for name in before.frames], dtype=np.int64)
    place = {i: k for k, i in enumerate(after.fixed.tolist())}
    fixed = np.array([place.get(int(body[i]), GONE) for i in before.fixed], dtype=np.int64)
    return Places(body, shape, frame, fixed, joints_between(before.joints, after.joints))


def checked(changes: Any) -> list[list[Any]]:
    """Return changes that come from a file; ValueError for what is none."""
    if not isinstance(changes, list) or not all(
            isinstance(one, list) and len(one) == 2
            and isinstance(one[1], {'add': dict, 'remove': str}.get(str(one[0]), ()))
            and not names_a_file(one[1]) for one in changes):
        raise ValueError('the snapshot tells of bodies that came and went in a way that makes no '
                         'sense: it was changed, or saved by another version')
    return changes


def changed(spec: Mapping[str, Any], changes: Sequence[Sequence[Any]]) -> dict[str, Any]:
    """
    Return a scene, as data, after parts came (`['add', part]`) and went (`['remove', name]`).

    ValueError for a part that goes and is not there.
    """
    scene = dict(spec)
    for kind, what in changes:
        scene = with_parts(scene, what) if kind == 'add' else without(scene, what)
    return scene


def order_after(names: Sequence[str], order: Sequence[str]) -> IntArray:
    """Return the order of bodies: those that stay in the order of before, then those that came."""
    index = {name: i for i, name in enumerate(names)}
    stay = [name for name in order if name in index]
    return np.array([index[name] for name in dict.fromkeys([*stay, *names])], dtype=np.int64)
