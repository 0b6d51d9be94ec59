"""Radii follow their distributions, by number and by mass."""

import math
from statistics import NormalDist

import numpy as np
import pytest
from packing_support import generator, uniform

from multicor_cli.packing.sizes import (
    diameter,
    disc_area,
    draw_to_total,
    list_sizes,
    lognormal_sizes,
    normal_sizes,
    power_sizes,
    table_sizes,
)

LOW, HIGH, N = 0.5e-3, 2.0e-3, 20_000


def power_mean(exponent):
    """Mean of the density r^-exponent on [LOW, HIGH]."""

    def integral(p):
        return math.log(HIGH / LOW) if p == 0.0 else (HIGH**p - LOW**p) / p

    return integral(2.0 - exponent) / integral(1.0 - exponent)


def lognormal_mean(median, sigma):
    a, b = (math.log(r / median) / sigma for r in (LOW, HIGH))
    cdf = NormalDist().cdf
    return median * math.exp(sigma**2 / 2) * (cdf(b - sigma) - cdf(a - sigma)) / (cdf(b) - cdf(a))


def normal_mean(mean, sigma):
    a, b = ((r - mean) / sigma for r in (LOW, HIGH))
    normal = NormalDist()
    return mean + sigma * (normal.pdf(a) - normal.pdf(b)) / (normal.cdf(b) - normal.cdf(a))


SIEVE = np.array([LOW, 0.8e-3, 0.9e-3, HIGH]), np.array([0.0, 0.25, 0.25, 1.0])


ENDS = (LOW, HIGH)
FAMILIES = {
    "uniform": (power_sizes, (0.0, *ENDS), 0.5 * (LOW + HIGH)),
    "power 1": (power_sizes, (1.0, *ENDS), power_mean(1.0)),
    "power 2.5": (power_sizes, (2.5, *ENDS), power_mean(2.5)),
    "power -2": (power_sizes, (-2.0, *ENDS), power_mean(-2.0)),
    "lognormal": (lognormal_sizes, (1e-3, 0.4, *ENDS), lognormal_mean(1e-3, 0.4)),
    "lognormal, tail": (lognormal_sizes, (0.5e-3, 0.1, *ENDS), lognormal_mean(0.5e-3, 0.1)),
    "normal": (normal_sizes, (1e-3, 0.3e-3, *ENDS), normal_mean(1e-3, 0.3e-3)),
    "normal, tail": (normal_sizes, (HIGH, 0.2e-3, *ENDS), normal_mean(HIGH, 0.2e-3)),
    "table": (table_sizes, SIEVE, 0.25 * 0.65e-3 + 0.75 * 1.45e-3),
}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("power", [0, 2, 3])
def test_mean_of_continuous_families(family, power):
    make, arguments, expected = FAMILIES[family]
    radii = make(*arguments, power).draw(N, generator())
    weight = radii**power
    assert radii.min() >= LOW * (1 - 1e-12)
    assert radii.max() <= HIGH * (1 + 1e-12)
    assert np.average(radii, weights=weight) == pytest.approx(expected, rel=3e-4)


@pytest.mark.parametrize("power", [2, 3])
def test_masses_of_uniform_and_listed_sizes(power):
    radii = np.sort(power_sizes(0.0, LOW, HIGH, power).draw(N, generator()))
    mass = np.cumsum(radii**power) / (radii**power).sum()
    np.testing.assert_allclose(mass, (radii - LOW) / (HIGH - LOW), atol=5e-4)
    sizes = list_sizes(np.array([1e-3, 2e-3]), np.array([0.25, 0.75]), power)
    radii = sizes.draw(10_000, generator())
    share = (radii[radii == 1e-3] ** power).sum() / (radii**power).sum()
    assert share == pytest.approx(0.25, abs=5e-4)


@pytest.mark.parametrize(
    ("count", "fractions"),
    [(1000, [0.2, 0.3, 0.5]), *((count, [0.15, 0.5, 0.35]) for count in (7, 100, 1001))],
)
def test_list_is_within_one_grain_of_its_fractions(count, fractions):
    sizes = list_sizes(np.array([1.0, 2.0, 3.0]), np.array(fractions), 0)
    radii = sizes.draw(count, generator())
    got = np.array([np.count_nonzero(radii == r) for r in (1.0, 2.0, 3.0)])
    assert got.sum() == count
    expected = np.array(fractions) * count
    assert np.all(np.abs(got - expected) < (0.01 if count == 1000 else 1.0))
    assert np.any(np.diff(radii) < 0)  # shuffled


def test_few_draws_from_a_long_list_reach_all_of_it():
    long = list_sizes(np.linspace(1.0, 2.0, 1000), None, 0)
    assert long.draw(40, generator()).mean() == pytest.approx(1.5, abs=0.02)


@pytest.mark.parametrize(("measure", "total"), [(disc_area, 1e-3), (diameter, 0.123)])
def test_drawing_to_a_total_is_as_close_as_a_grain_allows(measure, total):
    sizes = uniform(LOW, HIGH)
    radii = draw_to_total(sizes, measure, total, generator)
    assert abs(measure(radii).sum() - total) <= 0.51 * measure(np.array([HIGH]))[0]


def test_draws_depend_on_their_stream_and_ranges_may_be_degenerate():
    sizes = uniform(LOW, HIGH)
    np.testing.assert_array_equal(sizes.draw(50, generator(1)), sizes.draw(50, generator(1)))
    assert not np.array_equal(sizes.draw(50, generator(1)), sizes.draw(50, generator(2)))
    for sizes in (
        power_sizes(2.0, LOW, LOW, 3),
        lognormal_sizes(LOW, 0.3, LOW, LOW, 0),
        normal_sizes(LOW, 1e-4, LOW, LOW, 3),
    ):
        np.testing.assert_allclose(sizes.draw(10, generator()), LOW, rtol=1e-14)


@pytest.mark.parametrize("power", [0, 2, 3])
def test_each_class_of_a_sieve_curve_has_its_share(power):
    radii = table_sizes(*SIEVE, power).draw(N, generator())
    weight = radii**power
    shares = [weight[radii <= limit].sum() / weight.sum() for limit in SIEVE[0][1:]]
    assert shares == pytest.approx(SIEVE[1][1:].tolist(), abs=3e-4)
    # Nothing is retained between these sieves
    assert not ((radii > 0.8e-3) & (radii < 0.9e-3)).any()
