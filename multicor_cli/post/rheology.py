"""Rheology of the bulk of a layer sheared between two walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, ShapeKind
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import (
    Between,
    Extent,
    area_below,
    find_extent,
    heights,
    make_bins,
)
from multicor_cli.post.cell_rheology import CellRheology, cell_rheology
from multicor_cli.post.contacts import has_forces
from multicor_cli.post.flow import CellFlow, MeanFlow, mean_flow
from multicor_cli.post.rheology_sums import (
    CONTACT_SUMS,
    INERTIAL_NUMBERS,
    OF_CONTACTS,
    average_ratios,
    contact_sums,
    derive_contacts,
    inertial_numbers,
)
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bounds_of_intervals,
    frames_of,
    frames_told,
    model_of,
    need_same_grains,
)
from multicor_cli.post.table import Quantity, TimeTable

# ---- The bulk, far enough from both walls, and what is summed over it between two frames

MARGIN = 8.0
"""Mean diameters next to a wall that are no bulk: a rough wall disturbs the spins that far."""

_LARGEST = 0.25
"""Margin of a thin layer over the distance of the walls."""
_CLEAR = 1.0 / 3.0
"""Margin between large glued grains over what is free between the surfaces of the walls."""

SUM_NAMES = (
    "lapse", "rate", "spin", "solid", "area", "kinetic", "weight", "stress_area", *CONTACT_SUMS,
)  # fmt: skip
"""Names of the sums of `interval_sums`."""


@dataclass(frozen=True)
class Band:
    """The heights between which the bulk lies.

    Attributes:
        bottom: What is left out above the line of the lower wall [m].
        top: What is left out below the line of the upper wall [m].
        margin: What is left out next to the surface of each wall [m].
    """

    extent: Extent
    bottom: float
    top: float
    margin: float

    def edges(self, frame: Frame) -> tuple[float, float]:
        """Lowest and highest y of the bulk [m]; raises `PostError` if the walls come too near."""
        floor, span = self.extent.origin(frame), self.extent.span(frame)
        if not self.bottom + self.top < span:
            raise PostError(
                f"no bulk is left between the walls where they come nearest, {span:.4g} m: lower "
                "--margin, or choose other frames"
            )
        return floor + self.bottom, floor + span - self.top


def find_band(model: Model, extent: Extent, margin: float | None) -> Band:
    """The bulk between two walls, ``margin`` mean diameters off their surfaces; see `rheology`.

    Raises:
        PostError: If the margin is negative or leaves nothing.
    """
    diameter = model.mean_diameter
    if margin is not None and not margin >= 0.0:
        raise PostError(f"the margin {margin:g} must not be negative")
    below, above = _glued_radius(model, extent.lower), _glued_radius(model, extent.upper)
    if margin is None:
        clear = max(extent.height - below - above, 0.0)
        edge = min(MARGIN * diameter, _LARGEST * extent.height, _CLEAR * clear)
    else:
        edge = margin * diameter
    band = Band(extent, edge + below, edge + above, edge)
    if not band.bottom + band.top < extent.height:
        raise PostError(
            f"no bulk is left between the walls, {extent.height / diameter:.3g} mean diameters "
            "apart: lower --margin"
        )
    return band


def _glued_radius(model: Model, wall: int | None) -> float:
    """Mean radius of the grains glued to a wall [m]; 0 for a smooth wall."""
    glued = (model.shapes.wall == wall) & (model.shapes.kind == ShapeKind.DISC)
    return float(model.shapes.geometry[glued, 2].mean()) if glued.any() else 0.0


def interval_sums(
    source: Run, band: Band, flow: MeanFlow | CellFlow, first: Frame, second: Frame, lapse: float
) -> Floats:
    """The sums `SUM_NAMES` over the bulk between two frames that are ``lapse`` apart [s].

    Velocity and spin are displacements over the interval: no fluctuation in between is missed. The
    rest belongs to the second frame; what belongs to contacts is zero if it has none.
    """
    need_same_grains(first, second)
    model = model_of(source, second)
    low, high = band.edges(second)
    y, radius = heights(second), model.grains.radius
    solid = area_below(high - y, radius) - area_below(low - y, radius)
    inside = (y > low) & (y < high)
    slip = flow.fluctuation(second)[inside]
    motion = (lapse, *strain_and_spin(band, model, first, second))
    bulk = (solid.sum(), (high - low) * model.period, 0.5 * (slip**2).sum(), inside.sum())
    area = bulk[1] if has_forces(second) else 0.0
    return np.array([*motion, *bulk, area, *contact_sums(model, second, inside, low, high)])


def strain_and_spin(band: Band, model: Model, first: Frame, second: Frame) -> tuple[float, float]:
    """Strain and rotation of the bulk in an interval; the grains are where they are halfway."""
    edges = np.mean([band.edges(first), band.edges(second)], axis=0)
    y = 0.5 * (heights(first) + heights(second))
    inside = (y > edges[0]) & (y < edges[1])
    if np.count_nonzero(inside) < 2:
        raise PostError("there are no two grains in the bulk: lower --margin")
    turn = _change(first, second, "angle")
    way = _change(first, second, "position") + model.period * _change(first, second, "image")
    # The slope of the least-squares line
    x, away = y[inside] - y[inside].mean(), way[inside] - way[inside].mean()
    square = float((x * x).sum())
    strain = float((x * away).sum()) / square if square > 0.0 else math.nan
    # It weighs the local shear with (y − low)(high − y); so must the rotation.
    weight = ((y - edges[0]) * (edges[1] - y))[inside]
    return strain, float(np.average(turn[inside], weights=weight))


def _change(first: Frame, second: Frame, name: str) -> Floats:
    """How much an array of the grains (its first column) differs between two frames."""
    before, after = (np.asarray(getattr(frame, name), np.float64) for frame in (first, second))
    change = after - before
    return np.asarray(change if change.ndim == 1 else change[:, 0])


# ---- What is measured there, and its averages


QUANTITIES = (
    Quantity("shear_rate", "shear rate in the bulk", r"\dot\gamma", "1/s"),
    Quantity("pressure", "normal force of the walls per length", "P", "N/m"),
    *INERTIAL_NUMBERS,
    Quantity("friction_walls", "friction μ*, from the walls", r"\mu^*_\mathrm{walls}"),
    Quantity(
        "friction_bulk", "friction μ*, from contact stress in the bulk", r"\mu^*_\mathrm{bulk}"
    ),
    Quantity("bulk_stress_yy", "contact stress σ_yy in the bulk", r"\sigma_{yy}", "N/m"),
    Quantity("solid_fraction", "solid fraction in the bulk", r"\nu"),
    *OF_CONTACTS,
    Quantity("spin_ratio", "mean spin over shear rate", r"\langle\omega\rangle/\dot\gamma"),
    Quantity("granular_temperature", "granular temperature", "T_g", "m2/s2"),
)
"""What `rheology` measures, in the order of the table."""

_COLUMNS = (*SUM_NAMES, "window", "shear_impulse", "normal_impulse")


class Rheology(TimeTable):
    """Rheology over time and on average; ``r`` intervals between consecutive frames.

    I = |γ̇| √(m/P) with the mean mass m of a grain and the force P per length [N/m] with which the
    walls press (the mean of both): the convention of da Cruz et al. (2005); of grains of several
    sizes m is the mean of their masses, not the mass of a grain of mean size.
    ``inertial_number_density`` is |γ̇| d̄/√(P/ρ) with the mass ρ of the grains per area that they
    cover, the convention of GDR MiDi (2004). The first is √(π/4) times the second for equal discs.
    Friction is μ* = −σ_xy/σ_yy for a positive shear rate, and positive where stress resists the
    shear; that of the walls is the mean of both shear forces over that of both normal forces.

    The solid fraction is the area of the free grains in the bulk (parts of grains included) over
    that of the bulk. Contacts are those that carry a force, those with walls included; Z averages
    over all grains whose center lies in the bulk, Z' over those with at least two contacts (the
    others are rattlers). The granular temperature is ½⟨v'·v'⟩ over all these grains, which count
    alike (see `multicor_cli.post.flow.MeanFlow`). The spin over the shear rate is −1/2 for grains
    that turn with the flow. The density of contact directions is (1 + a_c cos 2(θ − θ_c))/2π.

    Attributes:
        time: Ends of the intervals [s], shape ``(r,)``.
        values: Each of `QUANTITIES` over time by name, nan where not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        spread: Their standard errors and drifts; see `multicor_cli.post.sums.spread`.
        margin: What is left out next to the surface of each wall [m].
        height: Distance of the walls [m].
        walls: Names of the lower and upper wall.
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    KEYS = (
        "walls", "height", "margin", "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note", "time", "values",
    )  # fmt: skip


