"""Study 4.1, figures 5 and 6: fourteen grains, one of them hot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from entry import Entry, Panel, Rows, on_axes, percent
from numpy.typing import NDArray

from multicor_cli import open_run
from multicor_cli.plots import plot
from multicor_cli.plots.style import COLORS, COLUMN
from multicor_cli.post import grain_map

Floats = NDArray[np.float64]

WATCHED = (0, 4, 13)
"""The grains that figure 5 shows: 1, 5 and 14 of the paper."""

_CURVE = Path(__file__).parents[1] / "lattice14" / "finite_elements.csv"
_MAP_SHARE = 17 / 100  # part of the run after which the map is taken: about C/H
_KELVIN = 273.15


def lattice_entries(path: Path) -> list[Entry]:
    """Figures 5 and 6 from a finished run of ``configs/lattice14.toml``."""
    with open_run(path) as run:
        times = np.asarray(run.frames.time, np.float64)
        celsius = (
            np.array([np.asarray(frame.temperature, np.float64) for frame in run.frames]) - _KELVIN
        )
        resolved = _read_curve(times)
        index = round(_MAP_SHARE * (times.size - 1))
        return [
            _figure_5(times, celsius, resolved, index),
            _figure_6(grain_map(run, "temperature", index), celsius),
        ]


def _read_curve(times: Floats) -> Floats:
    """Temperatures of the watched grains by finite elements at these times [°C], shape
    ``(m, 3)``.
    """
    lines = [line for line in _CURVE.read_text(encoding="utf-8").splitlines() if line[:1].isdigit()]
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    return np.column_stack([np.interp(times, table[:, 0], column) for column in table.T[1:]])


def _figure_5(times: Floats, celsius: Floats, resolved: Floats, index: int) -> Entry:
    lumped = celsius[:, WATCHED]
    share = np.abs(lumped - resolved) / np.ptp(celsius[0])
    rows: Rows = [
        (
            f"grain {grain + 1}",
            f"{lumped[index, k]:.2f}",
            f"{resolved[index, k]:.2f}",
            percent(share[:, k].max()),
            f"{times[share[:, k].argmax()]:.3g} s",
        )
        for k, grain in enumerate(WATCHED)
    ]
    differs = [
        (
            f"The largest difference from the finite elements is {percent(share.max())} of the "
            f"initial difference of {np.ptp(celsius[0]):.0f} K. Nearly all of it is the "
            "constriction of the heat towards the contacts: the conductance of Hertz holds for "
            "the whole way between two grains, and the finite elements resolve the part inside "
            "the grains once more."
        ),
        (
            "Its curves cannot be laid over ours: the time scale C/H needs λ, c<sub>p</sub> and "
            "the load, which are not stated."
        ),
    ]
    head = (
        "",
        f"one temperature, t = {times[index]:g} s [°C]",
        "finite elements [°C]",
        "largest difference, of the start's",
        "at",
    )
    return Entry(
        "5",
        "Temperatures of grains 1, 5 and 14",
        [
            (
                "Fourteen equal grains of radius 1 mm in a triangular arrangement, grain 1 at 100 "
                "°C, the others at 20 °C: the temperatures of grains 1, 5 and 14, one temperature "
                "per grain, are compared with finite elements."
            )
        ],
        [
            (
                "The rows (14 is not a triangular number), the load, λ and c<sub>p</sub>. Chosen: "
                "rows of 2, 3, 4, 5; 1 N in every contact, because the forces of rigid grains in "
                "such a lattice are not unique; the steel of study 4.2; c<sub>p</sub> = 500 J/(kg "
                "K)."
            )
        ],
        [
            Panel(
                "figure-05",
                "Lines: one temperature per grain. Dashes: finite elements inside the grains.",
                _curves(times, lumped, resolved),
            )
        ],
        head,
        rows,
        differs,
    )


def _curves(times: Floats, lumped: Floats, resolved: Floats) -> Any:
    def draw(axes: Any) -> None:
        for k, (grain, color) in enumerate(zip(WATCHED, COLORS, strict=False)):
            axes.plot(times, lumped[:, k], color=color, label=f"grain {grain + 1}")
            axes.plot(times, resolved[:, k], "--", color="black", linewidth=0.8)
        axes.plot([], [], "--", color="black", linewidth=0.8, label="finite elements")
        axes.set_xlim(times[0], times[-1])
        axes.set_xlabel("time $t$ [s]")
        axes.set_ylabel("temperature $T$ [°C]")
        axes.legend(loc="upper right")

    return on_axes((COLUMN, 0.8 * COLUMN), draw)


def _figure_6(table: Any, celsius: Floats) -> Entry:
    now, last = celsius[table.frame], celsius[-1]
    rows: Rows = [
        ("time", f"{table.time:g} s"),
        ("hottest grain", f"{now.argmax() + 1}: {now.max():.2f} °C"),
        ("coldest grain", f"{now.argmin() + 1}: {now.min():.2f} °C"),
        ("mean", f"{now.mean():.3f} °C (at the start {celsius[0].mean():.3f} °C)"),
        ("spread at the end of the run", f"{np.ptp(last):.2g} K"),
    ]
    return Entry(
        "6",
        "Temperatures of all grains",
        ["The temperatures of all fourteen grains while the heat spreads from grain 1."],
        ["At which time."],
        [Panel("figure-06", f"t = {table.time:g} s, about C/H.", lambda path: plot(table, path))],
        ("", "ours"),
        rows,
        [
            (
                "Nothing in what the paper states contradicts this map; its numbers depend on the "
                "same open choices as figure 5."
            )
        ],
    )
