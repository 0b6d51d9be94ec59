"""How well groups of grains are mixed over time; how they, or sizes, lie over the height."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between, Shares, make_bins
from multicor_cli.post.lattice import lattice_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    frames_of,
    frames_told,
    of_groups,
    times_of,
)
from multicor_cli.post.sums import Sums, Values, average, sum_grains
from multicor_cli.post.table import Column, Quantity, Table, TimeTable
from multicor_cli.text import choices

CELL = 10.0
"""Grains in a cell, unless told otherwise."""

_SHUFFLES = 200

MIXING = (
    Quantity("mixing_index", "mixing index M (Lacey)", "M"),
    Quantity("separation", "separation of mean heights", "s"),
)
"""What `mixing` measures, beside the mean height of each group; the second of two groups that have
heights."""


class Mixing(TimeTable):
    """Mixing of groups over time; ``f`` frames, ``k`` cells with N_i of N grains in a frame.

    M = (σ₀² − σ²)/(σ₀² − σ_r²) (Lacey, J. Appl. Chem. 4, 257, 1954) with the variance
    σ² = Σ_i N_i Σ_g (p_ig − p_g)²/N of the shares p_ig of the groups in the cells, which is
    σ₀² = Σ_g p_g (1 − p_g) where each cell has grains of one group, and on average
    σ_r² = σ₀² (k − 1)/(N − 1) where chance assigns the groups to the grains (the variance of
    drawing without replacement): M is 0 and on average 1 in these cases, whatever the N_i. Grains
    count alike, each in the cell of its center.

    Cells hold equal numbers of grains, which differ by one or two where division leaves a rest:
    rows of grains ordered by height, each cut from left to right
    into cells about as wide as high. So none is empty or poor, in a heap or a drum either.

    The separation is the difference of the mean heights of the first and the second group, over the
    largest that these groups can have at the same places: 1 with the first group above, −1 below.

    Attributes:
        values: `MIXING` and ``height_GROUP``, mean heights [m], by name, ``(f,)``; nan where
            there is no grain; M also with fewer than two cells, or one group alone.
        groups: Names of the groups.
        cell_grains: Grains in a cell, averaged over cells and frames.
        cells: Number of cells, averaged over the frames.
        random_scatter: Standard deviation of M about 1 if groups were assigned by chance, in the
            last frame with an index.
    """


def mixing(
    source: Run,
    selection: Selection | None = None,
    *,
    cell: float = CELL,
    groups: Sequence[str] = (),
) -> Mixing:
    """How well groups are mixed, frame by frame.

    Args:
        source: The run.
        selection: Which frames; default: all.
        cell: Grains in a cell.
        groups: Names of the groups that count; default: all.

    Raises:
        PostError: If there are fewer than two groups, one of them does not exist, no frame is
            selected, or none has two cells and grains of two groups.
        StoreError: If the run cannot be read.
    """
    names = names_of_groups(source.model.groups, groups)
    if not 1.0 <= cell < np.inf:
        raise PostError(f"{cell:g} grains in a cell: choose 1 or more")
    chosen = (selection or Selection(frames=slice(None))).indices(source.frames)
    numbers = np.array([source.model.groups.index(name) for name in names], np.int64)

    def grains() -> Iterator[_Grains]:
        return (_grains(source, frame, numbers) for frame in frames_of(source, chosen))

    # One for all frames: M jumps where the number of rows does
    aspects = np.array([each.aspect for each in grains()])
    aspect = float(np.median(aspects[~np.isnan(aspects)])) if not np.isnan(aspects).all() else 1.0
    rows: list[list[float]] = []
    sizes: list[tuple[int, int]] = []
    last = None
    for at, group, _ in grains():
        if not len(at):  # none is there yet, or any more
            rows.append([np.nan] * (2 + len(names)))
            continue
        cells, y = cells_of(at, cell, aspect), at[:, Y]
        index = lacey(cells, group, len(names))
        with np.errstate(invalid="ignore"):  # nan of a group without a grain
            heights = np.bincount(group, y, len(names)) / np.bincount(group, minlength=len(names))
        rows.append([index, _separation(y, group), *heights])
        sizes.append((len(at), int(cells.max()) + 1))
        last = last if np.isnan(index) else (cells, group)
    if last is None:
        raise PostError(
            "no frame has two cells of several grains and two groups in them: choose another "
            "--cell, or other frames"
        )
    (cells, group), random = last, np.random.default_rng(0)
    by_chance = [lacey(cells, random.permutation(group), len(names)) for _ in range(_SHUFFLES)]
    count, number = np.mean(sizes, axis=0).tolist()
    kinds = [*MIXING]
    kinds += [Quantity(f"height_{name}", f"mean height of {name}", "y", "m") for name in names]
    values = dict(zip((kind.name for kind in kinds), np.array(rows).T, strict=True))
    if source.model.is_cell:  # it has no heights
        kinds = kinds[:1]
    if len(names) > 2:
        del kinds[1:2]
    return Mixing.of_frames(
        source, chosen, kinds, values, groups=names, cell_grains=count / number, cells=number,
        random_scatter=float(np.std(by_chance)),
    )  # fmt: skip


def names_of_groups(known: tuple[str, ...], groups: Sequence[str]) -> tuple[str, ...]:
    """Names of the groups that count; raises `PostError` if one is missing or alone."""
    for name in groups:
        if name not in known:
            raise PostError(f"there is no group '{name}'; {choices(name, known)}")
    names = tuple(dict.fromkeys(groups)) or known
    if len(names) < 2:
        raise PostError(
            f"mixing is one of several groups, and there is only '{names[0]}': divide the grains "
            "of the scenario into groups, or name two with --group"
        )
    return names


class _Grains(NamedTuple):
    """Places of the grains that count [m], their groups, and height over width of their region."""

    at: Floats
    group: NDArray[np.int64]
    aspect: float


def _grains(source: Run, frame: Frame, numbers: NDArray[np.int64]) -> _Grains:
    of_grain, lattice = frame.model.grains.group, lattice_of(source.model, frame)
    counts = np.isin(of_grain, numbers)
    at = lattice.wrapped(np.asarray(frame.position, np.float64)[counts, :2])
    at[:, X] -= lattice.slant * at[:, Y]  # of a tilted cell between straight sides
    group = (of_grain[counts, np.newaxis] == numbers).argmax(axis=1)
    if len(at) < 2:
        return _Grains(at, group, np.nan)
    width, height = (size or np.ptp(axis) for axis, size in zip(at.T, lattice[:2], strict=True))
    return _Grains(at, group, float(height / width) if width > 0.0 else np.inf)


def cells_of(at: Floats, grains: float, aspect: float) -> NDArray[np.int64]:
    """Cells 0, 1, … of about so many grains each, of grains at places [m], shape ``(n,)``.

    ``aspect`` is the height over the width of the region, so that cells are about square; of four
    and more at least two lie beside and two above each other, in thin regions too.
    """
    n, (x, y) = len(at), at.T
    cells = max(round(n / grains), 1)
    least = 2.0 if cells >= 4 else 1.0
    rows = round(min(max(np.sqrt(cells * aspect), least), cells / least))
    first = np.arange(rows + 1) * cells // rows  # cell of each row
    ends, upwards, found = first * n // cells, np.lexsort((x, y)), np.empty(n, np.int64)
    for k in range(rows):
        row = upwards[ends[k] : ends[k + 1]]
        columns, order = first[k + 1] - first[k], row[np.lexsort((y[row], x[row]))]
        found[order] = first[k] + np.arange(row.size) * columns // row.size
    return found


def lacey(cells: NDArray[np.int64], group: NDArray[np.int64], groups: int) -> float:
    """Mixing index of grains in cells; nan with one cell, or one group; see `Mixing`."""
    n, k = cells.size, int(cells.max(initial=-1)) + 1
    shares = np.bincount(group, minlength=groups) / n
    apart = float((shares * (1.0 - shares)).sum())
    if k < 2 or apart == 0.0 or k >= n:
        return np.nan
    counts = np.bincount(cells * groups + group, minlength=k * groups).reshape(k, groups)
    size = counts.sum(axis=1, keepdims=True)
    variance = float((size * (counts / size - shares) ** 2).sum()) / n
    return (apart - variance) / (apart * (1.0 - (k - 1) / (n - 1)))


def _separation(y: Floats, group: NDArray[np.int64]) -> float:
    """Difference of the mean heights of two groups over the largest that there can be."""
    first = int((group == 0).sum())
    if not 0 < first < group.size or group.max() > 1:
        return np.nan
    found = float(y[group == 0].mean() - y[group == 1].mean())
    ordered = np.sort(y)[::-1] if found > 0.0 else np.sort(y)  # the first group at its end
    most = abs(float(ordered[:first].mean() - ordered[first:].mean()))
    return found / most if most > 0.0 else np.nan


# ---- How groups, or sizes, lie over the height

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
    (sums,) = sum_grains(part, chosen, places, [_values(first)], "mean")
    rows = [Sums(*(column[rows] for column in sums)) for rows in parts]
    value, error = (np.array(each) for each in zip(*map(average, rows), strict=True))
    area = np.array([row.area.mean(axis=0) for row in rows])
    at = times_of(source, chosen)
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
    # Halfway between the last frame of a time and the first of the next
    between_times = [0.5 * (at[one[-1]] + at[two[0]]) for one, two in pairwise(parts)]
    return Segregation(
        columns, facts, details, quantity=quantity, frames=chosen, label=label,
        time_edges=np.array([at[0], *between_times, at[-1]]),
        y_edges=places.bottom + np.arange(places.count + 1) * places.width,
    )  # fmt: skip


def _values(group: int) -> Values:
    """Whether grains are of a group, or, if it is −1, their diameters [m]."""

    def values(frame: Frame, shares: Shares) -> Floats:
        grains = frame.model.grains
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
