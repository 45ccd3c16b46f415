# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which joints of a scene are told about together: those of a model, and those of the scene."""

from collections.abc import Sequence
from typing import NamedTuple

from rigid_sim_ros.scene import schema


class JointGroup(NamedTuple):
    """The joints with one coordinate of a model."""

    model: str                  # '': those that are of the scene and of no model
    names: tuple[str, ...]      # as the model has them: without MODEL/
    places: tuple[int, ...]     # in the joints of the scene


def model_of(joint: str) -> str:
    """Return the model of a joint by its name, '' for a joint of the scene itself."""
    model, slash, _ = joint.partition('/')
    return model if slash else ''


def full_name(model: str, joint: str) -> str:
    """Return the name that a joint of a model has in the scene."""
    return f'{model}/{joint}' if model else joint


def joint_groups(joints: Sequence[schema.Joint] | None) -> list[JointGroup]:
    """Return the groups, in the order of their first joints."""
    found: dict[str, list[int]] = {}
    for j, joint in enumerate(joints or ()):
        if joint.type in schema.ONE_AXIS:
            found.setdefault(model_of(joint.name), []).append(j)
    named = joints or ()
    return [JointGroup(model, tuple(named[j].name.removeprefix(f'{model}/') if model else
                                    named[j].name for j in index), tuple(index))
            for model, index in found.items()]


def all_joints(groups: Sequence[JointGroup]) -> JointGroup:
    """
    Return all joints as one group, for /joint_states.

    One model alone has its own names there, as its description has them; of several models each
    name begins with its model.
    """
    if len(groups) == 1:
        return groups[0]
    return JointGroup('', tuple(full_name(group.model, name) for group in groups
                                for name in group.names),
                      tuple(j for group in groups for j in group.places))
