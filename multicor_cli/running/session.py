"""One session of a run: begun or found where it was left, carried on, its end recorded."""

from __future__ import annotations

import contextlib
import functools
import os
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli import __version__
from multicor_cli.engine import Engine
from multicor_cli.engine.jit.cache import is_compiled
from multicor_cli.engine.orders import StepReport
from multicor_cli.model import TALLY_NAMES, Model, State
from multicor_cli.packing import Placed, place
from multicor_cli.running.controller import Controller, DirectoryRecorder
from multicor_cli.running.differences import added_stages, find_differences, former_defaults
from multicor_cli.running.estimate import compilation
from multicor_cli.running.from_scenario import heat_settings, inflow_rules, make_plan, stage_names
from multicor_cli.running.machine import keep_freed_memory, shared_compilation
from multicor_cli.running.outcome import (
    OBSERVED,
    STEERED,
    ExitCode,
    Observer,
    QuietObserver,
    RunOutcome,
    StopReason,
    exit_code_of,
)
from multicor_cli.running.plan import RunPlan, begin_stage
from multicor_cli.running.signals import StopSignals
from multicor_cli.running.steering import Steer, Steering
from multicor_cli.scenario.problems import Refused, ScenarioError, format_key, show
from multicor_cli.scenario.scenario import Scenario, parse_scenario
from multicor_cli.store import (
    DirectoryRefused,
    RunDirectory,
    StoreError,
    collect_provenance,
    open_run,
)
from multicor_cli.store.documents import Origin, read_run_document, read_scenario
from multicor_cli.store.extension import Extension
from multicor_cli.store.layout import RESOLVED
from multicor_cli.store.provenance import current_command
from multicor_cli.store.rundir import check_usable
from multicor_cli.text import count_noun

_UNCONVERGED = TALLY_NAMES.index("unconverged_steps")

Review = Callable[[Scenario, RunPlan, Model, State], None]


