# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The frames of an SDF model, and where they are with all joints at 0.

SDFormat 1.7 and later: pose frame semantics (sdformat.org, "Pose Frame Semantics Proposal"). Each
model, link, joint and frame has a pose relative to another one; names are whole ones, such as
`gripper::finger`.
"""

from typing import NamedTuple

from rigid_sim_ros.models.findings import Findings, Place
from rigid_sim_ros.models.poses import combined, IDENTITY, inverse, Pose
from rigid_sim_ros.models.xml_tree import Element
from rigid_sim_ros.words import similar

MODEL = '__model__'
WORLD = 'world'


class _Node(NamedTuple):
    base: str       # the frame that the pose is relative to
    raw: Pose
    attached: str   # the frame that it is fixed to, '' for a link
    element: Element
    placement: str = ''     # of a model: the frame that the pose is of


class FrameGraph:
    """All frames of a model and of those in it."""

    def __init__(self, findings: Findings) -> None:
        """Begin with nothing but the frame of the outermost model."""
        self._findings = findings
        self._nodes: dict[str, _Node] = {}
        self._poses: dict[str, Pose] = {MODEL: IDENTITY}
        # The link that the frame of a model is fixed to.
        self.canonical: dict[str, str] = {}

    def add(self, name: str, base: str, raw: Pose, attached: str, element: Element,
            placement: str = '') -> None:
        """Add a frame; a second one of its name is reported."""
        if name in self._nodes:
            self._findings.error(element, f'is there twice, must have a name of its own: {name!r}')
            return
        self._nodes[name] = _Node(base, raw, attached, element, placement)

    def add_world(self) -> None:
        """Let poses be relative to the world, which is where the outermost frame is."""
        self._poses[WORLD] = IDENTITY

    def resolve(self, name: str, scope: str, element: Element) -> str:
        """Return the whole name of what is named in a scope such as `gripper::`, '' for none."""
        if name == WORLD:
            return WORLD
        whole = self._known(f'{scope}{name}')
        if whole == MODEL or whole in self._nodes:
            return whole
        here = [one.removeprefix(scope) for one in self._nodes if one.startswith(scope)]
        self._findings.error(element, f'{name[:80]!r} is neither a link nor a frame, a joint or a '
                             f'model here, {similar(name, here) or "must be one"}')
        return ''

    def _known(self, name: str) -> str:
        """Return the whole name of a frame: that of a model stands for the frame of the model."""
        return name if name in self._nodes else (
            f'{name}::{MODEL}' if f'{name}::{MODEL}' in self._nodes else name)

    def pose(self, name: str, element: Place) -> Pose:
        """Return the pose of a frame in the outermost model."""
        chain: list[str] = []
        seen: set[str] = set()
        at = name
        while at not in self._poses:
            if at in seen or at not in self._nodes:
                self._report(at, chain, element)
                break
            seen.add(at)
            chain.append(at)
            at = self._known(self._nodes[at].base)
        # Of what is reported, once, all that is relative to it has some pose.
        pose = self._poses.setdefault(at, IDENTITY)
        for step in reversed(chain):
            node = self._nodes[step]
            pose = combined(pose, node.raw)
            if node.placement:
                pose = combined(pose, inverse(self._within(node.placement, step, element)))
            self._poses[step] = pose
        return pose

    def _report(self, at: str, chain: list[str], element: Place) -> None:
        """Report a chain of poses that ends at what is no frame, or leads back to itself."""
        element = self._nodes[chain[-1]].element if chain else element
        if at in chain:
            self._findings.error(element, 'its pose leads back to itself, must lead to the model')
        else:
            meant = similar(at, self._nodes) or 'must be one'
            self._findings.error(element, f'{at[:80]!r} is no frame, {meant}')

    def _within(self, name: str, model: str, element: Place) -> Pose:
        """Return the pose of a frame in the model that it belongs to."""
        pose, at, seen = IDENTITY, self._known(name), {name}
        while at != model:
            node = self._nodes.get(at)
            if node is None or node.placement or node.base in seen:
                self._findings.error(element, f'placement_frame {name[:80]!r} is no frame of the '
                                     'model itself, must be one')
                return IDENTITY
            pose = combined(node.raw, pose)
            at = self._known(node.base)
            seen.add(at)
        return pose

    def link(self, name: str, element: Place) -> str:
        """Return the link that a frame is fixed to, '' after a report of one that is on none."""
        seen: set[str] = set()
        while name != WORLD:
            name = self.canonical.get(name) or self._known(name)
            name = self.canonical.get(name) or name
            node = self._nodes.get(name)
            if node is None or name in seen:
                self._findings.error(element, f'{name[:80]!r} is attached to no link, must be')
                return ''
            if not node.attached:
                return name
            seen.add(name)
            name = node.attached
        return WORLD
