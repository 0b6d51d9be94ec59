"""Profiles: averages of a field over horizontal bins and over frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.post.extent import find_extent
from multicor_cli.post.fields import FIELDS, Field
from multicor_cli.post.flow import RelativeFrame, mean_flow
from multicor_cli.post.source import FrameSource, GrainFrame, PostError, Selection
from multicor_cli.post.sums import Bins, Sums, Values, average, sum_means, sum_rates, sum_shares
from multicor_cli.state.model import Floats

BIN_LIMIT = 100_000


@dataclass(frozen=True)
class ProfileTable:
    """A profile over the height; ``b`` bins.

    The value of a bin is the average over the grains in it and over the frames, weighted by the area of each grain that lies in
    the bin. Rates and shares are per area of the plane instead (see `multicor_cli.post.fields.Kind`). The standard error comes from
    the scatter between up to ten blocks of consecutive frames (for rates: of intervals between frames); it is nan with one of
    them. Averages over bins that no grain has touched are nan.

    Attributes:
        field: What was averaged.
        y: Centers of the bins above the origin [m], or over the height if normalized, shape ``(b,)``.
        value: Averages in the unit of the field; if normalized, see `multicor_cli.post.fields.Scaling`; shape ``(b,)``.
        error: Standard errors, shape ``(b,)``.
        area: Area of the grains in each bin, averaged over the frames [m²], shape ``(b,)``.
        width: Width of a bin, in the unit of ``y``.
        height: Distance of the walls [m]; see `multicor_cli.post.extent.Extent`.
        wall_values: Averages of the field at the lower and upper wall; nan where there is none.
        walls: Names of the lower and upper wall; empty where there is none.
        shear_rate: Difference of the mean velocities of the upper and lower wall over their distance [1/s]; nan without them.
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
    shear_rate: float
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
            "shear_rate": self.shear_rate,
            "bin_width": self.width,
            "y": self.y.tolist(),
            "value": self.value.tolist(),
            "standard_error": self.error.tolist(),
            "area": self.area.tolist(),
        }

    def normalized(self) -> ProfileTable:
        """The same with y/H, and the field in a form without unit.

        A velocity or temperature goes from 0 at the lower wall to 1 at the upper wall (for a fixed lower wall and a velocity this
        is v/V with the velocity V of the upper wall). A spin is divided by the shear rate of the walls, (V_upper − V_lower)/H:
        grains that turn with a homogeneous shear flow have −1/2.

        Raises:
            PostError: If the field has no such form, there is no wall below or above the grains, or the walls do not differ.
        """
        if self.is_normalized:
            return self
        if self.field.scaling == "none":
            choice = ", ".join(name for name, field in FIELDS.items() if field.scaling != "none")
            raise PostError(f"there is no normalized {self.field.label}; choose from: {choice}")
        low, scale = self._shear_scale() if self.field.scaling == "shear" else self._wall_scale()
        return replace(
            self,
            y=self.y / self.height,
            value=(self.value - low) / scale,
            error=self.error / abs(scale),
            width=self.width / self.height,
            is_normalized=True,
        )

    def _wall_scale(self) -> tuple[float, float]:
        low, high = self.wall_values
        if not all(self.walls):
            raise PostError("normalizing needs a wall below and a wall above the grains")
        if not np.isfinite(low) or not np.isfinite(high):
            free = [name for name, value in zip(self.walls, self.wall_values, strict=True) if not np.isfinite(value)]
            raise PostError(f"normalizing needs a prescribed {self.field.label} of both walls; '{free[0]}' has none")
        if low == high:
            raise PostError(f"normalizing needs walls of different {self.field.label}; both have {low:g} {self.field.unit}")
        return low, high - low

    def _shear_scale(self) -> tuple[float, float]:
        if not np.isfinite(self.shear_rate):
            raise PostError("normalizing needs a wall below and a wall above the grains")
        if self.shear_rate == 0.0:
            raise PostError("normalizing needs walls of different velocity; they do not shear the grains")
        return 0.0, self.shear_rate


