"""Radii follow their distributions, by number and by mass."""

import math
from statistics import NormalDist

import numpy as np
import pytest
from packing_support import generator

from multicor_cli.packing.sizes import (
    diameter,
    disc_area,
    draw_to_total,
    list_sizes,
    lognormal_sizes,
    normal_sizes,
    power_sizes,
    table_sizes,
    uniform_sizes,
)

LOW, HIGH, N = 0.5e-3, 2.0e-3, 20_000


def power_mean(exponent: float) -> float:
    """Mean of the density r^-exponent on [LOW, HIGH]."""

    def integral(power: float) -> float:
        return (
            math.log(HIGH / LOW)
            if power == -1.0
            else (HIGH ** (power + 1.0) - LOW ** (power + 1.0)) / (power + 1.0)
        )

    return integral(1.0 - exponent) / integral(-exponent)


def lognormal_mean(median: float, sigma: float) -> float:
    a, b = (math.log(r / median) / sigma for r in (LOW, HIGH))
    cdf = NormalDist().cdf
    return median * math.exp(sigma**2 / 2) * (cdf(b - sigma) - cdf(a - sigma)) / (cdf(b) - cdf(a))


def normal_mean(mean: float, sigma: float) -> float:
    a, b = ((r - mean) / sigma for r in (LOW, HIGH))
    normal = NormalDist()
    return mean + sigma * (normal.pdf(a) - normal.pdf(b)) / (normal.cdf(b) - normal.cdf(a))


SIEVE = np.array([LOW, 0.8e-3, 0.9e-3, HIGH]), np.array([0.0, 0.25, 0.25, 1.0])


FAMILIES = {
    "uniform": (lambda by, p: uniform_sizes(LOW, HIGH, by, p), 0.5 * (LOW + HIGH)),
    "power 1": (lambda by, p: power_sizes(1.0, LOW, HIGH, by, p), power_mean(1.0)),
    "power 2.5": (lambda by, p: power_sizes(2.5, LOW, HIGH, by, p), power_mean(2.5)),
    "power -2": (lambda by, p: power_sizes(-2.0, LOW, HIGH, by, p), power_mean(-2.0)),
    "lognormal": (
        lambda by, p: lognormal_sizes(1e-3, 0.4, LOW, HIGH, by, p),
        lognormal_mean(1e-3, 0.4),
    ),
    "lognormal, tail": (
        lambda by, p: lognormal_sizes(0.5e-3, 0.1, LOW, HIGH, by, p),
        lognormal_mean(0.5e-3, 0.1),
    ),
    "normal": (
        lambda by, p: normal_sizes(1e-3, 0.3e-3, LOW, HIGH, by, p),
        normal_mean(1e-3, 0.3e-3),
    ),
    "normal, tail": (
        lambda by, p: normal_sizes(HIGH, 0.2e-3, LOW, HIGH, by, p),
        normal_mean(HIGH, 0.2e-3),
    ),
    "table": (lambda by, p: table_sizes(*SIEVE, by, p), 0.25 * 0.65e-3 + 0.75 * 1.45e-3),
}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("by", "power"), [("number", 2), ("mass", 2), ("mass", 3)])
def test_mean_of_continuous_families(family, by, power):
    make, expected = FAMILIES[family]
    radii = make(by, power).draw(N, generator())
    weight = radii**power if by == "mass" else np.ones(N)
    assert radii.min() >= LOW * (1 - 1e-12)
    assert radii.max() <= HIGH * (1 + 1e-12)
    assert np.average(radii, weights=weight) == pytest.approx(expected, rel=3e-4)


@pytest.mark.parametrize("power", [2, 3])
def test_cumulated_mass_of_uniform_by_mass(power):
    radii = np.sort(uniform_sizes(LOW, HIGH, "mass", power).draw(N, generator()))
    mass = np.cumsum(radii**power) / (radii**power).sum()
    np.testing.assert_allclose(mass, (radii - LOW) / (HIGH - LOW), atol=5e-4)


def test_list_by_number_is_exact():
    radii = list_sizes(np.array([1.0, 2.0, 3.0]), np.array([0.2, 0.3, 0.5]), "number", 2).draw(
        1000, generator()
    )
    assert [np.count_nonzero(radii == r) for r in (1.0, 2.0, 3.0)] == [200, 300, 500]
    assert np.any(np.diff(radii) < 0)  # shuffled


@pytest.mark.parametrize("count", [7, 100, 1001])
def test_list_is_within_one_grain_of_its_fractions(count):
    fractions = np.array([0.15, 0.5, 0.35])
    radii = list_sizes(np.array([1.0, 2.0, 3.0]), fractions, "number", 2).draw(count, generator())
    got = np.array([np.count_nonzero(radii == r) for r in (1.0, 2.0, 3.0)])
    assert got.sum() == count
    assert np.all(np.abs(got - fractions * count) < 1.0)


@pytest.mark.parametrize("power", [2, 3])
def test_list_by_mass(power):
    radii = list_sizes(np.array([1e-3, 2e-3]), np.array([0.25, 0.75]), "mass", power).draw(
        10_000, generator()
    )
    mass = radii**power
    assert mass[radii == 1e-3].sum() / mass.sum() == pytest.approx(0.25, abs=5e-4)


def test_few_draws_from_a_long_list_reach_all_of_it():
    long = list_sizes(np.linspace(1.0, 2.0, 1000), None, "number", 2)
    assert long.draw(40, generator()).mean() == pytest.approx(1.5, abs=0.02)


@pytest.mark.parametrize(("measure", "total"), [(disc_area, 1e-3), (diameter, 0.123)])
def test_drawing_to_a_total_is_as_close_as_a_grain_allows(measure, total):
    sizes = uniform_sizes(LOW, HIGH, "number", 2)
    radii = draw_to_total(sizes, measure, total, generator)
    assert abs(measure(radii).sum() - total) <= 0.51 * measure(np.array([HIGH]))[0]


def test_a_draw_is_a_function_of_its_stream():
    sizes = uniform_sizes(LOW, HIGH, "number", 2)
    np.testing.assert_array_equal(sizes.draw(50, generator(1)), sizes.draw(50, generator(1)))
    assert not np.array_equal(sizes.draw(50, generator(1)), sizes.draw(50, generator(2)))


def test_degenerate_ranges_give_one_size():
    for sizes in (
        power_sizes(2.0, LOW, LOW, "mass", 3),
        lognormal_sizes(LOW, 0.3, LOW, LOW, "number", 2),
        normal_sizes(LOW, 1e-4, LOW, LOW, "mass", 3),
    ):
        np.testing.assert_allclose(sizes.draw(10, generator()), LOW, rtol=1e-14)


@pytest.mark.parametrize(("by", "power"), [("number", 2), ("mass", 2), ("mass", 3)])
def test_each_class_of_a_sieve_curve_has_its_share(by, power):
    radii = table_sizes(*SIEVE, by, power).draw(N, generator())
    weight = radii**power if by == "mass" else np.ones(N)
    shares = [weight[radii <= limit].sum() / weight.sum() for limit in SIEVE[0][1:]]
    assert shares == pytest.approx(SIEVE[1][1:].tolist(), abs=3e-4)
    # Nothing is retained between these sieves
    assert not ((radii > 0.8e-3) & (radii < 0.9e-3)).any()
