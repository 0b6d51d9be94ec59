"""One thread or several: the faster way is found, tried again now and then, and never asked for
where it cannot pay."""

import pytest

from multicor_cli.engine.contact.solve import PARALLEL_FROM, SLICE, ThreadChoice

MANY = PARALLEL_FROM


def carry_out(pace, slices, cost, relaxations=float(SLICE)):
    """What is chosen for some slices, on a machine where a relaxation costs so much on one thread
    and on several."""
    chosen = []
    for _ in range(slices):
        way = pace.choose(MANY)
        pace.note(MANY, way, relaxations, cost[way] * relaxations)
        chosen.append(way)
    return chosen


@pytest.mark.parametrize("threads_pay", [True, False])
def test_the_faster_way_is_taken_nearly_always(threads_pay):
    cost = {threads_pay: 5e-9, not threads_pay: 2e-8}
    chosen = carry_out(ThreadChoice(2), 2000, cost)
    assert chosen.count(threads_pay) > 1950
    tried = chosen.count(not threads_pay)
    assert 3 < tried < 50
    assert tried * cost[not threads_pay] < 0.1 * 2000 * 5e-9  # what the tries cost
    assert ThreadChoice(2).favorite == 2


def test_only_work_counts_not_compilation_nor_calls():
    pace = ThreadChoice(2)
    way = pace.choose(MANY)
    pace.note(MANY, way, float(SLICE), 20.0)
    chosen = carry_out(pace, 200, {True: 5e-9, False: 1e-8})
    assert chosen.count(True) > 190
    pace = ThreadChoice(2)
    chosen = carry_out(pace, 400, {True: 5e-9, False: 1e-8}, relaxations=SLICE / 100.0)
    assert all(chosen)  # four slices' worth of work: too early to try anything else


def test_it_follows_what_changes():
    pace = ThreadChoice(2)
    carry_out(pace, 100, {True: 5e-9, False: 1e-8})
    assert pace.favorite == 2
    # Another program has come
    assert carry_out(pace, 300, {True: 1e-7, False: 1e-8})[-50:].count(False) >= 49
    assert pace.favorite == 1
    assert carry_out(pace, 1500, {True: 5e-9, False: 1e-8})[-50:].count(True) >= 48  # and gone
    assert pace.favorite == 2


def test_one_thread_and_small_problems_need_no_choice():
    assert not ThreadChoice(1).choose(10**6)
    pace = ThreadChoice(8)
    assert not pace.choose(PARALLEL_FROM - 1)
    pace.note(PARALLEL_FROM - 1, False, 1e9, 1.0)
    assert pace.choose(PARALLEL_FROM)
    assert pace.favorite == 8
