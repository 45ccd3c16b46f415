# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the process that is forked imports, and which kernels it has, once: see forked.py."""

import contextlib
import gc
from importlib import import_module

from rclpy.type_support import check_for_type_support

from rigid_sim_ros.kernels.separate import finish
from rigid_sim_ros.messages.topics import PUBLISHED
from rigid_sim_ros.nodes.publishers import message_class
from rigid_sim_ros.warm_up import use
from rigid_sim_ros.world import load_scene

for program in ('rigid_sim_ros.nodes.simulate', 'rigid_sim_ros.nodes.replay.node',
                'rigid_sim_ros.nodes.view', 'rigid_sim_ros.cli'):
    import_module(program)
for topic in PUBLISHED.values():
    with contextlib.suppress(ImportError):      # tf2_msgs is not among the ROS wheels
        check_for_type_support(message_class(topic.type))
# To read kernels from the cache takes a node a third of a second of a processor. These scenes have
# those of nearly all nodes: of a body alone, of contacts, of joints with contacts.
for scene in ('tumbling_cubesat', 'tower', 'gripper'):
    use(load_scene(scene))
finish()    # if they were compiled: a fork would have the names of processes that are not its own
# A node looks for cycles before it begins. In what it has from here it would find none, and would
# copy all of that memory: 0.1 s of a processor.
gc.freeze()
