"""How much room grains have: local solid fractions, neighbors and hexatic order of their cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import BIN_LIMIT
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    frames_of,
    frames_told,
    model_of,
    need_grains,
)
from multicor_cli.post.structure import margin_of, region_of
from multicor_cli.post.sums import Spread, of_sums
from multicor_cli.post.table import Column, Quantity, Table, line_of
from multicor_cli.post.tessellation import cells_of

_BINS = 50  # between 0 and 1
SIDES = np.arange(3, 10)
"""Numbers of neighbors whose shares are told."""

QUANTITIES = (
    Quantity("local_solid_fraction", "local solid fraction", r"\langle\nu_i\rangle"),
    Quantity("deviation", "its standard deviation over the grains"),
    Quantity("solid_fraction", "area of the grains over that of their cells", r"\nu"),
    Quantity("neighbors", "neighbors of a grain"),
    *(Quantity(f"share_{k}", f"share of grains with {k} neighbors") for k in (5, 6, 7)),
    Quantity("hexatic", "hexatic order of a grain", r"\langle|\psi_6|\rangle"),
    Quantity("hexatic_global", "hexatic order of all", r"|\langle\psi_6\rangle|"),
)
"""What `voronoi` measures, in the order of the table."""

_SUMS = (
    "grains", "fraction", "square", "solid", "cells", "neighbors", "hexatic", "hexatic_global",
)  # fmt: skip
"""Sums over the grains with a cell, before their numbers by neighbors and by local fraction."""


class VoronoiTable(Table):
    """Radical cells of the grains: averages, and P(ν) of the local solid fraction; ``b`` bins.

    The local solid fraction of a grain is its area over that of its cell (see
    `multicor_cli.post.tessellation.Cells`), of spheres their cross-section. Neighbors are grains
    across a side of the cell, glued ones too. Grains with open cells are left out, and with a
    margin those near sides that are not periodic. Grains count alike.

    Attributes:
        mean: Averages over grains and frames of `QUANTITIES` by name.
        spread: Their standard errors and drifts; see `multicor_cli.post.sums.spread`.
        fraction: Centers of the bins of the local solid fraction, shape ``(b,)``.
        density: Probability density P(ν) there, shape ``(b,)``.
        density_error: Its standard errors, nan with too few frames to tell, shape ``(b,)``.
        grains: Grains of all frames in each bin, shape ``(b,)``.
        sides: Numbers of neighbors `SIDES`.
        share: Shares of the grains that have as many; ``share_error``, standard errors.
        open_share: Share of grains whose cells are open.
        grain_count: Grains that count, averaged over the frames.
        mean_diameter: Mean diameter d̄ [m].
        margin: What is left out at sides that are not periodic, in mean diameters.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """


def voronoi(
    source: Run,
    selection: Selection | None = None,
    bins: int | None = None,
    *,
    margin: float | None = None,
) -> VoronoiTable:
    """Local solid fractions, numbers of neighbors and hexatic order of the radical cells.

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage.
        bins: Bins of the local solid fraction between 0 and 1; default: 50.
        margin: Mean diameters left out at sides that are not periodic, counted from the outermost
            centers; default: 1.

    Raises:
        PostError: If no frame is selected, one has no grain, or no grain that counts has a cell; if
            ``margin`` is negative, or given for a cell.
        MissingLibrary: If SciPy is not installed.
        StoreError: If the run cannot be read.
    """
    if bins is not None and not 1 <= bins <= BIN_LIMIT:
        raise PostError(f"{bins} bins: choose between 1 and {BIN_LIMIT}")
    diameter, edge = source.model.mean_diameter, margin_of(source.model, margin)
    chosen = (selection or Selection()).indices(source.frames)
    need_grains(source, chosen)
    count = bins or _BINS
    rows = np.array([_sums(source, f, edge, count) for f in frames_of(source, chosen)])
    if not rows[:, 1].any():
        raise PostError(
            "no grain in the region has a cell: too few are there, or each is at a free surface; "
            "lower --margin, or choose other frames"
        )
    open_share, rows = rows[:, 0].sum() / rows[:, :2].sum(), rows[:, 1:]
    times = np.asarray(source.frames.time, np.float64)[chosen]
    values, spreads = of_sums(lambda sums: _derive(sums, count), rows, times)
    k = len(QUANTITIES)
    names = [quantity.name for quantity in QUANTITIES]
    mean = dict(zip(names, values.tolist(), strict=False))
    spread = {name: Spread(*(each[n] for each in spreads)) for n, name in enumerate(names)}
    of_sides, of_bins = slice(k, k + SIDES.size), slice(k + SIDES.size, None)
    number = rows[:, -count:].sum(axis=0)
    seen = np.flatnonzero(number)
    shown = slice(int(seen[0]), int(seen[-1]) + 1)
    details = [
        Column("fraction", "1", ((np.arange(count) + 0.5) / count)[shown], "local solid fraction"),
        Column("density", "1", values[of_bins][shown], "probability density"),
        Column("density_error", "1", spreads.error[of_bins][shown], "standard error"),
        Column("grains", "", number[shown].astype(np.int64)),
    ]
    facts = {
        "mean_diameter": diameter, "margin": edge, **frames_told(source, chosen),
        "grain_count": float(rows[:, 0].mean()), "open_share": float(open_share), "mean": mean,
        "standard_error": {name: float(one.error) for name, one in spread.items()},
        "drift": {name: float(one.drift) for name, one in spread.items()},
        "note": {name: one.note() for name, one in spread.items()},
        "sides": SIDES, "share": values[of_sides], "share_error": spreads.error[of_sides],
        **{column.name: column.values for column in details},
    }  # fmt: skip
    lines = [line_of(q.label, mean[q.name], spread[q.name]) for q in QUANTITIES]
    headings = ("quantity", "mean", "standard error", "drift", "note")
    columns = [
        Column(f"of_{heading}", "", values, heading, "")
        for heading, values in zip(headings, zip(*lines, strict=True), strict=True)
    ]
    return VoronoiTable(columns, facts, details, spread=spread, frames=chosen)


def _sums(source: Run, frame: Frame, margin: float, count: int) -> Floats:
    """Grains with open cells; the `_SUMS`; grains by number of neighbors and by local fraction."""
    model = model_of(source, frame)
    inside = region_of(source.model, frame, margin).which
    cells = cells_of(model, frame)
    known = inside[~cells.is_open[inside]]
    solid, area = np.pi * model.grains.radius[known] ** 2, cells.area[known]
    neighbors, order = cells.neighbors[known], np.nan_to_num(cells.order()[known])
    fraction = solid / area
    bin_ = np.minimum((fraction * count).astype(np.int64), count - 1)  # 1 and what rounding adds
    return np.array([
        inside.size - known.size, known.size, fraction.sum(), (fraction**2).sum(), solid.sum(),
        area.sum(), neighbors.sum(), np.abs(order).sum(), np.abs(order.sum()),
        *np.bincount(neighbors, minlength=SIDES[-1] + 1)[SIDES],
        *np.bincount(bin_, minlength=count),
    ])  # fmt: skip


def _derive(sums: Floats, count: int) -> Floats:
    """`QUANTITIES`, shares by number of neighbors, and densities, from sums ``(…, q)``."""
    s: dict[str, Any] = dict(zip(_SUMS, np.moveaxis(sums, -1, 0), strict=False))
    n = s["grains"]
    mean, sides = s["fraction"] / n, sums[..., len(_SUMS) : len(_SUMS) + SIDES.size] / n[..., None]
    found: dict[str, NDArray[Any]] = {
        "local_solid_fraction": mean,
        "deviation": np.sqrt(np.maximum(s["square"] / n - mean**2, 0.0)),
        "solid_fraction": s["solid"] / s["cells"],
        "neighbors": s["neighbors"] / n,
        **{f"share_{k}": sides[..., k - SIDES[0]] for k in (5, 6, 7)},
        "hexatic": s["hexatic"] / n,
        "hexatic_global": s["hexatic_global"] / n,
    }
    averages = np.stack([found[quantity.name] for quantity in QUANTITIES], axis=-1)
    density = sums[..., -count:] * (count / n[..., None])
    return np.concatenate([averages, sides, density], axis=-1)
