# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whatever becomes of a bag's bytes: one line and exit code 2, soon, and nothing outside is touched.

Never a traceback, a hang, or a verdict that is wrong.
"""

from pathlib import Path
import shutil
import tempfile

from bag.damage import damages, spoil
from bag.hostile import COMMANDS, contents, limited_time
from bag.sessions import brief_session
from effort import examples
from hypothesis import given, strategies as st
import pytest

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.verify import verify


def check(storage: str, compression: str, suffix: str, damage, strict: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        bag, beside = Path(folder, 'bag'), Path(folder, 'beside')
        shutil.copytree(brief_session(storage, compression), bag)
        beside.write_bytes(b"somebody's words")
        changed = spoil(bag, suffix, damage)
        before = contents(bag)
        for name, command in COMMANDS.items():      # `recover` is the last one
            try:
                with limited_time():
                    found = command(bag)
            except BagError as error:
                assert str(error).isprintable()
                continue
            if name == 'info' and strict:
                assert not changed
            if name == 'verify' and strict:
                assert not changed or not found.holds
            assert name == 'recover' or contents(bag) == before
        assert beside.read_bytes() == b"somebody's words"
        assert {path.name for path in Path(folder).iterdir()} <= {'bag', 'beside', 'bag.csv'}
        check_recovered(bag, strict=strict and changed)


def check_recovered(bag: Path, *, strict: bool) -> None:
    """Check that what `recover` has made or left is one bag for all commands."""
    try:
        if not recover(bag).is_whole:
            assert recover(bag).is_whole
    except BagError:
        return      # nothing of it can be read any more
    info(bag)
    try:
        verdict = verify(bag)
    except BagError:
        return      # whole, and of another program or without its beginning
    assert verdict.faults == ()
    if strict:      # the checksums let no changed message through: what is there is as it was
        assert verdict.difference is None or 'nothing' in verdict.difference.text


@pytest.mark.parametrize('compression', ['none', 'zstd'])
@examples(25)
@given(damage=damages)
def test_no_change_of_an_mcap_file_goes_unnoticed(compression, damage) -> None:
    check('mcap', compression, '.mcap', damage, strict=True)


@pytest.mark.parametrize('compression', ['none', 'zstd'])
@examples(12)
@given(damage=damages)
def test_a_changed_sqlite_file_is_read_or_refused(compression, damage) -> None:
    # SQLite has no checksums: what is changed within a message is for `verify` to find.
    check('sqlite3', compression, '.db3', damage, strict=False)


@examples(15)
@given(damage=damages)
def test_changed_metadata_are_read_or_refused(damage) -> None:
    check('mcap', 'none', 'metadata.yaml', damage, strict=False)


@examples(25)
@given(content=st.binary(max_size=300), name=st.sampled_from(['bag_0.mcap', 'bag_0.db3']),
       begins=st.booleans())
def test_any_bytes_are_read_or_refused(content, name, begins) -> None:
    magic = b'\x89MCAP0\r\n' if name.endswith('.mcap') else b'SQLite format 3\0'
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / name).write_bytes((magic if begins else b'') + content)
        for path in (folder, Path(folder) / name):
            with pytest.raises(BagError):
                info(path)
