# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever a bag is made to do: one line, soon, with little memory, and nothing outside of it."""

import json
from pathlib import Path
import subprocess
import sys

from bag.hostile import COMMANDS, contents, HARM, harmed, limited_time
import pytest

from rigid_sim_ros.bag.errors import BagError

# What a reader may ignore: it is not a part of what the metadata tell of.
HARMLESS = {'reserve is a link', 'reserve is a pipe', 'reserve is a hard link',
            'metadata part is a link', 'part is a link'}


@pytest.mark.parametrize('command', COMMANDS)
@pytest.mark.parametrize('name', HARM)
def test_a_bag_is_read_or_refused_soon_and_reaches_nothing_outside(tmp_path, name, command):
    bag, outside = harmed(name, tmp_path)
    before, inside = contents(outside), contents_of(bag)
    try:
        with limited_time():
            COMMANDS[command](bag)
    except BagError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 1000
    else:
        assert command == 'recover' or name in HARMLESS
    assert contents(outside) == before
    if command != 'recover':
        assert contents_of(bag) == inside


def contents_of(bag: Path) -> list[tuple[str, int]]:
    return sorted((path.name, path.lstat().st_size) for path in bag.iterdir())


# Runs a command on a bag and prints by how much memory [bytes] that has grown.
MEMORY = """
import json, resource, sys
from pathlib import Path
from bag.hostile import COMMANDS
from bag.sessions import shared_session
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.topics import typestore
from rigid_sim_ros.bag.verify import verify
typestore()
verify(shared_session())
grown = {}
for command in COMMANDS:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        COMMANDS[command](Path(sys.argv[1]))
    except BagError:
        pass
    grown[command] = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
print(json.dumps(grown))
"""


@pytest.mark.parametrize('name', [
    'huge message', 'aliases', 'file is a device', 'computed column', 'constraint that computes'])
def test_a_bag_that_is_refused_takes_little_memory(tmp_path, name):
    bag, _ = harmed(name, tmp_path)
    done = subprocess.run([sys.executable, '-c', MEMORY, str(bag)], capture_output=True, text=True,
                          check=True, cwd=Path(__file__).parents[1])
    size = sum(path.lstat().st_size for path in bag.iterdir())
    for command, grown in json.loads(done.stdout).items():
        assert grown < size + 200e6, command
