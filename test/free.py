# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS domains and ports that no other test of this machine has, whichever process it runs in."""

from collections.abc import Iterable
import fcntl
from pathlib import Path
import random
import socket
import tempfile
from typing import IO

# Open as long as this process lives, and so are the locks on them.
_locks: list[IO[str]] = []
# Linux takes the ports of outgoing connections from 32768 on.
_PORTS = range(20_000, 30_000)


def free_domain() -> int:
    """
    Return a ROS domain in which no DDS participant listens, and let no other test have it.

    The first participant of domain d takes UDP port 7410 + 250 d (DDSI-RTPS 2.5, 9.6.1.1).
    Domains above 101 share their ports with outgoing connections of Linux.
    """
    return _first('domain', range(1, 102), socket.SOCK_DGRAM, lambda domain: 7410 + 250 * domain)


def free_port() -> int:
    """Return a TCP port at which nobody listens, and let no other test have it."""
    return _first('port', random.SystemRandom().sample(_PORTS, 100), socket.SOCK_STREAM,
                  lambda port: port)


def _first(what: str, numbers: Iterable[int], kind: socket.SocketKind, port_of) -> int:
    """Return the first number that nobody has whose port is free."""
    for number in numbers:
        try:
            lock = (Path(tempfile.gettempdir()) / f'rigid_sim_ros_{what}_{number}').open('w')
        except PermissionError:     # another user's
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.bind(('', port_of(number)))
        except OSError:
            lock.close()
            continue
        _locks.append(lock)
        return number
    raise RuntimeError(f'no {what} is free')
