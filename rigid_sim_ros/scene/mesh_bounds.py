# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How large a mesh becomes: looked at before it is read.

A few lines of DAE or GLB may ask for the same part a million times, for nodes in nodes without
end, or for more numbers than the file holds, and whoever reads them copies all of it. ValueError
for what grows beyond all measure.
"""

from collections import Counter
from collections.abc import Callable, Sequence
import json
import struct
from typing import Any
from xml.sax import ContentHandler
from xml.sax.xmlreader import AttributesImpl

from defusedxml.sax import parseString

# Triangles of a file: more take minutes, and are drawn or made a hull of all the same.
MOST_FACES = 5_000_000
# Parts of a file, which take 0.2 ms each: drawings of machines have some thousands. A part is a
# node, and each piece of a surface with a material of its own, wherever it is used or not.
_MOST_PARTS = 10_000
# Nodes in nodes: whoever reads them goes from each up to the first. Skeletons have some thirty.
_MOST_LEVELS = 100
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


# --- STL ----------------------------------------------------------------------------------------

def _stl(data: bytes) -> bytes:
    """Refuse what consists of very many solids, as a file in letters may."""
    if (count := data.count(b'endsolid')) > _MOST_PARTS:
        _refuse(count, 'parts')
    return data


# --- GLB ----------------------------------------------------------------------------------------

def _glb(data: bytes) -> bytes:
    length, name = _PIECE.unpack_from(data, _GLB.size)
    start = _GLB.size + _PIECE.size
    if name != b'JSON' or len(data) < start + length:
        raise ValueError('no JSON')
    tree = json.loads(data[start:start + length])
    counts = [int(each['count']) for each in tree.get('accessors', ())]
    # Numbers of which a file says that they are all 0 do not stand in it.
    if max(counts, default=0) > len(data):
        _refuse(max(counts), 'numbers')
    nodes, meshes = tree.get('nodes', ()), tree.get('meshes', ())
    pieces = [len(mesh['primitives']) for mesh in meshes]
    used = [node['mesh'] for node in nodes if 'mesh' in node]
    # What no node uses is read too.
    parts = (sum(1 + len(node.get('children', ())) for node in nodes)
             + sum(pieces) + sum(pieces[k] for k in used))
    if parts > 3 * _MOST_PARTS:
        _refuse(parts, 'parts')
    sizes = [sum(_numbers(piece, counts) for piece in mesh['primitives']) for mesh in meshes]
    # Corners of triangles and places; pieces may share them, and are read with all of them.
    numbers = max(sum(counts), sum(sizes), sum(sizes[k] for k in used))
    if numbers > 6 * MOST_FACES:
        _refuse(numbers, 'numbers')
    _check_levels(nodes)
    return data


def _numbers(piece: Any, counts: list[int]) -> int:
    places = counts[piece['attributes']['POSITION']]
    return places + (counts[piece['indices']] if 'indices' in piece else 0)


def _check_levels(nodes: Sequence[Any]) -> None:
    """Refuse nodes that hold nodes, and so on, too often, or themselves."""
    level = set(range(len(nodes)))
    for _ in range(_MOST_LEVELS):
        level = {child for k in level for child in nodes[k].get('children', ())}
        if not level:
            return
    _refuse(_MOST_LEVELS, 'levels or more')


# --- DAE ----------------------------------------------------------------------------------------

# Elements that become a piece of a surface each.
_PIECES = {'lines', 'linestrips', 'polygons', 'polylist', 'triangles', 'trifans', 'tristrips'}


class _Node:
    """A node of a scene: what it holds itself, and which others."""

    def __init__(self) -> None:
        self.geometries: list[str] = []
        self.named: list[str] = []      # nodes that it repeats
        self.inner: list[_Node] = []


class _Outline(ContentHandler):
    """Keeps how large geometries are, of how many pieces, and which nodes repeat them."""

    def __init__(self) -> None:
        super().__init__()
        self.sizes: dict[str, int] = {}
        self.pieces: Counter[str] = Counter()
        self.corners = 0        # that polygons say they have
        self._corners: list[str] | None = None
        self.nodes: dict[str, _Node] = {}
        self.top: list[_Node] = []
        self._open: list[_Node] = []
        self._geometry = ''

    def startElement(self, name: str, attrs: AttributesImpl) -> None:
        """Take up an element."""
        url = str(attrs.get('url', '')).lstrip('#')
        if name == 'geometry':
            self._geometry = str(attrs.get('id', ''))
        elif name in _PIECES:
            self.pieces[self._geometry] += 1
        elif name == 'vcount':
            self._corners = []
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
        elif name == 'vcount' and self._corners is not None:
            self.corners += sum(map(int, ''.join(self._corners).split()))
            self._corners = None

    def characters(self, content: str) -> None:
        """Count text."""
        if self._geometry:
            self.sizes[self._geometry] = self.sizes.get(self._geometry, 0) + len(content)
        if self._corners is not None:
            self._corners.append(content)


def _dae(data: bytes) -> bytes:
    outline = _Outline()
    parseString(data, outline, forbid_dtd=True)     # no entities, and no archive
    if (parts := outline.pieces.total()) > _MOST_PARTS:     # what no node uses is read too
        _refuse(parts, 'parts')
    if outline.corners > 3 * MOST_FACES:
        _refuse(outline.corners, 'corners')
    known: dict[int, tuple[int, int, int]] = {}

    def total(node: _Node) -> tuple[int, int, int]:
        """Return parts, levels and size of a node, all that it holds written out."""
        if id(node) not in known:
            known[id(node)] = 1, _MOST_LEVELS, 0    # while it is asked for: it holds itself
            inner = [*node.inner, *(outline.nodes[name] for name in node.named
                                    if name in outline.nodes)]
            parts = 1 + sum(outline.pieces[name] for name in node.geometries)
            size = sum(outline.sizes.get(name, 0) for name in node.geometries)
            levels = 0
            for more, below, larger in map(total, inner):
                parts, size, levels = parts + more, size + larger, max(levels, below)
            known[id(node)] = parts, levels + 1, size
        return known[id(node)]

    totals = [total(node) for node in outline.top]
    for most, what, found in (
            (2 * _MOST_PARTS, 'parts', sum(parts for parts, _, _ in totals)),
            (_MOST_LEVELS, 'levels', max((levels for _, levels, _ in totals), default=0)),
            (_MOST_TEXT, 'bytes', sum(size for _, _, size in totals))):
        if found > most:
            _refuse(found, what)
    return data


_CHECKS: dict[str, Callable[[bytes], bytes]] = {
    'obj': _obj, 'stl': _stl, 'glb': _glb, 'dae': _dae}