@dataclass
class Session:
    """Carries out a scenario in a directory until it is finished or has to stop.

    What it is made of is what `multicor_cli.run` is given, with all defaults filled in.
    ``stop_signals`` are those that the caller has installed already; ``review`` looks at a new run
    before anything is written, and what it raises ends the run there.
    """

    scenario: Scenario
    path: Path
    _: KW_ONLY
    threads: int
    max_seconds: float | None = None
    overwrite: bool = False
    extend: bool = False
    observer: Observer = field(default_factory=QuietObserver)
    steer: Steer | None = None
    steer_every: int = 1
    stop_signals: StopSignals = field(default_factory=StopSignals)
    review: Review | None = None

    def __post_init__(self) -> None:
        self._compiles = False
        self._started = time.monotonic()

    def run(self) -> RunOutcome:
        """Begin or continue the run; raises as `multicor_cli.run`."""
        has_shapes = any(group.outline is not None for group in self.scenario.particles)
        has_heat = self.scenario.heat is not None
        self._compiles = not is_compiled(has_shapes=has_shapes)
        compilation = shared_compilation(self.threads, has_shapes=has_shapes, has_heat=has_heat)
        with self.stop_signals.installed(), compilation:
            self.stop_signals.on_exit = self._leave
            try:
                if RunDirectory.is_run(self.path) and not self.overwrite:
                    return self._continue()
                if self.extend:
                    raise DirectoryRefused(
                        f"{self.path}: holds no run that could be extended; leave --extend out "
                        "to begin one"
                    )
                return self._begin()
            finally:
                self.observer.closed()

    def _leave(
        self, number: int, directory: RunDirectory | None = None, state: State | None = None
    ) -> None:
        """What a signal does while there is nothing to save: grains placed, kernels compiled."""
        reason = StopReason.of_signal(number)
        self.observer.closed()
        step, time_reached = (state.step, state.time) if state is not None else (0, 0.0)
        told = str(RunOutcome(reason, self.path, step, time_reached, 0))
        if directory is None:
            told = f"{reason.value}: nothing is written yet; the same command begins again"
        self.observer.message(told)
        if directory is not None:
            with directory:
                directory.finish("stopped", stop_reason=reason.value, exit_code=reason.exit_code)

    def _begin(self) -> RunOutcome:
        check_usable(self.path, overwrite=self.overwrite)
        _refuse_own_start(self.scenario, self.path)
        placed = self._build(self.scenario)
        plan = make_plan(self.scenario, placed.model)
        if self.review is not None:
            self.review(self.scenario, plan, placed.model, placed.state)
        provenance = collect_provenance(
            current_command(), seed=self.scenario.seed, threads=self.threads
        )
        with RunDirectory.create(
            self.path,
            self.scenario.sources.text,
            self.scenario.resolved_toml(),
            provenance,
            stages=[stage.name for stage in plan.stages],
            precision=self.scenario.output.precision,
            overwrite=self.overwrite,
            origin=placed.origin,
            steering=self._steering_record(),
        ) as directory:
            return self._carry_on(directory, self.scenario, placed)

    def _continue(self) -> RunOutcome:
        document = read_run_document(self.path)
        self._refuse_other_program(document)
        before = read_scenario(self.path / RESOLVED, document["resolved_sha256"])
        scenario = _as_begun(self.scenario, before, int(document["provenance"]["seed"]))
        extension = self._find_extension(scenario, before)
        with RunDirectory.resume(self.path, extension=extension) as directory:
            if directory.is_finished:
                open_run(self.path).close()  # finished, if its results are still there
                summary = document["summary"]
                return RunOutcome(
                    StopReason.ALREADY_FINISHED,
                    self.path,
                    int(summary["step"]),
                    float(summary["time"]),
                    int(summary["solver"]["unconverged_steps"]),
                    directory.stage_ends,
                )
            with self._recording_failure(directory):
                checkpoint = directory.load_checkpoint()
                if checkpoint is None:
                    self.stop_signals.on_exit = functools.partial(self._leave, directory=directory)
                    placed = self._build(scenario)
                    _refuse_other_origin(scenario, directory.origin, placed.origin)
                    return self._carry_on(directory, scenario, placed)
                version = str(document["provenance"].get("multicor_version", ""))
                if version != __version__:
                    told = f"the run began with multicor {version}, this is {__version__}"
                    self.observer.warning(f"{told}: its bits may differ from here on")
                for warning in checkpoint.warnings:
                    self.observer.warning(warning)
                model, state = directory.load_model() or place(scenario).model, checkpoint.state
                self.observer.message(f"continuing from step {state.step} (t = {state.time:g} s)")
                return self._carry_on(directory, scenario, Placed(model, state), is_new=False)

    def _find_extension(self, scenario: Scenario, before: str) -> Extension | None:
        """The scenario as a longer one; None if it is the same. Raises as `_refuse_changes`."""
        # an earlier version may have written what is no longer valid: compared as it is
        with contextlib.suppress(ScenarioError):
            before = parse_scenario(before, scenario.path).resolved_toml()
        resolved = scenario.resolved_toml()
        added = added_stages(before, resolved)
        if added <= 0:
            _refuse_changes(scenario, before, self.path)
            return None
        stages = count_noun(added, "stage")
        if not self.extend:
            what = f"{stages} more than when the run in {self.path} began"
            remedy = (
                "give --extend to add them to that run, choose another directory with -o, or "
                "start anew with --overwrite"
            )
            raise scenario.refuse(Refused(("loading", len(scenario.loading) - added), what, remedy))
        # What cannot be carried out is refused before it becomes the run's own scenario
        with open_run(self.path) as run:
            if run.info["summary"] is not None:
                make_plan(scenario, run.model)
        self.observer.message(f"adding {stages} to the run")
        return Extension(scenario.sources.text, resolved, stage_names(scenario))

    def _steering_record(self) -> dict[str, Any] | None:
        """What ``run.json`` says at first of the program that steers the run."""
        if self.steer is None:
            return None
        # an object that is called
        named = self.steer if hasattr(self.steer, "__qualname__") else type(self.steer)
        return {
            "by": f"{named.__module__}.{named.__qualname__}",
            "every": self.steer_every,
            "decisions": [],
            "notes": {},
        }

    def _refuse_other_program(self, document: dict[str, Any]) -> None:
        """A run goes on with the program that steered it, or with none; else `DirectoryRefused`."""
        before, now = document.get("steering"), self._steering_record()
        steered = "" if before is None else f"is steered by the Python program {before['by']}"
        what = ""
        if before is not None and self.extend:
            what = (
                f"{steered}, and no stages can be added to it; go on from its end in another run, "
                "with [start]"
            )
        elif document["status"] == "finished" or (before is None and now is None):
            return
        elif now is None:
            what = (
                f"{steered}; go on with it, by multicor_cli.run(…, steer=…), or choose another "
                "directory with -o"
            )
        elif before is None:
            what = "this run began without steer; go on without, or choose another directory"
        elif now["every"] != before["every"]:
            what = (
                f"this run began with steer_every={before['every']}; go on with that, or choose "
                "another directory"
            )
        if what:
            raise DirectoryRefused(f"{self.path}: {what}")

    def _build(self, scenario: Scenario) -> Placed:
        self.observer.message(
            "placing the grains" if scenario.start is None else "taking the grains from another run"
        )
        with self.stop_signals.exit_at_once():
            placed = place(scenario)
        if placed.origin is not None:
            self.observer.message(f"going on from {placed.origin.text}")
            for text in placed.origin.wall_texts:
                self.observer.message(f"walls {text}")
        return placed

    def _carry_on(
        self, directory: RunDirectory, scenario: Scenario, placed: Placed, *, is_new: bool = True
    ) -> RunOutcome:
        model, state = placed.model, placed.state
        with self._recording_failure(directory):
            steering = None
            if self.steer is not None:
                steering = Steering(self.steer, scenario, model, directory)
                scenario = steering.scenario
            plan = make_plan(scenario, model, state)
            first = 0.0 if directory.origin is None else directory.origin.time
            starts = [first] if state.stage == 0 else stage_starts(self.path, state, plan, first)
            writer = directory.writer(model)
            engine = make_engine(scenario, model, state, self.threads)
            what = "cell" if model.is_cell else "wall"
            parts = [count_noun(model.grain_count, "grain"), count_noun(model.wall_count, what)]
            parts.append(count_noun(engine.threads, "thread"))
            if engine.threads < self.threads:
                parts[-1] += f" of the {self.threads} allowed"
            self.observer.message(", ".join(parts))
            if self._compiles:
                once = f"this happens once and takes about {compilation(model)}"
                self.observer.message(f"compiling the kernels; {once}")
            self.stop_signals.on_exit = functools.partial(
                self._leave, directory=directory, state=state
            )
            controller = Controller(
                plan,
                engine,
                DirectoryRecorder(directory, writer),
                observer=self.observer,
                stop_signals=self.stop_signals,
                deadline=None if self.max_seconds is None else self._started + self.max_seconds,
                stage_starts=starts,
                steering=steering,
            )
            reason = controller.run(is_new=is_new)
            timings = {"wall": time.monotonic() - self._started, **engine.timers}
            if reason.is_end:
                self.observer.message("writing results.h5")
            directory.finish(
                "finished" if reason.is_end else "stopped",
                stop_reason=reason.value,
                exit_code=reason.exit_code,
                timings=timings,
            )
        unconverged = round(float(state.tallies[_UNCONVERGED]))
        return RunOutcome(
            reason, self.path, state.step, state.time, unconverged, directory.stage_ends
        )

    @contextlib.contextmanager
    def _recording_failure(self, directory: RunDirectory) -> Iterator[None]:
        """Write into ``run.json`` why the run failed, if possible; the error goes on."""
        try:
            yield
        except Exception as error:
            if directory.status == "running":
                with contextlib.suppress(StoreError, MemoryError):
                    code, reason = exit_code_of(error), str(error)
                    notes = getattr(error, "__notes__", ())
                    whose = next((who for who in (STEERED, OBSERVED) if who in notes), "")
                    if whose or code is ExitCode.BUG:
                        where = whose or "internal error"
                        reason = f"{where}: {type(error).__name__}: {error}"
                    directory.finish("failed", stop_reason=reason, exit_code=code)
            raise


