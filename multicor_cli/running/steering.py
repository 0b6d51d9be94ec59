"""A program of the user's that looks at a run after its steps, and may change or end it.

What it decides is kept with the checkpoints, and so are its notes. Between two decisions the run is
that of a scenario, which `multicor_cli.scenario.documents` writes down.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.orders import StepReport
from multicor_cli.model import Model, State
from multicor_cli.model.cell import real_velocity
from multicor_cli.model.contacts import ContactTable
from multicor_cli.running.from_scenario import make_plan, stage_names
from multicor_cli.running.plan import RunPlan, StagePlan
from multicor_cli.scenario.documents import Decision, steered_document
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.store.documents import record_of
from multicor_cli.store.frames import GrainFacts
from multicor_cli.store.rundir import RunDirectory
from multicor_cli.store.schema import read_only

Array = NDArray[Any]


class WallNow(NamedTuple):
    """A wall after a step.

    Attributes:
        position: Reference point [m] and angle [rad], shape ``(3,)``.
        velocity: Velocity [m/s] and spin [rad/s], shape ``(3,)``.
        force: Force [N] and torque [N m] of the grains on it in the last step, shape ``(3,)``.
        surface: Velocity with which its surface runs along it [m/s].
    """

    position: Array
    velocity: Array
    force: Array
    surface: float = 0.0


class LiveRun:
    """A run after a step, for a program that steers it; ``n`` grains are there.

    Arrays are read-only; copy what is to be kept.

    Attributes:
        stage: Name of the loading stage.
        dt: Length of the step [s].
        notes: The program's own dict of JSON values, kept with the checkpoints from call to call.
    """

    def __init__(
        self,
        state: State,
        model: Model,
        stage: StagePlan,
        report: StepReport,
        contacts: Callable[[], ContactTable],
        notes: dict[str, Any],
    ) -> None:
        self._state, self._model, self._report, self._contacts = state, model, report, contacts
        self.stage, self.dt, self.notes = stage.name, stage.dt, notes
        self._has_ended = self._ends_run = False
        self._then: Mapping[str, Any] | None = None

    def end_stage(self, then: Mapping[str, Any] | None = None) -> None:
        """End the stage with this step.

        Args:
            then: A stage that comes next, as a table of ``[[loading]]``, such as
                ``{"duration": 1.0, "drives": {"top": {"x": {"velocity": 0.1}}}}``. What it does not
                name goes on as before. Default: the next stage of the scenario. It is checked as a
                file is: a wrong one is a `ScenarioError` of the run.
        """
        self._has_ended, self._then = True, then

    def end_run(self) -> None:
        """End the stage and the run with this step: it is finished."""
        self._has_ended = self._ends_run = True

    @property
    def step(self) -> int:
        """Steps done since the start of the run."""
        return self._state.step

    @property
    def time(self) -> float:
        """Time since the start of the run [s]."""
        return self._state.time

    @property
    def stage_time(self) -> float:
        """Time since the start of the stage [s]."""
        return self._state.time - self._state.stage_start

    @cached_property
    def number(self) -> Array:
        """Numbers of the grains that are there, shape ``(n,)``."""
        return self._of_grains(np.arange(self._model.grain_count))

    @cached_property
    def grains(self) -> GrainFacts:
        """Radius, mass, material and group of the grains that are there; shapes ``(n,)``."""
        return GrainFacts.of(
            self._model.with_grains(self.number) if self._state.presence.size else self._model
        )

    @property
    def position(self) -> Array:
        """Centers, x wrapped into the period [m], shape ``(n, 2)``."""
        return self._of_grains(self._state.position[:, :2])

    @property
    def angle(self) -> Array:
        """Rotations since the start [rad], shape ``(n,)``."""
        return self._of_grains(self._state.position[:, 2])

    @property
    def velocity(self) -> Array:
        """Velocities [m/s], shape ``(n, 2)``."""
        return self._of_grains(real_velocity(self._model, self._state)[:, :2])

    @property
    def spin(self) -> Array:
        """Spins [rad/s], shape ``(n,)``."""
        return self._of_grains(self._state.velocity[:, 2])

    @property
    def temperature(self) -> Array | None:
        """Temperatures [K], shape ``(n,)``; None without heat."""
        thermal = self._model.thermal
        return None if thermal is None else self._of_grains(self._state.temperature(thermal))

    def _of_grains(self, values: Array) -> Array:
        return read_only(values[self._state.here])

    @property
    def walls(self) -> dict[str, WallNow]:
        """The walls by name."""
        state, impulse = self._state, self._report.wall_impulse
        # Nothing moved
        force = impulse / self.dt if impulse.size else np.zeros_like(state.wall_position)
        surface = state.wall_surface.tolist() or [0.0] * len(force)
        columns = (read_only(each) for each in (state.wall_position, state.wall_velocity, force))
        rows = zip(self._model.walls.names, *columns, surface, strict=True)
        return {name: WallNow(*row) for name, *row in rows}

    @cached_property
    def contacts(self) -> ContactTable:
        """Contacts of the step with a force, by numbers in the run; wall shapes follow grains."""
        table = self._contacts().carrying()
        for values in vars(table).values():
            if values is not None:
                values.flags.writeable = False
        return table

    @property
    def books(self) -> dict[str, float]:
        """Energy books and heat books by name [J]; see docs/reference/formats/results.md."""
        return self._state.named("books") | self._state.named("heat_books")

    def __repr__(self) -> str:
        return f"<LiveRun: step {self.step}, t = {self.time:.6g} s, stage {self.stage}>"


Steer = Callable[[LiveRun], None]
"""A program that steers a run."""


class Steering:
    """Asks the program, and keeps what it decided; ``scenario`` is what is carried out so far."""

    def __init__(
        self, steer: Steer, scenario: Scenario, model: Model, directory: RunDirectory
    ) -> None:
        """Set up: decisions that the run has kept are carried out once more on its scenario."""
        self._steer, self._model, self._directory = steer, model, directory
        self._record = directory.steering or {}
        self._kept: tuple[State, dict[str, Any]] | None = None
        decisions = [record_of(Decision, document) for document in self._record["decisions"]]
        self.scenario = _changed(scenario, decisions) if decisions else scenario
        directory.rename_stages(stage_names(self.scenario))

    def keep(self, state: State) -> None:
        """Keep what a checkpoint needs if the program, due after the coming step, should fail."""
        self._kept = None
        if (state.stage_step + 1) % int(self._record["every"]) == 0:
            arrays = {name: values.copy() for name, values in state.as_dict().items()}
            self._kept = State.from_dict(arrays), copy.deepcopy(self._record["notes"])

    @property
    def is_due(self) -> bool:
        """Whether the program is to be asked after this step."""
        return self._kept is not None

    def ask(
        self,
        state: State,
        stage: StagePlan,
        report: StepReport,
        contacts: Callable[[], ContactTable],
    ) -> RunPlan | None:
        """Ask the program after a step; gives the new plan if it ends the stage.

        Raises what the program raises; `ScenarioError` if the stage that it adds is wrong,
        `ValueError` if its notes cannot be kept.
        """
        now = LiveRun(state, self._model, stage, report, contacts, self._record["notes"])
        self._steer(now)
        self._record["notes"] = _json_of(now.notes)
        plan = None
        if now._has_ended:
            then = None if now._then is None else dict(now._then)
            decision = Decision(
                state.stage, state.step, state.stage_step, stage.dt, then, now._ends_run
            )
            self.scenario = _changed(self.scenario, [decision])
            plan = make_plan(self.scenario, self._model, state)
            if then is not None:  # with its defaults, and numbers for expressions
                then = self.scenario.as_dict()["loading"][state.stage + 1]
            self._record["decisions"].append(replace(decision, then=then).as_document())
            self._directory.rename_stages(stage_names(self.scenario))
        return plan

    def go_back(self) -> State:
        """State and notes before the step after which the program failed, to be saved."""
        assert self._kept is not None
        state, self._record["notes"] = self._kept
        return state


def _changed(scenario: Scenario, decisions: list[Decision]) -> Scenario:
    document = steered_document(scenario.as_dict(), decisions)
    return Scenario.from_dict(document, directory=scenario.path.parent)


def _json_of(notes: Any) -> dict[str, Any]:
    """Notes as a checkpoint gives them back; raises `ValueError` if it would not."""
    of_whom = "the notes of the program that steers"
    try:
        kept = json.loads(json.dumps(notes))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{of_whom} cannot be kept: {error}") from None
    if not isinstance(kept, dict) or kept != notes:
        raise ValueError(
            f"{of_whom} would come back changed: keep a dict with text as keys, lists, finite "
            "numbers"
        )
    return kept
