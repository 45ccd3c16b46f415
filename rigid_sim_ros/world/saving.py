# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The state of a world as a whole: its hash, saved, restored.

How bytes hold it: snapshot.py. What is refused: snapshot_check.py.
"""

from collections.abc import Mapping
import hashlib
import logging
from typing import Any

import numpy as np

from rigid_sim_ros.engine.state.state import copy_into, MOVING_FIELDS
from rigid_sim_ros.world.applied_wrenches import FIELDS
from rigid_sim_ros.world.bounds import check_reach
from rigid_sim_ros.world.changing import Changing
from rigid_sim_ros.world.posed import FIELDS as POSED_FIELDS, Posed
from rigid_sim_ros.world.snapshot import pack, unpack
from rigid_sim_ros.world.snapshot_check import check, Sizes
from rigid_sim_ros.world.trajectories import FIELDS as PATH_FIELDS
from rigid_sim_ros.world.values import some
from rigid_sim_ros.world.version import version

_logger = logging.getLogger(__name__)


class Saving(Changing):
    """The part of `World` that saves and restores it."""

    _posed: Posed
    _sizes: Sizes

    def _fingerprint(self) -> str:
        return hashlib.blake2b(self._origin.physics_text.encode(), digest_size=8).hexdigest()

    def _order_mark(self) -> str:
        """Return what tells orders of the bodies apart, nothing for that of the scene."""
        if np.array_equal(self._order, np.arange(len(self._order))):
            return ''
        return hashlib.blake2b(self._order.tobytes(), digest_size=8).hexdigest()

    def _dynamic(self) -> dict[str, np.ndarray]:
        """Return every array that the next step depends on, by name."""
        moving = {name: getattr(self._state, name) for name in MOVING_FIELDS}
        return {**moving, **self._posed.rows(self._state), **self._applied.rows(),
                **self._contact.lasting(), **self._path_rows()}

    def state_hash(self) -> int:
        """Return 64 bits that identify the complete dynamic state, time included."""
        digest = hashlib.blake2b(self.step_index.to_bytes(8, 'little'), digest_size=8)
        for array in self._dynamic().values():
            digest.update(array.tobytes())
        return int.from_bytes(digest.digest(), 'little')

    def save(self) -> bytes:
        """
        Return the complete dynamic state, for `restore` in a world of the same scene.

        With it the bodies that came and went: the other world needs none of them.
        """
        meta = {'scene': self._fingerprint(), 'bodies': len(self.names),
                'step_index': self.step_index, 'sources': self._applied.sources,
                'order': self._order_mark(), 'version': version()}
        if self._changes:
            meta['changes'] = self._changes
        return pack(meta, self._dynamic())

    def restore(self, data: bytes) -> None:
        """
        Continue from what `save` returned, bit for bit.

        What another version saved goes on with other bits where that moves bodies otherwise: a
        warning says so. ValueError if it belongs to another scene, is damaged, or holds anything
        that no world of this scene can be in; then this one stays as it is.
        """
        meta, arrays = unpack(data)
        theirs, mine = meta.get('version', 'unknown'), version()
        if theirs == mine:
            self._restore(data, meta, arrays)
            return
        versions = f'saved by version {theirs!r:.60}, this is {mine!r}'
        try:
            self._restore(data, meta, arrays)
        except ValueError as error:
            raise ValueError(f'{error} ({versions})') from None
        _logger.warning('the snapshot was %s: the motion may go on with other bits', versions)

    def _restore(self, data: bytes, meta: Mapping[str, Any],
                 arrays: Mapping[str, np.ndarray]) -> None:
        if meta.get('scene') != self._fingerprint():
            raise ValueError(
                f"the snapshot of {meta.get('bodies')!r:.20} bodies is of another scene than this "
                f'one of {len(self.names)} ({some(self.names)}): restore it into a world of its '
                'own')
        if (changes := meta.get('changes', [])) != self._changes:
            other = type(self)(self._origin)
            other._follow_changes(changes)
            other._restore(data, meta, arrays)
            self._become(other)
            return
        if meta.get('order', '') != self._order_mark():
            raise ValueError('the snapshot numbers the bodies in another way: it was saved by '
                             'another version; run the scene from its start')
        check(meta, arrays, self._dynamic(), self._sizes, self.step_ns)
        check_reach(self._bounds, self._model, self._start, arrays)
        self._check_paths(arrays)
        self._take(arrays, meta['sources'])
        self.step_index = meta['step_index']

    def _take(self, arrays: Mapping[str, np.ndarray], sources: list[str]) -> None:
        """Go on from the arrays of a snapshot that fit."""
        # First what raises an error where the arrays are of another layout.
        self._contact.recall({name: array for name, array in arrays.items()
                              if name not in MOVING_FIELDS + POSED_FIELDS + FIELDS + PATH_FIELDS})
        copy_into(self._state, self._start._replace(**{name: arrays[name]
                                                       for name in MOVING_FIELDS}))
        self._take_paths(arrays)
        self._posed.replace(self._state, arrays)
        self._applied.replace({name: arrays[name] for name in FIELDS}, sources)
        self._motion_is_current = False