def rheology(
    source: Run,
    selection: Selection | None = None,
    *,
    margin: float | None = None,
    between: Between | None = None,
) -> Rheology | CellRheology:
    """Measure the rheology of a layer between two walls that shear it, or of a cell without walls.

    For a cell see `multicor_cli.post.cell_rheology.CellRheology`. Between walls the shear rate is
    the least-squares slope of the displacements of the bulk between two frames, the spin its mean
    rotation; wall forces are means over the rows of the time series that end between the two
    frames; the rest is taken at the second of them. A short interval at the end of a stage is one
    with that before it (`multicor_cli.post.source.bounds_of_intervals`).

    Args:
        source: The run.
        selection: Which frames; default: the later half of the last stage.
        margin: Mean diameters next to the surface of each wall that are not bulk; default: 8, or if
            less a quarter of the distance of the walls or a third of that of their surfaces.
        between: Names of the walls below and above; default: those that bound the grains.

    Raises:
        PostError: If fewer than two frames are selected, there are no two walls that shear the
            grains, the domain is not periodic, or nothing is left between the margins; or if a
            cell is given a margin or walls.
        StoreError: If the run cannot be read.
    """
    chosen = (selection or Selection()).indices(source.frames)
    chosen = bounds_of_intervals(source, chosen)
    if source.model.is_cell:
        if margin is not None or between is not None:
            raise PostError(
                "a cell that is periodic in x and y has no walls: leave out --margin and --between"
            )
        return cell_rheology(source, chosen)
    extent = find_extent(source, chosen, between)
    direction = _check_shear(source, extent, chosen)
    band = find_band(source.model, extent, margin)
    times = np.asarray(source.frames.time)[chosen]
    flow = mean_flow(source, chosen, make_bins(source, chosen))
    pairs = zip(pairwise(frames_of(source, chosen)), np.diff(times).tolist(), strict=True)
    rows = [interval_sums(source, band, flow, *pair, lapse) for pair, lapse in pairs]
    sums = np.column_stack([np.array(rows), _sum_walls(source, extent, times)])
    model, names = source.model, source.model.walls.names
    found = average_ratios(lambda rows: _derive(model, rows, direction), sums, times)
    assert extent.lower is not None
    assert extent.upper is not None
    facts = {
        "margin": band.margin, "height": extent.height,
        "walls": (names[extent.lower], names[extent.upper]),
        **frames_told(source, chosen),
    }  # fmt: skip
    quantities = [q.over_time(found.values[q.name]) for q in QUANTITIES]
    parts: dict[str, Any] = {"mean": found.mean, "spread": found.spread, "frames": chosen}
    return Rheology(times[1:], quantities, facts, **parts)


