"""What a check is (a number, its limits, what follows if it is beyond them), and what it looks at.

A `Rule` is one kind of check, with everything about it in one place: how its number is found, its
limits, what it means, what to do. Judging a subject by it gives a `Check`. The page
docs/reference/checks.md is made of the rules.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from multicor_cli.engine.motion.drives import WallDrive
from multicor_cli.model import Model, State
from multicor_cli.model.model import ContactLaws, Floats
from multicor_cli.running.estimate import Estimate, estimate
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import RunPlan, StagePlan
from multicor_cli.running.time_step import StepReview, largest_gravity, review_steps
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.scenario.scenario import Scenario, parse_scenario
from multicor_cli.store import Run
from multicor_cli.store.documents import Origin

# ---- A check and its rule

S = TypeVar("S")


class Verdict(Enum):
    """How a check came out."""

    OK = "ok"
    WARNING = "warning"  # to be known, and often meant
    BAD = "bad"  # results are not to be relied on, or the run will not get through


_ORDER = list(Verdict)
_LONGEST = 110  # letters of what a number belongs to: names may be of any length


class Measured(NamedTuple):
    """A number to be judged, and what it belongs to: a stage, a material, a wall."""

    value: float
    about: str = ""


@dataclass(frozen=True)
class Check:
    """The outcome of one check.

    Attributes:
        name: What is checked.
        value: The number; of several (stages, materials) the one farthest beyond its limits.
        text: The number for people, with its unit and what it belongs to.
        limit: Its limits, in words.
        verdict: How it came out.
        meaning: What the number says.
        remedy: What to do if it is beyond its limits.
    """

    name: str
    value: float
    text: str
    limit: str
    verdict: Verdict
    meaning: str
    remedy: str

    def as_dict(self) -> dict[str, Any]:
        """As JSON types."""
        return {**asdict(self), "verdict": self.verdict.value}


@dataclass(frozen=True)
class Rule(Generic[S]):
    """One kind of check.

    Attributes:
        name: What is checked.
        measure: Finds the numbers in a subject; none if the check does not apply to it.
        meaning: What the number says.
        remedy: What to do if it is beyond its limits.
        unit: What stands behind the number.
        warning: Largest value without a warning.
        bad: Largest value that is not bad; None: no value is.
        least: Smallest value without a warning; None: there is no such limit.
    """

    name: str
    measure: Callable[[S], Iterable[Measured]]
    meaning: str
    remedy: str
    unit: str = ""
    warning: float = math.inf
    bad: float | None = None
    least: float | None = None

    @property
    def limit(self) -> str:
        """The limits in words."""
        if self.least is not None:
            has_top = self.warning < math.inf
            return f"{self.least:g} to {self.warning:g}" if has_top else f"at least {self.least:g}"
        if self.bad == self.warning:
            return f"bad above {self.bad:g}"
        normal = "none" if self.warning == 0.0 else f"at most {self.warning:g}"
        return normal if self.bad is None else f"{normal}, bad above {self.bad:g}"

    def judge(self, subject: S) -> Check | None:
        """The check of a subject; None if it does not apply."""
        found = list(self.measure(subject))
        if not found:
            return None
        value, about = max(
            found, key=lambda it: (_ORDER.index(self._verdict(it.value)), self._excess(it.value))
        )
        text = f"{value:.3g} {self.unit}".strip()
        if about:
            text += f" ({about if len(about) <= _LONGEST else about[: _LONGEST - 1] + '…'})"
        verdict = self._verdict(value)
        return Check(self.name, value, text, self.limit, verdict, self.meaning, self.remedy)

    def _verdict(self, value: float) -> Verdict:
        # What is not a number is beyond every limit.
        if self.bad is not None and not value <= self.bad:
            return Verdict.BAD
        is_normal = value <= self.warning and (self.least is None or value >= self.least)
        return Verdict.OK if is_normal else Verdict.WARNING

    def _excess(self, value: float) -> float:
        """How far a number is towards its limits: the larger, the nearer or the farther beyond."""
        if self.least is None:
            return value
        return max(value / self.warning, self.least / value if value > 0.0 else math.inf)


def judge_all(rules: Sequence[Rule[S]], subject: S) -> list[Check]:
    """The checks of a subject, in the order of the rules; those that do not apply are left out."""
    return [check for rule in rules if (check := rule.judge(subject)) is not None]


def worst_verdict(checks: Iterable[Check]) -> Verdict:
    """The worst verdict of some checks; ok if there are none."""
    return max((check.verdict for check in checks), key=_ORDER.index, default=Verdict.OK)


# ---- A run before its first step: what the checks of a scenario look at

_SAMPLES = 32


def moments_of(stage: StagePlan) -> list[float]:
    """Times spread over a stage, or over the first second where its end is not known [s]."""
    length = 1.0 if stage.length is None else stage.length
    return [length * (k + 0.5) / _SAMPLES for k in range(_SAMPLES)]


@dataclass(frozen=True)
class Prepared:
    """A scenario with its grains placed.

    It will be carried out by so many ``threads`` into a ``directory``; ``origin`` is the moment of
    another run from which it goes on.
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
        return estimate(self.scenario, self.plan, self.model, self.state, self.threads)

    @cached_property
    def reviews(self) -> list[StepReview | None]:
        """How the time step of each stage compares with what it needs; None for frozen stages."""
        return review_steps(self.scenario, self.model, self.plan)

    @cached_property
    def gravity(self) -> list[Floats]:
        """Gravity at the ends of stages, if none ends before its time [m/s²], shapes ``(2,)``."""
        lengths = [stage.length or 0.0 for stage in self.plan.stages]
        starts = [0.0, *itertools.accumulate(lengths)]
        return [
            self.model.gravity
            if stage.gravity is None
            else stage.gravity.started(starts).value(length)
            for stage, length in zip(self.plan.stages, lengths, strict=True)
        ]

    @property
    def laws(self) -> Iterator[tuple[str, ContactLaws]]:
        """Contact laws at first, and those of stages that name others; with the stage, in words."""
        yield "", self.model.laws
        for stage in self.plan.stages:
            if stage.laws is not None:
                yield f"stage {stage.name}", stage.laws

    @cached_property
    def drives(self) -> Sequence[list[WallDrive]]:
        """What the walls do in each stage, as if all stages began at once."""
        return [stage.drives.started([0.0] * len(self.plan.stages)) for stage in self.plan.stages]


