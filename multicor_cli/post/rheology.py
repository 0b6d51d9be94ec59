"""Rheology of the bulk of a layer sheared between two walls, and of a cell without walls."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import cell
from multicor_cli.model.columns import XX, XY, YY, X
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Between, Bins, Extent, find_extent, heights, make_bins
from multicor_cli.post.bulk import (
    CONTACT_SUMS,
    INERTIAL_NUMBERS,
    OF_CONTACTS,
    SIZE_SUMS,
    Band,
    contact_sums,
    derive_contacts,
    find_band,
    inertial_numbers,
    refuse_walls_of_cell,
    size_sums,
    strain_and_spin,
)
from multicor_cli.post.contacts import has_forces
from multicor_cli.post.flow import CellFlow, MeanFlow, mean_flow
from multicor_cli.post.lattice import Strains, lattice_of, relative_velocity, strains_of
from multicor_cli.post.rings import cut_of
from multicor_cli.post.source import (
    Frame,
    PostError,
    Run,
    Selection,
    bounds_of_intervals,
    chosen_frames,
    frames_of,
    need_same_grains,
    need_two,
    times_of,
)
from multicor_cli.post.table import Quantity, TimeTable, average_ratios, sums_between

# ---- A layer: what is summed over its bulk between two frames

SUM_NAMES = (
    "lapse", "rate", "spin", "solid", "area", "kinetic", "weight", "stress_area", *CONTACT_SUMS,
    *SIZE_SUMS,
)  # fmt: skip
"""Names of the sums of `interval_sums`."""


def interval_sums(
    band: Band, flow: MeanFlow | CellFlow, first: Frame, second: Frame, lapse: float
) -> Floats:
    """The sums `SUM_NAMES` over the bulk between two frames that are ``lapse`` apart [s].

    Velocity and spin are displacements over the interval: no fluctuation in between is missed. The
    rest belongs to the second frame; what belongs to contacts is zero if it has none.
    """
    need_same_grains(first, second)
    model = second.model
    low, high = band.edges(second)
    y, cut, everyone = heights(second), cut_of(model, second), np.arange(model.grain_count)
    solid = cut.below(everyone, high - y) - cut.below(everyone, low - y)
    inside = (y > low) & (y < high)
    slip = flow.fluctuation(second)[inside]
    motion = (lapse, *strain_and_spin(band, model, first, second))
    bulk = (solid.sum(), (high - low) * model.period, 0.5 * (slip**2).sum(), inside.sum())
    area = bulk[1] if has_forces(second) else 0.0
    contacts = contact_sums(model, second, inside, low, high)
    return np.array([*motion, *bulk, area, *contacts, *size_sums(model)])


# ---- A layer: what is measured, and its averages

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
        values: Each of `QUANTITIES` over time by name, nan where not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        margin: What is left out next to the surface of each wall [m].
        height: Distance of the walls [m].
        walls: Names of the lower and upper wall.
    """


