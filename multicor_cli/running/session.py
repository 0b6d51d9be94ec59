"""One session of a run: starting it or finding where it was left, carrying it on, and recording how it ended."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from multicor_cli import __version__
from multicor_cli.engine import Engine
from multicor_cli.engine.coupled import CoupledEngine
from multicor_cli.engine.exchange.engine import OpenEngine
from multicor_cli.engine.exchange.watch import stray_warnings
from multicor_cli.engine.heat.step import HeatEngine
from multicor_cli.engine.heat.watch import biot_warning, undelivered_warning
from multicor_cli.engine.jit.cache import is_compiled
from multicor_cli.model import EXCHANGE_NAMES, HEAT_BOOK_NAMES, TALLY_NAMES, Model, State
from multicor_cli.model.fallen import count_fallen
from multicor_cli.packing import build
from multicor_cli.running.controller import Controller
from multicor_cli.running.differences import find_differences, former_defaults
from multicor_cli.running.exchange_plan import exchange_rules
from multicor_cli.running.heat_plan import heat_settings
from multicor_cli.running.memory import keep_freed_memory
from multicor_cli.running.observer import Observer, SilentObserver
from multicor_cli.running.outcome import ExitCode, RunOutcome, StopReason, exit_code_of
from multicor_cli.running.planning import make_plan
from multicor_cli.running.recorder import DirectoryRecorder
from multicor_cli.running.signals import Switchboard
from multicor_cli.scenario.load import parse_scenario
from multicor_cli.scenario.overrides import apply_overrides
from multicor_cli.scenario.problems import ScenarioError
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.store import RunDirectory, StoreError, collect_provenance, open_run
from multicor_cli.store.layout import RESOLVED
from multicor_cli.store.prepare import check_usable, read_scenario
from multicor_cli.store.provenance import current_command
from multicor_cli.store.run_document import read_run_document

_UNCONVERGED = TALLY_NAMES.index("unconverged_steps")
_STRAYS = tuple(EXCHANGE_NAMES.index(name) for name in ("lost", "behind"))


class Session:
    """Carries out a scenario in a directory until it is finished or has to stop."""

    def __init__(
        self,
        scenario: Scenario,
        path: Path,
        *,
        threads: int,
        max_seconds: float | None = None,
        overwrite: bool = False,
        observer: Observer | None = None,
        switchboard: Switchboard | None = None,
    ) -> None:
        """Set up; nothing is read or written yet.

        Args:
            scenario: What to do.
            path: The run directory.
            threads: Number of threads of the solver.
            max_seconds: Wall-clock time from now at which to stop with a checkpoint.
            overwrite: Whether a run that is there may be removed.
            observer: Who is told.
            switchboard: Where signals arrive, if the caller has installed one already.
        """
        self._scenario = scenario
        self._path = path
        self._threads = threads
        self._overwrite = overwrite
        self._observer = observer or SilentObserver()
        self._signals = switchboard or Switchboard()
        self._started = time.monotonic()
        self._deadline = None if max_seconds is None else self._started + max_seconds

    def run(self) -> RunOutcome:
        """Begin or continue the run.

        Raises:
            ScenarioError: If the grains cannot be placed, or the run began with another scenario.
            PhysicsError: If the run cannot go on; its last checkpoint is kept.
            StageTimeout: If the condition of a stage was not reached in time, and that is to stop the run.
            StoreError: If the directory cannot be used, or a file cannot be written or is damaged.
        """
        with self._signals.installed():
            self._signals.farewell = self._leave
            try:
                if RunDirectory.is_run(self._path) and not self._overwrite:
                    return self._continue()
                return self._begin()
            finally:
                self._observer.closed()

    def _leave(self, number: int, directory: RunDirectory | None = None, state: State | None = None) -> None:
        """What a signal does where nothing has to be saved: while grains are placed, or kernels compile in a first step."""
        reason = StopReason.of_signal(number)
        self._observer.closed()
        step, time_reached = (state.step, state.time) if state is not None else (0, 0.0)
        self._observer.message(str(RunOutcome(reason, self._path, step, time_reached, 0)))
        if directory is not None:
            with directory:
                directory.finish("stopped", stop_reason=reason.value, exit_code=reason.exit_code)

    def _begin(self) -> RunOutcome:
        check_usable(self._path, overwrite=self._overwrite)
        model, state = self._build(self._scenario)
        plan = make_plan(self._scenario, model)
        provenance = collect_provenance(current_command(), seed=self._scenario.seed, threads=self._threads)
        with RunDirectory.create(
            self._path,
            self._scenario.source,
            self._scenario.resolved_toml(),
            provenance,
            stages=[stage.name for stage in plan.stages],
            precision=self._scenario.output.precision,
            overwrite=self._overwrite,
        ) as directory:
            return self._carry_on(directory, self._scenario, model, state, is_new=True)

    def _continue(self) -> RunOutcome:
        document = read_run_document(self._path)
        before = read_scenario(self._path / RESOLVED, document["resolved_sha256"])
        scenario = _with_seed_of(_with_defaults_of(self._scenario, before), int(document["provenance"]["seed"]))
        _refuse_changes(scenario, before, self._path)
        with RunDirectory.resume(self._path) as directory:
            if directory.is_finished:
                summary = document["summary"]
                return RunOutcome(
                    StopReason.ALREADY_FINISHED,
                    self._path,
                    int(summary["step"]),
                    float(summary["time"]),
                    int(summary["solver"]["unconverged_steps"]),
                    directory.stage_ends,
                )
            with self._recording_failure(directory):
                checkpoint = directory.load_checkpoint()
                if checkpoint is None:
                    self._signals.farewell = functools.partial(self._leave, directory=directory)
                    model, state = self._build(scenario)
                    return self._carry_on(directory, scenario, model, state, is_new=True)
                self._compare_versions(str(directory.provenance.get("multicor_version", "")))
                for warning in checkpoint.warnings:
                    self._observer.warning(warning)
                model = directory.load_model() or build(scenario)[0]
                self._observer.message(f"continuing from step {checkpoint.state.step} (t = {checkpoint.state.time:g} s)")
                return self._carry_on(directory, scenario, model, checkpoint.state, is_new=False)

    def _compare_versions(self, before: str) -> None:
        if before != __version__:
            self._observer.warning(f"the run began with multicor {before}, this is {__version__}: its bits may differ from here on")

    def _build(self, scenario: Scenario) -> tuple[Model, State]:
        self._observer.message("placing the grains")
        with self._signals.impatient():
            return build(scenario)

    def _carry_on(self, directory: RunDirectory, scenario: Scenario, model: Model, state: State, *, is_new: bool) -> RunOutcome:
        with self._recording_failure(directory):
            plan = make_plan(scenario, model, state)
            starts = [0.0] if state.stage == 0 else stage_starts(self._path, state)
            writer = directory.writer(model)
            engine = make_stepper(scenario, model, state, self._threads)
            self._announce(model, engine)
            self._signals.farewell = functools.partial(self._leave, directory=directory, state=state)
            controller = Controller(
                plan,
                engine,
                DirectoryRecorder(directory, writer),
                observer=self._observer,
                switchboard=self._signals,
                deadline=self._deadline,
                stage_starts=starts,
            )
            reason = controller.run(is_new=is_new)
            self._warn_of_heat(state)
            self._warn_of_strays(state, model)
            timings = {"wall": time.monotonic() - self._started, **engine.timers}
            if reason.is_end:
                self._observer.message("writing results.h5")
            directory.finish(
                "finished" if reason.is_end else "stopped",
                stop_reason=reason.value,
                exit_code=reason.exit_code,
                timings=timings,
            )
        unconverged = round(float(state.tallies[_UNCONVERGED]))
        return RunOutcome(reason, self._path, state.step, state.time, unconverged, directory.stage_ends)

    def _announce(self, model: Model, engine: CoupledEngine | OpenEngine) -> None:
        threads = engine.threads
        plural = "thread" if threads == 1 else "threads"
        self._observer.message(f"{model.grain_count} grains, {model.wall_count} walls, {threads} {plural}")
        if not is_compiled():
            self._observer.message("compiling the kernels; this happens once and takes up to half a minute")

    def _warn_of_heat(self, state: State) -> None:
        if not state.heat_books.size:
            return
        biot, undelivered = (float(state.heat_books[HEAT_BOOK_NAMES.index(name)]) for name in ("max_biot", "undelivered"))
        for warning in (biot_warning(biot), undelivered_warning(undelivered)):
            if warning is not None:
                self._observer.warning(warning)

    def _warn_of_strays(self, state: State, model: Model) -> None:
        lost, behind = (round(float(state.exchange[k])) if state.exchange.size else 0 for k in _STRAYS)
        for warning in stray_warnings(count_fallen(state, model), lost, behind):
            self._observer.warning(warning)

    @contextlib.contextmanager
    def _recording_failure(self, directory: RunDirectory) -> Iterator[None]:
        """Write into ``run.json`` why the run failed, as far as that is possible, and let the error go on."""
        try:
            yield
        except Exception as error:
            if directory.status == "running":
                with contextlib.suppress(StoreError, MemoryError):
                    directory.finish("failed", stop_reason=_describe(error), exit_code=exit_code_of(error))
            raise


def make_engine(scenario: Scenario, model: Model, state: State, threads: int) -> CoupledEngine:
    """The engine of a run; raises `ScenarioError` if the domain is too small for the grains."""
    keep_freed_memory()
    try:
        mechanics = Engine(model, state, threads=threads)
    except ValueError as error:
        raise ScenarioError([scenario.problem(("domain", "size"), str(error), "widen the domain")]) from error
    settings = heat_settings(scenario, model)
    return CoupledEngine(mechanics, None if settings is None else HeatEngine(model, state, settings))


def make_stepper(scenario: Scenario, model: Model, state: State, threads: int) -> CoupledEngine | OpenEngine:
    """As `make_engine`; grains come and go as the scenario says."""
    if model.outlets is None:
        return make_engine(scenario, model, state, threads)

    def make(model: Model, state: State) -> CoupledEngine:
        return make_engine(scenario, model, state, threads)

    return OpenEngine(model, state, exchange_rules(scenario, model), make)


def stage_starts(path: Path, state: State) -> list[float]:
    """Times at which the stages up to that of ``state`` have begun [s]: each stage but the last has left a frame of its end."""
    with open_run(path) as run:
        stages, times = run.frames.stage, run.frames.time
    return [0.0, *(float(times[stages == k][-1]) for k in range(state.stage - 1)), state.stage_start]


def _describe(error: Exception) -> str:
    return str(error) if exit_code_of(error) is not ExitCode.BUG else f"internal error: {type(error).__name__}: {error}"


def _with_defaults_of(scenario: Scenario, before: str) -> Scenario:
    """The scenario with the defaults of the version that began the run, where it leaves keys to their defaults."""
    former = former_defaults(before, scenario.resolved_toml(), _given(scenario))
    own = scenario.sources.applied.values()
    return parse_scenario(scenario.source, scenario.path, [*own, *former]) if former else scenario


def _with_seed_of(scenario: Scenario, seed: int) -> Scenario:
    """The scenario with the seed that the run drew at its start, if it leaves the seed to chance."""
    if _given(scenario)["scenario"]["seed"] != "random":
        return scenario
    header = scenario.model.scenario.model_copy(update={"seed": seed})
    return dataclasses.replace(scenario, model=scenario.model.model_copy(update={"scenario": header}))


def _given(scenario: Scenario) -> dict[str, Any]:
    """What the user has written, in the file and in overrides: no defaults."""
    data = tomllib.loads(scenario.source)
    apply_overrides(data, list(scenario.sources.applied.values()))
    return data


def _refuse_changes(scenario: Scenario, before: str, path: Path) -> None:
    """A run is continued only with the scenario with which it began; keys that came later have their defaults."""
    with contextlib.suppress(ScenarioError):  # an earlier version may have written what is no longer valid: compared as it is
        before = parse_scenario(before, scenario.path).resolved_toml()
    changes = find_differences(before, scenario.resolved_toml())
    remedy = "undo the change to continue the run, choose another directory with -o, or start anew with --overwrite"
    if changes:
        raise ScenarioError(
            [
                scenario.problem(change.path, f"was {change.before} when the run in {path} began, is {change.after} now", remedy)
                for change in changes
            ]
        )
