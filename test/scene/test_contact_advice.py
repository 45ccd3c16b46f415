# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`rigid_sim check` tells of masses, sizes and speeds that contacts will not resolve."""

from typing import Any

import pytest

from rigid_sim_ros.scene import scene_from_dict
from rigid_sim_ros.scene.contact_advice import describe_contact


def box(name: str, size: float = 1.0, **keys: Any) -> dict[str, Any]:
    """Return a body of 1 kg, if the keys give no other mass, away from all others."""
    place = 10.0 * (sum(map(ord, name)) % 97)
    return {'name': name, 'shape': {'type': 'box', 'size': [size] * 3}, 'mass': 1.0,
            'pose': {'position': [place, 0, 2]}, **keys}


GROUND = {'name': 'ground', 'fixed': True, 'shape': {'type': 'plane'}}


def lines(*bodies: dict[str, Any], step: float = 1e-3, collision: Any = None,
          **world: Any) -> list[str]:
    """Return what is said of these bodies above the ground."""
    return list(describe_contact(scene_from_dict({
        'world': {'step': step, **world}, 'bodies': [GROUND, *bodies],
        # Soft enough for the penalty model to be stable in steps of this length.
        'materials': {'default': {'stiffness': 1e3}},
        'collision': collision or {}})))


def test_nothing_is_said_of_what_goes_well() -> None:
    assert lines(box('a', mass=999), box('b'), box('c', 0.01, twist={'linear': [5, 0, 0]})) == []


def test_a_heavy_body_and_the_light_one_that_it_may_lie_on_are_named() -> None:
    line, = lines(box('light'), box('ship', mass=10_000), box('other', mass=100))
    assert line.startswith("body 'ship' weighs 1e+04 kg, 1e+04 times what 'light' does")
    assert 'contact: event' in line


@pytest.mark.parametrize('apart', [
    {'collides': False}, {'groups': ['ghosts'], 'collides_with': ['ghosts']}])
def test_bodies_that_never_touch_may_weigh_what_they_like(apart: dict[str, Any]) -> None:
    assert lines(box('light', **apart), box('ship', mass=10_000)) == []
    assert lines(box('light'), box('ship', mass=10_000),
                 collision={'ignore': [['light', 'ship']]}) == []
    assert lines(box('light'), box('ship', mass=10_000), contact='event') == []


def test_a_body_that_falls_by_a_tenth_of_its_radius_in_a_step_is_too_small() -> None:
    # g h^2 / 2 = 1.36 mm at 1/60 s, against half of a diagonal, 0.866 of the size.
    assert lines(box('grain', 0.016), step=1 / 60) == []
    line, = lines(box('grain', 0.0156), step=1 / 60)
    assert line.startswith("body 'grain' reaches 0.0135 m from its middle and falls 0.00136 m")
    step = float(line.split('at most ')[1].split()[0])
    assert lines(box('grain', 0.0156), step=step) == []


@pytest.mark.parametrize('twist', [
    {'linear': [61, 0, 0]}, {'angular': [0, 0, 75]},
    {'linear': [30, 0, 0], 'angular': [0, 38, 0]}])
def test_a_body_that_crosses_half_of_both_in_a_step_is_too_fast(twist: dict[str, Any]) -> None:
    slow = {key: [0.97 * v for v in values] for key, values in twist.items()}
    # A panel 0.02 m thick and a cube of 0.1 m, of which a corner is 0.0866 m out.
    panel = {**box('panel'), 'shape': {'type': 'box', 'size': [0.02, 1, 1]}}
    far = {'pose': {'position': [0, 0, 9]}, 'compound': [
        {'type': 'box', 'size': [0.1] * 3, 'pose': {'position': [0.73, 0, 0]}}], 'shape': None}

    def dart(motion: dict[str, Any]) -> dict[str, Any]:
        own = far if 'angular' in motion else {}
        body = {**box('dart', 0.1), **own, 'twist': motion,
                'inertial': {'mass': 1, 'inertia': [1, 1, 1, 0, 0, 0]}}
        del body['mass']
        return {key: value for key, value in body.items() if value is not None}
    assert lines(dart(slow), panel, contact='penalty') == []
    line, = lines(dart(twist), panel, contact='penalty')
    assert line.startswith("body 'dart' moves by 0.06")
    assert "may cross 'panel', 0.02 m thick" in line
    step = float(line.split('at most ')[1].split()[0])
    assert lines(dart(twist), panel, contact='penalty', step=step) == []
    # Those look as far ahead as bodies move.
    assert lines(dart(twist), panel, contact='event') == []
    assert lines(dart(twist), panel, contact='timestep') == []


def test_a_kinematic_body_may_be_too_fast_as_well() -> None:
    bat = {**box('bat', 0.1, twist={'linear': [0, 0, 110]}), 'kinematic': True}
    line, = lines(bat, box('ball', 0.1), contact='penalty')
    assert "body 'bat' moves by 0.11 m in a step and may cross 'ball'" in line


def test_many_lines_are_summed_up() -> None:
    found = lines(*(box(f'grain_{k}', 1e-3) for k in range(9)), step=0.01)
    assert len(found) == 4
    assert found[-1] == '6 more bodies are too small for the step'
