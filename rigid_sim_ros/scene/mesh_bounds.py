# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How large a mesh becomes: looked at before it is read.

A few lines of DAE or GLB may ask for the same part a million times, or for more numbers than the
file holds, and whoever reads them copies all of it. ValueError for what grows beyond all measure.
"""

from collections.abc import Callable
import json
import struct
from typing import Any
from xml.sax import ContentHandler
from xml.sax.xmlreader import AttributesImpl

from defusedxml.sax import parseString

# Triangles of a file: more take minutes, and are drawn or made a hull of all the same.
MOST_FACES = 5_000_000
# Parts of a file, which take 0.2 ms each: drawings of machines have some thousands.
_MOST_PARTS = 10_000
# [bytes] What the text of a DAE file may become when all its parts are written out.
_MOST_TEXT = 2 ** 28
_GLB = struct.Struct('<4sII')
_PIECE = struct.Struct('<I4s')


def bounded(data: bytes, kind: str) -> bytes:
    """Return the bytes of a file to be read; ValueError if they stand for too much."""
    return _CHECKS.get(kind, lambda data: data)(data)


def _refuse(count: int, what: str) -> None:
    raise ValueError(f'{count} {what}')


# --- OBJ ----------------------------------------------------------------------------------------

def _obj(data: bytes) -> bytes:
    """Return the lines that tell of the surface: each change of group or material takes time."""
    lines = data.replace(b'\r\n', b'\n').replace(b'\\\n', b' ').splitlines()
    return b'\n'.join(line for line in lines if line.lstrip()[:1] in (b'v', b'f'))


# --- GLB ----------------------------------------------------------------------------------------

def _glb(data: bytes) -> bytes:
    length, name = _PIECE.unpack_from(data, _GLB.size)
    start = _GLB.size + _PIECE.size
    if name != b'JSON' or len(data) < start + length:
        raise ValueError('no JSON')
    tree = json.loads(data[start:start + length])
    counts = [int(each['count']) for each in tree.get('accessors', ())]
    if sum(counts) > 6 * MOST_FACES:    # corners of triangles, places and normals
        _refuse(sum(counts), 'numbers')
    nodes = tree.get('nodes', ())
    meshes = [sum(_corners(piece, counts) for piece in mesh['primitives'])
              for mesh in tree.get('meshes', ())]
    parts = sum(1 + len(node.get('children', ())) for node in nodes)
    if parts > 2 * _MOST_PARTS:
        _refuse(parts, 'parts')
    corners = sum(meshes[node['mesh']] for node in nodes if 'mesh' in node)
    if corners > 3 * MOST_FACES:
        _refuse(corners, 'corners')
    return data


def _corners(piece: Any, counts: list[int]) -> int:
    return counts[piece['indices'] if 'indices' in piece else piece['attributes']['POSITION']]


# --- DAE ----------------------------------------------------------------------------------------

class _Node:
    """A node of a scene: what it holds itself, and which others."""

    def __init__(self) -> None:
        self.geometries: list[str] = []
        self.named: list[str] = []      # nodes that it repeats
        self.inner: list[_Node] = []


class _Outline(ContentHandler):
    """Keeps how large geometries are, and which nodes repeat them."""

    def __init__(self) -> None:
        super().__init__()
        self.sizes: dict[str, int] = {}
        self.nodes: dict[str, _Node] = {}
        self.top: list[_Node] = []
        self._open: list[_Node] = []
        self._geometry = ''

    def startElement(self, name: str, attrs: AttributesImpl) -> None:
        """Take up an element."""
        url = str(attrs.get('url', '')).lstrip('#')
        if name == 'geometry':
            self._geometry = str(attrs.get('id', ''))
        elif name == 'node':
            node = _Node()
            (self._open[-1].inner if self._open else self.top).append(node)
            self.nodes[attrs.get('id', '') or str(id(node))] = node
            self._open.append(node)
        elif name == 'instance_node' and self._open:
            self._open[-1].named.append(url)
        elif name in ('instance_geometry', 'instance_controller') and self._open:
            self._open[-1].geometries.append(url)

    def endElement(self, name: str) -> None:
        """Leave an element."""
        if name == 'node':
            self._open.pop()
        elif name == 'geometry':
            self._geometry = ''

    def characters(self, content: str) -> None:
        """Count text."""
        if self._geometry:
            self.sizes[self._geometry] = self.sizes.get(self._geometry, 0) + len(content)


def _dae(data: bytes) -> bytes:
    outline = _Outline()
    parseString(data, outline, forbid_dtd=True)     # no entities, and no archive
    known: dict[int, tuple[int, int]] = {}

    def total(node: _Node) -> tuple[int, int]:
        """Return of how many nodes one consists, and how large it is, all written out."""
        if id(node) not in known:
            known[id(node)] = _MOST_PARTS + 1, 0    # while it is asked for: it holds itself
            inner = [*node.inner, *(outline.nodes[name] for name in node.named
                                    if name in outline.nodes)]
            parts, size = 1, sum(outline.sizes.get(name, 0) for name in node.geometries)
            for more, larger in map(total, inner):
                parts, size = parts + more, size + larger
            known[id(node)] = parts, size
        return known[id(node)]

    for node in outline.top:
        parts, size = total(node)
        if parts > _MOST_PARTS:
            _refuse(parts, 'parts')
        if size > _MOST_TEXT:
            _refuse(size, 'bytes')
    return data


_CHECKS: dict[str, Callable[[bytes], bytes]] = {'obj': _obj, 'glb': _glb, 'dae': _dae}
