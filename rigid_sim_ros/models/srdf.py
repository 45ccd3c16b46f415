# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""SRDF: which links of a URDF model never collide; groups and poses are for planners."""

from pathlib import Path

from rigid_sim_ros.models.description import Model
from rigid_sim_ros.models.findings import Findings
from rigid_sim_ros.models.xml_tree import read
from rigid_sim_ros.words import nearest


def read_srdf(path: Path, model: Model) -> None:
    """Add the pairs of a file to a model; raises ModelError where it names what is not there."""
    root = read(path)
    findings = Findings()
    links = {link.name for link in model.links}
    if root.tag != 'robot':
        findings.error(root, 'is no robot, the first element must be <robot>')
    for element in root.each('disable_collisions'):
        pair = [element.attributes.get(key, '') for key in ('link1', 'link2')]
        for name in pair:
            if name not in links:
                findings.error(element, f'{name[:60]!r} is no link of the model, '
                               f'{nearest(name, sorted(links))}')
        if pair[0] != pair[1]:
            model.ignored_pairs.append((pair[0], pair[1]))
    findings.stop()
