# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Properties of all scenes: the text gives the same scene again, and nothing but SceneError."""

from functools import cache
from typing import Any

from effort import examples
from hypothesis import given, HealthCheck, strategies as st
import numpy as np
import pytest

from rigid_sim_ros.engine.dynamics.forces import FORCES
from rigid_sim_ros.scene import (
    example_names, read_scene, Scene, scene_from_dict, scene_from_text, SceneError)

RUN = examples(50, deadline=None, derandomize=True,
               suppress_health_check=[HealthCheck.too_slow])

numbers = st.floats(-100, 100)
positives = st.floats(1e-3, 100)
vectors = st.lists(numbers, min_size=3, max_size=3)
NAMES = ('a', 'b_1', 'C')


@st.composite
def quaternions(draw: st.DrawFn) -> list[float]:
    """Draw a quaternion, normalised to a few digits or to the last."""
    q = np.array(draw(st.lists(st.floats(-1, 1), min_size=4, max_size=4)))
    q = q / np.linalg.norm(q) if np.linalg.norm(q) > 0.1 else np.array([0.0, 0.0, 0.0, 1.0])
    return list(np.round(q, draw(st.sampled_from([4, 17]))).tolist())


poses = st.fixed_dictionaries({}, optional={'position': vectors, 'orientation': quaternions()})
solids = st.one_of(
    st.fixed_dictionaries({'type': st.just('sphere'), 'radius': positives}),
    st.fixed_dictionaries({'type': st.just('box'),
                           'size': st.lists(positives, min_size=3, max_size=3)}),
    st.fixed_dictionaries({'type': st.sampled_from(['capsule', 'cylinder']), 'radius': positives,
                           'length': positives}),
    st.fixed_dictionaries({
        'type': st.just('mesh'), 'scale': positives,
        'vertices': st.just([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.1, 0.2, 0.7]]),
        'faces': st.just([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])}),
)
shapes = st.one_of(solids, st.fixed_dictionaries({'compound': st.lists(
    st.builds(lambda solid, pose: {**solid, 'pose': pose}, solids, poses),
    min_size=1, max_size=3)}))
forces = st.one_of(
    st.fixed_dictionaries({'type': st.just('wind'), 'velocity': vectors, 'drag': positives}),
    st.fixed_dictionaries({'type': st.just('spring'), 'a': st.sampled_from([*NAMES, 'a/tip']),
                           'anchor': vectors, 'stiffness': positives}),
    st.fixed_dictionaries({'type': st.just('hold_orientation'), 'a': st.just('C'),
                           'orientation': quaternions(), 'stiffness': positives}),
)


@st.composite
def scenes(draw: st.DrawFn) -> dict[str, Any]:
    """Draw a scene without mistakes."""
    bodies = []
    for name in NAMES:
        body = draw(st.fixed_dictionaries(
            {'shape': shapes, draw(st.sampled_from(['mass', 'density'])): positives},
            optional={'pose': poses, 'twist': st.fixed_dictionaries({'angular': vectors}),
                      'color': st.just([0.1, 0.2, 0.3]), 'material': st.just('rubber')}))
        bodies.append({'name': name, **body})
    bodies[0]['frames'] = {'tip': draw(poses)}
    return {
        'world': {'step': draw(st.floats(1e-9, 1)), 'gravity': draw(vectors)},
        'materials': {'rubber': {'friction': draw(positives)}},
        'bodies': bodies,
        'forces': draw(st.lists(forces, max_size=3)),
    }


def bits(scene: Scene) -> list[bytes]:
    """Return every number of a scene that a run depends on."""
    arrays = [*scene.state, *scene.model[:-1], *scene.model.forces]
    return [np.asarray(array).tobytes() for array in arrays]


@given(scenes())
@RUN
def test_the_text_of_a_scene_gives_the_same_scene_to_the_bit(data: dict[str, Any]) -> None:
    scene = scene_from_dict(data)
    again = scene_from_text(scene.text)
    assert again.text == scene.text
    assert bits(again) == bits(scene)
    assert (again.frame_names, again.step_ns) == (scene.frame_names, scene.step_ns)


@pytest.mark.parametrize('name', example_names())
def test_the_text_of_an_example_gives_the_same_scene_to_the_bit(name: str) -> None:
    scene = read_scene(name)
    again = scene_from_text(scene.text)
    assert again.text == scene.text
    assert bits(again) == bits(scene)


def reads_or_refuses(text: str) -> None:
    """Check that a text gives a scene or a SceneError of one line for each problem."""
    try:
        scene_from_text(text)
    except SceneError as error:
        assert len(str(error).splitlines()) == len(error.problems)
        assert '\n' not in error.summary


@given(st.text(max_size=80))
@RUN
def test_any_text_is_read_or_refused(text: str) -> None:
    reads_or_refuses(text)


@given(st.text(alphabet=' \n-:,[]{}&*!|>\'"%@`#?~<a1.\t\\', max_size=40))
@RUN
def test_any_text_of_yaml_signs_is_read_or_refused(text: str) -> None:
    reads_or_refuses(text)


@cache
def example(name: str) -> str:
    """Return the text of an example."""
    return read_scene(name).text


@given(st.sampled_from(sorted(example_names())), st.data())
@RUN
def test_an_example_with_a_piece_replaced_is_read_or_refused(
        name: str, data: st.DataObject) -> None:
    text = example(name)
    start = data.draw(st.integers(0, len(text)))
    length = data.draw(st.integers(0, 40))
    reads_or_refuses(text[:start] + data.draw(st.text(max_size=8)) + text[start + length:])


junk = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.text(max_size=5), inner, max_size=4)), max_leaves=8)


def places(data: Any) -> list[tuple[Any, Any]]:
    """Return every container of a scene with each of its keys or indices."""
    keys = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    below = [place for key in keys for place in places(data[key])]
    return [(data, key) for key in keys] + below


@given(scenes(), junk, st.data())
@RUN
def test_a_scene_with_one_value_replaced_is_read_or_refused(
        scene: dict[str, Any], value: Any, data: st.DataObject) -> None:
    holder, key = data.draw(st.sampled_from(places(scene)))
    holder[key] = value
    try:
        scene_from_dict(scene)
    except SceneError as error:
        assert len(str(error).splitlines()) == len(error.problems)


PARAMETERS = [(kind, parameter.name) for kind in FORCES for parameter in FORCES[kind].parameters]


@given(scenes(), st.sampled_from(PARAMETERS), junk)
@RUN
def test_a_force_with_any_parameter_is_read_or_refused(
        scene: dict[str, Any], place: tuple[str, str], value: Any) -> None:
    kind, parameter = place
    force = {'type': kind, parameter: value}
    if FORCES[kind].ends == 'ab':
        force |= {'a': 'a', 'b': 'b_1'}
    try:
        scene_from_dict({**scene, 'forces': [force]})
    except SceneError as error:
        assert error.problems


@given(scenes(), st.sampled_from([1e-308, 1e-160, 1e160, 1e308]), st.data())
@RUN
def test_extreme_numbers_are_refused_or_give_finite_ones(
        scene: dict[str, Any], number: float, data: st.DataObject) -> None:
    leaves = [place for place in places(scene['bodies'])
              if isinstance(place[0][place[1]], float)]
    holder, key = data.draw(st.sampled_from(leaves))
    holder[key] = number
    try:
        built = scene_from_dict(scene)
    except SceneError:
        return
    assert all(np.isfinite(array).all() for array in (*built.state, *built.model[:-1]))
