"""Contact problems of frames in the HDF5 format of FCLib, the field's collection of such.

A file holds the local form ``u = W r + q`` with two components (normal, tangential) per contact, W
as compressed rows, and, as a guess, the impulses from which our solver would start. A group
``multicor`` beside it, which FCLib does not look at, holds the bodies, so that the file can be read
back whole.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.problem import ContactProblem, free_velocity
from multicor_cli.export.target import ExportError, check_output, choose_frame, commit_hdf5
from multicor_cli.files import regular_path
from multicor_cli.model import Model, State
from multicor_cli.model.columns import NORMAL, TANGENTIAL
from multicor_cli.model.contacts import are_impacts
from multicor_cli.model.model import Floats, Ints
from multicor_cli.running.conditions import is_due
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import RunPlan, StagePlan
from multicor_cli.running.session import make_engine
from multicor_cli.scenario.scenario import parse_scenario
from multicor_cli.store import Frame, Run
from multicor_cli.store.atomic import GuardedFile
from multicor_cli.store.errors import DamagedRun
from multicor_cli.store.hdf5 import reading

_LOCAL, _BODIES, _GUESSES = "fclib_local", "multicor", "guesses"
_ROWS = -2
"""``nz`` of a matrix in compressed rows."""

_ENTRY_LIMIT = 200_000_000
"""Largest number of entries of W: 2.4 GB."""

_MATH_INFO = (
    "W is symmetric and positive semi-definite; friction is that of Coulomb, so the solution need "
    "not be unique"
)

_UNITS = {
    "inverse_mass": "1/kg, 1/kg, 1/(kg m2)",
    "velocity": "m/s, m/s, rad/s",
    "pair": "1",
    "normal": "1",
    "lever": "m",
    "bias": "m/s",
    "friction": "1",
    "slide": "m/s",
}


@dataclass(frozen=True)
class LocalForm:
    """``u = W r + q`` for ``c`` contacts; rows 2k, 2k + 1: normal, tangential part of contact k.

    Attributes:
        start: First entry of every row of W in the two below, shape ``(2c + 1,)``.
        column: Column of every entry, ascending in a row.
        value: The entries [1/kg].
        q: Relative velocities without impulses, the bias in the normal ones [m/s], shape ``(2c,)``.
        friction: Coefficients of friction, shape ``(c,)``.
    """

    start: Ints
    column: Ints
    value: Floats
    q: Floats
    friction: Floats

    def velocity(self, impulse: Floats) -> Floats:
        """``W r + q`` [m/s], shape ``(2c,)``; ``impulse`` has shape ``(c, 2)`` or ``(2c,)``."""
        row = np.repeat(np.arange(len(self.q)), np.diff(self.start))
        products = self.value * impulse.reshape(-1)[self.column]
        return np.asarray(np.bincount(row, products, len(self.q)) + self.q, np.float64)


def local_form(problem: ContactProblem) -> LocalForm:
    """The local form; `ExportError` if W is too large: a driven body touches too many others."""
    q = free_velocity(problem)
    q[:, 0] += problem.bias
    first, second, block = _blocks(problem)
    count = np.bincount(first, minlength=len(problem.pair))  # blocks in each pair of rows
    begin = np.cumsum(count) - count
    lengths = np.repeat(2 * count, 2)
    row_start = np.concatenate([[0], np.cumsum(lengths)])
    column, value = np.empty(4 * len(first), np.int32), np.empty(4 * len(first))
    within = 2 * (np.arange(len(first)) - begin[first])
    for a in (0, 1):
        for b in (0, 1):
            entry = row_start[2 * first + a] + within + b
            column[entry], value[entry] = 2 * second + b, block[:, a, b]
    return LocalForm(row_start.astype(np.int32), column, value, q.reshape(-1), problem.friction)


def _blocks(problem: ContactProblem) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """The 2×2 blocks of W that are not zero, ordered by their two contacts: these, and blocks."""
    contact, body, jacobian = _incidences(problem)
    count = np.bincount(body, minlength=len(problem.velocity))
    total = int((count.astype(np.int64) ** 2).sum())
    if 4 * total > _ENTRY_LIMIT:
        raise ExportError(
            f"the matrix of the contact problem has {4 * total} entries, more than "
            f"{_ENTRY_LIMIT}; export a smaller run"
        )
    # Every incidence of a body with every other: those of one body lie next to each other.
    repeat = count[body]
    one = np.repeat(np.arange(len(body)), repeat)
    first_of_body = (np.cumsum(count) - count)[body[one]]
    other = first_of_body + np.arange(total) - np.repeat(np.cumsum(repeat) - repeat, repeat)
    key = contact[one] * len(problem.pair) + contact[other]
    order = np.argsort(key, kind="stable")
    one, other, key = one[order], other[order], key[order]
    products = jacobian[one][:, :, None, :] * jacobian[other][:, None, :, :]
    blocks = (products * problem.inverse_mass[body[one]][:, None, None, :]).sum(axis=3)
    # Contacts that share both bodies: one block from two
    edges = np.flatnonzero(np.diff(key, prepend=-1))
    summed = np.add.reduceat(blocks, edges, axis=0) if len(edges) else blocks
    return contact[one[edges]], contact[other[edges]], summed


def _incidences(problem: ContactProblem) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Contacts with bodies that move, ordered by body: contact, body, and its part in u_n, u_t."""
    c = len(problem.pair)
    levers, (nx, ny) = problem.levers(), problem.normal.T
    jacobian = np.empty((2, c, 2, 3))
    for side, sign in ((0, 1.0), (1, -1.0)):
        jacobian[side, :, 0] = sign * np.column_stack([nx, ny, levers[:, side, NORMAL]])
        jacobian[side, :, 1] = sign * np.column_stack([-ny, nx, levers[:, side, TANGENTIAL]])
    body = problem.pair.T.reshape(-1).astype(np.int64)
    contact = np.tile(np.arange(c), 2)
    moves = np.flatnonzero(np.asarray(problem.inverse_mass.any(axis=1))[body])
    moves = moves[np.argsort(body[moves], kind="stable")]
    return contact[moves], body[moves], jacobian.reshape(2 * c, 2, 3)[moves]


