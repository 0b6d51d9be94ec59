"""The contact problem of the step after a frame, for other solvers to be compared with ours on."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.engine.contact.problem import ContactProblem
from multicor_cli.export.errors import ExportError
from multicor_cli.export.fclib_file import write_fclib
from multicor_cli.export.selection import choose_frame
from multicor_cli.export.target import check_output
from multicor_cli.model import Model, State
from multicor_cli.model.model import Floats
from multicor_cli.running.cadence import is_due
from multicor_cli.running.plan import RunPlan, StagePlan
from multicor_cli.running.planning import make_plan
from multicor_cli.running.session import make_engine
from multicor_cli.running.stage import resume_stage
from multicor_cli.scenario.load import parse_scenario
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.store import Frame, Run
from multicor_cli.store.errors import DamagedRun


@dataclass(frozen=True)
class FrameProblem:
    """A contact problem and where it comes from.

    Attributes:
        problem: The problem.
        start: Impulses from which the solver would start: those of the step before, scaled [N s], shape ``(c, 2)``.
        frame: Number of the frame.
        time: Time of the frame [s].
        stage: Name of the loading stage of the step.
        dt: Time step [s].
        is_beyond: Whether the run ended with the frame; the step is the one that its last stage would take next.
    """

    problem: ContactProblem
    start: Floats
    frame: int
    time: float
    stage: str
    dt: float
    is_beyond: bool


@dataclass(frozen=True)
class _Moment:
    """Where in the plan a run stands after a frame.

    Attributes:
        stage: Index of the stage of the next step.
        stage_step: Steps done in it.
        starts: Times at which the stages up to it have begun [s].
        is_beyond: Whether the last stage is over.
    """

    stage: int
    stage_step: int
    starts: tuple[float, ...]
    is_beyond: bool


def export_fclib(
    run: Run, path: Path, frame: int = -1, *, is_overwriting: bool = False, computing: AbstractContextManager[Any] | None = None
) -> FrameProblem:
    """Write the contact problem of the step after a frame in the format of FCLib.

    Args:
        run: The run.
        path: The file.
        frame: Number of the frame; negative counts from the end.
        is_overwriting: Whether a file that is there may be replaced.
        computing: Context in which kernels are compiled and run, before anything is written.

    Raises:
        ExportError: If there is no such frame, the step is one in which nothing moves, there is no contact, or contacts have
            adhesion or rolling resistance.
        ExportRefused: If the file may not be written.
        StoreError: If the run cannot be read, or the file not be written.
    """
    check_output(path, is_overwriting=is_overwriting)
    with computing or nullcontext():
        found = frame_problem(run, frame)
    name = parse_scenario(run.scenario_resolved, run.path).model.scenario.name
    after = ", one step after the end of the run" if found.is_beyond else ""
    write_fclib(
        found.problem,
        path,
        start=found.start,
        title=f"{name}, step after frame {found.frame}",
        description=f"Plane granular flow, step of {found.dt!r} s after t = {found.time!r} s in stage '{found.stage}'{after}. "
        f"{len(found.problem.pair)} contacts of discs among each other and with walls. r are impulses [N s], u velocities [m/s]; "
        f"normal first, then tangential; q holds the terms of gap and restitution. Run {run.run_id}.",
        is_overwriting=is_overwriting,
    )
    return found


def frame_problem(run: Run, number: int = -1) -> FrameProblem:
    """The contact problem of the step after a frame: what the engine would solve next.

    In a run with ``output.precision = "double"`` it is the problem that the run has solved, to the bit. Without recorded contacts
    there are no impulses to start from.

    Args:
        run: The run.
        number: Number of the frame; negative counts from the end.

    Raises:
        ExportError: If there is no such frame, the step is one in which nothing moves, or contacts have adhesion or rolling
            resistance.
        StoreError: If the run cannot be read.
    """
    frame = choose_frame(run, number)
    model = run.model
    _refuse_further_laws(run, model)
    if model.outlets is not None:
        message = (
            f"{run.path}: grains come and go in this run, so that the next contact problem is not that of the grains of a frame"
        )
        raise ExportError(message)
    scenario = parse_scenario(run.scenario_resolved, run.path)
    plan = make_plan(scenario, model)
    moment = _find_moment(run, frame, plan)
    stage = plan.stages[moment.stage]
    if stage.is_frozen:
        message = f"{run.path}: nothing moves in stage '{stage.name}' after frame {frame.index}, so there is no contact problem"
        raise ExportError(message)
    state = _restore(frame, model, moment)
    state.wall_origin = _wall_origin(run, frame, stage, moment)
    problem, start = _next_problem(scenario, plan, model, state, moment)
    return FrameProblem(problem, start, frame.index, frame.time, stage.name, stage.step_after(moment.stage_step), moment.is_beyond)


def _next_problem(scenario: Scenario, plan: RunPlan, model: Model, state: State, moment: _Moment) -> tuple[ContactProblem, Floats]:
    engine, stage = make_engine(scenario, model, state, threads=1), plan.stages[moment.stage]
    resume_stage(engine, stage, moment.starts)
    return engine.next_start(stage.step_after(moment.stage_step), stage.time_after(moment.stage_step))


def _refuse_further_laws(run: Run, model: Model) -> None:
    """FCLib knows Coulomb's cone alone; raises `ExportError` if contacts have another law."""
    laws = {"adhesion": model.laws.adhesion, "rolling resistance": model.laws.rolling}
    for name, table in laws.items():
        if table.size:
            message = f"{run.path}: contacts of this run have {name}, which the format of FCLib does not know"
            raise ExportError(message)


