# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a step of the example `rover` takes on a plane and on terrain of 4802 prisms.

    python benchmarks/terrain.py

Processor time of one thread: it stands for half a second, then it drives with 5 rad/s for two.
"""

from pathlib import Path
import time
from typing import Any

import numpy as np
from page import heading, line, machine
import yaml

import rigid_sim_ros
from rigid_sim_ros import World

ROVER = Path(rigid_sim_ros.__file__).parent / 'example_scenes' / 'rover.yaml'
SIDE, SIZE = 50, 20.0   # points along each side of the terrain, and how long that is [m]
HILL = 0.05     # [m]
SETTLED = 500   # steps of 1 ms before anything is measured
# Steps, and the speed of the wheels [rad/s].
PARTS = {'stands': (500, 0.0), 'drives': (2000, 5.0)}


def heights(hill: float) -> list[list[float]]:
    """Return the heights of hills about 5 m apart."""
    x = np.linspace(-0.5 * SIZE, 0.5 * SIZE, SIDE)
    return (hill * np.sin(1.3 * x)[:, None] * np.cos(1.1 * x)[None, :]).tolist()


def rover(hill: float | None) -> World:
    """Return a rover on a heightfield, or on the plane of the example."""
    spec: dict[str, Any] = yaml.safe_load(ROVER.read_text(encoding='utf-8'))
    if hill is not None:
        for one in spec['bodies']:
            if one['name'] == 'ground':
                one['shape'] = {'type': 'heightfield', 'heights': heights(hill),
                                'size': [SIZE, SIZE]}
            else:
                one['pose']['position'][2] += 1.2 * hill
    return World.from_dict(spec)


def times(world: World) -> list[float]:
    """Return the time of a step [us] of each part, its mean and the 99th percentile."""
    world.step(SETTLED)
    found = []
    for steps, speed in PARTS.values():
        for name in world.joint_names:
            world.set_joint_command(name, mode='velocity', velocity=speed)
        taken = []
        for _ in range(steps):
            begun = time.thread_time_ns()
            world.step()
            taken.append((time.thread_time_ns() - begun) / 1e3)
        found += [float(np.mean(taken)), float(np.percentile(taken, 99))]
    return found


def main() -> None:
    """Measure and print."""
    print(machine(), '', sep='\n')
    columns = [f'{part}, {what}' for part in PARTS for what in ('mean', 'p99')]
    print(*heading(['rover, us a step', *columns]), sep='\n')
    for name, hill in (('plane', None), ('flat heightfield', 0.0), ('hills', HILL)):
        world = rover(hill)
        world.step()    # compiles
        print(line([name, *(f'{value:.0f}' for value in times(world))]), flush=True)


if __name__ == '__main__':
    main()