def make_engine(scenario: Scenario, model: Model, state: State, threads: int) -> Engine:
    """The engine of a run; raises `ScenarioError` if the domain is too small for the grains."""
    keep_freed_memory()
    inflow = None if model.outlets is None else inflow_rules(scenario, model)
    try:
        return Engine(
            model, state, threads=threads, heat=heat_settings(scenario, model), inflow=inflow
        )
    except ValueError as error:
        refused = Refused(("domain", "size"), str(error), "widen the domain")
        raise scenario.refuse(refused) from error


def stage_starts(path: Path, state: State, plan: RunPlan, first: float = 0.0) -> list[float]:
    """Times at which the stages up to that of ``state`` have begun [s], from frames at their ends.

    The ``first`` stage did not begin at 0 on the clock of a run from which this one goes on.
    """
    with open_run(path) as run:
        stages, steps, lengths = run.frames.stage, run.frames.step, run.frames.column("steps/dt")
    ends = [int(np.flatnonzero(stages == k)[-1]) for k in range(state.stage)]
    starts, done = [first], 0
    for stage, end in zip(plan.stages, ends, strict=False):
        count = int(steps[end]) - done
        # A frozen stage takes no step of the mechanics. An earlier version may have chosen another
        # step, and cuts no last one.
        is_planned = stage.is_frozen or float(lengths[end]) == stage.step_after(count - 1)
        starts.append(
            starts[-1] + (stage.time_after(count) if is_planned else count * float(lengths[end]))
        )
        done = int(steps[end])
    return starts


