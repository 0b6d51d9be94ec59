"""What a step reports, and why it may fail."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from multicor_cli.model.model import Floats


@dataclass(frozen=True)
class StepReport:
    """What the contact solver did in one step.

    Attributes:
        sweeps: Sweep-equivalents: sweeps plus evaluations of the residual.
        converged: Whether all three tolerances were met.
        rms: rms of e_c over u_rms.
        maximum: Largest e_c over u_ref.
        energy: Energy residual G.
        contacts: Number of contacts that carry an impulse.
        candidates: Number of contacts considered.
        overlap: Largest overlap over the smaller radius at the end of the step.
        wall_impulse: Impulse of the grains on the walls [N s, N s, N m s], shape ``(w, 3)``; empty where nothing moves.
    """

    sweeps: float
    converged: bool
    rms: float
    maximum: float
    energy: float
    contacts: int
    candidates: int
    overlap: float
    wall_impulse: Floats = field(default_factory=lambda: np.empty((0, 3)), repr=False, compare=False)


class PhysicsError(Exception):
    """The run cannot go on: the state is not finite, no admissible positions exist, or the solver failed by request."""

    exit_code = 4

    def __init__(self, step: int, message: str) -> None:
        super().__init__(f"step {step}: {message}")
        self.step = step
        self.message = message
