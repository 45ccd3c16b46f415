# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is plotted is what a world does: numbers against the world itself and against formulas."""
from functools import cache

from bag import sessions
import numpy as np
import pytest

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.bag.motion import Clock, read_motion
from rigid_sim_ros.messages import decode
from rigid_sim_ros.plots.command import choose_bodies, choose_rows, make_diagram
from rigid_sim_ros.plots.contacts import simulate_contacts
from rigid_sim_ros.plots.diagram import Line, Panel, thinned
from rigid_sim_ros.plots.energies import energies
from rigid_sim_ros.world import World

G = 9.81
# The centre of mass lies away from the body frame, and no axis along another: a wrong frame shows.
SPRUNG = {
    'format': 1,
    'world': {'contact': 'none'},
    'bodies': [
        {'name': 'crate', 'shape': {'type': 'box', 'size': [0.4, 0.3, 0.2]},
         'inertial': {'mass': 2.0, 'com': [0.05, -0.02, 0.01],
                      'inertia': [0.03, 0.04, 0.05, 0.001, 0, 0.002]},
         'pose': {'position': [1, 2, 3], 'orientation': [0.5, 0.1, -0.7, 0.5]},
         'twist': {'linear': [0.1, 0.2, -0.3], 'angular': [0.3, -0.2, 0.5]}},
        {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.5},
        {'name': 'post', 'shape': {'type': 'box', 'size': [1, 1, 1]}, 'fixed': True},
    ],
    'forces': [{'type': 'spring', 'a': 'crate', 'b': 'ball', 'stiffness': 20.0}],
}
FALLING = {
    'format': 1,
    'materials': {'default': {'restitution': 0.0}},
    'bodies': [
        {'name': 'floor', 'shape': {'type': 'plane'}, 'fixed': True},
        {'name': 'cube', 'shape': {'type': 'box', 'size': [1, 1, 1]}, 'mass': 2.0,
         'pose': {'position': [0, 0, 0.6]}},
    ],
}
SLIDING = {
    'format': 1,
    'materials': {'default': {'friction': 0.5}},
    'bodies': [
        FALLING['bodies'][0],
        FALLING['bodies'][1] | {'pose': {'position': [0, 0, 0.5]},
                                'twist': {'linear': [6.0, 0.0, 0.0]}}],
}


@cache
def recorded(name):
    """Return a bag and what the world said at each recorded state."""
    world = World.from_dict({'sprung': SPRUNG, 'falling': FALLING, 'sliding': SLIDING}[name])
    bag = sessions.lasting_folder() / name
    batch = Batch(world, bag)
    said = []
    for _ in range(100):
        said.append((world.kinetic_energy(), world.potential_energy(), world.total_momentum(),
                     world.total_angular_momentum()))
        batch.run(10)
    batch.close()
    return bag, said


def everything(bag, *, bodies=(), quantities=(), start=0.0, duration=None):
    return make_diagram(str(bag), bodies, quantities, start, duration)


def lines_of(diagram, title):
    panel, = (panel for panel in diagram.panels if panel.title == title)
    return {line.label: line for line in panel.lines}


def at_states(motion, values):
    """Return those rows of a series that belong to the states that `recorded` looked at."""
    rows = np.searchsorted(motion.time, np.arange(100) * 0.01 - 1e-6)
    return values[rows]


def test_energy_and_its_parts_are_those_of_the_world():
    bag, said = recorded('sprung')
    motion = read_motion(bag)
    found = energies(motion, motion.scene, slice(None), np.arange(3))
    kinetic, potential = np.array([row[:2] for row in said], dtype=float).T
    # A recorded twist is of the body frame: turning it into momenta and back loses some digits.
    assert at_states(motion, found.linear + found.rotational) == pytest.approx(kinetic, rel=1e-12)
    assert at_states(motion, found.potential) == pytest.approx(potential, rel=1e-12)


def test_linear_energy_is_that_of_the_centres_of_mass():
    motion = read_motion(recorded('sprung')[0])
    found = energies(motion, motion.scene, slice(None), np.array([1]))
    v = motion.linear_velocity[:, 1]     # of a ball, whose centre of mass is its frame
    assert found.linear == pytest.approx(0.5 * 1.5 * (v * v).sum(axis=1))


def test_momenta_are_those_of_the_world():
    bag, said = recorded('sprung')
    motion = read_motion(bag)
    found = energies(motion, motion.scene, slice(None), np.arange(3))
    assert at_states(motion, found.momentum) == pytest.approx(
        np.array([row[2] for row in said]), rel=1e-11, abs=1e-11)
    assert at_states(motion, found.angular_momentum) == pytest.approx(
        np.array([row[3] for row in said]), rel=1e-11, abs=1e-11)


