"""Exponents of power laws by maximum likelihood, where the data are compatible with one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multicor_cli.model.model import Floats

LEAST = 50
"""Values in the tail from which on an exponent is worth something (Clauset et al. 2009)."""

PLAUSIBLE = 0.1
"""Chance of a worse fit to a true power law below which there is none."""

_SAMPLES = 200  # drawn from the law to see how well it fits
_STARTS = 60  # where the tail may begin


class PowerLaw(NamedTuple):
    """A density that falls as x^(−exponent) from ``start`` on, with its standard error.

    Attributes:
        number: Values in the tail.
        chance: Chance that data from this law fit worse.
        distance: Kolmogorov–Smirnov distance of tail and law.
    """

    exponent: float
    error: float
    start: float
    number: int
    chance: float
    distance: float


def fit_power_law(values: Floats) -> tuple[PowerLaw | None, str]:
    """The power law of the tail of positive values; None, and why, where it is not justified.

    After Clauset, Shalizi & Newman, SIAM Review 51, 661 (2009): α = 1 + n/Σ ln(x/x_min), with the
    standard error (α − 1)/√n; x_min is where the distance of Kolmogorov and Smirnov is least. The
    chance is that of samples with as many values as there are, of the law in the tail and of the
    values themselves below it, each fitted in the same way, whose distance is larger. An
    exponential tail must be less likely (Vuong's test: the logarithm of the ratio of likelihoods,
    over √n times its standard deviation, is more than 1.64).
    """
    x = np.sort(np.asarray(values, np.float64))
    x = x[x > 0.0]
    if x.size < LEAST:
        return None, f"no exponent: {LEAST} events are needed, there are {x.size}"
    alpha, start, distance = _fit(x)
    tail = x[x >= start]
    if tail.size < LEAST or not 1.0 < alpha < math.inf:
        return None, f"no exponent: only {tail.size} events would follow a power law"
    if not _is_above_exponential(tail, alpha):
        return None, "no exponent: an exponential tail is as likely as a power law"
    random, below = np.random.default_rng(0), x[x < start]
    worse = 0
    for _ in range(_SAMPLES):
        count = random.binomial(x.size, tail.size / x.size)
        law = start * random.random(count) ** (-1.0 / (alpha - 1.0))
        rest = random.choice(below, x.size - count) if below.size else law[:0]
        worse += _fit(np.sort(np.concatenate([rest, law])))[2] > distance
    chance = worse / _SAMPLES
    if chance < PLAUSIBLE:
        return None, f"no exponent: data of a power law fit worse in only {100.0 * chance:.0f} %"
    error = (alpha - 1.0) / math.sqrt(tail.size)
    return PowerLaw(alpha, error, start, int(tail.size), chance, distance), ""


def _fit(x: Floats) -> tuple[float, float, float]:
    """Exponent, beginning of the tail, and distance, of ascending values."""
    first = np.unique(np.searchsorted(x, x[:: max(1, x.size // _STARTS)]))
    first = first[x.size - first >= min(10, x.size)]
    best = (math.nan, float(x[0]), math.inf)
    for k in first.tolist():
        tail, n = x[k:], x.size - k
        total = float(np.log(tail / tail[0]).sum())
        if not total > 0.0:
            continue
        alpha = 1.0 + n / total
        law = 1.0 - (tail / tail[0]) ** (1.0 - alpha)
        below = np.arange(n) / n
        distance = float(max(np.abs(law - below).max(), np.abs(law - below - 1.0 / n).max()))
        if distance < best[2]:
            best = (alpha, float(tail[0]), distance)
    return best


def _is_above_exponential(tail: Floats, alpha: float) -> bool:
    start = float(tail[0])
    rate = 1.0 / float((tail - start).mean())
    law = math.log((alpha - 1.0) / start) - alpha * np.log(tail / start)
    ratio = law - (math.log(rate) - rate * (tail - start))
    scatter = float(ratio.std())
    return scatter > 0.0 and float(ratio.sum()) > 1.64 * scatter * math.sqrt(tail.size)
