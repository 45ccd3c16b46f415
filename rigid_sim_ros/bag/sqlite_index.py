# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read a SQLite file of a bag from any time on, in the schemas of rosbag2 so far (1 to 4)."""

from bisect import bisect_right
from collections.abc import Collection, Iterator
from contextlib import closing
from operator import itemgetter
from pathlib import Path
import sqlite3
from typing import Any, NamedTuple

from rigid_sim_ros.bag.errors import Damaged
from rigid_sim_ros.bag.sqlite_file import open_database, SqliteReader

_ROWS = 500     # that are fetched at a time
# Columns of the table `topics`; what older schemas do not have is empty.
_COLUMNS = ('id', 'name', 'type', 'serialization_format', 'offered_qos_profiles',
            'type_description_hash')


class SqliteTopic(NamedTuple):
    """A row of the table `topics`."""

    number: int
    name: str
    type: str
    encoding: str
    profiles: str
    type_hash: str


class SqliteIndex:
    """One file; every call opens it anew, so that any thread may call."""

    def __init__(self, path: Path) -> None:
        """Check the file and read its topics; Damaged if it is not what was written."""
        self.path = path
        SqliteReader(path, False).close()       # checks every page
        self.topics = [self._topic(row) for row in self._query(_topics_query(self._columns()))]
        (first, last), = self._query('SELECT min(timestamp), max(timestamp) FROM messages')
        if first is not None and not (type(first) is type(last) is int and first >= 0):
            raise Damaged(f'{path.name} is damaged (times from {first!r} to {last!r})')
        (strays,), = self._query(
            'SELECT count(*) FROM messages WHERE topic_id NOT IN (SELECT id FROM topics)')
        if strays:
            raise Damaged(f'{path.name} is damaged ({strays} messages of no topic)')
        self.first_ns, self.last_ns = first or 0, last or 0
        self._places: dict[int, list[tuple[int, int]]] = {}     # of each message of a topic

    def messages(
        self, start_ns: int, numbers: Collection[int],
    ) -> Iterator[list[tuple[int, int, bytes]]]:
        """Give topic, time and bytes of what was recorded from a time on, in groups."""
        chosen = ','.join(map(str, numbers))
        rows = self._query(
            'SELECT topic_id, timestamp, data FROM messages WHERE timestamp >= ? AND topic_id IN '
            f'({chosen}) ORDER BY timestamp, id', (start_ns,))
        group = []
        for row in rows:
            group.append(self._message(row))
            if len(group) == _ROWS:
                yield group
                group = []
        if group:
            yield group

    def last(self, number: int, until_ns: int, count: int) -> list[tuple[int, int, bytes]]:
        """Return the last messages of a topic up to a time and with it."""
        if number not in self._places:
            # The tables have no index for this. The times of one topic are few numbers to keep.
            self._places[number] = list(self._query(
                'SELECT timestamp, id FROM messages WHERE topic_id = ? ORDER BY timestamp, id',
                (number,)))
        places = self._places[number]
        end = bisect_right(places, until_ns, key=itemgetter(0))
        return [self._message(row) for _, k in places[max(0, end - count):end]
                for row in self._query(
                    'SELECT topic_id, timestamp, data FROM messages WHERE id = ?', (k,))]

    def _columns(self) -> set[str]:
        return {row[1].decode(errors='replace')
                for row in self._query('PRAGMA table_info(topics)')}

    def _topic(self, row: tuple[Any, ...]) -> SqliteTopic:
        number, *texts = row
        try:
            return SqliteTopic(int(number), *(text.decode() for text in texts))
        except (AttributeError, TypeError, ValueError) as error:
            raise Damaged(f'{self.path.name} is damaged ({error})') from None

    def _message(self, row: tuple[Any, ...]) -> tuple[int, int, bytes]:
        number, stamp, data = row
        if type(stamp) is not int or type(data) is not bytes:
            raise Damaged(f'{self.path.name} is damaged (a message of topic {number!r})')
        return number, stamp, data

    def _query(self, text: str, values: tuple[object, ...] = ()) -> Iterator[tuple[Any, ...]]:
        try:
            with closing(open_database(self.path)) as database:
                yield from database.execute(text, values)
        except (sqlite3.Error, UnicodeDecodeError, OverflowError, MemoryError) as error:
            raise Damaged(f'{self.path.name} is damaged ({error})') from None


def _topics_query(columns: set[str]) -> str:
    return 'SELECT {} FROM topics'.format(
        ', '.join(name if name in columns else "CAST('' AS BLOB)" for name in _COLUMNS))