def _check_shear(source: Run, extent: Extent, chosen: NDArray[np.int64]) -> float:
    """+1 if the upper wall moves towards +x relative to the lower one, else −1."""
    if extent.lower is None or extent.upper is None:
        raise PostError("rheology needs a wall below and a wall above the grains that shear them")
    if not source.model.period > 0.0:
        raise PostError(
            "rheology needs a domain that is periodic in x: between side walls there is no "
            "homogeneous shear"
        )
    if chosen.size < 2:
        raise PostError(
            "rheology needs two frames; only one is selected: choose more with --from or --frames"
        )
    speeds = [frame.wall_velocity[:, 0] for frame in frames_of(source, chosen)]
    relative = float(np.mean([speed[extent.upper] - speed[extent.lower] for speed in speeds]))
    if relative == 0.0:
        names = source.model.walls.names
        raise PostError(
            f"the walls '{names[extent.lower]}' and '{names[extent.upper]}' do not shear the "
            "grains in these frames"
        )
    return float(np.sign(relative))


def _sum_walls(source: Run, extent: Extent, times: Floats) -> Floats:
    """Windows that end in each interval [s], and impulses of the walls in them: shear, pressing."""
    series = source.series
    duration, force = np.asarray(series["window_duration"]), np.asarray(series["wall_force"])
    lower, upper = force[:, extent.lower], force[:, extent.upper]
    # Forces are those on the walls. Rows and frames of one step have times equal to the bit.
    shear, press = 0.5 * (lower[:, 0] - upper[:, 0]), 0.5 * (upper[:, 1] - lower[:, 1])
    interval = np.searchsorted(times, np.asarray(series["time"]), side="left") - 1
    inside = (interval >= 0) & (interval < times.size - 1)
    columns = (duration, duration * shear, duration * press)
    return np.column_stack(
        [np.bincount(interval[inside], c[inside], minlength=times.size - 1) for c in columns]
    )


def _derive(model: Model, sums: Floats, direction: float) -> dict[str, Floats]:
    """Each quantity of `QUANTITIES` from rows of sums."""
    s = dict(zip(_COLUMNS, sums.T, strict=True))
    rate = s["rate"] / s["lapse"]
    pressure = s["normal_impulse"] / s["window"] / model.period
    return {
        "shear_rate": rate,
        "pressure": pressure,
        **inertial_numbers(model, rate, pressure),
        "friction_walls": direction * s["shear_impulse"] / s["normal_impulse"],
        "friction_bulk": -direction * s["xy"] / s["yy"],
        "bulk_stress_yy": s["yy"] / s["stress_area"],
        "solid_fraction": s["solid"] / s["area"],
        **derive_contacts(s),
        "spin_ratio": s["spin"] / s["rate"],
        "granular_temperature": s["kinetic"] / s["weight"],
    }
