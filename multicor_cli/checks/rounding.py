"""Whether numbers of the flow stand out of the rounding of larger ones, to which they are added."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.prepared import Prepared
from multicor_cli.engine.motion.drives import DofDrive

_SAMPLES = 32
_DOUBLE, _SINGLE = float(np.finfo(np.float64).eps), float(np.finfo(np.float32).eps)


def _farthest(run: Prepared) -> float:
    """Largest coordinate of a grain or wall [m]."""
    places = (run.state.position[:, :2], run.state.wall_position[:, :2])
    return max([run.model.period, *(float(np.abs(place).max(initial=0.0)) for place in places)])


def _smallest(run: Prepared) -> float:
    return float(run.model.grains.radius.min())


def _of_places(run: Prepared) -> Iterator[Measured]:
    far = _farthest(run)
    yield Measured(_DOUBLE * far / _smallest(run), f"places up to {far:.3g} m")
    yield from _of_loads(run)


def _of_loads(run: Prepared) -> Iterator[Measured]:
    """ε F Δt²/M: what rounding leaves of the way on which a load sends its wall before the grains hold it."""
    walls = run.model.walls
    for stage, drives in zip(run.plan.stages, run.drives, strict=True):
        length = 1.0 if stage.length is None else stage.length
        for w, drive in enumerate(drives):
            dofs = ((drive.x, walls.mass[w], 1.0), (drive.y, walls.mass[w], 1.0), (drive.spin, walls.inertia[w], walls.length[w]))
            for dof, mass, lever in dofs:
                load = _largest_load(dof, float(walls.length[w]), length)
                if load > 0.0:
                    way = load * stage.dt * stage.dt / (float(mass) + 0.5 * stage.dt * dof.damping) * float(lever)
                    yield Measured(_DOUBLE * way / _smallest(run), f"load of wall {walls.names[w]} in stage {stage.name}")


def _largest_load(dof: DofDrive, length: float, duration: float) -> float:
    """Largest force [N] or torque [N m] of a stage; 0 where a motion is prescribed."""
    loads = [(dof.force, 1.0), (dof.stress, length)]
    times = [duration * (k + 0.5) / _SAMPLES for k in range(_SAMPLES)]
    return math.fsum(factor * max(abs(load.value(t)) for t in times) for load, factor in loads if load is not None)


def _stored(run: Prepared) -> Iterator[Measured]:
    if run.scenario.output.precision == "single":
        far = _farthest(run)
        yield Measured(_SINGLE * far / _smallest(run), f"places up to {far:.3g} m")


RULES: tuple[Rule[Prepared], ...] = (
    Rule(
        "round-off", _of_places, unit="of the smallest radius", warning=1e-7, bad=5e-4,
        meaning="What rounding leaves open of the places of grains and walls: 2·10⁻¹⁶ of their coordinates, and of the way on "
        "which a load would send its wall in a step, if no grain held it.",
        remedy="Put the domain near the origin; give the wall a mass not far below that of the grains under it, or a shorter dt.",
    ),
    Rule(
        "stored places", _stored, unit="of the smallest radius", warning=1e-2, bad=0.1,
        meaning='What rounding to numbers of seven digits (precision = "single") leaves open of the places in the files.',
        remedy='Use precision = "double", or put the domain near the origin.',
    ),
)  # fmt: skip
"""What is checked of rounding."""
