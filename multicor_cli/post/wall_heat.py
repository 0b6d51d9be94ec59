"""Heat transfer between walls and a bed: coefficient and Nusselt number over time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from multicor_cli.model import Model
from multicor_cli.model.columns import GIVEN, X
from multicor_cli.model.model import SHAPE_FACTOR, Floats
from multicor_cli.model.shapes import Outline
from multicor_cli.post.rings import spans
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
    frames_told,
    gas_conductivity,
    need_grains,
    need_heat,
    need_two,
    placed_walls,
    places_of,
    refuse_cell,
    solid_conductivity,
    times_of,
    wall_temperatures,
)
from multicor_cli.post.table import Column, Quantity, TimeTable, average_ratios
from multicor_cli.text import choices

Over = Literal["solid", "gas"]
"""Of which the conductivity is that of the Nusselt number."""

WALL_QUANTITIES = (
    Quantity("flow", "heat flow into the grains", "Q", "W"),
    Quantity("bed", "temperature of the bed", r"T_\mathrm{bed}", "K"),
    Quantity("difference", "temperature of the wall less that of the bed", r"\Delta T", "K"),
    Quantity("wetted", "wetted length", "L", "m"),
    Quantity("coefficient", "heat transfer coefficient h", "h", "W/(m2 K)"),
    Quantity("nusselt", "Nusselt number h d/k", r"\mathrm{Nu}"),
)
"""What `wall_heat` measures of each wall, in the order of the table."""

_SUMS = ("lapse", "given", "bed", "difference", "wetted", "driving")


class WallHeatTable(TimeTable):
    """Heat transfer between walls and a bed; ``r`` intervals between frames.

    h = Q/(A (T_wall − T_bed)), with the heat Q that a wall gives to the grains by contacts, gas and
    radiation (without the heat of friction that it receives), and the wetted area A = L b: L is the
    sum of the diameters of the grains that touch the wall (with a contact that bears or conducts;
    of grains that are no discs their widths along it) in the second frame of an interval, or a
    given length; b is the mean thickness of discs, and of spheres the mean diameter, the thickness
    of a layer. The temperature of the bed is the mean by heat capacity, over all grains or those
    near the wall, that of an interval the mean of its two frames. Nu = h d̄/k.

    Attributes:
        values: Each of `WALL_QUANTITIES` of each wall by name, as ``floor: coefficient``, nan where
            not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        walls: Names of the walls.
        left_out: Names of those that have a temperature in some of the frames alone.
        thickness: b [m].
        length: The given length [m]; nan if it is that of the grains that touch.
        near: How far from the wall grains count for the temperature of the bed, in mean diameters;
            infinite: all.
        over: Which conductivity k is that of Nu.
        conductivity: k [W/(m K)]; nan if the scenario has none, or several.
    """


def wall_heat(
    source: Run,
    selection: Selection | None = None,
    walls: Sequence[str] = (),
    *,
    near: float | None = None,
    length: float | None = None,
    over: Over = "solid",
) -> WallHeatTable:
    """Heat transfer coefficients between walls and the bed.

    Args:
        source: The run, with heat.
        selection: Which frames bound the intervals; default: the later half of the last stage.
        walls: Names of the walls; default: all with a temperature in these frames.
        near: Only grains whose surface is within so many mean diameters of the wall are the bed.
        length: Wetted length of each wall [m]; default: the diameters of the grains that touch it.
        over: Whether Nu has the conductivity of the solid or of the gas.

    Raises:
        PostError: If fewer than two frames are selected, no wall (or one that is named) has a
            temperature, contacts were not recorded, or the run has no heat, or is one of a cell.
        StoreError: If the run cannot be read.
    """
    refuse_cell(source.model, "there are no walls", "use post conductivity")
    if source.model.thermal is None:
        need_heat(None)
    for name, value in (("distance", near), ("length", length)):
        if value is not None and not 0.0 < value < np.inf:
            raise PostError(f"the {name} {value:g} must be positive and finite")
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    need_two(chosen, "wall-heat needs two frames")
    if length is None and not all(f.contacts.recorded for f in frames_of(source, chosen[1:])):
        raise PostError(
            "the contacts of these frames were not recorded, which say where grains touch a wall: "
            "give its wetted length with --length"
        )
    warmth = wall_temperatures(source, chosen)
    numbers, names = _find_walls(source, warmth, walls), source.model.walls.names
    thickness = _thickness(source.model)
    conductivity = solid_conductivity(source) if over == "solid" else gas_conductivity(source)
    times = times_of(source, chosen)
    seen = [_look(source, frame, numbers, near, length) for frame in frames_of(source, chosen)]
    means = 0.5 * (warmth[1:] + warmth[:-1])
    over_k = source.model.mean_diameter / conductivity

    def derive(sums: Floats) -> dict[str, Floats]:
        return _derive(sums, thickness, over_k)

    quantities: list[Column] = []
    parts: dict[str, Any] = {"mean": {}, "spread": {}}
    for k, wall in enumerate(numbers):
        rows = [
            _between(first[k], second[k], warm, lapse)
            for (first, second), warm, lapse in zip(
                pairwise(seen), means[:, wall].tolist(), np.diff(times).tolist(), strict=True
            )
        ]
        found = average_ratios(derive, np.array(rows), times)
        for q in WALL_QUANTITIES:
            if q.name == "nusselt" and not np.isfinite(conductivity):
                continue
            name = f"{names[wall]}: {q.name}"
            label = f"{names[wall]}: {q.label}"
            quantities.append(Column(name, q.unit, found.values[q.name], label))
            for of in ("mean", "spread"):
                parts[of][name] = getattr(found, of)[q.name]
    sometimes = np.flatnonzero(np.isfinite(warmth).any(axis=0)).tolist()
    left_out = [names[wall] for wall in sometimes if wall not in numbers and not walls]
    facts = {
        "walls": [names[wall] for wall in numbers], "left_out": left_out, "thickness": thickness,
        "length": np.nan if length is None else length, "near": np.inf if near is None else near,
        "over": over, "conductivity": conductivity, **frames_told(source, chosen),
    }  # fmt: skip
    return WallHeatTable(times[1:], quantities, facts, frames=chosen, **parts)


def _find_walls(source: Run, warmth: Floats, asked: Sequence[str]) -> list[int]:
    """Numbers of the walls asked for, or else of those with a temperature [K] in all frames."""
    names, is_warm = source.model.walls.names, np.asarray(np.isfinite(warmth).all(axis=0))
    known = ", ".join(names[w] for w in np.flatnonzero(is_warm)) or "none"
    for name in asked:
        if name not in names:
            raise PostError(f"there is no wall '{name}'; {choices(name, names)}")
    found = [names.index(name) for name in asked] or np.flatnonzero(is_warm).tolist()
    if not found or not is_warm[found].all():
        raise PostError(
            "wall-heat needs walls with a temperature in all these frames; those that have one: "
            f"{known}"
        )
    return list(dict.fromkeys(found))


def _thickness(model: Model) -> float:
    """Mean thickness of discs, mean diameter of spheres [m]."""
    assert model.thermal is not None
    if model.shape_factor != SHAPE_FACTOR["disc"]:
        return model.mean_diameter
    return float((model.thermal.surface / model.perimeter).mean())


class _Seen(NamedTuple):
    """Heat that a wall has given [J], temperature of the bed [K] and wetted length [m]."""

    given: float
    bed: float
    wetted: float


def _look(
    source: Run, frame: Frame, walls: Sequence[int], near: float | None, length: float | None
) -> list[_Seen]:
    model, temperature = frame.model, need_heat(frame.temperature)
    assert model.thermal is not None
    capacity, found = model.thermal.capacity, []
    for wall in walls:
        weight = capacity
        if near is not None:
            away = wall_distance(model, frame, wall) - model.grains.radius
            weight = capacity * (away <= near * source.model.mean_diameter)
        total = float(weight.sum())
        bed = float((weight * temperature).sum()) / total if total > 0.0 else np.nan
        wetted = _wetted(model, frame, wall) if length is None else length
        found.append(_Seen(float(need_heat(frame.wall_heat)[wall, GIVEN]), bed, wetted))
    return found


def _wetted(model: Model, frame: Frame, wall: int) -> float:
    """Sum of the diameters of the grains that touch a wall, or widths along it [m]."""
    contacts, n = frame.contacts, model.grain_count
    i, j = np.asarray(contacts.i), np.asarray(contacts.j)
    of_walls = np.flatnonzero(j >= n)
    of_walls = of_walls[model.shapes.wall[j[of_walls] - n] == wall]
    touching, first = np.unique(i[of_walls], return_index=True)
    if model.outlines is None:
        return 2.0 * float(model.grains.radius[touching].sum())
    x, y = np.asarray(contacts.normal, np.float64)[of_walls[first]].T
    angle = np.array(frame.angle, np.float64)
    angle[touching] += 0.5 * np.pi - np.arctan2(y, x)  # on a level floor
    left, right = spans(model, angle)[:, touching, 0]
    return float((right - left).sum())


def _between(first: _Seen, second: _Seen, warm: float, lapse: float) -> tuple[float, ...]:
    """The sums `_SUMS` of an interval in which the wall has a mean temperature [K]."""
    bed = 0.5 * (first.bed + second.bed)
    difference, given, wetted = warm - bed, second.given - first.given, second.wetted
    return (
        lapse, given, lapse * bed, lapse * difference, lapse * wetted, lapse * wetted * difference
    )  # fmt: skip


def _derive(sums: Floats, thickness: float, over_k: float) -> dict[str, Floats]:
    """`WALL_QUANTITIES` from rows of sums, of b [m] and d̄/k [m² K/W]."""
    s = dict(zip(_SUMS, sums.T, strict=True))
    coefficient = s["given"] / (s["driving"] * thickness)
    return {
        "flow": s["given"] / s["lapse"],
        **{name: s[name] / s["lapse"] for name in ("bed", "difference", "wetted")},
        "coefficient": coefficient,
        "nusselt": coefficient * over_k,
    }


# ---- How far grains are from a wall


def wall_distance(model: Model, frame: Frame, wall: int) -> Floats:
    """Distances of the centers of grains from the nearest line, disc or circle of a wall [m]."""
    place = places_of(frame)
    is_asked = np.arange(model.wall_count) == wall
    found = np.full(len(place), np.inf)
    for _, outline in placed_walls(model, np.asarray(frame.wall_position, np.float64), is_asked):
        found = np.minimum(found, _from_outline(outline, place, model.period))
    return found


def _from_outline(outline: Outline, place: Floats, period: float) -> Floats:
    """Least distance of points from shapes of one kind [m], shape ``(n,)``."""

    def towards(points: Floats) -> Floats:
        """From points ``(k, 2)`` to the places, or their nearest images, ``(n, k, 2)`` [m]."""
        way = place[:, np.newaxis] - points
        if period > 0.0:
            way[..., X] -= period * np.round(way[..., X] / period)
        return way

    if outline.radius is not None:
        away = np.hypot(*np.moveaxis(towards(outline.points[:, 0]), -1, 0))
        return np.asarray(np.abs(away - outline.radius).min(axis=1))
    if outline.normal is not None:
        way = place[:, np.newaxis] - outline.points[:, 0]
        return np.asarray(np.abs((way * outline.normal).sum(axis=-1)).min(axis=1))
    if outline.points.shape[1] == 1:  # the end of a line
        return np.full(len(place), np.inf)
    start, end = (outline.points[:, part].reshape(-1, 2) for part in (slice(-1), slice(1, None)))
    side, way = end - start, towards(0.5 * (start + end))
    square = np.maximum((side**2).sum(axis=-1), np.finfo(float).tiny)
    along = np.clip((way * side).sum(axis=-1) / square, -0.5, 0.5)
    away = way - along[..., np.newaxis] * side
    return np.asarray(np.hypot(*np.moveaxis(away, -1, 0)).min(axis=1))
