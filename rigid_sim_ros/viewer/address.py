# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a page is opened, and what its user is told about that."""
import secrets
import socket
import sys

from rigid_sim_ros.viewer.server import is_local, LOCAL, PageServer, start

PORT = 8080
_EVERYWHERE = frozenset({'0.0.0.0', '::'})


class AddressError(ValueError):
    """The page cannot be opened where it should be; the message says why."""


def open_page(host: str = LOCAL, port: int = PORT) -> tuple[PageServer, str]:
    """
    Open a page and print its address; return the server and the address.

    Away from this machine's own addresses a secret token is made up, which the printed address
    holds, and a warning is printed. AddressError where the machine has no such address.
    """
    _check(host)
    token = '' if is_local(host) else secrets.token_urlsafe(24)
    server = start(host, port, token)
    name = socket.gethostname() if host in _EVERYWHERE else host
    place = f'[{name}]' if ':' in name else name
    address = f'http://{place}:{server.get_port()}/' + (f'?token={token}' if token else '')
    if token:
        print(f'rigid_sim: warning: the page is open on {host}: anyone who has the address below '
              'can drive the simulation, and whoever listens in on the network can read it',
              file=sys.stderr, flush=True)
    print(f'the page is at {address}', flush=True)
    return server, address


def _check(host: str) -> None:
    """Try to open a port at a host; viser would try for ever."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.bind(address)
    except OSError as error:
        raise AddressError(f'--host {host}: {error.strerror or error}: must be an address of '
                           f'this machine, such as {LOCAL} or 0.0.0.0') from None
