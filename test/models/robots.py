# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small models whose figures follow from formulas, as files of each format."""

from pathlib import Path
from typing import Any

from rigid_sim_ros import World

# A slender rod of 1 m and 1 kg hangs on a base at a height of 1 m; a tool frame is at its end.
INERTIAL = ('<inertial><origin xyz="0 0 -0.5"/><mass value="1"/>'
            '<inertia ixx="{I}" ixy="0" ixz="0" iyy="{I}" iyz="0" izz="{J}"/></inertial>')
ROD = INERTIAL.format(I=1 / 12, J=2e-4)
URDF = f"""<robot name="pendulum">
  <link name="base"/>
  <link name="rod">{ROD}
    <collision><origin xyz="0 0 -0.5"/><geometry><cylinder radius="0.02" length="1"/></geometry>
    </collision></link>
  <link name="tool"/>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
    <origin xyz="0 0 1"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="10" velocity="5"/></joint>
  <joint name="hold" type="fixed"><parent link="rod"/><child link="tool"/>
    <origin xyz="0 0 -1" rpy="0 1.5707963267948966 0"/></joint>
</robot>
"""


def write(folder: Path, name: str, text: str) -> Path:
    """Write a file and return its path."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding='utf-8')
    return path


def world_of(path: Path, **more: Any) -> World:
    """Return a world with nothing but a model, called r."""
    return World.from_dict({'world': {'contact': 'none'}, 'models': [
        {'name': 'r', 'file': str(path), **more}]})
