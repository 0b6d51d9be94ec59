"""Outlines of grains from files of polygons: WKT and GeoJSON, by way of shapely."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Any

import numpy as np

from multicor_cli.optional import library
from multicor_cli.scenario.base import COORDINATE_BOUNDS

Columns = list[list[float]]
"""Number of the grain, from 1; of the ring, 0 being the outside; x and y; of each corner."""


def read_wkt(text: str) -> Columns:
    """Columns of a text of geometries in WKT, each on a line or several; raises as `_columns`."""
    return _columns(_from("from_wkt", one, f"line {line}") for line, one in _geometries(text))


def read_geojson(text: str) -> Columns:
    """Columns of a geometry, feature or collection of them in GeoJSON; raises as `_columns`."""
    return _columns([_from("from_geojson", text, "the file")])


def _geometries(text: str) -> Iterator[tuple[int, str]]:
    """Texts with all of their parentheses closed, and the lines where they begin."""
    begin, parts, depth = 0, list[str](), 0
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        begin = begin if parts else number
        parts.append(line)
        depth += line.count("(") - line.count(")")
        if depth <= 0:
            yield begin, " ".join(parts)
            parts, depth = [], 0
    if parts:
        yield begin, " ".join(parts)


def _from(function: str, text: str, where: str) -> Any:
    shapely = library("shapely")
    try:
        return getattr(shapely, function)(text)
    except shapely.errors.ShapelyError as error:
        message = f"{where} cannot be read: {str(error).strip()[:200]}"
        raise ValueError(message) from None


def _polygons(geometry: Any) -> Iterator[Any]:
    if hasattr(geometry, "geoms"):
        yield from chain.from_iterable(map(_polygons, geometry.geoms))
    elif geometry.geom_type == "Polygon" and not geometry.is_empty:
        yield geometry
    else:
        what = "an empty polygon" if geometry.is_empty else f"a {geometry.geom_type}"
        message = f"{what} is no outline of a grain: keep polygons alone"
        raise ValueError(message)


def _columns(geometries: Iterable[Any]) -> Columns:
    """The corners of all polygons among geometries; what is above the plane is left out.

    Raises:
        MissingLibrary: If shapely is not installed.
        ValueError: The text cannot be read, or holds something else than polygons.
    """
    columns: Columns = [[], [], [], []]
    low, high = COORDINATE_BOUNDS
    for number, polygon in enumerate(chain.from_iterable(map(_polygons, geometries)), 1):
        for ring, line in enumerate((polygon.exterior, *polygon.interiors)):
            corners = np.asarray(line.coords, float)[:, :2]
            if not ((corners >= low) & (corners <= high)).all():
                message = f"grain {number} has a coordinate that is not from {low:g} to {high:g}"
                raise ValueError(message)
            rows = ([float(number)] * len(corners), [float(ring)] * len(corners), *corners.T)
            for column, row in zip(columns, rows, strict=True):
                column.extend(np.asarray(row).tolist())
    if not columns[0]:
        message = "there is no polygon in it"
        raise ValueError(message)
    return columns
