"""Profiles: averages of a field over horizontal bins and over frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.post.binning import share_discs
from multicor_cli.post.extent import Extent, find_extent
from multicor_cli.post.fields import FIELDS, Field
from multicor_cli.post.source import FrameSource, PostError, Selection
from multicor_cli.state.model import Floats

BLOCKS = 10
"""Number of blocks of consecutive frames whose scatter gives the standard error (fewer if there are fewer frames)."""

BIN_LIMIT = 100_000


@dataclass(frozen=True)
class ProfileTable:
    """A profile over the height; ``b`` bins.

    The value of a bin is the average over the grains in it and over the frames, weighted by the area of each grain that lies in
    the bin. The standard error comes from the scatter between up to `BLOCKS` blocks of consecutive frames; it is nan with one
    frame. Bins that no grain has touched have the value nan.

    Attributes:
        field: What was averaged.
        y: Centers of the bins above the origin [m], or over the height if normalized, shape ``(b,)``.
        value: Averages in the unit of the field, or from 0 at the lower to 1 at the upper wall if normalized, shape ``(b,)``.
        error: Standard errors, shape ``(b,)``.
        area: Area of the grains in each bin, averaged over the frames [m²], shape ``(b,)``.
        width: Width of a bin, in the unit of ``y``.
        height: Distance of the walls [m]; see `multicor_cli.post.extent.Extent`.
        wall_values: Averages of the field at the lower and upper wall; nan where there is none.
        walls: Names of the lower and upper wall; empty where there is none.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
        is_normalized: Whether ``y`` and ``value`` are normalized.
    """

    field: Field
    y: Floats
    value: Floats
    error: Floats
    area: Floats
    width: float
    height: float
    wall_values: tuple[float, float]
    walls: tuple[str, str]
    frames: NDArray[np.int64]
    times: tuple[float, float]
    is_normalized: bool = False

    @property
    def units(self) -> tuple[str, str]:
        """Units of ``y`` and ``value``; ``1`` if normalized."""
        return ("1", "1") if self.is_normalized else ("m", self.field.unit)

    @property
    def headings(self) -> tuple[str, str, str, str]:
        """Names of the columns of `rows` with their units."""
        y, value = (f" [{unit}]" for unit in self.units)
        return f"y{y}", f"{self.field.name}{value}", f"standard error{value}", "area [m2]"

    @property
    def rows(self) -> list[tuple[float, float, float, float]]:
        """Height, value, standard error and area of every bin; nan where there is none."""
        columns = (self.y, self.value, self.error, self.area)
        return list(zip(*(column.tolist() for column in columns), strict=True))

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        return {
            "of": self.field.name,
            "unit": self.units[1],
            "y_unit": self.units[0],
            "normalized": self.is_normalized,
            "frame_count": int(self.frames.size),
            "times": list(self.times),
            "height": self.height,
            "walls": list(self.walls),
            "wall_values": list(self.wall_values),
            "bin_width": self.width,
            "y": self.y.tolist(),
            "value": self.value.tolist(),
            "standard_error": self.error.tolist(),
            "area": self.area.tolist(),
        }

    def normalized(self) -> ProfileTable:
        """The same with y/H, and the field from 0 at the lower wall to 1 at the upper wall.

        For a fixed lower wall and a velocity this is v/V with the velocity V of the upper wall.

        Raises:
            PostError: If there is no wall below or above the grains, or the field is the same at both.
        """
        low, high = self.wall_values
        if self.is_normalized:
            return self
        if not np.isfinite(low) or not np.isfinite(high):
            raise PostError("normalizing needs a wall below and a wall above the grains")
        if low == high:
            raise PostError(f"normalizing needs walls of different {self.field.label}; both have {low:g} {self.field.unit}")
        return replace(
            self,
            y=self.y / self.height,
            value=(self.value - low) / (high - low),
            error=self.error / abs(high - low),
            width=self.width / self.height,
            is_normalized=True,
        )


def profile(
    source: FrameSource,
    of: str = "velocity",
    selection: Selection | None = None,
    bins: int | None = None,
) -> ProfileTable:
    """Average a field over horizontal bins and frames.

    Args:
        source: The run.
        of: Name of the field, one of `FIELDS`.
        selection: Which frames; default: the later half of the last stage.
        bins: Number of bins; default: as many as make a bin about one mean diameter wide.

    Raises:
        PostError: If there is no such field, no frame, or no sensible number of bins.
        StoreError: If the run cannot be read.
    """
    field = FIELDS.get(of)
    if field is None:
        raise PostError(f"there is no profile of '{of}'; choose from: {', '.join(FIELDS)}")
    chosen = (selection or Selection()).indices(source.frames)
    extent = find_extent(source, chosen)
    count = bins if bins is not None else round(extent.height / source.model.mean_diameter)
    count = max(count, 1) if bins is None else count
    if not 1 <= count <= BIN_LIMIT:
        raise PostError(f"{count} bins: choose between 1 and {BIN_LIMIT}")
    width = extent.height / count
    area, weighted, walls = _sum_frames(source, field, chosen, extent, width, count)
    value, error = _average(area, weighted)
    times = np.asarray(source.frames.time)[chosen]
    names = source.model.walls.names
    return ProfileTable(
        field=field,
        y=np.asarray((np.arange(count) + 0.5) * width),
        value=value,
        error=error,
        area=area.mean(axis=0),
        width=width,
        height=extent.height,
        wall_values=(float(walls[0]), float(walls[1])),
        walls=tuple("" if w is None else names[w] for w in (extent.lower, extent.upper)),  # type: ignore[arg-type]
        frames=chosen,
        times=(float(times[0]), float(times[-1])),
    )


def _sum_frames(
    source: FrameSource, field: Field, chosen: NDArray[np.int64], extent: Extent, width: float, count: int
) -> tuple[Floats, Floats, Floats]:
    """Areas and area-weighted sums per frame and bin, shape ``(frames, bins)``, and the mean values at the two walls."""
    area, weighted = np.zeros((chosen.size, count)), np.zeros((chosen.size, count))
    at_walls = np.full((chosen.size, 2), np.nan)
    radius = source.model.grains.radius
    for row, k in enumerate(chosen):
        frame = source.frames[int(k)]
        values = np.asarray(field.of_grains(frame, source.model), np.float64)
        y = np.asarray(frame.position, np.float64)[:, 1]
        shares = share_discs(y, radius, extent.origin(frame), width, count)
        area[row] = np.bincount(shares.bin, weights=shares.area, minlength=count)
        weighted[row] = np.bincount(shares.bin, weights=shares.area * values[shares.grain], minlength=count)
        if field.of_walls is not None:
            of_walls = field.of_walls(frame, source.model)
            at_walls[row] = [np.nan if w is None else of_walls[w] for w in (extent.lower, extent.upper)]
    return area, weighted, at_walls.mean(axis=0)


def _average(area: Floats, weighted: Floats) -> tuple[Floats, Floats]:
    """Means over the frames and their standard errors from block averages."""
    frames = area.shape[0]
    blocks = np.array_split(np.arange(frames), min(BLOCKS, frames))
    with np.errstate(invalid="ignore", divide="ignore"):
        value = weighted.sum(axis=0) / area.sum(axis=0)
        means = np.array([weighted[block].sum(axis=0) / area[block].sum(axis=0) for block in blocks])
        known = np.isfinite(means)
        number = known.sum(axis=0)
        deviation = np.where(known, means, 0.0) - np.where(known, means, 0.0).sum(axis=0) / number
        variance = (np.where(known, deviation, 0.0) ** 2).sum(axis=0) / (number - 1)
        error = np.sqrt(variance / number)
    error[number < 2] = np.nan
    return value, error
