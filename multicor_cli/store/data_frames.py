"""Frames, contacts and the time series as DataFrames of pandas, which need not be installed for anything else."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.store.schema.rows import Column

Columns = Iterator[tuple[str, str, NDArray[Any]]]
"""Name, unit and values of each column."""


class MissingPandas(ImportError):
    """pandas is not installed."""

    exit_code = 5


def data_frame(columns: Columns) -> Any:
    """A DataFrame; units of the columns are in its ``attrs["units"]``.

    Raises:
        MissingPandas: If pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError as error:
        message = "DataFrames need pandas: pip install 'multicor-cli[study]'"
        raise MissingPandas(message) from error
    kept = list(columns)
    found = pd.DataFrame({name: values for name, _, values in kept})
    found.attrs["units"] = {name: unit for name, unit, _ in kept}
    return found


def columns_of(reader: Any, row: str) -> Columns:
    """The attributes of a frame or of its contacts that have one value, or one vector, for each row of a kind.

    Args:
        reader: `Frame` or `Contacts`.
        row: Kind of the rows: ``particle_row`` or ``contact_row``.
    """
    for kind in reversed(type(reader).__mro__):
        for name, column in vars(kind).items():
            if isinstance(column, Column) and column.row == row and (values := getattr(reader, name)) is not None:
                yield from _split(name, column, np.asarray(values))


def _split(name: str, column: Column[Any], values: NDArray[Any]) -> Columns:
    """A vector has a column for each of its components."""
    if values.ndim == 1:
        yield name, column.unit, values
        return
    names = column.columns if len(column.columns) == values.shape[1] else [f"{name}_{k}" for k in range(values.shape[1])]
    units = (column.unit.split(", ") * values.shape[1])[: values.shape[1]]
    yield from zip(names, units, values.T, strict=True)
