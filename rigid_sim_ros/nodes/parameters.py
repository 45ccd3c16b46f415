# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters of the node `simulate`.

Names and defaults stand in msg_config/default.yaml and nowhere else; here is what each one means,
which values it may have and whether it changes while the node runs.
"""
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from ruamel.yaml import YAML

from rigid_sim_ros.scene.errors import nearest

_DEFAULTS = files('rigid_sim_ros') / 'msg_config' / 'default.yaml'


class ParameterError(ValueError):
    """A parameter has a value that the node cannot use; the message says which and what to do."""


class _Meaning(NamedTuple):
    description: str
    live: bool = False
    most: float | None = None       # numbers lie between 0 and this
    constraints: str = ''


_MEANINGS = {
    'scene': _Meaning('Path of a scene file, or the name of an example scene.'),
    'frame_id': _Meaning(
        'frame_id of every published message. Wrenches, poses and twists that name it, or '
        '`world`, or no frame are in world axes.', constraints='not empty, no body of the scene'),
    'bodies': _Meaning(
        'Names or glob patterns that choose which bodies get topics of their own; ~/state and '
        '~/wrenches always cover all of them.'),
    'real_time_factor': _Meaning(
        'Simulated seconds per second of wall time; 0 is as fast as possible.', True, 1e4),
    'publish_rate': _Meaning(
        'Rate of poses, twists, states and transforms in Hz of simulation time, rounded to whole '
        'steps; 0 publishes none.', True, 1e6),
    'clock_rate': _Meaning(
        'Rate of /clock in Hz of simulation time, rounded to whole steps; 0 publishes none.',
        True, 1e6),
    'marker_rate': _Meaning(
        'Rate of ~/markers in Hz of simulation time, rounded to whole steps; 0 publishes none.',
        True, 1e6),
    'diagnostics_rate': _Meaning(
        'Rate of /diagnostics in Hz of wall time; 0 publishes none.', True, 1e3),
    'hash_interval': _Meaning(
        'Steps from one ~/state_hash to the next; 0 publishes none.', True, 2**31 - 1),
    'wrench_timeout': _Meaning(
        'Simulation time in s, rounded to whole steps, for which a wrench holds unless a message '
        'on its topic replaces it; 0 is one step.', True, 1e6),
    'reset_time': _Meaning(
        'Whether ~/reset also sets the simulation time, and with it /clock, back to 0.', True),
    'publish_clock': _Meaning('Whether to publish the simulation time on /clock.'),
    'publish_tf': _Meaning('Whether to publish the poses on /tf; needs the package tf2_msgs.'),
    'publish_markers': _Meaning(
        'Whether to publish the shapes, contact points and contact forces on ~/markers.'),
    'publish_contact_wrench': _Meaning(
        'Whether to publish the net contact wrench on each body, about its centre of mass.'),
}
_QOS_MEANINGS = {
    'reliability': _Meaning('Reliability of topic `{}`.', constraints='reliable | best_effort'),
    'durability': _Meaning(
        'Durability of topic `{}`.', constraints='volatile | transient_local'),
    'depth': _Meaning('How many messages the queue of topic `{}` holds.', most=100_000),
}


def default_parameters() -> dict[str, Any]:
    """Return every parameter of msg_config/default.yaml; a nested key has dots in its name."""
    document = YAML(typ='safe', pure=True).load(_DEFAULTS.read_text(encoding='utf-8'))
    return dict(_flatten(document['/**']['ros__parameters']))


def declare(node: Node) -> dict[str, Any]:
    """
    Declare every parameter on a node and return their values.

    Raise ParameterError for an override of the wrong type or out of its range.
    """
    defaults = default_parameters()
    _warn_of_unknown(node, defaults)
    return {name: _declare(node, name, default) for name, default in defaults.items()}


def is_live(name: str) -> bool:
    """Return whether a declared parameter may change while the node runs."""
    return name in _MEANINGS and _MEANINGS[name].live


def _declare(node: Node, name: str, default: Any) -> Any:
    try:
        return node.declare_parameter(name, default, _descriptor(name, default)).value
    except InvalidParameterTypeException as error:
        raise ParameterError(_wrong_type(name, default, error)) from None
    except InvalidParameterValueException as error:
        raise ParameterError(f'parameter {_sentence(str(error))}') from None


def _flatten(tree: Mapping[str, Any], prefix: str = '') -> Sequence[tuple[str, Any]]:
    leaves: list[tuple[str, Any]] = []
    for key, value in tree.items():
        if isinstance(value, Mapping):
            leaves += _flatten(value, f'{prefix}{key}.')
        else:
            leaves.append((f'{prefix}{key}', value))
    return leaves


def _meaning(name: str) -> _Meaning:
    if not name.startswith('qos.'):
        return _MEANINGS[name]
    _, topic, policy = name.split('.')
    meaning = _QOS_MEANINGS[policy]
    return meaning._replace(description=meaning.description.format(topic))


def _descriptor(name: str, default: Any) -> ParameterDescriptor:
    meaning = _meaning(name)
    descriptor = ParameterDescriptor(
        description=meaning.description,
        additional_constraints=meaning.constraints,
        read_only=not meaning.live,
    )
    if meaning.most is not None and isinstance(default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=0.0, to_value=meaning.most, step=0.0)]
    elif meaning.most is not None:
        descriptor.integer_range = [
            IntegerRange(from_value=0, to_value=int(meaning.most), step=1)]
    return descriptor


def _wrong_type(name: str, default: Any, error: Exception) -> str:
    mend = {
        bool: 'must be true or false',
        int: 'must be a whole number',
        float: f'must be a number with a decimal point, such as {default}',
        str: "must be text; in quotes if it looks like a number: '\"7\"'",
        list: "must be a list of texts, such as ['*']",
    }[type(default)]
    return f'parameter {name}: {mend} ({_sentence(str(error))})'


def _sentence(text: str) -> str:
    return ' '.join(text.split()).rstrip('.')


def _warn_of_unknown(node: Node, known: Mapping[str, Any]) -> None:
    # A parameter file may serve several nodes, so a name that is not ours is no error. rclpy has
    # no public list of the overrides before they are declared.
    for name in getattr(node, '_parameter_overrides', {}):
        if name not in known and not node.has_parameter(name):
            similar = [k for k in known if k.startswith('qos.') == name.startswith('qos.')]
            node.get_logger().warning(f'no parameter {name!r}: {nearest(name, similar)}')
