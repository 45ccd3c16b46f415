# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
MuJoCo's compiler in a process of its own.

A few lines of MJCF may ask for more memory than there is or for a million bodies, and a file that
attaches itself ends MuJoCo by a signal. So it compiles where that ends nobody else, with bounds on
what it may take, and what comes back is the compiled model in MuJoCo's binary form.
"""

from importlib.util import find_spec
import os
from pathlib import Path
import re
import resource
import signal
import subprocess
import sys
from typing import Any

from rigid_sim_ros.models.xml_tree import Element
from rigid_sim_ros.problems import Problem

# [s] of a processor, of which a robot takes tenths, and [s] until what stands still is ended.
_MOST_SECONDS, _PATIENCE = 10, 120
# [bytes] of addresses that it may use, libraries and all, and of what comes back.
_MOST_MEMORY, _MOST_RESULT = 3 << 30, 256 << 20
_GOOD, _WRONG = b'+', b'-'      # how an answer begins: with a model, or with words
# What MuJoCo says of where a mistake is.
_LINE, _OPENED = re.compile(r', line (\d+)'), re.compile(r"opening file '([^']*)'")
_ROOT = Path(__file__).parents[2]


def compiled(path: Path, seconds: int = _MOST_SECONDS) -> Any:
    """
    Return the mujoco.MjModel of a file, compiled in so many seconds of a processor.

    ValueError with what MuJoCo says of one that it refuses; ImportError without MuJoCo.
    """
    # None in sys.modules says that there is none, which find_spec does not know.
    if sys.modules.get('mujoco', ...) is None or find_spec('mujoco') is None:
        raise ImportError('mujoco')
    environment = os.environ | {
        'PYTHONPATH': os.pathsep.join(entry or os.getcwd() for entry in sys.path),
        # Each thread of these would take memory that counts against the bound.
        'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1'}
    try:
        done = subprocess.run(
            [sys.executable, '-m', __name__, os.path.abspath(path), str(seconds)], cwd=_ROOT,
            env=environment, stdin=subprocess.DEVNULL, capture_output=True, timeout=_PATIENCE,
            check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ValueError(f'MuJoCo could not compile it: {error}') from None
    if done.returncode < 0:
        name = signal.Signals(-done.returncode).name
        raise ValueError(f'MuJoCo was ended by {name}: it asks for more than {seconds} s or '
                         f'{_MOST_MEMORY >> 30} GiB, or attaches itself; must be smaller')
    answer = done.stdout
    if answer[:1] != _GOOD:
        said = answer[1:] if answer[:1] == _WRONG else done.stderr[-400:]
        raise ValueError(f'MuJoCo says: {" ".join(said.decode("utf-8", "replace").split())}')
    import mujoco

    name = 'compiled.mjb'
    return mujoco.MjModel.from_binary_path(name, {name: answer[1:]})


def placed(message: str, root: Element) -> Problem:
    """Return what MuJoCo says with its place: the line, or the file that it could not open."""
    named = _LINE.search(message)
    opened = _OPENED.search(message)
    places = [element for element in root.every() if opened is not None
              and opened[1].endswith(element.attributes.get('file', '') or '\0')]
    if places:
        return Problem(message, places[0].path, root.file, places[0].line)
    # A line of a file that is included is one of that file, which MuJoCo does not name.
    is_alone = not any(one.tag == 'include' or (one.tag == 'model' and 'file' in one.attributes)
                       for one in root.every())
    return Problem(message, '', root.file, int(named[1]) if named and is_alone else 0)


def _answer(path: str) -> bytes:
    import mujoco
    import numpy as np

    try:
        model = mujoco.MjSpec.from_file(path).compile()
        size = mujoco.mj_sizeModel(model)
        if size > _MOST_RESULT:
            raise ValueError(f'the compiled model has {size} bytes, must have {_MOST_RESULT} or '
                             'fewer')
        raw = np.empty(size, np.uint8)
        mujoco.mj_saveModel(model, None, raw)
    except (ValueError, TypeError, RuntimeError, OSError, MemoryError) as error:
        return _WRONG + str(error).encode()
    return _GOOD + raw.tobytes()


def main() -> None:
    """Compile the file that is named, and write the answer."""
    answer, path, seconds = os.dup(1), sys.argv[1], int(sys.argv[2])
    os.dup2(2, 1)       # what MuJoCo prints is no part of the answer
    for kind, most in ((resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, _MOST_MEMORY),
                       (resource.RLIMIT_CORE, 0), (resource.RLIMIT_FSIZE, 0)):
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (most if hard < 0 else min(most, hard), hard))
    with os.fdopen(answer, 'wb') as pipe:
        pipe.write(_answer(path))


if __name__ == '__main__':
    main()
