# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a user may do with a world once "compiling took" was said, with a cache that was empty before.

`python first_calls.py SCENE` prints each call in which a kernel is compiled yet, or this process
waits for one that another compiles, with the kernels.
"""

from collections.abc import Callable
import contextlib
import sys
from typing import Any

from numba.core import event
import numpy as np

from rigid_sim_ros import load_scene, World
from rigid_sim_ros.kernels import helper_process
from rigid_sim_ros.warm_up import announced, warm_up


class Compiled(event.Listener):
    """Notes what is compiled."""

    def __init__(self) -> None:
        self.kernels: list[str] = []

    def on_start(self, event: Any) -> None:
        """Note a kernel."""
        self.kernels.append(str(event.data['dispatcher']))

    def on_end(self, event: Any) -> None:
        """Do nothing."""


def calls(world: World) -> dict[str, Callable[[], object]]:
    """Return what a user may call, by name, in the order in which it is called."""
    body = next(body.name for body in world.scene.spec.bodies if body.is_pushed)
    found: dict[str, Callable[[], object]] = {
        'attributes': lambda: [getattr(world, name) for name in dir(type(world))
                               if isinstance(getattr(type(world), name), property)],
        'contacts': world.contacts, 'contact_wrenches': world.contact_wrenches,
        'contact_report': world.contact_report, 'save': world.save, 'hash': world.state_hash,
        'one step': world.step, 'steps': lambda: world.step(200),
        'contacts then': world.contacts,
        'impulse': lambda: world.apply_impulse(body, (0, 0, 1)),
        'impulse at a point': lambda: world.apply_impulse(
            body, (0, 0, 1), point=(0.1, 0, 0), frame=body),
        'wrench': lambda: world.apply_wrench(body, (0, 0, 1), duration=0.1),
        'wrench at a point': lambda: world.apply_wrench(
            body, (0, 0, 1), (0, 0, 1), frame=body, point=(0.1, 0, 0)),
        'step with wrenches': lambda: world.step(3),
        'set_pose': lambda: world.set_pose(body, (0, 0, 3), (0, 0, 0, 1)),
        'set_twist': lambda: world.set_twist(body, (0, 0, 3), (0, 0, 0)),
        'energy': lambda: (world.kinetic_energy(), world.potential_energy()),
        'momentum': lambda: (world.total_momentum(), world.total_angular_momentum()),
        'restore': lambda: world.restore(world.save()), 'restored': lambda: world.step(3),
        'add': lambda: world.add({'name': 'newcomer', 'mass': 1.0, 'pose': {
            'position': [0, 0, 9]}, 'shape': {'type': 'sphere', 'radius': 0.1}}),
        'step with a newcomer': lambda: world.step(3),
        'remove': lambda: world.remove('newcomer'), 'step without it': lambda: world.step(3)}
    if world.joint_names:
        found |= calls_of_joints(world, world.joint_names[0], body)
    return found | {'reset': world.reset, 'step after it': lambda: world.step(3)}


def calls_of_joints(world: World, joint: str, body: str) -> dict[str, Callable[[], object]]:
    """Return what a user of joints may call."""
    model = joint.partition('/')[0]
    return {
        'joint_wrench': lambda: world.joint_wrench(joint),
        'set_joint_command': lambda: world.set_joint_command(joint, effort=0.1),
        'step with a command': lambda: world.step(3),
        'set_joint_state': lambda: world.set_joint_state(joint, 0.1),
        'mass_matrix': lambda: world.mass_matrix(model),
        'jacobian': lambda: world.jacobian(model, body),
        'inverse_dynamics': lambda: world.inverse_dynamics(
            model, np.zeros(len(world.joint_names)))}


def main(scene: str) -> None:
    """Print what compiles too late."""
    world = announced(lambda: load_scene(scene))
    warm_up(world.scene)
    compiled = Compiled()
    event.register('numba:compile', compiled)
    helper_process.waiting.append(
        lambda begins: compiled.kernels.append('of another process') if begins else None)
    for name, call in calls(world).items():
        with contextlib.suppress(ValueError):   # such as a pose of what joints hold
            call()
        if compiled.kernels:
            print(f'{name}: {", ".join(compiled.kernels)}')
            compiled.kernels.clear()
    print('done')


if __name__ == '__main__':
    main(sys.argv[1])