def profile(
    source: FrameSource,
    of: str = "velocity",
    selection: Selection | None = None,
    bins: int | None = None,
) -> ProfileTable:
    """Average a field over horizontal bins and frames.

    Rates come from the differences of consecutive frames, with the grains halfway between: they must not move by much more than
    a bin from frame to frame.

    Args:
        source: The run.
        of: Name of the field, one of `FIELDS`.
        selection: Which frames; default: the later half of the last stage.
        bins: Number of bins; default: as many as make a bin about one mean diameter wide.

    Raises:
        PostError: If there is no such field, no frame (for a rate: fewer than two), or no sensible number of bins; or if the
            field needs heat and the run has none.
        StoreError: If the run cannot be read.
    """
    field = FIELDS.get(of)
    if field is None:
        raise PostError(f"there is no profile of '{of}'; choose from: {', '.join(FIELDS)}")
    chosen = (selection or Selection()).indices(source.frames)
    field.of_grains(source.frames[int(chosen[0])], source.model)  # a run without heat is refused for that reason before others
    if field.kind == "rate" and chosen.size < 2:
        raise PostError(f"{field.label} is a rate and needs two frames; only one is selected: choose more with --from or --frames")
    bins_ = make_bins(source, chosen, bins)
    sums = _SUMS[field.kind](source, chosen, bins_, _values_of(source, field, chosen, bins_))
    value, error = average(sums)
    extent = bins_.extent
    walls, speeds = _at_walls(source, field, chosen, (extent.lower, extent.upper))
    times = np.asarray(source.frames.time)[chosen]
    names = source.model.walls.names
    return ProfileTable(
        field=field,
        y=bins_.centers,
        value=value,
        error=error,
        area=sums.area.mean(axis=0),
        width=bins_.width,
        height=extent.height,
        wall_values=walls,
        walls=tuple("" if w is None else names[w] for w in (extent.lower, extent.upper)),  # type: ignore[arg-type]
        shear_rate=(speeds[1] - speeds[0]) / extent.height,
        frames=chosen,
        times=(float(times[0]), float(times[-1])),
    )


_SUMS: dict[str, Callable[[FrameSource, NDArray[np.int64], Bins, Values], Sums]] = {
    "mean": sum_means,
    "rate": sum_rates,
    "share": sum_shares,
}


def make_bins(source: FrameSource, chosen: NDArray[np.int64], bins: int | None = None) -> Bins:
    """Bins over the extent of the frames ``chosen``, each about one mean diameter wide unless their number is given.

    Raises:
        PostError: If there are too few or too many.
    """
    extent = find_extent(source, chosen)
    count = bins if bins is not None else max(round(extent.height / source.model.mean_diameter), 1)
    if not 1 <= count <= BIN_LIMIT:
        raise PostError(f"{count} bins: choose between 1 and {BIN_LIMIT}")
    return Bins(extent, extent.height / count, count)


def _values_of(source: FrameSource, field: Field, chosen: NDArray[np.int64], bins: Bins) -> Values:
    if not field.is_relative:
        return lambda frame: np.asarray(field.of_grains(frame, source.model), np.float64)
    flow = mean_flow(source, chosen, bins)

    def values(frame: GrainFrame) -> Floats:
        relative = RelativeFrame(frame, flow.fluctuation(frame, bins.extent.origin(frame)))
        return field.of_grains(relative, source.model)

    return values


def _at_walls(
    source: FrameSource, field: Field, chosen: NDArray[np.int64], walls: tuple[int | None, int | None]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Means over the frames of the field and of the velocity at the lower and upper wall; nan where there is none."""
    found = np.full((chosen.size, 2, 2), np.nan)
    for row, k in enumerate(chosen):
        frame = source.frames[int(k)]
        for side, wall in enumerate(walls):
            if wall is not None:
                found[row, 1, side] = frame.wall_velocity[wall, 0]
                if field.of_walls is not None:
                    found[row, 0, side] = field.of_walls(frame, source.model)[wall]
    (low, high), (below, above) = found.mean(axis=0).tolist()
    return (low, high), (below, above)
