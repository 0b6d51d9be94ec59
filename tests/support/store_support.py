"""A tiny run without an engine: a model, a deterministic state, a driver to kill and resume."""

import contextlib
import hashlib
import os
import resource
import signal
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np

from multicor_cli.model import (
    BOOK_NAMES,
    HEAT_BOOK_NAMES,
    TALLY_NAMES,
    ContactLaws,
    Grains,
    Model,
    ShapeKind,
    State,
    Thermal,
    Walls,
    WallShapes,
)
from multicor_cli.model.contacts import ContactTable
from multicor_cli.store import RunDirectory, Snapshot, run_info, verify
from multicor_cli.store.extension import Extension
from multicor_cli.store.hdf5 import write_digests, write_text

SOURCE = "# scénario\r\n[scenario]\nname = 'tiny'\n"
RESOLVED = """[scenario]
name = "tiny"
[materials.steel]
density = 7800.0
young = 2.0e11
poisson = 0.3
"""
PROVENANCE = {"multicor_version": "0", "seed": 7, "versions": {"python": "3"}}


FLASH = {"speed": 0.1, "weakened": 0.1, "limit": 1200.0, "reference": 293.15}


def make_model(grains: int = 5, *, walls: bool = True, heat: bool = False) -> Model:
    """Five grains, or others; with heat it has all that only some runs have."""
    names = ("bottom", "dessus-é") if walls else ()
    w, m = len(names), 3 if walls else 0
    radius, zeros = np.linspace(1.0, 2.0, grains) * 1e-3, np.zeros(grains, np.int32)
    kinds = [ShapeKind.PLANE, ShapeKind.DISC, ShapeKind.DISC][:m]
    nan = np.full(w, np.nan)

    def pairs(value: float) -> np.ndarray:
        return np.full((2, 2), value)

    laws = ContactLaws(
        pairs(0.3),
        pairs(0.1),
        np.full((2, 2), -1, np.int32),
        np.array([0, 2], np.int32),
        np.array([0.0, 1.0]),
        np.array([0.3, 0.2]),
        *(map(pairs, (1e-3, 293.15, 0.1, 1.0, 1e-5, 0.2, 1e-4)) if heat else ()),
        **({"is_wet": np.ones((2, 2), np.uint8)} if heat else {}),
        **({f"flash_{of}": pairs(value) for of, value in FLASH.items()} if heat else {}),
    )
    return Model(
        grains=Grains(radius, radius**2 * 1e3, radius**4 * 5e2, zeros, zeros),
        shapes=WallShapes(np.array(kinds, np.int32), np.array([0, 1, 1], np.int32)[:m],
            np.ones((m, 4)) * 1e-3, np.ones(m, np.int32)),
        walls=Walls(names, nan, nan, np.zeros(w, np.bool_), np.ones(w)),
        laws=laws,
        materials=("steel", "glass"),
        groups=("grains",),
        period=0.1,
        gravity=np.array([0.0, -9.81]),
        shape_factor=2.0,
        thermal=Thermal(radius**2 * 5e5, 290.0 + np.arange(grains),
            4.0 * np.pi * radius**2) if heat else None,
    )  # fmt: skip


def start(model: Model) -> State:
    n = model.grain_count
    state = State.at_rest(
        model, np.stack([np.linspace(0.0, 0.09, n), np.linspace(0.0, 0.05, n)], axis=1)
    )
    state.velocity[:, 0] = 1.0
    return state


def advance(state: State, model: Model, dt: float = 1e-3) -> None:
    """A pure function of the state, as a step of the engine is."""
    state.step += 1
    state.stage_step += 1
    state.time += dt
    state.last_dt = dt
    state.velocity += 0.1 * np.sin(state.position + state.step)
    state.position += dt * state.velocity
    wraps = np.floor(state.position[:, 0] / model.period)
    state.position[:, 0] -= wraps * model.period
    state.image += wraps.astype(np.int64)
    state.wall_position += dt * 0.5
    # Some steps without contacts
    count = (3 * state.step) % (model.grain_count + 1) if model.grain_count > 1 else 0
    pairs = [(k, k + 1) for k in range(min(count, model.grain_count - 1))]
    if model.shape_count and count:
        pairs.append((model.grain_count - 1, model.grain_count + 2))
    state.contact_i = np.array([p[0] for p in pairs], np.int32)
    state.contact_j = np.array([p[1] for p in pairs], np.int32)
    state.contact_impulse = 1e-3 * np.sin(np.arange(2.0 * len(pairs)) + state.step).reshape(-1, 2)
    if model.laws.rolling.size:
        state.contact_couple = 1e-9 * (1.0 + np.arange(float(len(pairs))))
    if model.laws.is_wet.size:
        state.bridge_i, state.bridge_j = state.contact_i.copy(), state.contact_j.copy()
        state.adhesion_books += dt
    state.books += np.linspace(0.0, 1.0, len(BOOK_NAMES)) * dt
    state.tallies[TALLY_NAMES.index("sweeps")] += 10
    state.tallies[TALLY_NAMES.index("max_impulse_rate")] = 1.0
    state.window[0] += dt
    state.window[1:] += 1.0
    state.window_wall_impulse += dt * 2.0
    if model.thermal is not None:
        advance_heat(state, model.thermal)


