# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A process that records in real time until it is killed: python recording_process.py DIR STORAGE.

Each recording leaves DIR/NAME.times, the wall times [ns] of its first and its last publication, as
two integers of 8 bytes.

It needs test/ in PYTHONPATH. For each line `NAME` on stdin it forks a child that records into
DIR/NAME, and prints its process id; the child begins at once, with all imported and compiled. At
the end of stdin it waits.
"""

import os
from pathlib import Path
import struct
import sys
from tempfile import TemporaryDirectory
import time

from bag.sessions import NODE, world

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.outputs import Outputs, state_topics
from rigid_sim_ros.bag.recorder import Recorder

PERIOD = 10     # steps of 1 ms from one publication to the next


def begin(times: int) -> None:
    """Write down that nothing was published until now."""
    os.pwrite(times, struct.pack('qq', *2 * [time.time_ns()]), 0)


def record(bag: Path, storage: str) -> None:
    """Step a world in real time, push it now and then, and record it."""
    times = os.open(bag.with_name(f'{bag.name}.times'), os.O_RDWR | os.O_CREAT)
    begin(times)    # before there are files that a kill may leave
    the_world = world()
    topics = state_topics(NODE, the_world.names)
    recorder = Recorder(bag, the_world, topics, storage=storage, segment_s=1.6)
    outputs = Outputs(the_world, topics, 'world')
    chosen = kinds.CLOCK, kinds.POSE, kinds.TWIST, kinds.STATE, kinds.STATE_HASH
    begin(times)
    due = time.monotonic()
    while True:
        step = the_world.step_index
        if recorder.wants_snapshot:
            recorder.snapshot(the_world)
        pairs = [pair for kind in chosen for pair in outputs.encode(kind)]
        recorder.publish(step, [recorder.channel(name) for name, _ in pairs],
                         [data for _, data in pairs])
        os.pwrite(times, struct.pack('q', time.time_ns()), 8)
        if step % 70 == 0:
            pose = (0.1 * step, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
            the_world.set_pose('ball', *pose)
            recorder.event(step, 'set_pose', name='ball', position=pose[0], orientation=pose[1])
        the_world.step(PERIOD)
        due += PERIOD / 1000
        time.sleep(max(0.0, due - time.monotonic()))


def warm_up(storage: str) -> None:
    """Compile, and read the definitions of all types, so that the children need not."""
    with TemporaryDirectory() as folder:
        batch = Batch(world(), Path(folder, 'bag'), storage=storage)
        batch.tell('set_pose', name='ball', position=(0, 0, 0), orientation=(0, 0, 0, 1))
        batch.run(PERIOD)
        batch.close()


def main() -> None:
    """Fork on command."""
    folder, storage = Path(sys.argv[1]), sys.argv[2]
    warm_up(storage)
    children = []
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            record(folder / line.strip(), storage)
        children.append(child)
        print(child, flush=True)
    for child in children:
        os.waitpid(child, 0)


if __name__ == '__main__':
    main()
