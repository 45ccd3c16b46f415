# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Show a bag in the page, without ROS."""
import threading

from rigid_sim_ros.signals import Stop, stop_on_signals
from rigid_sim_ros.viewer.address import open_page, PORT
from rigid_sim_ros.viewer.recording import Recording
from rigid_sim_ros.viewer.server import LOCAL, stop
from rigid_sim_ros.viewer.timeline import BagPage, Verification

RATE = 40.0     # pictures a second: some more than an eye needs, as some come late


def show_bag(path: str, stopped: threading.Event, *, host: str = LOCAL, port: int = PORT,
             rate: float = RATE) -> None:
    """
    Open a page that plays a bag, and keep it until the event is set.

    BagError if the bag cannot be shown, AddressError if the page cannot be opened there.
    """
    recording = Recording(path)
    server, _ = open_page(host, port)
    try:
        page = BagPage(server, recording)
        # Only what this package recorded can be simulated again.
        verification = Verification(page, recording) if recording.session else None
        try:
            page.run(stopped, rate)
        finally:
            if verification is not None:
                verification.stop()
    finally:
        stop(server)


def run(path: str, *, host: str = LOCAL, port: int = PORT, rate: float = RATE) -> int:
    """Show a bag until Ctrl-C or SIGTERM; return the exit code. Errors as for `show_bag`."""
    stopped = Stop()
    restore = stop_on_signals(stopped)
    try:
        show_bag(path, stopped, host=host, port=port, rate=rate)
    finally:
        restore()
    return 0
