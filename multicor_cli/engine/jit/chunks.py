"""Reductions whose bits do not depend on the number of threads.

`CHUNK` grains or contacts form one unit: a kernel leaves one row of partial results per chunk, and its caller sums the rows in
order. (Array expressions and reductions inside a parallel kernel would be turned into parallel loops of their own, at a second of
compilation each.)
"""

from __future__ import annotations

import numpy as np

from multicor_cli.model.model import Floats

CHUNK = 512


def chunks_for(size: int, columns: int = 1) -> Floats:
    """Zeroed partial results for ``size`` items, one row per chunk (at least one), shape ``(chunks, columns)``."""
    return np.zeros((max(1, -(-size // CHUNK)), columns))
