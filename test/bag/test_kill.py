# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording process that is killed with SIGKILL loses at most the last second."""

import os
from pathlib import Path
import random
import signal
import struct
import subprocess
import sys
import time

from effort import either
import pytest
from rosbags.highlevel import AnyReader

from rigid_sim_ros.bag.recover import recover
from rigid_sim_ros.bag.verify import verify

PROCESS = Path(__file__).with_name('recording_process.py')

# [ns] What the contract allows to be lost before the kill.
MOST_LOST = 1_000_000_000

# Children that record at the same time: each takes 5 % of a core.
TOGETHER = 8


class Kill:
    """A recording that is killed some time after it began."""

    def __init__(self, bag: Path, pid: int, after_s: float) -> None:
        self.bag = bag
        self.pid = pid
        self.at = time.monotonic() + after_s

    def now(self) -> None:
        os.kill(self.pid, signal.SIGKILL)

    @property
    def times(self) -> tuple[int, int]:
        """Return when [ns] it published first and last; a busy machine may let it wait before."""
        return struct.unpack('qq', self.bag.with_name(f'{self.bag.name}.times').read_bytes())


def kill_recordings(folder: Path, storage: str, count: int, seed: int) -> list[Kill]:
    """Start recordings and kill each at a random moment of its first 2.4 s."""
    chance = random.Random(seed)
    done: list[Kill] = []
    tests = os.pathsep.join([str(PROCESS.parents[1]), os.environ.get('PYTHONPATH', '')])
    process = subprocess.Popen([sys.executable, str(PROCESS), str(folder), storage], text=True,
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                               env={**os.environ, 'PYTHONPATH': tests.rstrip(os.pathsep)})
    assert process.stdin is not None and process.stdout is not None
    try:
        running: list[Kill] = []
        while len(done) < count:
            while len(running) < TOGETHER and len(running) + len(done) < count:
                name = f'bag{len(running) + len(done)}_{time.monotonic_ns()}'
                process.stdin.write(f'{name}\n')
                process.stdin.flush()
                running.append(Kill(folder / name, int(process.stdout.readline()),
                                    chance.uniform(0.05, 2.4)))
            for kill in [kill for kill in running if time.monotonic() >= kill.at]:
                kill.now()
                running.remove(kill)
                done.append(kill)
            time.sleep(0.001)
    finally:
        for kill in running:
            kill.now()
        process.stdin.close()
        process.wait(timeout=180)
    return done


@pytest.mark.long
@pytest.mark.parametrize('storage, count', [('mcap', either(12, 80)), ('sqlite3', either(4, 20))],
                         ids=['mcap', 'sqlite3'])
def test_a_kill_at_any_moment_loses_at_most_a_second(tmp_path, storage, count) -> None:
    kills = kill_recordings(tmp_path, storage, count, seed=7)
    restored = 0
    for kill in kills:
        files = [path for path in kill.bag.glob('*') if path.suffix in ('.mcap', '.db3')]
        if not any(path.stat().st_size for path in files):
            continue    # killed before the recording had begun
        try:
            recover(kill.bag)
        except ValueError as error:
            # Nothing was flushed yet: then no more than a second had been recorded.
            assert 'no message' in str(error)
            first, last = kill.times
            assert last - first < MOST_LOST
            continue
        with AnyReader([kill.bag]) as reader:
            assert kill.times[1] - reader.end_time < MOST_LOST
        verdict = verify(kill.bag)
        assert (verdict.difference, verdict.faults, verdict.gaps) == (None, (), 0)
        restored += 1
    # One that is killed before its first flush holds nothing; on a busy machine these are many.
    assert restored >= count // 3
