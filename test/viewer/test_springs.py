# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the ends of springs are drawn."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

import numpy as np
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.viewer.motion import Motion
from rigid_sim_ros.viewer.springs import spring_ends

HALF = np.sqrt(0.5)
SCENE = {
    'format': 1, 'world': {'contact': 'none'},
    'bodies': [
        # Turned by 90 degrees about z: x of the body is y of the world.
        {'name': 'a', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
         'pose': {'position': [1, 0, 0], 'orientation': [0, 0, HALF, HALF]},
         'frames': {'handle': {'position': [0.5, 0, 0]}}},
        {'name': 'b', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1},
         'pose': {'position': [0, 0, 3]},
         'frames': {'turned': {'position': [0, 0, 1], 'orientation': [0, 0, HALF, HALF]}}}],
    'forces': [
        {'type': 'spring', 'a': 'a/handle', 'anchor': [4, 5, 6], 'stiffness': 1},
        {'type': 'wind', 'velocity': [1, 0, 0]},
        {'type': 'spring', 'a': 'a', 'b': 'b', 'stiffness': 1},
        {'type': 'hold_point', 'a': 'a', 'b': 'b/turned', 'anchor': [2, 0, 0], 'stiffness': 1}]}


def test_ends_are_where_the_scene_says():
    w = World.from_dict(SCENE)
    motion = Motion(0, w.position, w.orientation, w.linear_velocity, w.angular_velocity)
    a, b = spring_ends(w.scene)
    assert a.places(motion) == pytest.approx(np.array([[1, 0.5, 0], [1, 0, 0], [1, 0, 0]]))
    assert b.places(motion) == pytest.approx(np.array([[4, 5, 6], [0, 0, 3], [0, 2, 4]]))


def test_ends_are_found_by_whole_names_with_slashes():
    scene = {**SCENE, 'bodies': [
        {**SCENE['bodies'][0], 'name': 'm/a', 'frames': {
            'm/tool': {'position': [0.5, 0, 0]}, 'own': {'position': [0, 0, 2]}}}], 'forces': [
        {'type': 'spring', 'a': 'm/tool', 'anchor': [4, 5, 6], 'stiffness': 1},
        {'type': 'spring', 'a': 'm/a/own', 'anchor': [4, 5, 6], 'stiffness': 1},
        {'type': 'spring', 'a': 'm/a', 'anchor': [4, 5, 6], 'stiffness': 1}]}
    w = World.from_dict(scene)
    motion = Motion(0, w.position, w.orientation, w.linear_velocity, w.angular_velocity)
    a, _ = spring_ends(w.scene)
    assert a.places(motion) == pytest.approx(np.array([[1, 0.5, 0], [1, 0, 2], [1, 0, 0]]))


def test_ends_move_with_their_bodies():
    w = World.from_dict(SCENE)
    w.set_pose('a', (0, 0, -1), (0, 0, 0, 1))
    motion = Motion(0, w.position, w.orientation, w.linear_velocity, w.angular_velocity)
    a, b = spring_ends(w.scene)
    assert a.places(motion)[0] == pytest.approx([0.5, 0, -1])
    assert b.places(motion)[0] == pytest.approx([4, 5, 6])


def test_a_scene_without_springs_has_no_ends():
    scene = {key: value for key, value in SCENE.items() if key != 'forces'}
    w = World.from_dict(scene)
    motion = Motion(0, w.position, w.orientation, w.linear_velocity, w.angular_velocity)
    assert [len(ends.places(motion)) for ends in spring_ends(w.scene)] == [0, 0]
