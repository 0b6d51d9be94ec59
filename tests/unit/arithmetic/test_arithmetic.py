"""The program's own elementary functions: accuracy against many digits, special values, and equal
bits interpreted and compiled."""

import math

import numpy as np
import pytest

from multicor_cli import arithmetic
from multicor_cli import arithmetic as a
from multicor_cli.arithmetic import sums
from multicor_cli.arithmetic.sums import FEW
from multicor_cli.engine.jit import arrays

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


def largest_error(name, *arguments):
    """Largest distance from the exact values in units in the last place."""
    found = map(getattr(arithmetic, name), *arguments)
    with mpmath.workprec(BITS):
        exact = map(getattr(mpmath, name), *(map(mpmath.mpf, numbers) for numbers in arguments))
        return max(
            float(abs(mpmath.mpf(g) - e)) / math.ulp(float(e))
            for g, e in zip(found, exact, strict=True)
        )


@pytest.mark.parametrize("name", [*ONE, *TWO])
def test_functions_are_accurate(name):
    *arguments, allowed = (ONE | TWO)[name]
    assert largest_error(name, *arguments) <= allowed


def test_arguments_may_be_huge_tiny_and_far():
    assert largest_error("power", sizes(-100, 100), uniform(-3, 3)) <= 3.0
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


INF, NAN = math.inf, math.nan
SPECIAL = [
    (a.exp, {0.0: 1.0, 710.0: INF, -746.0: 0.0, INF: INF, -INF: 0.0, -745.13: 5e-324, NAN: NAN}),
    (a.expm1, {0.0: 0.0, -800.0: -1.0, 800.0: INF}),
    (a.log, {1.0: 0.0, 0.0: -INF, INF: INF, 5e-324: -744.4400719213812, -1.0: NAN, NAN: NAN}),
    (a.log1p, {0.0: 0.0, -1.0: -INF, -2.0: NAN}),
    (a.power, {(0.0, 0.0): 1.0, (0.0, 0.5): 0.0, (0.0, -0.5): INF, (INF, 0.5): INF}),
    (a.power, {(INF, -2.0): 0.0, (1e300, 2.0): INF, (1e-300, 2.0): 0.0, (4.0, 0.5): 2.0}),
    (a.power, {(-1.0, 0.5): NAN, (NAN, 1.0): NAN}),
    (a.cbrt, {0.0: 0.0, 27.0: 3.0, INF: INF, -1.0: NAN}),
    (a.sin, {0.0: 0.0, INF: NAN}),
    (a.cos, {0.0: 1.0, NAN: NAN}),
    (a.asin, {1.0: 0.5 * math.pi, 1.1: NAN}),
    (a.acos, {1.0: 0.0, -1.0: math.pi, -1.1: NAN}),
    (a.atan2, {(0.0, 1.0): 0.0, (0.0, -1.0): math.pi, (-1.0, 0.0): -0.5 * math.pi}),
    (a.atan2, {(INF, INF): 0.25 * math.pi, (NAN, 1.0): NAN}),
    (a.hypot, {(3.0, 4.0): 5.0}),
    (a.normal_cdf, {0.0: 0.5}),
    (a.normal_quantile, {0.5: 0.0}),
]


@pytest.mark.parametrize(("function", "values"), SPECIAL)
def test_special_values(function, values):
    for arguments, expected in values.items():
        got = function(*arguments) if isinstance(arguments, tuple) else function(arguments)
        assert got == expected or (math.isnan(got) and math.isnan(expected)), arguments


@pytest.mark.parametrize(
    "name", [name for name in arrays.__dict__ if name in {**ONE, "normal_quantile": 0}]
)
def test_compiled_functions_have_the_bits_of_interpreted_ones(name):
    shares = uniform(1e-300, 1.0) + sizes(-290, -1)
    arguments = shares if name == "normal_quantile" else ONE[name][0]
    compiled = getattr(arrays, name)(np.array(arguments))
    interpreted = np.array([getattr(arithmetic, name)(x) for x in arguments])
    assert (compiled.view(np.int64) == interpreted.view(np.int64)).all()


@pytest.mark.parametrize("others", [[], [0.0], [0.0, 5e-324, 1e-310, math.inf, math.nan, -1.0]])
def test_cube_roots_in_vectors_have_the_bits_of_single_ones(others):
    values = np.array(sizes(-307, 308) + uniform(0.0, 10.0) + others)
    roots = values.copy()
    arrays.cube_roots(roots)
    single = np.array([arithmetic.cbrt(x) for x in values.tolist()])
    assert (roots.view(np.int64) == single.view(np.int64)).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 128, 1001])
def test_sums(count):
    rng = np.random.default_rng(count)
    values = rng.standard_normal((count, 3)) * 10.0 ** rng.uniform(-8, 8, (count, 3))
    before = values.copy()
    allowed = 2e-16 * (FEW + max(1, count).bit_length())

    def is_sum(found, values, allowed):
        exact = math.fsum(values.ravel().tolist())
        return abs(found - exact) <= allowed * np.abs(values).sum()

    assert is_sum(sums.total(values), values, 2 * allowed)
    for column, found in zip(values.T, sums.column_totals(values), strict=True):
        assert is_sum(found, column, allowed)
    assert (values == before).all()
    if count:
        assert sums.mean(values) == sums.total(values) / values.size


def test_sums_have_the_stated_order():
    few = np.array([1.0, 1e16, -1.0, -1e16, 3.0])
    assert sums.total(few) == (((1.0 + 1e16) - 1.0) - 1e16) + 3.0
    values = np.zeros(2 * FEW + 1)
    values[0], values[FEW], values[-1], values[1] = 1e16, -1e16, 3.0, 1.0
    assert sums.total(values) == ((1e16 - 1e16) + 3.0) + 1.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_sums_of_what_is_not_finite_are_not(bad):
    assert not math.isfinite(sums.total(np.array([1.0, bad, 2.0])))
