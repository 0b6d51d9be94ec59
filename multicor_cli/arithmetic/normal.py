"""The standard normal distribution: its cumulated probability, and the inverse of that."""

from __future__ import annotations

import math

from multicor_cli.arithmetic.exponential import exp, log

_INVERSE_ROOT_TWO_PI = 0.3989422804014327
_TERMS = 60  # of the series, for |x| < 1.5
_FRACTIONS = 200  # of the continued fraction, for |x| ≥ 1.5
_CENTRAL = 0.425
_TAIL = 5.0
_CENTER = tuple(zip(
    (2509.0809287301226727, 33430.575583588128105, 67265.770927008700853, 45921.953931549871457,
     13731.693765509461125, 1971.5909503065514427, 133.14166789178437745, 3.387132872796366608),
    (5226.495278852854561, 28729.085735721942674, 39307.89580009271061, 21213.794301586595867,
     5394.1960214247511077, 687.1870074920579083, 42.313330701600911252, 1.0),
    strict=True,
))  # fmt: skip
_NEAR = tuple(zip(
    (7.7454501427834140764e-4, 0.0227238449892691845833, 0.24178072517745061177,
        1.27045825245236838258,
     3.64784832476320460504, 5.7694972214606914055, 4.6303378461565452959, 1.42343711074968357734),
    (1.05075007164441684324e-9, 5.475938084995344946e-4, 0.0151986665636164571966,
        0.14810397642748007459,
     0.68976733498510000455, 1.6763848301838038494, 2.05319162663775882187, 1.0),
    strict=True,
))  # fmt: skip
_FAR = tuple(zip(
    (2.01033439929228813265e-7, 2.71155556874348757815e-5, 0.0012426609473880784386,
        0.026532189526576123093,
     0.29656057182850489123, 1.7848265399172913358, 5.4637849111641143699, 6.6579046435011037772),
    (2.04426310338993978564e-15, 1.4215117583164458887e-7, 1.8463183175100546818e-5,
        7.868691311456132591e-4,
     0.0148753612908506148525, 0.13692988092273580531, 0.59983220655588793769, 1.0),
    strict=True,
))  # fmt: skip


def normal_cdf(x: float) -> float:
    """Probability of a value below x, to a relative 10⁻¹⁴ down to x = −10, below it to 10⁻¹⁷ x²."""
    density = _INVERSE_ROOT_TWO_PI * exp(-0.5 * x * x)
    if abs(x) < 1.5:  # ½ + φ(x) Σ x^(2k+1)/(1·3·5…(2k+1))
        term, total = x, x
        for k in range(1, _TERMS):
            term = term * x * x / (2.0 * k + 1.0)
            total += term
        return 0.5 + density * total
    fraction = abs(x)  # 1 − Φ(x) = φ(x)/(x + 1/(x + 2/(x + 3/(x + …))))
    for k in range(_FRACTIONS, 0, -1):
        fraction = abs(x) + k / fraction
    tail = density / fraction
    return tail if x < 0.0 else 1.0 - tail


def normal_quantile(p: float) -> float:
    """The value below which lies the probability 0 < p < 1, to a relative 10⁻¹⁵.

    M. J. Wichura, Algorithm AS 241, Appl. Statist. 37 (1988) 477, PPND16.
    """
    q = p - 0.5
    if abs(q) <= _CENTRAL:
        r = _CENTRAL * _CENTRAL - q * q
        return _ratio(r, _CENTER, q)
    r = math.sqrt(-log(p if q < 0.0 else 1.0 - p))
    size = _ratio(r - 1.6, _NEAR, 1.0) if r <= _TAIL else _ratio(r - _TAIL, _FAR, 1.0)
    return -size if q < 0.0 else size


def _ratio(r: float, pairs: tuple[tuple[float, float], ...], factor: float) -> float:
    """``factor`` times a ratio of polynomials with these coefficients, highest power first."""
    above = below = 0.0
    for a, b in pairs:
        above, below = above * r + a, below * r + b
    return factor * above / below
