# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the classes of the scene file format have in common."""

from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, ConfigDict, model_validator, ValidationInfo

from rigid_sim_ros.scene.values import Flag, Numbers, Quantity, Quaternion, Vector

Position: TypeAlias = Annotated[Vector, Numbers('x y z', Quantity('m'))]
Velocity: TypeAlias = Annotated[Vector, Numbers('x y z', Quantity('m/s'))]
AngularVelocity: TypeAlias = Annotated[Vector, Numbers('x y z', Quantity('rad/s'))]
Boolean: TypeAlias = Annotated[bool, Flag()]


class Spec(BaseModel):
    """A mapping in the file: its keys are known, its values do not change."""

    # Deferred: only a whole scene is ever validated, and it brings the classes of its parts along.
    model_config = ConfigDict(extra='forbid', frozen=True, defer_build=True)

    @model_validator(mode='before')
    @classmethod
    def _note_class(cls, data: Any, info: ValidationInfo) -> Any:
        """Note which class reads this mapping, so that an error can name the keys it knows."""
        if isinstance(info.context, dict):
            info.context[id(data)] = cls
        return data


class Pose(Spec):
    """Where a frame is, in the frame that it belongs to."""

    position: Position = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)
