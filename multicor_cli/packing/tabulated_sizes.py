"""Sizes from a table of what passes, as a sieve curve, and whatever can be written as one."""

from __future__ import annotations

import numpy as np

from multicor_cli.arithmetic import normal_cdf
from multicor_cli.model.model import Floats
from multicor_cli.packing.sizes import Basis, ContinuousSizes, normal_between

_SLICES = 2000  # of a normal distribution by mass


def table_sizes(radii: Floats, passing: Floats, by: Basis, mass_power: int) -> ContinuousSizes:
    """Radii between the rows of a table, with a constant density by ``by`` within each row.

    The density of numbers is then ∝ r^-p within a row, where the mass of a grain is ∝ r^p, and its integral and quantile have a
    closed form.

    Args:
        radii: Radii [m], ascending, shape ``(k,)``.
        passing: Share of the grains, by number or by mass, that is smaller; from 0 to 1, shape ``(k,)``.
        by: What is shared out.
        mass_power: p.
    """
    largest = float(radii[-1])
    edge = radii / largest
    low, high = edge[:-1], edge[1:]
    share = np.diff(passing)
    power = mass_power if by == "mass" else 0
    begin, end = _integral(low, power), _integral(high, power)
    number = share / (high - low) * (end - begin)
    cumulated = np.concatenate([[0.0], np.cumsum(number)])
    cumulated /= cumulated[-1]

    def quantile(level: Floats) -> Floats:
        row = np.clip(np.searchsorted(cumulated, level, side="right") - 1, 0, low.size - 1)
        span = cumulated[row + 1] - cumulated[row]
        local = (level - cumulated[row]) / np.where(span > 0.0, span, 1.0)
        ratio = _inverse(begin[row] + local * (end[row] - begin[row]), power)
        return largest * np.clip(ratio, low[row], high[row])

    return ContinuousSizes(quantile, largest)


def _integral(ratio: Floats, power: int) -> Floats:
    """∫ r^-p dr, without its constant."""
    if power == 0:
        return ratio
    return -1.0 / ratio if power == 2 else -0.5 / (ratio * ratio)


def _inverse(integral: Floats, power: int) -> Floats:
    """The ratio r of an `_integral`."""
    if power == 0:
        return integral
    return -1.0 / integral if power == 2 else np.sqrt(-0.5 / integral)


def normal_sizes(mean: float, sigma: float, smallest: float, largest: float, by: Basis, mass_power: int) -> ContinuousSizes:
    """Normal distribution of the radius with ``mean`` and standard deviation ``sigma``, cut to ``smallest`` … ``largest`` [m].

    By mass it is a table of so many rows that their steps cannot be told from the curve.
    """
    low, high = (smallest - mean) / sigma, (largest - mean) / sigma
    if by == "mass" and largest > smallest:
        width = (largest - smallest) / _SLICES
        edges = np.array([smallest + k * width for k in range(_SLICES + 1)])
        below = np.array([normal_cdf((edge - mean) / sigma) for edge in edges.tolist()])
        below -= below[0]
        return table_sizes(edges, below / below[-1], by, mass_power)
    score = normal_between(low, high)
    return ContinuousSizes(lambda level: np.clip(mean + sigma * score(level), smallest, largest), largest)
