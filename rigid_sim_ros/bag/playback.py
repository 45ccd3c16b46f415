# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Read a bag for playing it: from any time on, chosen topics only, in the order of their times.

Nothing but indices stays in memory, so a bag may be larger than that. BagReader in reader.py
reads from the beginning instead, and looks at every byte.
"""

from collections.abc import Iterator, Mapping, Set as AbstractSet
from contextlib import contextmanager
import os
from pathlib import Path
from typing import Any

from rigid_sim_ros.bag import offered_qos
from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.offered_qos import OfferedQos
from rigid_sim_ros.bag.playable_files import (
    Message, metadata_times, metadata_topics, open_file, RecordedTopic, TIME)
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.times import SECOND

_SESSION, _STEP = '/bag/session', '/bag/step'


class PlayableBag:
    """A bag that can be played from any time on; all methods may be called by any thread."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Find what is in a bag; BagError where that cannot be had, with the mend."""
        self.path = Path(path)
        self.notes: list[str] = []      # what is not as it should be, and does not matter much
        with self._mending():
            reader = BagReader(path)
            metadata = reader.metadata or {}
            by_message = str(metadata.get('compression_mode')).lower() == 'message'
            told, times = metadata_topics(metadata), metadata_times(metadata)
            files = [open_file(file, by_message, told, times.get(file.name))
                     for file in reader.files]
        self.files = [file for file in files if file.last_ns]
        self.first_ns = min((file.first_ns for file in self.files), default=0)
        self.last_ns = max((file.last_ns for file in self.files), default=0)
        self._check_times(metadata)
        self.topics: dict[str, RecordedTopic] = {}
        for file in files:
            self.topics.update(file.topics)
        self.qos = self._qos(told)

    @property
    def step_topic(self) -> str:
        """The topic that marks the steps of a recording of rigid_sim_ros; '' in other bags."""
        for name in self.topics:
            if name.endswith(_SESSION) and (step := name.removesuffix(_SESSION) + _STEP) in (
                    self.topics):
                return step
        return ''

    def messages(
        self, start_ns: int, names: AbstractSet[str],
    ) -> Iterator[tuple[int, list[Message]]]:
        """
        Give the messages of some topics from a time on, in groups, with the number of their file.

        BagError where the bag cannot be read any further.
        """
        with self._mending():
            for k, file in enumerate(self.files):
                if file.last_ns >= start_ns:
                    for group in file.messages(start_ns, names):
                        yield k, group

    def latched(self, until_ns: int, names: AbstractSet[str]) -> list[Message]:
        """
        Return what a late subscriber would have got at a time, sorted by time.

        Those are the last messages of each latched topic, as many as its publishers keep.
        """
        missing = {name: kept for name in names if (kept := self.qos[name].kept)}
        found: list[Message] = []
        with self._mending():
            for file in reversed(self.files):
                if missing and file.first_ns <= until_ns:
                    # Later files repeat what is latched: what is there is not needed again.
                    for message in file.last(until_ns, missing):
                        found.append(message)
                        missing[message[1]] -= 1
                    missing = {name: count for name, count in missing.items() if count}
        return sorted(found, key=TIME)

    @contextmanager
    def _mending(self) -> Iterator[None]:
        """Say how to mend what is wrong with the files."""
        try:
            yield
        except Damaged as error:
            raise BagError(f'{self.path}: {error}: `rigid_sim recover {self.path}` keeps what is '
                           'whole') from None
        except OSError as error:
            raise BagError(f'{error.filename or self.path}: {error.strerror or error}') from None

    def _check_times(self, metadata: Mapping[str, Any]) -> None:
        """
        Compare the times with what the metadata tell.

        A file without checksums may hold a time with a wrong bit, which would be waited for.
        """
        try:
            start = int(metadata['starting_time']['nanoseconds_since_epoch'])
            span = int(metadata['duration']['nanoseconds'])
        except (KeyError, TypeError, ValueError):
            return
        margin = span + SECOND
        if self.files and not (
                start - margin <= self.first_ns and self.last_ns <= start + span + margin):
            raise BagError(
                f'{self.path}: metadata.yaml tells of {span / SECOND:g} s, the files hold '
                f'{(self.last_ns - self.first_ns) / SECOND:g} s: `rigid_sim recover {self.path}` '
                'makes it anew')

    def _qos(self, told: Mapping[str, RecordedTopic]) -> dict[str, OfferedQos]:
        found = {}
        for name, topic in self.topics.items():
            profiles = told[name].profiles if name in told else None
            try:
                found[name] = offered_qos.parse(profiles or topic.profiles)
            except ValueError as error:
                found[name] = OfferedQos()
                self.notes.append(f'the QoS of {name} is not known: {error}')
        return found
