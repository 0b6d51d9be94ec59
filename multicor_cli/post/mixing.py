"""How well groups of grains are mixed, over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.post.lattice import lattice_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    frames_of,
    frames_told,
    model_of,
)
from multicor_cli.post.table import Quantity, TimeTable
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
        time: Times of the frames [s], shape ``(f,)``.
        values: `MIXING` and ``height_GROUP``, mean heights [m], by name, ``(f,)``; nan where
            there is no grain; M also with fewer than two cells, or one group alone.
        groups: Names of the groups.
        cell_grains: Grains in a cell, averaged over cells and frames.
        cells: Number of cells, averaged over the frames.
        random_scatter: Standard deviation of M about 1 if groups were assigned by chance, in the
            last frame with an index.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    KEYS = (
        "groups", "cell_grains", "cells", "random_scatter", "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note", "time", "values",
    )  # fmt: skip


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
        rows.append([index, _separation(y, group), *_heights(y, group, len(names))])
        sizes.append((len(at), int(cells.max()) + 1))
        last = last if np.isnan(index) else (cells, group)
    if last is None:
        raise PostError(
            "no frame has two cells and two groups in them: lower --cell, or choose other frames"
        )
    count, number = np.mean(sizes, axis=0).tolist()
    facts = {
        "groups": names, "cell_grains": count / number, "cells": number,
        "random_scatter": _random_scatter(*last, len(names)), **frames_told(source, chosen),
    }  # fmt: skip
    kinds = [*MIXING]
    kinds += [Quantity(f"height_{name}", f"mean height of {name}", "y", "m") for name in names]
    if source.model.is_cell:  # it has no heights
        kinds = kinds[:1]
    quantities = [kind.over_time(each) for kind, each in zip(kinds, np.array(rows).T, strict=False)]
    if len(names) > 2:
        del quantities[1:2]
    times = np.asarray(source.frames.time, np.float64)[chosen]
    return Mixing(times, quantities, facts, frames=chosen)


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
    of_grain, lattice = model_of(source, frame).grains.group, lattice_of(source.model, frame)
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

    ``aspect`` is the height over the width of the region, so that cells are about square.
    """
    n, (x, y) = len(at), at.T
    cells = max(round(n / grains), 1)
    rows = round(min(max(np.sqrt(cells * aspect), 1.0), cells))
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


def _heights(y: Floats, group: NDArray[np.int64], groups: int) -> Floats:
    """Mean heights of the groups [m]; nan without a grain."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.bincount(group, y, groups) / np.bincount(group, minlength=groups))


def _separation(y: Floats, group: NDArray[np.int64]) -> float:
    """Difference of the mean heights of two groups over the largest that there can be."""
    first = int((group == 0).sum())
    if not 0 < first < group.size or group.max() > 1:
        return np.nan
    ordered = np.sort(y)[::-1]
    most = float(ordered[:first].mean() - ordered[first:].mean())
    found = float(y[group == 0].mean() - y[group == 1].mean())
    return found / most if most > 0.0 else np.nan


def _random_scatter(cells: NDArray[np.int64], group: NDArray[np.int64], groups: int) -> float:
    """Standard deviation of M where chance assigns the groups, of `_SHUFFLES` such assignments."""
    random = np.random.default_rng(0)
    found = [lacey(cells, random.permutation(group), groups) for _ in range(_SHUFFLES)]
    return float(np.std(found))
