"""Coarse-grained fields of a flow: over the plane, polar, along a line, or over rings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.post import field_sums
from multicor_cli.post.coarse import CoarseGrid
from multicor_cli.post.contacts import has_conduction, has_forces
from multicor_cli.post.grain_map import make_scene
from multicor_cli.post.lattice import lattice_of
from multicor_cli.post.rings import reach_of
from multicor_cli.post.source import (
    PostError,
    Run,
    Selection,
    chosen_frames,
    frames_of,
    frames_told,
    need_grains,
    places_of,
)
from multicor_cli.post.sums import pseudo_values, standard_errors
from multicor_cli.post.table import Column, Quantity, Table, split_unit, with_unit
from multicor_cli.text import choices

Center = tuple[float, float]

_LEAST_REACH = 0.01
"""Least reach of the kernel in mean diameters: what reaches no farther meets hardly a grain."""

_MOST_REACH = 1e4
"""Largest: more than any run is wide."""

_FAR = 1e6  # mean diameters from the grains up to which a center may lie
_MEMORY = 256_000_000  # bytes that the densities of blocks of frames may take
_FEWEST_AND_MOST = (8, 64)  # such blocks
_AT_ONCE = 4096  # points whose errors are made together


class FieldTable(Table):
    """Fields averaged over frames at ``p`` places: a grid (in JSON rows of columns), line or rings.

    Attributes:
        of: The fields that the table and the figure show.
        fields: All fields.
        points: Where.
        values: Every field by name, nan where no grain is near, shape ``(p,)``.
        error: Standard errors by name, shape ``(p,)``. Of grids they are made of 32 to 64 sums over
            consecutive frames if there are more, of fewer if there are so many points that these
            would fill the memory.
        reach: How far the kernel reaches [m].
        scene: Grains and walls of the last frame.
        note: From which ring on rings reach beyond the grains, if any does; else empty.
    """


def fields(
    source: Run,
    of: Sequence[str] = (),
    selection: Selection | None = None,
    *,
    spacing: float = 0.5,
    reach: float = 2.0,
    center: Center | None = None,
    along: tuple[Center, Center] | None = None,
    is_radial: bool = False,
) -> FieldTable:
    """Coarse-grained fields, averaged over frames: on a grid unless another place is asked for.

    Densities are averaged over the frames, and over rings, before velocities, temperatures and
    gradients are made of them. Near a wall part of the kernel lies beyond it: densities and
    stresses fall off within its reach, velocities and temperatures do not. Kinetic stress and
    granular temperature are those of velocities relative to the mean at the point, over time; a
    gradient of the mean counts too, with about the square of the reach. Glued grains do not count.
    The heat flux is that of contacts; see `multicor_cli.post.contacts.heat_flows`.

    Args:
        source: The run.
        of: Fields that the table of a line and figures show; default: solid fraction, or the
            velocities along a line. Along a line ``velocity``, ``stress``, ``strain-rate`` and
            ``kinetic-stress`` stand for all their components.
        selection: Which frames; default: the later half of the last stage. If forces belong to any
            of them, the others are left out; if to none, there are no stresses. Heat fluxes are
            there if all the rest have contacts and heat.
        spacing: Distance of the points in mean diameters.
        reach: How far the kernel reaches in mean diameters.
        center: Center of a polar grid or of rings [m]; then components are radial and azimuthal.
        along: The ends of a line [m] on which the fields are wanted.
        is_radial: Whether to average over rings about ``center``.

    Raises:
        PostError: If there is no such field, no frame, no grain, or no sensible number of points;
            if ``is_radial`` has no center, or a line has one.
        StoreError: If the run cannot be read.
    """
    diameter = source.model.mean_diameter
    if (is_radial and center is None) or (along is not None and center is not None):
        raise PostError("rings need a center; a line has none")
    chosen = chosen_frames(source, selection)
    need_grains(source, chosen)
    span = min(lattice_of(source.model, frame).span for frame in frames_of(source, chosen))
    _refuse_sizes(spacing, reach, diameter, span)
    with_stress = [k for k in chosen.tolist() if has_forces(source.frames[k])]
    has_stress = bool(with_stress)
    chosen = np.array(with_stress, np.int64) if has_stress else chosen
    points = _points(source, chosen, spacing * diameter, center, along, is_radial=is_radial)
    has_heat = source.model.thermal is not None
    has_flux = has_heat and all(map(has_conduction, frames_of(source, chosen)))
    there = field_sums.Known(has_heat, has_stress, has_flux)
    names, known = field_sums.column_names(there), tuple(field_sums.field_list(points.axes, there))
    default = ["solid-fraction"] if points.is_grid else [f"velocity-{axis}" for axis in points.axes]
    wanted = _wanted(of or default, known, is_grid=points.is_grid)
    blocks = Blocks(_most_rows(len(points.coordinates) * len(names)) if points.is_grid else None)
    coarse, sizes = None, list[float]()
    for frame in frames_of(source, chosen):
        sizes.append(frame.model.mean_diameter)  # grains may grow and wear
        lattice = lattice_of(source.model, frame)
        if coarse is None or coarse.lattice != lattice:
            coarse = CoarseGrid(points.at, reach * diameter, lattice)
        sums = field_sums.frame_sums(frame, points, coarse, there)
        blocks.add(sums)

    size = float(np.mean(sizes))

    def derive(sums: Floats) -> dict[str, Floats]:
        return field_sums.derive(sums, names, points.axes, size)

    values = derive(blocks.total / chosen.size)
    error = _errors(blocks, derive, [field.name for field in known])
    coordinates = [
        Column(*split_unit(name), points.coordinates[:, k]) for k, name in enumerate(points.names)
    ]
    note = _beyond(source, chosen, points, spacing * diameter) if is_radial else ""
    facts = {
        **frames_told(source, chosen),
        "reach": reach * diameter, "note": note, "axes": list(points.axes), "shape": points.shape,
        "units": {field.name: field.unit for field in known},
        **{column.name: column.values for column in coordinates},
        "values": {name: column.reshape(points.shape) for name, column in values.items()},
    }  # fmt: skip
    facts["standard_error"] = {name: each.reshape(points.shape) for name, each in error.items()}
    details = [*coordinates, *(Column(f.name, f.unit, values[f.name]) for f in known)]
    details += [
        Column(f"error_{f.name}", f.unit, error[f.name], f"error of {f.name}") for f in known
    ]
    if points.is_grid:  # a row for each field
        labels = [with_unit(field.label, field.unit) for field in known]
        finite = [values[field.name][np.isfinite(values[field.name])] for field in known]
        columns = [Column("quantity", "", labels, key="")]
        for name, of_all in (("mean", np.mean), ("smallest", np.min), ("largest", np.max)):
            found = [float(of_all(value)) if value.size else np.nan for value in finite]
            columns.append(Column(name, "", found, key=""))
        uncertain = [_median_ratio(error[f.name], values[f.name]) for f in known]
        columns.append(Column("relative", "", uncertain, "relative error", ""))
    else:  # a row for each place
        columns = [coordinates[0]._replace(key="")]
        for f in wanted:
            columns.append(Column(f"shown_{f.name}", f.unit, values[f.name], f.name, ""))
            columns.append(Column("errors", "", error[f.name], "standard error", ""))
    parts = {
        "of": wanted, "fields": known, "points": points, "values": values, "error": error,
        "frames": chosen, "scene": make_scene(source, source.frames[int(chosen[-1])]),
    }  # fmt: skip
    return FieldTable(columns, facts, details, **parts)


def _refuse_sizes(spacing: float, reach: float, diameter: float, span: float) -> None:
    if not (0.0 < spacing < np.inf and _LEAST_REACH <= reach <= _MOST_REACH):
        what = (
            "spacing and reach are numbers of mean diameters, spacing above 0 and reach from "
            f"{_LEAST_REACH:g} to {_MOST_REACH:g}"
        )
        raise PostError(f"{what}; they are {spacing:g} and {reach:g}")
    if reach * diameter > span:
        raise PostError(
            f"the kernel reaches {reach * diameter:.3g} m, beyond the period of {span:.3g} m: "
            "choose a shorter reach"
        )


def _wanted(of: Sequence[str], known: Sequence[Quantity], *, is_grid: bool) -> tuple[Quantity, ...]:
    """Fields by name; that of a vector or tensor stands for its components, but not on a grid."""
    names = {field.name: field for field in known}
    chosen: list[Quantity] = []
    for name in of:
        parts = [field for field in known if field.name.rpartition("-")[0] == name]
        components = [field for field in parts if len(field.name) - len(name) <= 3]
        if name not in names and not components:
            raise PostError(f"there is no field '{name}' here; {choices(name, names)}")
        if name not in names and is_grid:
            raise PostError(
                f"'{name}' has several components: choose one of "
                f"{', '.join(field.name for field in components)}"
            )
        chosen += [names[name]] if name in names else components
    return tuple(dict.fromkeys(chosen))


def _points(
    source: Run,
    chosen: NDArray[np.int64],
    spacing: float,
    center: Center | None,
    along: tuple[Center, Center] | None,
    *,
    is_radial: bool,
) -> field_sums.FieldPoints:
    if along is not None:
        return field_sums.line(*along, spacing)
    if center is not None:
        inner, outer = np.inf, 0.0  # how near to the center grains come, and how far they reach
        for frame in frames_of(source, chosen):
            radius = frame.model.grains.radius
            position = places_of(frame)
            away = np.hypot(*(position - np.array(center)).T)
            inner = min(inner, max(float((away - radius).min()), 0.0))
            outer = max(outer, float((away + radius).max()))
        if not inner < _FAR * source.model.mean_diameter:
            raise PostError(
                f"the center lies {inner:.3g} m away from all grains: choose one nearer"
            )
        around = field_sums.rings if is_radial else field_sums.polar_grid
        return around(center, inner, outer, spacing)
    if source.model.is_cell:
        lattice = lattice_of(source.model, source.frames[int(chosen[-1])])
        return field_sums.grid((0.0, 0.0), lattice[:2], spacing, lattice.slant)
    low, high = _box(source, chosen)
    if source.model.period > 0.0:
        low[0], high[0] = 0.0, source.model.period
    return field_sums.grid(low.tolist(), high.tolist(), spacing)


def _box(source: Run, chosen: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Lower left and upper right corner of a box that holds the grains in all frames [m]."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for frame in frames_of(source, chosen):
        position = places_of(frame)
        ends = position + reach_of(frame.model, frame)
        low, high = np.minimum(low, ends[0].min(axis=0)), np.maximum(high, ends[1].max(axis=0))
    return low, high


def _beyond(
    source: Run, chosen: NDArray[np.int64], points: field_sums.FieldPoints, spacing: float
) -> str:
    """A word on rings partly beyond the grains: their means are over what is empty there, too."""
    if source.model.is_cell:
        return ""
    low, high = _box(source, chosen)
    if source.model.period > 0.0:
        low[0], high[0] = -np.inf, np.inf
    outside = ((points.at < low - spacing) | (points.at > high + spacing)).any(axis=1)
    if not outside.any():
        return ""
    first = float(points.coordinates[points.row[outside].min(), 0])
    return (
        f"rings from r = {first:.4g} m on reach beyond the grains: their means are over what is "
        "empty there, too"
    )


class Blocks:
    """Rows added up in blocks of as many consecutive ones as leave no more than ``most`` sums.

    Attributes:
        rows: Sums of the blocks that are full, each of the shape of a row.
        size: How many rows each of them has.
    """

    def __init__(self, most: int | None = None) -> None:
        """All rows are kept if ``most``, an even number, is None."""
        self.rows: list[Floats] = []
        self.size, self._most, self._count = 1, most, 0
        self._partial = np.zeros(())

    @property
    def total(self) -> Floats:
        """Sum of all rows, those of a last block that is not full too."""
        return np.asarray(sum(self.rows, start=self._partial))

    def add(self, row: Floats) -> None:
        """Add a row."""
        if not self._count % self.size and len(self.rows) == self._most:
            self.rows = [
                first + second for first, second in zip(*[iter(self.rows)] * 2, strict=True)
            ]
            self.size *= 2
        if self._count % self.size:
            self._partial += row
        else:
            self._partial = row.copy()
        self._count += 1
        if not self._count % self.size:
            self.rows.append(self._partial)
            self._partial = np.zeros(())


def _most_rows(numbers: int) -> int:
    """How many rows of so many numbers may be kept: an even number."""
    return int(np.clip(_MEMORY // (8 * numbers), *_FEWEST_AND_MOST)) // 2 * 2


def _errors(
    blocks: Blocks, derive: Callable[[Floats], dict[str, Floats]], names: Sequence[str]
) -> dict[str, Floats]:
    """Standard errors of every field from what each block of frames adds to it."""
    count, size = len(blocks.rows), blocks.size
    places = len(blocks.rows[0])
    error = {name: np.full(places, np.nan) for name in names}
    if count < 2:
        return error
    for first in range(0, places, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        rows = np.array([row[part].T for row in blocks.rows]).swapaxes(1, 2)
        whole = rows.sum(axis=0)
        values = derive(whole / (count * size))
        without = derive((whole - rows) / ((count - 1) * size))
        for name in names:
            error[name][part] = standard_errors(pseudo_values(values[name], without[name]))
    return error


def _median_ratio(error: Floats, value: Floats) -> float:
    known = np.isfinite(error) & (value != 0.0)
    return float(np.median(error[known] / np.abs(value[known]))) if known.any() else np.nan