def advance_heat(state: State, thermal: Thermal) -> None:
    """Temperatures go up and down; the mean contact forces are those of the present contacts."""
    state.heat += thermal.capacity * np.sin(np.arange(state.heat.size) + state.step)
    state.generated += 1e-6 * (1.0 + np.arange(state.generated.size))
    state.wear += 1e-15
    state.wall_heat += [1e-3, 2e-3]
    state.wall_wear += 1e-16
    state.wall_temperature[:1] = 300.0 + state.step
    state.heat_books += np.linspace(0.0, 1.0, len(HEAT_BOOK_NAMES))
    state.heat_books[HEAT_BOOK_NAMES.index("sub_steps")] = 2 * state.step
    state.mean_i, state.mean_j = state.contact_i.copy(), state.contact_j.copy()
    state.mean_force = np.abs(state.contact_impulse[:, 0])
    state.heat_dt = 1e-4 * state.step


def contact_rows(state: State) -> ContactTable:
    c = len(state.contact_i)
    normal = np.tile([0.6, 0.8], (c, 1))
    sliding = np.arange(c) % 2 == 1
    heat = (1e-9 * np.arange(c), 0.1 + np.arange(c)) if state.heat.size else (None, None)
    couple = state.contact_couple if state.heat.size else None
    return ContactTable(
        state.contact_i, state.contact_j, normal, -1e-6 * np.arange(c), state.contact_impulse,
        0.1 * np.arange(c), sliding, *heat, couple,
    )  # fmt: skip


def make_run(path: Path, **options: object) -> RunDirectory:
    return RunDirectory.create(
        path, SOURCE, RESOLVED, PROVENANCE, stages=("load", "shear"), **options
    )  # type: ignore[arg-type]


def drive(
    run: RunDirectory, model: Model, *, steps: int, checkpoint_every: int, finish: bool = True
) -> State:
    """From the checkpoint, or the start: a frame every 5 steps, a row of the series every 2."""
    found = run.load_checkpoint()
    state = found.state if found else start(model)
    writer = run.writer(model)
    if writer.last_frame_step < 0:
        writer.frame(Snapshot(state, model, contact_rows(state)))
        writer.series_row(Snapshot(state, model))
    while state.step < steps:
        advance(state, model)
        if state.step % 2 == 0:
            writer.series_row(Snapshot(state, model))
            state.window[:] = 0.0
            state.window_wall_impulse[:] = 0.0
        if state.step % 5 == 0:
            writer.frame(Snapshot(state, model, contact_rows(state)))
        if state.step % checkpoint_every == 0:
            run.checkpoint(state, writer)
    run.checkpoint(state, writer)
    if finish:
        run.finish("finished", stop_reason="end of the last stage")
    return state


def run_whole(
    path: Path,
    model: Model | None = None,
    *,
    steps: int = 40,
    checkpoint_every: int = 15,
    finish: bool = True,
    **options: object,
) -> State:
    """A run from its beginning to its end, or to where it would be finished."""
    with make_run(path, **options) as run:
        return drive(
            run, model or make_model(), steps=steps, checkpoint_every=checkpoint_every,
            finish=finish,
        )  # fmt: skip


def continue_run(path: Path, model: Model | None = None) -> None:
    """What ``multicor run`` does: begin, continue, or find that it is finished."""
    model = model or make_model()
    run = RunDirectory.resume(path) if RunDirectory.is_run(path) else make_run(path)
    with run:
        if not run.is_finished:
            drive(run, model, steps=40, checkpoint_every=15)


LONGER = Extension(SOURCE + "# and on\n", RESOLVED + "[more]\n", ("load", "shear", "on"))


def extend_run(path: Path, model: Model) -> None:
    """What ``multicor run --extend`` does: add the stages unless they are there, carry them out."""
    has_them = run_info(path)["stages"] == list(LONGER.stages)
    with RunDirectory.resume(path, extension=None if has_them else LONGER) as run:
        if not run.is_finished:
            drive(run, model, steps=60, checkpoint_every=15)


def killed_at(path: Path, point: str, go_on: Callable[[Path], object] = continue_run) -> bool:
    """`go_on` in a child process that kills itself at ``point``; returns whether it was killed."""
    child = os.fork()
    if child == 0:
        os.environ["MULTICOR_KILL_AT"] = point
        try:
            go_on(path)
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    status = os.waitpid(child, 0)[1]
    was_killed = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL
    assert was_killed or status == 0
    return was_killed


@contextlib.contextmanager
def file_size_limit(size: int) -> Iterator[None]:
    """Writes beyond ``size`` bytes fail meanwhile, in the same places as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def errors_of(path: Path) -> list[str]:
    """What `verify` says of lost or damaged data."""
    return [finding.message for finding in verify(path) if finding.severity == "error"]


def ends_of(path: Path) -> tuple[str, str]:
    """Digests of the data and of the last state of a finished run."""
    info = run_info(path)
    assert info["status"] == "finished"
    return info["data_digest"], info["state_digest"]


def replace(path: Path, data: bytes) -> None:
    """Give a file that may be read-only other bytes."""
    path.unlink()
    path.write_bytes(data)


def set_text(file: h5py.File, name: str, text: str) -> None:
    """Change a root attribute and its digest, as a faulty program would."""
    write_text(file, name, text)
    write_digests(file)


def set_value(file: h5py.File, path: str, row: int, value: float) -> None:
    """Change a value and the digest of its dataset, as a faulty program would."""
    file[path][row] = value
    write_text(
        file[path],
        "blake2b",
        hashlib.blake2b(file[path][...].tobytes(), digest_size=16).hexdigest(),
    )