def test_the_total_energy_is_the_sum_of_the_parts_that_are_drawn():
    lines = lines_of(everything(recorded('sprung')[0], quantities=['energy'])[0], 'Energy')
    assert lines.keys() == {'kinetic, linear', 'kinetic, rotational', 'potential', 'total'}
    parts = [line.y for label, line in lines.items() if label != 'total']
    assert lines['total'].y == pytest.approx(np.sum(parts, axis=0))


def test_a_choice_of_bodies_that_a_spring_joins_with_others_has_no_potential_energy():
    diagram, notes = everything(recorded('sprung')[0], bodies=['ball'], quantities=['energy'])
    assert lines_of(diagram, 'Energy').keys() == {
        'kinetic, linear', 'kinetic, rotational', 'kinetic'}
    assert notes == ['no potential energy: forces join the chosen bodies with others']


def test_where_nothing_but_gravity_acts_a_choice_has_its_potential_energy():
    lines = lines_of(everything(sessions.shared_session(), bodies=['ball'], duration=0.3)[0],
                     'Energy')
    z = lines_of(everything(sessions.shared_session(), bodies=['ball'], duration=0.3)[0],
                 'Position of ball')['z']
    assert lines['potential'].y == pytest.approx(1.0 * G * z.y)


def test_the_contact_force_on_a_body_at_rest_is_its_weight():
    bag, _ = recorded('falling')
    contacts = simulate_contacts(bag, read_motion(bag).scene, np.inf)
    assert contacts.note == ''
    late = contacts.time > 0.5
    assert contacts.force[late, 1] == pytest.approx(np.full(late.sum(), 2.0 * G), rel=1e-3)


def test_the_contact_force_on_a_body_that_slides_has_its_friction():
    bag, _ = recorded('sliding')    # for a second, of the 1.2 s after which it would stop
    contacts = simulate_contacts(bag, read_motion(bag).scene, np.inf)
    late = contacts.time > 0.5
    assert contacts.force[late, 1] == pytest.approx(
        np.full(late.sum(), 2.0 * G * np.hypot(1.0, 0.5)), rel=1e-3)


def test_contact_forces_are_means_that_hold_the_whole_blow():
    bag, _ = recorded('falling')
    contacts = simulate_contacts(bag, read_motion(bag).scene, np.inf)
    # From rest to rest all of gravity's impulse comes back through the contacts.
    span = np.diff(contacts.time)
    assert contacts.force[1:, 1] @ span == pytest.approx(2.0 * G * contacts.time[-1], rel=1e-3)


def test_contact_forces_are_drawn_from_the_largest_down_by_five_decades():
    panel = next(panel for panel in everything(recorded('falling')[0])[0].panels if panel.is_log)
    assert panel.title.startswith('Net contact force')
    largest = max(np.nanmax(line.y) for line in panel.lines)
    low, high = panel.limits()
    assert low < 1.1e-5 * largest
    assert largest < high
    assert panel.visible(np.array([0.0, largest])).tolist() == [low, largest]


def test_the_gap_is_the_height_above_the_floor_before_the_blow():
    bag, _ = recorded('falling')
    motion = read_motion(bag)
    gap = simulate_contacts(bag, motion.scene, np.inf).gap[:, 1]
    near = np.flatnonzero(np.isfinite(gap) & (gap > 0))
    assert len(near)
    # While the cube comes down its smallest gap since the last state is the latest. It was found
    # at the beginning of the last step, and within a step the cube falls sqrt(2 g 0.1 m) * 1 ms.
    assert gap[near] == pytest.approx(motion.position[near, 1, 2] - 0.5, abs=1.41e-3)


def test_contacts_end_where_the_motion_comes_out_otherwise_than_recorded(tmp_path):
    batch = Batch(World.from_dict({**sessions.SCENE, 'world': {'step': 0.001}}), tmp_path / 'bag')
    batch.run(300)
    batch.close()

    def change(topic, data):
        if topic.kind != kinds.STATE or decode.multi_dof_state(data)[0] != 240_000_000:
            return data
        return data[:-12] + b'\x01' + data[-11:]     # a bit of the last double

    changed = sessions.rewrite(tmp_path / 'bag', tmp_path, change)
    contacts = simulate_contacts(changed, read_motion(changed).scene, np.inf)
    assert contacts.time[-1] == pytest.approx(0.23)
    assert contacts.note.startswith('contact forces and gaps end at 0.24 s: simulated again')


def test_a_saved_state_of_another_scene_is_an_error_of_the_bag():
    bag, _ = recorded('falling')
    other = World.from_dict({**FALLING, 'world': {'gravity': [0, 0, -9.0]}}).scene
    with pytest.raises(BagError, match='a saved state in the bag cannot be used'):
        simulate_contacts(bag, other, np.inf)


