"""What the grains and contacts inside a part of the plane do, frame by frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import Area, Rectangle, Room
from multicor_cli.post.contacts import LoadedContacts, has_forces, loaded_contacts
from multicor_cli.post.quantities import PROFILED
from multicor_cli.post.rings import turned
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
    places_of,
    refuse_cell,
    times_of,
)
from multicor_cli.post.sums import spread
from multicor_cli.post.table import Column, TimeTable, line_of

QUANTITIES = tuple(
    replace(PROFILED[name], name=own)
    for name, own in {
        "solid-fraction": "solid_fraction", "coordination": "coordination",
        "velocity": "velocity_x", "velocity-y": "velocity_y", "spin": "spin",
        "temperature": "temperature",
        **{f"stress-{k}": f"stress_{k}" for k in ("xx", "xy", "yx", "yy")},
        **{f"kinetic-stress-{k}": f"kinetic_stress_{k}" for k in ("xx", "xy", "yy")},
    }.items()
)  # fmt: skip
"""What is measured in a region; temperature in runs with heat only."""

_ROUNDING = 1e-9
_STEP = 1e-6  # of a grain, over which the nearest boundary is straight
_PIECES = 8  # of a branch: narrow regions and corners lie between its ends
_AXES = ((0, 0, "xx"), (0, 1, "xy"), (1, 0, "yx"), (1, 1, "yy"))


class RegionTable(TimeTable):
    """Values in a part of the plane; ``f`` frames.

    A grain counts with the part of its area that lies inside, where the boundary is taken for
    straight across a grain, parallel to what is nearest to its center; a contact with the part of
    its branch that does. Both are exact for straight boundaries away from corners, and to the order
    of d/R for circles of radius R.

    Attributes:
        area: Area of the part [m²].
        grains: Number of grains whose center is inside, shape ``(f,)``.
        values: By name: solid fraction; coordination; means, weighted by area, of velocity, spin
            and temperature (in runs with heat); contact stress, and kinetic stress of velocities
            about the mean inside (compression positive); nan where nothing is inside, or no forces
            belong to a frame; shape ``(f,)``.
    """

    KEYS = (
        "area", "mean", "standard_error", "drift", "drift_error", "note", "time", "grains", "values"
    )  # fmt: skip

    @property
    def rows(self) -> list[tuple[Any, ...]]:
        """The area, the number of grains, and the quantities."""
        counts = self.grains.astype(np.float64)
        grains = line_of("grains", float(counts.mean()), spread(counts, self.time))
        return [("area [m2]", self.area, 0.0, 0.0, ""), grains, *super().rows]


def in_region(source: Run, area: Area, selection: Selection | None = None) -> RegionTable:
    """What is in a part of the plane; with a period, in its images too.

    Args:
        source: The run.
        area: The part; x is that of the domain.
        selection: Which frames; default: the later half of the last stage.

    Raises:
        PostError: If the part has no area, no frame is selected, no grain is in the part in any of
            them, it is no rectangle and wider than the period, or the run is one of a cell.
        TypeError: If it is none of the areas of `multicor_cli.model.shapes`.
        StoreError: If the run cannot be read.
    """
    if not isinstance(area, Area):
        raise TypeError(f"area is a Rectangle, Annulus or Polygon, is {type(area).__name__}")
    if not 0.0 < area.size < np.inf:
        raise PostError(
            f"the region has an area of {area.size:g} m²: are its corners, or its radii, swapped?"
        )
    remedy = "use post rheology for all of it, post profile or post fields for parts"
    refuse_cell(source.model, "a region is not looked for among the images", remedy)
    chosen = chosen_frames(source, selection)
    period, size = source.model.period, area.size
    room = Room(inside=(area,), period=period)
    if isinstance(area, Rectangle):
        (left, bottom), (right, top) = area.low, area.high
        if 0.0 < period <= (right - left) * (1.0 + _ROUNDING):  # it has no ends in x
            room = Room(inside=(Rectangle((-np.inf, bottom), (np.inf, top)),))
            size = period * (top - bottom)
    elif 0.0 < period < (width := float(np.ptp(area.corners()[:, 0]))) * (1.0 - _ROUNDING):
        raise PostError(
            f"the region is {width:g} m wide, and the period {period:g} m: grains would be in it "
            "twice; choose a narrower one, or a rectangle"
        )
    frames = frames_of(source, chosen)
    counts, measured = zip(*(_measure(f, room, size) for f in frames), strict=True)
    values = {name: np.array([row[name] for row in measured]) for name in measured[0]}
    quantities = [q.over_time(values[q.name]) for q in QUANTITIES if q.name in values]
    if not values["solid_fraction"].any():
        raise PostError("no grain is in the region in these frames")
    grains, time = np.array(counts, np.int64), times_of(source, chosen)
    return RegionTable(
        time,
        quantities,
        {"area": size, "grains": grains},
        [Column("grains", "", grains), *(column._replace(label="") for column in quantities)],
    )


def _measure(frame: Frame, room: Room, size: float) -> tuple[int, dict[str, float]]:
    """Number of grains whose center is inside, and the values of a frame."""
    model, position = frame.model, places_of(frame)
    radius, depth = model.disc_radius, room.clearance(position)
    share = _part_inside(model, frame, position, depth, room)
    cover = np.pi * radius * radius * share
    velocity = np.asarray(frame.velocity, np.float64)
    mean = [_ratio(cover, velocity[:, axis]) for axis in (0, 1)]
    values = {
        "solid_fraction": float(cover.sum()) / size, "coordination": np.nan,
        "velocity_x": mean[0], "velocity_y": mean[1],
        "spin": _ratio(cover, np.asarray(frame.spin, np.float64)),
    }  # fmt: skip
    if frame.temperature is not None:
        values["temperature"] = _ratio(cover, np.asarray(frame.temperature, np.float64))
    values |= dict.fromkeys((f"stress_{name}" for _, _, name in _AXES), np.nan)
    if has_forces(frame):
        contacts = loaded_contacts(frame, model)
        values["coordination"] = _ratio(share, contacts.counts)
        length = _lengths_inside(contacts, position, room)
        for a, b, name in _AXES:
            values[f"stress_{name}"] = float(contacts.virial(a, b) @ length) / size
    mass, away = model.grains.mass * share, velocity - np.array(mean)
    for a, b, name in (_AXES[0], _AXES[1], _AXES[3]):
        flux = float((mass * away[:, a]) @ away[:, b]) / size
        values[f"kinetic_stress_{name}"] = flux if share.any() else np.nan
    return int(np.count_nonzero(depth >= 0.0)), values


def _part_inside(model: Model, frame: Frame, position: Floats, depth: Floats, room: Room) -> Floats:
    """Part of the area of grains inside, whose centers are ``depth`` inside [m], ``(n,)``."""
    if model.outlines is None:
        return part_inside(depth, model.grains.radius)
    step = _STEP * model.disc_radius[:, np.newaxis] * np.eye(2)[:, np.newaxis]
    x, y = (room.clearance(position + way) - room.clearance(position - way) for way in step)
    # Turned so that the way inside leads down
    angle = np.asarray(frame.angle, np.float64) - 0.5 * np.pi - np.arctan2(y, x)
    cut = turned(model, angle)
    return np.asarray(cut.below(np.arange(depth.size), depth) / model.area)


def part_inside(depth: Floats, radius: Floats) -> Floats:
    """Part of the area of discs on the inner side of a straight line.

    1 − (arccos s − s √(1 − s²))/π, s = depth/radius cut to −1 … 1; inside depths are positive.
    """
    s = np.clip(depth / radius, -1.0, 1.0)
    return np.asarray(1.0 - (np.arccos(s) - s * np.sqrt(1.0 - s * s)) / np.pi)


def _lengths_inside(contacts: LoadedContacts, position: Floats, room: Room) -> Floats:
    """Part of each branch that lies inside, ``(c,)``: depth is linear along each of some pieces."""
    end = position[contacts.i]
    part, last = np.zeros(len(end)), room.clearance(end)
    for k in range(1, _PIECES + 1):
        first, last = last, room.clearance(end - (k / _PIECES) * contacts.branch)
        inner = np.maximum(first, 0.0) + np.maximum(last, 0.0)
        outer = np.maximum(-first, 0.0) + np.maximum(-last, 0.0)
        share = inner / np.where(inner + outer > 0.0, inner + outer, 1.0)
        part += np.where(outer == 0.0, 1.0, share) / _PIECES
    return part


def _ratio(weight: Floats, value: NDArray[Any]) -> float:
    """Weighted mean; nan where nothing has a weight."""
    return float((weight * value).sum()) / float(weight.sum()) if weight.any() else np.nan
