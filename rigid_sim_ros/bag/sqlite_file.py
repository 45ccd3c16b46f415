# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Write and read one SQLite file of a bag, in the schema of rosbag2's plugin sqlite3 (version 4).

Each flush ends a transaction, so a process that is killed leaves all that was flushed; a
transaction that was cut off is undone by whoever opens the file next.
"""

from collections.abc import Iterable, Iterator, Sequence
import os
from pathlib import Path
import sqlite3

import zstandard

from rigid_sim_ros.bag.errors import BagError, Damaged
from rigid_sim_ros.bag.files import Budget, open_regular, size_of, Unpacker
from rigid_sim_ros.bag.metadata import FileFacts, profiles_text
from rigid_sim_ros.bag.topics import definition, Topic

_TABLES = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,
  metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
  serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
  type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL,
  encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL,
  type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
  timestamp INTEGER NOT NULL, data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
INSERT INTO schema(schema_version, ros_distro) VALUES (4, 'jazzy');
"""
_INSERT = 'INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)'

# What SQLite keeps beside a file that is open, and would obey when it opens the file again.
COMPANIONS = ('-journal', '-wal', '-shm')

# [bytes] A transaction ends when it has grown to this, or with a flush.
_TRANSACTION = 1 << 20

# [bytes] What a closing transaction may need besides the messages.
_MARGIN = 65536


class SqliteFile:
    """A SQLite file that is being written; topic k has the id k + 1."""

    suffix = '.db3'

    def __init__(self, path: Path, topics: Sequence[Topic], compressed: bool) -> None:
        """Create the file and describe its topics; OSError if that cannot be done."""
        self.path = path
        self.counts = [0] * len(topics)
        self.first_ns = 0
        self.last_ns = 0
        self._pending = [0] * len(topics)
        self._pending_first = 0
        self._pending_last = 0
        self._pending_size = 0
        self._compress = zstandard.ZstdCompressor(level=1).compress if compressed else None
        path.open('xb').close()     # sqlite3 says less about why it cannot
        self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        try:
            self._database.execute('PRAGMA synchronous = NORMAL')
            self._database.executescript(f'BEGIN; {_TABLES} COMMIT;')
            self._database.execute('BEGIN')
            self._describe(topics)
            self._database.execute('COMMIT')
        except (sqlite3.Error, OSError) as error:
            self._database.close()
            path.unlink()
            raise OSError(f'{path}: {error}') from None
        self._database.execute('BEGIN')

    def write(self, channels: Iterable[int], first_ns: int, messages: Iterable[bytes]) -> None:
        """Append messages, one a channel, their times a nanosecond apart from `first_ns` on."""
        rows = [(channel, first_ns + k, self._compress(data) if self._compress else data)
                for k, (channel, data) in enumerate(zip(channels, messages, strict=True))]
        self._execute(_INSERT, rows)
        for channel, _, _ in rows:
            self._pending[channel - 1] += 1
        self._pending_first = self._pending_first or first_ns
        self._pending_last = first_ns + len(rows) - 1
        self._pending_size += sum(len(data) for _, _, data in rows)
        if self._pending_size >= _TRANSACTION:
            self.flush()

    @property
    def written(self) -> tuple[int, ...]:
        """How many messages each topic has, those included that wait for a flush."""
        return tuple(a + b for a, b in zip(self.counts, self._pending, strict=True))

    def flush(self) -> None:
        """Hand all that was written to the system, which keeps it when this process dies."""
        if not self._pending_first:
            return
        try:
            self._database.execute('COMMIT')
            self._database.execute('BEGIN')
        except sqlite3.Error as error:
            raise OSError(f'{self.path}: {error}') from None
        self.counts = [a + b for a, b in zip(self.counts, self._pending, strict=True)]
        self.first_ns = self.first_ns or self._pending_first
        self.last_ns = self._pending_last
        self._forget_pending()

    def sync_handle(self) -> int:
        """Return a new file descriptor, to be synchronised and closed by another thread."""
        return os.open(self.path, os.O_RDONLY)

    def cut_back(self) -> None:
        """Drop what a write that failed has left behind the last transaction."""
        if self._database.in_transaction:
            self._execute('ROLLBACK')
        self._forget_pending()

    def closing_size(self) -> int:
        """Return how many bytes `close` will need at most."""
        return _MARGIN

    def close(self) -> FileFacts:
        """End the file; OSError if there is no room."""
        self.flush()
        if self._database.in_transaction:
            self._execute('COMMIT')
        self._database.close()
        return self.facts()

    def abandon(self) -> None:
        """Let the file go as it is."""
        self._database.close()

    def facts(self) -> FileFacts:
        """Return what the metadata says of this file."""
        return FileFacts(self.path.name, self.first_ns, self.last_ns, tuple(self.counts))

    def _describe(self, topics: Sequence[Topic]) -> None:
        self._execute('INSERT INTO topics VALUES (?, ?, ?, ?, ?, ?)', [
            (k + 1, topic.name, topic.type, 'cdr', profiles_text(topic.latched),
             definition(topic.type)[1]) for k, topic in enumerate(topics)])
        self._execute(
            'INSERT INTO message_definitions (topic_type, encoding, encoded_message_definition, '
            'type_description_hash) VALUES (?, ?, ?, ?)',
            [(name, 'ros2msg', *definition(name))
             for name in dict.fromkeys(topic.type for topic in topics)])

    def _execute(self, statement: str, rows: Sequence[tuple[object, ...]] | None = None) -> None:
        try:
            if rows is None:
                self._database.execute(statement)
            else:
                self._database.executemany(statement, rows)
        except sqlite3.Error as error:
            raise OSError(f'{self.path}: {error}') from None

    def _forget_pending(self) -> None:
        self._pending = [0] * len(self._pending)
        self._pending_first = self._pending_last = self._pending_size = 0


