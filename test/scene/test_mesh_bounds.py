# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mesh files that stand for far more than they hold are refused soon, whatever they repeat."""

import json
import struct

from bag.hostile import limited_time
import numpy as np
import pytest

from rigid_sim_ros.scene import mesh
from rigid_sim_ros.scene.mesh_bounds import _MOST_PARTS, bounded

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype='<f4')
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)], dtype='<u2')


def glb(nodes, *, count=4, view=True, pieces=(1,), places=CORNERS):
    """Return a GLB file of nodes that may hold its meshes, of so many equal pieces each."""
    raw = places.tobytes() + FACES.tobytes()
    piece = {'attributes': {'POSITION': 0}, 'indices': 1}
    corners = {'componentType': 5126, 'count': count, 'type': 'VEC3',
               **({'bufferView': 0} if view else {})}
    tree = json.dumps({
        'asset': {'version': '2.0'}, 'scene': 0, 'scenes': [{'nodes': [0]}], 'nodes': nodes,
        'meshes': [{'primitives': [piece] * each} for each in pieces],
        'buffers': [{'byteLength': len(raw)}],
        'bufferViews': [{'buffer': 0, 'byteOffset': 0, 'byteLength': places.nbytes},
                        {'buffer': 0, 'byteOffset': places.nbytes, 'byteLength': FACES.nbytes}],
        'accessors': [corners, {'bufferView': 1, 'componentType': 5123, 'count': 12,
                                'type': 'SCALAR'}]}).encode()
    tree += b' ' * (-len(tree) % 4)
    pieces = struct.pack('<I4s', len(tree), b'JSON') + tree + struct.pack(
        '<I4s', len(raw), b'BIN\0') + raw
    return struct.pack('<4sII', b'glTF', 2, 12 + len(pieces)) + pieces


def dae(nodes, scene):
    """Return a DAE file of library nodes and of what is in its scene."""
    numbers = ' '.join(f'{x:g}' for x in CORNERS.ravel())
    faces = ' '.join(map(str, FACES.ravel()))
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="pa" count="12">{numbers}</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles></mesh></geometry>
</library_geometries><library_nodes>{nodes}</library_nodes><library_visual_scenes>
<visual_scene id="s">{scene}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


def tenfold(levels):
    """Return nodes of which each holds the one before ten times, and the last of them."""
    nodes = '<node id="n0"><instance_geometry url="#g"/></node>' + ''.join(
        f'<node id="n{k}">{10 * f"""<instance_node url="#n{k - 1}"/>"""}</node>'
        for k in range(1, levels + 1))
    return nodes, f'<node><instance_node url="#n{levels}"/></node>'


ONE = '<node><instance_geometry url="#g"/></node>'
SOLID = b"""solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid a
"""


def repeated(count):
    """Return a DAE file with a geometry of so many equal pieces."""
    before, begin, rest = dae('', ONE).partition(b'<triangles')
    piece, end, after = rest.partition(b'</triangles>')
    return before + (begin + piece + end) * count + after


def test_a_surface_may_have_more_than_one_piece(tmp_path):
    for name, data, count in (('a.dae', repeated(9), 36), ('b.stl', SOLID * 9, 9),
                              ('c.glb', glb([{'mesh': 0}], pieces=(9, 2)), 36)):
        (tmp_path / name).write_bytes(data)
        assert len(mesh.read(tmp_path / name).faces) == count
        assert sum(len(one.faces) for one, _ in mesh.read_colored(tmp_path / name)) == count


def test_nodes_may_hold_nodes_as_those_of_a_skeleton_do(tmp_path):
    levels = 50
    inner = ONE
    for _ in range(levels):
        inner = f'<node>{inner}</node>'
    for name, data in (('a.dae', dae('', inner)), ('b.glb', glb(
            [*({'children': [k]} for k in range(1, levels)), {'mesh': 0}]))):
        (tmp_path / name).write_bytes(data)
        assert len(mesh.read(tmp_path / name).faces) == 4


