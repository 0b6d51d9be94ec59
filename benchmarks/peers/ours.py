"""The program itself: it brings the cases to their start, and runs them beside the others."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from case import Floats, FlowPlan, Frames, Glued, Layer
from scene import DENSITY

from multicor_cli.bench.driving import PreparedScene, prepare
from multicor_cli.bench.scenes import BenchScene
from multicor_cli.engine import Engine, Settings
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.model import Model, ShapeKind, State
from multicor_cli.running.time_step import Scales

_BOTTOM, _TOP = 0, 1  # walls of the sheared layer


@dataclass(frozen=True)
class OurRun:
    """What a run of the program took.

    Attributes:
        seconds: Time of the measured steps [s].
        steps: Number of measured steps.
        dt: Time step [s].
        frames: What was seen at equal strains.
        sweeps: Sweep-equivalents per step, mean.
        residual: rms velocity correction over u_ref, mean over the steps.
        overlap: Largest overlap over the smaller radius at the end of any step.
        unconverged: Steps that missed the tolerances.
    """

    seconds: float
    steps: int
    dt: float
    frames: Frames
    sweeps: float
    residual: float
    overlap: float
    unconverged: int


def loosened(tolerance: float | None) -> Settings:
    """Default settings, or their tolerances with the same ratios and ``tolerance`` for the rms."""
    default = Settings()
    if tolerance is None:
        return default
    factor = tolerance / default.tolerance_rms
    energy, largest = factor * default.tolerance_energy, factor * default.tolerance_max
    return replace(default, tolerance_rms=tolerance, tolerance_max=largest, tolerance_energy=energy)


class Start:
    """A scene at the start of its last stage, from which engines are made as often as needed."""

    def __init__(self, scene: BenchScene, grains: int, *, threads: int = 1, seed: int = 1) -> None:
        """Bring the scene there.

        Args:
            scene: The scene.
            grains: Number of grains.
            threads: Number of threads that the engines get.
            seed: Seed of sizes and places of the grains.
        """
        self._prepared: PreparedScene = prepare(scene, grains, seed=seed, threads=threads)

    @property
    def model(self) -> Model:
        """What does not change."""
        return self._prepared.model

    @property
    def state(self) -> State:
        """The state that engines start from."""
        return self._prepared.state

    @property
    def dt(self) -> float:
        """Time step of the scene [s]."""
        return self._prepared.stage.dt

    def advance(self, duration: float) -> None:
        """Let the scene go on for a time [s], so that the next engines start from another state."""
        self._prepared.take(round(duration / self.dt))

    def engine(self, settings: Settings) -> Engine:
        """An engine of its own in front of this state."""
        engine = copy.deepcopy(self._prepared.engine)
        engine.resume(replace(engine.orders, settings=settings))
        engine.state.window_wall_impulse[:] = 0.0
        return engine

    def heat_settings(self) -> HeatSettings:
        """Choices about heat of a scene that has some."""
        heat = self._prepared.engine.heat
        assert heat is not None
        return heat

    def layer(self) -> Layer:
        """The sheared layer as the others see it."""
        model, state = self.model, self.state
        bottom, top = (glued(model, state, wall) for wall in (_BOTTOM, _TOP))
        fall = self._prepared.stage.drives.started([0.0, 0.0])[_TOP].y
        assert fall.force is not None
        height = float(top.position[:, 1].mean() - bottom.position[:, 1].mean())
        return Layer(
            state.position[:, :2].copy(), state.velocity.copy(), model.grains.radius, DENSITY,
            float(model.laws.friction[0, 0]), bottom, top,
            model.period, float(state.wall_velocity[_TOP, 0]), float(state.wall_velocity[_TOP, 1]),
            float(model.walls.mass[_TOP]), -fall.force.value(0.0), fall.damping, height,
        )  # fmt: skip


def automatic_step(layer: Layer) -> float:
    """What the program would choose for a layer, over τ."""
    return Scales(layer.tau, layer.height / layer.speed, math.inf, layer.friction).limit / layer.tau


def glued(model: Model, state: State, wall: int) -> Glued:
    """The grains of a rough wall where they are."""
    shapes = model.shapes
    mine = (shapes.wall == wall) & (shapes.kind == ShapeKind.DISC)
    return Glued(
        shapes.geometry[mine, :2] + state.wall_position[wall, :2], shapes.geometry[mine, 2]
    )


def flow(start: Start, layer: Layer, settings: Settings, dt_tau: float, plan: FlowPlan) -> OurRun:
    """Let the layer flow, then measure it.

    Args:
        start: The layer where it starts.
        layer: The same for the others.
        settings: Tolerances.
        dt_tau: Time step over τ.
        plan: Strains.
    """
    engine = start.engine(settings)
    every = max(1, round(layer.duration(plan.between) / (dt_tau * layer.tau)))
    dt = layer.duration(plan.between) / every
    for _ in range(round(plan.settle / plan.between) * every):
        engine.step(dt, 0.0)
    engine.state.window_wall_impulse[:] = 0.0
    seconds, reports, seen = 0.0, [], []
    for _ in range(plan.frames):
        begin = time.perf_counter()
        reports += [engine.step(dt, 0.0) for _ in range(every)]
        seconds += time.perf_counter() - begin
        seen.append(_look(engine.state, start.model, every * dt))
    places, velocities, forces = (np.array(part) for part in zip(*seen, strict=True))
    return OurRun(
        seconds, len(reports), dt, Frames(places, velocities, forces),
        _mean(r.sweeps for r in reports),
        _mean(r.rms for r in reports), max(r.overlap for r in reports),
        sum(not r.converged for r in reports),
    )  # fmt: skip


def _look(state: State, model: Model, duration: float) -> tuple[Floats, Floats, Floats]:
    """Places, velocities along x, and mean force on the upper wall since the last look."""
    walls = [glued(model, state, wall).position for wall in (_BOTTOM, _TOP)]
    force = state.window_wall_impulse[_TOP, :2] / duration
    state.window_wall_impulse[:] = 0.0
    return np.concatenate([state.position[:, :2], *walls]), state.velocity[:, 0].copy(), force


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))
