# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The node behind the page of a simulation.

The executor has a thread of its own; the main thread brings the page up to date.
"""
from collections.abc import Sequence
import os
import threading

from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from rigid_sim_ros.nodes.process import (
    complain, DONE, end_ros, ends_in_time, ROS_ERRORS, ros_text, start_ros, Threads)
from rigid_sim_ros.nodes.view_driver import RosDriver
from rigid_sim_ros.nodes.view_feed import Feed, simulations
from rigid_sim_ros.signals import Stop, stop_on_signals
from rigid_sim_ros.viewer.address import AddressError, open_page, PORT
from rigid_sim_ros.viewer.bag import RATE
from rigid_sim_ros.viewer.live import LivePage
from rigid_sim_ros.viewer.server import LOCAL, PageServer, stop
from rigid_sim_ros.viewer.simulation import Inbox

NODE_NAME = 'rigid_sim_view'
_NICE = 5       # levels by which the page gives way to a simulation on the same processors
_PATIENCE = 5.0     # s until an answer that has not come is asked for again
_LOOK = 0.25    # s between two looks for a simulation
_LOOKING = 'Looking for a simulation: start one with `rigid_sim run`.'


class View:
    """One page and one node, from the search for a simulation to the end."""

    def __init__(self, server: PageServer, stopped: threading.Event) -> None:
        self.node = Node(NODE_NAME)
        self._server = server
        self._stopped = stopped
        self._threads = Threads(stopped)
        self._log = self.node.get_logger()

    def run(self, target: str, rate: float, begins: bool = False) -> None:
        """Show a simulation, or the first that is found, until the end."""
        executor = EventsExecutor()
        executor.add_node(self.node)
        spinning = self._threads.make('spin', self._threads.spin, executor)
        spinning.start()
        try:
            looking = self._server.gui.add_markdown(_LOOKING)
            target = target or self._find()
            looking.remove()
            if target:
                self._show(target, rate, begins)
        finally:
            self._stopped.set()
            executor.wake()
            spinning.join()
            executor.shutdown()
        self._threads.raise_failure()

    def _show(self, target: str, rate: float, begins: bool) -> None:
        self._log.info(f'showing {target}')
        inbox = Inbox()
        feed = Feed(self.node, target, inbox)
        driver = RosDriver(self.node, target, feed.listen)
        page = LivePage(self._server, inbox, driver)
        if begins:
            self._log.info(f'{target} begins when the page is opened')
            threading.Thread(target=self._begin, args=(driver,), daemon=True).start()
        page.run(self._stopped, rate)

    def _begin(self, driver: RosDriver) -> None:
        """Wait for the first who looks, and for a simulation that can be told to go on."""
        opened, has_begun = threading.Event(), threading.Event()
        self._server.on_client_connect(lambda _: opened.set())

        def hear(text: str, success: bool) -> None:
            if success:
                has_begun.set()

        while not self._stopped.wait(_LOOK):
            if has_begun.is_set():
                return
            if opened.is_set():
                driver.pause(False, hear)
                has_begun.wait(_PATIENCE)

    def _find(self) -> str:
        """Wait for a simulation and return its name, '' at the end."""
        while not self._stopped.wait(_LOOK):
            found = simulations(self.node)
            if len(found) > 1:
                self._log.warning(f'found {", ".join(found)}: choose one with --node')
            if found:
                return found[0]
        return ''


def run(
    target: str = '', *, host: str = LOCAL, port: int = PORT, rate: float = RATE,
    begins: bool = False, ros_args: Sequence[str] = (),
) -> int:
    """
    Show a simulation until Ctrl-C or SIGTERM.

    target is the name of its node, '' for the first that is found. host and port are where the
    page is opened; rate [Hz] is how often it follows. With `begins` a paused simulation goes on as
    soon as somebody looks. Returns the exit code.
    """
    stopped = Stop()
    restore = stop_on_signals(stopped)
    try:
        os.nice(_NICE)
        start_ros(ros_args)
        server, _ = open_page(host, port)
        try:
            with ends_in_time():
                view = View(server, stopped)
                view.run(target, rate, begins)
            view.node.destroy_node()
        finally:
            stop(server)
    except (AddressError, OSError) as error:
        return complain(str(error))
    except ROS_ERRORS as error:
        return complain(ros_text(error))
    finally:
        end_ros()
        restore()
    return DONE
