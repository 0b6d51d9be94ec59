"""Profiles: averages of a field over horizontal bins and over frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.columns import XY, X
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between, Bins, Shares, make_bins
from multicor_cli.post.contacts import with_forces
from multicor_cli.post.flow import RelativeFrame, mean_flow
from multicor_cli.post.lattice import gradient_of, lattice_of, velocity_at
from multicor_cli.post.quantities import PROFILE_GROUPS, PROFILED, SAME, GrainQuantity
from multicor_cli.post.rings import need_axes
from multicor_cli.post.source import (
    Frame,
    FrameOfGroups,
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
    frames_told,
    need_two,
    of_groups,
    times_of,
    with_frames_before,
)
from multicor_cli.post.sums import (
    Sums,
    Values,
    average,
    drift_note,
    plane_width,
    sum_contacts,
    sum_grains,
    sum_rates,
)
from multicor_cli.post.table import Column, Table
from multicor_cli.text import choices

_TWO_WALLS = "normalizing needs a wall below and a wall above the grains"


class ProfileTable(Table):
    """A profile over the height; ``b`` bins.

    The value of a bin is the average over the grains in it and over the frames, weighted by the
    area of each grain that lies in the bin. Rates, shares and stresses are per area of the plane
    instead, and coordination numbers an average over grains that count alike (see
    `multicor_cli.post.quantities`: `Kind`, and `QUANTITIES` for the quantities). Between two walls
    the bins move and stretch with the walls, so that in every frame they end at the walls. Those
    of a cell fill its height, and what reaches over one side of it counts at the other, with the
    velocity that its image has there.

    Standard errors hold what consecutive frames (for rates: intervals between frames) remember of
    each other; they are nan with too few frames to tell (see `multicor_cli.post.sums.spread`).
    Averages over bins that no grain has touched are nan.

    Attributes:
        field: What was averaged.
        y: Centers of the bins above the origin [m], or y/H if normalized, shape ``(b,)``.
        value: Averages in the unit of the field; if normalized, see
            `multicor_cli.post.quantities.Scaling`; shape ``(b,)``.
        error: Standard errors, shape ``(b,)``.
        area: Area of the grains in each bin, averaged over the frames [m²], shape ``(b,)``.
        width: Width of a bin, in the unit of ``y``.
        height: Distance of the walls [m]; see `multicor_cli.post.bins.Extent`.
        wall_values: Averages of the field at the lower and upper wall; nan where there is none.
        walls: Names of the lower and upper wall; empty where there is none.
        shear_rate: Mean V_upper − V_lower over the distance of the walls, or ∂v_x/∂y of a cell
            [1/s]; nan without them.
        is_normalized: Whether ``y`` and ``value`` are normalized.
        bin_area: Area of the plane that a bin covers, averaged over the frames [m²]. Times the sum
            of the values it gives what all bins hold, for values per area: the area of the grains,
            the heat per time [W], the sum of f ℓ [N m].
        left_out: What is left out at each wall, in mean diameters.
        note: How many bins drift, and by how much the worst does over the frames, in the unit of
            the field; empty if none does.
        groups: The groups of grains that count; empty: all.
        about_groups: Which they are, as `` of 'glass'``; empty for all.
    """

    @property
    def about_walls(self) -> str:
        """A line on what is left out at the walls; empty if nothing is."""
        walls = " and ".join(f"'{name}'" for name in self.walls if name)
        text = f"left out next to {walls}: {self.left_out:.3g} of a mean diameter"
        return text if walls and self.left_out else ""

    @property
    def units(self) -> tuple[str, str]:
        """Units of ``y`` and ``value``; ``1`` if normalized."""
        return self.facts["y_unit"], self.facts["unit"]

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        return {**super().as_dict(), "note": self.note, "groups": list(self.groups)}

    def normalized(self) -> ProfileTable:
        """The same with y/H, and the field in a form without unit.

        A velocity or temperature goes from 0 at the lower wall to 1 at the upper wall (for a fixed
        lower wall and a velocity this is v/V with the velocity V of the upper wall). A spin is
        divided by the shear rate of the walls, (V_upper − V_lower)/H: −1/2 if grains turn with it.

        Raises:
            PostError: If the field has no such form, a wall is missing, or the walls do not differ.
        """
        if self.is_normalized:
            return self
        if self.field.scaling == "none":
            choice = ", ".join(name for name, field in PROFILED.items() if field.scaling != "none")
            raise PostError(f"there is no normalized {self.field.label}; choose from: {choice}")
        if self.field.scaling == "walls":
            low, scale = self._wall_scale()
        else:
            low, scale = 0.0, self.shear_rate
            if not np.isfinite(scale):
                raise PostError(_TWO_WALLS)
            if scale == 0.0:
                raise PostError(
                    "normalizing needs walls of different velocity; they do not shear the grains"
                    if any(self.walls)
                    else "normalizing needs a cell that is sheared; this one is not"
                )
        width = self.width / self.height
        scaled = {"value": (self.value - low) / scale, "error": self.error / abs(scale)}
        words = {"unit": "1", "y_unit": "1", "normalized": True, "is_normalized": True}
        y = self.y / self.height
        table = self.with_(y=y, bin_width=width, width=width, **scaled, **words)
        *columns, area = table.columns
        table.columns = (*(column._replace(unit="1") for column in columns), area)
        return table

    def _wall_scale(self) -> tuple[float, float]:
        low, high = self.wall_values
        if not all(self.walls):
            raise PostError(_TWO_WALLS)
        for name, value in zip(self.walls, self.wall_values, strict=True):
            if not np.isfinite(value):
                raise PostError(
                    f"normalizing needs a prescribed {self.field.label} of both walls; '{name}' "
                    "has none, or not in all of these frames"
                )
        if low == high:
            raise PostError(
                f"normalizing needs walls of different {self.field.label}; both have {low:g} "
                f"{self.field.unit}"
            )
        return low, high - low


class ProfileSet(Table):
    """Profiles of several fields over the same bins and frames.

    Attributes:
        name: Name of the group, or of the only field.
        tables: The profiles; at least one.
    """

    def __init__(self, name: str, tables: Sequence[ProfileTable]) -> None:
        self.name, self.tables = name, tuple(tables)
        y, *own, area = self.first.columns
        if len(self.tables) > 1:
            own = []
            for k, table in enumerate(self.tables):
                labels = (table.field.name, f"error {table.field.name.rpartition('-')[2]}")
                own += [
                    column._replace(name=f"{column.name}_{k}", label=label)
                    for column, label in zip(table.columns[1:3], labels, strict=True)
                ]
        super().__init__([y, *own, area], {})

    @property
    def first(self) -> ProfileTable:
        """The first profile: bins, frames and walls are those of all."""
        return self.tables[0]

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON types; numbers may be nan."""
        if len(self.tables) == 1:
            return self.first.as_dict()
        common = {key: value for key, value in self.first.as_dict().items() if key not in _OWN}
        fields = {}
        for table in self.tables:
            data = table.as_dict()
            fields[table.field.name] = {key: data[key] for key in data if key in _OWN[1:]}
        return {"of": self.name, **common, "fields": fields}

    def normalized(self) -> ProfileSet:
        """The same in a form without unit; raises as `ProfileTable.normalized`."""
        return ProfileSet(self.name, [table.normalized() for table in self.tables])


