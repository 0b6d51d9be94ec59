"""Trigonometric functions in + − × ÷ √; tests state errors in units in the last place (ulp)."""

from __future__ import annotations

import math

from multicor_cli.arithmetic.exponential import polynomial

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
