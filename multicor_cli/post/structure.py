"""How the grains are arranged: pair correlation function, and structure factor of a cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.post.lattice import Lattice, lattice_of, pair_sums
from multicor_cli.post.source import (
    BIN_LIMIT,
    Frame,
    PostError,
    Run,
    Selection,
    bin_count,
    chosen_frames,
    frames_of,
    frames_told,
    need_grains,
    places_of,
)
from multicor_cli.post.sums import Sums, average, drift_note
from multicor_cli.post.table import Column, Table

REACH = 10.0
"""Largest distance in mean diameters, unless told otherwise."""

MARGIN = 1.0
"""Mean diameters left out at sides that are not periodic, unless told otherwise."""

_WIDTH = 0.05  # of a bin, in mean diameters


class PairCorrelation(Table):
    """Pair correlation function g(r), pairs of grains over those of an ideal gas; ``b`` bins.

    The ideal gas has as many grains in the same region, independent of each other: g is 1 where
    chance places them. Bins have their centers at multiples of their width, so that grains of equal
    size that touch are in one bin, whatever their overlaps.

    The expected number of pairs between r and r + dr of n grains in a region of area A is
    ½ n(n − 1)/A² · 2πr γ(r) dr, with the area γ(r) of the region that lies in the region shifted by
    r, too, averaged over all directions (Illian, Penttinen, Stoyan & Stoyan, Statistical Analysis
    and Modelling of Spatial Point Patterns, 2008, chapter 4: edge correction by the isotropized
    set covariance). Of a cell γ = A, of a layer of width W (the period) and height h
    γ = W (h − 2r/π), of a rectangle γ = ab − 2r (a + b)/π + r²/π. The grains must fill the region
    evenly: those next to walls are left out by a margin, of a heap g is not 1 far away.

    Attributes:
        distance: Centers of the bins over the mean diameter, shape ``(b,)``.
        r: The same [m], shape ``(b,)``.
        g: Pair correlation function, frames weighted by their expected pairs, shape ``(b,)``.
        error: Standard errors, nan with too few frames to tell, shape ``(b,)``.
        pairs: Number of pairs in all frames, shape ``(b,)``.
        mean_diameter: Mean diameter d̄ [m].
        first_peak: Largest g of a bin.
        first_peak_error: Its standard error.
        first_peak_distance: Distance of this bin, in mean diameters.
        grain_count: Grains that count, averaged over the frames.
        region: Width and height of their region, averaged over the frames [m].
        margin: What is left out at sides that are not periodic, in mean diameters; 0 of a cell.
        note: How many bins drift, or have too few frames for good errors; empty if none.
        factor: A structure factor that is drawn beside, or None.
    """


def pair_correlation(
    source: Run,
    selection: Selection | None = None,
    reach: float | None = None,
    bins: int | None = None,
    *,
    margin: float | None = None,
) -> PairCorrelation:
    """The pair correlation function g(r) of the grains.

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage.
        reach: Largest distance in mean diameters; default: 10, or what the region allows.
        bins: Number of bins; default: 20 per mean diameter.
        margin: Mean diameters left out at sides that are not periodic, counted from the outermost
            centers; default: 1.

    Raises:
        PostError: If no frame is selected, or one has no grain; if ``reach`` is more than half of
            the height of a cell (the least one), the period, or the region; if ``margin`` is
            negative, leaves nothing, or is given for a cell.
        StoreError: If the run cannot be read.
    """
    diameter = source.model.mean_diameter
    chosen, edge, count, width = pair_bins(source, selection, reach, bins, margin, _WIDTH)
    distance, step = width * np.arange(1.0, count + 1.0), width * diameter
    found: list[Floats] = []
    ideal: list[Floats] = []
    sizes: list[tuple[int, float, float]] = []
    for frame in frames_of(source, chosen):
        here = region_of(source.model, frame, edge)
        found.append(pair_sums(here.points, here.lattice, step, count)[0])
        ideal.append(here.expected_pairs((np.arange(count + 1.0) + 0.5) * step))
        sizes.append((len(here.points), *here.sides))
    weight = np.array(ideal)
    if not weight.any():
        raise PostError("there are no two grains in the region: lower --margin")
    sums = Sums(np.array(found), weight, weight)
    g, error = average(sums)
    peak, size = int(np.argmax(g)), np.mean(sizes, axis=0).tolist()
    facts = {
        "mean_diameter": diameter, "first_peak": float(g[peak]),
        "first_peak_error": float(error[peak]), "first_peak_distance": float(distance[peak]),
        "grain_count": size[0], "region": size[1:], "margin": edge,
        **frames_told(source, chosen), "note": drift_note(sums),
    }  # fmt: skip
    columns = [
        Column("distance", "1", distance, "r/d"),
        Column("r", "m", distance * diameter),
        Column("g", "1", g),
        Column("error", "1", error, "standard error", "standard_error"),
        Column("pairs", "", sums.value.sum(axis=0).astype(np.int64)),
    ]
    return PairCorrelation(columns, facts, frames=chosen, factor=None)


class Region(NamedTuple):
    """Where pairs of a frame are counted, and the grains in it.

    Attributes:
        points: Centers of the grains [m], shape ``(n, 2)``.
        lattice: Where their images are.
        sides: Width and height [m].
        is_open: Whether pairs end at the sides to the left and right, and at those above and below.
        which: Numbers of the grains in the frame, shape ``(n,)``.
    """

    points: Floats
    lattice: Lattice
    sides: tuple[float, float]
    is_open: tuple[bool, bool]
    which: NDArray[np.int64]

    @property
    def limit(self) -> float:
        """Largest distance at which pairs are counted [m]."""
        ends = [side for side, is_open in zip(self.sides, self.is_open, strict=True) if is_open]
        return 0.5 * min(self.lattice.span, *ends) if ends else 0.5 * self.lattice.span

    def expected_pairs(self, edges: Floats) -> Floats:
        """Pairs of an ideal gas in bins between distances [m]; see `PairCorrelation`."""
        (a, b), (across, upwards) = self.sides, self.is_open
        within = np.pi * a * b * edges**2 - (4.0 / 3.0) * (b * across + a * upwards) * edges**3
        within += 0.5 * (across and upwards) * edges**4
        n, area = len(self.points), a * b
        return np.asarray(0.5 * n * (n - 1.0) / area**2 * np.diff(within))


def margin_of(model: Model, margin: float | None) -> float:
    """What is left out at sides that are not periodic, in mean diameters; see `pair_correlation`.

    Raises `PostError` of a negative margin, or of one in a cell.
    """
    if margin is not None and model.is_cell:
        raise PostError("a cell that is periodic in x and y has no sides: leave out --margin")
    if margin is not None and not margin >= 0.0:
        raise PostError(f"the margin {margin:g} must not be negative")
    return 0.0 if model.is_cell else MARGIN if margin is None else margin


def region_of(model: Model, frame: Frame, margin: float) -> Region:
    """The region of the grains of a frame, without ``margin`` mean diameters at open sides."""
    lattice = lattice_of(model, frame).reduced
    points = lattice.wrapped(places_of(frame))
    which, sides = np.arange(len(points)), [lattice.width, lattice.height]
    is_open = lattice.width <= 0.0, lattice.height <= 0.0
    for axis in np.flatnonzero(is_open):
        x, edge = points[:, axis], margin * model.mean_diameter
        low, high = x.min() + edge, x.max() - edge
        which = which[(x[which] >= low) & (x[which] <= high)]
        sides[axis] = max(float(high - low), 0.0)
    return Region(points[which], lattice, (sides[0], sides[1]), is_open, which)


def pair_bins(
    source: Run,
    selection: Selection | None,
    reach: float | None,
    bins: int | None,
    margin: float | None,
    wide: float,
) -> tuple[NDArray[np.int64], float, int, float]:
    """Where pairs are looked for: frames, margin, number and width of the bins [d̄].

    As `pair_correlation` is asked, but for bins about ``wide`` mean diameters; raises what it does.
    """
    edge = margin_of(source.model, margin)
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    limit = min(region_of(source.model, f, edge).limit for f in frames_of(source, chosen))
    return chosen, edge, *distance_bins(limit / source.model.mean_diameter, reach, bins, wide)


def distance_bins(
    limit: float, reach: float | None, bins: int | None, wide: float
) -> tuple[int, float]:
    """Number and width of bins whose last one ends below ``limit``; all in mean diameters.

    They are about ``wide`` and go to `REACH` unless told otherwise. Raises `PostError` of what does
    not fit.
    """
    if bins is not None:
        bins = bin_count(bins)
    if reach is None:
        if bins is None:
            bins = int(min(REACH / wide, limit / wide - 0.5))
            reach = bins * wide
        else:
            reach = min(REACH, limit / (1.0 + 0.5 / bins))
        if reach < 1.0:
            raise PostError(
                f"no pair correlation: the grains fill a region of only {2.0 * limit:.3g} mean "
                "diameters, and pairs are counted up to half of it; lower --margin, or choose "
                "other frames"
            )
        return bins, reach / bins
    if not 0.0 < reach < np.inf:
        raise PostError(f"the largest distance {reach:g} must be positive")
    count = bins or max(round(min(reach / wide, BIN_LIMIT)), 1)
    if reach * (1.0 + 0.5 / count) > limit * (1.0 + 1e-9):
        raise PostError(
            f"--reach {reach:g} is too far: the last bin ends at half of the least height of the "
            f"region of the grains, {limit:.4g} mean diameters"
        )
    return count, reach / count


# ---- The static structure factor: what waves the grains of a cell scatter

WAVE_NUMBER = 30.0
"""Largest wave number, times the mean diameter."""

_SHELL = 0.2  # width of a shell of wave numbers, times the mean diameter
_GRID = 2**26  # points of the largest grid of a transform
_KERNEL = 10  # points of the grid that a grain is spread over, either way
_SHAPE = 2.3 * _KERNEL  # β of the kernel
_TERMS = 40  # of its power series: the rest is below rounding


class StructureFactor(Table):
    """Static structure factor S(k) of the grains of a cell; ``b`` shells of wave numbers.

    S(k) = |Σ exp(−i k·r)|²/n, averaged over all reciprocal lattice vectors of the cell in a shell
    but 0, and over the frames. It is 1 of an ideal gas, and n at the reciprocal lattice vectors of
    a crystal; at small k it is how the number of grains varies in large parts of the cell.

    Attributes:
        wave_number: Mean wave number of a shell, times the mean diameter, shape ``(b,)``.
        k: The same [1/m], shape ``(b,)``.
        S: Structure factor, shape ``(b,)``.
        error: Standard errors, nan with too few frames to tell, shape ``(b,)``.
        vectors: Pairs k, −k of vectors in all frames, shape ``(b,)``.
        mean_diameter: Mean diameter d̄ [m].
        grain_count: Grains, averaged over the frames.
        note: How many shells drift, or have too few frames for good errors; empty if none.
    """


def structure_factor(
    source: Run, selection: Selection | None = None, bins: int | None = None
) -> StructureFactor:
    """The static structure factor S(k) of the grains of a cell, up to k d̄ = 30.

    In cells that are wider than some 400 mean diameters it ends earlier. Shells without a vector
    are left out.

    Args:
        source: The run, of a cell.
        selection: Which frames; default: the later half of the last stage.
        bins: Number of shells; default: of the width 0.2/d̄.

    Raises:
        PostError: If the run is none of a cell, no frame is selected, or one has no grain.
        StoreError: If the run cannot be read.
    """
    model = source.model
    if not model.is_cell:
        raise PostError(
            "a structure factor needs a cell that is periodic in x and y, whose waves fit into it: "
            'give [domain] periodic = ["x", "y"]; otherwise leave out --factor'
        )
    if bins is not None:
        bin_count(bins)
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    diameter = model.mean_diameter
    largest = max(
        lattice.width * np.hypot(lattice.tilt, lattice.height)
        for lattice in (lattice_of(model, frame).reduced for frame in frames_of(source, chosen))
    )
    limit = min(WAVE_NUMBER / diameter, 0.5 * np.pi * float(np.sqrt(_GRID / largest)))
    count = max(round(limit * diameter / _SHELL), 1) if bins is None else bins
    rows, counts = [], []
    for frame in frames_of(source, chosen):
        points = places_of(frame)
        rows.append(_shells(points, lattice_of(model, frame).reduced, limit, count))
        counts.append(len(points))
    scattered, vectors, waves = np.array(rows).transpose(1, 0, 2)
    known = vectors.sum(axis=0) > 0.0
    sums = Sums(scattered[:, known], vectors[:, known], vectors[:, known])
    value, error = average(sums)
    number = sums.weight.sum(axis=0)
    k = waves.sum(axis=0)[known] / number
    facts = {
        "mean_diameter": diameter,
        "grain_count": float(np.mean(counts)),
        **frames_told(source, chosen), "note": drift_note(sums),
    }  # fmt: skip
    columns = [
        Column("wave_number", "1", k * diameter, "k d"),
        Column("k", "1/m", k),
        Column("S", "1", value),
        Column("error", "1", error, "standard error", "standard_error"),
        Column("vectors", "", number.astype(np.int64)),
    ]
    return StructureFactor(columns, facts, frames=chosen)


def _shells(points: Floats, lattice: Lattice, limit: float, count: int) -> Floats:
    """Sums of S, of vectors and of wave numbers [1/m] in shells up to ``limit``, ``(3, count)``."""
    turn = 2.0 * np.pi
    most = limit / turn * np.array([lattice.width, np.hypot(lattice.tilt, lattice.height)])
    right, up = most.astype(np.int64).tolist()
    m, n = np.arange(-right, right + 1)[:, np.newaxis], np.arange(up + 1)
    # k·a is 2πm with the lattice vector a to the right, 2πn with that upwards
    k_x = turn * m / lattice.width
    k = np.sqrt(k_x**2 + ((turn * n - k_x * lattice.tilt) / lattice.height) ** 2)
    counting = (k < limit) & ((n > 0) | (m > 0))  # k and −k scatter alike
    shell = (k[counting] * (count / limit)).astype(np.int64)
    found = amplitudes(points, lattice, right, up)[counting]
    value = (found.real**2 + found.imag**2) / len(points)
    weights = (value, None, k[counting])
    return np.array([np.bincount(shell, weight, count)[:count] for weight in weights])


def amplitudes(points: Floats, lattice: Lattice, right: int, up: int) -> NDArray[np.complex128]:
    """Σ exp(−i k·r) over points [m] for the reciprocal lattice vectors with k·a = 2πm, 2πn.

    a are the lattice vectors to the right and upwards, −``right`` ≤ m ≤ ``right``, 0 ≤ n ≤ ``up``.
    A fast Fourier transform of the points, spread over a grid twice as fine with Kaiser–Bessel
    functions, whose transform is divided out (Jackson, Meyer, Nishimura & Macovski, IEEE Trans.
    Med. Imaging 10, 473, 1991): its errors are below 10⁻⁸ of the number of points.

    Returns:
        Complex amplitudes, shape ``(2 right + 1, up + 1)``.
    """
    points = points[np.argsort(points[:, X])]  # what is spread together lies together
    y = points[:, Y] / lattice.height
    parts = np.column_stack([(points[:, X] - lattice.slant * points[:, Y]) / lattice.width, y])
    sizes = [_fast_length(max(4 * most + 2, 2 * _KERNEL)) for most in (right, up)]
    places, weights = [], []
    for part, size in zip(parts.T, sizes, strict=True):
        at = part * size
        place = np.ceil(at - 0.5 * _KERNEL)[:, np.newaxis] + np.arange(_KERNEL)
        away = (place - at[:, np.newaxis]) / (0.5 * _KERNEL)
        places.append(place.astype(np.int64) % size)
        weights.append(_kernel(np.maximum(1.0 - away**2, 0.0)))
    place = places[0][:, :, np.newaxis] * sizes[1] + places[1][:, np.newaxis]
    weight = weights[0][:, :, np.newaxis] * weights[1][:, np.newaxis]
    grid = np.bincount(place.ravel(), weight.ravel(), sizes[0] * sizes[1]).reshape(sizes)
    m, n = np.arange(-right, right + 1), np.arange(up + 1)
    # Waves that nobody asks for are left out of the second transform
    found = np.fft.fft(np.fft.rfft(grid)[:, : up + 1], axis=0)[m]
    return np.asarray(found / (_spread(m / sizes[0])[:, np.newaxis] * _spread(n / sizes[1])))


def _kernel(u: Floats) -> Floats:
    """I₀(β √u) for 0 ≤ u ≤ 1 by its power series, which takes a third of the time of np.i0."""
    found = np.ones_like(u)
    for k in range(_TERMS, 0, -1):
        found *= u
        found *= (0.5 * _SHAPE / k) ** 2
        found += 1.0
    return found


def _spread(frequency: Floats) -> Floats:
    """Fourier transform of the kernel at frequencies per point of the grid."""
    root = np.sqrt(_SHAPE**2 - (np.pi * _KERNEL * frequency) ** 2)
    return np.asarray(_KERNEL * np.sinh(root) / root)


def _fast_length(least: int) -> int:
    """The next length that fast transforms like."""
    return min(factor << (-(-least // factor) - 1).bit_length() for factor in (1, 3, 5, 15))
