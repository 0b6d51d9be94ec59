"""What waves the grains of a cell scatter: the static structure factor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import BIN_LIMIT
from multicor_cli.post.lattice import Lattice, lattice_of
from multicor_cli.post.source import (
    PostError,
    Run,
    Selection,
    frames_of,
    frames_told,
    need_grains,
)
from multicor_cli.post.sums import Sums, average, drift_note
from multicor_cli.post.table import Column, Table

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
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
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
    if bins is not None and not 1 <= bins <= BIN_LIMIT:
        raise PostError(f"{bins} bins: choose between 1 and {BIN_LIMIT}")
    chosen = (selection or Selection()).indices(source.frames)
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
        points = np.asarray(frame.position, np.float64)[:, :2]
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
