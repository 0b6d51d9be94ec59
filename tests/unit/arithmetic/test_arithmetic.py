"""The program's own elementary functions: accuracy against many digits, special values, and equal
bits interpreted and compiled.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from multicor_cli import arithmetic
from multicor_cli import arithmetic as a
from multicor_cli.arithmetic import sums
from multicor_cli.arithmetic.sums import FEW
from multicor_cli.engine.jit import elementwise

mpmath = pytest.importorskip("mpmath")

COUNT = 3000
BITS = 400


def uniform(low, high, seed=1):
    return (low + (high - low) * np.random.default_rng(seed).random(COUNT)).tolist()


def magnitudes(low, high, seed=2):
    """Numbers of either sign with sizes between 10^low and 10^high."""
    rng = np.random.default_rng(seed)
    return (10.0 ** rng.uniform(low, high, COUNT) * rng.choice([-1.0, 1.0], COUNT)).tolist()


def sizes(low, high, seed=3):
    return [abs(x) for x in magnitudes(low, high, seed)]


QUARTERS = [k * 0.5 * math.pi for k in range(-3000, 3000, 3)]
NEAR_ONE = [1.0 + x for x in magnitudes(-15, -1)]

ONE = {
    "exp": (uniform(-700, 709) + uniform(-1, 1) + magnitudes(-18, 0), 1.0),
    "expm1": (uniform(-40, 700) + magnitudes(-20, 1), 2.0),
    "log": (sizes(-307, 308) + uniform(0.5, 2.0) + NEAR_ONE, 1.0),
    "log1p": (sizes(-20, 10) + uniform(-0.999, 2.0) + [-x for x in sizes(-18, -0.01)], 2.0),
    "cbrt": (sizes(-307, 308), 1.0),
    "sin": (uniform(-10, 10) + uniform(-1e6, 1e6) + magnitudes(-20, 0) + QUARTERS, 1.0),
    "cos": (uniform(-10, 10) + uniform(-1e6, 1e6) + QUARTERS, 1.0),
    "asin": (uniform(-1, 1) + magnitudes(-20, 0) + [1.0 - x for x in sizes(-15, -1)], 3.0),
    "acos": (uniform(-1, 1) + [1.0 - x for x in sizes(-15, -1)], 3.0),
}

TWO = {
    "power": (sizes(-10, 10), uniform(-1.2, 1.2), 1.0),
    "atan2": (uniform(-1, 1) + magnitudes(-20, 5), uniform(-1, 1, 5) + magnitudes(-20, 5, 6), 3.0),
    "hypot": (magnitudes(-10, 10), magnitudes(-10, 10, 7), 2.0),
}


def errors(got, exact):
    """Distance from the exact values in units in the last place."""
    return [float(abs(g - e)) / math.ulp(float(e)) for g, e in zip(got, exact, strict=True)]


@pytest.mark.parametrize("name", ONE)
def test_functions_of_one_number_are_accurate(name):
    arguments, allowed = ONE[name]
    with mpmath.workprec(BITS):
        exact = [getattr(mpmath, name)(mpmath.mpf(x)) for x in arguments]
        assert max(errors(map(getattr(arithmetic, name), arguments), exact)) <= allowed


@pytest.mark.parametrize("name", TWO)
def test_functions_of_two_numbers_are_accurate(name):
    first, second, allowed = TWO[name]
    with mpmath.workprec(BITS):
        exact = [
            getattr(mpmath, name)(mpmath.mpf(x), mpmath.mpf(y))
            for x, y in zip(first, second, strict=True)
        ]
        assert max(errors(map(getattr(arithmetic, name), first, second), exact)) <= allowed


def test_powers_are_accurate_where_results_are_huge_or_tiny():
    bases, exponents = sizes(-100, 100), uniform(-3, 3)
    with mpmath.workprec(BITS):
        exact = [
            mpmath.power(mpmath.mpf(x), mpmath.mpf(y))
            for x, y in zip(bases, exponents, strict=True)
        ]
        assert max(errors(map(arithmetic.power, bases, exponents), exact)) <= 3.0


def test_far_angles_are_as_good_as_their_argument():
    angles = magnitudes(6, 14)
    with mpmath.workprec(BITS):
        for x in angles:
            assert abs(arithmetic.sin(x) - mpmath.sin(mpmath.mpf(x))) <= 2.0 * math.ulp(x)


def test_normal_distribution():
    with mpmath.workprec(BITS):
        for x in uniform(-10, 8)[:500]:
            assert abs(arithmetic.normal_cdf(x) / mpmath.ncdf(mpmath.mpf(x)) - 1) < 1e-14
        for x in uniform(-37, -10)[:100]:
            assert abs(arithmetic.normal_cdf(x) / mpmath.ncdf(mpmath.mpf(x)) - 1) < 1e-16 * x * x
        for p in uniform(0, 1)[:300] + sizes(-290, -1)[:100]:
            x = mpmath.mpf(arithmetic.normal_quantile(p))
            # Newton's correction of the result is its error.
            error = (mpmath.ncdf(x) - mpmath.mpf(p)) / mpmath.npdf(x)
            assert abs(error) < 1e-15 * max(abs(x), mpmath.mpf("1e-3"))


@pytest.mark.parametrize(
    ("got", "expected"),
    [
        (a.exp(0.0), 1.0),
        (a.exp(710.0), math.inf),
        (a.exp(-746.0), 0.0),
        (a.exp(math.inf), math.inf),
        (a.exp(-math.inf), 0.0),
        (a.exp(-745.13), 5e-324),
        (a.expm1(0.0), 0.0),
        (a.expm1(-800.0), -1.0),
        (a.expm1(800.0), math.inf),
        (a.log(1.0), 0.0),
        (a.log(0.0), -math.inf),
        (a.log(math.inf), math.inf),
        (a.log(5e-324), -744.4400719213812),
        (a.log1p(0.0), 0.0),
        (a.log1p(-1.0), -math.inf),
        (a.power(0.0, 0.0), 1.0),
        (a.power(0.0, 0.5), 0.0),
        (a.power(0.0, -0.5), math.inf),
        (a.power(math.inf, 0.5), math.inf),
        (a.power(math.inf, -2.0), 0.0),
        (a.power(1e300, 2.0), math.inf),
        (a.power(1e-300, 2.0), 0.0),
        (a.power(4.0, 0.5), 2.0),
        (a.cbrt(0.0), 0.0),
        (a.cbrt(27.0), 3.0),
        (a.cbrt(math.inf), math.inf),
        (a.sin(0.0), 0.0),
        (a.cos(0.0), 1.0),
        (a.atan2(0.0, 1.0), 0.0),
        (a.atan2(0.0, -1.0), math.pi),
        (a.atan2(-1.0, 0.0), -0.5 * math.pi),
        (a.acos(1.0), 0.0),
        (a.acos(-1.0), math.pi),
        (a.asin(1.0), 0.5 * math.pi),
        (a.atan2(math.inf, math.inf), 0.25 * math.pi),
        (a.hypot(3.0, 4.0), 5.0),
        (a.normal_cdf(0.0), 0.5),
        (a.normal_quantile(0.5), 0.0),
    ],
)
def test_special_values(got, expected):
    assert got == expected


@pytest.mark.parametrize(
    "value",
    [
        a.exp(math.nan),
        a.log(-1.0),
        a.log(math.nan),
        a.log1p(-2.0),
        a.power(-1.0, 0.5),
        a.power(math.nan, 1.0),
        a.cbrt(-1.0),
        a.sin(math.inf),
        a.cos(math.nan),
        a.asin(1.1),
        a.acos(-1.1),
        a.atan2(math.nan, 1.0),
    ],
)
def test_what_is_not_a_number(value):
    assert math.isnan(value)


@pytest.mark.parametrize(
    "name", [name for name in elementwise.__dict__ if name in {**ONE, "normal_quantile": 0}]
)
def test_compiled_functions_have_the_bits_of_interpreted_ones(name):
    arguments = (
        uniform(1e-300, 1.0) + sizes(-290, -1) if name == "normal_quantile" else ONE[name][0]
    )
    compiled = getattr(elementwise, name)(np.array(arguments))
    interpreted = np.array([getattr(arithmetic, name)(x) for x in arguments])
    assert (compiled.view(np.int64) == interpreted.view(np.int64)).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 128, 1001])
def test_sums(count):
    rng = np.random.default_rng(count)
    values = rng.standard_normal((count, 3)) * 10.0 ** rng.uniform(-8, 8, (count, 3))
    before = values.copy()
    allowed = 2e-16 * (FEW + max(1, count).bit_length())
    assert sums.total(values) == pytest.approx(
        math.fsum(values.ravel().tolist()), rel=0, abs=2 * allowed * np.abs(values).sum()
    )
    for column, found in zip(values.T, sums.column_totals(values), strict=True):
        assert found == pytest.approx(
            math.fsum(column.tolist()), rel=0, abs=allowed * np.abs(column).sum()
        )
    assert (values == before).all()
    if count:
        assert sums.mean(values) == sums.total(values) / values.size


def test_sums_have_the_stated_order():
    assert (
        sums.total(np.array([1.0, 1e16, -1.0, -1e16, 3.0])) == (((1.0 + 1e16) - 1.0) - 1e16) + 3.0
    )
    values = np.zeros(2 * FEW + 1)
    values[0], values[FEW], values[-1], values[1] = 1e16, -1e16, 3.0, 1.0
    assert sums.total(values) == ((1e16 - 1e16) + 3.0) + 1.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_sums_of_what_is_not_finite_are_not(bad):
    assert not math.isfinite(sums.total(np.array([1.0, bad, 2.0])))
