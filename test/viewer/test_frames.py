# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frames by their names, also those of bodies whose names have a slash."""
from rigid_sim_ros.scene import scene_from_dict
from rigid_sim_ros.viewer.frames import frames_of


def test_links_and_frames_of_a_model_are_told_apart():
    scene = scene_from_dict({'world': {'contact': 'none'}, 'bodies': [
        {'name': 'arm/link1', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1}},
        {'name': 'arm/link2', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
         'frames': {'tip': {'position': [0.1, 0, 0]}}},
        {'name': 'crate', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
         'frames': {'handle': {'orientation': [0, 0, 1, 0]}}}]})
    found = frames_of(scene)
    assert found.keys() == scene.frame_names.keys()
    assert [found[name].body for name in ('arm/link1', 'arm/link2', 'arm/link2/tip')] == [0, 1, 1]
    assert found['arm/link2/tip'].position.tolist() == [0.1, 0.0, 0.0]
    assert found['crate/handle'].orientation.tolist() == [0.0, 0.0, 1.0, 0.0]
