# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The joints of a scene file, and the models that bring some: see schema.py."""

import math
from typing import Annotated, TypeAlias

from pydantic import model_validator

from rigid_sim_ros.scene.spec import Boolean, Pose, Spec
from rigid_sim_ros.scene.values import (
    Choice, ListOf, Name, Numbers, PartName, Quantity, refuse, Text, Vector)

JOINTS = ('fixed', 'revolute', 'continuous', 'prismatic', 'spherical', 'universal', 'planar',
          'distance', 'free')
# Of these a joint has a position, limits, a drive.
ONE_AXIS = ('revolute', 'continuous', 'prismatic')
DRIVES = ('effort', 'velocity', 'position')

# Of a rotation; along an axis of translation read m for rad and N for N m.
_Coordinate: TypeAlias = Annotated[float, Quantity('rad or m')]
_Rate: TypeAlias = Annotated[float, Quantity('rad/s or m/s')]
_Effort: TypeAlias = Annotated[float, Quantity('N m or N')]
_Stiffness: TypeAlias = Annotated[float, Quantity('N m/rad or N/m', least=0.0)]
_JointDamping: TypeAlias = Annotated[float, Quantity('N m s/rad or N s/m', least=0.0)]


class JointLimits(Spec):
    """How far a joint goes, and what its drive can do."""

    lower: _Coordinate | None = None
    upper: _Coordinate | None = None
    restitution: Annotated[float, Quantity(least=0.0, most=1.0)] = 0.0
    velocity: Annotated[float, Quantity('rad/s or m/s', above=0.0)] | None = None
    effort: Annotated[float, Quantity('N m or N', least=0.0)] | None = None

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest position, infinite where nothing bounds it."""
        return (-math.inf if self.lower is None else self.lower,
                math.inf if self.upper is None else self.upper)

    def beyond(self, position: float, velocity: float, joint: str, where: str = '') -> str:
        """
        Return what is wrong with goals of a joint, or with where it is put; '' for nothing.

        NaN is no goal. `where` is said after the name of the joint.
        """
        lower, upper = self.range
        if position < lower or position > upper:
            return (f"position {position:g} of joint '{joint}'{where}, must be within its limits "
                    f'{lower:g} .. {upper:g}')
        if self.velocity is not None and abs(velocity) > self.velocity:
            return (f"velocity {velocity:g} of joint '{joint}'{where}, must be within its limit "
                    f'{self.velocity:g}')
        return ''


class JointSpring(Spec):
    """A linear spring along the axis."""

    stiffness: _Stiffness
    rest: _Coordinate = 0.0


class JointDrive(Spec):
    """A motor and its controller: the mode that it starts in, its gains, and its first goal."""

    mode: Annotated[str, Choice(DRIVES)]
    gain: _JointDamping | None = None   # of the mode `velocity`
    stiffness: _Stiffness | None = None     # of the mode `position`, with the damping
    damping: _JointDamping = 0.0
    position: _Coordinate | None = None     # None: the position at the start
    velocity: _Rate = 0.0
    effort: _Effort = 0.0


class JointMimic(Spec):
    """Position = multiplier * position of another joint + offset; both feel it."""

    joint: Annotated[str, Text()]
    multiplier: Annotated[float, Quantity()] = 1.0
    offset: _Coordinate = 0.0


class Joint(Spec):
    """What holds a child to a parent, but for some motions."""

    name: PartName
    type: Annotated[str, Choice(JOINTS)]
    parent: Annotated[str, Text()]      # a body, or world
    child: Annotated[str, Text()]
    pose: Pose = Pose()     # of the joint frame in the parent
    child_pose: Pose | None = None      # in the child; None: where it is at position 0
    axis: Annotated[Vector, Numbers('x y z')] = (0.0, 0.0, 1.0)     # in the joint frame
    # Of a universal joint, fixed in the child; None: any at right angles to the axis.
    axis2: Annotated[Vector, Numbers('x y z')] | None = None
    position: _Coordinate | None = None     # at the start; None: 0
    velocity: _Rate | None = None   # None: as the bodies' twists have it
    limits: JointLimits = JointLimits()
    damping: _JointDamping = 0.0
    friction: Annotated[float, Quantity('N m or N', least=0.0)] = 0.0
    armature: Annotated[float, Quantity('kg m^2 or kg', least=0.0)] = 0.0
    spring: JointSpring | None = None
    drive: JointDrive | None = None
    mimic: JointMimic | None = None
    # Whether parent and child touch each other.
    collides: Boolean = False
    # Of a distance; None: as far apart as its ends are written.
    length: Annotated[float, Quantity('m', above=0.0)] | None = None
    # Whether the child begins where the joint wants it, wherever it is written.
    brings_child: Boolean | None = None

    @model_validator(mode='after')
    def _has_direction(self) -> 'Joint':
        for key in ('axis', 'axis2'):
            axis = getattr(self, key)
            if axis is not None and not any(axis):
                raise refuse('[0, 0, 0] has no direction, must be such as [0, 0, 1]', key)
        return self


class ModelFile(Spec):
    """A robot or another model from a file of its own, which becomes bodies and joints."""

    name: Name
    file: Annotated[str, Text()]
    srdf: Annotated[str, Text()] | None = None
    pose: Pose = Pose()
    # None: as the file has it.
    fixed_base: Boolean | None = None
    # Positions at the start, by the names in the file.
    joints: dict[str, _Coordinate] = {}
    # Drives of the joints whose names match; the others are of the mode effort.
    drives: dict[str, JointDrive] = {}
    # Joints, by patterns, whose bounds in the file are left out.
    unlimited: Annotated[tuple[str, ...], ListOf(Text(), 'names or patterns of joints')] = ()
    # Folders, by the names that package:// and model:// have for them.
    packages: dict[str, Annotated[str, Text()]] = {}
    # Of a xacro file.
    arguments: dict[str, Annotated[str, Text()]] = {}
    # Whether moments of inertia that no body has are raised to what a body may have.
    mend_inertia: Boolean = False
    material: Annotated[str, Text()] = 'default'
    # Whether bodies are drawn as the file says; else with their solids.
    visuals: Boolean = True
