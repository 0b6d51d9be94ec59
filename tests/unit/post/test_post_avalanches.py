"""Drops of a column: a saw-tooth, plain loops, and exponents of what does and does not have one."""

import numpy as np
import pytest
from made_up_groups import source_of_series

from multicor_cli.post import PostError, avalanches
from multicor_cli.post.avalanches import find_events, fit_power_law
from multicor_cli.store.frames import NamedColumn


def saw_tooth(teeth, rising=8, falling=2, height=3.0, sign=1.0):
    tooth = np.concatenate([np.linspace(0.0, height, rising + 1)[:-1],
                            np.linspace(height, 0.0, falling + 1)[:-1]])  # fmt: skip
    return sign * (1.0 + np.append(np.tile(tooth, teeth), 0.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_saw_tooth(sign):
    """Equal drops, one per period."""
    table = avalanches(source_of_series(saw_tooth(12, sign=sign)), "pull", threshold=1.0)
    assert table.events.size == pytest.approx(np.full(12, 3.0))
    assert table.events.duration == pytest.approx(np.full(12, 0.2))
    assert table.events.start == pytest.approx(0.9 + np.arange(12.0))
    assert np.isnan(table.events.wait[0])
    assert table.events.wait[1:] == pytest.approx(np.ones(11))
    expected = {
        "count": 12.0,
        "rate": 1.0,
        "size": 3.0,
        "largest": 3.0,
        "duration": 0.2,
        "wait": 1.0,
    }
    assert {name: table.mean[name] for name in expected} == pytest.approx(expected)
    for name in ("rate", "size", "duration", "wait"):
        assert table.error[name] == pytest.approx(0.0, abs=1e-12)
    assert table.law is None
    assert "50 events are needed, there are 12" in table.note
    assert {row[0]: row[1] for row in table.rows}["mean drop [N]"] == pytest.approx(3.0)
    assert len(table.detail_rows) == 12


def test_time_without_motion_does_not_count():
    """Ninety seconds of a frozen stage amid a saw-tooth, in which the column is not known or falls:
    rate and waits are those of the time in which grains move."""
    teeth, still = saw_tooth(12)[:-1], 9
    for resting in (np.nan, 0.0):
        source = source_of_series(np.concatenate([teeth, np.full(still, resting), teeth]))
        time, pull = (column.values for column in source.series_columns)
        time[len(teeth) :] += 10.0 * np.minimum(np.arange(1, still + len(teeth) + 1), still)
        moved = np.full(pull.size, 0.1)
        moved[len(teeth) : len(teeth) + still] = 0.0
        source.series_columns.append(NamedColumn("window_duration", "s", moved))
        table = avalanches(source, "pull", threshold=1.0)
        # The last drop of the first piece ends a row before its last tooth is over
        assert table.mean["count"] == 24.0
        assert table.events.wait[1:] == pytest.approx(np.ones(23), rel=1e-9)
        assert table.mean["rate"] == pytest.approx(1.0, rel=0.01)
        assert table.events.size[[0, 12]] == pytest.approx([3.0, 3.0])


def drops_of(time, value, threshold):
    """Drop by drop, row by row."""
    found, k, n = [], 0, len(value)
    while k < n - 1:
        while k < n - 1 and value[k + 1] >= value[k]:
            k += 1
        top = k
        last_fall = k
        while k < n - 1 and value[k + 1] <= value[k]:
            k += 1
            if value[k] < value[k - 1]:
                last_fall = k
        begin = top
        while begin < last_fall and value[begin + 1] == value[begin]:
            begin += 1
        if value[begin] - value[last_fall] >= threshold > 0.0:
            found.append(
                (time[begin], time[last_fall] - time[begin], value[begin] - value[last_fall])
            )
    return np.array(found).reshape(-1, 3)


@pytest.mark.parametrize("seed", range(5))
def test_drops_one_after_the_other(seed):
    """Of a walk with steps that may be 0: what stays the same belongs to maximum or minimum."""
    random = np.random.default_rng(seed)
    value = np.cumsum(random.integers(-2, 3, 400)).astype(float)
    time = np.cumsum(random.random(400))
    events, expected = find_events(time, value, 3.0), drops_of(time, value, 3.0)
    assert len(expected) > 10
    assert events.start == pytest.approx(expected[:, 0])
    assert events.duration == pytest.approx(expected[:, 1])
    assert events.size == pytest.approx(expected[:, 2])


def test_drops_at_both_ends_count_and_plateaus_do_not_lengthen_them():
    found = find_events(np.arange(7.0), np.array([5.0, 5.0, 2.0, 2.0, 4.0, 4.0, 1.0]), 1.0)
    assert (found.start.tolist(), found.duration.tolist(), found.size.tolist()) == (
        [1.0, 5.0], [1.0, 1.0], [3.0, 3.0]
    )  # fmt: skip


def test_rows_without_steps_are_left_out():
    """A force that is 0 while nothing moves has not dropped."""
    value = np.array([0.0, 1.0, 3.0, 1.5, 4.0, 0.0, 0.0, 4.0, 5.0])
    moving = np.array([0.0, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.1, 0.1])
    table = avalanches(source_of_series(value, window_duration=moving), "pull", threshold=1.0)
    assert table.events.size.tolist() == [1.5]


# --- exponents


@pytest.mark.parametrize("alpha", [1.6, 2.5])
def test_a_power_law_has_its_exponent(alpha):
    random = np.random.default_rng(1)
    errors = []
    for _ in range(4):
        law, why = fit_power_law(0.3 * random.random(800) ** (-1.0 / (alpha - 1.0)))
        assert why == ""
        assert law.error == pytest.approx((alpha - 1.0) / np.sqrt(law.number), rel=0.2)
        errors.append((law.exponent - alpha) / law.error)
    assert np.abs(errors).max() < 4.0


def test_a_tail_begins_where_the_law_does():
    """Below 1 the density is flat."""
    random = np.random.default_rng(3)
    values = np.concatenate([random.random(600), random.random(900) ** (-1.0 / 1.2)])
    law, _ = fit_power_law(values)
    assert 0.8 < law.start < 1.6
    assert law.exponent == pytest.approx(2.2, abs=0.2)


@pytest.mark.parametrize("draw", [
    lambda random: random.exponential(1.0, 1000), lambda random: random.random(1000),
    lambda random: np.abs(random.normal(3.0, 1.0, 1000)), lambda random: np.full(100, 2.0),
    lambda random: random.random(20) ** -1.0, lambda random: np.zeros(90),
])  # fmt: skip
def test_what_is_no_power_law_has_no_exponent(draw):
    law, why = fit_power_law(draw(np.random.default_rng(4)))
    assert law is None
    assert why


# --- what cannot be


def test_what_has_no_drops_is_said():
    rising = source_of_series(np.arange(10.0), other=np.zeros(10))
    with pytest.raises(PostError, match="never drops"):
        avalanches(rising, "pull")
    with pytest.raises(PostError, match="must be positive"):
        avalanches(rising, "pull", threshold=0.0)
    with pytest.raises(PostError, match="no 'push'"):
        avalanches(rising, "push")
    with pytest.raises(PostError, match="has 2 values"):
        avalanches(rising, "pull", end=0.2)
    both = source_of_series(np.arange(10.0), **{"top: pull": np.zeros(10)})
    with pytest.raises(PostError, match="are several columns"):
        avalanches(both, "pull")
    gaps = saw_tooth(5)
    gaps[3] = np.nan
    assert avalanches(source_of_series(gaps), "pull", threshold=1.0).mean["count"] == 5.0
