# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever becomes of a bag's bytes: one line and exit code 2, never a traceback or a hang."""

from pathlib import Path
import shutil
import tempfile

from bag.damage import damages, spoil
from bag.sessions import shared_session
from effort import examples
from hypothesis import given, strategies as st
import pytest

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.info import info
from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.verify import verify

# What happens to a file, at a place from 0 to 1.


def check(storage: str, compression: str, suffix: str, damage, strict: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder, 'bag')
        shutil.copytree(shared_session(storage, compression), bag)
        changed = spoil(bag, suffix, damage)
        for command in (info, verify, recover):
            try:
                found = command(bag)
            except BagError as error:
                assert '\n' not in str(error)
                continue
            if command is info and strict:
                assert not changed
            if command is verify and strict:
                assert not changed or not found.holds


@pytest.mark.parametrize('compression', ['none', 'zstd'])
@examples(40)
@given(damage=damages)
def test_no_change_of_an_mcap_file_goes_unnoticed(compression, damage) -> None:
    check('mcap', compression, '.mcap', damage, strict=True)


@pytest.mark.parametrize('compression', ['none', 'zstd'])
@examples(20)
@given(damage=damages)
def test_a_changed_sqlite_file_is_read_or_refused(compression, damage) -> None:
    # SQLite has no checksums: what is changed within a message is for `verify` to find.
    check('sqlite3', compression, '.db3', damage, strict=False)


@examples(25)
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
