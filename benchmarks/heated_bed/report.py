"""Everything the benchmark finds, as text and as one JSON object."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from comparison import Beds, ProfileRow, compare_beds, tabulate
from deposited import Bed, Mechanics, read_temperatures
from reheating import REFERENCE, REPEATS, Accuracy, compare_integrators, heat_bed

BUDGET_SECONDS, BUDGET_ERROR = 0.3, 1e-3


@dataclass(frozen=True)
class Results:
    """What the benchmark finds.

    Attributes:
        mechanics: The bed when it was frozen.
        profile: θ at some η.
        gas_ratio: Smallest and largest λ_s s/(λ_f a) of a contact in air.
        closure: Largest relative error of the first law when the bed is heated again.
        repeated: Largest difference of θ between the run and the same heating done again here.
        accuracy: Integrators and tolerances.
    """

    mechanics: Mechanics
    profile: list[ProfileRow]
    gas_ratio: tuple[float, float]
    closure: float
    repeated: float
    accuracy: list[Accuracy]


def make_results(bed: Bed, mechanics: Mechanics, air_run: Path | None) -> tuple[Results, Beds]:
    """Run the benchmark on a bed; ``air_run`` is a finished run in air, None heats the bed of the
    vacuum run again.
    """
    again, in_air = heat_bed(bed, bed.settings), heat_bed(bed, bed.air)
    beds = compare_beds(
        bed, bed.temperature, in_air.temperature if air_run is None else read_temperatures(air_run)
    )
    difference = np.abs(again.temperature - bed.temperature).max() / (bed.hot - bed.reference)
    results = Results(
        mechanics,
        tabulate(beds),
        in_air.gas_ratio,
        max(again.closure, in_air.closure),
        float(difference),
        compare_integrators(bed),
    )
    return results, beds


def as_json(results: Results) -> dict[str, Any]:
    """The results as plain numbers."""
    return asdict(results)


def as_text(results: Results) -> str:
    """The results as tables."""
    return "\n\n".join([_mechanics(results), _profile(results.profile), _accuracy(results)])


def _mechanics(results: Results) -> str:
    bed = results.mechanics
    low, high = results.gas_ratio
    return (
        f"{bed.grains} grains, height {bed.height:.4f} m, solid fraction "
        f"{bed.solid_fraction:.4f}, coordination {bed.coordination:.3f}, rattlers "
        f"{100 * bed.rattlers:.2f} %\n"
        f"floor {bed.floor_load:.5f} + side walls {bed.side_load:.5f} = {bed.load:.6f} of the "
        f"weight before freezing\nλ_s s/(λ_f a) of the contacts in air: {low:.3f} to {high:.2f}\n"
        f"the heating done again here: θ within {results.repeated:.1e} of the run; first law to "
        f"{results.closure:.1e}"
    )


def _profile(rows: list[ProfileRow]) -> str:
    lines = [
        (
            "θ = (T − T₀)/(T_wall − T₀) after half an hour; ± standard deviation among the grains "
            "of a bin one diameter wide"
        ),
        "     η   lattice vacuum      bed vacuum     lattice air         bed air",
    ]
    for row in rows:
        vacuum, air = (
            f"{row.vacuum:.4f} ± {row.vacuum_spread:.4f}",
            f"{row.air:.4f} ± {row.air_spread:.4f}",
        )
        lines.append(
            f"{row.eta:6.3f} {row.lattice_vacuum:16.4f} {vacuum:>15} {row.lattice_air:15.4f} "
            f"{air:>15}"
        )
    return "\n".join(lines)


def _accuracy(results: Results) -> str:
    title = (
        f"The heating alone, compiled, {REPEATS} times; errors of θ of the grains against "
        f"implicit {REFERENCE:g} (budget: {BUDGET_SECONDS:g} s at {BUDGET_ERROR:g})"
    )
    heading = "  integrator   tolerance   sub-steps   median s   least s   largest error       rms"
    return "\n".join([title, heading, *(_accuracy_line(row) for row in results.accuracy)])


def _accuracy_line(row: Accuracy) -> str:
    mark = "  <- default" if row.is_default else ""
    return (
        f"  {row.integrator:10s} {row.tolerance:11g} {row.sub_steps:11d} {row.seconds:10.3f} "
        f"{row.fastest:9.3f} {row.error:15.1e} {row.rms:9.1e}{mark}"
    )