def write_fclib(
    problem: ContactProblem,
    path: Path,
    *,
    start: Floats | None = None,
    title: str = "contact problem",
    description: str = "",
    is_overwriting: bool = False,
) -> None:
    """Write a problem in the format of FCLib.

    ``start`` are impulses to start from [N s], shape ``(c, 2)``; ``title`` says what it is.

    Raises:
        ExportError: If there is no contact, or W is too large.
        ExportRefused: If the file may not be written.
        StorageError: If it cannot be written.
    """
    if not len(problem.pair):
        raise ExportError("there is no contact, so there is no contact problem to export")
    check_output(path, is_overwriting=is_overwriting)
    form = local_form(problem)

    def write(guarded: GuardedFile) -> None:
        with h5py.File(guarded, "w") as file:
            local, rows = file.create_group(_LOCAL), len(form.q)
            local["spacedim"] = np.array([2], np.int32)
            sizes = {"nzmax": len(form.value), "m": rows, "n": rows, "nz": _ROWS}
            for name, number in sizes.items():
                local[f"W/{name}"] = np.array([number], np.int32)
            local["W/p"], local["W/i"], local["W/x"] = form.start, form.column, form.value
            local["vectors/q"], local["vectors/mu"] = form.q, form.friction
            info = local.create_group("info")
            texts = {"title": title, "description": description, "math_info": _MATH_INFO}
            for name, text in texts.items():
                data = text.encode() + b"\0"  # as the C library expects them
                info.create_dataset(name, data=np.array(data, dtype=f"S{len(data)}"))
            degrees = 3 * len(problem.velocity)
            info.attrs["numberOfDegreeOfFreedom"] = np.array([degrees], np.int32)
            if start is not None:
                guesses = file.create_group(_GUESSES)
                guesses["number_of_guesses"] = np.array([1], np.int32)
                guesses["1/r"], guesses["1/u"] = start.reshape(-1), form.velocity(start)
            for field in fields(problem):
                file[f"{_BODIES}/{field.name}"] = getattr(problem, field.name)
                file[f"{_BODIES}/{field.name}"].attrs["unit"] = _UNITS[field.name]

    arrays = [getattr(part, field.name) for part in (form, problem) for field in fields(part)]
    size = sum(array.nbytes for array in arrays) + 64 * len(form.q) + (64 << 10)
    commit_hdf5(path, "fclib", write, size)


