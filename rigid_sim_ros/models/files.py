# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where the files lie that a model refers to.

What is found lies in the folder of the model, in the package around it, in a package of the
workspace (AMENT_PREFIX_PATH), or in a folder that the scene names; nowhere else, whatever a file
says.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
import os
from pathlib import Path
import re
from urllib.parse import unquote

from rigid_sim_ros.models.findings import Findings, Place
from rigid_sim_ros.reading import is_inside

# What a folder holds that is a package of ROS, or a model of Gazebo.
_MARKS = ('package.xml', 'model.config')
_SCHEMES = ('package://', 'model://')
# The name of a package, the first such element of its package.xml, and how far to look.
_NAME = re.compile(r'<name>\s*([\w-]+)\s*</name>')
_MOST_OF_PACKAGE = 20_000
# Folders above a model that are asked whether they are a package.
_MOST_ABOVE = 12


@dataclass(frozen=True)
class Folders:
    """Where to look for files."""

    model: Path     # the folder of the model
    packages: Mapping[str, Path] = field(default_factory=dict)

    def find(self, uri: str, place: Place, findings: Findings) -> Path | None:
        """Return the file that a URI or a path names; report one that is not there or not ours."""
        shown = repr(uri if len(uri) < 100 else f'{uri[:96]}...')
        if '\0' in uri or not uri.strip():
            findings.error(place, f'file {shown}, must be the name of a file')
            return None
        if uri.lower().startswith(('http://', 'https://')):
            findings.error(place, f'file {shown} lies in the net, and nothing is downloaded: must '
                           'be a file here')
            return None
        scheme = next((prefix for prefix in _SCHEMES if uri.startswith(prefix)), None)
        if scheme is not None:
            name, _, rest = uri.removeprefix(scheme).lstrip('/').partition('/')
            roots = list(self._named(name))
            if not roots:
                findings.error(place, f'{shown}: package {name!r} is not found, must be named by '
                               '`packages: {NAME: FOLDER}`, or be in AMENT_PREFIX_PATH, or around '
                               'the model')
                return None
            found = [path for root, is_ours in roots
                     if (path := _inside(root, root, unquote(rest), is_ours)) is not None]
        else:
            rest = unquote(uri.removeprefix('file://'))
            found = [path for root, is_ours in self._around()
                     if (path := _inside(root, self.model, rest, is_ours)) is not None]
        if not found:
            findings.error(place, f'file {shown} lies outside of the folders of the model, must '
                           'lie in its folder, or in a package that `packages` names')
            return None
        for path in found:
            if path.is_file():
                return path
        findings.error(place, f'file {shown} is not there, must be at {found[0]}')
        return None

    def package(self, name: str) -> Path | None:
        """Return the folder of a package, None where there is none of that name."""
        return next((folder for folder, _ in self._named(name)), None)

    def _named(self, name: str) -> Iterator[tuple[Path, bool]]:
        """Return the folders of a package, and whether the user has named them."""
        if name in self.packages:
            yield self.packages[name], True
        if not name or name in ('.', '..'):
            return
        for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
            folder = Path(prefix, 'share', name)
            if prefix and folder.is_dir():
                yield folder, True
        for above in [self.model, *self.model.parents][:_MOST_ABOVE]:
            if name in _names(above):
                yield above, False
        if (self.model / name).is_dir():
            yield self.model / name, False

    def _around(self) -> Iterator[tuple[Path, bool]]:
        """Return the folders in which a plain path may lie."""
        yield self.model, False
        for above in [*self.model.parents][:_MOST_ABOVE]:
            if any((above / mark).is_file() for mark in _MARKS):
                yield above, False
        for folder in self.packages.values():
            yield folder, True


def _names(folder: Path) -> set[str]:
    """
    Return the names that a folder has as a package, none if it is not one.

    A clone or an archive of a package seldom lies in a folder of the package's own name, which
    its package.xml tells.
    """
    marks = [mark for mark in _MARKS if (folder / mark).is_file()]
    found = {folder.name} if marks else set()
    if 'package.xml' in marks:
        try:
            with (folder / 'package.xml').open('rb') as file:
                head = file.read(_MOST_OF_PACKAGE)
        except OSError:     # nobody but its owner may read it
            return found
        found.update(_NAME.findall(head.decode('utf-8', 'replace'))[:1])
    return found


def _inside(root: Path, start: Path, rest: str, is_ours: bool) -> Path | None:
    """
    Return the path from a folder on, None if it leaves the root.

    In a folder that the user has named links are followed, as `colcon build --symlink-install`
    makes them; in that of a model, which may be a stranger's, none leads out.
    """
    path = Path(os.path.normpath(start / rest))
    if not path.is_relative_to(os.path.normpath(root)):
        return None
    return path if is_ours or is_inside(path, root) else None
