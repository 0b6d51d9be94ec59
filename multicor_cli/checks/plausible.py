"""Values that are allowed but seldom meant: other units than those of the SI, a sign, or temperatures that no solid has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multicor_cli.checks.check import Measured, Rule
from multicor_cli.checks.prepared import Prepared
from multicor_cli.checks.recorded import Recorded
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.scenario.scenario import Scenario

_HOTTEST_SOLID = 4300.0
"""Temperature that no known solid bears [K]: mixed carbides and nitrides of hafnium melt near it (Q.-J. Hong & A. van de Walle,
Phys. Rev. B 92, 2015, 020104)."""

_SI = "All numbers of a scenario are in SI units."


def _densities(run: Prepared) -> Iterator[Measured]:
    return (Measured(table.density, name) for name, table in run.scenario.materials.items())


def _young(run: Prepared) -> Iterator[Measured]:
    return (Measured(table.young, name) for name, table in run.scenario.materials.items() if table.young is not None)


def _diameters(run: Prepared) -> Iterator[Measured]:
    grains = run.model.grains
    for index, name in enumerate(run.model.groups):
        radius = grains.radius[grains.group == index]
        for value in {float(radius.min()), float(radius.max())} if radius.size else ():
            yield Measured(2.0 * value, name)


def _friction(run: Prepared) -> Iterator[Measured]:
    named = [("", run.model.laws), *((f"stage {stage.name}", stage.laws) for stage in run.plan.stages if stage.laws is not None)]
    for name, laws in named:
        values = np.concatenate([laws.friction.ravel(), laws.table_friction])
        values = values[np.isfinite(values)]
        if values.size:
            yield Measured(float(values.max()), name)


def _temperatures(run: Prepared) -> Iterator[Measured]:
    heat, thermal = run.scenario.heat, run.model.thermal
    if heat is None or thermal is None:
        return
    yield Measured(float(run.state.temperature(thermal).min()), "coldest grain")
    for stage in run.plan.stages:
        conditions = [] if stage.heat is None else stage.heat.conditions.started([0.0] * len(run.plan.stages))
        for name, wall in zip(run.model.walls.names, conditions, strict=False):
            if wall.kind == "temperature" and wall.signal is not None:
                yield Measured(wall.signal.value(0.0), f"wall {name} in stage {stage.name}")
    if heat.ambient is not None:
        yield Measured(heat.ambient.temperature, "fluid")
    if heat.radiation is not None and heat.radiation.surroundings is not None:
        yield Measured(heat.radiation.surroundings, "surroundings")


def _melting(scenario: Scenario, model: Model) -> Floats:
    """Temperature that each material bears [K], shape ``(k,)``."""
    return np.array([scenario.materials[name].melting or _HOTTEST_SOLID for name in model.materials])


def _of_grains(scenario: Scenario, model: Model, temperature: Floats) -> Iterator[Measured]:
    """The hottest grain of each material over what it bears; T [K] of shape ``(n,)``, nan of grains that are not there."""
    for k, limit in enumerate(_melting(scenario, model)):
        of_it = temperature[(model.grains.material == k) & np.isfinite(temperature)]
        if of_it.size:
            yield Measured(float(of_it.max() / limit), f"{of_it.max():.5g} K, a grain of {model.materials[k]}")


def _hot(run: Prepared) -> Iterator[Measured]:
    heat, model, thermal = run.scenario.heat, run.model, run.model.thermal
    if heat is None or thermal is None:
        return
    yield from _of_grains(run.scenario, model, run.state.temperature(thermal))
    shapes, melting = model.shapes, _melting(run.scenario, model)
    bears = [float(melting[shapes.material[shapes.wall == w]].min(initial=_HOTTEST_SOLID)) for w in range(model.wall_count)]
    for stage in run.plan.stages:
        conditions = [] if stage.heat is None else stage.heat.conditions.started([0.0] * len(run.plan.stages))
        for name, limit, wall in zip(model.walls.names, bears, conditions, strict=False):
            if wall.kind == "temperature":
                hottest = wall.signal.largest()
                yield Measured(hottest / limit, f"{hottest:.5g} K, wall {name} in stage {stage.name}")


def _reached(run: Recorded) -> Iterator[Measured]:
    """The hottest grain of any row of the time series, by what the hardiest material bears; then each material as it is now."""
    model = run.run.model
    if not run.has_steps or model.thermal is None or run.planned is None:
        return
    scenario = run.planned[0]
    hottest = float(run.series("temperature_max").max(initial=run.info["heat"]["temperature"]["max"]))
    bears = float(_melting(scenario, model)[model.grains.material].max(initial=0.0))
    if bears > 0.0:
        yield Measured(hottest / bears, f"{hottest:.5g} K, the hottest grain so far")
    frame = run.run.frames[-1]
    yield from _of_grains(scenario, model, np.asarray(frame.temperature, np.float64))


def _upward_gravity(run: Prepared) -> Iterator[Measured]:
    yield Measured(max(0.0, run.scenario.domain.gravity[1]))
    for stage, gravity in zip(run.plan.stages, run.gravity, strict=True):
        yield Measured(max(0.0, float(gravity[1])), f"stage {stage.name}")


_MELTS = (
    "Temperatures over the melting of the materials, or over 4,300 K, which no known solid bears, where none is given. Grains are "
    "solids here: neither do they melt, nor do their properties depend on temperature."
)

BEFORE_RUN: tuple[Rule[Prepared], ...] = (
    Rule(
        "density", _densities, unit="kg/m³", least=50.0, warning=25_000.0,
        meaning=f"Solids that flow as grains have densities from 50 (foams) to 23,000 (osmium) kg/m³. {_SI}",
        remedy="Give density in kg/m³: 2.5 g/cm³ is 2500.",
    ),
    Rule(
        "Young's modulus", _young, unit="Pa", least=1e5,
        meaning=f"Softer than gels, whose grains are not rigid under any load. {_SI}",
        remedy="Give young in Pa: 70 GPa is 70e9.",
    ),
    Rule(
        "grain diameter", _diameters, unit="m", least=1e-6, warning=1.0,
        meaning="Larger bodies are hardly grains; smaller ones are ruled by adhesion and the fluid, which this program leaves out. "
        f"{_SI}",
        remedy="Give radii in meters: 0.5 mm is 0.5e-3.",
    ),
    Rule(
        "friction coefficient", _friction, warning=2.0,
        meaning="Dry solids have coefficients of friction below 1, rubber up to 2.",
        remedy="Check friction: is it an angle in degrees? Its tangent is the coefficient.",
    ),
    Rule(
        "lowest temperature", _temperatures, unit="K", least=100.0,
        meaning="Temperatures are absolute. What is below 100 K was probably meant in °C.",
        remedy="Add 273.15 to temperatures in °C.",
    ),
    Rule(
        "highest temperature", _hot, _MELTS, "Check temperatures and their units; give melting for other materials.",
        unit="of what it bears", warning=1.0, bad=1.0,
    ),
    Rule(
        "upward gravity", _upward_gravity, unit="m/s²", warning=0.0,
        meaning="gravity is an acceleration: with a positive second component grains fall upwards.",
        remedy="Give gravity = [0.0, -9.81].",
    ),
)  # fmt: skip
"""What is checked of the values of a scenario."""

OF_RUN: tuple[Rule[Recorded], ...] = (
    Rule(
        "highest temperature reached", _reached, _MELTS,
        "Check what heats the grains: flows of walls [W, not W/m²] and their duration, rates of shear under high loads.",
        unit="of what it bears", warning=1.0, bad=1.0,
    ),
)  # fmt: skip
"""What is checked of a run."""
