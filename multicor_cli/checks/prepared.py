"""A run before its first step: what the checks of a scenario look at."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from multicor_cli.engine.motion.drives import WallDrive
from multicor_cli.model import Model, State
from multicor_cli.model.model import Floats
from multicor_cli.running.estimate import Estimate, estimate
from multicor_cli.running.plan import RunPlan
from multicor_cli.running.time_step import StepReview, review_steps
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.store.origin import Origin


@dataclass(frozen=True)
class Prepared:
    """A scenario with its grains placed.

    Attributes:
        scenario: What is to be done.
        plan: How it will be done.
        model: Its grains and walls.
        state: Where they are.
        threads: Number of threads that will do it.
        directory: Where results will go.
        origin: The moment of another run from which it goes on.
    """

    scenario: Scenario
    plan: RunPlan
    model: Model
    state: State
    threads: int = 1
    directory: Path = Path("runs")
    origin: Origin | None = None

    @cached_property
    def cost(self) -> Estimate:
        """What the run will cost."""
        return estimate(self.scenario, self.plan, self.model, self.state, self.threads)

    @cached_property
    def reviews(self) -> list[StepReview | None]:
        """How the time step of each stage compares with what it needs; None for frozen stages."""
        return review_steps(self.scenario, self.model, self.plan)

    @cached_property
    def gravity(self) -> list[Floats]:
        """Gravity at the end of each stage, if none ends before its duration is over [m/s²], shapes ``(2,)``."""
        lengths = [stage.length or 0.0 for stage in self.plan.stages]
        starts = [0.0, *itertools.accumulate(lengths)]
        return [
            self.model.gravity if stage.gravity is None else stage.gravity.started(starts).value(length)
            for stage, length in zip(self.plan.stages, lengths, strict=True)
        ]

    @cached_property
    def drives(self) -> Sequence[list[WallDrive]]:
        """What the walls do in each stage, as if all stages began at once."""
        return [stage.drives.started([0.0] * len(self.plan.stages)) for stage in self.plan.stages]