def test_a_part_may_be_there_more_than_once(tmp_path):
    for name, data in (('a.dae', dae(*tenfold(2))), ('b.glb', glb(
            [{'children': list(range(1, 101))}, *[{'mesh': 0}] * 100]))):
        (tmp_path / name).write_bytes(data)
        assert len(mesh.read(tmp_path / name).faces) == 400
        assert sum(len(one.faces) for one, _ in mesh.read_colored(tmp_path / name)) == 400


HOSTILE = {
    'parts.glb': lambda: glb([{'children': list(range(1, 3 * _MOST_PARTS))},
                              *[{'mesh': 0}] * (3 * _MOST_PARTS)]),
    'numbers.glb': lambda: glb([{'mesh': 0}], count=2 ** 28, view=False),
    'few numbers of the file.glb': lambda: glb([{'mesh': 0}], count=10 ** 7, view=False),
    'pieces.glb': lambda: glb([{'mesh': 0}], pieces=(2 * _MOST_PARTS,)),
    'pieces that no node uses.glb': lambda: glb([{'mesh': 0}], pieces=(1, 4 * _MOST_PARTS)),
    'large pieces.glb': lambda: glb([{'mesh': 0}], count=10 ** 5, pieces=(1, 1000),
                                    places=np.tile(CORNERS, (25_000, 1))),
    'levels.glb': lambda: glb([*({'mesh': 0, 'children': [k]} for k in range(1, 9000)), {}]),
    'ring.glb': lambda: glb([{'mesh': 0, 'children': [1]}, {'children': [0]}]),
    'nested.glb': lambda: glb([]).replace(b'"nodes": []', b'"nodes": ' + b'[' * 9 + b']' * 9),
    'parts.dae': lambda: dae(*tenfold(7)),
    'ring.dae': lambda: dae('<node id="a"><instance_node url="#b"/></node>'
                            '<node id="b"><instance_node url="#a"/></node>',
                            '<node><instance_node url="#a"/></node>'),
    'deep.dae': lambda: dae('', '<node>' * 5000 + '</node>' * 5000),
    'pieces.dae': lambda: repeated(3 * _MOST_PARTS),
    'corners.dae': lambda: dae('', ONE).replace(b'<triangles count="4">', b'<polylist count="1">'
                                                b'<vcount>1999999999 1</vcount>').replace(
                                                    b'</triangles>', b'</polylist>'),
    'solids.stl': lambda: SOLID * (2 * _MOST_PARTS),
    'text.dae': lambda: dae(*tenfold(3)).replace(b'<p>', b'<p>' + b' ' * 300_000)}


@pytest.mark.parametrize('read', [mesh.read, mesh.read_colored])
@pytest.mark.parametrize('name', HOSTILE)
def test_what_grows_beyond_all_measure_is_refused_soon(tmp_path, name, read):
    (tmp_path / name).write_bytes(HOSTILE[name]())
    with limited_time(), pytest.raises(ValueError, match='is not a mesh that can be read'):
        read(tmp_path / name)


@pytest.mark.parametrize('name, said', [('levels.glb', 'levels'), ('solids.stl', 'parts')])
def test_it_is_refused_before_it_is_read(name, said):
    with pytest.raises(ValueError, match=said):
        bounded(HOSTILE[name](), name.rpartition('.')[2])


def test_groups_and_materials_of_an_obj_file_take_no_time(tmp_path):
    path = tmp_path / 'a.obj'
    corners = ''.join(f'v {x:g} {y:g} {z:g}\n' for x, y, z in CORNERS)
    lines = ''.join(f'usemtl m{k}\ng g{k}\nf {" ".join(str(i + 1) for i in FACES[k % 4])}\n'
                    for k in range(20_000))
    path.write_text(corners + lines)
    with limited_time():
        assert len(mesh.read(path).faces) == 20_000


def test_a_face_of_an_obj_file_may_go_on_in_the_next_line(tmp_path):
    (tmp_path / 'a.obj').write_text(
        'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\n3 4\n')
    assert len(mesh.read(tmp_path / 'a.obj').faces) == 2