def _as_begun(scenario: Scenario, before: str, seed: int) -> Scenario:
    """The scenario with what the run has of its own: defaults of the version that began it, groups
    that it took from another run, whatever became of that, and the seed that it drew by chance.
    """
    given = scenario.given
    if former := former_defaults(before, scenario.resolved_toml(), given):
        scenario = scenario.with_overrides(former)
    if scenario.start is not None and "particles" not in given:
        groups = parse_scenario(before, scenario.path).particles
        scenario = scenario.model_copy(update={"particles": groups})
    return scenario.with_drawn(seed)


def _refuse_own_start(scenario: Scenario, path: Path) -> None:
    """A run cannot replace the one that it goes on from."""
    other = None if scenario.start is None else scenario.resolve_path(scenario.start.run)
    if other is not None and os.path.realpath(other) == os.path.realpath(path):
        what = f"the run '{path}' is the one that this run would replace"
        remedy = (
            "choose another directory with -o; to add stages to that run itself, use its own "
            "scenario and --extend"
        )
        raise scenario.refuse(Refused(("start", "run"), what, remedy))


def _refuse_other_origin(scenario: Scenario, before: Origin | None, now: Origin | None) -> None:
    """A run that was stopped before its first checkpoint begins once more from the same moment."""
    if before is not None and now is not None and before.digest != now.digest:
        what = (
            f"this run began from digest {before.digest} (step {before.step}), the other run has "
            f"digest {now.digest} there now"
        )
        remedy = f"start anew with --overwrite, or go on from a frame at step {before.step}"
        raise scenario.refuse(Refused(("start", "run"), what, remedy))


_FEW_CHANGES = 3
"""So many are told one by one, with their values; more of them together."""


def _refuse_changes(scenario: Scenario, before: str, path: Path) -> None:
    """Refuse another scenario than the run began with; keys that came later have their defaults."""
    remedy = (
        "undo the change to continue the run, choose another directory with -o, or start anew "
        "with --overwrite"
    )
    found = find_differences(before, scenario.resolved_toml())
    if len(found) > _FEW_CHANGES:
        name = tomllib.loads(before)["scenario"]["name"]
        keys = ", ".join(format_key(each.path) for each in found[:_FEW_CHANGES])
        what = (
            f"{path} holds the run {show(name)} of another scenario: {len(found)} keys differ, as "
            f"{keys}"
        )
        raise scenario.refuse(Refused((), what, remedy))
    began = f"when the run in {path} began"
    changed = [
        Refused(each.path, f"was {each.before} {began}, is {each.after} now", remedy)
        for each in found
    ]
    if changed:
        raise scenario.refuse(*changed)


# ---- One step of a run, to see whether it would start


def try_step(scenario: Scenario, model: Model, state: State, threads: int) -> StepReport:
    """Do the first step of a run; nothing is written. **Modifies** the initial ``state``.

    Raises `ScenarioError` if the domain is too small, `PhysicsError` if the step fails.
    """
    stage = make_plan(scenario, model).stages[0]
    engine = make_engine(scenario, model, state, threads)
    engine.pass_grains()
    begin_stage(engine, stage, [0.0])
    return engine.step(stage.step_after(0), 0.0)
