# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags that somebody made to do harm, and what may not become of whoever reads them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
import os
from pathlib import Path
import shutil
import signal
import sqlite3
import struct
import tempfile
from typing import Any

from bag import foreign
from bag.sessions import shared_session
from mcap.opcode import Opcode
import zstandard

from rigid_sim_ros.bag.export import export
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.motion import read_motion
from rigid_sim_ros.bag.playback import PlayableBag
from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.resume import find
from rigid_sim_ros.bag.scan import McapScan
from rigid_sim_ros.bag.verify import verify

# [s] of a processor, and altogether: what goes on for ever, or grows with the square of what a bag
# holds, takes more. The longest takes 3 s, to recover a bag of 40 000 topics; on a busy machine,
# whose cores share their caches, up to twice that, and a tenth of a core is all that it may get.
LONGEST, AT_ALL = 60, 300


def _play(bag: Path) -> None:
    played = PlayableBag(bag)
    played.latched(played.last_ns, set(played.topics))
    for _ in played.messages(0, set(played.topics)):
        pass


COMMANDS: dict[str, Callable[[Path], Any]] = {
    'info': info, 'verify': verify, 'resume': lambda bag: find(bag, 0.5), 'plot': read_motion,
    'export': lambda bag: export(bag, 'csv', bag.parent / f'{bag.name}.csv'), 'replay': _play,
    'recover': recover,
}


@contextmanager
def limited_time() -> Iterator[None]:
    """Raise an AssertionError in what does not come to its end."""
    def too_long(*_: object) -> None:
        raise AssertionError(f'took more than {LONGEST} s of a processor, or {AT_ALL} s')

    before = signal.signal(signal.SIGVTALRM, too_long)
    beside = signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)
    signal.alarm(AT_ALL)    # what waits for ever takes no time
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.alarm(0)
        signal.signal(signal.SIGVTALRM, before)
        signal.signal(signal.SIGALRM, beside)


def contents(folder: Path) -> dict[str, object]:
    """Return all files below a folder with their bytes, links with where they lead."""
    return {str(path): os.readlink(path) if path.is_symlink() else path.read_bytes()
            if path.is_file() else path.stat().st_mode for path in sorted(folder.rglob('*'))}


# --- what is done to a copy of a good bag: each gets the bag and a folder outside of it ----------

def _first(bag: Path) -> Path:
    return sorted(path for path in bag.iterdir() if path.suffix in ('.mcap', '.db3'))[0]


def _linked(name: str, target: str) -> Callable[[Path, Path], None]:
    def change(bag: Path, outside: Path) -> None:
        path = _first(bag) if name == 'first' else bag / name
        path.unlink(missing_ok=True)
        path.symlink_to(target if target.startswith('/') else outside / target)
    return change


def _pipe(name: str) -> Callable[[Path, Path], None]:
    def change(bag: Path, outside: Path) -> None:
        path = _first(bag) if name == 'first' else bag / name
        path.unlink(missing_ok=True)
        os.mkfifo(path)
    return change


def _folder(bag: Path, outside: Path) -> None:
    path = _first(bag)
    path.unlink()
    path.mkdir()


def _hard_link(bag: Path, outside: Path) -> None:
    os.link(outside / 'letter', bag / '.reserve')


def _super_journal(bag: Path, outside: Path) -> None:
    """Plant a journal that names a file which SQLite removes when it has used the journal."""
    path = _first(bag)
    base, victim = path.with_name('x'), outside / 'super'
    with sqlite3.connect(base) as database:
        database.execute('CREATE TABLE t(x)')
        database.commit()
        database.execute('PRAGMA journal_mode = PERSIST')
        database.execute('PRAGMA cache_size = 1')
    base.unlink()
    name = str(victim).encode()
    magic = b'\xd9\xd5\x05\xf9\x20\xa1\x63\xd7'
    head = magic + struct.pack('>IIIII', 0, 1, os.path.getsize(path) // 4096, 512, 4096)
    tail = struct.pack('>I', 4096) + name + struct.pack(
        '>II', len(name), sum(name) & 0xffffffff) + magic
    path.with_name(path.name + '-journal').write_bytes(head.ljust(512, b'\0') + tail)


def _metadata(change: Callable[[str], str]) -> Callable[[Path, Path], None]:
    def apply(bag: Path, outside: Path) -> None:
        path = bag / 'metadata.yaml'
        path.write_text(change(path.read_text()))
    return apply


def _bomb(text: str) -> str:
    levels = ['a0: &a0 [x, x, x, x, x, x, x, x, x, x]'] + [
        f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * 10)}]' for k in range(1, 12)]
    return '\n'.join(levels) + '\n' + text


