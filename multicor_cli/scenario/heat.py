"""``[heat]``: which mechanisms carry heat, and how temperatures are integrated."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field, Tag

from multicor_cli.scenario.base import (
    ROOM_TEMPERATURE,
    Kelvin,
    Pair,
    Table,
    Time,
    Vector,
    one_of,
    optional,
    required,
)
from multicor_cli.scenario.materials import Material, Need
from multicor_cli.scenario.problems import Refused

NEEDS_POROSITY = ("gunn", "li-mason")
GUNN_POROSITY = (0.35, 1.0)
LEAST_CONTRAST = 10.0
"""Least ratio of conductivities, solid to gas, for Batchelor & O'Brien's formula."""

EQUAL = 1.1
"""Largest ratio of radii that counts as equal."""

_REACH = 0.4
_SPOT = ("conductivity", "young", "poisson")
_ROUGH = ("roughness", "asperity_slope", "microhardness")
_PARTITION = {
    "effusivity": ("conductivity", "heat_capacity"),
    "conductivity": ("conductivity",),
    "half": (),
    "electrothermal": ("conductivity", "resistivity"),
}

Gradient = Pair[Annotated[float, Field(ge=-1e9, le=1e9)]]
Reach = Annotated[float, Field(gt=0.0, le=2.0)]
FluidConductivity = Annotated[float, Field(ge=1e-6, le=1e3)]


class MechanismTable(Table):
    """A table of ``[heat]`` that switches on the mechanism of its key in
    `multicor_cli.engine.heat.settings.MECHANISMS`.
    """

    def needs(self, *, is_of_grains: bool) -> tuple[str, ...]:
        """Properties that it needs of a material of grains, or of walls alone."""
        return ()

    def check_material(self, name: str, material: Material) -> Iterator[Refused]:
        """Findings about a material of grains or walls, but for what it lacks."""
        yield from ()


class AverageForce(Table):
    """The force of a contact is its average over a time."""

    average: Time = required("time over which the normal force is averaged [s]")


class PrescribedForce(Table):
    """The force is the same for all contacts that carry one."""

    prescribed: Annotated[float, Field(ge=1e-15, le=1e12)] = required("normal force [N]")


Force = Annotated[
    Annotated[AverageForce, Tag("<average>")] | Annotated[PrescribedForce, Tag("<prescribed>")],
    one_of(
        "force is a table with",
        "average, prescribed",
        more="; without it, the force of each step counts",
    ),
]


class GasTable(MechanismTable):
    """Stagnant gas in the gaps between grains, and between grains and walls."""

    conductivity: FluidConductivity = required(
        "thermal conductivity of the gas [W/(m K)], for air 0.026"
    )
    model: Literal["parallel", "batchelor", "vargas"] = optional(
        'conductance of a gap: "parallel" (flux along the axis, exact), "batchelor" '
        "(Batchelor & O'Brien, solids at least ten times as conductive as the gas) or "
        '"vargas" (Vargas & McCarthy, equal grains that touch); of grains that are no discs the '
        "first alone",
        "parallel",
    )
    reach: Reach = optional("largest gap that conducts, over the smaller radius", _REACH)

    def needs(self, *, is_of_grains: bool) -> tuple[str, ...]:
        return _SPOT

    def check_material(self, name: str, material: Material) -> Iterator[Refused]:
        solid = material.conductivity or math.inf
        if self.model == "batchelor" and solid < LEAST_CONTRAST * self.conductivity:
            what = (
                f'"batchelor" needs solids at least {LEAST_CONTRAST:g} times as conductive as the '
                f"gas, '{name}' is {solid / self.conductivity:.3g} times"
            )
            yield Refused(("heat", "gas", "model"), what, 'use "parallel"')

    def misfits(self, smallest: float, largest: float) -> list[Refused]:
        """What is wrong with it for grains of these smallest and largest radii [m]."""
        if self.model != "vargas" or largest <= EQUAL * smallest:
            return []
        what = (
            f'"vargas" is for grains of equal size, but the radii are {smallest:g} to {largest:g} m'
        )
        return [Refused(("heat", "gas", "model"), what, 'use "parallel" or "batchelor"')]


class AmbientCoefficient(MechanismTable):
    """Convection with a constant coefficient."""

    temperature: Kelvin = required("temperature of the fluid [K]")
    coefficient: Annotated[float, Field(ge=1e-6, le=1e9)] = required(
        "heat transfer coefficient h [W/(m² K)]"
    )


class AmbientCorrelation(MechanismTable):
    """Convection by a correlation of the Nusselt number of each grain."""

    temperature: Kelvin = required("temperature of the fluid [K]")
    correlation: Literal["ranz-marshall", "whitaker", "gunn", "li-mason"] = required(
        'correlation of the Nusselt number: "ranz-marshall", "whitaker" (single spheres), '
        '"gunn" or "li-mason" (beds)'
    )
    conductivity: FluidConductivity = required("thermal conductivity of the fluid [W/(m K)]")
    viscosity: Annotated[float, Field(ge=1e-9, le=1e3)] = required(
        "kinematic viscosity of the fluid [m²/s]"
    )
    prandtl: Annotated[float, Field(ge=1e-4, le=1e6)] = required(
        "Prandtl number of the fluid, for air 0.7"
    )
    porosity: Annotated[float, Field(gt=0.0, le=1.0)] | None = optional(
        'volume fraction of the fluid; for "gunn" (0.35 to 1) and "li-mason", required there'
    )
    velocity: Vector = optional(
        "velocity of the fluid [m/s]; the Reynolds number takes each grain's velocity "
        "relative to it",
        (0.0, 0.0),
    )

    def faults(self) -> Iterator[Refused]:
        name, (low, high) = f'correlation = "{self.correlation}"', GUNN_POROSITY
        is_needed = self.correlation in NEEDS_POROSITY
        if is_needed and self.porosity is None:
            remedy = "add porosity, the volume fraction of the fluid, as 0.4"
            yield Refused((), f"{name} needs the porosity", remedy)
        elif not is_needed and self.porosity is not None:
            what = f"porosity has no meaning for {name}"
            yield Refused(("porosity",), what, 'remove it, or use "gunn" or "li-mason"')
        elif self.correlation == "gunn" and not low <= (self.porosity or 0.0) <= high:
            what = f"{name} holds for a porosity of {low:g} to {high:g}, is {self.porosity:g}"
            yield Refused(("porosity",), what, 'use "li-mason" for denser beds')


Ambient = Annotated[
    Annotated[AmbientCoefficient, Tag("<coefficient>")]
    | Annotated[AmbientCorrelation, Tag("<correlation>")],
    one_of("ambient is a table with temperature and", "coefficient, correlation"),
]


class RadiationTable(MechanismTable):
    """Thermal radiation of gray grains."""

    surroundings: Kelvin | None = optional(
        "temperature of the surroundings, a black body [K]; default: none"
    )
    neighbors: bool = optional("whether grains and walls within reach exchange radiation", False)
    reach: Reach | None = optional(
        "largest gap across which neighbors exchange radiation, over the smaller radius; "
        "default: 0.4",
        default_factory=lambda data: _REACH if data.get("neighbors") else None,
    )

    def faults(self) -> Iterator[Refused]:
        if self.surroundings is None and not self.neighbors:
            what = "there is nothing to exchange radiation with"
            yield Refused((), what, "give surroundings [K], or neighbors = true")
        if self.reach is not None and not self.neighbors:
            what = "reach has no meaning without neighbors = true"
            yield Refused(("reach",), what, "remove it, or add neighbors = true")

    def needs(self, *, is_of_grains: bool) -> tuple[str, ...]:
        return ("emissivity",) if is_of_grains or self.neighbors else ()


class Heat(Table):
    """``[heat]``: its presence switches temperatures on."""

    temperature: Kelvin = optional("initial temperature of all grains [K]", ROOM_TEMPERATURE)
    conduction: Literal["hertz", "rough", "none"] = optional(
        'conductance of contacts: "hertz" (smooth grains), "rough" (Bahrami & Yovanovich) or '
        '"none"',
        "hertz",
    )
    force: Force | None = optional(
        "normal force that makes the contact spot: { average = 0.01 } (over a time [s]) or { "
        "prescribed = 1.0 } [N]; default: that of each step"
    )
    friction: Literal["energy", "sliding", "none"] = optional(
        'heat of friction: "energy" (the work lost, exact), "sliding" (μ |u_t| q_n at the end '
        'of the step) or "none"',
        "energy",
    )
    impact: bool = optional("whether the energy lost in impacts becomes heat too", False)
    partition: Literal["effusivity", "conductivity", "half", "electrothermal"] = optional(
        "how the heat of a contact is shared by the two bodies", "effusivity"
    )
    collisional: bool = optional(
        "whether a contact that is new in a step conducts by the formula for impacts (Sun & Chen)",
        False,
    )
    gas: GasTable | None = optional(
        'gas in the gaps, as { conductivity = 0.026, model = "parallel" }; default: vacuum'
    )
    ambient: Ambient | None = optional(
        "convection to a fluid around the grains, as { temperature = 293.15, coefficient = "
        "10.0 }; default: none"
    )
    radiation: RadiationTable | None = optional(
        "thermal radiation, as { surroundings = 293.15 }; default: none"
    )
    wear_shrinks: bool = optional(
        "whether grains lose the volume that they wear off, and its mass; needs wear of a pair",
        False,
    )
    gradient: Gradient | None = optional(
        "mean gradient of temperature in a cell (x, y) [K/m]; temperatures are then those beside "
        "it; default: none"
    )
    integrator: Literal["auto", "explicit", "implicit"] = optional(
        '"explicit", "implicit", or "auto": implicit in frozen stages and in steps of many '
        "time constants C/ΣH",
        "auto",
    )
    sub_step: Annotated[float, Field(gt=0.0, le=1.0)] = optional(
        "largest sub-step of the explicit integrator over the longest that lets no "
        "temperature overshoot, C/(2 ΣH)",
        1.0,
    )
    tolerance: Annotated[float, Field(ge=1e-10, le=0.1)] = optional(
        "largest estimated error of a sub-step of the heat flow, over the spread of the "
        "temperatures",
        1e-4,
    )

    @property
    def has_sources(self) -> bool:
        """Whether contacts generate heat."""
        return self.friction != "none" or self.impact

    @property
    def has_spots(self) -> bool:
        """Whether the size of contact spots, and hence the normal force, matters."""
        return self.conduction != "none" or self.gas is not None

    @property
    def needs_forces(self) -> bool:
        """Whether contact spots follow from the forces that contacts carry."""
        return self.conduction != "none" and not isinstance(self.force, PrescribedForce)

    @property
    def mechanisms(self) -> dict[str, MechanismTable]:
        """The mechanisms that are on, by key."""
        return {key: table for key, table in self if isinstance(table, MechanismTable)}

    def needs(self, *, is_of_grains: bool) -> Iterator[Need]:
        """What needs properties of a material of grains, or of walls alone, and which."""
        if is_of_grains:
            yield "[heat]", ("heat_capacity",)
        if self.conduction != "none":
            keys = (*_SPOT, *_ROUGH) if self.conduction == "rough" else _SPOT
            yield f'conduction = "{self.conduction}"', keys
        if self.collisional:
            yield "collisional = true", (*_SPOT, "heat_capacity")
        if self.has_sources:
            yield f'partition = "{self.partition}"', _PARTITION[self.partition]
        for key, table in self.mechanisms.items():
            yield key, table.needs(is_of_grains=is_of_grains)

    def faults(self) -> Iterator[Refused]:
        if self.gradient is not None and not any(self.gradient):
            what = "a gradient of zero is none"
            yield Refused(("gradient",), what, "remove it, or give one, as [0.0, 1000.0]")
        if self.force is not None and not self.has_spots:
            what = 'force has no meaning with conduction = "none" and without gas'
            yield Refused(("force",), what, "remove force")
        if self.collisional and self.conduction == "none":
            what = 'collisional = true has no meaning with conduction = "none"'
            yield Refused(("collisional",), what, "remove one of the two")
