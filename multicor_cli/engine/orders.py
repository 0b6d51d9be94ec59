"""What an engine is told of a run and at the start of a stage, and what it says of a step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import ContactLaws, Floats
from multicor_cli.model.shapes import Rectangle

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


# ---- How grains come and go in a run: what does not change of it


@dataclass(frozen=True)
class Release:
    """How the waiting grains of a group come: one after the other, in the order of their numbers.

    The k-th release (from 0) is due at ``start`` + k/rate, or, with a rate of mass, at ``start`` +
    the mass released before it over the rate. A grain takes the first of the places that
    ``draw(k)`` gives where it overlaps nothing; if there is none it waits, and the same places are
    tried before the next step.

    Attributes:
        group: The group.
        rate: Grains or mass per time [1/s, kg/s].
        is_mass: Whether it is a rate of mass.
        start: Time of the first release [s].
        region: Where; grains lie wholly in it.
        spans_period: Whether it is the whole period wide: grains may then lie across its ends.
        velocity: Velocity [m/s] and spin [rad/s] that grains come with.
        angles: At which each grain of the group comes [rad], of size 0 if all are discs.
        draw: For the k-th release, numbers in [0, 1) for the places tried, shape ``(tries, 2)``.
    """

    group: int
    rate: float
    is_mass: bool
    start: float
    region: Rectangle
    spans_period: bool
    velocity: tuple[float, float, float]
    angles: Floats
    draw: Callable[[int], Floats]

    def allowed(self, time: float) -> float:
        """Grains or mass [kg] that may have come by a time [s]; negative before the start."""
        return self.rate * (time - self.start)


@dataclass(frozen=True)
class Outlet:
    """Where grains leave whose center lies in it.

    With ``returns`` they go back to wait, if their group has a release.
    """

    region: Rectangle
    returns: bool


@dataclass(frozen=True)
class InflowRules:
    """How grains come and go: releases of groups, and outlets in the order of `Model.outlets`.

    A grain whose center is beyond ``limits``, if there are any, is lost: that ends the run if it
    ``stops``, else the grain is removed.
    """

    releases: tuple[Release, ...] = ()
    outlets: tuple[Outlet, ...] = ()
    limits: Rectangle | None = None
    stops: bool = False


# ---- How a step ends early


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
