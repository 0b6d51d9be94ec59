"""From the thermal keys of a scenario to the choices of the heat engine and the thermal conditions of the walls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.engine.contact.hertz import contact_modulus
from multicor_cli.engine.heat.conduction import ContactForce, harmonic_conductivity
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.laws import HeatLaws
from multicor_cli.engine.heat.partition import conductivity_share, effusivity, effusivity_share, electrothermal_share
from multicor_cli.engine.heat.radiation import Radiation, emission_factor
from multicor_cli.engine.heat.settings import HeatSettings, WallHeat
from multicor_cli.engine.motion.drives import Constant, Shifted
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.scenario.drives import engine_signal
from multicor_cli.scenario.materials import Material
from multicor_cli.scenario.models import AmbientCoefficient, AverageForce, Heat
from multicor_cli.scenario.models import Radiation as RadiationTable
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.wall_heat import AnyCondition, FlowCondition, TemperatureCondition

_UNUSED_STIFFNESS = 1.0
"""Modulus and microhardness [Pa] of pairs that do not have them: nothing uses them, and they can be divided by."""


def heat_settings(scenario: Scenario, model: Model) -> HeatSettings | None:
    """The choices about heat; None if the scenario has no ``[heat]``.

    Args:
        scenario: What to do.
        model: Grains and walls of the run; materials come in its order.
    """
    heat = scenario.heat
    if heat is None:
        return None
    gas = heat.gas
    return HeatSettings(
        laws=heat_laws(scenario, model.materials),
        conduction=heat.conduction,
        force=_force(heat),
        friction=heat.friction,
        has_impact=heat.impact,
        is_collisional=heat.collisional,
        gas=None if gas is None else Gas(gas.conductivity, gas.model, gas.reach),
        ambient=_ambient(heat),
        radiation=_radiation(heat.radiation),
        integrator=heat.integrator,
        sub_step=heat.sub_step,
        tolerance=heat.tolerance,
    )


def _force(heat: Heat) -> ContactForce:
    if heat.force is None:
        return ContactForce()
    if isinstance(heat.force, AverageForce):
        return ContactForce("average", heat.force.average)
    return ContactForce("prescribed", heat.force.prescribed)


def _ambient(heat: Heat) -> Ambient | None:
    table = heat.ambient
    if table is None:
        return None
    if isinstance(table, AmbientCoefficient):
        return Ambient(table.temperature, coefficient=table.coefficient)
    return Ambient(
        table.temperature,
        correlation=table.correlation,
        conductivity=table.conductivity,
        viscosity=table.viscosity,
        prandtl=table.prandtl,
        porosity=1.0 if table.porosity is None else table.porosity,
        velocity=table.velocity,
    )


def _radiation(table: RadiationTable | None) -> Radiation | None:
    if table is None:
        return None
    return Radiation(table.surroundings, table.neighbors, 0.0 if table.reach is None else table.reach)


def heat_laws(scenario: Scenario, materials: Sequence[str]) -> HeatLaws:
    """Thermal properties of the materials and of their pairs.

    Properties that a material does not give are not needed in this run (loading the scenario has checked that). They are 0 in
    these arrays, except the modulus and the microhardness of such pairs, which are 1 Pa, and their shares, which are ½.

    Args:
        scenario: A scenario with heat.
        materials: Names of the materials, in the order of the model.
    """
    tables = [scenario.materials[name] for name in materials]
    heat = scenario.heat
    if heat is None:
        message = "a scenario without [heat] has no heat laws"
        raise ValueError(message)
    return HeatLaws(
        conductivity=np.array([table.conductivity or 0.0 for table in tables], float),
        volumetric=np.array([table.density * (table.heat_capacity or 0.0) for table in tables], float),
        modulus=_of_pairs(tables, _modulus),
        harmonic=_of_pairs(tables, _harmonic),
        share=_shares(tables, _SHARES[heat.partition]),
        emissivity=np.array([table.emissivity or 0.0 for table in tables], float),
        emission=_of_pairs(tables, lambda a, b: emission_factor(a.emissivity or 0.0, b.emissivity or 0.0)),
        roughness=_of_pairs(tables, lambda a, b: _together(a.roughness, b.roughness)),
        slope=_of_pairs(tables, lambda a, b: _together(a.asperity_slope, b.asperity_slope)),
        microhardness=_of_pairs(tables, _microhardness),
        wear=_wear(scenario, materials, tables),
    )


Pair = Callable[[Material, Material], float]


def _of_pairs(tables: Sequence[Material], formula: Pair) -> Floats:
    return np.array([[formula(a, b) for b in tables] for a in tables], float)


def _modulus(a: Material, b: Material) -> float:
    if a.young is None or a.poisson is None or b.young is None or b.poisson is None:
        return _UNUSED_STIFFNESS
    return contact_modulus(a.young, a.poisson, b.young, b.poisson)


def _harmonic(a: Material, b: Material) -> float:
    if a.conductivity is None or b.conductivity is None:
        return 0.0
    return harmonic_conductivity(a.conductivity, b.conductivity)


def _together(a: float | None, b: float | None) -> float:
    """Root of the sum of the squares, 0 if one is not given."""
    return 0.0 if a is None or b is None else hypot(a, b)


def _microhardness(a: Material, b: Material) -> float:
    if a.microhardness is None or b.microhardness is None:
        return _UNUSED_STIFFNESS
    return 2.0 * a.microhardness * b.microhardness / (a.microhardness + b.microhardness)


def _by_effusivity(a: Material, b: Material) -> float:
    if a.conductivity is None or a.heat_capacity is None or b.conductivity is None or b.heat_capacity is None:
        return 0.5
    first = effusivity(a.conductivity, a.density, a.heat_capacity)
    return effusivity_share(first, effusivity(b.conductivity, b.density, b.heat_capacity))


def _by_conductivity(a: Material, b: Material) -> float:
    if a.conductivity is None or b.conductivity is None:
        return 0.5
    return conductivity_share(a.conductivity, b.conductivity)


def _by_electrothermal(a: Material, b: Material) -> float:
    if a.conductivity is None or a.resistivity is None or b.conductivity is None or b.resistivity is None:
        return 0.5
    return electrothermal_share(a.resistivity, b.resistivity, a.conductivity, b.conductivity)


_SHARES: dict[str, Pair] = {
    "effusivity": _by_effusivity,
    "conductivity": _by_conductivity,
    "half": lambda _a, _b: 0.5,
    "electrothermal": _by_electrothermal,
}


def _shares(tables: Sequence[Material], formula: Pair) -> Floats:
    """Share of the first body; that of the second is what remains, so that nothing is lost to rounding."""
    share = _of_pairs(tables, formula)
    lower = np.tril_indices(len(tables), -1)
    share[lower] = 1.0 - share.T[lower]
    np.fill_diagonal(share, 0.5)
    return share


def _wear(scenario: Scenario, materials: Sequence[str], tables: Sequence[Material]) -> Floats:
    """Archard's coefficient over the hardness of the first material [1/Pa]; 0 for pairs without wear, or that cannot touch."""
    wear = np.zeros((len(materials), len(materials)))
    for i, a in enumerate(materials):
        for j, b in enumerate(materials):
            if not any(entry.covers(a, b) for entry in scenario.contacts):
                continue
            coefficient, hardness = scenario.law(a, b).wear, tables[i].hardness
            if coefficient is not None and hardness is not None:
                wear[i, j] = coefficient / hardness
    return wear


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

    def started(self, stage_starts: Sequence[float]) -> list[WallHeat]:
        """The conditions as functions of the time since the start of this stage.

        Args:
            stage_starts: Times at which the stages up to this one have begun [s].
        """
        return [self._shift(wall, named, stage_starts) for wall, named in zip(self.walls, self.named_by, strict=True)]

    def _shift(self, wall: WallHeat, named_by: int, stage_starts: Sequence[float]) -> WallHeat:
        if named_by == self.stage or isinstance(wall.signal, Constant | Shifted):
            return wall
        return replace(wall, signal=Shifted(wall.signal, stage_starts[self.stage] - stage_starts[named_by]))


def wall_heat(scenario: Scenario, wall_names: Sequence[str]) -> list[StageWallHeat]:
    """The thermal conditions of all walls in all stages.

    Args:
        scenario: What to do.
        wall_names: Names of the walls, in the order of the engine.
    """
    return [
        StageWallHeat(number, tuple(_engine_condition(kept.condition) for kept in walls), tuple(kept.stage for kept in walls))
        for number, walls in enumerate(scenario.wall_conditions(tuple(wall_names)))
    ]


def _engine_condition(condition: AnyCondition) -> WallHeat:
    if isinstance(condition, TemperatureCondition):
        return WallHeat("temperature", engine_signal(condition.temperature))
    if isinstance(condition, FlowCondition):
        return WallHeat("flow", engine_signal(condition.flow))
    return WallHeat()
