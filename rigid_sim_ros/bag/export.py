# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion, wrenches and joint states of a bag as tables, CSV or Parquet, through pyarrow."""

from collections.abc import Sequence
import os
from pathlib import Path, PurePath
from typing import Any, NamedTuple

import numpy as np

from rigid_sim_ros.bag import decode, topics as kinds
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import joint_prefix
from rigid_sim_ros.bag.reader import BagReader
from rigid_sim_ros.bag.session import is_session
from rigid_sim_ros.messages.topics import body_of

FORMATS = ('csv', 'parquet')


class Column(NamedTuple):
    """A column of a table: a name that programs can write, and the unit, '' for text."""

    name: str
    unit: str = ''


def _vector(name: str, unit: str) -> tuple[Column, ...]:
    return tuple(Column(f'{name}_{axis}', unit) for axis in 'xyz')


_TIMES = (Column('bag_time', 's'), Column('time', 's'))
MOTION = (*_TIMES, Column('body'), *_vector('position', 'm'),
          *(Column(f'orientation_{axis}', '1') for axis in 'xyzw'),
          *_vector('linear_velocity', 'm/s'), *_vector('angular_velocity', 'rad/s'))
WRENCHES = (*_TIMES, Column('body'), Column('frame'), *_vector('force', 'N'),
            *_vector('torque', 'N m'))
JOINTS = (*_TIMES, Column('joint'), Column('position', 'rad or m'),
          Column('velocity', 'rad/s or m/s'), Column('effort', 'N m or N'))

# Rows that are gathered before they are written: some 20 MB.
_ROWS = 1 << 17


def export(bag: str | os.PathLike[str], file_format: str, output: Path, *,
           units: bool = False) -> list[tuple[Path, int]]:
    """
    Write the motion of all bodies to a file, accepted wrenches and joint states to such beside it.

    Parquet files hold the unit of each column as its metadata; with `units` the names say them
    too, as in `position_x [m]`. Returns the files and how many rows each has. BagError if the bag
    cannot be read, holds no motion, or a file exists already.
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        raise BagError("export needs pyarrow: `pip install 'rigid_sim_ros[export]'`, or `pip "
                       'install pyarrow`') from None
    beside = [output.with_name(f'{output.stem}_{what}{output.suffix}')
              for what in ('wrenches', 'joints')]
    for path in (output, *beside):
        if path.exists():
            raise BagError(f'{path} exists already: choose another --output, or remove it')
    motion = _Table(output, file_format, MOTION, units)
    wrenches = _Table(beside[0], file_format, WRENCHES, units)
    joints = _Table(beside[1], file_format, JOINTS, units)
    try:
        _fill(BagReader(bag), motion, wrenches, joints)
        if not motion.count and not motion.rows:
            raise BagError(f'{bag} holds no motion: no topic is of the type '
                           f'{kinds.TYPES[kinds.STATE]}')
        written = [(table.path, table.close()) for table in (motion, wrenches, joints)]
    except OSError as error:
        raise BagError(f'{error.filename or output}: {error.strerror or error}') from None
    return [(path, count) for path, count in written if count]


def _fill(reader: BagReader, motion: '_Table', wrenches: '_Table', joints: '_Table') -> None:
    first_ns: int | None = None
    node: str | None = None     # of a session of ours
    types: dict[str, str] = {}
    names: list[str] = []
    for topic, stamp, data in reader.messages():
        first_ns = stamp if first_ns is None else first_ns
        if topic not in types:
            types = reader.types
        kind = types[topic]
        at = (stamp - first_ns) / 1e9
        if kind == kinds.TYPES[kinds.STATE]:
            t_ns, _, names, numbers = decode.multi_dof_state(data)
            motion.add([at] * len(names), [t_ns / 1e9] * len(names), names, numbers=numbers)
        elif kind == kinds.TYPES[kinds.APPLIED_WRENCH] and topic.endswith('/applied_wrench'):
            t_ns, frame, numbers = decode.wrench(data)
            wrenches.add([at], [t_ns / 1e9], [body_of(topic, names)], [frame],
                         numbers=numbers)
        elif kind == kinds.TYPES[kinds.JOINT_STATES]:
            prefix = joint_prefix(topic, node)
            if prefix is not None:
                t_ns, _, joint_names, numbers = decode.joint_state(data)
                joints.add([at] * len(joint_names), [t_ns / 1e9] * len(joint_names),
                           [prefix + name for name in joint_names], numbers=numbers)
        elif node is None and is_session(topic):
            node = topic.removesuffix('/bag/session')
    if reader.faults:
        raise BagError(f'{reader.path}: {reader.faults[0]}: `rigid_sim recover {reader.path}` '
                       'keeps what is whole')


class _Table:
    """A table that is written while it grows; the file appears with the first row."""

    def __init__(self, path: Path, file_format: str, columns: Sequence[Column],
                 units: bool) -> None:
        self.path = path
        self.rows = 0           # gathered and not yet written
        self.count = 0          # written
        self._format = file_format
        self._columns = columns
        self._names = [f'{name} [{unit}]' if units and unit else name for name, unit in columns]
        self._lists: list[list[Any]] = []
        self._numbers: list[np.ndarray] = []
        self._writer: Any = None

    def add(self, *lists: Sequence[Any], numbers: np.ndarray) -> None:
        """Append rows: some columns as lists, the others as an array."""
        self._lists = self._lists or [[] for _ in lists]
        for column, more in zip(self._lists, lists, strict=True):
            column.extend(more)
        self._numbers.append(numbers)
        self.rows += len(numbers)
        if self.rows >= _ROWS:
            self._write()

    def close(self) -> int:
        """Write the rest and return the number of rows."""
        if self.rows:
            self._write()
        if self._writer is not None:
            self._writer.close()
        return self.count

    def _write(self) -> None:
        import pyarrow

        table = pyarrow.table([*self._lists, *np.concatenate(self._numbers).T], names=self._names)
        table = table.cast(pyarrow.schema([
            field.with_metadata({'unit': column.unit} if column.unit else {})
            for field, column in zip(table.schema, self._columns, strict=True)]))
        if self._writer is None:
            self._writer = self._opened(table.schema)
        self._writer.write_table(table)
        self.count += self.rows
        self._lists, self._numbers, self.rows = [], [], 0

    def _opened(self, schema: Any) -> Any:
        if self._format == 'csv':
            from pyarrow.csv import CSVWriter
            return CSVWriter(str(self.path), schema)
        from pyarrow.parquet import ParquetWriter
        return ParquetWriter(str(self.path), schema)


def format_of(output: str | None) -> str:
    """Return the format that the ending of a file asks for, csv without a file."""
    if output is None:
        return FORMATS[0]
    ending = PurePath(output).suffix[1:].lower()
    if ending not in FORMATS:
        raise BagError(f'{output}: must end in .csv or .parquet, or give --format')
    return ending


def default_output(bag: Path, file_format: str) -> Path:
    """Return where an export goes if nobody says: NAME.csv in the working directory."""
    return Path(f'{bag.resolve().name.partition(".")[0] or "bag"}.{file_format}')
