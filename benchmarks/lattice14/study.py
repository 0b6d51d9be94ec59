"""The comparison: one temperature per grain against temperatures resolved inside the grains."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from arrangement import (
    COLD,
    HOT,
    ROWS,
    WATCHED,
    Floats,
    find_contacts,
    place_rows,
    solve_lumped,
    to_celsius,
)
from constriction import (
    effective_share,
    measured_resistance,
    measured_share,
    own_resistance,
    solve_network,
)
from disc_mesh import MeshChoice
from finite_elements import Disc, History, make_disc, solve_discs
from scipy.optimize import minimize_scalar

BIOTS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
ARC_LEVELS = (3, 4, 5, 6, 7)
TIME_REFINEMENT = 2
"""Divides the time steps of the sweep; the table of convergence starts at 1."""

_CONVERGENCE_BIOT = 0.1
_PROBE_TIME = 0.5  # s = t H/C at which convergence is looked at: temperatures change fast
_TRIANGLE = (1, 2)  # rows of the three discs on which meshes are compared

disc_of = cache(make_disc)


@dataclass(frozen=True)
class Comparison:
    """One Biot number. Differences are the largest over s ≤ 6 and grains 1, 5 and 14, as shares of
    80 K.

    Attributes:
        biot: Bi = H/(λ h), H the conductance of the interface.
        interface: Finite elements against one temperature per grain with the same H.
        share: H_eff/H of the closed form.
        share_measured: H_eff/H of two meshed discs.
        effective: Against one temperature per grain with H_eff.
        network: Against one temperature per grain with the own and mutual resistances R_0, R_φ of
            its contacts.
        share_fitted: H_fit/H, the conductance with the smallest difference.
        fitted: That difference.
        spread: Largest minus smallest temperature inside grain 1, at its largest.
        deviation: Root of the mean square deviation from the mean inside grain 1, at its largest.
        drift: Error of the conservation of heat.
    """

    biot: float
    interface: float
    share: float
    share_measured: float
    effective: float
    network: float
    share_fitted: float
    fitted: float
    spread: float
    deviation: float
    drift: float


@dataclass(frozen=True)
class ArcRow:
    """One half-width of the contact arcs.

    Attributes:
        half_width: b/a.
        resistance: λ h R_0 of the mesh.
        closed_form: The same by the closed form.
        interface: As in `Comparison`.
        effective: As in `Comparison`.
    """

    half_width: float
    resistance: float
    closed_form: float
    interface: float
    effective: float


@dataclass(frozen=True)
class ConvergenceRow:
    """One refinement.

    Attributes:
        kind: What is refined.
        factor: Steps or triangle edges are this many times smaller.
        unknowns: Degrees of freedom.
        values: The temperatures looked at [°C], or the resistance.
        order: Observed order from this and the two coarser rows; None where there are not enough.
    """

    kind: Literal["time", "mesh", "resistance"]
    factor: int
    unknowns: int
    values: tuple[float, ...]
    order: float | None


def solve_lattice(
    biot: float, mesh: MeshChoice | None = None, refinement: int = TIME_REFINEMENT
) -> History:
    """Finite-element temperatures of the 14 discs."""
    centers = place_rows()
    return solve_discs(
        disc_of(mesh or MeshChoice()), find_contacts(centers), len(centers), biot, refinement
    )


def lumped_lattice(times: Floats) -> Floats:
    """Exact θ of the 14 grains with one temperature each, shape ``(m, 14)``."""
    return solve_lumped(find_contacts(place_rows()), sum(ROWS), times)


def difference(resolved: Floats, lumped: Floats) -> float:
    """Largest difference of grains 1, 5 and 14, as a share of 80 K."""
    return float(np.abs(resolved - lumped)[:, WATCHED].max())


def compare(biot: float, mesh: MeshChoice | None = None) -> Comparison:
    """Finite elements against the four kinds of grains with one temperature."""
    disc = disc_of(mesh or MeshChoice())
    history = solve_lattice(biot, mesh)
    times, resolved = history.times, history.mean
    share = effective_share(biot, disc.half_width)
    network = solve_network(find_contacts(place_rows()), sum(ROWS), biot, disc.half_width, times)
    fit = fit_share(history)
    return Comparison(
        biot=biot,
        interface=difference(resolved, lumped_lattice(times)),
        share=share,
        share_measured=measured_share(disc, biot),
        effective=difference(resolved, lumped_lattice(share * times)),
        network=difference(resolved, network),
        share_fitted=fit,
        fitted=difference(resolved, lumped_lattice(fit * times)),
        spread=float(history.spread[1:].max()),
        deviation=float(history.deviation.max()),
        drift=history.drift,
    )


def fit_share(history: History) -> float:
    """H_fit/H for which grains with one temperature come closest."""
    found = minimize_scalar(
        lambda share: difference(history.mean, lumped_lattice(share * history.times)),
        bounds=(0.05, 1.2),
        method="bounded",
        options={"xatol": 1e-7},
    )
    return float(found.x)


def compare_arcs(biot: float) -> list[ArcRow]:
    """The same interface conductance through arcs of different half-widths."""
    rows = []
    for level in ARC_LEVELS:
        mesh = MeshChoice(arc_level=level)
        disc, history = disc_of(mesh), solve_lattice(biot, mesh)
        effective = lumped_lattice(effective_share(biot, disc.half_width) * history.times)
        rows.append(
            ArcRow(
                half_width=disc.half_width,
                resistance=measured_resistance(disc),
                closed_form=own_resistance(disc.half_width),
                interface=difference(history.mean, lumped_lattice(history.times)),
                effective=difference(history.mean, effective),
            )
        )
    return rows


def refine_time() -> list[ConvergenceRow]:
    """Temperatures of grains 1, 5 and 14 at s = 0.5 and Bi = 0.1 with smaller and smaller steps."""
    runs = [(factor, solve_lattice(_CONVERGENCE_BIOT, refinement=factor)) for factor in (1, 2, 4)]
    return _rows("time", [(factor, run.size, _probe(run, WATCHED)) for factor, run in runs])


def refine_mesh() -> list[ConvergenceRow]:
    """Temperatures of three discs that touch each other, at s = 0.5 and Bi = 0.1, on finer and
    finer meshes.
    """
    centers = place_rows(_TRIANGLE)
    runs = []
    for halvings in range(3):
        disc = disc_of(MeshChoice(halvings=halvings))
        run = solve_discs(
            disc, find_contacts(centers), len(centers), _CONVERGENCE_BIOT, TIME_REFINEMENT
        )
        runs.append((2**halvings, run.size, _probe(run, (0, 1))))
    return _rows("mesh", runs)


def refine_resistance() -> list[ConvergenceRow]:
    """Resistance λ h R_0 of one disc on finer and finer meshes."""
    discs: list[tuple[int, Disc]] = [
        (2**halvings, disc_of(MeshChoice(halvings=halvings))) for halvings in range(3)
    ]
    return _rows(
        "resistance", [(factor, disc.size, (measured_resistance(disc),)) for factor, disc in discs]
    )


def _probe(history: History, grains: tuple[int, ...]) -> tuple[float, ...]:
    k = int(np.argmin(np.abs(history.times - _PROBE_TIME)))
    return tuple(float(value) for value in to_celsius(history.mean[k, list(grains)]))


def _rows(
    kind: Literal["time", "mesh", "resistance"], runs: list[tuple[int, int, tuple[float, ...]]]
) -> list[ConvergenceRow]:
    """Rows with the order seen in the first value: log₂ of the ratio of two successive changes."""
    rows = []
    for k, (factor, unknowns, values) in enumerate(runs):
        order = None
        if k >= 2:
            before, last = runs[k - 1][2][0] - runs[k - 2][2][0], values[0] - runs[k - 1][2][0]
            order = float(np.log2(abs(before / last)))
        rows.append(ConvergenceRow(kind, factor, unknowns, values, order))
    return rows


def kelvin(share: float) -> float:
    """A share of the initial difference in kelvin."""
    return share * (HOT - COLD)
