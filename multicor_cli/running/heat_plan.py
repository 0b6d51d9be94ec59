"""From the thermal keys of a scenario to the choices of the heat engine and the thermal conditions of the walls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.heat.conduction import ContactForce
from multicor_cli.engine.heat.laws import heat_laws
from multicor_cli.engine.heat.mechanism import HeatLaws
from multicor_cli.engine.heat.settings import MECHANISMS, HeatSettings
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.model import Model
from multicor_cli.scenario.drives import engine_signal, kept_signal
from multicor_cli.scenario.heat import AverageForce, Heat
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.wall_heat import AnyCondition, CapacityCondition, FlowCondition, TemperatureCondition


def heat_settings(scenario: Scenario, model: Model) -> HeatSettings | None:
    """The choices about heat; None if the scenario has no ``[heat]``.

    Args:
        scenario: What to do.
        model: Grains and walls of the run; materials come in its order.
    """
    heat = scenario.heat
    if heat is None:
        return None
    mechanisms = tuple(table.as_record(MECHANISMS[key]) for key, table in heat.mechanisms.items())
    return heat.as_record(HeatSettings, laws=laws_of_scenario(scenario, model.materials), force=_force(heat), mechanisms=mechanisms)


def _force(heat: Heat) -> ContactForce:
    if heat.force is None:
        return ContactForce()
    if isinstance(heat.force, AverageForce):
        return ContactForce("average", heat.force.average)
    return ContactForce("prescribed", heat.force.prescribed)


def laws_of_scenario(scenario: Scenario, materials: Sequence[str]) -> HeatLaws:
    """Thermal properties of the materials and of their pairs, as `multicor_cli.engine.heat.laws.heat_laws`.

    Args:
        scenario: A scenario with heat.
        materials: Names of the materials, in the order of the model.
    """
    if scenario.heat is None:
        message = "a scenario without [heat] has no heat laws"
        raise ValueError(message)
    tables = [scenario.materials[name].model_dump() for name in materials]
    wear = np.array([[_wear(scenario, a, b) for b in materials] for a in materials], float)
    return heat_laws(tables, scenario.heat.partition, wear)


def _wear(scenario: Scenario, a: str, b: str) -> float:
    """Archard's coefficient of two materials; 0 without wear, or if they cannot touch."""
    is_covered = any(entry.covers(a, b) for entry in scenario.contacts)
    return (scenario.law(a, b).wear if is_covered else None) or 0.0


@dataclass(frozen=True)
class StageWallHeat:
    """The thermal conditions of the walls in one stage.

    Attributes:
        stage: Index of the stage.
        walls: One condition per wall; signals are functions of the time since the start of the stage that named them.
        named_by: For each wall the index of the stage from whose start its signal counts.
    """

    stage: int
    walls: tuple[WallHeat, ...]
    named_by: tuple[int, ...]

    def beginning(self) -> NDArray[np.bool_]:
        """Which walls have a condition that begins with this stage, shape ``(w,)``."""
        return np.array([named_by == self.stage for named_by in self.named_by], np.bool_)

    def started(self, stage_starts: Sequence[float]) -> list[WallHeat]:
        """The conditions as functions of the time since the start of this stage.

        Args:
            stage_starts: Times at which the stages up to this one have begun [s].
        """
        return [
            replace(wall, signal=kept_signal(wall.signal, named_by, self.stage, stage_starts))
            for wall, named_by in zip(self.walls, self.named_by, strict=True)
        ]


def wall_heat(scenario: Scenario, wall_names: Sequence[str]) -> list[StageWallHeat]:
    """The thermal conditions of all walls in all stages.

    Args:
        scenario: What to do.
        wall_names: Names of the walls, in the order of the engine.
    """
    fallback = math.nan if scenario.heat is None else scenario.heat.temperature
    found = []
    for number, walls in enumerate(scenario.wall_conditions(tuple(wall_names))):
        conditions = (_engine_condition(kept.condition, fallback) for kept in walls)
        found.append(StageWallHeat(number, tuple(conditions), tuple(kept.stage for kept in walls)))
    return found


def _engine_condition(condition: AnyCondition, fallback: float) -> WallHeat:
    if isinstance(condition, CapacityCondition):
        initial = math.nan if condition.initial is None else condition.initial
        return WallHeat("capacity", capacity=condition.capacity, initial=initial, fallback=fallback)
    if isinstance(condition, TemperatureCondition):
        return WallHeat("temperature", engine_signal(condition.temperature))
    if isinstance(condition, FlowCondition):
        return WallHeat("flow", engine_signal(condition.flow))
    return WallHeat()