def _find_moment(run: Run, frame: Frame, plan: RunPlan) -> _Moment:
    """Every stage leaves a frame of its end, so the frames tell where stages begin."""
    stages, times, steps = run.frames.stage, run.frames.time, run.frames.step
    stage = frame.stage
    if stage not in range(len(plan.stages)) or not np.isin(np.arange(stage), stages).all():
        raise DamagedRun(f"frame {frame.index} is of stage {stage}, which the run does not have; check it with multicor verify")
    ends = [int(np.flatnonzero(stages == k)[-1]) for k in range(stage)]
    stage_step = frame.step - (int(steps[ends[-1]]) if ends else 0)
    starts = (0.0, *(float(times[end]) for end in ends))
    if not _ends_stage(run, frame, plan, stage_step):
        return _Moment(stage, stage_step, starts, is_beyond=False)
    if stage + 1 == len(plan.stages):
        return _Moment(stage, stage_step, starts, is_beyond=True)
    return _Moment(stage + 1, 0, (*starts, frame.time), is_beyond=False)


def _ends_stage(run: Run, frame: Frame, plan: RunPlan, stage_step: int) -> bool:
    if frame.index + 1 < len(run.frames):
        return bool(run.frames.stage[frame.index + 1] != frame.stage)
    stage = plan.stages[frame.stage]
    return run.status == "finished" or stage_step == stage.step_limit or not is_due(stage_step, stage.frame_every)


def _wall_origin(run: Run, frame: Frame, stage: StagePlan, moment: _Moment) -> Floats:
    """Where displacements of the walls count from: where they were when their drives were named."""
    first = [run.frames[int(np.flatnonzero(run.frames.stage == k)[-1]) if k >= 0 else 0] for k in range(-1, moment.stage)]
    origin = frame.wall_position.astype(np.float64)
    for w, named_by in enumerate(stage.drives.named_by):
        for d, number in enumerate(named_by[:3]):  # of its body
            if number >= 0:
                origin[w, d] = first[number].wall_position[w, d]
    return origin


def _restore(frame: Frame, model: Model, moment: _Moment) -> State:
    """The state of a frame, as far as the next contact problem depends on it."""
    state = State.at_rest(model, np.column_stack([frame.position, frame.angle]).astype(np.float64))
    state.velocity = np.column_stack([frame.velocity, frame.spin]).astype(np.float64)
    state.wall_position, state.wall_velocity = frame.wall_position.copy(), frame.wall_velocity.copy()
    if frame.wall_surface is not None:
        state.wall_surface = frame.wall_surface.copy()
    contacts = frame.contacts
    loaded = contacts.impulse[:, 0] > 0.0
    state.contact_i, state.contact_j = contacts.i[loaded], contacts.j[loaded]
    state.contact_impulse = contacts.impulse[loaded].astype(np.float64)
    state.step, state.time, state.last_dt = frame.step, frame.time, frame.dt
    state.stage, state.stage_step, state.stage_start = moment.stage, moment.stage_step, moment.starts[-1]
    if model.thermal is not None and frame.temperature is not None and frame.wall_temperature is not None:
        state.heat = (frame.temperature - model.thermal.start) * model.thermal.capacity
        state.wall_temperature = frame.wall_temperature.copy()
    return state
