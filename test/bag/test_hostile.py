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


# Prints by how much memory [bytes] each command on each bag grows, in processes of their own that
# have what any command needs already.
MEMORY = """
import json, os, sys
from pathlib import Path
from bag.hostile import COMMANDS
from bag.sessions import shared_session
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.topics import typestore
from rigid_sim_ros.bag.verify import verify
typestore()
verify(shared_session())

def most(work, bag=None):
    child = os.fork()
    if child == 0:
        status = 1
        try:
            work(bag)
            status = 0
        except BagError:
            status = 0
        finally:
            os._exit(status)
    _, status, used = os.wait4(child, 0)
    assert status == 0
    return 1024 * used.ru_maxrss

least = most(lambda bag: None)
print(json.dumps([{name: most(command, Path(bag)) - least for name, command in COMMANDS.items()}
                  for bag in sys.argv[1:]]))
"""
HUNGRY = ['huge message', 'many large messages', 'many large chunks', 'many topics', 'aliases',
          'file is a device', 'computed column', 'constraint that computes']


@pytest.fixture(scope='module')
def hungry(tmp_path_factory):
    """Return the folders of bags that want much memory, and what each command took for each."""
    bags = [harmed(name, tmp_path_factory.mktemp('hungry'))[0] for name in HUNGRY]
    done = subprocess.run([sys.executable, '-c', MEMORY, *map(str, bags)], capture_output=True,
                          text=True, check=True, cwd=Path(__file__).parents[1])
    return dict(zip(HUNGRY, zip(bags, json.loads(done.stdout), strict=True), strict=True))


@pytest.mark.parametrize('name', HUNGRY)
def test_a_bag_that_is_refused_takes_little_memory(hungry, name):
    bag, grown = hungry[name]
    size = sum(path.lstat().st_size for path in bag.iterdir())
    for command in COMMANDS:
        assert grown[command] < size + 200e6, command