def test_positions_are_the_recorded_ones():
    bag, _ = recorded('falling')
    motion = read_motion(bag)
    lines = lines_of(everything(bag, quantities=['position'])[0], 'Position of cube')
    assert (lines['z'].y == motion.position[:, 1, 2]).all()
    assert (lines['z'].x == motion.time).all()


def test_time_goes_on_across_a_reset_and_lines_are_interrupted_there():
    motion = read_motion(sessions.shared_session())
    diagram, _ = everything(sessions.shared_session(), bodies=['ball'], quantities=['position'])
    line = lines_of(diagram, 'Position of ball')['x']
    assert (np.diff(motion.time) >= 0).all()
    # The session is reset to time 0 once, and once with the time kept.
    assert len(diagram.resets) == len(motion.resets) == 1
    assert np.isnan(line.y).sum() == 1
    assert diagram.x_label == 'simulated time, resets not counted back [s]'


def test_a_clock_of_dates_counts_from_the_first():
    clock = Clock()
    assert clock.seconds(1_700_000_000_000_000_000) == (0.0, False)
    assert clock.seconds(1_700_000_000_500_000_000) == (0.5, False)


def test_a_clock_that_is_set_back_goes_on():
    clock = Clock()
    assert [clock.seconds(t) for t in (0, 2_000_000_000, 0, 1_000_000_000)] == [
        (0.0, False), (2.0, False), (2.0, True), (3.0, False)]


def test_bodies_are_chosen_by_patterns_in_the_order_of_the_scene():
    motion = read_motion(recorded('sprung')[0])
    assert choose_bodies(motion, ['b*', 'crate']).tolist() == [0, 1]
    assert choose_bodies(motion, []).tolist() == [0, 1]      # not the fixed one
    assert choose_bodies(motion, ['post']).tolist() == [2]
    with pytest.raises(BagError, match="'crates' matches no body, must be one of crate, ball"):
        choose_bodies(motion, ['crates'])


def test_a_span_of_time_is_cut_out():
    motion = read_motion(recorded('sprung')[0])
    time = motion.time[choose_rows(motion, 0.25, 0.5)]
    assert (time[0], time[-1]) == pytest.approx((0.25, 0.75))
    with pytest.raises(BagError, match='nothing from there on'):
        choose_rows(motion, 7.0, None)


def test_several_bodies_have_one_colour_each_in_all_panels():
    diagram, _ = everything(recorded('sprung')[0], bodies=['crate', 'ball'])
    titles = ['Position, x', 'Position, y', 'Position, z', 'Path', 'Speed', 'Angular speed']
    for title in titles:
        colors = {label: line.color for label, line in lines_of(diagram, title).items()}
        assert colors == {'crate': '#0072B2', 'ball': '#E69F00'}


@cache
def crowd():
    """Return the bag of 30 balls that fly apart."""
    world = World.from_dict({'format': 1, 'world': {'contact': 'none'}, 'bodies': [
        {'name': f'ball_{k}', 'shape': {'type': 'sphere', 'radius': 0.1}, 'mass': 1.0,
         'twist': {'linear': [k, 0, 0]}} for k in range(30)]})
    bag = sessions.lasting_folder() / 'crowd'
    batch = Batch(world, bag)
    batch.run(100)
    batch.close()
    return bag


def test_many_bodies_are_a_median_and_bands_and_not_thirty_lines():
    diagram, _ = everything(crowd())
    panel, = (panel for panel in diagram.panels if panel.title == 'Position, x')
    assert [line.label for line in panel.lines] == ['median']
    widest, middle = panel.bands
    # At 0.1 s the balls stand from 0 to 2.9 m; the middle 80 % from a tenth to nine tenths.
    assert (widest.low[-1], widest.high[-1]) == pytest.approx((0.0, 2.9))
    assert (middle.low[-1], middle.high[-1]) == pytest.approx((0.29, 2.61))
    assert panel.lines[0].y[-1] == pytest.approx(1.45)
    assert max(len(panel.lines) + len(panel.bands) for panel in diagram.panels
               if panel.axes is None) <= 4
    path, = (panel for panel in diagram.panels if panel.title == 'Path')
    assert [line.label for line in path.lines if line.label] == ['30 bodies']
    assert len({line.color for line in path.lines}) == len(path.lines) == 7


def test_what_cannot_be_plotted_is_said():
    _, notes = everything(sessions.shared_session())
    assert notes == ['no contact force: the scene has `contact: none`',
                     'no gap: the scene has `contact: none`']


def test_thinning_keeps_peaks_and_gaps():
    x = np.linspace(0.0, 1.0, 100_000)
    y = np.sin(40 * x)
    y[[12_345, 54_321]], y[77_777] = [5.0, -5.0], np.nan
    thin_x, thin_y = thinned(x, y)
    assert len(thin_x) < 7000
    assert (np.nanmin(thin_y), np.nanmax(thin_y)) == (-5.0, 5.0)
    assert np.isnan(thin_y).sum() == 1
    assert (np.diff(thin_x) > 0).all()


