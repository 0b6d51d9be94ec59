"""Independent random streams: one for each table of the scenario and purpose, all from one seed.

Adding a wall or a particle group therefore does not change the numbers that any other group draws.

NumPy promises the raw numbers of its bit generators for all versions, but not what its ``Generator`` makes of them: that is done
here.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from multicor_cli.model.model import Floats


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


class Stream:
    """A stream of random numbers."""

    def __init__(self, raw: np.random.BitGenerator) -> None:
        self._raw = raw

    def random(self, shape: int | tuple[int, ...]) -> Floats:
        """Multiples of 2⁻⁵³ uniform in [0, 1)."""
        count = math.prod(shape) if isinstance(shape, tuple) else shape
        return np.asarray((self._raw.random_raw(count) >> np.uint64(11)) * 2.0**-53).reshape(shape)

    def shuffled(self, values: Floats) -> Floats:
        """The values in random order."""
        return values[np.argsort(self._raw.random_raw(values.size), kind="stable")]


def stream(seed: int, table: TableKind, index: int, purpose: Purpose, *part: int) -> Stream:
    """The counter-based stream of table number ``index`` of its kind, or of a part of it, at its beginning."""
    key = np.random.SeedSequence(entropy=seed, spawn_key=(int(table), index, int(purpose), *part))
    return Stream(np.random.Philox(key))
