"""What can be chosen about the contact solver, and what it reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Method = Literal["accelerated", "gauss-seidel"]
Local = Literal["exact", "bipotential"]


@dataclass(frozen=True)
class Settings:
    """Choices of the contact solver.

    Attributes:
        method: Global method: Gauss–Seidel sweeps, accelerated or plain.
        local: Solution of one contact: exact, or one predictor–corrector step of the bipotential.
        tolerance_rms: Largest rms velocity correction e_c over u_ref.
        tolerance_max: Largest velocity correction e_c of a contact over u_ref.
        tolerance_energy: Largest energy residual G.
        max_sweeps: Cap on the number of sweeps of one step.
        on_failure: What an unconverged step does: it is counted ("warn"), or stops the run ("error").
    """

    method: Method = "accelerated"
    local: Local = "exact"
    tolerance_rms: float = 1e-3
    tolerance_max: float = 5e-2
    tolerance_energy: float = 1e-2
    max_sweeps: int = 10_000
    on_failure: Literal["warn", "error"] = "warn"


@dataclass(frozen=True)
class StepReport:
    """What the contact solver did in one step.

    Attributes:
        sweeps: Sweep-equivalents: sweeps plus evaluations of the residual.
        converged: Whether all three tolerances were met.
        rms: rms of e_c over u_ref.
        maximum: Largest e_c over u_ref.
        energy: Energy residual G.
        contacts: Number of contacts that carry an impulse.
        candidates: Number of contacts considered.
        overlap: Largest overlap over the smaller radius at the end of the step.
    """

    sweeps: float
    converged: bool
    rms: float
    maximum: float
    energy: float
    contacts: int
    candidates: int
    overlap: float


class PhysicsError(Exception):
    """The run cannot go on: the state is not finite, no admissible positions exist, or the solver failed by request."""

    def __init__(self, step: int, message: str) -> None:
        super().__init__(f"step {step}: {message}")
        self.step = step
        self.message = message