def _merge_bomb(text: str) -> str:
    levels = ['a0: &a0 {x: 1}'] + [
        f'a{k}: &a{k} {{<<: [{", ".join([f"*a{k - 1}"] * 10)}], y{k}: 1}}' for k in range(1, 12)]
    return '\n'.join(levels) + '\n' + text


def _sqlite(*statements: str) -> Callable[[Path, Path], None]:
    def change(bag: Path, outside: Path) -> None:
        with sqlite3.connect(_first(bag)) as database:
            for statement in statements:
                database.execute(statement)
            database.commit()
        database.close()
    return change


@cache
def _of_3_gigabytes() -> bytes:
    """Return some kB that grow to 3 GB."""
    pieces = zstandard.ZstdCompressor(level=3).compressobj(size=3 << 30)
    zeros = bytes(1 << 24)
    return b''.join(pieces.compress(zeros) for _ in range(192)) + pieces.flush()


def _huge_message(bag: Path, outside: Path) -> None:
    """Put a message that grows into a bag with messages compressed by zstd."""
    with sqlite3.connect(_first(bag)) as database:
        database.execute('UPDATE messages SET data = ? WHERE id = 5', (_of_3_gigabytes(),))
        database.commit()
    database.close()
    path = bag / 'metadata.yaml'
    path.write_text(path.read_text().replace('"none"', '"message"'))


def _grow(size: int) -> bytes:
    """Return a message of type String that is so large, compressed."""
    text = size - 8
    return zstandard.ZstdCompressor().compress(
        struct.pack('<II', 0x100, text) + bytes(text))


def _many_large_messages(bag: Path, outside: Path) -> None:
    """Put messages of 30 MB each, none of them too large, into the place of all others."""
    with sqlite3.connect(_first(bag)) as database:
        database.execute('UPDATE messages SET data = ?', (_grow(30 << 20),))
        database.commit()
    database.close()
    path = bag / 'metadata.yaml'
    path.write_text(path.read_text().replace('"none"', '"message"'))


@cache
def _of_many_large_chunks() -> bytes:
    """Return an MCAP file of a thousand chunks of 30 MB each."""
    with tempfile.TemporaryDirectory() as folder:
        size = 30 << 20
        path = foreign.mcap(Path(folder, 'large.mcap'), [(10 ** 9, '/chat', bytes(size))],
                            compression=foreign.CompressionType.ZSTD)
        whole = path.read_bytes()
        scan = McapScan(path)
        records = list(scan.records())
        scan.close()
    chunk, = (k for k, record in enumerate(records) if record.opcode == Opcode.CHUNK)
    begin, end = records[chunk].offset, records[chunk + 1].offset
    return whole[:begin] + 1000 * whole[begin:end]


def _many_large_chunks(bag: Path, outside: Path) -> None:
    _first(bag).write_bytes(_of_many_large_chunks())
    (bag / 'metadata.yaml').unlink()


