"""Outlines of digitized grains: polygons in WKT and GeoJSON, by way of shapely; what is wrong with
their corners; convex pieces.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import chain, groupby, pairwise, starmap
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
    lines = ((f"line {number}", one) for number, one in _geometries(text))
    return _columns((where, _from("from_wkt", one, where)) for where, one in lines)


def read_geojson(text: str) -> Columns:
    """Columns of a geometry, feature or collection of them in GeoJSON; raises as `_columns`."""
    library("shapely")  # what it is for is told before what is wrong
    try:
        parts = [(where, json.dumps(one)) for where, one in _parts(json.loads(text), "")]
    except Refused:
        raise
    except (ValueError, RecursionError) as error:
        raise Refused((), f"the file cannot be read: {error}", "correct it") from None
    return _columns((where, _from("from_geojson", one, where)) for where, one in parts)


_COLLECTIONS = {
    "FeatureCollection": ("features", "feature"),
    "GeometryCollection": ("geometries", "geometry"),
}
"""Types of GeoJSON that hold others: under which key, and what one of them is called."""


def _parts(value: Any, where: str) -> Iterator[tuple[str, Any]]:
    """The geometries in a value of GeoJSON, and where they are in the file; empty: all of it.

    Raises:
        Refused: A part lacks what its type must have (RFC 7946).
    """
    here, kind = where or "the file", value.get("type") if isinstance(value, dict) else None
    if not isinstance(kind, str):
        remedy = 'write { "type": "Polygon", "coordinates": ... }, or a Feature with it'
        raise Refused((), f'{here} has no "type" of GeoJSON', remedy)
    key, name = _COLLECTIONS.get(kind, ("geometry" if kind == "Feature" else "coordinates", ""))
    if value.get(key) is None:
        remedy = f"give the {key} of a polygon" + (f", or remove {where}" if where else "")
        raise Refused((), f"{here} has no {key}", remedy)
    if name and not isinstance(value[key], list):
        raise Refused((), f"{here} has {key} that are no array", "put them between [ and ]")
    if name:
        for number, each in enumerate(value[key], 1):
            yield from _parts(each, f"{where}, {name} {number}" if where else f"{name} {number}")
    elif kind == "Feature":
        yield from _parts(value[key], where)
    else:
        yield where, value


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
        why = re.sub(r"^\w+Exception: ", "", str(error).strip())[:200]
        if "json.exception" in why:  # of the parser within shapely
            why = "its coordinates are no arrays of finite numbers"
        message = f"{where or 'the file'} cannot be read: {why}"
        raise Refused((), message, "correct it") from None


def _polygons(where: str, geometry: Any) -> Iterator[Any]:
    if hasattr(geometry, "geoms"):
        for part in geometry.geoms:
            yield from _polygons(where, part)
    elif geometry.geom_type == "Polygon" and not geometry.is_empty:
        yield geometry
    else:
        kind = geometry.geom_type
        what = f"{where}: " if where else ""
        what += f"an empty {kind}" if geometry.is_empty else f"a {kind}"
        raise Refused((), f"{what} is no outline of a grain", "keep polygons alone")


def _columns(geometries: Iterable[tuple[str, Any]]) -> Columns:
    """The corners of all polygons among geometries; what is above the plane is left out.

    Each geometry comes with where it is in the file.

    Raises:
        MissingLibrary: If shapely is not installed.
        Refused: The text cannot be read, or holds something else than polygons.
    """
    columns: Columns = [[], [], [], []]
    low, high = COORDINATE_BOUNDS
    for number, polygon in enumerate(chain.from_iterable(starmap(_polygons, geometries)), 1):
        for ring, line in enumerate((polygon.exterior, *polygon.interiors)):
            corners = np.asarray(line.coords, float)[:, :2]
            if not ((corners >= low) & (corners <= high)).all():
                what = f"grain {number} has a coordinate that is not from {low:g} to {high:g}"
                raise Refused((), what, "correct it")
            rows = ([float(number)] * len(corners), [float(ring)] * len(corners), *corners.T)
            for column, row in zip(columns, rows, strict=True):
                column.extend(np.asarray(row).tolist())
    if not columns[0]:
        raise Refused((), "there is no polygon in it", "draw one for each grain")
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
        if len(points) < 3:
            what += "less than three corners are left without those on straight sides"
            raise Refused((), what, "give a third corner, which is not on a line with the others")
        if (fault := fault_of_polygon(points)) is not None:
            remedy = "draw the outline once around, as with shapely.make_valid"
            raise Refused((), f"{what}{fault[1]}", remedy)
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
    if not (rows or x or y or ring):
        remedy = "give file, or grain, x and y of each corner"
        yield Refused((), "no outlines are given", remedy)
        return
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
