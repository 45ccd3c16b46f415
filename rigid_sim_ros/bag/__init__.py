# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Bags: record a session, read it, restore it after a crash, simulate it again.

recorder.py takes what is published and hands it to a thread, which writes through writer.py to
one file after another (mcap_file.py or sqlite_file.py). reader.py reads what is there (scan.py,
sqlite_file.py); verify.py, export.py and info.py are made of that; recover.py mends;
playback.py reads from any time on, for a replay. No ROS is
imported. The format is described in docs/bags.md.
"""