def read_fclib(path: Path) -> tuple[ContactProblem, Floats | None]:
    """The problem of a file that `write_fclib` has made, and the impulses to start from, if any.

    Raises:
        ExportError: If the file holds the local form alone: it does not say what the bodies are.
        DamagedRun: If it is damaged, or no FCLib file.
        StorageError: If it cannot be read.
    """
    with reading(path), regular_path(path) as opened, h5py.File(opened, "r", locking=False) as file:
        if _BODIES not in file:
            is_fclib = _LOCAL in file or "fclib_global" in file
            known = "an FCLib file, but one of another program" if is_fclib else "not an FCLib file"
            raise ExportError(
                f"{path}: is {known}; only files that multicor has exported can be read back"
            )
        arrays: dict[str, NDArray[Any]] = {
            f.name: file[f"{_BODIES}/{f.name}"][...]
            for f in fields(ContactProblem)
            if f.name in file[_BODIES] or f.name != "slide"
        }
        problem = ContactProblem(**arrays)
        start = (
            file[f"{_GUESSES}/1/r"][...].reshape(len(problem.pair), 2) if _GUESSES in file else None
        )
        return problem, start


# ---- The contact problem of the step after a frame, for other solvers to be compared with ours on


@dataclass(frozen=True)
class FrameProblem:
    """A contact problem and where it comes from.

    Attributes:
        problem: The problem.
        start: Impulses from which the solver would start: those of the step before, scaled [N s],
            shape ``(c, 2)``.
        frame: Number of the frame.
        time: Time of the frame [s].
        stage: Name of the loading stage of the step.
        dt: Time step [s].
        is_beyond: Whether the run ended with the frame; the step is its last stage's next one.
    """

    problem: ContactProblem
    start: Floats
    frame: int
    time: float
    stage: str
    dt: float
    is_beyond: bool


class _Moment(NamedTuple):
    """Where in the plan a run stands after a frame: stage of the next step, and steps done in it.

    ``starts``: times at which the stages up to it have begun [s]; ``is_beyond``: the last is over.
    """

    stage: int
    stage_step: int
    starts: tuple[float, ...]
    is_beyond: bool


def export_fclib(
    run: Run,
    path: Path,
    frame: int = -1,
    *,
    is_overwriting: bool = False,
    computing: AbstractContextManager[Any] | None = None,
) -> FrameProblem:
    """Write the contact problem of the step after a frame in the format of FCLib.

    A negative number counts from the end. ``computing`` is a context in which kernels are compiled
    and run, before anything is written.

    Raises:
        ExportError: If there is no such frame, the step is one in which nothing moves, there is no
            contact, contacts have adhesion or rolling resistance, not all grains are discs, or the
            run is one of a cell.
        ExportRefused: If the file may not be written.
        StoreError: If the run cannot be read, or the file not be written.
    """
    check_output(path, is_overwriting=is_overwriting)
    with computing or nullcontext():
        found = frame_problem(run, frame)
    name = parse_scenario(run.scenario_resolved, run.path).name
    after = ", one step after the end of the run" if found.is_beyond else ""
    write_fclib(
        found.problem,
        path,
        start=found.start,
        title=f"{name}, step after frame {found.frame}",
        description=(
            f"Plane granular flow, step of {found.dt!r} s after t = {found.time!r} s in stage "
            f"'{found.stage}'{after}. {len(found.problem.pair)} contacts of discs among each "
            "other and with walls. r are impulses [N s], u velocities [m/s]; normal first, then "
            f"tangential; q holds the terms of gap and restitution. Run {run.run_id}."
        ),
        is_overwriting=is_overwriting,
    )
    return found


