"""The tables, as text and as one JSON object."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from arrangement import ROWS, WATCHED, find_contacts, place_rows, to_celsius
from case import Case
from disc_mesh import MeshChoice
from study import (
    BIOTS,
    ArcRow,
    Comparison,
    ConvergenceRow,
    compare,
    compare_arcs,
    disc_of,
    kelvin,
    lumped_lattice,
    refine_mesh,
    refine_resistance,
    refine_time,
    solve_lattice,
)

ARC_BIOT = 0.1
CURVE_TIMES = (0.25, 0.5, 1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Curves:
    """Temperatures of grains 1, 5 and 14 [°C] at some times s = t H/C, for one Bi.

    Attributes:
        biot: Bi.
        times: s.
        resolved: Finite elements, one triple per time.
        lumped: One temperature per grain, the same H.
    """

    biot: float
    times: list[float]
    resolved: list[list[float]]
    lumped: list[list[float]]


@dataclass(frozen=True)
class Results:
    """Everything that the benchmark finds.

    Attributes:
        case: The shipped scenario.
        half_width: b/a of the sweep.
        unknowns: Degrees of freedom of the sweep.
        shipped: The comparison at the Bi of the shipped scenario.
        curves: Its temperatures.
        sweep: The comparison against Bi.
        arcs: Against the half-width of the arcs.
        convergence: In time and mesh.
    """

    case: Case
    half_width: float
    unknowns: int
    shipped: Comparison
    curves: Curves
    sweep: list[Comparison]
    arcs: list[ArcRow]
    convergence: list[ConvergenceRow]


def make_results(case: Case) -> Results:
    """Run the whole benchmark."""
    return Results(
        case=case,
        half_width=MeshChoice().half_width,
        unknowns=sum(ROWS) * disc_of(MeshChoice()).size,
        shipped=compare(case.biot),
        curves=make_curves(case.biot),
        sweep=[compare(biot) for biot in BIOTS],
        arcs=compare_arcs(ARC_BIOT),
        convergence=[*refine_time(), *refine_mesh(), *refine_resistance()],
    )


def make_curves(biot: float) -> Curves:
    """Temperatures at a few times."""
    history = solve_lattice(biot)
    picked = [int(np.argmin(np.abs(history.times - time))) for time in CURVE_TIMES]
    times = history.times[picked]
    watched = list(WATCHED)
    return Curves(
        biot,
        times.tolist(),
        to_celsius(history.mean[picked][:, watched]).tolist(),
        to_celsius(lumped_lattice(times)[:, watched]).tolist(),
    )


def as_json(results: Results) -> dict[str, Any]:
    """The results as plain numbers; shares are of 80 K."""
    return asdict(results)


def as_text(results: Results) -> str:
    """The results as tables."""
    parts = [
        _head(results),
        _curves(results.curves),
        _sweep(results),
        _arcs(results.arcs),
        _convergence(results.convergence),
    ]
    return "\n\n".join(parts)


def _head(results: Results) -> str:
    case, contacts = results.case, len(find_contacts(place_rows()))
    return (
        f"14 discs in rows {'-'.join(map(str, ROWS))}, {contacts} contacts, arcs of half-width b "
        f"= {results.half_width:.4f} a, {results.unknowns} unknowns\n"
        f"shipped scenario: H = {case.conductance:.4e} W/K, C = {case.capacity:.4e} J/K, C/H = "
        f"{case.time_unit:.2f} s, Bi = H/(λh) = {case.biot:.4f} (H/(λa) = {case.spot_biot:.4f})"
    )


def _curves(curves: Curves) -> str:
    lines = [
        f"T [°C] of grains 1, 5, 14 at Bi = {curves.biot:.4f}",
        "   t H/C | finite elements             | one temperature per grain, same H",
    ]
    for time, resolved, lumped in zip(curves.times, curves.resolved, curves.lumped, strict=True):
        lines.append(
            f"{time:8.2f} | "
            + " ".join(f"{v:9.4f}" for v in resolved)
            + " | "
            + " ".join(f"{v:9.4f}" for v in lumped)
        )
    return "\n".join(lines)


def _sweep(results: Results) -> str:
    lines = [
        (
            "Largest difference of the mean temperatures of grains 1, 5, 14 over t ≤ 6 C/H, % of "
            "80 K, between the finite elements and"
        ),
        (
            "grains with one temperature: with the same H; with H_eff; with R_0 and R_φ between "
            "all contacts of a grain; with H_fit"
        ),
        (
            "      Bi   same H     (K)  H_eff/H measured |  H_eff   mutual    H_fit (H_fit/H) | "
            "inside grain 1: max-min   rms   drift"
        ),
    ]
    lines += [_sweep_line(row) for row in [*results.sweep, results.shipped]]
    lines[-1] += "  <- shipped"
    return "\n".join(lines)


def _sweep_line(row: Comparison) -> str:
    return (
        f"{row.biot:8.4f} {100 * row.interface:8.3f} {kelvin(row.interface):7.3f} "
        f"{row.share:8.4f} {row.share_measured:8.4f} | {100 * row.effective:6.3f} "
        f"{100 * row.network:8.3f} {100 * row.fitted:8.3f} ({row.share_fitted:.4f}) | "
        f"{100 * row.spread:20.2f} {100 * row.deviation:9.3f}   {row.drift:.0e}"
    )


def _arcs(rows: list[ArcRow]) -> str:
    lines = [
        (
            f"Half-width of the arcs, Bi = {ARC_BIOT}: own resistance λ h R_0, and differences in "
            "% of 80 K"
        ),
        "     b/a  R_0 mesh  closed form   same H    H_eff",
    ]
    lines += [_arc_line(row) for row in rows]
    return "\n".join(lines)


def _arc_line(row: ArcRow) -> str:
    shares = f"{100 * row.interface:8.3f} {100 * row.effective:8.3f}"
    return f"{row.half_width:8.4f} {row.resistance:9.4f} {row.closed_form:12.4f} {shares}"


_TITLES = {
    "time": "time steps: T of grains 1, 5, 14 at t = 0.5 C/H, Bi = 0.1 [°C]",
    "mesh": (
        "mesh: T of the hot and of a cold one of three touching discs at t = 0.5 C/H, Bi = 0.1 [°C]"
    ),
    "resistance": "mesh: λ h R_0 of one disc",
}


def _convergence(rows: list[ConvergenceRow]) -> str:
    lines = ["Convergence (order: of the first value)"]
    for kind, title in _TITLES.items():
        lines.append(title)
        for row in rows:
            if row.kind == kind:
                values = " ".join(f"{value:12.6f}" for value in row.values)
                order = "" if row.order is None else f"  order {row.order:.2f}"
                lines.append(f"  1/{row.factor}  {row.unknowns:6d} unknowns {values}{order}")
    return "\n".join(lines)
