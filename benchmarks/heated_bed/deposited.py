"""The deposited bed: running its scenario, or reading a run of it, up to the moment at which it is
frozen.
"""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lattice_bed import Floats, Sphere

from multicor_cli import load_scenario, open_run
from multicor_cli import run as run_scenario
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.model import Model, State
from multicor_cli.post import force_network
from multicor_cli.running.from_scenario import heat_settings, wall_heat
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.store import Run

CONFIG = Path(__file__).parents[2] / "configs" / "heated-bed.toml"
AIR = "heat.gas={conductivity=0.026, model='parallel'}"
AIR_CONDUCTIVITY = 0.026
# The solid fraction is taken between these parts of the height, away from floor and surface
_DEPTH = (0.1, 0.9)


@dataclass(frozen=True)
class Bed:
    """The frozen bed of a finished run.

    Attributes:
        model: Grains and walls.
        state: The last state; positions and contact forces are those at which the bed was frozen.
        settings: Choices about heat, without a gas.
        air: The same with air in the gaps.
        conditions: Thermal conditions of the walls while it is heated.
        duration: How long it is heated [s].
        interval: Time between frames of this stage [s].
        reference: Temperature at the start [K].
        hot: Temperature of the floor [K].
        sphere: A grain in numbers.
        temperature: Temperatures at the end of the run [K], shape ``(n,)``.
    """

    model: Model
    state: State
    settings: HeatSettings
    air: HeatSettings
    conditions: list[WallHeat]
    duration: float
    interval: float
    reference: float
    hot: float
    sphere: Sphere
    temperature: Floats


@dataclass(frozen=True)
class Mechanics:
    """What the bed was like when it was frozen.

    Attributes:
        grains: Number of grains.
        height: How far the grains reach [m].
        solid_fraction: Area of the grains over that of the plane, between 0.1 and 0.9 of the
            height.
        coordination: Mean number of contacts of a grain that carry a force.
        rattlers: Share of grains with fewer than two such contacts.
        floor_load: Vertical force on the floor over the weight, mean over the last steps before.
        side_load: The same for the friction on the side walls.
    """

    grains: int
    height: float
    solid_fraction: float
    coordination: float
    rattlers: float
    floor_load: float
    side_load: float

    @property
    def load(self) -> float:
        """What floor and walls carry over the weight."""
        return self.floor_load + self.side_load


def finish_run(directory: Path, overrides: tuple[str, ...] = ()) -> Path:
    """The directory, after the scenario has been carried out in it if no finished run is there."""
    if (directory / "run.json").is_file():
        with open_run(directory) as run:
            if run.status == "finished":
                return directory
    print(f"running {CONFIG.name} in {directory}: some minutes", file=sys.stderr)
    run_scenario(CONFIG, directory, overrides=overrides)
    return directory


def read_bed(directory: Path) -> tuple[Bed, Mechanics]:
    """The bed of a finished run in vacuum.

    Raises:
        StoreError: If the run cannot be read.
        ValueError: If it is not finished.
    """
    scenario = load_scenario(directory / "scenario.resolved.toml")
    with open_run(directory) as run:
        state = run.state()
        if run.status != "finished" or state is None:
            raise ValueError(f"{directory}: the run is not finished")
        return _bed(directory, scenario, run.model, state), _mechanics(run)


def read_temperatures(directory: Path) -> Floats:
    """Temperatures of the grains at the end of a run [K], shape ``(n,)``."""
    with open_run(directory) as run:
        return np.array(run.frames[-1].temperature, np.float64)


def _bed(directory: Path, scenario: Scenario, model: Model, state: State) -> Bed:
    with_air = load_scenario(directory / "scenario.resolved.toml", [AIR])
    document = tomllib.loads((directory / "scenario.resolved.toml").read_text(encoding="utf-8"))
    stage, number = document["loading"][-1], len(document["loading"]) - 1
    settings, air = heat_settings(scenario, model), heat_settings(with_air, model)
    assert settings is not None
    assert air is not None
    assert model.thermal is not None
    conditions = wall_heat(scenario, model.walls.names)[number].started([0.0] * (number + 1))
    return Bed(
        model, state, settings, air, conditions, float(stage["duration"]), float(stage["dt"]),
        float(document["heat"]["temperature"]), float(stage["thermal"]["floor"]["temperature"]),
        _sphere(document),
        state.temperature(model.thermal),
    )  # fmt: skip


def _sphere(document: dict[str, Any]) -> Sphere:
    (material,), (group,) = document["materials"].values(), document["particles"]
    names = ("density", "heat_capacity", "conductivity", "young", "poisson")
    return Sphere(
        group["sizes"]["radii"][0],
        *(float(material[name]) for name in names),
        -float(document["domain"]["gravity"][1]),
    )


def _mechanics(run: Run) -> Mechanics:
    frozen = int(np.flatnonzero(run.frames.stage < len(run.stages) - 1)[-1])
    row = int(np.flatnonzero(run.series["stage"] < len(run.stages) - 1)[-1])
    grains, position = run.model.grains, np.asarray(run.frames[frozen].position)
    weight = float(grains.mass.sum()) * -float(run.model.gravity[1])
    down = -run.series["wall_force"][row, :, 1] / weight  # forces of the grains on the walls
    floor = run.wall_names.index("floor")
    low, high = (
        float(edge)
        for edge in ((position[:, 1] - grains.radius).min(), (position[:, 1] + grains.radius).max())
    )
    network = force_network(run, frozen)
    return Mechanics(
        grains=grains.radius.size,
        height=high - low,
        solid_fraction=_solid_fraction(position, grains.radius, low, high),
        coordination=network.coordination,
        rattlers=network.rattler_share,
        floor_load=float(down[floor]),
        side_load=float(down.sum() - down[floor]),
    )


def _solid_fraction(position: Floats, radius: Floats, low: float, high: float) -> float:
    bottom, top = (low + part * (high - low) for part in _DEPTH)
    inside = (position[:, 1] >= bottom) & (position[:, 1] < top)
    width = (position[:, 0] + radius).max() - (position[:, 0] - radius).min()
    return float(np.pi * (radius[inside] ** 2).sum() / (width * (top - bottom)))
