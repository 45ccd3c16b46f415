# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Python in new processes that have imported the libraries already, and nothing of the package.

They are forks of a process that has done nothing else. To import Numba and the others takes half a
second of a processor, and tests start some hundred such processes: what these have of the package,
its cache of kernels among it, they find as every new process does. Who asks what is imported, or
in which order Python goes through a set, starts Python itself.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
import json
import os
from pathlib import Path
import runpy
import select
import subprocess
import sys
import tempfile
import threading
import types
from typing import Any

_LIBRARIES = ('click', 'defusedxml.sax', 'numba', 'numpy', 'osqp', 'pydantic.json_schema',
              'pydantic.main', 'pydantic.types', 'ruamel.yaml', 'urllib.request', 'yaml')
_OFTEN = 0.01   # s between two looks at whether a process has ended


class Fresh:
    """A process, which has nothing to read."""

    def __init__(self, words: Sequence[str], env: Mapping[str, str] | None = None,
                 cwd: str | os.PathLike[str] = '.') -> None:
        """Start Python with these words, `-c` and a program, `-m` and a module, or a file."""
        self._words = words
        self._folder = tempfile.TemporaryDirectory()
        self._ended = threading.Event()
        self._code = 0
        _server().start(self, {
            'words': [*map(str, words)], 'folder': self._folder.name, 'cwd': os.path.abspath(cwd),
            'env': dict(os.environ if env is None else env)})

    def end(self, code: int) -> None:
        """Note how it ended."""
        self._code = code
        self._ended.set()

    def wait(self, timeout: float = 600.0) -> subprocess.CompletedProcess[str]:
        """Wait for the end and return what it said; TimeoutError if it does not come."""
        if not self._ended.wait(timeout):
            raise TimeoutError(f'waited {timeout} s for the end of a process')
        out, err = (Path(self._folder.name, name).read_text(encoding='utf-8')
                    for name in ('out', 'err'))
        self._folder.cleanup()
        return subprocess.CompletedProcess(self._words, self._code, out, err)


def run(*words: str, env: Mapping[str, str] | None = None, cwd: str | os.PathLike[str] = '.',
        ) -> subprocess.CompletedProcess[str]:
    """Run Python with these words and return what it said."""
    return Fresh(words, env, cwd).wait()


class _Server:
    """The process that is forked."""

    def __init__(self) -> None:
        self._process = subprocess.Popen([sys.executable, __file__], stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE, text=True, bufsize=1)
        self._lock = threading.Lock()
        self._running: dict[int, Fresh] = {}
        threading.Thread(target=self._listen, daemon=True).start()

    def start(self, process: Fresh, order: Mapping[str, Any]) -> None:
        """Let it start a process."""
        assert self._process.stdin
        with self._lock:
            number = id(process)
            self._running[number] = process
            self._process.stdin.write(json.dumps({'number': number, **order}) + '\n')

    def _listen(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            number, code = json.loads(line)
            self._running.pop(number).end(code)


@cache
def _server() -> _Server:
    return _Server()


def _serve() -> dict[str, Any] | None:
    """Fork as often as is asked for; return what a fork is to do, None in the end."""
    running: dict[int, int] = {}
    pending = b''
    while True:
        if select.select([0], [], [], _OFTEN if running else None)[0]:
            if not (said := os.read(0, 1 << 16)):
                return None
            *lines, pending = (pending + said).split(b'\n')
            for line in lines:
                order = json.loads(line)
                if (pid := os.fork()) == 0:
                    return dict(order)
                running[pid] = order['number']
        while running:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                break
            told = json.dumps([running.pop(pid), os.waitstatus_to_exitcode(status)])
            os.write(1, told.encode() + b'\n')


def _become(order: Mapping[str, Any]) -> None:
    """Be a new process in its folder and environment, and run what it is to run."""
    for number, path in enumerate((os.devnull, *(
            Path(order['folder'], name) for name in ('out', 'err')))):
        opened = os.open(path, os.O_RDONLY if number == 0 else os.O_WRONLY | os.O_CREAT)
        os.dup2(opened, number)
        os.close(opened)
    os.chdir(order['cwd'])
    os.environ.clear()
    os.environ.update(order['env'])
    import numba
    reload: Any = numba.config
    reload.reload_config()
    first, *rest = order['words']
    own = str(Path(__file__).parent)
    above = os.environ.get('PYTHONPATH', '')
    before = [path for path in above.split(os.pathsep) if path]
    sys.path[:] = [*before, *(path for path in sys.path if path not in (own, *_INHERITED))]
    if first == '-c':
        sys.path.insert(0, '')
        sys.argv = ['-c', *rest[1:]]
        main = sys.modules['__main__'] = types.ModuleType('__main__')
        exec(compile(rest[0], '<string>', 'exec'), main.__dict__)
    elif first == '-m':
        sys.path.insert(0, os.getcwd())
        sys.argv = rest
        runpy.run_module(rest[0], run_name='__main__', alter_sys=True)
    else:
        sys.path.insert(0, str(Path(first).parent))
        sys.argv = order['words']
        runpy.run_path(first, run_name='__main__')


_INHERITED = tuple(os.environ.get('PYTHONPATH', '').split(os.pathsep))

if __name__ == '__main__':
    for library in _LIBRARIES:
        import_module(library)
    # What Numba imports and starts when it compiles for the first time: 0.3 s of a processor.
    import_module('numba').njit(lambda x: abs(x))(1.0)
    if (work := _serve()) is not None:
        _become(work)
