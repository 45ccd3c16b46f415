# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinds of value in a scene file, with their units, limits and words for a mistake."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
import math
import re
from typing import Annotated, Any, TypeAlias

from pydantic import GetCoreSchemaHandler
from pydantic_core import core_schema, PydanticCustomError

from rigid_sim_ros.scene.errors import Path, shown
from rigid_sim_ros.words import nearest

# A quaternion this close to unit length is normalised: what is left of one written with four
# digits. One farther off is more likely a mistake (degrees, or w first and a digit lost) than a
# rotation.
UNIT_TOLERANCE = 1e-3

# Normalising leaves a length that is off by a few units of 1.1e-16.
_ROUNDING = 1e-15

# [characters] rmw allows 247 for a topic; this leaves over 100 for namespace, node and
# '/applied_wrench'.
MAX_NAME = 120


def refuse(message: str, *at: str | int) -> PydanticCustomError:
    """Return the error that reports `message` at the place `at` below the value in question."""
    return PydanticCustomError('scene', '{text}', {'text': message, 'at': at})


class _Check:
    """An annotation: the value is what the check returns for it."""

    def __get_pydantic_core_schema__(
            self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Let pydantic call the check and nothing else."""
        return core_schema.no_info_plain_validator_function(self)

    def __call__(self, value: Any) -> Any:
        """Return the checked value or raise what `refuse` returns."""
        raise AssertionError


@dataclass(frozen=True)
class Quantity(_Check):
    """A finite number in a unit, within limits."""

    unit: str = ''
    above: float = -math.inf
    least: float = -math.inf
    most: float = math.inf

    def __call__(self, value: Any, *at: int) -> float:
        """Return the number as a float."""
        if type(value) is float and self.above < value and (
                self.least <= value <= self.most) and math.isfinite(value):
            return value    # all but mistakes, and whole numbers
        if isinstance(value, bool) or not isinstance(value, int | float):
            quotes = ', written without quotes' if _is_number(value) else ''
            unit = f' in {self.unit}' if self.unit else ''
            raise refuse(f'{shown(value)}, must be a number{unit}{quotes}', *at)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if self.above < number and self.least <= number <= self.most and math.isfinite(number):
            return number
        raise refuse(f'{f"{shown(value)} {self.unit}".strip()}, must be {self._range(number)}',
                     *at)

    def _range(self, number: float) -> str:
        """Say what a number must be that is not allowed."""
        if not math.isfinite(number):
            return 'finite'
        if number <= self.above:
            return f'> {self.above:g}'
        if math.isfinite(self.least) and math.isfinite(self.most):
            return f'in [{self.least:g}, {self.most:g}]'
        return f'>= {self.least:g}' if math.isfinite(self.least) else f'<= {self.most:g}'


@dataclass(frozen=True)
class Numbers(_Check):
    """A list of a fixed count of numbers in one unit."""

    names: str
    number: Quantity = Quantity()

    def __call__(self, value: Any) -> tuple[float, ...]:
        """Return the numbers as a tuple of floats."""
        if not isinstance(value, list) or len(value) != self._count:
            form = f'[{", ".join(self.names.split())}] {self.number.unit}'.strip()
            raise refuse(f'{shown(value)}, must be {self._count} numbers {form}')
        return tuple([self.number(item, i) for i, item in enumerate(value)])

    @cached_property
    def _count(self) -> int:
        return len(self.names.split())


_FOUR = Numbers('x y z w')


class UnitQuaternion(_Check):
    """Four numbers x, y, z, w, of unit length or so near that they can only mean it."""

    def __call__(self, value: Any) -> tuple[float, ...]:
        """Return the quaternion with unit length."""
        q = _FOUR(value)
        norm = math.hypot(*q)
        if abs(norm - 1.0) > UNIT_TOLERANCE:
            raise refuse(f'{shown(value)} has length {norm:.6g}, must be 1 within '
                         f'{UNIT_TOLERANCE:g} (x, y, z, w: w is last)')
        # One of unit length but for rounding stays as it is, to the bit: a scene that is written
        # out and read again must not change.
        return q if abs(norm - 1.0) < _ROUNDING else tuple(component / norm for component in q)


@dataclass(frozen=True)
class Choice(_Check):
    """One of several words."""

    words: tuple[str, ...]

    def __call__(self, value: Any) -> str:
        """Return the word."""
        if value in self.words:
            return str(value)
        raise refuse(f'{shown(value)}, {nearest(value, self.words)}')


@dataclass(frozen=True)
class Count(_Check):
    """A whole number within limits."""

    least: int
    most: int

    def __call__(self, value: Any) -> int:
        """Return the number."""
        if isinstance(value, bool) or not isinstance(value, int) or not (
                self.least <= value <= self.most):
            raise refuse(f'{shown(value)}, must be a whole number from {self.least} to '
                         f'{self.most}')
        return value


class NamePair(_Check):
    """Two different names."""

    def __call__(self, value: Any) -> tuple[str, str]:
        """Return them."""
        if not isinstance(value, list) or len(value) != 2 or value[0] == value[1] or not all(
                isinstance(name, str) for name in value):
            raise refuse(f"{shown(value)}, must be two different names, as in ['crate', 'hook']")
        return value[0], value[1]


class Flag(_Check):
    """A truth value."""

    def __call__(self, value: Any) -> bool:
        """Return it."""
        if isinstance(value, bool):
            return value
        raise refuse(f'{shown(value)}, must be true or false')


@dataclass(frozen=True)
class NameToken(_Check):
    """
    A name that can be a part of a ROS topic name.

    Letters, digits and underscores, no digit first, no two underscores in a row (ROS 2 design,
    "Topic and Service name mapping to DDS", section "ROS 2 Topic and Service Name Constraints").
    Only `world` is taken: it is a frame id. The node's own topics are no danger, since those of a
    body lie one level deeper: body `state` has `~/state/pose` beside the node's `~/state`.
    """

    # Whether it may be several tokens with slashes between them, as those of a model's parts are.
    is_path: bool = False

    def __call__(self, value: Any) -> str:
        """Return the name."""
        if self.is_path and isinstance(value, str) and '/' in value:
            for token in value.split('/')[:MAX_NAME]:
                NameToken()(token if token != 'world' else 'base')
            if len(value) <= MAX_NAME:
                return value
        if not isinstance(value, str) or not re.fullmatch('[A-Za-z_][A-Za-z0-9_]*', value):
            raise refuse(f'{shown(value)}, must be a ROS name: letters, digits and underscores, '
                         f'beginning with a letter{_mended(value)}')
        if '__' in value:
            raise refuse(f'{shown(value)}, must not have two underscores in a row{_mended(value)}')
        if len(value) > MAX_NAME:
            raise refuse(f'{shown(value)} has {len(value)} characters, must be at most {MAX_NAME}')
        if value == 'world':
            raise refuse("'world' is the name of the fixed frame, must be another name")
        return value


@dataclass(frozen=True)
class ListOf(_Check):
    """A list of values of one kind, of any length but 0."""

    item: Callable[[Any, int], Any]
    names: str

    def __call__(self, value: Any) -> tuple[Any, ...]:
        """Return the values."""
        if not isinstance(value, list) or not value:
            raise refuse(f'{shown(value)}, must be a list of {self.names}')
        return tuple(self.item(item, i) for i, item in enumerate(value))


class FieldSize(_Check):
    """The lengths of a heightfield along x and y, and what its heights are multiplied by."""

    def __call__(self, value: Any) -> tuple[float, ...]:
        """Return two numbers or three."""
        names = 'x y z' if isinstance(value, list) and len(value) == 3 else 'x y'
        return Numbers(names, Quantity('m', above=0.0))(value)


class Scale(_Check):
    """One factor for all directions, or one for each; as three numbers."""

    def __call__(self, value: Any) -> tuple[float, ...]:
        """Return the three factors."""
        factor = Quantity(above=0.0)
        if isinstance(value, list):
            return Numbers('x y z', factor)(value)
        return (factor(value),) * 3


class Color(_Check):
    """Red, green and blue in [0, 1], and opacity; opaque without one."""

    def __call__(self, value: Any) -> tuple[float, ...]:
        """Return the four numbers."""
        names = 'r g b a' if isinstance(value, list) and len(value) == 4 else 'r g b'
        return (*Numbers(names, Quantity(least=0.0, most=1.0))(value), 1.0)[:4]


class Format(_Check):
    """The version of the file format."""

    def __call__(self, value: Any) -> int:
        """Return the version."""
        if value == 1 and isinstance(value, int) and not isinstance(value, bool):
            return 1
        raise refuse(f'{shown(value)}, must be 1, the only format so far')


class Text(_Check):
    """Any text."""

    def __call__(self, value: Any, *at: int) -> str:
        """Return the text."""
        if isinstance(value, str):
            return value
        raise refuse(f'{shown(value)}, must be text', *at)


@dataclass(frozen=True)
class Rows(_Check):
    """
    A list of rows of three numbers, or the same as one text with a row between two commas.

    As text a large mesh is a single YAML scalar, read a hundred times faster than a list of lists.
    """

    number: Callable[[Any], Any]
    names: str

    def __call__(self, value: Any) -> tuple[tuple[Any, ...], ...]:
        """Return the rows."""
        if isinstance(value, str):
            rows: Any = [[_parsed(word) for word in row.split()] for row in value.split(',')]
        else:
            rows = value
        if not isinstance(rows, list) or not rows:
            raise refuse(f'{shown(value)}, must be a list of rows [{self.names}]')
        return tuple(self._row(row, i) for i, row in enumerate(rows))

    def _row(self, row: Any, i: int) -> tuple[Any, ...]:
        if not isinstance(row, list) or len(row) != len(self.names.split()):
            raise refuse(f'{shown(row)}, must be [{self.names}]', i)
        try:
            return tuple(map(self.number, row))
        except PydanticCustomError as error:
            raise refuse(str(error), i) from None


class Heights(_Check):
    """Rows of as many numbers each, or the same as one text with a row between two commas."""

    def __call__(self, value: Any) -> tuple[tuple[float, ...], ...]:
        """Return the rows."""
        rows = value
        if isinstance(value, str):
            rows = [[_parsed(word) for word in row.split()] for row in value.split(',')]
        number = Quantity('m')
        if not isinstance(rows, list) or len(rows) < 2 or not all(
                isinstance(row, list) and len(row) >= 2 for row in rows):
            raise refuse(f'{shown(value)}, must be two or more rows of two or more heights [m]')
        for i, row in enumerate(rows):
            if len(row) != len(rows[0]):
                raise refuse(f'{len(row)} heights, must be {len(rows[0])} as in the first row', i)
        return tuple(tuple([number(item, i, k) for k, item in enumerate(row)])
                     for i, row in enumerate(rows))


def place(context: Mapping[str, Any]) -> Path:
    """Return the place that `refuse` was given."""
    return tuple(context.get('at', ()))


def _is_number(value: Any) -> bool:
    return isinstance(value, str) and isinstance(_parsed(value), int | float)


def _parsed(word: str) -> int | float | str:
    """Return the number that a word is, or the word."""
    with suppress(ValueError):
        return int(word)
    with suppress(ValueError):
        return float(word)
    return word


def _mended(value: Any) -> str:
    """Suggest a legal name made of an illegal one."""
    if not isinstance(value, str) or len(value) > MAX_NAME:
        return ''
    name = re.sub('_+', '_', re.sub('[^A-Za-z0-9]', '_', value)).strip('_')
    if not name:
        return ''
    return f", such as '{name if name[0].isalpha() else f'body_{name}'}'"


def index(value: Any) -> int:
    """Return a vertex number, counted from 0."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**31:
        raise refuse(f'{shown(value)}, must be the index of a vertex, counted from 0')
    return value


Length: TypeAlias = Annotated[float, Quantity('m', above=0.0)]
Mass: TypeAlias = Annotated[float, Quantity('kg', above=0.0)]
Density: TypeAlias = Annotated[float, Quantity('kg/m^3', above=0.0)]
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = Annotated[tuple[float, float, float, float], UnitQuaternion()]
Name: TypeAlias = Annotated[str, NameToken()]
# Of a body, a joint or a frame: MODEL/LINK is one of a model.
PartName: TypeAlias = Annotated[str, NameToken(is_path=True)]
