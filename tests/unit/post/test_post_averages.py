"""Errors of means over series whose errors are known: autoregressive ones of first order, with and
without drift."""

import math

import numpy as np
import pytest

from multicor_cli.post.sums import FEW_ROWS, pseudo_values, spread, standard_errors


def autoregressive(phi, rows, count, seed=1):
    """Stationary series of variance 1, shape ``(rows, count)``."""
    noise = np.random.default_rng(seed).normal(size=(rows, count))
    series = np.empty_like(noise)
    series[0] = noise[0]
    for k in range(1, rows):
        series[k] = phi * series[k - 1] + math.sqrt(1.0 - phi * phi) * noise[k]
    return series


def variance_of_mean(phi, rows):
    lag = np.arange(1, rows)
    return float(1.0 + 2.0 * ((1.0 - lag / rows) * phi**lag).sum()) / rows


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.8, 0.9])
def test_errors_are_true_and_intervals_cover(phi):
    """800 series of 800 rows: ±2 errors would cover 95.4 % if they were known; four deviations of a
    binomial are 3 %."""
    series = autoregressive(phi, 800, 800)
    found = spread(series)
    ratio = np.sqrt((found.error**2).mean() / variance_of_mean(phi, 800))
    assert ratio == pytest.approx(1.0, abs=0.12)
    assert np.median(found.memory) == pytest.approx((1.0 + phi) / (1.0 - phi), rel=0.2)
    cover = (np.abs(series.mean(axis=0)) < 2.0 * found.error).mean()
    assert 0.92 < cover < 0.985
    assert found.is_drifting.mean() < 0.02


def test_short_series_that_remember_cover_more_than_those_of_blocks():
    """30 rows that hold about ten independent ones; blocks of three rows are not independent."""
    series = autoregressive(0.5, 30, 2000)
    found = spread(series)
    blocks = series.reshape(10, 3, -1).mean(axis=1).std(axis=0, ddof=1) / math.sqrt(10.0)
    known = np.isfinite(found.error)
    inside = np.abs(series.mean(axis=0)) < 2.0 * found.error
    assert known.mean() > 0.95
    assert inside[known].mean() > 0.88
    assert inside[known].mean() > (np.abs(series.mean(axis=0)) < 2.0 * blocks).mean() + 0.03


def test_drift_is_the_slope_and_is_told():
    series = autoregressive(0.3, 200, 300)
    time = np.linspace(2.0, 5.0, 200)
    found = spread(series + (time - 2.0)[:, np.newaxis], time)
    assert found.drift[0] == pytest.approx(3.0 * np.polyfit(time, series[:, 0], 1)[0] + 3.0)
    assert found.drift.mean() == pytest.approx(3.0, abs=4.0 * found.drift.std() / math.sqrt(300))
    assert np.sqrt((found.drift_error**2).mean()) == pytest.approx(found.drift.std(), rel=0.2)
    assert found.is_drifting.mean() > 0.95
    one = spread(series[:, 0] + time, time)
    assert one.note() == "drifts"
    # The drift is in the error, or there is none
    assert not (one.error < found.drift_error[0] / 10.0)


def test_errors_of_few_rows_are_told_to_be_a_guess():
    """Eight independent rows: the errors are true on average, but ±2 of them cover less, and drifts
    cannot be told."""
    series = autoregressive(0.0, 8, 4000)
    found = spread(series)
    assert np.isfinite(found.error).mean() > 0.9
    inside = np.abs(series.mean(axis=0)) < 2.0 * found.error
    assert 0.85 < inside[np.isfinite(found.error)].mean() < 0.954
    assert found.is_unsure.all()
    assert not found.is_drifting.any()
    assert spread(series[:, 0]).note() == "too short"
    assert not spread(autoregressive(0.0, FEW_ROWS, 50)).is_unsure.all()


def test_what_cannot_be_known_is_not_a_number():
    two = spread(np.array([1.0, 2.0]))
    assert (two.error, two.drift) == pytest.approx((0.5, 1.0))
    assert np.isnan(two.drift_error)
    assert np.isnan(spread(np.array([1.0])).drift)
    assert np.isnan(spread(np.array([])).error)
    walk = spread(np.linspace(0.0, 1.0, 40) ** 2 + np.sin(np.linspace(0.0, 3.0, 40)))
    assert np.isnan(walk.error)
    assert walk.note() == "too short"
    constant = spread(np.full(5, 0.1))
    assert (float(constant.error), float(constant.drift), constant.note()) == (0.0, 0.0, "")


def test_pseudo_values_of_a_ratio_of_equal_weights_are_its_rows():
    rows = np.random.default_rng(3).random(12)
    assert pseudo_values(np.asarray(rows.mean()), (rows.sum() - rows) / 11) == pytest.approx(rows)


def test_standard_errors_are_those_of_the_spread():
    rows = np.cumsum(np.random.default_rng(8).normal(size=(30, 4, 6)), axis=0)
    rows[:, 1, 2], rows[3:9, 0, 1], rows[:29, 2, 0] = 5.0, np.nan, np.nan
    found, expected = standard_errors(rows), spread(rows).error
    assert np.array_equal(found, expected, equal_nan=True)
    assert found.shape == (4, 6)
    assert found[1, 2] == 0.0
    assert np.isnan(standard_errors(rows[:1])).all()
