"""The flows of the study: one plane shear cell, at several time steps and tolerances."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from multicor_cli import load_scenario, open_run
from multicor_cli import run as run_scenario
from multicor_cli.engine.orders import Settings
from multicor_cli.running.time_step import Scales

CONFIG = Path(__file__).parents[2] / "configs" / "shear-gravity-free.toml"

LOAD = 0.3  # on the upper wall [N]
PERIOD = 0.03  # [m]
DENSITY, THICKNESS = 1000.0, 0.01  # [kg/m³], [m]
SMALL, LARGE = 0.4e-3, 0.6e-3  # radii [m], uniformly distributed
_MASS = DENSITY * THICKNESS * math.pi * (SMALL**2 + SMALL * LARGE + LARGE**2) / 3.0
TAU = math.sqrt(_MASS * PERIOD / LOAD)
"""τ = √(m̄/P): the time in which the pressure moves a grain by its own size [s]."""

SPEEDS = {0.3: 17.7, 0.1: 5.9, 0.03: 1.77, 0.01: 0.59, 0.003: 0.177}
"""Speed of the upper wall [m/s] of each nominal inertial number."""

STEPS = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Time steps over τ."""

TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4)
"""Tolerances of the rms of the velocity corrections."""

STEP, TOLERANCE = 0.2, 1e-3
"""Those that are kept while the other is varied."""

MU = 0.4
"""Coefficient of friction between the discs, unless another is asked for."""

TRADES = ((0.2, 1e-3), (0.1, 3e-3), (0.05, 1e-2), (0.05, 3e-2), (0.025, 1e-2))
"""Time steps over τ, each with its tolerance: shorter steps that are paid for with a looser one."""

ACCURACIES = (2.0, 1.0, 0.5, 0.25)
"""Accuracies of the automatic time step, at the default tolerances: *draft*, *normal*, *fine*, and
half of that."""

DEFAULT = Settings().tolerance_rms

TRANSIENT = 4.0
"""Strain that is left out of all averages."""


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes:
        inertial: Nominal inertial number.
        step: Time step over τ.
        tolerance: Tolerance of the rms; the other tolerances keep their ratio to it.
        seed: Seed of the packing.
        strain: Shear strain at which the run ends.
        friction: Coefficient of friction between the discs.
        restitution: Coefficient of restitution.
    """

    inertial: float
    step: float
    tolerance: float
    seed: int
    strain: float
    friction: float = MU
    restitution: float = 0.0

    @property
    def name(self) -> str:
        """Name of the folder of the run."""
        law = "" if self.friction == MU else f"-mu{self.friction:g}"
        law += f"-e{self.restitution:g}" if self.restitution else ""
        numerics = f"dt{self.step:g}-tol{self.tolerance:g}-strain{self.strain:g}"
        return f"I{self.inertial:g}-{numerics}-seed{self.seed}{law}"

    def overrides(self) -> list[str]:
        """What is changed in the shipped scenario."""
        speed = SPEEDS[self.inertial]
        share = speed / SPEEDS[0.1]
        return [
            f"loading.0.drives.top.x.velocity={speed}",
            f"particles.0.velocity=[{0.5 * speed},0.0]",
            f"particles.0.shear_rate={131.1 * share}",
            f"loading.0.until.strain.value={self.strain}",
            f"solver.dt={self.step * TAU}",
            *self._tolerances(),
            "solver.threads=1",
            f"output.frame_interval={1e-3 / share}",
            f"scenario.seed={self.seed}",
            f"contacts.0.friction={self.friction}",
            f"contacts.0.restitution={self.restitution}",
        ]

    def _tolerances(self) -> list[str]:
        if self.tolerance == DEFAULT:
            return []
        return [
            f"solver.tolerance_rms={self.tolerance}",
            f"solver.tolerance_max={min(1.0, 50.0 * self.tolerance)}",
            f"solver.tolerance_energy={min(1.0, 10.0 * self.tolerance)}",
        ]


def automatic_step(inertial: float, friction: float, restitution: float) -> float:
    """The automatic time step of this flow over τ."""
    return Scales(1.0, 1.0 / inertial, math.inf, friction, restitution=restitution).limit


def all_cases(
    inertial: list[float],
    seeds: list[int],
    strain: float,
    friction: float = MU,
    restitution: float = 0.0,
    trades: bool = False,
    accuracies: bool = False,
) -> Iterator[Case]:
    """All cases: the time step is varied at one tolerance, and the tolerance at one time step; or
    both together (`TRADES`), or the accuracy (`ACCURACIES`).
    """
    choices = [(step, TOLERANCE) for step in STEPS] + [
        (STEP, tolerance) for tolerance in TOLERANCES if tolerance != TOLERANCE
    ]
    for number in inertial:
        if accuracies:
            step = automatic_step(number, friction, restitution)
            choices = [(factor * step, DEFAULT) for factor in ACCURACIES]
        for step, tolerance in TRADES if trades else choices:
            for seed in seeds:
                yield Case(number, step, tolerance, seed, strain, friction, restitution)


def finish(case: Case, runs: Path) -> Path:
    """The run of a case; begun or continued if it is not finished.

    Raises:
        ScenarioError: If an unfinished run there has another scenario.
        StoreError: If the folder cannot be used.
        RuntimeError: If the run was stopped before its end.
    """
    path = runs / case.name
    if not _is_finished(path):
        run_scenario(load_scenario(CONFIG, overrides=case.overrides()), path)
        if not _is_finished(path):
            message = f"{path}: the run was stopped; the same command continues it"
            raise RuntimeError(message)
    return path


def _is_finished(path: Path) -> bool:
    if not (path / "run.json").is_file():
        return False
    with open_run(path) as run:
        return run.status == "finished"