def open_database(path: Path) -> sqlite3.Connection:
    """
    Open a SQLite file to be read, and nothing but the file: no journal, no other database.

    Damaged if it is none, or holds more than plain tables: a view, a trigger or a column that is
    computed would be a program of whoever wrote the file. Errors of `open_regular`.
    """
    open_regular(path).close()
    try:
        database = sqlite3.connect(f'{path.absolute().as_uri()}?mode=ro&immutable=1', uri=True)
        database.text_factory = bytes
        for kind, name, text in database.execute('SELECT type, name, sql FROM sqlite_master'):
            # Parentheses inside of those around the columns are an expression, or what it takes
            # to compute one. Indices that SQLite makes itself have no text.
            if kind not in (b'table', b'index') or not isinstance(text or b'', bytes) or (
                    (text or b'').count(b'(') > 1
                    or (text or b'').upper().startswith(b'CREATE VIRTUAL')):
                database.close()
                raise Damaged(f'{path.name} is damaged ({_said(name)} is no plain table)')
    # The words of an error of SQLite may quote bytes of the file that are no text.
    except (sqlite3.Error, UnicodeDecodeError, MemoryError) as error:
        raise Damaged(f'{path.name} is damaged ({error})') from None
    return database


class SqliteReader:
    """One SQLite file of a bag, to be read."""

    def __init__(self, path: Path, compressed: bool) -> None:
        """Open the file and read its topics; BagError if it is none, or damaged."""
        self.path = path
        self._decompress = Unpacker(Budget(size_of(path))) if compressed else None
        for companion in COMPANIONS:
            if os.path.lexists(path.with_name(path.name + companion)):
                raise Damaged(f'{path.name} was not closed')
        self._database = open_database(path)
        try:
            # Entries of an index that lead to other rows too, which a quick check leaves out.
            verdict = self._database.execute('PRAGMA integrity_check(1)').fetchone()[0]
            if verdict != b'ok':
                raise Damaged(f'{path.name} is damaged ({_said(verdict)})')
            rows = self._database.execute('SELECT id, name, type FROM topics').fetchall()
            self.topics = {int(k): (name.decode(), kind.decode()) for k, name, kind in rows}
        except (sqlite3.Error, UnicodeDecodeError, TypeError, ValueError, AttributeError,
                OverflowError, MemoryError) as error:
            self._database.close()
            if isinstance(error, BagError):
                raise
            raise Damaged(f'{path.name} is damaged ({error})') from None

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Give channel, time and bytes of every message in the order of their times."""
        try:
            for channel, stamp, data in self._database.execute(
                    'SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id'):
                if channel not in self.topics or type(stamp) is not int or (
                        type(data) is not bytes):
                    raise Damaged(f'{self.path.name} is damaged (a message of topic {channel!r})')
                yield channel, stamp, self._decompress(data) if self._decompress else data
        except (sqlite3.Error, ValueError, OverflowError, MemoryError) as error:
            if isinstance(error, BagError):
                raise
            raise Damaged(f'{self.path.name} is damaged ({error})') from None

    def close(self) -> None:
        """Let the file go."""
        self._database.close()


def _said(verdict: object) -> str:
    text = verdict.decode(errors='replace') if isinstance(verdict, bytes) else str(verdict)
    return ' '.join(text.split())
