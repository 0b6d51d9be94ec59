"""The whole scenario file as one model, and the names of all its parts.

Attribute names are the TOML keys, except ``from`` and ``to`` of a rough wall, which are ``start`` and ``end``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict, ValidationInfo, field_validator

from multicor_cli.scenario.base import CHANGEABLE, Name, Table
from multicor_cli.scenario.functions import Variable, VariableName
from multicor_cli.scenario.loading import (
    AxialStrainEnd,
    CapacityCondition,
    DisplacementEnd,
    FixedDof,
    FlowCondition,
    ForceEnd,
    InsulatedCondition,
    LoadDof,
    PositionDof,
    Spring,
    Stage,
    SteadyEnd,
    StrainEnd,
    StressEnd,
    TemperatureCondition,
    TiltedGravityTable,
    UntilAxialStrain,
    UntilDisplacement,
    UntilForce,
    UntilRest,
    UntilSteady,
    UntilStrain,
    UntilStress,
    VelocityDof,
    WallDrives,
)
from multicor_cli.scenario.materials import (
    MAX_MATERIALS,
    ContactPair,
    FrictionTable,
    Heat,
    Material,
    PairFriction,
    SofteningFriction,
)
from multicor_cli.scenario.particles import (
    AnyTemperature,
    CompactedPacking,
    DepositedPacking,
    FilePacking,
    FileTemperature,
    GradientTemperature,
    LatticePacking,
    Outlet,
    ParticleGroup,
    RandomPacking,
    RegionsTemperature,
    Release,
    RunPacking,
    Start,
    StartPacking,
    TilePacking,
    ValuesTemperature,
)
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.region import RectangleRegion, Region
from multicor_cli.scenario.settings import Domain, Header, Output, Solver, StageSolver
from multicor_cli.scenario.signals import RampSignal, SineSignal, SineWave, TableSignal
from multicor_cli.scenario.sizes import AnySizes, ListSizes, LognormalSizes, NormalSizes, PowerSizes, TableSizes, UniformSizes
from multicor_cli.scenario.walls import Wall


class ScenarioModel(Table):
    """A scenario file."""

    scenario: Header = Field(description="name, description and seed")
    variables: Annotated[dict[VariableName, Variable] | None, CHANGEABLE] = Field(
        None,
        max_length=1000,
        description="a number by each name, as d = 1e-3; a string that begins with = is an expression and can stand in place of "
        'any number, as "= 2 * d"',
    )
    domain: Domain = Field(description="size, periodicity and gravity")
    materials: dict[Name, Material] = Field(min_length=1, max_length=MAX_MATERIALS, description="materials by name")
    contacts: Annotated[tuple[ContactPair, ...], Strict(False)] = Field(
        (), max_length=1000, description="contact laws of pairs of materials"
    )
    start: Start | None = Field(None, description="run from which this one goes on; without it grains and walls start anew")
    particles: Annotated[tuple[ParticleGroup, ...], Strict(False)] = Field(
        max_length=1000, description="groups of grains; may be left out with [start]: those of its run"
    )
    walls: Annotated[tuple[Wall, ...], Strict(False)] = Field((), max_length=1000, description="walls")
    outlets: Annotated[tuple[Outlet, ...], Strict(False)] = Field((), max_length=1000, description="where grains leave")
    loading: Annotated[tuple[Stage, ...], Strict(False)] = Field(
        min_length=1, max_length=1000, description="loading stages in time order"
    )
    heat: Heat | None = Field(None, description="heat: its presence switches temperatures on")
    solver: Solver = Field(default_factory=Solver, description="time step and contact solver; default: all of its defaults")
    output: Output = Field(description="what is written, and how often")

    @field_validator("particles")
    @classmethod
    def _has_grains(cls, groups: tuple[ParticleGroup, ...], info: ValidationInfo) -> tuple[ParticleGroup, ...]:
        """Only a run that cannot be read (yet) leaves a scenario without groups."""
        if not groups and info.data.get("start") is None:
            raise Refused((), "must have at least 1 elements, has 0", "expected: groups of grains")
        return groups


__all__ = [
    "AnySizes",
    "AnyTemperature",
    "AxialStrainEnd",
    "CapacityCondition",
    "CompactedPacking",
    "ContactPair",
    "DepositedPacking",
    "DisplacementEnd",
    "Domain",
    "FilePacking",
    "FileTemperature",
    "FixedDof",
    "FlowCondition",
    "ForceEnd",
    "FrictionTable",
    "GradientTemperature",
    "Header",
    "Heat",
    "InsulatedCondition",
    "LatticePacking",
    "ListSizes",
    "LoadDof",
    "LognormalSizes",
    "Material",
    "NormalSizes",
    "Outlet",
    "Output",
    "PairFriction",
    "ParticleGroup",
    "PositionDof",
    "PowerSizes",
    "RampSignal",
    "RandomPacking",
    "RectangleRegion",
    "Region",
    "RegionsTemperature",
    "Release",
    "RunPacking",
    "ScenarioModel",
    "SineSignal",
    "SineWave",
    "SofteningFriction",
    "Solver",
    "Spring",
    "Stage",
    "StageSolver",
    "Start",
    "StartPacking",
    "SteadyEnd",
    "StrainEnd",
    "StressEnd",
    "TableSignal",
    "TableSizes",
    "TemperatureCondition",
    "TilePacking",
    "TiltedGravityTable",
    "UniformSizes",
    "UntilAxialStrain",
    "UntilDisplacement",
    "UntilForce",
    "UntilRest",
    "UntilSteady",
    "UntilStrain",
    "UntilStress",
    "ValuesTemperature",
    "VelocityDof",
    "Wall",
    "WallDrives",
]
