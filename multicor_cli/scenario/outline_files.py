"""Outlines of digitized grains: polygons in WKT and GeoJSON, by way of shapely; what is wrong with
their corners; convex pieces.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import chain, groupby, pairwise
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from multicor_cli.model.decomposition import convex_pieces, without_idle
from multicor_cli.model.outlines import Floats
from multicor_cli.model.shapes import Polygon, are_apart, fault_of_polygon
from multicor_cli.optional import library
from multicor_cli.scenario.base import COORDINATE_BOUNDS
from multicor_cli.scenario.problems import Refused

MOST_CORNERS = 64
"""Most corners of a piece, and most pieces of a grain."""

_MOST_DRAWN = 1000
_UNITED = "unite what touches, as with shapely.make_valid"
_SIMPLER = "leave out corners, as with shapely.simplify"

# ---- Files

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


# ---- Corners


class Drawn(NamedTuple):
    """A digitized grain: its rings, the outer one counter-clockwise and holes clockwise; pieces."""

    rings: list[Floats]
    pieces: list[Floats]


@lru_cache(maxsize=4096)  # it is needed for checks, sizes and packings
def drawn(rings: tuple[tuple[tuple[float, float], ...], ...]) -> Drawn:
    """An outline of rings with corners in either order; `Refused`, without a key, if it is none."""
    found: list[Floats] = []
    for k, ring in enumerate(rings):
        what, points = f"hole {k}: " if k else "", without_idle(np.array(ring))
        fault = "less than three corners are left without those on straight sides"
        if len(points) > 2:
            fault = (fault_of_polygon(points) or (0, ""))[1]
        if fault:
            remedy = "draw the outline once around, as with shapely.make_valid"
            raise Refused((), f"{what}{fault}", remedy)
        is_left = Polygon(points).signed_size > 0.0
        found.append(points if is_left == (k == 0) else points[::-1].copy())
    corners = sum(map(len, found))
    if corners > _MOST_DRAWN:
        what = f"{corners} corners are more than {_MOST_DRAWN}"
        raise Refused((), what, _SIMPLER)
    _check_holes(found)
    pieces = convex_pieces(found)
    if pieces is None:
        raise Refused((), "corners nearly touch a side or another corner", _SIMPLER)
    most = max(len(pieces), *map(len, pieces))
    if most > MOST_CORNERS:
        kind = "convex pieces" if most == len(pieces) else "corners of a convex piece"
        raise Refused((), f"{most} {kind} are more than {MOST_CORNERS}", _SIMPLER)
    return Drawn(found, pieces)


def _check_holes(rings: list[Floats]) -> None:
    """Raise `Refused` for a hole that is not within the outline, or touches it or another one."""
    for k, hole in enumerate(rings[1:], 1):
        ends = np.roll(hole, -1, axis=0)
        for m, other in enumerate(rings[:k]):
            others = np.roll(other, -1, axis=0)
            is_apart = all(
                are_apart(*side, other, others).all() for side in zip(hole, ends, strict=True)
            )
            is_inside = Polygon(other).depth(hole[:1])[0] > 0.0
            if m == 0 and not (is_apart and is_inside):
                raise Refused((), f"hole {k} is not inside of the outline", _UNITED)
            is_around = Polygon(hole).depth(other[:1])[0] > 0.0
            if m > 0 and (not is_apart or is_inside or is_around):
                raise Refused((), f"holes {m} and {k} touch or overlap", _UNITED)


def rings_of_grains(
    grain: Sequence[float], ring: Sequence[float], x: Sequence[float], y: Sequence[float]
) -> Iterator[tuple[float, tuple[tuple[tuple[float, float], ...], ...]]]:
    """Number of each grain, and its rings, of the columns of all corners."""
    rows = zip(grain, ring or [0.0] * len(grain), zip(x, y, strict=True), strict=True)
    for number, corners in groupby(rows, key=itemgetter(0)):
        rings = groupby(corners, key=itemgetter(1))
        yield number, tuple(tuple(point for _, _, point in each) for _, each in rings)


def faults_of_columns(values: Sequence[Sequence[float]]) -> Iterator[Refused]:
    """What is wrong with outlines: the columns grain, ring (which may be empty), x and y."""
    grain, ring, x, y = values
    rows = len(grain)
    if rows == 0 or (len(x), len(y), len(ring) or rows) != (rows, rows, rows):
        what = f"{len(x)} x and {len(y)} y for {rows} corners"
        what += f" with {len(ring)} rings" if ring else ""
        yield Refused((), what, "give grain, x and y of each corner, or file")
        return
    for before, after in pairwise(zip(grain, ring or grain, strict=True)):
        if after < before:
            at = int(after[0] == before[0])
            of = ("grain", "ring")[at]
            remedy = f"let the corners of a {of} follow each other, ascending"
            yield Refused((of,), f"{of} {after[at]:g} follows {before[at]:g}", remedy)
            return
    for number, rings in rings_of_grains(grain, ring, x, y):
        try:
            drawn(rings)
        except Refused as error:
            yield Refused(("grain",), f"grain {number:g}: {error.what}", error.remedy)
