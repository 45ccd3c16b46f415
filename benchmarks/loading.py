# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How long large scenes take to load: from a file to a world that can step.

    python benchmarks/loading.py
    python benchmarks/loading.py --output docs/scenes.md

Each is loaded in processes of its own, whose kernels are in the cache. The time of the processor
tells more on a machine that does other things too.
"""

from collections.abc import Iterator
import json
from pathlib import Path
from statistics import median
import subprocess
import sys

import numpy as np
from page import heading, line, measure

# Prints wall time and processor time of loading a scene [s], and the peak of memory [MB].
LOAD = """
import json, resource, sys, time
from rigid_sim_ros import load_scene
begin = time.perf_counter(), time.process_time()
load_scene(sys.argv[1])
print(json.dumps([time.perf_counter() - begin[0], time.process_time() - begin[1],
                  resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""
BODY = """  - name: body_{k}
    shape: {shape}
    mass: 2.0
    pose:
      position: [{x}.5, {y}.25, {z}.0]
      orientation: [0, 0, 0, 1]
"""
MESH = """format: 1
bodies:
  - {name: ground, shape: {type: plane}, fixed: true}
  - {name: part, mass: 1.0, shape: {type: mesh, file: part.obj}, pose: {position: [0, 0, 2]}}
"""


def write_bodies(folder: Path, count: int) -> Path:
    """Write a scene of boxes and balls in a block, as a user would lay it out."""
    side = round(count ** (1 / 3)) + 1
    shapes = '{type: box, size: [0.5, 0.4, 0.3]}', '{type: sphere, radius: 0.25}'
    bodies = [BODY.format(k=k, shape=shapes[k % 2], x=k % side, y=k // side % side,
                          z=1 + k // side ** 2) for k in range(count)]
    path = folder / f'{count}.yaml'
    path.write_text('format: 1\nbodies:\n  - {name: ground, shape: {type: plane}, fixed: true}\n'
                    + ''.join(bodies), encoding='utf-8')
    return path


def write_mesh(folder: Path, faces: int, dents: float) -> Path:
    """Write a scene of a ball of so many triangles, with dents of so much of its radius."""
    rings = round((faces / 4) ** 0.5)
    around = 2 * rings
    t, p = np.meshgrid(np.linspace(0.0, np.pi, rings + 1)[1:-1],
                       np.arange(around) * np.pi / rings, indexing='ij')
    corners = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    corners *= (1.0 - dents * (1.0 + np.sin(5 * t) * np.cos(7 * p)))[..., None]
    here = np.arange((rings - 1) * around).reshape(rings - 1, around)
    beside = np.roll(here, -1, axis=1)
    quads = here[:-1], here[1:], beside[:-1], beside[1:]
    a, b, c, d = (part.reshape(-1) for part in quads)
    top, bottom = here.size, here.size + 1
    triangles = np.concatenate([
        np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1),
        np.stack([np.full(around, top), here[0], beside[0]], axis=1),
        np.stack([np.full(around, bottom), beside[-1], here[-1]], axis=1)])
    poles = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    with (folder / 'part.obj').open('w', encoding='utf-8') as file:
        file.writelines('v {:.9g} {:.9g} {:.9g}\n'.format(*corner)
                        for corner in np.concatenate([corners.reshape(-1, 3), poles]))
        file.writelines('f {} {} {}\n'.format(*triangle) for triangle in triangles + 1)
    path = folder / 'mesh.yaml'
    path.write_text(MESH, encoding='utf-8')
    return path


def rows(folder: Path, repeats: int) -> Iterator[str]:
    """Give the lines of the table."""
    yield from heading(['scene', 'load [s]', 'of the processor', 'memory [MB]', 'at most [s]'])
    for name, make, most in (
            ('10 000 bodies', lambda: write_bodies(folder, 10_000), 2),
            ('100 000 bodies', lambda: write_bodies(folder, 100_000), 20),
            ('a ball of 328 000 faces', lambda: write_mesh(folder, 328_000, 0.0), 10),
            ('one with dents, of which the hull collides',
             lambda: write_mesh(folder, 328_000, 0.05), 10)):
        print(f'  {name}', file=sys.stderr, flush=True)
        words = [sys.executable, '-c', LOAD, str(make())]
        # The first one fills the caches.
        found = [json.loads(subprocess.run(words, check=True, capture_output=True).stdout)
                 for _ in range(repeats + 1)][1:]
        wall, processor, memory = (median(column) for column in zip(*found, strict=True))
        yield line([name, f'{wall:.2f}', f'{processor:.2f}', f'{memory:.0f}', most])


def main() -> int:
    """Measure, print and write down."""
    return measure('loading', __doc__, 3, 'processes for each', rows)


if __name__ == '__main__':
    sys.exit(main())