@cache
def _of_many_topics() -> bytes:
    """Return an MCAP file with tens of thousands of topics."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'many.mcap')
        foreign.mcap(path, [(10 ** 9 + k, f'/topic_{k}', bytes(8)) for k in range(40_000)])
        return path.read_bytes()


def _many_topics(bag: Path, outside: Path) -> None:
    """Leave a file with tens of thousands of topics, which breaks off."""
    whole = _of_many_topics()
    _first(bag).write_bytes(whole[:len(whole) * 7 // 10])
    (bag / 'metadata.yaml').unlink()


def _schema_of_no_text(bag: Path, outside: Path) -> None:
    """Let SQLite quote bytes that are no text in its words about an error."""
    path = _first(bag)
    path.write_bytes(path.read_bytes().replace(b'CREATE TABLE', b'CR\xb8ATE TABLE'))


ENDLESS = (
    'CREATE VIEW messages AS WITH RECURSIVE r(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM r) '
    "SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM r")

# By name: storage, compression, and the change.
HARM: dict[str, tuple[str, str, Callable[[Path, Path], None]]] = {
    'reserve is a link': ('mcap', 'none', _linked('.reserve', 'letter')),
    'reserve is a pipe': ('mcap', 'none', _pipe('.reserve')),
    'reserve is a hard link': ('mcap', 'none', _hard_link),
    'metadata part is a link': ('mcap', 'none', _linked('.metadata.yaml.part', 'letter')),
    'metadata is a link': ('mcap', 'none', _linked('metadata.yaml', 'letter')),
    'metadata is a pipe': ('mcap', 'none', _pipe('metadata.yaml')),
    'metadata is a device': ('mcap', 'none', _linked('metadata.yaml', '/dev/zero')),
    'file is a link': ('mcap', 'none', _linked('first', 'letter')),
    'file is a device': ('mcap', 'none', _linked('first', '/dev/zero')),
    'file is a pipe': ('mcap', 'none', _pipe('first')),
    'file is a folder': ('mcap', 'none', _folder),
    'sqlite file is a link': ('sqlite3', 'none', _linked('first', 'letter')),
    'sqlite file is a device': ('sqlite3', 'none', _linked('first', '/dev/zero')),
    'sqlite file is a pipe': ('sqlite3', 'none', _pipe('first')),
    'part is a link': ('mcap', 'none', _linked('session_0.mcap.part', 'letter')),
    'a journal names a file': ('sqlite3', 'none', _super_journal),
    'endless view': ('sqlite3', 'none', _sqlite('DROP TABLE messages', ENDLESS)),
    'computed column': ('sqlite3', 'none', _sqlite(
        'ALTER TABLE messages ADD COLUMN z AS (zeroblob(999999999))')),
    'constraint that computes': ('sqlite3', 'none', _sqlite(
        'DROP TABLE topics', 'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT CHECK('
        'length(zeroblob(999999999)) > 0), type TEXT)')),
    'schema that is no text': ('sqlite3', 'none', _schema_of_no_text),
    'huge message': ('sqlite3', 'zstd', _huge_message),
    'many large messages': ('sqlite3', 'zstd', _many_large_messages),
    'many large chunks': ('mcap', 'none', _many_large_chunks),
    'many topics': ('mcap', 'none', _many_topics),
    'aliases': ('mcap', 'none', _metadata(_bomb)),
    'aliases that are merged': ('mcap', 'none', _metadata(_merge_bomb)),
    'nested metadata': ('mcap', 'none', _metadata(lambda text: 'a: ' + '[' * 5000 + text)),
    'long name': ('mcap', 'none', _metadata(
        lambda text: text.replace('session_0.mcap', 'x' * 5000))),
    'custom data': ('mcap', 'none', _metadata(
        lambda text: text.replace('custom_data: {}', 'custom_data: [1, [2]]'))),
    'other custom data': ('mcap', 'none', _metadata(
        lambda text: text.replace('custom_data: {}', 'custom_data: {recovered: {a: [1]}}'))),
    'name with control characters': ('mcap', 'none', _metadata(
        lambda text: text.replace('session_0.mcap', r'\\u001b[2Jx.mcap'))),
    'counts': ('mcap', 'none', _metadata(lambda text: text.replace(
        '"message_count": ', '"message_count": -'))),
    'mode': ('mcap', 'none', _metadata(lambda text: text.replace(
        'compression_mode: ""', 'compression_mode: {a: [1, 2]}'))),
}


def harmed(name: str, folder: Path) -> tuple[Path, Path]:
    """Return a bag that does harm, and a folder outside of it with somebody's files."""
    storage, compression, change = HARM[name]
    bag, outside = folder / 'session', folder / 'outside'
    shutil.copytree(shared_session(storage, compression), bag)
    outside.mkdir()
    for name in ('letter', 'super'):
        (outside / name).write_bytes(b"somebody's words\0" * 500)
    change(bag, outside)
    return bag, outside
