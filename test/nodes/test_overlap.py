# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies that are in each other at the start are named in the log."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('rclpy') is None:
    raise SkipTest('rclpy is not installed: pip install .[ros]')

from nodes.live import simulate

SCENE = """
bodies:
  - {name: floor, shape: {type: plane}, fixed: true}
  - {name: crate, shape: {type: box, size: [1, 1, 1]}, mass: 1, pose: {position: [0, 0, 0.45]}}
  - {name: ball, shape: {type: sphere, radius: 0.5}, mass: 1, pose: {position: [3, 0, 0.5]}}
"""


def test_the_log_names_the_bodies_and_the_depth_and_the_simulation_runs(ros, tmp_path):
    scene = tmp_path / 'scene.yaml'
    scene.write_text(SCENE, encoding='utf-8')
    process = simulate(tmp_path / 'log', str(scene), words=['--duration', '0.1'])
    assert process.wait() == 0
    line, = (line for line in process.stderr.splitlines() if 'overlap' in line)
    assert "bodies 'floor' and 'crate' overlap by 0.05 m at the start" in line
