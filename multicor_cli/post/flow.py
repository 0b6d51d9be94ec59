"""The mean flow over the height, and how grains move beside it and beside their neighborhood."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import XY, X, Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.post.bins import Bins, Extent, heights, make_bins
from multicor_cli.post.lattice import (
    Lattice,
    gradient_of,
    lattice_of,
    near_pairs,
    relative_velocity,
)
from multicor_cli.post.source import (
    Frame,
    Run,
    SeenFrame,
    frames_of,
    need_same_grains,
    places_of,
)

_CELL_LIMIT = 1000
# Weight of the slopes beside that of the grains: it decides only what no grain does
_SMOOTHING = 1e-12


@dataclass(frozen=True)
class MeanFlow:
    """Mean velocity over the height: straight lines between knots a fixed part of it apart.

    The lines have the smallest squares of the fluctuations of the grains about them, each weighted
    by its area and placed at its center. So a velocity that is linear in the height is found
    exactly, up to the walls; an average over bins would leave part of the shear in the
    fluctuations. The outermost lines go on for one cell beyond the walls.

    Attributes:
        extent: Where heights are measured from; the knots move with the walls.
        velocity: Velocities at the knots from the origin to the full height [m/s], ``(k, 2)``.
    """

    extent: Extent
    velocity: Floats

    def fluctuation(self, frame: Frame) -> Floats:
        """Velocities of grains relative to the mean flow at their centers [m/s], ``(n, 2)``."""
        cell, part = _locate(frame, self.extent, len(self.velocity) - 1)
        part = part[:, np.newaxis]
        mean = (1.0 - part) * self.velocity[cell] + part * self.velocity[cell + 1]
        return np.asarray(_velocities(frame) - mean)


class CellFlow:
    """The mean flow of a cell, whose gradient every frame has."""

    def fluctuation(self, frame: Frame) -> Floats:
        """Velocities of grains relative to the mean flow at their centers [m/s], ``(n, 2)``."""
        return relative_velocity(frame)


@dataclass(frozen=True)
class RelativeFrame(SeenFrame):
    """A frame for profiles of fluctuations: velocity relative to the mean flow [m/s] ``(n, 2)``."""

    velocity: NDArray[Any]


def mean_flow(source: Run, chosen: NDArray[np.int64], bins: Bins) -> MeanFlow | CellFlow:
    """The mean flow over the frames ``chosen``, from wall to wall whatever the bins leave out.

    That of a cell is the one that strains it, in each frame.

    Its knots are as far apart as the bins, but not farther than a mean diameter: coarse bins would
    count the shear as fluctuation. Squares of fluctuations come out too small by about the number
    of knots over that of the grains, times that of the frames with independent velocities; so a
    single frame of a layer that is 20 grains long lacks one part in 20.
    """
    extent = bins.extent
    if extent.is_cell:
        return CellFlow()
    spacing = min(bins.width, source.model.mean_diameter)
    weighted = ((f, f.model.disc_radius**2) for f in frames_of(source, chosen))
    return fit_flow(extent, spacing, weighted)


def fit_flow(extent: Extent, spacing: float, weighted: Iterable[tuple[Frame, Floats]]) -> MeanFlow:
    """The mean flow of frames whose grains have weights, by knots about ``spacing`` apart [m]."""
    count = max(round(min(extent.height / spacing, _CELL_LIMIT)), 1)
    below, above, across, everything = np.zeros(count), np.zeros(count), np.zeros(count), 0.0
    right = np.zeros((count + 1, 2))
    for frame, weight in weighted:
        cell, part = _locate(frame, extent, count)
        everything += weight.sum()
        factors = ((1.0 - part) ** 2, part**2, part * (1.0 - part))
        for total, factor in zip((below, above, across), factors, strict=True):
            total += np.bincount(cell, weight * factor, minlength=count)
        for axis, speed in enumerate(_velocities(frame).T):
            right[:-1, axis] += np.bincount(cell, weight * (1.0 - part) * speed, minlength=count)
            right[1:, axis] += np.bincount(cell, weight * part * speed, minlength=count)
    smoothing = _SMOOTHING * everything / count
    # each cell adds to its lower knot, to its upper knot, and between the two
    beside = across - smoothing
    matrix = np.diag(beside, 1) + np.diag(beside, -1)
    own = np.append(below + smoothing, 0.0) + np.append(0.0, above + smoothing)
    matrix[np.diag_indices_from(matrix)] += own
    return MeanFlow(extent, np.asarray(np.linalg.solve(matrix, right), np.float64))


def fluctuations(source: Run, frame: int) -> Floats:
    """Velocities relative to the mean horizontal flow of the same frame [m/s], shape ``(n, 2)``.

    In a cell they are those relative to its mean flow.
    """
    chosen = np.array([frame])
    flow = mean_flow(source, chosen, make_bins(source, chosen))
    if isinstance(flow, MeanFlow):
        flow.velocity[:, 1] = 0.0
    return flow.fluctuation(source.frames[frame])


def _locate(frame: Frame, extent: Extent, count: int) -> tuple[NDArray[np.int64], Floats]:
    """Cell of each grain between two knots, and where in it the center is: 0 … 1, or −1 … 2."""
    place = (heights(frame) - extent.origin(frame)) * (count / extent.span(frame))
    cell = np.clip(np.floor(place).astype(np.int64), 0, count - 1)
    return cell, np.clip(place - cell, -1.0, 2.0)  # or one grain far away would outweigh all others


def _velocities(frame: Frame) -> Floats:
    return np.asarray(frame.velocity, np.float64)[:, :2]


# ---- How far grains move beside the deformation of their neighborhood: D² of Falk and Langer

NEIGHBORHOOD = 2.5
"""Mean diameters up to which grains are neighbors, in the earlier frame."""

_FEWEST = 3  # neighbors: a gradient of displacements can always be found that takes two along
_FLAT = 1e-9  # least ratio of the moments of a neighborhood that is no straight line


def d2min(model: Model, before: Frame, after: Frame, leant: float | None = None) -> Floats:
    """D²_min of each grain between two frames, per neighbor [m²], shape ``(n,)``.

    The least mean square of what the displacements of the neighbors relative to the grain, Δ, have
    beside G r, with their places r relative to it before and any one gradient G (Falk & Langer,
    Phys. Rev. E 57, 7192, 1998, equation 2.11, whose sum over neighbors is a mean here). Free
    grains are neighbors, up to `NEIGHBORHOOD` mean diameters before. nan of grains with fewer than
    three of them, or with all in a line.

    Args:
        model: The model of the grains.
        before: The earlier frame.
        after: The later one.
        leant: The stretch xy of a cell between them, about; default: by the rates of both frames.

    Raises:
        PostError: If grains have come or gone.
    """
    need_same_grains(before, after)
    lattice = lattice_of(model, before).reduced
    points = lattice.wrapped(places_of(before))
    moved = (
        _moved_in_cell(model, before, after, points, leant)
        if model.is_cell
        else _moved(before, after)
    )
    n, places = len(points), (len(points), 3)
    r_r, r_moved, squares = np.zeros(places), np.zeros((n, 2, 2)), np.zeros(n)
    number = np.zeros(n)
    reach = NEIGHBORHOOD * model.mean_diameter
    which, pairs = near_pairs(points, lattice, reach)
    for near in pairs:
        kept = np.abs(near.way) <= reach
        i, j = np.broadcast_to(near.i, kept.shape)[kept], which[near.image[kept]]
        r = near.way[kept].view(np.float64).reshape(-1, 2)
        away = moved(i, j)
        for grain in (i, j):  # with both signs turned, all sums are the same

            def add(values: Floats, grain: Any = grain) -> Floats:
                return np.asarray(np.bincount(grain, values, minlength=n), np.float64)

            number += np.bincount(grain, minlength=n)
            squares += add((away**2).sum(axis=1))
            for k, (a, b) in enumerate(((X, X), (X, Y), (Y, Y))):
                r_r[:, k] += add(r[:, a] * r[:, b])
            for a in (X, Y):
                for b in (X, Y):
                    r_moved[:, a, b] += add(away[:, a] * r[:, b])
    xx, xy, yy = r_r.T
    det = xx * yy - xy**2
    is_known = (number >= _FEWEST) & (det > _FLAT * (xx + yy) ** 2)
    divisor = np.where(is_known, det, 1.0)
    x, y = r_moved[:, :, X], r_moved[:, :, Y]
    explained = (
        x**2 * yy[:, np.newaxis] - 2.0 * x * y * xy[:, np.newaxis] + y**2 * xx[:, np.newaxis]
    ).sum(axis=1)
    left = np.maximum(squares - explained / divisor, 0.0)  # below zero is rounding
    return np.where(is_known, left / np.maximum(number, 1.0), np.nan)


Moved = Callable[[Any, Any], Floats]
"""Displacements of j relative to i, but for what is affine [m], shape ``(k, 2)``."""


def _moved(before: Frame, after: Frame) -> Moved:
    way = (np.asarray(f.unwrapped, np.float64)[:, :2] for f in (after, before))
    moved = next(way) - next(way)
    return lambda i, j: np.asarray(moved[j] - moved[i])


def _moved_in_cell(
    model: Model, before: Frame, after: Frame, points: Floats, leant: float | None
) -> Moved:
    """Beside the motion of the cell, which is affine and which its images follow.

    Nobody counts how often grains cross its sides: of all images the nearest is taken.
    """
    first, second = lattice_of(model, before), lattice_of(model, after)
    end = places_of(after)
    beside = end - points @ deformation(first, second, before, after, leant).T

    def moved(i: Any, j: Any) -> Floats:
        other = beside[j] - beside[i]
        up = np.round(other[:, Y] / second.height)
        other -= up[:, np.newaxis] * np.array([second.tilt, second.height])
        other[:, X] -= second.width * np.round(other[:, X] / second.width)
        return np.asarray(other)

    return moved


def deformation(
    first: Lattice, second: Lattice, before: Frame, after: Frame, leant: float | None = None
) -> Floats:
    """The tensor that takes a cell from one frame to the next, shape ``(2, 2)``.

    The tilt is known but for a multiple of the width: that is taken which ``leant``, as of `d2min`,
    comes nearest to.
    """
    xx, yy = second.width / first.width, second.height / first.height
    if leant is None:
        rate = 0.5 * float(gradient_of(before)[XY] + gradient_of(after)[XY])
        leant = rate * float(after.time - before.time) * yy
    tilt = xx * first.tilt + leant * first.height
    nearest = second.tilt + second.width * round((tilt - second.tilt) / second.width)
    return np.array([[xx, (nearest - xx * first.tilt) / first.height], [0.0, yy]])