def rheology(
    source: Run,
    selection: Selection | None = None,
    *,
    margin: float | None = None,
    between: Between | None = None,
) -> Rheology | CellRheology:
    """Measure the rheology of a layer between two walls that shear it, or of a cell without walls.

    For a cell see `CellRheology`. Between walls the shear rate is
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
    chosen = chosen_frames(source, selection)
    chosen = bounds_of_intervals(source, chosen)
    if source.model.is_cell:
        refuse_walls_of_cell(margin, between)
        return cell_rheology(source, chosen)
    extent = find_extent(source, chosen, between)
    direction = _check_shear(source, extent, chosen)
    band = find_band(source.model, extent, margin)
    times = times_of(source, chosen)
    flow = mean_flow(source, chosen, make_bins(source, chosen))
    pairs = zip(pairwise(frames_of(source, chosen)), np.diff(times).tolist(), strict=True)
    rows = [interval_sums(band, flow, *pair, lapse) for pair, lapse in pairs]
    sums = np.column_stack([np.array(rows), _sum_walls(source, extent, times)])
    model, names = source.model, source.model.walls.names
    found = average_ratios(lambda rows: _derive(model.period, rows, direction), sums, times)
    assert extent.lower is not None
    assert extent.upper is not None
    return Rheology.of_frames(
        source, chosen, QUANTITIES, found, walls=(names[extent.lower], names[extent.upper]),
        height=extent.height, margin=band.margin,
    )  # fmt: skip


def _check_shear(source: Run, extent: Extent, chosen: NDArray[np.int64]) -> float:
    """+1 if the upper wall moves towards +x relative to the lower one, else −1."""
    if extent.lower is None or extent.upper is None:
        raise PostError("rheology needs a wall below and a wall above the grains that shear them")
    if not source.model.period > 0.0:
        raise PostError(
            "rheology needs a domain that is periodic in x: between side walls there is no "
            "homogeneous shear"
        )
    need_two(chosen, "rheology needs two frames")
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
    rows = np.column_stack([duration, duration * shear, duration * press])
    return sums_between(np.asarray(series["time"]), times, rows)


def _derive(period: float, sums: Floats, direction: float) -> dict[str, Floats]:
    """Each quantity of `QUANTITIES` from rows of sums."""
    s = dict(zip(_COLUMNS, sums.T, strict=True))
    rate = s["rate"] / s["lapse"]
    pressure = s["normal_impulse"] / s["window"] / period
    return {
        "shear_rate": rate,
        "pressure": pressure,
        **inertial_numbers(s, rate, pressure),
        "friction_walls": direction * s["shear_impulse"] / s["normal_impulse"],
        "friction_bulk": -direction * s["xy"] / s["yy"],
        "bulk_stress_yy": s["yy"] / s["stress_area"],
        "solid_fraction": s["solid"] / s["area"],
        **derive_contacts(s),
        "spin_ratio": s["spin"] / s["rate"],
        "granular_temperature": s["kinetic"] / s["weight"],
    }


# ---- A cell

_AXES = ("xx", "yy", "xy")

CELL_QUANTITIES = (
    Quantity("shear_rate", "shear rate", r"\dot\gamma", "1/s"),
    Quantity("dilation_rate", "rate at which the area grows", r"\dot\varepsilon_v", "1/s"),
    Quantity("flow_deviation", "deviation from a linear mean flow", r"\delta"),
    Quantity("pressure", "pressure (σ_xx + σ_yy)/2", "P", "N/m"),
    Quantity("deviator", "largest shear stress q", "q", "N/m"),
    *(Quantity(f"stress_{k}", f"stress {k}", rf"\sigma_{{{k}}}", "N/m") for k in _AXES),
    *(
        Quantity(
            f"kinetic_stress_{k}",
            f"  of this kinetic stress {k}",
            rf"\sigma^\mathrm{{kin}}_{{{k}}}",
            "N/m",
        )
        for k in _AXES
    ),
    *INERTIAL_NUMBERS,
    Quantity("friction", "friction μ = |σ_xy|/P", r"\mu"),
    Quantity("normal_difference", "normal stress difference (σ_xx − σ_yy)/P", r"N_1/P"),
    Quantity("solid_fraction", "solid fraction", r"\nu"),
    *OF_CONTACTS,
    Quantity(
        "spin_over_flow",
        "mean spin over that of the flow, −rate/2",
        r"-2\langle\omega\rangle/\dot\gamma",
    ),
    Quantity("granular_temperature", "granular temperature", "T_g", "m2/s2"),
)
"""What `cell_rheology` measures, in the order of the table."""

_OF_SERIES = (
    "window", "area", *(f"{of}_{k}" for of in ("stress", "contact", "strain") for k in _AXES),
)  # fmt: skip
_OF_FRAMES = (
    "lapse", "cover", "turn", "sheared", "kinetic", "weight", *CONTACT_SUMS, *SIZE_SUMS,
)  # fmt: skip


class CellRheology(TimeTable):
    """Rheology of a cell over time and on average; ``r`` intervals between consecutive frames.

    Stresses (compression positive) and rates of strain are means over the rows of the time series
    that end between two frames, so that no step is missed; stresses are those of the contacts,
    Σ f⊗ℓ, and of the fluctuations, Σ m c⊗c, over the area of the cell, with the velocities c
    relative to the mean flow. Spins are rotations between two frames; the rest belongs to the
    second of them.

    q = √(¼(σ_xx − σ_yy)² + σ_xy²). Friction in an interval is negative if σ_xy has another sign
    there than on average. I and the quantities of contacts are those of
    `Rheology`, with P = ½(σ_xx + σ_yy). A spin over that of the flow of
    1 is that of grains that turn with it. The deviation δ is the root mean square of c_x, averaged
    over time in bins one mean diameter high, over |γ̇| H/√12, that of γ̇ y: 0 where the flow is
    linear, 1 where it slips in one plane, and of a single interval mostly chance.

    Attributes:
        values: Each of `CELL_QUANTITIES` over time by name, nan where not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        width: Mean width of the cell [m].
        height: Mean height [m].
    """


def cell_rheology(source: Run, chosen: NDArray[np.int64]) -> CellRheology:
    """The rheology of a cell from the frames ``chosen``; raises `PostError` with fewer than two."""
    need_two(chosen, "rheology needs two frames")
    model, bins = source.model, make_bins(source, chosen)
    times, strains = times_of(source, chosen), strains_of(source)
    ways = np.diff(times), np.diff(strains.at(times)[0][:, XY])
    pairs = zip(pairwise(frames_of(source, chosen)), *(way.tolist() for way in ways), strict=True)
    rows = [_of_frames(bins, *pair, *way) for pair, *way in pairs]
    sums = np.column_stack([_of_series(source, strains, times), np.array(rows)])
    shear = float(sums[:, _OF_SERIES.index("stress_xy")].sum())
    found = average_ratios(
        lambda rows: _derive_cell(bins.extent.height, float(np.sign(shear)), rows),
        sums,
        times,
    )
    widths = [lattice_of(model, frame).width for frame in frames_of(source, chosen)]
    return CellRheology.of_frames(
        source, chosen, CELL_QUANTITIES, found, width=float(np.mean(widths)),
        height=bins.extent.height,
    )  # fmt: skip


def _of_series(source: Run, strains: Strains, times: Floats) -> Floats:
    """Sums `_OF_SERIES` over the windows that end in each interval, shape ``(r, …)``."""
    series = source.series
    duration = np.asarray(series["window_duration"])
    sides = np.asarray(series["wall_position"])[:, 0]
    virial = np.asarray(series["virial_rate"])
    contact = (virial[:, 0, 0], virial[:, 1, 1], virial[:, 0, 1])
    area = cell.over_windows(sides[:, XX] * sides[:, YY])
    columns = [np.ones(len(area)), area, *np.asarray(series["wall_force"])[:, 0].T, *contact]
    strain = np.diff(strains.strain, axis=0, prepend=0.0)
    rows = np.column_stack([duration[:, np.newaxis] * np.column_stack(columns), strain])
    return sums_between(np.asarray(series["time"]), times, rows)


def _of_frames(bins: Bins, first: Frame, second: Frame, lapse: float, sheared: float) -> Floats:
    """Sums `_OF_FRAMES`, then c_x times area and area of the grains in each bin."""
    model = second.model
    slip, everywhere = relative_velocity(second), np.ones(model.grain_count, np.bool_)
    turn = np.asarray(second.angle, np.float64) - np.asarray(first.angle, np.float64)
    cover = 0.5 * lapse * (first.model.area.sum() + model.area.sum())
    motion = (lapse, cover, turn.mean(), sheared, 0.5 * (slip**2).sum(), len(slip))
    shares = bins.share(heights(second), cut_of(model, second), bins.place(second))
    moved = bins.total(shares, shares.area * slip[shares.grain, X])
    contacts = contact_sums(model, second, everywhere, -np.inf, np.inf)
    sizes = size_sums(model)
    return np.array([*motion, *contacts, *sizes, *moved, *bins.total(shares, shares.area)])


def _derive_cell(height: float, sign: float, sums: Floats) -> dict[str, Floats]:
    """Each of `CELL_QUANTITIES` from rows of sums; ``sign`` is that of the mean σ_xy."""
    names = (*_OF_SERIES, *_OF_FRAMES)
    s = dict(zip(names, sums.T, strict=False))
    moved, area = np.split(sums[:, len(names) :], 2, axis=1)
    stress = {k: s[f"stress_{k}"] / s["area"] for k in _AXES}
    rate, pressure = s["strain_xy"] / s["window"], 0.5 * (stress["xx"] + stress["yy"])
    half = 0.5 * (stress["xx"] - stress["yy"])
    deviation = np.sqrt(((moved / area) ** 2).mean(axis=1))
    return {
        "shear_rate": rate,
        "dilation_rate": (s["strain_xx"] + s["strain_yy"]) / s["window"],
        "flow_deviation": deviation / (np.abs(rate) * height / np.sqrt(12.0)),
        "pressure": pressure,
        "deviator": np.hypot(half, stress["xy"]),
        **{f"stress_{k}": stress[k] for k in _AXES},
        **{
            f"kinetic_stress_{k}": (s[f"stress_{k}"] - s[f"contact_{k}"]) / s["area"] for k in _AXES
        },
        **inertial_numbers(s, rate, pressure),
        "friction": sign * stress["xy"] / pressure,
        "normal_difference": 2.0 * half / pressure,
        "solid_fraction": s["cover"] / s["lapse"] * s["window"] / s["area"],
        **derive_contacts(s),
        "spin_over_flow": -2.0 * s["turn"] / s["sheared"],
        "granular_temperature": s["kinetic"] / s["weight"],
    }
