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
from rigid_sim_ros.bag.export import export, JOINTS, MOTION
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
    assert tuple(table.column_names) == MOTION
    found = np.column_stack([table[f'position {axis} [m]'] for axis in 'xyz'])
    assert np.array_equal(found, expected)
    assert table['body'].to_pylist()[:3] == ['crate', 'ball', 'crate']


def test_every_number_has_its_unit_in_the_header(tmp_path) -> None:
    export(shared_session(), 'csv', tmp_path / 'motion.csv')
    header = (tmp_path / 'motion.csv').read_text().splitlines()[0]
    assert [name for name in header.replace('"', '').split(',') if not name.endswith(']')] == [
        'body']


def test_wrenches_go_to_a_file_of_their_own(tmp_path) -> None:
    beside = tmp_path / 'motion_wrenches.csv'
    assert export(wrench_session(tmp_path), 'csv', tmp_path / 'motion.csv') == [
        (tmp_path / 'motion.csv', 2), (beside, 1)]
    assert csv.read_csv(beside).drop_columns('bag time [s]').to_pylist() == [{
        'time [s]': 0.005, 'body': 'crate', 'frame': 'crate', 'force x [N]': 0.1,
        'force y [N]': 0.2, 'force z [N]': 0.3, 'torque x [N m]': 0, 'torque y [N m]': 0,
        'torque z [N m]': 0}]


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
    assert tuple(table.column_names) == JOINTS
    assert table['joint'].to_pylist() == ['arm/turn', 'pivot'] * 2
    assert table['position [rad or m]'].to_pylist()[2:] == world.joint_position.tolist()
    assert table['velocity [rad/s or m/s]'].to_pylist()[2:] == world.joint_velocity.tolist()
