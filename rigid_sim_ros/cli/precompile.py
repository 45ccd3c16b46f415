# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fill the cache of compiled kernels before anybody waits: for container images and CI."""

from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from rigid_sim_ros.engine.steps.contact_models import CONTACT_MODELS, JOINTED_MODELS
from rigid_sim_ros.engine.steps.free import FREE_MOTION
from rigid_sim_ros.kernels.helper_process import cores
from rigid_sim_ros.kernels.separate import finish
from rigid_sim_ros.scene import read_scene, Scene, scene_from_dict
from rigid_sim_ros.scene.overlap import initial_overlaps
from rigid_sim_ros.warm_up import use
from rigid_sim_ros.world import World

_TETRAHEDRON = {'type': 'mesh', 'vertices': [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]],
                'faces': [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]}
_BODIES: list[dict[str, Any]] = [
    {'shape': {'type': 'sphere', 'radius': 0.1}},
    {'shape': {'type': 'box', 'size': [0.2, 0.2, 0.2]}},
    {'shape': {'type': 'capsule', 'radius': 0.1, 'length': 0.2}},
    {'shape': {'type': 'cylinder', 'radius': 0.1, 'length': 0.2}},
    {'shape': _TETRAHEDRON},
    {'compound': [{'type': 'sphere', 'radius': 0.1},
                  {'type': 'box', 'size': [0.2, 0.2, 0.2], 'pose': {'position': [0.1, 0, 0]}}]}]
_SURFACE = {'friction': 0.5, 'restitution': 0.5, 'rolling': 0.01, 'spinning': 0.01}
# Of some of them: the others are free.
_JOINTS: list[dict[str, Any]] = [
    {'name': 'hinge', 'type': 'revolute', 'parent': 'body_0', 'child': 'body_1',
     'limits': {'lower': -1.0, 'upper': 1.0}, 'drive': {'mode': 'position', 'stiffness': 1.0}},
    {'name': 'slide', 'type': 'prismatic', 'parent': 'body_1', 'child': 'body_2', 'friction': 1.0}]
_WITH_JOINTS = ' with joints'
# Where nothing can touch, this model steps without looking for contacts.
_ALONE = 'timestep alone'
_SPRING = {'type': 'spring', 'a': 'body_0', 'anchor': [0, 0, 1], 'stiffness': 1.0,
           'rest_length': 1.0}


def precompile(scenes: Sequence[str], console: Console) -> None:
    """
    Compile what some scenes need, given by path or name, or everything if there are none.

    Shows how far it is. SceneError, before anything is compiled, if a scene is wrong.
    """
    contents = [read_scene(scene) for scene in scenes]
    names, done = (scenes, _compiled(contents)) if scenes else (_kinds(), _everything())
    with Progress(TextColumn('compiling'), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                  TextColumn('{task.description}', markup=False), console=console) as progress:
        task = progress.add_task('', total=len(names))
        for name in done:
            progress.update(task, advance=1, description=name)


def _compiled(contents: Sequence[Scene]) -> Iterator[str]:
    """Compile what scenes need, and give their names as they are done."""
    for scene in contents:
        _compile(scene)
        yield scene.name
    finish()


def _everything() -> Iterator[str]:
    """Compile what each kind of scene needs, a process for each core, and give their names."""
    with ProcessPoolExecutor(cores(), get_context('spawn')) as pool:
        work = {pool.submit(_compile_kind, name): name for name in _kinds()}
        for done in as_completed(work):
            done.result()
            yield work[done]


def _compile_kind(name: str) -> None:
    scene = _with_all(_kinds()[name])
    joints = {'joints': _JOINTS} if name.endswith(_WITH_JOINTS) else {}
    bodies = {'bodies': [one for one in scene['bodies'] if one['name'] == 'body_0']}
    _compile(scene_from_dict(scene | joints | (bodies if name == _ALONE else {})))
    finish()


def _compile(scene: Scene) -> None:
    """Do with a scene whatever calls kernels."""
    use(World(scene))
    initial_overlaps(scene)
    world = World(scene)
    world.threads = 2
    world.step()
    world.contacts()
    world.contact_report()
    world.restore(world.save())


def _kinds() -> dict[str, dict[str, str]]:
    """
    Return `world` of a scene, by a name, for each way in which a world can step.

    Those that take longest come first, so that no core waits for the last one.
    """
    kinds = [{'contact': contact} | ({'solver': solver} if solver else {})
             for contact, solver in CONTACT_MODELS if contact != 'none']
    kinds += [{'contact': 'none', 'integrator': name} for name in FREE_MOTION]
    named = {' '.join(kind.values()): kind for kind in kinds} | {_ALONE: {'contact': 'timestep'}}
    jointed = {name: {'contact': name} for name in (*JOINTED_MODELS, 'none')}
    jointed |= {'symplectic4': {'contact': 'none', 'integrator': 'symplectic4'}}
    return {name + _WITH_JOINTS: kind for name, kind in jointed.items()} | named


def _with_all(kind: dict[str, str]) -> dict[str, Any]:
    """
    Return a scene of a kind with all that makes a world of it call a kernel.

    Kernels are compiled for the types of their arguments, whatever the numbers are.
    """
    # Masses that differ much have a solver of their own.
    bodies = [{'name': f'body_{i}', 'mass': 1.0 if i else 100.0, **body,
               'pose': {'position': [0.19 * i, 0.0, 0.15]}} for i, body in enumerate(_BODIES)]
    sleeps = kind['contact'] == 'timestep' and kind.get('solver') != 'qp'
    return {
        # So small a step is stable with every contact stiffness that is the default.
        'format': 1, 'world': {'step': 1e-4, **kind}, 'materials': {'default': _SURFACE},
        'collision': {'sleep_after': 1.0} if sleeps else {}, 'forces': [_SPRING],
        'bodies': [{'name': 'ground', 'shape': {'type': 'plane'}, 'fixed': True}, *bodies]}
