"""The contact problems: what the engine solved in consecutive steps of a scene, kept in files.

They are recorded where the engine hands a problem to its solver, so they are the problems of real
runs with their real warm starts.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli import open_run
from multicor_cli.bench.driving import prepare
from multicor_cli.bench.scenes import SCENES
from multicor_cli.engine import Engine
from multicor_cli.engine import mechanics as engine_module
from multicor_cli.engine.contact.solve import ResidualScale
from multicor_cli.engine.contact.sweep import System, add_impulses
from multicor_cli.engine.contact.system import OneByOne, one_tile
from multicor_cli.engine.jit.arrays import aligned
from multicor_cli.engine.jit.cache import cache_name
from multicor_cli.model.columns import FIRST, INVERSE_MASS, MASS, MU, NY, SECOND, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.packing import build
from multicor_cli.scenario import parse_scenario

_FORMAT = 5
_CHANGING = ("velocity", "impulse", "general_impulse")
_NUMBERS = {"spin_factor", "contacts"}
# no scene has rolling resistance, is a cell, or has grains that are no discs
_ARRAYS = tuple(
    field for field in System._fields if field not in _NUMBERS | {"couples", "cell", "faces"}
)


@dataclass(frozen=True)
class Problem:
    """One contact problem.

    Attributes:
        name: Scene, size and start.
        system: In the order of the sweep, with the impulses to start from. Not to be changed: take
            `copy`.
        scale: What residuals are measured against.
    """

    name: str
    system: System
    scale: ResidualScale

    @property
    def contacts(self) -> int:
        """Number of contacts considered."""
        return self.system.contacts

    def copy(self) -> System:
        """A system that may be changed."""
        return copy_system(self.system)

    def cold(self) -> Problem:
        """The same problem from impulses of zero."""
        system = self.copy()
        negative = system._replace(impulse=-system.impulse, general_impulse=-system.general_impulse)
        add_impulses(negative)
        system.impulse[:] = 0.0
        system.general_impulse[:] = 0.0
        return Problem(f"{self.name}, cold", system, self.scale)

    def named(self, name: str) -> Problem:
        """The same problem by another name."""
        return Problem(name, self.system, self.scale)

    def units(self) -> Floats:
        """What rms, maximum, energy and distance of a history are measured in [m/s, m/s, J,
        m/s].
        """
        return np.array(
            [self.scale.rms, self.scale.velocity, self.scale.energy, self.scale.velocity]
        )


def copy_system(system: System) -> System:
    """A copy of what sweeps change; the rest is shared."""
    return _with_copies(system, _CHANGING)


def _with_copies(system: System, names: Iterable[str]) -> System:
    return system._replace(**{name: _copy(getattr(system, name)) for name in names})


def _copy(array: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins at a cache line, as all arrays of a system do."""
    copied = aligned(array.shape, array.dtype.type)
    copied[:] = array
    return copied


def column(count: int = 116) -> Problem:
    """A column of equal discs on a floor, at rest, under gravity: cold start of a problem whose
    solution is known.
    """
    velocity = np.zeros((count + 1, 4))
    velocity[:count, Y], velocity[:count, INVERSE_MASS] = -9.81e-3, 1.0
    order = np.arange(count)
    pair = np.column_stack([order, np.where(order > 0, order - 1, count)]).astype(np.int32)
    frame = np.zeros((count, 5))
    frame[:, NY], frame[:, MU] = 1.0, 0.5
    frame[:, MASS] = 1.0 / (
        velocity[pair[:, FIRST], INVERSE_MASS] + velocity[pair[:, SECOND], INVERSE_MASS]
    )
    rows = OneByOne(pair, frame, np.zeros((count, 2)))
    system = one_tile(rows, velocity, np.zeros((count + 1, 3)), 2.0)
    return Problem(
        f"column of {count}, cold",
        system,
        ResidualScale(9.81e-3, 9.81e-3, 0.5 * count * 9.81e-3**2),
    )


@contextmanager
def _listening(engine: Engine, heard: list[tuple[System, ResidualScale]]) -> Iterator[None]:
    """While this lasts, every problem that an engine hands to its solver is copied before it is
    solved.
    """
    names = vars(engine_module)
    solve: Callable[..., Any] = names["solve_system"]

    def listen(system: System, scale: ResidualScale, *rest: Any, **named: Any) -> Any:
        heard.append((_by_grain(system, engine.mechanics.layout.selection.lanes.place), scale))
        return solve(system, scale, *rest, **named)

    names["solve_system"] = listen
    try:
        yield
    finally:
        names["solve_system"] = solve


