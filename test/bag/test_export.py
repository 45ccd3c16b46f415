# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables hold the numbers of the bag, and say their units."""

from bag.sessions import messages_of, rewrite, shared_session, wrench_session
import numpy as np
from pyarrow import csv, parquet
import pytest

from rigid_sim_ros import World
from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.export import export, format_of, JOINTS, MOTION
from rigid_sim_ros.bag.topics import typestore

READ = {'csv': csv.read_csv, 'parquet': parquet.read_table}


def positions(bag) -> np.ndarray:
    """Return the positions in a bag, read by rosbags."""
    rows = []
    for _, _, data in messages_of(bag, kinds.STATE):
        message = typestore().deserialize_cdr(data, kinds.TYPES[kinds.STATE])
        rows += [[t.translation.x, t.translation.y, t.translation.z] for t in message.transforms]
    return np.array(rows)


@pytest.mark.parametrize('file_format', ['csv', 'parquet'])
def test_a_table_holds_every_state_to_the_last_digit(tmp_path, file_format) -> None:
    bag = shared_session()
    path = tmp_path / f'motion.{file_format}'
    expected = positions(bag)
    assert export(bag, file_format, path) == [(path, len(expected))]
    table = READ[file_format](path)
    assert tuple(table.column_names) == tuple(column.name for column in MOTION)
    found = np.column_stack([table[f'position_{axis}'] for axis in 'xyz'])
    assert np.array_equal(found, expected)
    assert table['body'].to_pylist()[:3] == ['crate', 'ball', 'crate']


def header(path) -> list[str]:
    return path.read_text().splitlines()[0].replace('"', '').split(',')


def test_names_are_such_as_a_program_can_write(tmp_path) -> None:
    export(shared_session(), 'csv', tmp_path / 'motion.csv')
    assert all(name.isidentifier() for name in header(tmp_path / 'motion.csv'))


def test_every_number_has_its_unit_in_the_header_if_that_is_wanted(tmp_path) -> None:
    export(shared_session(), 'csv', tmp_path / 'motion.csv', units=True)
    names = header(tmp_path / 'motion.csv')
    assert [name for name in names if not name.endswith(']')] == ['body']
    assert 'angular_velocity_z [rad/s]' in names


def test_a_parquet_file_knows_the_units(tmp_path) -> None:
    export(shared_session(), 'parquet', tmp_path / 'motion.parquet')
    schema = parquet.read_schema(tmp_path / 'motion.parquet')
    assert {field.name: field.metadata[b'unit'].decode() for field in schema
            if field.name != 'body'} == {
        column.name: column.unit for column in MOTION if column.name != 'body'}


@pytest.mark.parametrize(('output', 'expected'), [
    (None, 'csv'), ('a.csv', 'csv'), ('a/b.PARQUET', 'parquet')])
def test_the_ending_says_the_format(output, expected) -> None:
    assert format_of(output) == expected


def test_an_unknown_ending_is_an_error_that_names_the_others() -> None:
    with pytest.raises(BagError, match=r'table\.txt: must end in \.csv or \.parquet'):
        format_of('table.txt')


def test_wrenches_go_to_a_file_of_their_own(tmp_path) -> None:
    beside = tmp_path / 'motion_wrenches.csv'
    assert export(wrench_session(tmp_path), 'csv', tmp_path / 'motion.csv') == [
        (tmp_path / 'motion.csv', 2), (beside, 1)]
    assert csv.read_csv(beside).drop_columns('bag_time').to_pylist() == [{
        'time': 0.005, 'body': 'crate', 'frame': 'crate', 'force_x': 0.1,
        'force_y': 0.2, 'force_z': 0.3, 'torque_x': 0, 'torque_y': 0,
        'torque_z': 0}]


def test_a_bag_without_motion_is_an_error(tmp_path) -> None:
    bag = rewrite(shared_session(), tmp_path, lambda topic, data: (
        data if topic.kind == kinds.POSE else None))
    with pytest.raises(BagError, match='holds no motion'):
        export(bag, 'csv', tmp_path / 'motion.csv')


@pytest.mark.parametrize('name', ['motion.csv', 'motion_wrenches.csv'])
def test_a_file_that_exists_is_not_overwritten(tmp_path, name) -> None:
    (tmp_path / name).write_text('precious')
    with pytest.raises(BagError, match='exists already'):
        export(shared_session(), 'csv', tmp_path / 'motion.csv')
    assert (tmp_path / name).read_text() == 'precious'


def test_a_folder_that_does_not_exist_is_an_error(tmp_path) -> None:
    with pytest.raises(BagError, match='No such file'):
        export(shared_session(), 'csv', tmp_path / 'nowhere' / 'motion.csv')


def test_joint_states_go_to_a_file_of_their_own(tmp_path) -> None:
    world = World.from_dict({
        'world': {'contact': 'none'},
        'bodies': [{'name': name, 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1}}
                   for name in ('arm/rod', 'bob')],
        'joints': [{'name': f'{model}{name}', 'type': 'continuous', 'parent': 'world',
                    'child': child, 'axis': [0, 1, 0], 'pose': {'position': [0.3, 0, 0]}}
                   for model, name, child in (('arm/', 'turn', 'arm/rod'), ('', 'pivot', 'bob'))]})
    batch = Batch(world, tmp_path / 'bag')
    batch.run(10)
    batch.close()
    beside = tmp_path / 'motion_joints.csv'
    assert (beside, 4) in export(tmp_path / 'bag', 'csv', tmp_path / 'motion.csv')
    table = csv.read_csv(beside)
    assert tuple(table.column_names) == tuple(column.name for column in JOINTS)
    assert table['joint'].to_pylist() == ['arm/turn', 'pivot'] * 2
    assert table['position'].to_pylist()[2:] == world.joint_position.tolist()
    assert table['velocity'].to_pylist()[2:] == world.joint_velocity.tolist()
