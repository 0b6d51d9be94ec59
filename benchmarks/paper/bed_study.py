"""Study 4.2, figure 7: a deposited bed heated from below."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from entry import Entry, Panel, Rows, on_axes, percent

from multicor_cli.plots.profile import draw_theta_eta
from multicor_cli.plots.style import COLUMN
from multicor_cli.post import ThetaTable

# The benchmark of this study has the lattice and the bed in air
sys.path.append(str(Path(__file__).parents[1] / "heated_bed"))

_AGREES = 0.03  # η above which the paper reports agreement
_COLD = 0.1


def bed_entries(path: Path) -> list[Entry]:
    """Figure 7 from a finished run of ``configs/heated-bed.toml``; the bed is heated once more in
    air.
    """
    from comparison import compare_beds, tabulate
    from deposited import read_bed
    from figure import draw_beds
    from reheating import heat_bed

    bed, mechanics = read_bed(path)
    air = heat_bed(bed, bed.air)
    beds = compare_beds(bed, bed.temperature, air.temperature)
    rows: Rows = [
        (
            f"{row.eta:g}",
            f"{row.lattice_vacuum:.3f}",
            f"{row.vacuum:.3f} ± {row.vacuum_spread:.3f}",
            f"{row.lattice_air:.3f}",
            f"{row.air:.3f} ± {row.air_spread:.3f}",
        )
        for row in tabulate(beds)
    ]
    bed_panel = Panel(
        "figure-07-bed",
        "The deposited bed in vacuum.",
        on_axes(_SIZE, lambda axes: draw_theta_eta(axes, beds.vacuum)),
    )
    both = Panel(
        "figure-07-air",
        "In vacuum and in air, beside a perfect lattice (dashes).",
        on_axes(_SIZE, lambda axes: draw_beds(axes, beds)),
    )
    covered = mechanics.grains * np.pi * (2.0 * bed.sphere.radius) ** 2 / (0.45 * 0.31)
    return [
        Entry(
            "7",
            "Temperature θ against height η in the heated bed",
            [
                (
                    "15,548 grains of stainless steel in 0.45 m × 0.31 m, floor at 50 °C, start "
                    "at 25 °C, other sides insulated, after 30 minutes."
                ),
                (
                    "θ(η) agrees with the experiment above η = 0.03; the front oscillates as "
                    "stress chains converge and diverge along the height."
                ),
                (
                    "Conduction through the gas is left out, because λ<sub>s</sub> "
                    "s/(λ<sub>f</sub> a) ≫ 1."
                ),
            ],
            [
                (
                    f"A <em>radius</em> of 3 mm cannot be: {mechanics.grains:,} such grains would "
                    f"cover {covered:.2f} "
                    "times the bed; 3 mm is the diameter. Not stated: c<sub>p</sub>, how the bed "
                    "was deposited, the gas pressure in the experiment. Chosen: 500 J/(kg K), a "
                    "rain of grains, no restitution."
                )
            ],
            [bed_panel, both],
            ("η", "lattice, vacuum", "bed, vacuum", "lattice, air", "bed, air"),
            rows,
            _differs(beds, mechanics, air.gas_ratio),
        )
    ]


_SIZE = (COLUMN, 0.85 * COLUMN)


def _at(table: ThetaTable, eta: float) -> float:
    known = np.isfinite(table.mean)
    return float(np.interp(eta, table.center[known], table.mean[known]))


def _differs(beds: Any, mechanics: Any, ratio: tuple[float, float]) -> list[str]:
    near, far = (_at(beds.vacuum, eta) for eta in (_AGREES, _COLD))
    return [
        (
            f"Agreement above η = {_AGREES:g} tests little: in vacuum θ has fallen to {near:.2f} "
            f"there, and to {far:.3f} at η = {_COLD:g}; all that happens in half an hour happens "
            "next to the floor."
        ),
        (
            f"λ<sub>s</sub> s/(λ<sub>f</sub> a) is not ≫ 1: in air it is {ratio[0]:.2g} to "
            f"{ratio[1]:.2g} in this bed, and air raises θ({_COLD:g}) from {far:.3f} to "
            f"{_at(beds.air, _COLD):.2f}. The curve should be compared with experiments in vacuum."
        ),
        (
            f"At one height the temperatures differ by up to ±{np.nanmax(beds.vacuum.spread):.2f} "
            "(standard deviation): they follow the force chains, as the paper says."
        ),
        (
            f"Against an exact solution for a perfect lattice θ({_AGREES:g}) is {near:.3f}, not "
            f"{float(beds.lattice_vacuum.at(np.array(_AGREES))):.3f}: "
            f"{mechanics.coordination:.2f} contacts of a grain carry a force "
            f"({percent(mechanics.rattlers)} rattlers; solid fraction "
            f"{mechanics.solid_fraction:.3f}), in the lattice 4. Nothing was tuned."
        ),
    ]
