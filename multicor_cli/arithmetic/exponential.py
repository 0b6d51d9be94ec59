"""Exponentials, logarithms, powers and cube roots in + − × ÷; tests state their errors in ulp.

Arguments are reduced exactly (fraction and exponent, ln 2 in two parts) until the Taylor series
converge within a dozen terms. A result that must be more accurate than a number can hold, as the
logarithm inside a power, is a pair: a number and what it lacks. An ulp is a unit in the last place.
"""

from __future__ import annotations

import math

_LN2_HIGH = 0.6931471803691238  # the first 33 bits of ln 2: its multiples by exponents are exact
_LN2_LOW = 1.9082149292705877e-10
_INVERSE_LN2 = 1.4426950408889634
_LARGEST = 709.782712893384  # e to this is the largest number
_SMALLEST = -745.1332191019412  # e to this is the smallest number above zero
_SQRT_HALF = 0.7071067811865476
_SPLITTER = 134217729.0  # 2²⁷ + 1
_OF_EXP = tuple(1.0 / math.factorial(n) for n in range(14, 1, -1))
_OF_LOG = tuple(1.0 / n for n in range(25, 1, -2))


def exp(x: float) -> float:
    """e^x, to 1 ulp."""
    return exp_pair(x, 0.0)


def exp_pair(x: float, rest: float) -> float:
    """e^(x + rest) for a ``rest`` far below an ulp of x or at most some 10⁻¹⁰."""
    if x != x:
        return x
    if x > _LARGEST:
        return math.inf
    if x < _SMALLEST:
        return 0.0
    k = math.floor(x * _INVERSE_LN2 + 0.5)
    # In two steps: 2^k alone may be too large or too small for a number although e^x is not.
    half = k // 2
    return math.ldexp(math.ldexp(1.0 + _excess(x, k, rest), half), k - half)


def expm1(x: float) -> float:
    """e^x − 1, to 2 ulp also near x = 0."""
    if x != x:
        return x
    if x > 50.0:
        return exp(x)
    if x < -50.0:
        return -1.0
    k = math.floor(x * _INVERSE_LN2 + 0.5)
    scale = math.ldexp(1.0, k)
    return scale * _excess(x, k, 0.0) + (scale - 1.0)


def _excess(x: float, k: int, rest: float) -> float:
    """e^r − 1 for r = x − k ln 2 + rest, |r| ≤ 0.35."""
    high = x - k * _LN2_HIGH
    low = k * _LN2_LOW - rest
    r = high - low
    lost = (high - r) - low
    series = polynomial(_OF_EXP, r)
    return r + (r * r * series + (lost + lost * r))


def log(x: float) -> float:
    """The natural logarithm, to 1 ulp; −inf at zero, nan below."""
    if not x > 0.0 or x == math.inf:
        return -math.inf if x == 0.0 else (x if x > 0.0 else math.nan)
    high, low = log_pair(x)
    return high + low


def log1p(x: float) -> float:
    """ln(1 + x), to 2 ulp also near x = 0; −inf at −1, nan below."""
    if x == math.inf:
        return x
    total = 1.0 + x
    if not total > 0.0:
        return -math.inf if total == 0.0 else math.nan
    lost = x - (total - 1.0) if abs(x) < 1.0 else 1.0 - (total - x)
    high, low = log_pair(total)
    return high + (low + lost / total)


def log_pair(x: float) -> tuple[float, float]:
    """The logarithm of a positive finite number, and what the first number lacks; good to 2⁻⁵⁹.

    ln m = 2 artanh s with s = f/(2 + f), f = m − 1, for x = 2^k m, √½ ≤ m < √2.
    """
    m, k = math.frexp(x)
    if m < _SQRT_HALF:
        m, k = 2.0 * m, k - 1
    f = m - 1.0
    below = 2.0 + f
    below_lost = f - (below - 2.0)
    s = f / below
    product, product_lost = two_product(s, below)
    s_lost = (((f - product) - product_lost) - s * below_lost) / below
    z = s * s
    series = polynomial(_OF_LOG, z)
    high, lost = two_sum(k * _LN2_HIGH, 2.0 * s)
    return high, lost + (2.0 * s_lost + (2.0 * s * z * series + k * _LN2_LOW))


def power(x: float, y: float) -> float:
    """x^y for x ≥ 0, to 1 ulp where |y ln x| < 30, else to 3; nan for negative x. 0⁰ = 1."""
    if y == 0.0:
        return 1.0
    if not x > 0.0 or x == math.inf:
        if x == 0.0 or x == math.inf:
            return x if y > 0.0 else (math.inf if x == 0.0 else 0.0)
        return math.nan
    high, low = log_pair(x)
    product, lost = two_product(y, high)
    if not abs(product) < 1e4:
        return exp(product)
    total = product + (lost + y * low)
    return exp_pair(total, (product - total) + (lost + y * low))


def cbrt(x: float) -> float:
    """Cube root of x ≥ 0, to 1 ulp; nan below zero."""
    if not x > 0.0 or x == math.inf:
        return x if x >= 0.0 else math.nan
    m, k = math.frexp(x)
    third = (k + 2) // 3
    m = math.ldexp(m, k - 3 * third)  # between 1/8 and 1
    root = 0.39 + m * (1.02 - 0.41 * m)  # to 3 %
    for _ in range(3):  # Halley: cubic convergence
        cube = root * root * root
        root = root - root * (cube - m) / (2.0 * cube + m)
    return math.ldexp(root, third)


def polynomial(coefficients: tuple[float, ...], x: float) -> float:
    """The polynomial with these coefficients, highest power first (Horner)."""
    total = 0.0
    for coefficient in coefficients:
        total = total * x + coefficient
    return total


def two_sum(a: float, b: float) -> tuple[float, float]:
    """Sum of a and b, and what is lost in rounding it (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def two_product(a: float, b: float) -> tuple[float, float]:
    """Product of a and b, and what it lost in rounding, |a|, |b| < 10²⁹⁰ (Dekker, Veltkamp)."""
    product = a * b
    split = _SPLITTER * a
    a_high = split - (split - a)
    a_low = a - a_high
    split = _SPLITTER * b
    b_high = split - (split - b)
    b_low = b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
