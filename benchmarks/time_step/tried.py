"""What was tried against errors of first order in Δt: prints the table from the records of the
runs.

    python benchmarks/time_step/tried.py

The runs are in ``tried.json``. Those of the laws that are not in the program were made with
``tried.patch`` (see the README). Plane shear as in `cases`, 1,200 discs, μ* from the walls, ν in
the middle. Errors are differences from Δt → 0: a straight line through the runs of the present law
with steps up to 0.2 τ, at tolerances up to 10⁻² where the step is 0.05 τ or less and of 10⁻³ where
it is longer. Below I = 0.1 the error falls more slowly than Δt, and the line ends too low in ν.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

PRESENT = "present"
LONGEST, SHORT = 0.2, 0.05
STRICT, LOOSE = 1e-3, 1e-2


@dataclass(frozen=True)
class Record:
    """One run.

    Attributes:
        law: Name of the law that was tried, `PRESENT` for that of the program.
        inertial: Nominal inertial number.
        friction: μ between the discs.
        step: Δt over τ.
        tolerance: Tolerance of the rms.
        seed: Seed of the packing.
        strain: Strain of the run; the first 4 are left out.
        macroscopic: μ* and its standard error.
        solid: ν and its standard error.
        early: Mean gap of the contacts, weighted with their impulses, over d̄.
        contacts: Contacts per grain that carry an impulse in a step, times two.
        work: Sweeps per unit of strain.
    """

    law: str
    inertial: float
    friction: float
    step: float
    tolerance: float
    seed: int
    strain: float
    macroscopic: tuple[float, float]
    solid: tuple[float, float]
    early: float
    contacts: float
    work: float


Value = tuple[float, float]


def read_records(path: Path) -> list[Record]:
    """All runs."""
    return [
        Record(**{k: tuple(v) if isinstance(v, list) else v for k, v in r.items()})
        for r in json.loads(path.read_text())
    ]


def average(values: Sequence[Value]) -> Value:
    """Mean of values with standard errors, weighted with these."""
    weights = [1.0 / (error * error) for _, error in values]
    return sum(w * v for w, (v, _) in zip(weights, values, strict=True)) / sum(
        weights
    ), 1.0 / math.sqrt(sum(weights))


def limit(steps: Sequence[float], values: Sequence[Value]) -> Value:
    """Value at Δt → 0 of a straight line through values at several steps, and its standard
    error.
    """
    level, error = np.array(values).T
    design = np.column_stack([np.ones(len(steps)), steps]) / error[:, None]
    covariance = np.linalg.inv(design.T @ design)
    return float((covariance @ design.T @ (level / error))[0]), math.sqrt(covariance[0, 0])


def _counts(r: Record) -> bool:
    tolerance = LOOSE if r.step <= SHORT else STRICT
    return r.law == PRESENT and r.step <= LONGEST and r.tolerance <= tolerance


def _line(runs: Sequence[Record], zero: dict[str, Value]) -> str:
    cells = [f"{len(runs):4d}"]
    for name, (level, error) in zero.items():
        value, own = average([getattr(r, name) for r in runs])
        cells.append(f"{value - level:+8.4f} ±{math.hypot(own, error):.4f}")
    early, contacts, work = (
        np.mean([getattr(r, name) for r in runs]) for name in ("early", "contacts", "work")
    )
    return " ".join([*cells, f"{early:8.1e} {contacts:5.2f} {work:10.0f}"])


def as_text(records: Sequence[Record]) -> str:
    """The table."""
    head = (
        f"{'I':>5} {'μ':>4} {'law':<25} {'Δt/τ':>6} {'rms tol.':>8} {'runs':>4} {'μ* error':>16} "
        f"{'ν error':>16} {'early':>8} {'Z':>5} {'per strain':>10}"
    )
    lines = [head]
    flows = sorted({(r.inertial, r.friction) for r in records}, reverse=True)
    for flow in flows:
        here = [r for r in records if (r.inertial, r.friction) == flow]
        counted = [r for r in here if _counts(r)]
        if len({r.step for r in counted}) < 2:
            continue
        zero = {
            name: limit([r.step for r in counted], [getattr(r, name) for r in counted])
            for name in ("macroscopic", "solid")
        }
        (m, m_error), (s, s_error) = zero["macroscopic"], zero["solid"]
        lines.append(
            f"{flow[0]:5g} {flow[1]:4g} Δt → 0: μ* = {m:.4f} ± {m_error:.4f}, ν = {s:.4f} ± "
            f"{s_error:.4f}"
        )
        kinds = sorted({(r.law != PRESENT, r.law, r.step, -r.tolerance) for r in here})
        for _, law, step, minus in kinds:
            runs = [r for r in here if (r.law, r.step, r.tolerance) == (law, step, -minus)]
            lines.append(
                f"{flow[0]:5g} {flow[1]:4g} {law:<25} {step:6g} {-minus:8g} " + _line(runs, zero)
            )
    return "\n".join(lines)


if __name__ == "__main__":
    print(as_text(read_records(Path(__file__).parent / "tried.json")))
