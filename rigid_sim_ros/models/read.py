# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read a model: which reader a file is for is what its name ends with."""

from collections.abc import Callable, Mapping
import os
from pathlib import Path

from rigid_sim_ros.models.description import Model
from rigid_sim_ros.models.files import Folders
from rigid_sim_ros.models.findings import ModelError
from rigid_sim_ros.models.mjcf import read_mjcf
from rigid_sim_ros.models.sdf import read_sdf
from rigid_sim_ros.models.srdf import read_srdf
from rigid_sim_ros.models.urdf import read_urdf
from rigid_sim_ros.models.xacro_file import expanded
from rigid_sim_ros.models.xml_tree import contents
from rigid_sim_ros.problems import Problem


def read_model(path: Path, packages: Mapping[str, Path] | None = None,
               srdf: Path | None = None, arguments: Mapping[str, str] | None = None) -> Model:
    """
    Return the description of the model in a file.

    `packages` are folders by the names that package:// and model:// have for them. `srdf` is a
    file with pairs that do not collide; None: the one of the same name beside the model, if there
    is one. `arguments` are those of a xacro file. Raises ModelError with file and line of all that
    is wrong.
    """
    kind = ending(path)
    if not kind:
        raise ModelError([Problem(f'is no model, must end with {", ".join(ENDINGS)}', '',
                                  str(path))])
    # As it is written, and absolute: links that a workspace is made of stay as they are.
    folder = Path(os.path.abspath(path)).parent
    folders = Folders(folder, dict(packages or {}))
    told = path
    if kind == _XACRO:
        data = expanded(path, arguments or {}, folders)
        # Lines are those of what `xacro FILE` writes: it does not say where these come from.
        told = path.with_name(f'{path.name} (expanded by xacro)')
    else:
        data = contents(path)
    model = _READERS[kind](data, told, folders)
    if _READERS[kind] is read_urdf:
        model.urdf = data.decode('utf-8', 'replace')
    if srdf is None:
        beside = path.with_suffix('.srdf')
        srdf = beside if beside.is_file() else None
    if srdf is not None:
        read_srdf(srdf, model)
    return model


def ending(path: str | os.PathLike[str]) -> str:
    """Return the ending that says what a file is, in lower case, '' for that of no model."""
    suffix = os.path.splitext(os.fspath(path))[1].lower()
    return suffix if suffix in _READERS else ''


_XACRO = '.xacro'
_READERS: dict[str, Callable[[bytes, Path, Folders], Model]] = {
    '.urdf': read_urdf, _XACRO: read_urdf, '.sdf': read_sdf, '.xml': read_mjcf,
    '.mjcf': read_mjcf}
ENDINGS = tuple(_READERS)
