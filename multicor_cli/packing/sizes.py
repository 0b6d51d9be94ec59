"""Distributions of radii, by number or by mass, as formulas or tables; and drawing from them.

Lists are drawn by exact quotas (largest remainder, ties at random), so that the fractions hold as
well as whole grains can; continuous distributions are drawn by stratified sampling, one grain per
interval of equal probability, so that their moments hold far better than with independent draws.
Both are then shuffled.

"By mass" weights are turned into weights by number: a grain of radius r has a mass ∝ r^p, p = 2 for
discs and 3 for spheres, so that ``number density ∝ mass density / r^p``. The continuous families
here stay in closed form under this; tables and the normal distribution follow. All take this p as
``power``, which is 0 for weights by number.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from multicor_cli import arithmetic
from multicor_cli.arithmetic import normal_cdf, sums
from multicor_cli.engine.jit import arrays
from multicor_cli.model.model import Floats
from multicor_cli.packing.initial_grains import Shape
from multicor_cli.scenario.sizes import (
    ListSizes,
    LognormalSizes,
    NormalSizes,
    PowerSizes,
    Sizes,
    TableSizes,
)

# ---- Independent random streams, one for each table of the scenario and purpose, from one seed.
#
# Adding a wall or a particle group therefore does not change the numbers that any other draws.
# NumPy promises the raw numbers of its bit generators for all versions, but not what its
# `Generator` makes of them: that is done here.


class TableKind(IntEnum):
    """Kind of table that draws."""

    PARTICLES = 0
    WALLS = 1


class Purpose(IntEnum):
    """What the numbers are for."""

    SIZES = 0
    PLACES = 1
    JITTER = 2
    RELEASE = 3
    SHAPES = 4
    ANGLES = 5


class Stream:
    """A stream of random numbers."""

    def __init__(self, raw: np.random.BitGenerator) -> None:
        self._raw = raw

    def random(self, shape: int | tuple[int, ...]) -> Floats:
        """Multiples of 2⁻⁵³ uniform in [0, 1)."""
        count = math.prod(shape) if isinstance(shape, tuple) else shape
        return np.asarray((self._raw.random_raw(count) >> np.uint64(11)) * 2.0**-53).reshape(shape)

    def shuffled(self, values: Floats) -> Floats:
        return values[np.argsort(self._raw.random_raw(values.size), kind="stable")]


def stream(seed: int, table: TableKind, index: int, purpose: Purpose, *part: int) -> Stream:
    """The counter-based stream of a table of its kind, or of a part of it, at its beginning."""
    key = np.random.SeedSequence(entropy=seed, spawn_key=(int(table), index, int(purpose), *part))
    return Stream(np.random.Philox(key))


# ---- Distributions

MASS_POWER = {"disc": 2, "sphere": 3}
"""p in ``mass ∝ radius^p`` by shape."""

_PROBES = 4096
_FITS = 8


@dataclass(frozen=True)
class DiscreteSizes:
    """A few radii [m] with fractions by number, whose sum is 1, shape ``(k,)``."""

    radii: Floats
    fractions: Floats

    @property
    def largest(self) -> float:
        return float(self.radii[self.fractions > 0.0].max())

    def draw(self, count: int, rng: Stream) -> Floats:
        """``count`` radii [m] in random order, each with its share (largest remainder)."""
        if count < self.radii.size:
            # Fewer grains than radii: the largest remainders would always pick the same few.
            levels = (np.arange(count) + rng.random(count)) / count
            place = np.searchsorted(np.cumsum(self.fractions), levels, side="right")
            return rng.shuffled(self.radii[np.minimum(place, self.radii.size - 1)])
        share = self.fractions * count
        # Shares that are whole numbers but for rounding must not lose a grain to the next one.
        whole = np.floor(share + 1e-9).astype(np.int64)
        missing = count - int(np.cumsum(whole)[-1])
        lottery = rng.random(self.radii.size)
        whole[np.lexsort((lottery, np.rint(1e9 * (whole - share))))[:missing]] += 1
        return rng.shuffled(np.repeat(self.radii, whole))


@dataclass(frozen=True)
class ContinuousSizes:
    """A distribution by its quantile function: radius [m] at a cumulated fraction by number."""

    quantile: Callable[[Floats], Floats]
    largest: float

    def draw(self, count: int, rng: Stream) -> Floats:
        """``count`` radii [m] in random order, one from each interval of equal probability."""
        levels = (np.arange(count) + rng.random(count)) / max(count, 1)
        return rng.shuffled(self.quantile(levels))


SizeDistribution = DiscreteSizes | ContinuousSizes


def list_sizes(radii: Floats, fractions: Floats | None, power: int) -> DiscreteSizes:
    """Radii [m] with ``fractions``, normalized here (default: equal), by number or by mass."""
    weights = np.ones(radii.size) if fractions is None else np.array(fractions, float)
    if power:
        ratio = radii / radii.max()
        weights = weights / (ratio * ratio if power == 2 else ratio * ratio * ratio)
    return DiscreteSizes(np.array(radii, float), weights / sums.total(weights))


def power_sizes(exponent: float, smallest: float, largest: float, power: int) -> ContinuousSizes:
    """Density ∝ r^-exponent between ``smallest`` and ``largest`` [m]; constant for 0."""
    slope = 1.0 - exponent - power
    span = arithmetic.log(largest / smallest)

    def quantile(level: Floats) -> Floats:
        if slope == 1.0:  # uniform by number
            return smallest + level * (largest - smallest)
        if abs(slope * span) < 1e-12:
            return smallest * arrays.exp(level * span)
        # (r/r_min)^slope grows linearly with the level; expm1 and log1p keep it exact for slopes
        # near 0.
        growth = arithmetic.expm1(slope * span)
        return smallest * arrays.exp(arrays.log1p(level * growth) / slope)

    return ContinuousSizes(quantile, largest)


def lognormal_sizes(
    median: float, sigma: float, smallest: float, largest: float, power: int
) -> ContinuousSizes:
    """Normal distribution of ln r with mean ln ``median`` and standard deviation ``sigma``.

    Cut to radii between ``smallest`` and ``largest`` [m]. Dividing by r^p shifts the mean of ln r
    by −p σ² and keeps the form.
    """
    center = arithmetic.log(median) - power * sigma * sigma
    score = normal_between(
        (arithmetic.log(smallest) - center) / sigma, (arithmetic.log(largest) - center) / sigma
    )
    return ContinuousSizes(
        lambda level: np.clip(arrays.exp(center + sigma * score(level)), smallest, largest), largest
    )


def normal_between(low: float, high: float) -> Callable[[Floats], Floats]:
    """Quantile function of the standard normal distribution, cut to ``low`` … ``high``."""
    # Work in the lower tail, where the cumulated probability has full relative precision.
    side = -1.0 if low + high > 0.0 else 1.0
    start, end = arithmetic.normal_cdf(side * low), arithmetic.normal_cdf(side * high)

    def quantile(level: Floats) -> Floats:
        cumulated = np.clip(start + level * (end - start), 1e-300, 1.0 - 1e-16)
        return side * arrays.normal_quantile(cumulated)

    return quantile


def disc_area(radii: Floats) -> Floats:
    """Area that each grain covers in the plane [m²]."""
    return np.asarray(math.pi * radii * radii)


def diameter(radii: Floats) -> Floats:
    """Length that each grain covers on a line [m]."""
    return 2.0 * radii


def draw_to_total(
    sizes: SizeDistribution,
    measure: Callable[[Floats], Floats],
    total: float,
    restart: Callable[[], Stream],
) -> Floats:
    """Draw as many grains as bring the sum of their ``measure`` closest to ``total``; at least one.

    ``measure`` gives an area or length from radii [m], in the unit of the total. ``restart`` gives
    the stream at its beginning: a draw of n+1 grains is not one of n with one more.
    """
    mean = sums.mean(measure(sizes.draw(_PROBES, restart())))
    count = max(1, round(total / mean))
    tried: dict[int, tuple[float, Floats]] = {}
    for _ in range(_FITS):
        if count in tried:
            break
        radii = sizes.draw(count, restart())
        reached = sums.total(measure(radii))
        tried[count] = abs(reached - total), radii
        count = max(1, count + round((total - reached) / mean))
    for near in (count - 1, count + 1):
        if near > 0 and near not in tried:
            radii = sizes.draw(near, restart())
            tried[near] = abs(sums.total(measure(radii)) - total), radii
    return min(tried.values(), key=lambda pair: pair[0])[1]


# ---- Sizes from a table of what passes, as a sieve curve, and whatever can be written as one

_SLICES = 2000  # of a normal distribution by mass


def table_sizes(radii: Floats, passing: Floats, power: int) -> ContinuousSizes:
    """Radii between the rows of a table, with a constant density within each row.

    The density of numbers is then ∝ r^-p within a row, where the mass of a grain is ∝ r^p, and its
    integral and quantile have a closed form. Radii [m] ascend; ``passing`` is the share that is
    smaller, by number or by mass, from 0 to 1; both have shape ``(k,)``.
    """
    largest = float(radii[-1])
    edge = radii / largest
    low, high = edge[:-1], edge[1:]
    share = np.diff(passing)
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


def normal_sizes(
    mean: float, sigma: float, smallest: float, largest: float, power: int
) -> ContinuousSizes:
    """Normal distribution of radii, of this ``mean`` and deviation, cut to smallest … largest [m].

    By mass it is a table of so many rows that their steps cannot be told from the curve.
    """
    low, high = (smallest - mean) / sigma, (largest - mean) / sigma
    if power and largest > smallest:
        width = (largest - smallest) / _SLICES
        edges = np.array([smallest + k * width for k in range(_SLICES + 1)])
        below = np.array([normal_cdf((edge - mean) / sigma) for edge in edges.tolist()])
        below -= below[0]
        return table_sizes(edges, below / below[-1], power)
    score = normal_between(low, high)
    return ContinuousSizes(
        lambda level: np.clip(mean + sigma * score(level), smallest, largest), largest
    )


# ---- From a `sizes` table of the scenario to a distribution


def sizes_of(table: Sizes, shape: Shape) -> SizeDistribution:
    """The distribution of a ``sizes`` table; ``shape`` tells how mass grows with the radius."""
    power = MASS_POWER[shape] if table.by == "mass" else 0
    if isinstance(table, ListSizes):
        fractions = None if table.fractions is None else np.array(table.fractions)
        return list_sizes(np.array(table.radii), fractions, power)
    if isinstance(table, TableSizes):
        return table_sizes(np.array(table.radii), np.array(table.passing), power)
    bounds = (table.min, table.max, power)
    if isinstance(table, LognormalSizes):
        return lognormal_sizes(table.median, table.sigma, *bounds)
    if isinstance(table, NormalSizes):
        return normal_sizes(table.mean, table.sigma, *bounds)
    return power_sizes(table.exponent if isinstance(table, PowerSizes) else 0.0, *bounds)
