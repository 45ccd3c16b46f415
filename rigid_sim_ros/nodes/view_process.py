# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of `rigid_sim run --view`: a process of its own, which lives as long as the node."""
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
import re
import subprocess
import sys

_NODE = 'rigid_sim'
_RULE = re.compile(rf'(?:{_NODE}:)?__(node|name|ns):=(.*)')
_PATIENCE = 5.0     # s until the page has closed


def name_of(ros_args: Sequence[str]) -> str:
    """Return the full name of the node that `simulate` starts with these arguments."""
    rules: dict[str, str] = {}
    for flag, word in pairwise(ros_args):
        rule = _RULE.fullmatch(word) if flag in ('-r', '--remap') else None
        if rule:
            key, value = rule.groups()
            rules.setdefault('ns' if key == 'ns' else 'node', value)
    space = rules.get('ns', '').strip('/')
    return '/'.join(['', *filter(None, [space, rules.get('node', _NODE)])])


@contextmanager
def viewing(ros_args: Sequence[str]) -> Iterator[None]:
    """Show in a page what the node does that is run in the block; the first page lets it begin."""
    # In this process the page would take the interpreter away from the step thread.
    page = subprocess.Popen(
        [sys.executable, '-m', 'rigid_sim_ros.programs', 'view', '--begin', '--node',
         name_of(ros_args)])
    try:
        yield
    finally:
        page.terminate()
        try:
            page.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            page.kill()
            page.wait()
