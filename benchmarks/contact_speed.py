# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Speed of the model `timestep`: `python benchmarks/contact_speed.py`.

Prints steps a second in the scenes in which other engines were measured (240 steps a second of
simulated time), the median of several runs from the start of the scene, one thread, sleeping off.
Compare with runs in turn on the same machine only.
"""

import statistics
import time

from contact_quality import box, H, heap_of_balls, heap_of_boxes, world

REPEATS = 3


def tower(count):
    """Return a tower of boxes."""
    return world([box(f'b{k}', (1, 1, 1), 1.0, (0, 0, 0.5 + k)) for k in range(count)], H, 0.6)


def pyramid():
    """Return a pyramid of 210 boxes."""
    return world([box(f'b{k}_{i}', (1, 1, 1), 1.0, ((i - (19 - k) / 2) * 1.05, 0, 0.5 + k))
                  for k in range(20) for i in range(20 - k)], H, 0.6)


CASES = (('spheres 666', heap_of_balls, 1200), ('stack 10', lambda: tower(10), 2400),
         ('stack 20', lambda: tower(20), 2400), ('pyramid 210', pyramid, 1200),
         ('pile 1000', heap_of_boxes, 1200))


def main() -> None:
    """Run the scenes and print a line for each."""
    for name, make, steps in CASES:
        times = []
        for _ in range(REPEATS + 1):
            w = make()
            start = time.perf_counter()
            w.step(steps)
            times.append(time.perf_counter() - start)
        # The first run may have compiled.
        median = statistics.median(times[1:])
        spread = (max(times[1:]) - min(times[1:])) / median
        print(f'{name:<14}{steps / median:10.0f} steps/s, spread {spread:.0%}', flush=True)


if __name__ == '__main__':
    main()
