"""Elementary functions in + − × ÷ √; tests state their errors in ulp.

Arguments are reduced exactly (fraction and exponent, ln 2 and π/2 in parts) until the Taylor series
converge within a dozen terms. A result that must be more accurate than a number can hold, as the
logarithm inside a power, is a pair: a number and what it lacks. An ulp is a unit in the last place.
"""

from __future__ import annotations

import math

# ---- Exponentials, logarithms, powers and cube roots

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


# ---- Trigonometric functions

# π/2 in three parts, two of 33 bits: multiples up to 2²⁰ are exact (Cody and Waite).
_QUARTER_HIGH = 1.5707963267341256
_QUARTER_MIDDLE = 6.077100506303966e-11
_QUARTER_LOW = 2.0222662487959506e-21
_INVERSE_QUARTER = 0.6366197723675814
_PI = 3.141592653589793
_PI_LOST = 1.2246467991473532e-16  # π − _PI
_FARTHEST = 2.0**51
_OF_SIN = tuple((1.0 if n % 4 == 1 else -1.0) / math.factorial(n) for n in range(17, 1, -2))
_OF_COS = tuple((1.0 if n % 4 == 0 else -1.0) / math.factorial(n) for n in range(18, 2, -2))
_OF_ATAN = tuple((1.0 if n % 4 == 3 else -1.0) / n for n in range(17, 1, -2))


def sin(x: float) -> float:
    """Sine, to 1 ulp up to |x| = 10⁶, beyond as if x were 2 ulp off; nan from 2⁵¹ quarter turns."""
    quarter, r, lost = _reduced(x)
    value = _sin_near(r, lost) if quarter % 2 == 0 else _cos_near(r, lost)
    return value if quarter < 2 else -value


def cos(x: float) -> float:
    """Cosine, with the accuracy of `sin`."""
    quarter, r, lost = _reduced(x)
    value = _cos_near(r, lost) if quarter % 2 == 0 else _sin_near(r, lost)
    return value if quarter in (0, 3) else -value


def _reduced(x: float) -> tuple[int, float, float]:
    """The quarter turn of x (0 to 3), the rest |r| ≤ π/4 [rad] and what r lacks."""
    turns = x * _INVERSE_QUARTER
    if not abs(turns) < _FARTHEST:
        return 0, math.nan, math.nan
    n = math.floor(turns + 0.5)
    first = x - n * _QUARTER_HIGH
    second = n * _QUARTER_MIDDLE
    rest = first - second
    low = ((first - rest) - second) - n * _QUARTER_LOW
    r = rest + low
    return int(n % 4), r, (rest - r) + low


def _sin_near(r: float, lost: float) -> float:
    z = r * r
    series = polynomial(_OF_SIN, z)
    return r + (r * z * series + lost * (1.0 - 0.5 * z))


def _cos_near(r: float, lost: float) -> float:
    z = r * r
    series = polynomial(_OF_COS, z)
    half = 0.5 * z
    main = 1.0 - half
    return main + (((1.0 - main) - half) + (z * z * series - r * lost))


def atan2(y: float, x: float) -> float:
    """Angle of (x, y) from the x axis in [−π, π], to 3 ulp; zeros have signs, as in IEEE 754."""
    if x != x or y != y:
        return math.nan
    across, along = abs(y), abs(x)
    if across == along:
        angle = 0.0 if across == 0.0 else 0.25 * _PI
    elif across < along:
        angle = _atan_of_ratio(across, along)
    else:
        angle = 0.5 * _PI - (_atan_of_ratio(along, across) - 0.5 * _PI_LOST)
    if math.copysign(1.0, x) < 0.0:
        angle = _PI - (angle - _PI_LOST)
    return math.copysign(angle, y)


def _atan_of_ratio(a: float, b: float) -> float:
    """Arctangent of 0 ≤ a/b < 1: of the nearest quarter c, and the series of the rest |w| ≤ ⅛."""
    t = a / b
    if t < 0.125:
        return t - _atan_deficit(t)
    if t < 0.375:
        start, w = 0.24497866312686414, (a - 0.25 * b) / (b + 0.25 * a)
    elif t < 0.625:
        start, w = 0.4636476090008061, (a - 0.5 * b) / (b + 0.5 * a)
    elif t < 0.875:
        start, w = 0.6435011087932844, (a - 0.75 * b) / (b + 0.75 * a)
    else:
        start, w = 0.25 * _PI, (a - b) / (b + a)
    return start + (w - _atan_deficit(w))


def _atan_deficit(w: float) -> float:
    """Difference w − atan w for |w| ≤ ⅛."""
    z = w * w
    return w * z * polynomial(_OF_ATAN, z)


def asin(x: float) -> float:
    """Arcsine in [−π/2, π/2], to 3 ulp; nan for |x| > 1."""
    if not abs(x) <= 1.0:
        return math.nan
    return atan2(x, math.sqrt((1.0 - x) * (1.0 + x)))


def acos(x: float) -> float:
    """Arccosine in [0, π], to 3 ulp; nan for |x| > 1."""
    if not abs(x) <= 1.0:
        return math.nan
    return atan2(math.sqrt((1.0 - x) * (1.0 + x)), x)


def hypot(x: float, y: float) -> float:
    """Length of (x, y), to 2 ulp, if squares neither overflow nor vanish (10⁻¹⁵⁰ to 10¹⁵⁰)."""
    return math.sqrt(x * x + y * y)


# ---- The standard normal distribution: its cumulated probability, and the inverse of that

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
