"""Rheology of a cell that is periodic in x and y."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, cell
from multicor_cli.model.columns import XX, YY, X
from multicor_cli.model.model import Floats
from multicor_cli.post.bins import Bins, heights, make_bins
from multicor_cli.post.lattice import lattice_of, relative_velocity
from multicor_cli.post.rheology_sums import (
    CONTACT_SUMS,
    INERTIAL_NUMBERS,
    OF_CONTACTS,
    average_ratios,
    contact_sums,
    derive_contacts,
    inertial_numbers,
    sums_between,
)
from multicor_cli.post.source import Frame, PostError, Run, frames_of, frames_told
from multicor_cli.post.table import Quantity, TimeTable

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
_OF_FRAMES = ("lapse", "turn", "kinetic", "weight", *CONTACT_SUMS)


class CellRheology(TimeTable):
    """Rheology of a cell over time and on average; ``r`` intervals between consecutive frames.

    Stresses (compression positive) and rates of strain are means over the rows of the time series
    that end between two frames, so that no step is missed; stresses are those of the contacts,
    Σ f⊗ℓ, and of the fluctuations, Σ m c⊗c, over the area of the cell, with the velocities c
    relative to the mean flow. Spins are rotations between two frames; the rest belongs to the
    second of them.

    q = √(¼(σ_xx − σ_yy)² + σ_xy²). Friction in an interval is negative if σ_xy has another sign
    there than on average. I and the quantities of contacts are those of
    `multicor_cli.post.rheology.Rheology`, with P = ½(σ_xx + σ_yy). A spin over that of the flow of
    1 is that of grains that turn with it. The deviation δ is the root mean square of c_x, averaged
    over time in bins one mean diameter high, over |γ̇| H/√12, that of γ̇ y: 0 where the flow is
    linear, 1 where it slips in one plane, and of a single interval mostly chance.

    Attributes:
        time: Ends of the intervals [s], shape ``(r,)``.
        values: Each of `CELL_QUANTITIES` over time by name, nan where not known, shape ``(r,)``.
        mean: Averages over the intervals: ratios of sums, not means of ratios.
        spread: Their standard errors and drifts; see `multicor_cli.post.sums.spread`.
        width: Mean width of the cell [m].
        height: Mean height [m].
        frames: Indices of the frames.
        times: Times of the first and last frame [s].
    """

    KEYS = (
        "width", "height", "frame_count", "times",
        "units", "mean", "standard_error", "drift", "drift_error", "note", "time", "values",
    )  # fmt: skip


def cell_rheology(source: Run, chosen: NDArray[np.int64]) -> CellRheology:
    """The rheology of a cell from the frames ``chosen``; raises `PostError` with fewer than two."""
    if chosen.size < 2:
        raise PostError(
            "rheology needs two frames; only one is selected: choose more with --from or --frames"
        )
    model, bins = source.model, make_bins(source, chosen)
    times = np.asarray(source.frames.time)[chosen]
    pairs = zip(pairwise(frames_of(source, chosen)), np.diff(times).tolist(), strict=True)
    rows = [_of_frames(model, bins, *pair, lapse) for pair, lapse in pairs]
    sums = np.column_stack([_of_series(source, times), np.array(rows)])
    shear = float(sums[:, _OF_SERIES.index("stress_xy")].sum())
    found = average_ratios(
        lambda rows: _derive(model, bins.extent.height, float(np.sign(shear)), rows), sums, times
    )
    widths = [lattice_of(model, frame).width for frame in frames_of(source, chosen)]
    facts = {
        "width": float(np.mean(widths)), "height": bins.extent.height, **frames_told(source, chosen)
    }  # fmt: skip
    quantities = [q.over_time(found.values[q.name]) for q in CELL_QUANTITIES]
    parts: dict[str, Any] = {"mean": found.mean, "spread": found.spread, "frames": chosen}
    return CellRheology(times[1:], quantities, facts, **parts)


def _of_series(source: Run, times: Floats) -> Floats:
    """Sums `_OF_SERIES` over the windows that end in each interval, shape ``(r, …)``."""
    series = source.series
    duration = np.asarray(series["window_duration"])
    sides, rate = (np.asarray(series[f"wall_{of}"])[:, 0] for of in ("position", "velocity"))
    virial = np.asarray(series["virial_rate"])
    contact = (virial[:, 0, 0], virial[:, 1, 1], virial[:, 0, 1])
    area, rates = cell.over_windows(sides[:, XX] * sides[:, YY]), cell.over_windows(rate)
    columns = [np.ones(len(area)), area, *np.asarray(series["wall_force"])[:, 0].T, *contact]
    rows = duration[:, np.newaxis] * np.column_stack([*columns, *rates.T])
    return sums_between(np.asarray(series["time"]), times, rows)


def _of_frames(model: Model, bins: Bins, first: Frame, second: Frame, lapse: float) -> Floats:
    """Sums `_OF_FRAMES`, then c_x times area and area of the grains in each bin."""
    slip, everywhere = relative_velocity(second), np.ones(model.grain_count, np.bool_)
    turn = np.asarray(second.angle, np.float64) - np.asarray(first.angle, np.float64)
    motion = (lapse, turn.mean(), 0.5 * (slip**2).sum(), len(slip))
    shares = bins.share(heights(second), model.grains.radius, bins.place(second))
    moved = bins.total(shares, shares.area * slip[shares.grain, X])
    contacts = contact_sums(model, second, everywhere, -np.inf, np.inf)
    return np.array([*motion, *contacts, *moved, *bins.total(shares, shares.area)])


def _derive(model: Model, height: float, sign: float, sums: Floats) -> dict[str, Floats]:
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
        **inertial_numbers(model, rate, pressure),
        "friction": sign * stress["xy"] / pressure,
        "normal_difference": 2.0 * half / pressure,
        "solid_fraction": np.pi * (model.grains.radius**2).sum() * s["window"] / s["area"],
        **derive_contacts(s),
        "spin_over_flow": -2.0 * (s["turn"] / s["lapse"]) / rate,
        "granular_temperature": s["kinetic"] / s["weight"],
    }
