"""What an engine is told at the start of a loading stage, and what it says of a step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import ContactLaws, Floats

if TYPE_CHECKING:
    from multicor_cli.engine.heat.walls import WallHeat
    from multicor_cli.engine.motion.drives import AnyGravity, WallDrive

Method = Literal["accelerated", "gauss-seidel"]
Local = Literal["exact", "bipotential"]


@dataclass(frozen=True)
class Settings:
    """Choices of the contact solver, named as the keys of ``[solver]``.

    Attributes:
        method: Global method: Gauss–Seidel sweeps, accelerated or plain.
        local: Solution of one contact: exact, or one predictor–corrector step of the bipotential.
        tolerance_rms: Largest rms velocity correction e_c over u_rms.
        tolerance_max: Largest velocity correction e_c of a contact over u_ref.
        tolerance_energy: Largest energy residual G.
        max_sweeps: Cap on the number of sweeps of one step.
        on_failure: What an unconverged step does: it is counted ("warn"), or stops the run
            ("error").
    """

    method: Method = "accelerated"
    local: Local = "exact"
    tolerance_rms: float = 2e-3
    tolerance_max: float = 0.1
    tolerance_energy: float = 1e-2
    max_sweeps: int = 50_000
    on_failure: Literal["warn", "error"] = "warn"


@dataclass(frozen=True)
class Orders:
    """All that a loading stage orders; what it leaves out is as the model has it.

    Signals count from the start of the stage.

    Attributes:
        drives: What the walls do, one for each; None: they stand still.
        settings: Choices of the contact solver.
        gravity: Gravity as a function of time; None: that of the model.
        laws: Contact laws, with rolling resistance only if those of the model have it; None: those
            of the model.
        conditions: Thermal conditions of the walls, one for each; None: they are insulated.
        is_new: Which of these conditions begin with the stage, shape ``(w,)``: a wall with a heat
            capacity then gets its first temperature; None: no condition does.
        is_heat_on: Whether temperatures change.
        is_frozen: Whether grains and walls stand still, and only heat flows.
    """

    drives: Sequence[WallDrive] | None = None
    settings: Settings = Settings()
    gravity: AnyGravity | None = None
    laws: ContactLaws | None = None
    conditions: Sequence[WallHeat] | None = None
    is_new: NDArray[np.bool_] | None = None
    is_heat_on: bool = True
    is_frozen: bool = False


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
        wall_impulse: Impulse of the grains on the walls [N s, N s, N m s], shape ``(w, 3)``; empty
            where nothing moves.
    """

    sweeps: float
    converged: bool
    rms: float
    maximum: float
    energy: float
    contacts: int
    candidates: int
    overlap: float
    wall_impulse: Floats = field(
        default_factory=lambda: np.empty((0, 3)), repr=False, compare=False
    )


class PhysicsError(Exception):
    """The run cannot go on: an absurd state, no admissible positions, or a solve that failed."""

    exit_code = 4

    def __init__(self, step: int, message: str) -> None:
        super().__init__(step, message)  # as given, so that it can be pickled
        self.step = step
        self.message = message

    def __str__(self) -> str:
        return f"step {self.step}: {self.message}"


class Interrupted(Exception):
    """The step was abandoned because a signal asked for it; nothing has been changed."""


def stop_if_asked(should_stop: Callable[[], bool] | None) -> None:
    """Raise `Interrupted` if a stop has been requested."""
    if should_stop is not None and should_stop():
        raise Interrupted
