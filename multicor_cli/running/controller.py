"""The loop over steps and loading stages, and what of it goes into files."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from multicor_cli.engine.orders import Interrupted, PhysicsError, StepReport
from multicor_cli.model import State
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.state import find_absurd_value
from multicor_cli.running.conditions import StepDone, is_due, update_peak
from multicor_cli.running.outcome import (
    OBSERVED,
    STEERED,
    Observer,
    QuietObserver,
    StageTimeout,
    Status,
    StopReason,
)
from multicor_cli.running.plan import RunPlan, StagePlan, begin_stage, foresee_steps
from multicor_cli.running.signals import StopSignals
from multicor_cli.running.steering import Steering
from multicor_cli.store.documents import Reason, StageEnd
from multicor_cli.store.rundir import RunDirectory
from multicor_cli.store.segments import FrameWriter
from multicor_cli.store.snapshot import Snapshot

if TYPE_CHECKING:
    from multicor_cli.engine import Engine

# ---- From the controller to the files of a run directory


class DirectoryRecorder:
    """Writes what the controller says into a run directory; each may raise as `checkpoint`."""

    def __init__(self, directory: RunDirectory, writer: FrameWriter) -> None:
        self._directory, self._writer = directory, writer
        self.stage_ended, self.heartbeat = directory.stage_ended, directory.progress

    def frame(self, state: State, contacts: ContactTable | None) -> None:
        self._require_sound(state)
        self._writer.frame(Snapshot(state, self._writer.model, contacts))

    def series(self, state: State) -> None:
        self._require_sound(state)
        self._writer.series_row(Snapshot(state, self._writer.model))

    def checkpoint(self, state: State) -> None:
        """Commit the output so far, then the state; raises `StoreError`.

        `PhysicsError` if a value is not finite or absurd: what is on disk stays right.
        """
        self._require_sound(state)
        self._directory.checkpoint(state, self._writer)

    def _require_sound(self, state: State) -> None:
        fault = find_absurd_value(state, self._writer.model)
        if fault is not None:
            raise PhysicsError(state.step, fault)


# ---- How fast a run goes and when it will be done, the compilation of the kernels left out

WARM_UP_STEPS = 3
"""Steps of this process left out: kernels compile, or are loaded from the cache, in them."""

RECENT = 20.0
"""Length of wall-clock time over which the current speed is measured [s]."""

SPACING = 0.1
"""Shortest wall-clock time between two points [s]."""


class Pace:
    """Speed and remaining time, from the clock, steps of this process and share of the run done."""

    def __init__(self) -> None:
        self._start: tuple[float, int, float] | None = None
        self._samples: deque[tuple[float, int]] = deque()
        self._progress = 0.0

    def note(self, now: float, steps: int, progress: float) -> None:
        """Note a point, except in the warm-up or too close to the one before."""
        if steps < WARM_UP_STEPS or (self._samples and now - self._samples[-1][0] < SPACING):
            return
        if self._start is None:
            self._start = (now, steps, progress)
        self._progress = progress
        self._samples.append((now, steps))
        while now - self._samples[0][0] > RECENT and len(self._samples) > 2:
            self._samples.popleft()

    def speed(self) -> float | None:
        """Recent speed [steps/s], or None as long as that is unknown."""
        if len(self._samples) < 2:
            return None
        (first, before), (last, after) = self._samples[0], self._samples[-1]
        return (after - before) / (last - first) if last > first else None

    def remaining(self) -> float | None:
        """Seconds left if the run goes on as since the warm-up; None as long as that is unknown."""
        if self._start is None:
            return None
        begun, _, done_before = self._start
        now, done = self._samples[-1][0], self._progress - done_before
        if done <= 0.0 or now <= begun:
            return None
        return (1.0 - self._progress) * (now - begun) / done


# ---- The loop

HEARTBEAT = 2.0
"""Wall-clock time between two heartbeats [s]."""

CHECKPOINT_SHARE = 20.0
"""Checkpoints are this many times as far apart as one takes: never more than a 20th of a run."""


class Recorder(Protocol):
    """Where the controller's results go: the files of a run."""

    def frame(self, state: State, contacts: ContactTable | None) -> None: ...
    def series(self, state: State) -> None: ...
    def stage_ended(self, end: StageEnd) -> None: ...
    def checkpoint(self, state: State) -> None: ...
    def heartbeat(self, data: dict[str, Any]) -> None: ...


