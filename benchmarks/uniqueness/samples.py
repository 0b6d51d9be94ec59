"""Do two ways of running the same packings differ? Differences by seed, their standard error, and
an exact test of signs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multicor_cli.model.model import Floats

_MOST = 16  # signs are all tried up to this many differences, drawn by lot beyond


@dataclass(frozen=True)
class Sample:
    """Values of one quantity, one for each seed: mean and its standard error."""

    mean: float
    error: float


@dataclass(frozen=True)
class Shift:
    """Differences of a quantity between two ways of running the same packings.

    Attributes:
        mean: Mean difference.
        error: Its standard error; nan of one seed.
        scatter: rms of the differences: how far apart two runs of one packing are.
        chance: Share of all choices of signs that give a mean at least as large: small if the mean
            is not by chance.
    """

    mean: float
    error: float
    scatter: float
    chance: float

    @property
    def errors(self) -> float:
        """The mean difference in standard errors."""
        return self.mean / self.error if self.error > 0.0 else math.nan


def sample(values: Sequence[float]) -> Sample:
    """Mean and standard error."""
    return Sample(float(np.mean(values)), _error(np.asarray(values, np.float64)))


def shift(values: Sequence[float], control: Sequence[float]) -> Shift:
    """Compare two sets of values, seed by seed."""
    differences = np.asarray(values, np.float64) - np.asarray(control, np.float64)
    scatter = float(np.sqrt((differences**2).mean()))
    return Shift(float(differences.mean()), _error(differences), scatter, chance(differences))


def _error(values: Floats) -> float:
    return float(values.std(ddof=1) / math.sqrt(values.size)) if values.size > 1 else math.nan


def chance(differences: Floats) -> float:
    """Share of choices of signs whose mean is at least as large as that of the differences."""
    count = differences.size
    if count <= _MOST:
        signs = 1.0 - 2.0 * ((np.arange(2**count)[:, None] >> np.arange(count)) & 1)
    else:
        signs = np.random.Generator(np.random.Philox(1)).choice([-1.0, 1.0], (2**_MOST, count))
    sums, found = np.abs(signs @ differences), abs(differences.sum())
    return float((sums >= found * (1.0 - 1e-12)).mean())
