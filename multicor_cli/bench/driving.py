"""Carries a scene, in memory, to where it is measured, and takes its steps there."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import total
from multicor_cli.bench.scenes import BenchScene
from multicor_cli.engine import Engine
from multicor_cli.engine.orders import StepReport
from multicor_cli.model import Model, ShapeKind, State, WallShapes
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import TAIL, Tail
from multicor_cli.packing import build
from multicor_cli.running.conditions import KINETIC
from multicor_cli.running.controller import Controller
from multicor_cli.running.from_scenario import make_plan
from multicor_cli.running.plan import StagePlan, begin_stage
from multicor_cli.running.session import make_engine
from multicor_cli.scenario import Scenario, parse_scenario
from multicor_cli.store.documents import Reason

# ---- A scene that is ready, and its steps


@dataclass(frozen=True)
class Round:
    """Steps measured together: times [s], those of solves, shares with a core without waiting."""

    seconds: list[float]
    solves: list[float]
    shares: list[float]
    phases: dict[str, float]
    reports: list[StepReport]


@dataclass
class PreparedScene:
    """A prepared scene, ready to be timed in its last stage."""

    scene: BenchScene
    model: Model
    engine: Engine
    stage: StagePlan

    @property
    def state(self) -> State:
        return self.engine.state

    def take(self, steps: int, between: Callable[[], None] | None = None) -> Round:
        """Take some steps; ``between`` is called after every fourth, and its time not counted."""
        timers = self.engine.timers
        before = dict(timers)
        seconds, solves, shares, reports = [], [], [], []
        for number in range(steps):
            solved, busy, start = timers["solve"], time.thread_time(), time.perf_counter()
            reports.append(self.engine.step(self.stage.dt, self.state.stage_step * self.stage.dt))
            seconds.append(time.perf_counter() - start)
            shares.append(min(1.0, (time.thread_time() - busy) / seconds[-1]))
            solves.append(timers["solve"] - solved)
            if between is not None and number % 4 == 0:
                between()
        phases = {name: after - before[name] for name, after in timers.items()}
        return Round(seconds, solves, shares, phases, reports)

    def take_cold(self) -> Round:
        """Take one step whose solve knows nothing of the impulses of the last."""
        self.state.contact_impulse = np.zeros_like(self.state.contact_impulse)
        return self.take(1)


def prepare(scene: BenchScene, grains: int, *, seed: int = 1, threads: int = 1) -> PreparedScene:
    """Bring a scene to where it is measured; ``threads`` are those of the part that is measured.

    Of a tiled scene the nearest multiple of its tile is taken. Raises `NoRestError` if the scene is
    measured at rest and does not come to rest, and `PhysicsError` from a step.
    """
    count, copies = (scene.tile, max(1, round(grains / scene.tile))) if scene.tile else (grains, 1)
    narrow, wide = (
        parse_scenario(scene.text(count, seed, k), Path(f"{scene.name}.toml")) for k in (1, copies)
    )
    model, state = build(narrow)
    plan = make_plan(wide, model)
    starts = [0.0]
    if len(plan.stages) > 1:
        starts = _run_to_last(scene, narrow, model, state)
    # the books begin with the part that is measured
    if scene.tile and (copies > 1 or len(plan.stages) > 1):
        model, state = repeat_scene(model, state, copies)
    elif len(plan.stages) > 1:
        state = _fresh(model, state)
    engine = make_engine(wide, model, state, threads)
    begin_stage(engine, plan.stages[-1], starts)
    return PreparedScene(scene, model, engine, plan.stages[-1])


def _run_to_last(scene: BenchScene, narrow: Scenario, model: Model, state: State) -> list[float]:
    """Carry out all stages but the last; returns the times at which the stages began [s]."""
    plan = make_plan(narrow, model)
    first, *others = plan.stages[:-1]
    rest = Rest.of(model, first.dt) if scene.rests else None
    if rest is not None:
        first = _Settling(**vars(first), rest=rest)
    engine = make_engine(narrow, model, state, threads=0)
    Controller(replace(plan, stages=[first, *others]), engine, _NoRecorder()).run(is_new=True)
    if rest is not None:
        rest.check(scene.name, state)
    return [0.0] * (len(plan.stages) - 1) + [state.time]


class _NoRecorder:
    def _ignore(self, *_: Any) -> None:
        pass

    frame = series = checkpoint = stage_ended = heartbeat = _ignore


def _fresh(model: Model, state: State) -> State:
    """The same places, velocities and contacts at step 0, with new books."""
    result = State.at_rest(model, state.position)
    motion = ("velocity", "wall_position", "wall_velocity")
    for name in (*motion, "contact_i", "contact_j", "contact_impulse", "heat"):
        setattr(result, name, np.array(getattr(state, name)))
    result.last_dt = state.last_dt
    return result


# ---- Rest: when the kinetic energy says so, for long enough; a number of steps says nothing

QUIET = 1e-7
"""Kinetic energy at rest over Σ m g d: lifts of 10⁻⁷ diameters; the solver leaves 10⁻⁸."""

REST_FOR = 4.0
"""How long it must stay so, over √(d/g): without support a grain falls eight diameters in it."""


class NoRestError(Exception):
    """A scene did not come to rest; the message says how far it is from it."""


@dataclass
class Rest:
    """Kinetic energy up to ``allowed`` [J] for ``steps`` steps; ``quiet`` counts those so far."""

    allowed: float
    steps: int
    quiet: int = 0

    @classmethod
    def of(cls, model: Model, dt: float) -> Rest:
        diameter, gravity = model.mean_diameter, hypot(*model.gravity.tolist())
        weight = total(model.grains.mass) * gravity
        steps = math.ceil(REST_FOR * math.sqrt(diameter / gravity) / dt)
        return cls(QUIET * weight * diameter, steps)

    @property
    def is_reached(self) -> bool:
        return self.quiet >= self.steps

    def note(self, state: State) -> None:
        self.quiet = self.quiet + 1 if state.books[KINETIC] <= self.allowed else 0

    def check(self, name: str, state: State) -> None:
        """Raise `NoRestError`, with the name of the scene and its energy, if it does not rest."""
        if self.is_reached:
            return
        raise NoRestError(
            f"the {name} did not come to rest within {state.time:.3g} s: kinetic energy "
            f"{state.books[KINETIC]:.2e} J, allowed {self.allowed:.2e} J for {self.steps} steps"
        )


@dataclass(frozen=True)
class _Settling(StagePlan):
    """A stage that ends when the grains have come to rest, or when its time is over."""

    rest: Rest = field(kw_only=True)

    def reason_to_end(self, state: State) -> Reason | None:
        """Why the stage is over, if it is; asked once after each step."""
        self.rest.note(state)
        return "condition" if self.rest.is_reached else super().reason_to_end(state)


# ---- A periodic scene side by side, which goes on as the original would


def repeat_scene(model: Model, state: State, copies: int) -> tuple[Model, State]:
    """A model and a state of ``copies`` periods, at step 0 with the warm start of the last step.

    Loads on walls, and their masses where a wall has one, are not repeated: the caller's scenario
    knows them. Walls are level planes and rough walls. Raises `ValueError` if nothing is periodic.
    """
    if not model.period > 0.0:
        raise ValueError("only a periodic scene can be repeated")
    shape_copies = np.where(model.shapes.kind == ShapeKind.PLANE, 1, copies)
    walls = model.walls
    wide = replace(
        model.with_grains(np.tile(np.arange(model.grain_count), copies)),
        shapes=_repeat_shapes(model, shape_copies),
        walls=replace(walls, mass=walls.mass * copies, length=walls.length * copies),
        period=model.period * copies,
        numbers=None,
    )
    position = np.tile(state.position, (copies, 1))
    position[:, 0] += np.repeat(np.arange(copies), model.grain_count) * model.period
    result = State.at_rest(wide, position)
    result.velocity[:] = np.tile(state.velocity, (copies, 1))
    result.wall_position = state.wall_position.copy()
    result.wall_velocity = state.wall_velocity.copy()
    contacts = _repeat_contacts(model, state, shape_copies, copies)
    result.contact_i, result.contact_j, result.contact_impulse = contacts
    result.last_dt = state.last_dt
    if model.thermal is not None:
        result.heat = np.tile(state.heat, copies)
        result.wall_temperature = state.wall_temperature.copy()
    return wide, result


def _repeat_shapes(model: Model, shape_copies: NDArray[np.int64]) -> WallShapes:
    """Shapes of the walls, the copies of each side by side in the list."""
    shapes = model.shapes
    geometry = np.repeat(shapes.geometry, shape_copies, axis=0)
    shift = np.concatenate([np.arange(k) for k in shape_copies] or [np.zeros(0)]) * model.period
    geometry[:, 0] += shift
    has_end = np.repeat(TAIL[shapes.kind] == Tail.POINT, shape_copies)
    geometry[has_end, 2] += shift[has_end]
    kind, wall, material = (
        np.repeat(values, shape_copies) for values in (shapes.kind, shapes.wall, shapes.material)
    )
    return WallShapes(kind, wall, geometry, material)


def _repeat_contacts(
    model: Model, state: State, shape_copies: NDArray[np.int64], copies: int
) -> tuple[Ints, Ints, Floats]:
    """Sorted; those across the ends of the period join neighboring copies."""
    n, period = model.grain_count, model.period
    i, j = state.contact_i.astype(np.int64), state.contact_j.astype(np.int64)
    is_wall = j >= n
    shape = np.where(is_wall, j - n, 0)
    of_walls = model.shapes.geometry[:, 0] + state.wall_position[model.shapes.wall, 0]
    x = np.concatenate([state.position[:, 0], of_walls])
    across = np.rint((x[i] - x[j]) / period).astype(np.int64)
    first_copy = np.concatenate([[0], np.cumsum(shape_copies)])[:-1]
    rows = []
    for copy in range(copies):
        other = (copy + across) % copies
        a, b = i + copy * n, j + other * n
        if shape_copies.size:
            of_shape = first_copy[shape] + np.where(shape_copies[shape] > 1, other, 0)
            b = np.where(is_wall, n * copies + of_shape, b)
        # Exchanging the two keeps p_n and p_t
        rows.append(np.column_stack([np.minimum(a, b), np.maximum(a, b)]))
    pairs = np.concatenate(rows)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    impulse = np.tile(state.contact_impulse, (copies, 1))[order]
    return pairs[order, 0].astype(np.int32), pairs[order, 1].astype(np.int32), impulse