_OWN = ("of", "unit", "wall_values", "value", "standard_error", "note")


def profile(
    source: Run,
    of: str = "velocity",
    selection: Selection | None = None,
    bins: int | None = None,
    *,
    bin_width: float | None = None,
    exclude_walls: float | None = None,
    between: Between | None = None,
    groups: Sequence[str] = (),
) -> ProfileTable:
    """Average a field over horizontal bins and frames.

    Rates come from the differences of consecutive frames, with the grains halfway between: they
    must not move by much more than a bin from frame to frame. Stresses and contacts come from the
    frames to which contact forces belong; the others are left out.

    Args:
        source: The run.
        of: Name of the field, one of `PROFILED`.
        selection: Which frames; default: the later half of the last stage.
        bins: Number of bins; default: as many as make a bin about ``bin_width`` wide.
        bin_width: Width in mean diameters, rounded so that a whole number fits; default: 1.
        exclude_walls: What to leave out at each wall, in mean diameters, counted as the heights
            are: from the line through the centers of glued grains, or from the surface of a smooth
            wall. Default: the layer next to the wall, `bins.WALL_LAYER`; between walls that are
            near, no more than an eighth of their distance.
        between: Names of the walls below and above; default: those that bound the grains.
        groups: Groups of grains that count; default: all. Fluctuations are those about the mean
            flow of all grains. Coordination numbers include contacts with grains of other groups;
            of the stress in a contact between two grains each has half.

    Raises:
        PostError: If there is no such field, no frame (for a rate: fewer than two), or no sensible
            number of bins; or if the field needs heat or contacts and the run has none.
        StoreError: If the run cannot be read.
    """
    if of in PROFILE_GROUPS:
        raise PostError(
            f"'{of}' has several components: choose one of {', '.join(PROFILE_GROUPS[of])}"
        )
    return profiles(
        source, of, selection, bins, bin_width=bin_width, exclude_walls=exclude_walls,
        between=between, groups=groups
    ).first  # fmt: skip


