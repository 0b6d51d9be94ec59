"""Means over the seeds, and the table of the study."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from cases import STEP, TOLERANCE, Case
from measure import Measured

from multicor_cli.model.model import Floats

FRICTION, SOLID = 0.01, 0.003
"""The accuracy that the table marks: changes of μ* and ν from the smallest time step."""


@dataclass(frozen=True)
class Row:
    """Means over the seeds of one case; ``change_…`` is from the smallest time step, errors are
    standard errors.
    """

    inertial: float
    step: float
    tolerance: float
    seeds: int
    friction: float
    friction_error: float
    solid: float
    solid_error: float
    velocity: Floats
    density: Floats
    early: float
    overlap: float
    slide: float
    sweeps: float
    work: float
    unconverged: int


def make_rows(results: Sequence[tuple[Case, Measured]]) -> list[Row]:
    """One row per inertial number, time step and tolerance, in the order of the cases."""
    groups: dict[tuple[float, float, float], list[Measured]] = {}
    for case, measured in results:
        groups.setdefault((case.inertial, case.step, case.tolerance), []).append(measured)
    return [_make_row(key, group) for key, group in groups.items()]


def _make_row(key: tuple[float, float, float], group: Sequence[Measured]) -> Row:
    friction, friction_error = _mean([m.friction for m in group])
    solid, solid_error = _mean([m.solid for m in group])
    return Row(
        *key,
        len(group),
        friction,
        friction_error,
        solid,
        solid_error,
        np.mean([m.velocity for m in group], axis=0),
        np.mean([m.density for m in group], axis=0),
        float(np.mean([m.early for m in group])),
        max(m.overlap for m in group),
        float(np.mean([m.slide for m in group])),
        float(np.mean([m.sweeps for m in group])),
        float(np.mean([m.work for m in group])),
        sum(m.unconverged for m in group),
    )


def _mean(values: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Mean and its standard error of independent values with standard errors."""
    return float(np.mean([v for v, _ in values])), math.sqrt(sum(e * e for _, e in values)) / len(
        values
    )


def reference_of(row: Row, rows: Sequence[Row]) -> Row:
    """The row of the same flow with the smallest time step: at the tolerance that is kept, or else
    at the strictest there is.
    """
    same = [r for r in rows if r.inertial == row.inertial]
    kept = [r for r in same if r.tolerance == TOLERANCE]
    return min(kept if len(kept) > 1 else same, key=lambda r: (r.step, r.tolerance))


def as_text(rows: Sequence[Row]) -> str:
    """The table."""
    head = (
        f"{'I':>5} {'Δt/τ':>5} {'rms tol.':>8} {'γ̇Δt':>7} {'μ*':>15} {'change':>7} {'ν':>16} "
        f"{'change':>8} {'Δv/V':>6} {'Δν(y)':>6} {'early':>8} {'overlap':>8} {'sweeps':>7} "
        f"{'per strain':>10} {'unconv.':>7}"
    )
    return "\n".join([head, *(_line(row, reference_of(row, rows)) for row in rows), _note()])


def _line(row: Row, reference: Row) -> str:
    friction, solid = row.friction - reference.friction, row.solid - reference.solid
    mark = " " if abs(friction) <= FRICTION and abs(solid) <= SOLID else "*"
    velocity, density = (
        _apart(row.velocity, reference.velocity),
        _apart(row.density, reference.density),
    )
    return (
        f"{row.inertial:5g} {row.step:5g} {row.tolerance:8g} {row.slide:7.4f} {row.friction:7.4f} "
        f"±{row.friction_error:6.4f} {friction:+7.4f} {row.solid:7.4f} ± {row.solid_error:6.4f} "
        f"{solid:+8.4f} {velocity:6.3f} {density:6.3f} {row.early:8.1e} {row.overlap:8.1e} "
        f"{row.sweeps:7.0f} {row.work:10.0f} {row.unconverged:7d} {mark}"
    )


def _apart(profile: Floats, reference: Floats) -> float:
    """Root mean square difference of two profiles, over the bins that both have."""
    return float(np.sqrt(np.nanmean((profile - reference) ** 2)))


def _note() -> str:
    return (
        f"changes are from the smallest Δt, at rms {TOLERANCE:g} if there are several; *: more "
        f"than {FRICTION:g} in μ* or {SOLID:g} in ν. Δv/V, Δν(y): rms difference of the profiles. "
        "early: impulse-weighted mean gap over d̄. sweeps: per step; per strain: sweeps per unit "
        f"of strain. Unless with --trades, tolerances are varied at Δt = {STEP:g} τ"
    )


def as_json(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """The rows for JSON."""
    return [
        {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(row).items()
        }
        for row in rows
    ]