def test_rounding_does_not_fill_a_panel():
    x = np.linspace(0, 1, 10)
    low, high = Panel('Energy', 'J', [Line('total', x, 5.0 + 1e-15 * x, '#000000')]).limits()
    assert high - low == pytest.approx(0.02)     # 2 * 2e-3 of 5


def test_what_a_panel_shows_keeps_away_from_its_edges():
    x = np.linspace(0, 1, 10)
    low, high = Panel('Height', 'm', [Line('z', x, 3.0 - x, '#000000')]).limits()
    assert (low, high) == pytest.approx((1.95, 3.05))   # a twentieth of 1 m on either side


NAN = np.nan


@pytest.mark.parametrize('axes, y, dots', [
    (None, [1, 1, NAN, 2, NAN, 3, 3], [3]),     # what lasts for one state is to be seen
    (None, [5, NAN, 1, NAN, 4], [0, 2, 4]),
    (None, [1, 2, 3], []),
    (('x', 'y'), [1, 1, 1, NAN, 2, 2], [2, 5])])    # each path ends in a dot
def test_what_would_be_a_stretch_without_length_is_a_dot(axes, y, dots):
    line = Line('a', np.arange(len(y), dtype=float), np.array(y, dtype=float), '#000000')
    panel = Panel('Gap', 'mm', [line], axes=axes)
    assert np.flatnonzero(panel.dots(line)).tolist() == dots


@pytest.mark.parametrize('stiffness', [0.0, 50.0])
def test_efforts_are_drawn_by_themselves_only_where_there_are_any(tmp_path, stiffness):
    world = World.from_dict({
        'world': {'contact': 'none'},
        'bodies': [{'name': 'rod', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1}}],
        'joints': [{'name': 'turn', 'type': 'revolute', 'parent': 'world', 'child': 'rod',
                    'axis': [0, 1, 0], 'position': 0.3, 'pose': {'position': [0.3, 0, 0]},
                    'spring': {'stiffness': stiffness}}]})
    batch = Batch(world, tmp_path / 'bag')
    batch.run(50)
    batch.close()
    usual, _ = make_diagram(str(tmp_path / 'bag'), (), (), 0.0, None)
    titles = [panel.title for panel in usual.panels if panel.title.startswith('Joint')]
    assert titles == ['Joint position', 'Joint velocity'] + ['Joint effort'] * (stiffness > 0.0)
    chosen, _ = make_diagram(str(tmp_path / 'bag'), (), ['joint_effort'], 0.0, None)
    assert len(chosen.panels) == 1


def test_joints_are_drawn_as_they_were_published_turning_and_sliding_apart(tmp_path):
    link = {'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1}}
    world = World.from_dict({
        'world': {'contact': 'none'},
        'bodies': [{'name': 'arm/rod', **link}, {'name': 'arm/sled', **link}],
        'joints': [{'name': 'arm/turn', 'type': 'continuous', 'parent': 'world',
                    'child': 'arm/rod', 'axis': [0, 1, 0], 'pose': {'position': [0.3, 0, 0]}},
                   {'name': 'arm/slide', 'type': 'prismatic', 'parent': 'arm/rod',
                    'child': 'arm/sled', 'spring': {'stiffness': 50.0}}]})
    batch = Batch(world, tmp_path / 'bag')
    said = []
    for _ in range(50):
        said.append(np.stack([world.joint_position, world.joint_velocity, world.joint_effort]))
        batch.run(10)
    batch.close()
    quantities = ['joint_position', 'joint_velocity', 'joint_effort']
    diagram, notes = make_diagram(str(tmp_path / 'bag'), (), quantities, 0.0, 0.495)
    assert notes == []
    panels = {(panel.title, panel.unit): panel.lines for panel in diagram.panels}
    units_of = {'position': ('rad', 'm'), 'velocity': ('rad/s', 'm/s'), 'effort': ('N m', 'N')}
    for k, (title, units) in enumerate(units_of.items()):
        for j, name in enumerate(('arm/turn', 'arm/slide')):
            line, = panels[f'Joint {title}', units[j]]
            assert line.label == name
            assert line.y.tolist() == [numbers[k, j] for numbers in said]
    assert len({line.color for lines in panels.values() for line in lines}) == 2
    chosen, _ = make_diagram(str(tmp_path / 'bag'), (), quantities[:1], 0.0, None, ['*slide'])
    assert [panel.unit for panel in chosen.panels] == ['m']
    with pytest.raises(BagError, match='matches no joint, must be one of arm/turn, arm/slide'):
        make_diagram(str(tmp_path / 'bag'), (), (), 0.0, None, ['wheel'])