def profiles(
    source: Run,
    of: str = "velocity",
    selection: Selection | None = None,
    bins: int | None = None,
    *,
    bin_width: float | None = None,
    exclude_walls: float | None = None,
    between: Between | None = None,
    groups: Sequence[str] = (),
) -> ProfileSet:
    """As `profile`, for a field or for several at once, reading every frame once.

    Args:
        source: The run.
        of: Name of the field, one of `PROFILED`, or of one of `PROFILE_GROUPS`.
        selection: Which frames; default: the later half of the last stage.
        bins: Number of bins, as for `profile`.
        bin_width: Width of a bin in mean diameters, as for `profile`.
        exclude_walls: What to leave out at each wall, in mean diameters, as for `profile`.
        between: Names of the walls below and above, as for `profile`.
        groups: Groups of grains that count, as for `profile`.

    Raises:
        PostError: As `profile`.
    """
    fields = _find_fields(of)
    chosen = chosen_frames(source, selection)
    kind = fields[0].kind
    if any(field.needs_contacts for field in fields):
        chosen = with_forces(source, chosen)
    part, counted = source, chosen
    if any(field.since_before for field in fields):
        part, counted = with_frames_before(source, chosen)
    if groups:
        part = of_groups(part, groups)
    for field in fields:
        # a run without them is refused before anything else
        if field.needs_axes:
            need_axes(source.model)
        if field.averaged is not None and field.needs_heat:
            first = source.frames[int(chosen[0])]
            field.averaged(first, first.model)
    if kind == "rate":
        need_two(chosen, f"{fields[0].label} is a rate and needs two frames")
    bins_ = make_bins(
        source, chosen, bins, bin_width=bin_width, exclude_walls=exclude_walls, between=between
    )
    if kind == "contact":
        carried = [field.of_contacts for field in fields if field.of_contacts is not None]
        sums = sum_contacts(part, chosen, bins_, carried)
    else:
        values = _values_of(source, fields, chosen, bins_)
        if kind == "rate":
            sums = sum_rates(part, chosen, bins_, values)
        else:
            sums = sum_grains(part, counted, bins_, values, kind)
    tables = [
        _make_table(source, *pair, chosen, bins_, tuple(groups))
        for pair in zip(fields, sums, strict=True)
    ]
    return ProfileSet(of, tables)


def _find_fields(of: str) -> tuple[GrainQuantity, ...]:
    names = PROFILE_GROUPS.get(of, (SAME.get(of, of),))
    if names[0] not in PROFILED:
        known = [
            name for name in PROFILED if not any(name in group for group in PROFILE_GROUPS.values())
        ]
        raise PostError(f"there is no profile of '{of}'; {choices(of, [*known, *PROFILE_GROUPS])}")
    return tuple(PROFILED[name] for name in names)


