# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the page knows of a bag."""
from importlib.util import find_spec
from unittest import SkipTest

if find_spec('viser') is None:
    raise SkipTest('viser is not installed: pip install .[view]')

from bag.sessions import messages_of, rewrite, shared_session
import numpy as np
import pytest

from rigid_sim_ros.bag import topics as kinds
from rigid_sim_ros.bag.batch import Batch
from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.messages.decode import multi_dof_state
from rigid_sim_ros.viewer import recording as module
from rigid_sim_ros.viewer.recording import Recording
from rigid_sim_ros.world import World


@pytest.fixture(scope='module')
def recording():
    return Recording(shared_session())


def test_every_recorded_state_is_there_to_the_bit(recording):
    messages = messages_of(shared_session(), kinds.STATE)
    assert len(recording) == len(messages)
    for row, (_, _, data) in enumerate(messages):
        t_ns, _, _, numbers = multi_dof_state(data)
        motion = recording.motion(row)
        assert motion.t_ns == t_ns
        assert np.array_equal(np.hstack(motion[1:]), numbers)


def test_time_goes_on_where_a_reset_sets_the_clock_back(recording):
    clock = np.array([recording.motion(row).t_ns for row in range(len(recording))])
    assert (np.diff(clock) < 0).any()
    assert (np.diff(recording.times) >= 0).all()


def test_a_time_finds_the_last_state_before_it(recording):
    times = recording.times
    between = 0.5 * (times[10] + times[11])
    assert [recording.row(t) for t in (times[0] - 1, times[10], between, times[-1] + 1)] == [
        0, 10, 10, len(recording) - 1]


def test_what_happened_stands_at_its_time(recording):
    found = {each.what: each.time for each in recording.happenings}
    assert {'reset', 'pause', 'resume', 'set_pose', 'set_twist', 'speed', 'end'} <= set(found)
    assert found['set_pose'] == pytest.approx(0.81, abs=0.0101)     # s: within one state


def test_a_gap_is_told_of_with_what_is_missing(tmp_path):
    batch = Batch(World.from_dict({'format': 1, 'bodies': [
        {'name': 'ball', 'mass': 1.0, 'shape': {'type': 'sphere', 'radius': 0.1}}]}),
        tmp_path / 'bag')
    batch.run(100)
    batch.recorder.event(100, 'gap', since_step=50, messages=3, events=2)
    batch.run(100)
    batch.close()
    gap, = (each for each in Recording(tmp_path / 'bag').happenings if each.what == 'gap')
    assert gap.time == pytest.approx(0.1, abs=0.0101)       # s: within one state
    assert gap.text == 'gap 3'


def test_the_last_wrench_on_each_body_is_known(folder_with_wrench):
    recording = Recording(folder_with_wrench)
    assert recording.applied(recording.times[-1])['crate'].force == (0.1, 0.2, 0.3)


@pytest.fixture
def folder_with_wrench(tmp_path):
    from bag.sessions import wrench_session

    return wrench_session(tmp_path)


def test_a_long_session_is_thinned_out_evenly(monkeypatch, recording):
    size = len(messages_of(shared_session(), kinds.STATE)[0][2])
    monkeypatch.setattr(module, '_MOST_BYTES', 100 * size)
    thin = Recording(shared_session())
    assert len(thin) <= 100
    assert thin.thinning in (2, 4, 8)
    assert thin.duration == pytest.approx(recording.duration, abs=0.1)
    steps = np.diff(thin.times)
    assert np.quantile(steps, 0.9) < 1.5 * np.median(steps) + 1e-9


def test_a_bag_without_states_says_what_is_missing(tmp_path):
    bag = rewrite(shared_session(), tmp_path,
                  lambda topic, data: None if topic.kind == kinds.STATE else data)
    with pytest.raises(BagError, match='holds no states with their scene'):
        Recording(bag)
