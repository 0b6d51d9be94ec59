"""What is stored of a moment: arrays by path of the schema."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.store.hdf5 import encode_strings
from multicor_cli.store.moment import Moment
from multicor_cli.store.schema import Dataset

Columns = dict[str, NDArray[Any]]
"""Arrays by path of the schema."""


def columns_of(table: tuple[Dataset, ...], moment: Moment) -> Columns:
    """Arrays of the rows of a table that come from a moment; those of one value per frame or row have a first dimension of 1."""
    return {row.path: _column(row, row.value(moment)) for row in table if row.value is not None}


def _column(row: Dataset, value: Any) -> NDArray[Any]:
    if row.dtype == "str":
        return encode_strings(list(value))
    values = np.asarray(value)
    return values[np.newaxis] if row.row in ("frame", "series_row", "one") else values
