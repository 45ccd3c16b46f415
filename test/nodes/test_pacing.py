# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Deadlines, with the wall clock played by the test: no wall time is measured."""
import pytest

from rigid_sim_ros.nodes.pacing import CATCH_UP_NS, MILLISECOND, Pacer

STEP = MILLISECOND


def run_until(pacer: Pacer, end_ns: int, wake_ns: int, start_ns: int = 0) -> int:
    """Wake up every `wake_ns`, do what is due, and return how many steps that were."""
    done = 0
    for now_ns in range(start_ns, end_ns + 1, wake_ns):
        count = pacer.due(now_ns)
        if count:
            pacer.start(count, now_ns)
            done += count
    return done


def test_a_step_is_due_at_its_deadline_and_not_before():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    assert pacer.due(STEP - 1) == 0
    assert pacer.due(STEP) == 1


def test_the_wait_ends_at_the_deadline():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    assert pacer.wait_ns(STEP // 4) == 3 * STEP // 4
    assert pacer.wait_ns(2 * STEP) == 0
    pacer.start(1, STEP)
    assert pacer.wait_ns(STEP) == STEP


@pytest.mark.parametrize('factor', [0.01, 0.5, 1.0, 2.0, 10.0, 333.0])
def test_the_pace_is_the_factor(factor):
    pacer = Pacer(STEP, factor, now_ns=0)
    second = 1_000_000_000
    # One group of steps may be under way, and a tick is whole nanoseconds: 1e-6 of 1 ms.
    group = max(1.0, factor)
    assert run_until(pacer, second, 100_000) == pytest.approx(
        1000 * factor, abs=group, rel=1e-6)


def test_waking_up_late_does_not_shift_later_deadlines():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    for k in range(1, 1001):
        late_ns = k * STEP + 300_000
        assert pacer.start(pacer.due(late_ns), late_ns).late_ns == 300_000
    assert pacer.wait_ns(1000 * STEP) == STEP


def test_short_steps_share_a_deadline():
    pacer = Pacer(STEP // 10, 1.0, now_ns=0)
    assert pacer.due(MILLISECOND - 1) == 0
    assert pacer.due(MILLISECOND) == 10


def test_a_group_that_was_begun_is_due_to_its_end():
    pacer = Pacer(STEP // 10, 1.0, now_ns=0)
    pacer.start(4, MILLISECOND)
    assert pacer.due(MILLISECOND) == 6


def test_a_step_is_an_overrun_if_it_is_late_by_more_than_a_tick():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    assert pacer.start(1, 2 * STEP).overruns == 0
    assert pacer.start(1, 3 * STEP + 1).overruns == 1
    assert pacer.overruns == 1


def test_each_late_step_of_a_batch_counts():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    # At 5.5 steps the first four are late by 4.5, 3.5, 2.5 and 1.5; the fifth only by half a one.
    assert pacer.start(5, 5 * STEP + STEP // 2).overruns == 4


def test_a_debt_is_made_up_for():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    assert pacer.due(20 * STEP) == 20
    pacer.start(20, 20 * STEP)
    assert pacer.due(20 * STEP) == 0
    assert pacer.dropped_ns == 0


def test_a_debt_too_large_is_dropped():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    now_ns = 10 * CATCH_UP_NS
    assert pacer.due(now_ns) == CATCH_UP_NS // STEP
    assert pacer.dropped_ns == 9 * CATCH_UP_NS
    pacer.start(CATCH_UP_NS // STEP, now_ns)
    assert pacer.due(now_ns) == 0
    assert pacer.due(now_ns + STEP) == 1


def test_a_machine_too_slow_is_never_asked_for_more_than_the_bound():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    now_ns = 0
    for _ in range(100):
        count = pacer.due(now_ns)
        assert count <= CATCH_UP_NS // STEP
        pacer.start(count, now_ns)
        now_ns += max(1, count) * 3 * STEP      # a step takes three times its time
    assert pacer.dropped_ns > 0
    assert pacer.overruns > 0


def test_a_step_longer_than_the_bound_is_still_taken():
    step_ns = 5 * CATCH_UP_NS
    pacer = Pacer(step_ns, 1.0, now_ns=0)
    assert run_until(pacer, 10 * step_ns, step_ns // 5) == 10


def test_factor_0_has_no_deadline():
    pacer = Pacer(STEP, 0.0, now_ns=0)
    assert pacer.due(0) is None
    assert pacer.wait_ns(0) == 0
    assert pacer.start(1000, 0) == (0, 0)


def test_a_new_factor_holds_from_now_on():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    run_until(pacer, 100 * STEP, STEP)
    pacer.set_factor(2.0, 100 * STEP)
    assert pacer.due(100 * STEP) == 0
    assert run_until(pacer, 200 * STEP, STEP, start_ns=100 * STEP) == 200


def test_restart_forgets_the_debt():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    pacer.restart(50 * STEP)
    assert pacer.due(50 * STEP) == 0
    assert pacer.due(51 * STEP) == 1
    assert pacer.overruns == 0


def test_of_a_debt_a_little_beyond_what_is_caught_up_the_rest_is_dropped():
    pacer = Pacer(STEP, 1.0, now_ns=0)
    assert pacer.due(CATCH_UP_NS + 3 * STEP) == CATCH_UP_NS // STEP
    assert pacer.dropped_ns == 3 * STEP
