"""From the key ``until`` of a stage to the condition that ends it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from multicor_cli.engine.motion.spacing import Spacing
from multicor_cli.model import Model
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.running.cadence import count_steps
from multicor_cli.running.conditions import Aim, Condition, RestReached, StrainReached
from multicor_cli.running.gauges import ShearGauge
from multicor_cli.running.steady import BLOCKS, Steady
from multicor_cli.running.wall_conditions import DisplacementReached, DistanceReached, ForceReached
from multicor_cli.scenario.loading import Stage
from multicor_cli.scenario.until import (
    BoundEnd,
    UntilAxialStrain,
    UntilDisplacement,
    UntilForce,
    UntilRest,
    UntilSteady,
    UntilStrain,
    UntilStress,
)

_COLUMN = {"x": X, "y": Y, "spin": SPIN}


def condition_of(stage: Stage, model: Model, dt: float) -> Condition | None:
    """What ends a stage before its duration is over, if anything does.

    Args:
        stage: The stage.
        model: Grains and walls.
        dt: Time step of the stage [s], in which windows of time are counted.

    Raises:
        ValueError: If a wall does not exist, or is named twice; loading a scenario excludes it.
    """
    if stage.until is None:
        return None
    return _MAKERS[type(stage.until)](stage.until, model, dt)


def _strain(until: UntilStrain, model: Model, dt: float) -> Condition:
    return StrainReached(ShearGauge.between(model, *until.strain.walls), until.strain.value)


def _rest(until: UntilRest, model: Model, dt: float) -> Condition:
    return RestReached(until.kinetic_energy_ratio)


def _axial_strain(until: UntilAxialStrain, model: Model, dt: float) -> Condition:
    end = until.axial_strain
    spacing = Spacing.between(model, *end.walls, _COLUMN[end.axis])
    return DistanceReached(_aim(f"the axial strain in {end.axis} between {end.walls[0]} and {end.walls[1]}", "1", end), spacing)


def _displacement(until: UntilDisplacement, model: Model, dt: float) -> Condition:
    end = until.displacement
    of_what, unit = ("the angle turned", "rad") if end.axis == "spin" else (f"the displacement in {end.axis}", "m")
    return DisplacementReached(_aim(f"{of_what} of {end.wall}", unit, end), _wall(model, end.wall), _COLUMN[end.axis])


def _force(until: UntilForce, model: Model, dt: float) -> Condition:
    end = until.force
    of_what, unit = ("torque", "N m") if end.axis == "spin" else (f"force in {end.axis}", "N")
    sought = _aim(f"the mean {of_what} on {end.wall}", unit, end)
    return ForceReached(sought, _wall(model, end.wall), _COLUMN[end.axis], count_steps(end.window, dt), 1.0)


def _stress(until: UntilStress, model: Model, dt: float) -> Condition:
    end = until.stress
    wall = _wall(model, end.wall)
    sought = _aim(f"the mean stress in {end.axis} on {end.wall}", "N/m", end)
    return ForceReached(sought, wall, _COLUMN[end.axis], count_steps(end.window, dt), float(model.walls.length[wall]))


def _steady(until: UntilSteady, model: Model, dt: float) -> Condition:
    end = until.steady
    wall = None if end.wall is None else _wall(model, end.wall)
    axis = X if end.axis is None else _COLUMN[end.axis]
    across = (Y if axis == X else X) if end.of == "friction" else None
    what = {
        "kinetic_energy": "the kinetic energy",
        "friction": f"the ratio of the force in {end.axis} to that across on {end.wall}",
    }
    if end.axis is not None:
        component = "torque" if end.axis == "spin" else f"{end.of} in {end.axis}"
        what |= dict.fromkeys(("force", "stress"), f"the {component} on {end.wall}")
    sought = Aim(f"the drift of {what[end.of]}", "1", "at most", end.tolerance)
    return Steady(sought, wall, axis, across, count_steps(end.window / BLOCKS, dt), round(end.after / dt))


def _aim(quantity: str, unit: str, end: BoundEnd) -> Aim:
    return Aim(quantity, unit, end.relation, end.goal)


def _wall(model: Model, name: str) -> int:
    return model.walls.names.index(name)


_MAKERS: dict[type, Callable[[Any, Model, float], Condition]] = {
    UntilStrain: _strain,
    UntilRest: _rest,
    UntilAxialStrain: _axial_strain,
    UntilDisplacement: _displacement,
    UntilForce: _force,
    UntilStress: _stress,
    UntilSteady: _steady,
}