@dataclass
class Controller:
    """Carries out a plan, from wherever the state is; nothing is written before it is told to run.

    The order, which decides what a frame and a checkpoint hold:

    1. At the very start of a run: the drives of the first stage (the books hold the energy of walls
       that loads drive); frame 0 and series row 0, then a checkpoint.
    2. Before every step: stop if a signal or the time limit says so (after a checkpoint); a
       checkpoint if one is due.
    3. Before every step but frozen ones: grains go and come. Before the first step of a stage: its
       drives.
    4. A step; then peak energy of the stage, and what its condition notes of the step. If the stage
       goes on, the program that steers the run is asked, if there is one: it may end the stage. If
       it fails, a checkpoint of the state before the step.
    5. If due or the stage is over: series row (the window starts anew), frame.
    6. If the stage is over: the state moves on to the next stage. After the last one: a checkpoint.
       If its time ran out and that is to stop the run: a checkpoint with the state where it is, and
       `StageTimeout`. Told to go on, the run starts from here.
    7. The observer is told. If it fails, a checkpoint.

    A checkpoint is thus taken only where everything due has been written, and what is due depends
    on the state alone. That makes a resumed run equal to one that was never stopped.

    Attributes:
        deadline: What the ``clock`` reads when the run stops [s].
        stage_starts: Times at which the stages up to that of the state have begun [s]; for a run
            that goes on from another on the clock of that one, so that the offsets by which signals
            are carried on have the same bits.
        steering: The program that steers, which is not asked in frozen stages.
    """

    plan: RunPlan
    engine: Engine
    recorder: Recorder
    _: KW_ONLY
    observer: Observer = field(default_factory=QuietObserver)
    stop_signals: StopSignals = field(default_factory=StopSignals)
    deadline: float | None = None
    stage_starts: list[float] = field(default_factory=lambda: [0.0])
    steering: Steering | None = None
    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        self._pace = Pace()
        self._steps = 0
        self._foreseen = foresee_steps(self.plan, self.engine.state)
        self._has_moved_on = False
        self._last_checkpoint = self.clock()
        self._checkpoint_took = 0.0
        self._last_heartbeat = float("-inf")

    def run(self, *, is_new: bool) -> StopReason:
        """Go on to the end of the last stage, or to the first reason to stop.

        ``is_new``: the run starts here, and its initial state is still to be written. Raises
        `PhysicsError` from a step (what is lost since the last checkpoint can be computed again),
        `StoreError`, or `StageTimeout` if a stage ran out of time and that is to stop the run.
        """
        if is_new:
            begin_stage(self.engine, self.plan.stages[0], self.stage_starts)
            self._write_series()
            self._write_frame()
            self._checkpoint()
        state = self.engine.state
        if 0 < state.stage < len(self.plan.stages) and state.stage_step == 0:
            # Left between two stages: books of walls go from drives of the one to the other's.
            self.engine.resume(self.plan.stages[state.stage - 1].orders(self.stage_starts[:-1]))
        while state.stage < len(self.plan.stages):
            reason = self._run_stage(self.plan.stages[state.stage])
            if reason is not None:
                return reason
        if self._has_moved_on:
            self._checkpoint()
        self.recorder.heartbeat({"step": state.step, "time": state.time, "progress": 1.0})
        return StopReason.FINISHED

    def _run_stage(self, stage: StagePlan) -> StopReason | None:
        """Carry out the rest of a stage; None if it came to its end."""
        state = self.engine.state
        if state.stage_step > 0:
            if stage.reason_to_end(state) == "timeout":
                self._end_stage(stage, "timeout")
                return None
            self.engine.resume(stage.orders(self.stage_starts))
        while True:
            reason = None
            if self.stop_signals.stop_signal is not None:
                reason = StopReason.of_signal(self.stop_signals.stop_signal)
            elif self.deadline is not None and self.clock() >= self.deadline:
                reason = StopReason.TIME_LIMIT
            if reason is not None:
                self._checkpoint()
                return reason
            self._checkpoint_if_due()
            if self.steering is not None:
                self.steering.keep(state)
            report = self._first_step(stage) if state.stage_step == 0 else self._step(stage)
            if report is not None and self._after_step(stage, report):
                return None

    def _first_step(self, stage: StagePlan) -> StepReport | None:
        """The first step; if it is interrupted, the state is what it was before the stage."""
        state = self.engine.state
        books, origin = state.books.copy(), state.wall_origin
        if not stage.is_frozen:
            self.engine.pass_grains()
        begin_stage(self.engine, stage, self.stage_starts)
        report = self._step(stage)
        if report is None:
            state.books[:] = books
            state.wall_origin = origin
            state.stage_peak = 0.0
            state.stage_notes = np.empty(0)
        return report

    def _step(self, stage: StagePlan) -> StepReport | None:
        """One step with its gauges; None, and an unchanged state, if a signal interrupted it."""
        state = self.engine.state
        before, dt = state.wall_position.copy(), stage.step_after(state.stage_step)
        # In the first step kernels may compile, and the last checkpoint is the state before it
        is_first, signals = self._steps == 0, self.stop_signals
        try:
            with signals.exit_at_once() if is_first else contextlib.nullcontext():
                t = stage.time_after(state.stage_step)
                report = self.engine.step(dt, t, signals.should_stop)
        except Interrupted:
            return None
        self._steps += 1
        # The engine takes all steps of a stage for as long as this one; the last may be cut.
        state.time = state.stage_start + stage.time_after(state.stage_step)
        update_peak(state)
        if stage.until is not None:
            stage.until.note(state, StepDone(dt, before, report.wall_impulse))
        return report

    def _after_step(self, stage: StagePlan, report: StepReport) -> bool:
        """Write what is due, tell the observer, move on to the next stage; True if this is over."""
        state = self.engine.state
        reason = stage.reason_to_end(state)
        if reason is None and self._is_ended_by_program(stage, report):
            reason = "steered"
        has_ended = reason is not None
        if has_ended or is_due(state.stage_step, stage.series_every):
            self._write_series()
        if has_ended or is_due(state.stage_step, stage.frame_every):
            self._write_frame()
        if reason is not None:
            self._end_stage(stage, reason)
        self._tell(stage, report)
        return has_ended

    def _is_ended_by_program(self, stage: StagePlan, report: StepReport) -> bool:
        """Ask the program that steers, if it is time; True if it ends the stage and sets a plan."""
        if self.steering is None or not self.steering.is_due or stage.is_frozen:
            return False
        try:
            plan = self.steering.ask(self.engine.state, stage, report, self.engine.contacts)
        except BaseException as error:
            error.add_note(STEERED)
            self.recorder.checkpoint(self.steering.go_back())
            raise
        if plan is not None:
            self.plan, self._foreseen = plan, foresee_steps(plan, self.engine.state)
        return plan is not None

    def _end_stage(self, stage: StagePlan, reason: Reason) -> None:
        """Move on to the next stage, or stop here if the stage has timed out and says so."""
        state = self.engine.state
        end = stage.end_of(state, reason)
        self.recorder.stage_ended(end)
        if reason == "timeout" and stage.stops_late:
            self._checkpoint()
            raise StageTimeout(end)
        self._has_moved_on = True
        self.stage_starts.append(self.stage_starts[-1] + stage.time_after(state.stage_step))
        state.stage += 1
        state.stage_step = 0
        state.stage_start = state.time
        state.stage_peak = state.stage_strain = 0.0
        state.stage_notes = np.empty(0)

    def _write_series(self) -> None:
        state = self.engine.state
        self.recorder.series(state)
        state.window[:] = 0.0
        state.window_wall_impulse[:] = 0.0

    def _write_frame(self) -> None:
        contacts = self.engine.contacts().carrying() if self.plan.output.contacts else None
        self.recorder.frame(self.engine.state, contacts)

    def _checkpoint(self) -> None:
        before = self.clock()
        self.recorder.checkpoint(self.engine.state)
        self._last_checkpoint = self.clock()
        self._checkpoint_took = self._last_checkpoint - before
        self.stop_signals.is_checkpoint_wanted = False

    def _checkpoint_if_due(self) -> None:
        rarest = CHECKPOINT_SHARE * self._checkpoint_took
        interval = max(self.plan.output.checkpoint_interval, rarest)
        if self.stop_signals.is_checkpoint_wanted:
            self._checkpoint()
            self.observer.message(f"checkpoint written at step {self.engine.state.step}")
        elif self.clock() - self._last_checkpoint >= interval:
            self._checkpoint()

    def _tell(self, stage: StagePlan, report: StepReport) -> None:
        state, now = self.engine.state, self.clock()
        progress = self.plan.progress(state, self._foreseen)
        self._pace.note(now, self._steps, progress)
        count, speed, left = len(self.plan.stages), self._pace.speed(), self._pace.remaining()
        status = Status(state, stage.name, count, report, progress, speed, left)
        try:
            self.observer.stepped(status)
        except BaseException as error:
            error.add_note(OBSERVED)
            self._checkpoint()
            raise
        if now - self._last_heartbeat >= HEARTBEAT:
            self._last_heartbeat = now
            self.recorder.heartbeat({
                "step": state.step, "time": state.time, "stage": stage.name,
                "stage_count": count,
                "progress": progress, "steps_per_second": speed, "remaining_seconds": left,
                "contacts": report.contacts, "sweeps": report.sweeps, "residual_rms": report.rms,
            })  # fmt: skip
