# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node `view`: a web page that shows and drives a running simulation or replay, or a bag."""
from collections.abc import Sequence
import sys

from rclpy.utilities import remove_ros_args

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.nodes.process import complain, Parser, ROS_ERRORS, ros_text
from rigid_sim_ros.viewer import is_installed, NEEDED


def main(args: Sequence[str] | None = None) -> int:
    """Run the ROS executable `view`: [BAG] [--node NAME] [--host H] [--ros-args ...]."""
    if not is_installed():
        return complain(NEEDED)
    from rigid_sim_ros.nodes.view_node import run
    from rigid_sim_ros.viewer.address import AddressError, PORT
    from rigid_sim_ros.viewer.bag import RATE, run as run_bag
    from rigid_sim_ros.viewer.server import LOCAL

    words = list(sys.argv if args is None else ['view', *args])
    parser = Parser(prog='view', description='Show and drive a simulation in a web page.')
    parser.add_argument('bag', nargs='?', metavar='BAG',
                        help='play this bag, instead of a simulation')
    parser.add_argument('--node', default='', metavar='NAME',
                        help='node of the simulation; without it the first that is found')
    parser.add_argument('--begin', action='store_true',
                        help='let a simulation that is paused begin once somebody looks')
    parser.add_argument('--host', default=LOCAL, metavar='ADDRESS',
                        help=f'where to open the page; default {LOCAL}: for this machine only')
    parser.add_argument('--port', type=int, default=PORT, metavar='PORT',
                        help=f'the next free one from here on; default {PORT}')
    parser.add_argument('--rate', type=float, default=RATE, metavar='HZ',
                        help=f'how often the page follows at most; default {RATE:g}')
    try:
        own_words = remove_ros_args(words)[1:]
    except ROS_ERRORS as error:
        return complain(ros_text(error))
    options = parser.parse_args(own_words)
    if not 0 < options.rate < float('inf'):
        parser.error(f'argument --rate: {options.rate} Hz, must be > 0 and finite')
    if not 0 <= options.port < 65536:
        parser.error(f'argument --port: {options.port}, must be from 0 to 65535')
    if options.bag is not None:
        try:
            return run_bag(options.bag, host=options.host, port=options.port, rate=options.rate)
        except (AddressError, BagError) as error:
            return complain(str(error))
    return run(options.node, host=options.host, port=options.port, rate=options.rate,
               begins=options.begin, ros_args=words)
