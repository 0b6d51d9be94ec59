"""How groups of grains, or their sizes, lie over the height, and how that changes with time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between, Shares, make_bins
from multicor_cli.post.mixing import names_of_groups
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    frames_told,
    model_of,
    of_groups,
)
from multicor_cli.post.sums import Sums, Values, average, sum_grains
from multicor_cli.post.table import Column, Quantity, Table
from multicor_cli.text import choices

Of = Literal["share", "size"]
"""The share of the first group in the area of the grains, or their mean diameter."""

SEGREGATION = {
    "share": Quantity("share", "share of area", "c"),
    "size": Quantity("size", "mean diameter", r"\bar{d}", "m"),
}
"""What `segregation` measures."""

_FRAMES_EACH = 4
_MOST = 40  # times, unless told otherwise


class Segregation(Table):
    """Profiles over the height against time; ``t`` times, ``b`` bins; CSV has a row for each pair.

    People see those of the first and the last time.

    The frames of a run are parted into so many times, of about as many frames each. The share of a
    group is its part of the area of the grains (of groups that count) in a bin, summed over the
    frames of a time: c = Σ A_1/Σ A. The mean diameter is that by area, Σ A d/Σ A. Bins are those of
    `multicor_cli.post.profile.ProfileTable`, from wall to wall, with nothing left out. Standard
    errors are those over the frames of a time (`multicor_cli.post.sums.spread`): they hold what
    changes meanwhile, and are nan of single frames, and of few that remember each other. Where no
    grain is there is no value.

    Attributes:
        of: What was averaged: share or size.
        quantity: The same as a `Quantity`.
        label: What it is called, with the group.
        group: Name of the group whose share it is; empty of diameters.
        groups: Names of the groups that count.
        time: Mean times of the frames of each part [s], shape ``(t,)``.
        y: Centers of the bins above the origin [m], shape ``(b,)``.
        value: Shares, or mean diameters [m], shape ``(t, b)``.
        standard_error: Their standard errors, likewise.
        area: Area of the grains in the bins, averaged over the frames [m²], likewise.
        time_edges: When each time begins, and when the last one ends [s], shape ``(t + 1,)``.
        y_edges: Edges of the bins [m], shape ``(b + 1,)``.
        walls: Names of the lower and upper wall; empty where there is none.
        height: Distance of the walls [m]; see `multicor_cli.post.bins.Extent`.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """


def segregation(
    source: Run,
    selection: Selection | None = None,
    of: Of = "share",
    *,
    groups: Sequence[str] = (),
    bins: int | None = None,
    between: Between | None = None,
    times: int | None = None,
) -> Segregation:
    """Profiles of the share of a group, or of the mean diameter, against time.

    Args:
        source: The run.
        selection: Which frames; default: all.
        of: "share" of the first group, or "size".
        groups: Names of the groups that count; default: all.
        bins: Number of bins; default: as many as make a bin about one mean diameter wide.
        between: Names of the walls below and above; default: those that bound the grains.
        times: Number of times; default: one for every four frames, 40 at most; with fewer than 16
            one for each.

    Raises:
        PostError: If a group does not exist, or the share of one is asked for and there is no
            other; if no frame is selected, or one without grains; if there are more times than
            frames, or no sensible number of bins.
        StoreError: If the run cannot be read.
    """
    if of not in get_args(Of):
        raise PostError(f"there is no profile of '{of}' against time; {choices(of, get_args(Of))}")
    names: tuple[str, ...] = tuple(groups)
    if of == "share":
        names = names_of_groups(source.model.groups, groups)
    chosen = (selection or Selection(frames=slice(None))).indices(source.frames)
    parts = _parts(chosen.size, times)
    places = make_bins(source, chosen, bins, between=between)
    part = of_groups(source, names) if names else source
    first = source.model.groups.index(names[0]) if of == "share" else -1
    (sums,) = sum_grains(part, chosen, places, [_values(source, first)], "mean")
    rows = [Sums(*(column[rows] for column in sums)) for rows in parts]
    value, error = (np.array(each) for each in zip(*map(average, rows), strict=True))
    area = np.array([row.area.mean(axis=0) for row in rows])
    at = np.asarray(source.frames.time, np.float64)[chosen]
    middle = np.array([at[rows].mean() for rows in parts])
    extent, quantity = places.extent, SEGREGATION[of]
    walls = source.model.walls.names
    facts = {
        "of": quantity.name, "unit": quantity.unit, "group": names[0] if of == "share" else "",
        "groups": list(names or source.model.groups),
        "walls": tuple("" if w is None else walls[w] for w in (extent.lower, extent.upper)),
        "height": extent.height, "bin_width": places.width, **frames_told(source, chosen),
        "time": middle, "y": places.centers, "value": value, "standard_error": error, "area": area,
    }  # fmt: skip
    label, unit = f"share of {names[0]}" if of == "share" else quantity.label, quantity.unit
    columns = [Column("centers", "m", places.centers, "y", "")]
    for name, k in {"first": 0, "last": -1}.items():
        columns.append(Column(name, unit, value[k], f"{label}, {name}", ""))
        columns.append(Column(f"{name}_error", unit, error[k], "standard error", ""))
    details = [
        Column("of_time", "s", np.repeat(middle, places.count), "time"),
        Column("of_y", "m", np.tile(places.centers, middle.size), "y"),
        Column("of_value", unit, value.ravel(), label),
        Column("of_error", unit, error.ravel(), "standard error"),
        Column("of_area", "m2", area.ravel(), "area"),
    ]
    return Segregation(
        columns, facts, details, quantity=quantity, frames=chosen, label=label,
        time_edges=_edges(at, parts),
        y_edges=places.bottom + np.arange(places.count + 1) * places.width,
    )  # fmt: skip


def _values(source: Run, group: int) -> Values:
    """Whether grains are of a group, or, if it is −1, their diameters [m]."""

    def values(frame: Frame, shares: Shares) -> Floats:
        grains = model_of(source, frame).grains
        of_grains = 2.0 * grains.radius if group < 0 else (grains.group == group).astype(float)
        return np.asarray(of_grains[shares.grain], np.float64)

    return values


def _parts(frames: int, times: int | None) -> list[NDArray[np.int64]]:
    """Which frames belong to each time."""
    if times is None:
        are_many = frames >= _FRAMES_EACH**2
        times = min(frames // _FRAMES_EACH, _MOST) if are_many else frames
    if not 1 <= times <= frames:
        raise PostError(
            f"{frames} frames cannot be parted into {times} times: choose between 1 and {frames}, "
            "or more frames with --frames"
        )
    return np.array_split(np.arange(frames), times)


def _edges(at: Floats, parts: Sequence[NDArray[Any]]) -> Floats:
    """Halfway between the last frame of a time and the first of the next [s]; first and last."""
    inner = [0.5 * (at[before[-1]] + at[after[0]]) for before, after in pairwise(parts)]
    return np.array([at[0], *inner, at[-1]])
