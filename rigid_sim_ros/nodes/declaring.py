# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node, with defaults from a file in msg_config and a meaning for each."""
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from importlib.resources import files
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter
from ruamel.yaml import YAML

from rigid_sim_ros.words import nearest


# Of NaN: rclpy checks ranges, and has let it pass in other versions.
NOT_A_NUMBER = 'must be a number'


class ParameterError(ValueError):
    """A parameter has a value that the node cannot use; the message says which and what to do."""


class Meaning(NamedTuple):
    """What a parameter means, and which values it may have."""

    description: str
    live: bool = False              # may change while the node runs
    most: float | None = None       # numbers lie between `least` and this
    constraints: str = ''
    least: float = 0.0


def defaults_in(name: str) -> dict[str, Any]:
    """Return every parameter of a file in msg_config; a nested key has dots in its name."""
    text = (files('rigid_sim_ros') / 'msg_config' / name).read_text(encoding='utf-8')
    document = YAML(typ='safe', pure=True).load(text)
    return dict(_flatten(document['/**']['ros__parameters']))


def declare_all(
    node: Node, defaults: Mapping[str, Any], meaning: Callable[[str], Meaning],
) -> dict[str, Any]:
    """
    Declare parameters on a node and return their values.

    Raise ParameterError for an override of the wrong type or out of its range.
    """
    _warn_of_unknown(node, defaults)
    as_floats = partial(_with_floats, [n for n, v in defaults.items() if isinstance(v, float)])
    overrides = _overrides(node)
    overrides.update({p.name: p for p in as_floats(list(overrides.values()))})
    node.add_pre_set_parameters_callback(as_floats)
    return {name: _declare(node, name, default, meaning(name))
            for name, default in defaults.items()}


def _declare(node: Node, name: str, default: Any, meaning: Meaning) -> Any:
    try:
        value = node.declare_parameter(name, default, _descriptor(default, meaning)).value
    except InvalidParameterTypeException as error:
        raise ParameterError(_wrong_type(name, default, error)) from None
    except InvalidParameterValueException as error:
        raise ParameterError(_wrong_value(node, name, meaning, error)) from None
    if value != value:
        raise ParameterError(f'parameter {name}: {NOT_A_NUMBER}')
    return value


def _with_floats(floating: Collection[str], parameters: list[Parameter]) -> list[Parameter]:
    """Return parameters of which those that are floating-point numbers may be written as `50`."""
    return [Parameter(p.name, value=float(p.value))
            if p.name in floating and p.type_ is Parameter.Type.INTEGER else p
            for p in parameters]


def _flatten(tree: Mapping[str, Any], prefix: str = '') -> Sequence[tuple[str, Any]]:
    leaves: list[tuple[str, Any]] = []
    for key, value in tree.items():
        if isinstance(value, Mapping):
            leaves += _flatten(value, f'{prefix}{key}.')
        else:
            leaves.append((f'{prefix}{key}', value))
    return leaves


def _descriptor(default: Any, meaning: Meaning) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=meaning.description,
        additional_constraints=meaning.constraints,
        read_only=not meaning.live,
    )
    if meaning.most is not None and isinstance(default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=meaning.least, to_value=meaning.most, step=0.0)]
    elif meaning.most is not None:
        descriptor.integer_range = [
            IntegerRange(from_value=int(meaning.least), to_value=int(meaning.most), step=1)]
    return descriptor


def _wrong_type(name: str, default: Any, error: Exception) -> str:
    mend = {
        bool: 'must be true or false',
        int: 'must be a whole number',
        float: f'must be a number, such as {default}',
        str: "must be text; in quotes if it looks like a number: '\"7\"'",
        list: "must be a list of texts, such as ['*']",
    }[type(default)]
    return f'parameter {name}: {mend} ({_sentence(str(error))})'


def _wrong_value(node: Node, name: str, meaning: Meaning, error: Exception) -> str:
    given = _overrides(node).get(name)
    if given is None or meaning.most is None:
        return f'parameter {name}: {_sentence(str(error))}'
    return (f'parameter {name}: {given.value}, must be at least {meaning.least:g} and at most '
            f'{meaning.most:g}')


def given_names(node: Node) -> list[str]:
    """Return the names of the parameters that the node was started with."""
    return list(_overrides(node))


def _overrides(node: Node) -> dict[str, Parameter]:
    # rclpy has no public list of the overrides before they are declared.
    overrides: dict[str, Parameter] = getattr(node, '_parameter_overrides', {})
    return overrides


def _sentence(text: str) -> str:
    return ' '.join(text.split()).rstrip('.')


def _warn_of_unknown(node: Node, known: Mapping[str, Any]) -> None:
    # A parameter file may serve several nodes, so a name that is not ours is no error.
    for name in _overrides(node):
        if not (name in known or node.has_parameter(name) or name.startswith('qos_overrides.')):
            similar = [k for k in known if k.startswith('qos.') == name.startswith('qos.')]
            node.get_logger().warning(f'no parameter {name!r}: {nearest(name, similar)}')
