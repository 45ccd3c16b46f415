# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `rigid_sim compile` has compiled no process compiles again."""

import os
from pathlib import Path

import fresh
import pytest

import rigid_sim_ros
from rigid_sim_ros import cli, load_scene

# Runs worlds of scenes in the ways of a node and prints which kernels had to be compiled.
COMPILED = """
import sys
from numba.core import event
from rigid_sim_ros import load_scene
from rigid_sim_ros.scene.overlap import initial_overlaps
from rigid_sim_ros.warm_up import use
with event.install_recorder('numba:compile') as recorder:
    for name in sys.argv[1:]:
        world = load_scene(name)
        initial_overlaps(world.scene)
        use(world)
        world.step(20)
        world.contacts()
print(sorted({str(entry.data['dispatcher']) for _, entry in recorder.buffer}))
"""
MODELS = {
    'timestep': '{contact: timestep}', 'qp': '{contact: timestep, solver: qp}',
    'event': '{contact: event}', 'penalty': '{contact: penalty, step: 1.0e-4}',
    **{name: f'{{contact: none, integrator: {name}}}'
       for name in ('euler', 'semi_implicit', 'rk4', 'symplectic')}}
BALLS = """
format: 1
world: {world}
materials: {{default: {{friction: 0.5, restitution: {restitution}}}}}
bodies:
  - {{name: ground, shape: {{type: plane}}, fixed: true}}
  - {{name: a, shape: {{type: sphere, radius: 0.1}}, mass: 1, pose: {{position: [0, 0, 0.1]}}}}
  - {{name: b, shape: {{type: box, size: [1, 1, 1]}}, mass: 1, pose: {{position: [2, 0, 0.5]}}}}
"""
# Nothing can touch, so that nobody looks for contacts.
ALONE = """
format: 1
bodies: [{name: ball, shape: {type: sphere, radius: 0.1}, mass: 1}]
"""
# Two pendulums: one hangs at rest and sleeps after five steps, the other swings.
PENDULUMS = """
format: 1
world: {step: 0.002}
collision: {sleep_after: 0.01}
bodies:
  - {name: a, shape: {type: box, size: [0.1, 0.1, 0.4]}, mass: 1}
  - {name: b, shape: {type: box, size: [0.1, 0.1, 0.4]}, mass: 1, pose: {position: [2, 0, 0]}}
joints:
  - {name: at_rest, type: revolute, parent: world, child: a, axis: [0, 1, 0],
     pose: {position: [0, 0, 0.2]}}
  - {name: swinging, type: revolute, parent: world, child: b, axis: [0, 1, 0],
     pose: {position: [2.1, 0, 0.2]}}
"""


def run(*words: str, cache: Path | None = None) -> str:
    """Return what Python printed in a process of its own, with a cache of its own if need be."""
    own = {} if cache is None else {'NUMBA_CACHE_DIR': str(cache)}
    done = fresh.run(*words, env=os.environ | own)
    assert (done.returncode, done.stderr) == (0, '')
    return done.stdout


def scene(folder: Path, model: str, restitution: float = 0.0) -> str:
    """Write a scene in which a ball and a box lie on the ground, and return its path."""
    path = folder / f'{model}_{restitution}.yaml'
    path.write_text(BALLS.format(world=MODELS[model], restitution=restitution), encoding='utf-8')
    return str(path)


def test_a_scene_that_was_compiled_is_not_compiled_again(tmp_path: Path) -> None:
    cache = tmp_path / 'cache'
    said = run('-m', 'rigid_sim_ros', 'compile', 't_handle', scene(tmp_path, 'rk4'), cache=cache)
    assert '2/2' in said
    assert run('-c', COMPILED, 't_handle', scene(tmp_path, 'rk4'), cache=cache) == '[]\n'
    # And nothing of what they do not need.
    assert not list(cache.rglob('*timestep*')) + list(cache.rglob('*event*'))


def test_after_all_was_compiled_no_scene_is_compiled(tmp_path: Path) -> None:
    said = run('-m', 'rigid_sim_ros', 'compile')
    assert '15/15' in said
    examples = [path.stem for path in
                (Path(rigid_sim_ros.__file__).parent / 'example_scenes').glob('*.yaml')]
    own = [scene(tmp_path, model, restitution) for model in MODELS for restitution in (0.0, 0.5)]
    pendulums = tmp_path / 'pendulums.yaml'
    pendulums.write_text(PENDULUMS, encoding='utf-8')
    alone = tmp_path / 'alone.yaml'
    alone.write_text(ALONE, encoding='utf-8')
    assert run('-c', COMPILED, *examples, *own, str(pendulums), str(alone)) == '[]\n'
    world = load_scene(pendulums)
    world.step(20)
    assert world.contact_report().asleep == 1   # the other articulation is a part of the whole


def test_nothing_is_compiled_if_one_scene_is_wrong(capsys, monkeypatch) -> None:
    monkeypatch.setattr('rigid_sim_ros.cli.precompile.World', None)
    with pytest.raises(SystemExit) as leaving:
        cli.main(['compile', 't_handle', 'towr'])
    out, err = capsys.readouterr()
    assert (leaving.value.code, out) == (2, '')
    assert err.count('\n') == 1
    assert "did you mean 'tower'?" in err