def _make_table(
    source: Run,
    field: GrainQuantity,
    sums: Sums,
    chosen: NDArray[np.int64],
    bins: Bins,
    groups: tuple[str, ...],
) -> ProfileTable:
    value, error = average(sums, field.of_means)
    extent = bins.extent
    walls, speeds = _at_walls(source, field, chosen, (extent.lower, extent.upper))
    shear_rate = (speeds[1] - speeds[0]) / extent.height
    if extent.is_cell:
        rates = [gradient_of(frame)[XY] for frame in frames_of(source, chosen)]
        shear_rate = float(np.mean(rates))
    names = source.model.walls.names
    facts = {
        "of": field.name, "unit": field.unit, "y_unit": "m", "normalized": False,
        **frames_told(source, chosen),
        "height": extent.height,
        "walls": tuple("" if w is None else names[w] for w in (extent.lower, extent.upper)),
        "excluded_at_walls": bins.left_out / source.model.mean_diameter, "wall_values": walls,
        "shear_rate": shear_rate, "bin_width": bins.width,
        "bin_area": _bin_area(source, field, sums, chosen, bins),
    }  # fmt: skip
    of_groups = f" of {' and '.join(map(repr, groups))}" if groups else ""
    columns = [
        Column("y", "m", bins.centers),
        Column("value", field.unit, value, f"{field.name}{of_groups}"),
        Column("error", field.unit, error, "standard error", "standard_error"),
        Column("area", "m2", sums.area.mean(axis=0)),
    ]
    parts: dict[str, Any] = {
        "field": field, "frames": chosen, "is_normalized": False, "width": bins.width,
        "left_out": facts["excluded_at_walls"], "note": drift_note(sums, field.of_means),
        "groups": groups, "about_groups": of_groups,
    }  # fmt: skip
    return ProfileTable(columns, facts, **parts)


def _bin_area(
    source: Run, field: GrainQuantity, sums: Sums, chosen: NDArray[np.int64], bins: Bins
) -> float:
    """Area of a bin, averaged over the frames, or over the time of a rate [m²]."""
    if field.kind in ("mean", "number"):
        frames = frames_of(source, chosen)
        areas = [bins.place(frame).width * plane_width(source, frame) for frame in frames]
        return float(np.mean(areas))
    times = times_of(source, chosen)
    lapse = times[-1] - times[0] if field.kind == "rate" else chosen.size
    return float(sums.weight[:, 0].sum() / lapse)


def _values_of(
    source: Run, fields: tuple[GrainQuantity, ...], chosen: NDArray[np.int64], bins: Bins
) -> list[Values]:
    is_relative = any(field.is_relative for field in fields)
    flow = mean_flow(source, chosen, bins) if is_relative else None

    def values_of(field: GrainQuantity) -> Values:
        averaged = field.averaged
        assert averaged is not None

        def of_grains(frame: Frame) -> Floats:
            # Contacts with grains of other groups count too, and these as neighbors
            is_about_others = field.needs_contacts or field.of_others
            if is_about_others and isinstance(frame, FrameOfGroups):
                return of_grains(frame.whole)[frame.rows]
            moving: Any = frame
            if flow is not None:
                moving = RelativeFrame(frame, flow.fluctuation(frame))
            found = averaged(moving, frame.model)
            return np.asarray(found, np.complex128 if field.of_means else np.float64)

        def values(frame: Frame, shares: Shares) -> Floats:
            if field.of_velocity is None or not source.model.is_cell:
                return of_grains(frame)[shares.grain]
            # that of the image which is in the bin
            width, height, tilt = lattice_of(source.model, frame)
            way = shares.turn[:, np.newaxis] * np.array([tilt, height])
            place = np.asarray(frame.position, np.float64)[shares.grain, :2] - way
            place[:, X] %= width
            seen = velocity_at(frame, place, shares.grain)
            return np.asarray(field.of_velocity(seen), np.float64)

        return values

    return [values_of(field) for field in fields]


def _at_walls(
    source: Run,
    field: GrainQuantity,
    chosen: NDArray[np.int64],
    walls: tuple[int | None, int | None],
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Means over frames of field and velocity at the lower and upper wall; nan without one."""
    values = np.full((chosen.size, 2, 2), np.nan)
    for row, frame in enumerate(frames_of(source, chosen)):
        for side, wall in enumerate(walls):
            if wall is not None:
                values[row, 1, side] = frame.wall_velocity[wall, 0]
                if field.of_walls is not None:
                    values[row, 0, side] = field.of_walls(frame, source.model)[wall]
    (low, high), (below, above) = values.mean(axis=0).tolist()
    return (low, high), (below, above)
