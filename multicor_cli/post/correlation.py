"""Over which distances grains move together: correlations of their velocity fluctuations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post.bins import make_bins
from multicor_cli.post.flow import RelativeFrame, fit_flow, mean_flow
from multicor_cli.post.lattice import pair_sums, relative_velocity
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    frames_of,
    frames_told,
    times_of,
)
from multicor_cli.post.structure import Region, pair_bins, region_of
from multicor_cli.post.sums import Spread, note_on_bins, of_sums
from multicor_cli.post.table import Column, Table

KINDS = {"both": "C", "along": "C of v_x", "across": "C of v_y", "spin": "C of the spin"}
"""What is correlated, and what tables call it."""

LENGTHS = tuple("length" if kind == "both" else f"length_{kind}" for kind in KINDS)
"""Names of the correlation lengths."""

_WIDTH = 0.2  # of a bin, in mean diameters
_NOTHING = 1e-12  # of the speeds: smaller fluctuations are rounding


class VelocityCorrelation(Table):
    """Correlation of the velocity fluctuations of pairs of grains, ``b`` bins of their distance.

    C(r) = ⟨v'_i · v'_j⟩/⟨v'²⟩: the first mean is over the pairs at the distance r in all frames,
    the second over the grains of the region. v' is the velocity relative to the mean flow of the
    frames: of a cell that which strains it, otherwise as a function of the height
    (`multicor_cli.post.flow.MeanFlow`). The same of the components along x, the direction of the
    flow, and across it; and of spins relative to their mean, in a cell that of all grains. In a
    cell all v' add up to 0: so C is negative somewhere.

    The correlation length is the first distance at which C falls below 1/e, on straight lines from
    C(0) = 1 through the middles of the bins.

    Attributes:
        distance: Centers of the bins over the mean diameter; bins without pairs are left out.
        r: The same [m], shape ``(b,)``.
        both, along, across, spin: C of velocities, of their components, of spins, ``(b,)``.
        error_both, …: Standard errors, nan with too few frames to tell, shape ``(b,)``.
        pairs: Number of pairs in all frames, shape ``(b,)``.
        length, length_along, length_across, length_spin: Correlation lengths in mean diameters, nan
            where C stays above 1/e; ``error_length`` and so on, standard errors.
        fluctuation: √⟨v'²⟩ [m/s].
        mean_diameter: Mean diameter d̄ [m].
        grain_count: Grains that count, averaged over the frames.
        margin: What is left out at sides that are not periodic, in mean diameters.
        note: How many bins of C of velocities drift, or have too few frames for good errors.
    """


def correlation(
    source: Run,
    selection: Selection | None = None,
    reach: float | None = None,
    bins: int | None = None,
    *,
    margin: float | None = None,
) -> VelocityCorrelation:
    """The correlation of velocity fluctuations with the distance of the grains.

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage.
        reach: Largest distance in mean diameters; default: 10, or what the region allows.
        bins: Number of bins; default: 5 per mean diameter.
        margin: Mean diameters left out at sides that are not periodic, counted from the outermost
            centers; default: 1.

    Raises:
        PostError: As `multicor_cli.post.structure.pair_correlation`; or if nothing moves beside the
            mean flow.
        StoreError: If the run cannot be read.
    """
    diameter = source.model.mean_diameter
    chosen, edge, count, width = pair_bins(source, selection, reach, bins, margin, _WIDTH)
    fluctuations, fastest = _fluctuations(source, chosen), 0.0
    found = []
    for frame in frames_of(source, chosen):
        fastest = max(fastest, float(np.abs(np.asarray(frame.velocity)[:, :2]).max()))
        here = region_of(source.model, frame, edge)
        found.append(_sums(here, fluctuations(frame), width * diameter, count))
    rows = np.array(found)
    known = np.flatnonzero(rows[:, 4:].sum(axis=0)[:count])
    n, x, y = rows[:, :3].sum(axis=0).tolist()
    if not known.size:
        raise PostError("there are no two grains in the region: lower --margin")
    fluctuation = float(np.sqrt((x + y) / n))
    if not fluctuation > _NOTHING * fastest:
        raise PostError("nothing moves beside the mean flow in these frames: choose others")
    distance = np.asarray(width * (known + 1.0), np.float64)
    times = times_of(source, chosen)
    value, spreads = of_sums(lambda sums: _derive(sums, count, known, distance), rows, times)
    columns = [Column("distance", "1", distance, "r/d"), Column("r", "m", distance * diameter)]
    lengths: dict[str, float] = {}
    for k, (kind, label) in enumerate(KINDS.items()):
        at = slice(len(KINDS) + k * known.size, len(KINDS) + (k + 1) * known.size)
        columns.append(Column(kind, "1", value[at], label))
        columns.append(Column(f"error_{kind}", "1", spreads.error[at], "standard error"))
        lengths |= {LENGTHS[k]: float(value[k]), f"error_{LENGTHS[k]}": float(spreads.error[k])}
    pairs = rows[:, 4:].sum(axis=0)[known].astype(np.int64)
    columns.append(Column("pairs", "", pairs))
    facts = {
        "mean_diameter": diameter, **lengths, "fluctuation": fluctuation,
        "grain_count": n / chosen.size, "margin": edge, **frames_told(source, chosen),
        "note": note_on_bins(Spread(*(each[len(KINDS) :][: known.size] for each in spreads))),
    }  # fmt: skip
    return VelocityCorrelation(columns, facts, frames=chosen)


def _fluctuations(source: Run, chosen: NDArray[np.int64]) -> Callable[[Frame], Floats]:
    """What gives velocities and spins relative to the mean flow in a frame, shape ``(n, 3)``."""
    if source.model.is_cell:
        mean = np.mean([float(np.mean(frame.spin)) for frame in frames_of(source, chosen)])
        return lambda frame: np.column_stack([relative_velocity(frame), frame.spin - mean])
    bins = make_bins(source, chosen)
    flow = mean_flow(source, chosen, bins)

    def turning(frame: Frame) -> Any:
        return RelativeFrame(frame, np.column_stack([frame.spin, np.zeros(len(frame.spin))]))

    weighted = ((turning(frame), frame.model.disc_radius**2) for frame in frames_of(source, chosen))
    spins = fit_flow(bins.extent, min(bins.width, source.model.mean_diameter), weighted)
    return lambda frame: np.column_stack(
        [flow.fluctuation(frame), spins.fluctuation(turning(frame))[:, 0]]
    )


def _sums(region: Region, moving: Floats, width: float, count: int) -> Floats:
    """Grains, and squares of what ``moving`` ``(n, 3)`` has along x, y and of spin; then in bins
    around ``width`` [m], twice as much, … pairs and their products of each.
    """
    own = moving[region.which].T.copy()
    sums = pair_sums(region.points, region.lattice, width, count, own)
    return np.concatenate([[own.shape[1]], (own**2).sum(axis=1), sums.ravel()])


def _derive(sums: Floats, count: int, known: NDArray[np.int64], distance: Floats) -> Floats:
    """Correlation lengths [d̄], and C in the ``known`` bins, of each of `KINDS`."""
    n, squares = sums[..., :1], sums[..., 1:4]
    pairs, x, y, spin = (
        sums[..., 4 + k * count : 4 + (k + 1) * count][..., known] for k in range(4)
    )
    both = squares[..., 0] + squares[..., 1]
    of_all = zip((x + y, x, y, spin), (both, *np.moveaxis(squares, -1, 0)), strict=True)
    found = [products / pairs / (square[..., np.newaxis] / n) for products, square in of_all]
    lengths = np.stack([correlation_length(distance, c) for c in found], axis=-1)
    return np.concatenate([lengths, *found], axis=-1)


def correlation_length(distance: Floats, correlations: Floats) -> Floats:
    """First distances at which correlations ``(…, b)`` fall below 1/e; nan where they do not."""
    level = np.exp(-1.0)
    c = np.concatenate([np.ones((*correlations.shape[:-1], 1)), correlations], axis=-1)
    r, is_below = np.concatenate([[0.0], distance]), c < level
    after = np.maximum(is_below.argmax(axis=-1), 1)
    above, below = (
        np.take_along_axis(c, k[..., np.newaxis], axis=-1)[..., 0] for k in (after - 1, after)
    )
    part = (above - level) / np.where(is_below.any(axis=-1), above - below, np.nan)
    return np.asarray(r[after - 1] + part * (r[after] - r[after - 1]))
