# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a file says of a model, whatever its format: links, frames, joints; all in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from rigid_sim_ros.models.findings import Place
from rigid_sim_ros.models.poses import IDENTITY, Pose
from rigid_sim_ros.problems import Problem


# Robots have some hundred; pairs of links that do not touch grow with the square.
MOST_LINKS = 2000


class Inertia(NamedTuple):
    """Mass properties of a link, in its frame."""

    mass: float     # [kg]
    com: tuple[float, float, float]     # [m]
    # [kg m^2] about the centre of mass: ixx, iyy, izz, ixy, ixz, iyz
    tensor: tuple[float, float, float, float, float, float]
    place: Place


class MeshFile(NamedTuple):
    """A file with triangles, or with heights."""

    path: Path
    scale: tuple[float, float, float]


class Shape(NamedTuple):
    """
    A solid in the frame of its link.

    `kind` and `values` are the type and the keys of a shape in a scene, but for a mesh, which is a
    file or points, and for a heightfield in a file, which is scaled to its lengths.
    """

    kind: str
    values: Mapping[str, Any]
    pose: Pose
    place: Place
    mesh: MeshFile | None = None
    points: Any = None      # (n, 3) [m]
    faces: Any = None       # (f, 3) of the points, where the file has some
    color: tuple[float, ...] | None = None


@dataclass
class Link:
    """A rigid part."""

    name: str
    place: Place
    inertia: Inertia | None = None      # None: it weighs nothing
    pose: Pose = IDENTITY   # in the frame of the model, where all joints are at 0
    collisions: list[Shape] = field(default_factory=list)
    visuals: list[Shape] = field(default_factory=list)
    is_fixed: bool = False      # to the world


class Frame(NamedTuple):
    """A named frame on a link."""

    name: str
    link: str
    pose: Pose      # in the link
    place: Place


class Mimic(NamedTuple):
    """Position = multiplier * position of another joint + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass
class Joint:
    """What holds a child to a parent; kinds are the types of a scene."""

    name: str
    kind: str
    parent: str     # a link, or '' for the world
    child: str
    pose: Pose      # of the joint frame, in the parent
    place: Place
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)      # in the joint frame
    axis2: tuple[float, float, float] | None = None
    lower: float | None = None      # [rad] or [m]
    upper: float | None = None
    velocity: float | None = None   # [rad/s] or [m/s]
    effort: float | None = None     # [N m] or [N]
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    mimic: Mimic | None = None
    drive: Mapping[str, Any] | None = None      # as in a scene; None: of the mode effort
    collides: bool = False      # whether parent and child touch each other


@dataclass
class Model:
    """A model, as its file has it."""

    name: str
    links: list[Link]
    joints: list[Joint]
    frames: list[Frame]
    place: Place
    # Whether what is not fixed by the file itself is fixed where nobody says otherwise.
    is_fixed_by_default: bool = False
    ignored_pairs: list[tuple[str, str]] = field(default_factory=list)
    # What the file says of the world, for a model alone: `gravity`, `step`.
    world: Mapping[str, Any] = field(default_factory=dict)
    notes: list[Problem] = field(default_factory=list)
    urdf: str = ''      # the whole text, if that is what it is