# ---- A run from its first step on: what the checks of a run look at


@dataclass(frozen=True)
class Recorded:
    """A run directory, of a run that goes on or has ended, and what `run_info` says of it."""

    run: Run
    info: dict[str, Any]

    @cached_property
    def planned(self) -> tuple[Scenario, RunPlan] | None:
        """The scenario and its plan; None if this version cannot read it."""
        with contextlib.suppress(ScenarioError):
            scenario = parse_scenario(self.run.scenario_resolved, self.run.path)
            return scenario, make_plan(scenario, self.run.model)
        return None

    @cached_property
    def reviews(self) -> list[StepReview | None]:
        """How the time step of each stage compares with what it needs; None for frozen stages."""
        if self.planned is None:
            return []
        return review_steps(self.planned[0], self.run.model, self.planned[1])

    @cached_property
    def gravity(self) -> Floats:
        """Gravity at the newest checkpoint [m/s²], shape ``(2,)``; the domain's without a plan."""
        starts = [0.0, *(end["time"] for end in self.info["stage_ends"])]
        number = self._stage
        gravity = None if number is None else self.stages[number].gravity
        if number is None or gravity is None or number >= len(starts):
            return self.run.model.gravity
        return gravity.started(starts).value(self.info["time"] - starts[number])

    @property
    def stages(self) -> Sequence[StagePlan]:
        """What is planned; none where the plan is not known."""
        return [] if self.planned is None else self.planned[1].stages

    @property
    def _stage(self) -> int | None:
        """Index of the newest stage; None where no plan is known."""
        if not self.stages or self.info["stage"] is None:
            return None
        return min(int(self.info["stage"]), len(self.stages) - 1)

    @cached_property
    def largest_gravity(self) -> float:
        """Largest gravity in any stage [m/s²]; that of the domain where no plan is known."""
        model = self.run.model
        largest = (largest_gravity(stage, model)[2] for stage in self.stages)
        return max(largest, default=math.hypot(*model.gravity.tolist()))

    def laws(self, stage: int) -> ContactLaws:
        """Contact laws of a stage; those of the model where the plan is not known."""
        laws = self.stages[stage].laws if self.stages else None
        return self.run.model.laws if laws is None else laws

    @cached_property
    def lifted_walls(self) -> list[int]:
        """Walls whose height follows from forces in the newest stage; none without a known plan."""
        number = self._stage
        if number is None:
            return []
        drives = self.stages[number].drives.started([0.0] * (number + 1))
        return [w for w, drive in enumerate(drives) if drive.y.is_driven]

    def noted(self, *keys: str) -> Iterator[Measured]:
        """A number of the summary, if it is known, to be judged."""
        value: Any = self.info
        for key in keys:
            value = None if value is None else value.get(key)
        if value is not None:
            yield Measured(value)

    def summary(self, *keys: str) -> Iterator[Measured]:
        """As `noted`, of a run with steps."""
        return self.noted(*keys) if self.has_steps else iter(())

    @property
    def has_steps(self) -> bool:
        """Whether the books of a step are there."""
        return bool(self.info["step"])

    def book(self, name: str) -> float:
        """An energy book of the newest checkpoint [J]."""
        return float(self.info["books"][name])

    def rows(self, stage: int) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Rows of the time series in a stage that end a window in which something moved."""
        is_moving = np.asarray(self.run.series["window_duration"]) > 0.0
        return np.flatnonzero((np.asarray(self.run.series["stage"]) == stage) & is_moving)

    def series(self, name: str) -> Floats:
        return np.asarray(self.run.series[name], np.float64)
