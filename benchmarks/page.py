# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where and when something was measured, and where it is written down."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from datetime import date
import os
from pathlib import Path
import platform
import sys
import tempfile

import numba
import numpy as np


def machine() -> str:
    """Return a line about where and when the figures were measured."""
    processor = next((text.split(':')[1].strip() for text in _read('/proc/cpuinfo').splitlines()
                      if text.startswith('model name')), platform.machine())
    return (f'{date.today()}, {processor}, {os.cpu_count()} virtual cores, load {load()}, Python '
            f'{platform.python_version()}, Numba {numba.__version__}, NumPy {np.__version__}')


def load() -> str:
    """Return how many programs the machine runs at the moment, on average."""
    return f'{os.getloadavg()[0]:.1f}' if hasattr(os, 'getloadavg') else 'unknown'


def _read(path: str) -> str:
    try:
        return Path(path).read_text(encoding='utf-8')
    except OSError:
        return ''


def line(cells: Sequence[object]) -> str:
    """Return a line of a table in Markdown."""
    return '| ' + ' | '.join(map(str, cells)) + ' |'


def heading(cells: Sequence[object]) -> list[str]:
    """Return the first two lines of a table; all columns but the first hold numbers."""
    return [line(cells), line(['---', *['---:'] * (len(cells) - 1)])]


def write(path: Path, pages: Sequence[str], name: str = 'measured') -> None:
    """Put the figures between the marks of this name in a file, or into a new file."""
    begin, end = f'<!-- {name}: begin -->', f'<!-- {name}: end -->'
    text = path.read_text(encoding='utf-8') if path.exists() else f'{begin}\n{end}\n'
    if begin not in text or end not in text:
        sys.exit(f'{path} has no lines {begin} and {end}')
    head, tail = text.split(begin)[0], text.split(end)[1]
    path.write_text(f'{head}{begin}\n\n' + '\n\n'.join(pages) + f'\n\n{end}{tail}',
                    encoding='utf-8')


def measure(name: str, about: str | None, repeats: int, what: str,
            *tables: Callable[[Path, int], Iterable[str]]) -> int:
    """
    Be the main function of a benchmark: measure, print and write down; return the exit code.

    Each of the tables returns its lines from an empty folder and from how often to measure;
    `repeats` of `what` where the command line says nothing.
    """
    parser = argparse.ArgumentParser(description=(about or '').strip().splitlines()[0])
    parser.add_argument('--repeats', type=int, default=repeats, help=f'{what}, {repeats}')
    parser.add_argument('--output', type=Path, help='a Markdown file to write, besides')
    arguments = parser.parse_args()
    pages = [machine()]
    print(pages[0], flush=True)
    with tempfile.TemporaryDirectory() as folder:
        pages += ['\n'.join(table(Path(folder), arguments.repeats)) for table in tables]
    print('', *pages[1:], sep='\n\n')
    if arguments.output:
        write(arguments.output, pages, name)
    return 0
