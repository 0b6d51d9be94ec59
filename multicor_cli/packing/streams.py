"""Independent random streams: one for each table of the scenario and purpose, all from one seed.

Adding a wall or a particle group therefore does not change the numbers that any other group draws.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Table(IntEnum):
    """Kind of table that draws."""

    PARTICLES = 0
    WALLS = 1


class Purpose(IntEnum):
    """What the numbers are for."""

    SIZES = 0
    PLACES = 1
    JITTER = 2


def stream(seed: int, table: Table, index: int, purpose: Purpose) -> np.random.Generator:
    """The counter-based generator of table number ``index`` of its kind, at its beginning."""
    key = np.random.SeedSequence(entropy=seed, spawn_key=(int(table), index, int(purpose)))
    return np.random.Generator(np.random.Philox(key))
