"""The kernel of coarse graining, and its means along lines in closed form.

It is that of Lucy (Astron. J. 82, 1013, 1977) in the plane, φ = h (1 + 3q)(1 − q)³ with q = r/c < 1
and the height h = 5/(π c²): it reaches to the distance c and has two continuous derivatives. All
lengths here are in units of c, and φ in units of h.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.model.model import Floats

_SHORTEST = 1e-6  # half of a line: shorter ones are as good as points, and a quotient of roundings


def height(reach: float) -> float:
    """Height of a kernel whose integral is 1 [per m²], which reaches so far [m]."""
    return 5.0 / (np.pi * reach**2)


def depth(square: Floats) -> Floats:
    """How far 1 − q points lie inside the circle, 0 outside it, from q²; φ is made of it."""
    q = np.sqrt(square)
    np.subtract(1.0, q, out=q)
    return np.asarray(np.maximum(q, 0.0, out=q))


def value(depth: Floats) -> Floats:
    """φ, with p = 1 − q: (1 + 3q)(1 − q)³ = p³ (4 − 3p)."""
    found = 4.0 - 3.0 * depth
    for _ in range(3):
        found *= depth
    return np.asarray(found)


def slope(depth: Floats) -> Floats:
    """What the way from the source is multiplied with to have ∇φ: −12 (1 − q)²."""
    return np.asarray(-12.0 * depth * depth)


def directions(half: Floats) -> tuple[Floats, Floats]:
    """Unit vectors of half lines ``(n, 2)`` and their lengths ``(n,)``; points get a short one."""
    length = np.hypot(*half.T)
    is_point = length < _SHORTEST
    length = np.where(is_point, _SHORTEST, length)
    ahead = np.where(is_point[:, np.newaxis], [1.0, 0.0], half / length[:, np.newaxis])
    return ahead, length


def mean_along(along: Floats, across: Floats, half: Floats) -> Floats:
    """Means of φ over lines, of where a point is along and across them, from their middles.

    Of half their length, too; shapes are those that broadcast. At the distance s along a line from
    the foot of the point, φ = 1 − 6q² + 8q³ − 3q⁴ with q² = s² + w and the square w of the distance
    across has the primitive s (1 − 6w − 3w² − 2s² (1 + w + 0.3 s²) + q (2s² + 5w)) + 3w² ln(s + q);
    lines are cut off at the circle.
    """
    w = across * across
    rim = np.sqrt(np.maximum(1.0 - w, 0.0))
    s = np.empty((2, *rim.shape))  # of both ends
    np.subtract(along, half, out=s[0])
    np.add(along, half, out=s[1])
    np.minimum(s, rim, out=s)
    np.maximum(s, np.negative(rim, out=rim), out=s)
    square = s * s
    q = square + w
    np.sqrt(q, out=q)
    log = q + s
    log += np.finfo(float).tiny  # only where w² vanishes
    first, last = log
    last /= first
    ln = np.log(last)
    ln *= 3.0 * w * w
    term = np.multiply(2.0, square, out=log)
    term += 5.0 * w
    q *= term
    np.multiply(0.6, square, out=term)
    term += 2.0 + 2.0 * w
    term *= square
    q -= term
    q += 1.0 - 3.0 * w * (2.0 + w)
    q *= s
    first, last = q
    last -= first
    last += ln
    last *= 0.5 / half
    return np.asarray(last)