def frame_problem(run: Run, number: int = -1) -> FrameProblem:
    """The contact problem of the step after a frame: what the engine would solve next.

    In a run with ``output.precision = "double"`` it is the problem that the run has solved, to the
    bit. Without recorded contacts there are no impulses to start from. A negative number counts
    from the end.

    Raises:
        ExportError: If there is no such frame, the step is one in which nothing moves, contacts
            have adhesion or rolling resistance, not all grains are discs, or the run is one of a
            cell.
        StoreError: If the run cannot be read.
    """
    frame = choose_frame(run, number)
    model = run.model
    # The format knows Coulomb's cone alone
    laws = {"adhesion": model.laws.adhesion, "rolling resistance": model.laws.rolling}
    for name, table in laws.items():
        if table.size:
            raise ExportError(
                f"{run.path}: contacts of this run have {name}, which the format of FCLib does "
                "not know"
            )
    if model.outlines is not None:
        raise ExportError(
            f"{run.path}: not all grains of this run are discs; contact problems are exported of "
            "discs alone"
        )
    if model.is_cell:
        raise ExportError(
            f"{run.path}: contacts of this run are also with images in a cell that is strained, "
            "which the format of FCLib does not know"
        )
    if model.outlets is not None:
        raise ExportError(
            f"{run.path}: grains come and go in this run, so that the next contact problem is not "
            "that of the grains of a frame"
        )
    scenario = parse_scenario(run.scenario_resolved, run.path)
    plan = make_plan(scenario, model)
    moment = _find_moment(run, frame, plan)
    stage = plan.stages[moment.stage]
    if stage.is_frozen:
        raise ExportError(
            f"{run.path}: nothing moves in stage '{stage.name}' after frame {frame.index}, so "
            "there is no contact problem"
        )
    state = _restore(frame, model, moment)
    state.wall_origin = _wall_origin(run, frame, stage, moment)
    engine, done = make_engine(scenario, model, state, threads=1), moment.stage_step
    engine.resume(stage.orders(moment.starts))
    dt = stage.step_after(done)
    problem, start = engine.next_start(dt, stage.time_after(done))
    return FrameProblem(problem, start, frame.index, frame.time, stage.name, dt, moment.is_beyond)


def _find_moment(run: Run, frame: Frame, plan: RunPlan) -> _Moment:
    """Every stage leaves a frame of its end, so the frames tell where stages begin."""
    stages, times, steps = run.frames.stage, run.frames.time, run.frames.step
    stage = frame.stage
    if stage not in range(len(plan.stages)) or not np.isin(np.arange(stage), stages).all():
        raise DamagedRun(
            f"frame {frame.index} is of stage {stage}, which the run does not have; check it with "
            "multicor verify"
        )
    ends = [int(np.flatnonzero(stages == k)[-1]) for k in range(stage)]
    stage_step = frame.step - (int(steps[ends[-1]]) if ends else 0)
    starts = (0.0, *(float(times[end]) for end in ends))
    planned = plan.stages[stage]
    if frame.index + 1 < len(run.frames):
        is_end = bool(stages[frame.index + 1] != stage)
    else:
        is_due_anyway = is_due(stage_step, planned.frame_every)
        is_end = stage_step == planned.step_limit or not is_due_anyway or run.status == "finished"
    if is_end and stage + 1 < len(plan.stages):
        return _Moment(stage + 1, 0, (*starts, frame.time), is_beyond=False)
    return _Moment(stage, stage_step, starts, is_beyond=is_end)


def _wall_origin(run: Run, frame: Frame, stage: StagePlan, moment: _Moment) -> Floats:
    """Where displacements of the walls count from: where they were when their drives were named."""
    first = [
        run.frames[int(np.flatnonzero(run.frames.stage == k)[-1]) if k >= 0 else 0]
        for k in range(-1, moment.stage)
    ]
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
    state.wall_position = frame.wall_position.copy()
    state.wall_velocity = frame.wall_velocity.copy()
    if frame.wall_surface is not None:
        state.wall_surface = frame.wall_surface.copy()
    contacts = frame.contacts
    loaded = (contacts.impulse[:, 0] > 0.0) & ~are_impacts(contacts.gap)
    state.contact_i, state.contact_j = contacts.i[loaded], contacts.j[loaded]
    state.contact_impulse = contacts.impulse[loaded].astype(np.float64)
    state.step, state.time, state.last_dt = frame.step, frame.time, frame.dt
    state.stage, state.stage_step = moment.stage, moment.stage_step
    state.stage_start = moment.starts[-1]
    thermal, walls = model.thermal, frame.wall_temperature
    if thermal is not None and frame.temperature is not None and walls is not None:
        state.heat = (frame.temperature - thermal.initial_temperature) * thermal.capacity
        state.wall_temperature = walls.copy()
    return state