def _by_grain(system: System, place: Ints) -> System:
    """A copy of a system whose first rows are the grains in their own order: so they have the same
    names in every step. Nothing is shared: later steps write into the same lanes.
    """
    n = place.size
    velocity, inverse = system.velocity.copy(), system.inverse.copy()
    velocity[:n], inverse[:n] = velocity[place], inverse[place]
    name = np.arange(len(velocity), dtype=np.int32)
    name[place] = np.arange(n, dtype=np.int32)
    copied = _with_copies(system._replace(velocity=velocity), _ARRAYS)
    pair = _copy(4 * name[system.pair // 4])
    return copied._replace(inverse=inverse, pair=pair, general_pair=name[system.general_pair])


def _record_scene(
    name: str, grains: int, seed: int, steps: int
) -> list[tuple[System, ResidualScale]]:
    prepared = prepare(SCENES[name], grains, seed=seed)
    prepared.take(SCENES[name].warm_steps)
    heard: list[tuple[System, ResidualScale]] = []
    with _listening(prepared.engine, heard):
        prepared.take(steps)
    return heard


def _record_deposited(grains: int, seed: int) -> list[tuple[System, ResidualScale]]:
    """The first step of a bed whose grains were dropped one by one, each rolling to rest: nothing
    is known of its forces.
    """
    scene = SCENES["bed"]
    copies = max(1, round(grains / scene.tile))
    scenario = parse_scenario(
        scene.text(scene.tile, seed, copies),
        "deposited.toml",
        ['particles.0.packing={kind="deposited"}'],
    )
    engine = Engine(*build(scenario), threads=1)
    heard: list[tuple[System, ResidualScale]] = []
    with _listening(engine, heard):
        engine.step(float(scenario.stage_solver(0).dt), 0.0)
    return heard


def _record_run(directory: Path) -> list[tuple[System, ResidualScale]]:
    """The step that a run would take next with its walls held: that after its last step, if its
    grains no longer move.
    """
    with open_run(directory) as run:
        model, state = run.model, run.state()
    if state is None or state.last_dt <= 0.0:
        raise ValueError(f"{directory}: the run has not moved a grain yet")
    heard: list[tuple[System, ResidualScale]] = []
    engine = Engine(model, state, threads=1)
    with _listening(engine, heard):
        engine.step(state.last_dt, 0.0)
    return heard[:1]


SOURCES = ("column", *(name for name, scene in SCENES.items() if not scene.is_frozen), "deposited")
"""Where problems are taken from: the column (of one size), scenes of ``multicor bench``, a bed that
has just been placed. The folder of a run is a source too."""


def is_run(source: str) -> bool:
    """Whether a source is the folder of a run."""
    return (Path(source) / "run.json").is_file()


def consecutive(source: str, grains: int, seed: int, steps: int, folder: Path) -> list[Problem]:
    """Problems of consecutive steps of a scene, from the file if it is there, made and kept
    otherwise.

    Args:
        source: One of `SOURCES` but "column", or the folder of a run (one step with its walls held;
            nothing is kept).
        grains: Number of grains.
        seed: Seed of the scene.
        steps: Number of steps; a step that needed a second solve gives one problem more.
        folder: Where problems are kept.
    """
    if is_run(source):
        return [
            Problem(Path(source).name, system, scale) for system, scale in _record_run(Path(source))
        ]
    name = f"{source}-{grains}"
    path = folder / f"{name}-seed{seed}-{steps}-{_digest()}.npz"
    if path.exists():
        return _load(path, name)
    heard = (
        _record_deposited(grains, seed)
        if source == "deposited"
        else _record_scene(source, grains, seed, steps)
    )
    folder.mkdir(parents=True, exist_ok=True)
    problems = [Problem(name, system, scale) for system, scale in heard]
    _save(path, problems)
    return problems


def _digest() -> str:
    """Changes with the scenes, the kernels and the form of the files, so that old files are not
    taken for new ones.
    """
    text = "".join(scene.text(100, 1, 1) for scene in SCENES.values()) + cache_name()
    return hashlib.sha256(f"{_FORMAT}{text}".encode()).hexdigest()[:8]


def _save(path: Path, problems: list[Problem]) -> None:
    arrays: dict[str, Any] = {"count": len(problems)}
    for number, problem in enumerate(problems):
        arrays[f"{number}.scale"] = np.array(problem.scale)
        for field in (*_ARRAYS, *_NUMBERS):
            arrays[f"{number}.{field}"] = getattr(problem.system, field)
    part = path.with_suffix(".part.npz")
    np.savez(part, **arrays)
    part.replace(path)


def _load(path: Path, name: str) -> list[Problem]:
    with np.load(path, allow_pickle=False) as data:
        problems = []
        for number in range(int(data["count"])):
            fields: dict[str, Any] = {field: _copy(data[f"{number}.{field}"]) for field in _ARRAYS}
            fields["spin_factor"], fields["contacts"] = (
                float(data[f"{number}.spin_factor"]),
                int(data[f"{number}.contacts"]),
            )
            scale = ResidualScale(*(float(value) for value in data[f"{number}.scale"]))
            problems.append(Problem(name, System(**fields), scale))
    return problems
