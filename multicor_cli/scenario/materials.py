"""Materials, contact laws of pairs of them, and ``[heat]``: its mechanisms and integration."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    Tag,
    field_validator,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema
from pydantic_core.core_schema import no_info_after_validator_function

from multicor_cli.scenario.base import (
    Fraction,
    Friction,
    Kelvin,
    Table,
    Time,
    Vector,
    one_of,
    require_ascending,
)
from multicor_cli.scenario.problems import Refused

# ---- `[heat]`: which mechanisms carry heat, and how temperatures are integrated

ROOM_TEMPERATURE = 293.15
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

Reach = Annotated[float, Field(gt=0.0, le=2.0)]
FluidConductivity = Annotated[float, Field(ge=1e-6, le=1e3)]

Need = tuple[str, tuple[str, ...]]
"""What needs properties of a material, in the words of the scenario, and which."""


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

    average: Time = Field(description="time over which the normal force is averaged [s]")


class PrescribedForce(Table):
    """The force is the same for all contacts that carry one."""

    prescribed: Annotated[float, Field(ge=1e-15, le=1e12)] = Field(description="normal force [N]")


Force = Annotated[
    Annotated[AverageForce, Tag("<average>")] | Annotated[PrescribedForce, Tag("<prescribed>")],
    one_of(
        "force is a table with",
        "average",
        "prescribed",
        more="; without it, the force of each step counts",
    ),
]


class GasTable(MechanismTable):
    """Stagnant gas in the gaps between grains, and between grains and walls."""

    conductivity: FluidConductivity = Field(
        description="thermal conductivity of the gas [W/(m K)], for air 0.026"
    )
    model: Literal["parallel", "batchelor", "vargas"] = Field(
        "parallel",
        description=(
            'conductance of a gap: "parallel" (flux along the axis, exact), "batchelor" '
            "(Batchelor & O'Brien, solids at least ten times as conductive as the gas) or "
            '"vargas" (Vargas & McCarthy, equal grains that touch)'
        ),
    )
    reach: Reach = Field(_REACH, description="largest gap that conducts, over the smaller radius")

    def needs(self, *, is_of_grains: bool) -> tuple[str, ...]:
        """As `MechanismTable.needs`."""
        return _SPOT

    def check_material(self, name: str, material: Material) -> Iterator[Refused]:
        """Batchelor & O'Brien's formula holds for solids that conduct much better than the gas."""
        solid = material.conductivity
        if (
            self.model == "batchelor"
            and solid is not None
            and solid < LEAST_CONTRAST * self.conductivity
        ):
            least = (
                f'"batchelor" needs solids at least {LEAST_CONTRAST:g} times as conductive as the '
                "gas"
            )
            what = f"{least}, '{name}' is {solid / self.conductivity:.3g} times"
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

    temperature: Kelvin = Field(description="temperature of the fluid [K]")
    coefficient: Annotated[float, Field(ge=1e-6, le=1e9)] = Field(
        description="heat transfer coefficient h [W/(m² K)]"
    )


class AmbientCorrelation(MechanismTable):
    """Convection by a correlation of the Nusselt number of each grain."""

    temperature: Kelvin = Field(description="temperature of the fluid [K]")
    correlation: Literal["ranz-marshall", "whitaker", "gunn", "li-mason"] = Field(
        description=(
            'correlation of the Nusselt number: "ranz-marshall", "whitaker" (single spheres), '
            '"gunn" or "li-mason" (beds)'
        )
    )
    conductivity: FluidConductivity = Field(
        description="thermal conductivity of the fluid [W/(m K)]"
    )
    viscosity: Annotated[float, Field(ge=1e-9, le=1e3)] = Field(
        description="kinematic viscosity of the fluid [m²/s]"
    )
    prandtl: Annotated[float, Field(ge=1e-4, le=1e6)] = Field(
        description="Prandtl number of the fluid, for air 0.7"
    )
    porosity: Annotated[float, Field(gt=0.0, le=1.0)] | None = Field(
        None,
        description=(
            'volume fraction of the fluid; for "gunn" (0.35 to 1) and "li-mason", required there'
        ),
    )
    velocity: Vector = Field(
        (0.0, 0.0),
        description=(
            "velocity of the fluid [m/s]; the Reynolds number takes each grain's velocity "
            "relative to it"
        ),
    )

    @model_validator(mode="after")
    def _check_porosity(self) -> Self:
        name = f'correlation = "{self.correlation}"'
        if self.correlation in NEEDS_POROSITY and self.porosity is None:
            raise Refused(
                (),
                f"{name} needs the porosity",
                "add porosity, the volume fraction of the fluid, as 0.4",
            )
        if self.correlation not in NEEDS_POROSITY and self.porosity is not None:
            raise Refused(
                ("porosity",),
                f"porosity has no meaning for {name}",
                'remove it, or use "gunn" or "li-mason"',
            )
        low, high = GUNN_POROSITY
        if (
            self.correlation == "gunn"
            and self.porosity is not None
            and not low <= self.porosity <= high
        ):
            what = f"{name} holds for a porosity of {low:g} to {high:g}, is {self.porosity:g}"
            raise Refused(("porosity",), what, 'use "li-mason" for denser beds')
        return self


Ambient = Annotated[
    Annotated[AmbientCoefficient, Tag("<coefficient>")]
    | Annotated[AmbientCorrelation, Tag("<correlation>")],
    one_of("ambient is a table with temperature and", "coefficient", "correlation"),
]


def _default_reach(data: dict[str, object]) -> float | None:
    return _REACH if data.get("neighbors") else None


class RadiationTable(MechanismTable):
    """Thermal radiation of gray grains."""

    surroundings: Kelvin | None = Field(
        None, description="temperature of the surroundings, a black body [K]; default: none"
    )
    neighbors: bool = Field(
        False, description="whether grains and walls within reach exchange radiation"
    )
    reach: Reach | None = Field(
        default_factory=_default_reach,
        description=(
            "largest gap across which neighbors exchange radiation, over the smaller radius; "
            "default: 0.4"
        ),
    )

    @model_validator(mode="after")
    def _radiates(self) -> Self:
        if self.surroundings is None and not self.neighbors:
            raise Refused(
                (),
                "there is nothing to exchange radiation with",
                "give surroundings [K], or neighbors = true",
            )
        if self.reach is not None and not self.neighbors:
            raise Refused(
                ("reach",),
                "reach has no meaning without neighbors = true",
                "remove it, or add neighbors = true",
            )
        return self

    def needs(self, *, is_of_grains: bool) -> tuple[str, ...]:
        """As `MechanismTable.needs`."""
        return ("emissivity",) if is_of_grains or self.neighbors else ()


class Heat(Table):
    """``[heat]``: its presence switches temperatures on."""

    temperature: Kelvin = Field(
        ROOM_TEMPERATURE, description="initial temperature of all grains [K]"
    )
    conduction: Literal["hertz", "rough", "none"] = Field(
        "hertz",
        description=(
            'conductance of contacts: "hertz" (smooth grains), "rough" (Bahrami & Yovanovich) or '
            '"none"'
        ),
    )
    force: Force | None = Field(
        None,
        description=(
            "normal force that makes the contact spot: { average = 0.01 } (over a time [s]) or { "
            "prescribed = 1.0 } [N]; default: that of each step"
        ),
    )
    friction: Literal["energy", "sliding", "none"] = Field(
        "energy",
        description=(
            'heat of friction: "energy" (the work lost, exact), "sliding" (μ |u_t| q_n at the end '
            'of the step) or "none"'
        ),
    )
    impact: bool = Field(False, description="whether the energy lost in impacts becomes heat too")
    partition: Literal["effusivity", "conductivity", "half", "electrothermal"] = Field(
        "effusivity", description="how the heat of a contact is shared by the two bodies"
    )
    collisional: bool = Field(
        False,
        description=(
            "whether a contact that is new in a step conducts by the formula for impacts (Sun & "
            "Chen)"
        ),
    )
    gas: GasTable | None = Field(
        None,
        description=(
            'gas in the gaps, as { conductivity = 0.026, model = "parallel" }; default: vacuum'
        ),
    )
    ambient: Ambient | None = Field(
        None,
        description=(
            "convection to a fluid around the grains, as { temperature = 293.15, coefficient = "
            "10.0 }; default: none"
        ),
    )
    radiation: RadiationTable | None = Field(
        None, description="thermal radiation, as { surroundings = 293.15 }; default: none"
    )
    integrator: Literal["auto", "explicit", "implicit"] = Field(
        "auto",
        description=(
            '"explicit", "implicit", or "auto": implicit in frozen stages and in steps of many '
            "time constants C/ΣH"
        ),
    )
    sub_step: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        1.0,
        description=(
            "largest sub-step of the explicit integrator over the longest that lets no "
            "temperature overshoot, C/(2 ΣH)"
        ),
    )
    tolerance: Annotated[float, Field(ge=1e-10, le=0.1)] = Field(
        1e-4,
        description=(
            "largest estimated error of a sub-step of the heat flow, over the spread of the "
            "temperatures"
        ),
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

    @property
    def crosses_gaps(self) -> bool:
        """Whether a mechanism carries heat between bodies that are only near each other."""
        return any(getattr(table, "reach", None) for table in self.mechanisms.values())

    def needs(self, *, is_of_grains: bool) -> Iterator[Need]:
        """What needs properties of a material of grains, or of walls alone, and which."""
        if is_of_grains:
            yield "[heat]", ("heat_capacity",)
        if self.conduction != "none":
            yield (
                f'conduction = "{self.conduction}"',
                (*_SPOT, *_ROUGH) if self.conduction == "rough" else _SPOT,
            )
        if self.collisional:
            yield "collisional = true", (*_SPOT, "heat_capacity")
        if self.has_sources:
            yield f'partition = "{self.partition}"', _PARTITION[self.partition]
        for key, table in self.mechanisms.items():
            yield key, table.needs(is_of_grains=is_of_grains)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.force is not None and not self.has_spots:
            raise Refused(
                ("force",),
                'force has no meaning with conduction = "none" and without gas',
                "remove force",
            )
        if self.collisional and self.conduction == "none":
            raise Refused(
                ("collisional",),
                'collisional = true has no meaning with conduction = "none"',
                "remove one of the two",
            )
        return self


# ---- Materials and the contact laws of pairs of materials

MAX_MATERIALS = 100
MAX_FRICTION = 10.0


@dataclass(frozen=True)
class _OfSolids:
    """A property of solids within bounds, as an annotation; too small values suggest a larger unit.

    Attributes:
        example: A right value, and of what.
        power: Of ten, from the unit that was probably meant to ``unit``: 3 or 9.
        origin: That unit.
    """

    name: str
    unit: str
    low: float
    high: float
    example: str
    power: int
    origin: str

    def check(self, value: float) -> float:
        """The value itself, if it is within the bounds."""
        right = f"give it in {self.unit}, {self.example}"
        if value <= 0.0:
            raise Refused((), f"the {self.name} must be positive, is {value:g} {self.unit}", right)
        if not self.low <= value <= self.high:
            meant = f"{1000.0 * value:g}" if self.power == 3 else f"{value:g}e{self.power}"
            hint = f"did you mean {meant} (from {self.origin})?" if value < self.low else right
            raise Refused(
                (),
                (
                    f"{value:g} {self.unit} is not the {self.name} of a solid ({self.low:g} to "
                    f"{self.high:g})"
                ),
                hint,
            )
        return value

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {**handler(schema), "minimum": self.low, "maximum": self.high}


Density = Annotated[
    float, _OfSolids("density", "kg/m³", 1.0, 30_000.0, "for steel 7800", 3, "g/cm³")
]
Young = Annotated[float, _OfSolids("Young's modulus", "Pa", 1e3, 1e13, "for steel 193e9", 9, "GPa")]
HeatCapacity = Annotated[
    float, _OfSolids("heat capacity", "J/(kg K)", 10.0, 1e5, "for steel 500", 3, "J/(g K)")
]
Hardness = Annotated[float, _OfSolids("hardness", "Pa", 1e5, 1e12, "for steel 2e9", 9, "GPa")]


class Material(Table):
    """``[materials.NAME]``: what grains and walls are made of."""

    density: Density = Field(description="density [kg/m³]")
    young: Young | None = Field(
        None,
        description=(
            "Young's modulus [Pa]; with poisson it gives the elastic deflection that rigid grains "
            "neglect"
        ),
    )
    poisson: Annotated[float, Field(gt=-1.0, lt=0.5)] | None = Field(
        None, description="Poisson's ratio, between -1 and 0.5"
    )

    conductivity: Annotated[float, Field(ge=1e-4, le=1e5)] | None = Field(
        None, description="thermal conductivity [W/(m K)]"
    )
    heat_capacity: HeatCapacity | None = Field(
        None, description="specific heat capacity [J/(kg K)]"
    )
    melting: Kelvin | None = Field(
        None,
        description=(
            "temperature at which it melts or decays [K]; checks compare temperatures with it"
        ),
    )
    emissivity: Annotated[float, Field(gt=0.0, le=1.0)] | None = Field(
        None, description="emissivity, for radiation"
    )
    roughness: Annotated[float, Field(ge=1e-10, le=1e-2)] | None = Field(
        None, description="rms roughness of the surface [m], for rough contacts"
    )
    asperity_slope: Annotated[float, Field(ge=1e-4, le=10.0)] | None = Field(
        None, description="mean absolute slope of the asperities, for rough contacts"
    )
    microhardness: Hardness | None = Field(
        None, description="microhardness [Pa], for rough contacts"
    )
    hardness: Hardness | None = Field(None, description="hardness [Pa], for wear")
    resistivity: Annotated[float, Field(ge=1e-10, le=1e20)] | None = Field(
        None, description='electrical resistivity [Ω m], for partition = "electrothermal"'
    )

    @classmethod
    def with_unit(cls, key: str) -> str:
        """A property with its unit, as its description has it: ``conductivity [W/(m K)]``."""
        unit = re.search(r"\[.*?\]", cls.model_fields[key].description or "")
        return f"{key} {unit[0]}" if unit else key

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.young is None) != (self.poisson is None):
            given, other = ("young", "poisson") if self.poisson is None else ("poisson", "young")
            raise Refused(
                (given,), f"{given} is given without {other}", f"give {other} too, or neither"
            )
        return self


def _when_softening(value: float) -> Callable[[dict[str, Any]], float | None]:
    """A default that holds only where the friction softens."""
    return lambda data: value if data.get("softening") is not None else None


class Softening(Table):
    """How a coefficient of friction depends on temperature: times 1 - softening (T - reference),
    cut to [min, max].
    """

    softening: Annotated[float, Field(ge=-1.0, le=1.0)] | None = Field(
        None,
        description=(
            "relative decrease of the coefficient of friction per kelvin [1/K]; needs [heat]"
        ),
    )
    reference: Kelvin | None = Field(
        default_factory=_when_softening(ROOM_TEMPERATURE),
        description=(
            "temperature at which the coefficient is as given [K]; default with softening: 293.15"
        ),
    )
    min: Friction | None = Field(
        default_factory=_when_softening(0.0),
        description="smallest coefficient of friction; default with softening: 0",
    )
    max: Friction | None = Field(
        default_factory=_when_softening(MAX_FRICTION),
        description="largest coefficient of friction; default with softening: 10",
    )

    @model_validator(mode="after")
    def _softens(self) -> Self:
        if self.softening is None:
            for key in ("reference", "min", "max"):
                if getattr(self, key) is not None:
                    raise Refused(
                        (key,),
                        f"{key} has no meaning without softening",
                        "add softening [1/K], or remove it",
                    )
        elif self.min is not None and self.max is not None and self.max < self.min:
            raise Refused(
                ("max",), f"max = {self.max:g} is below min = {self.min:g}", "swap the two"
            )
        return self


class SofteningFriction(Softening):
    """Coefficient of friction that depends on temperature."""

    value: Friction = Field(description="coefficient of friction at the reference temperature")

    @model_validator(mode="after")
    def _is_softening(self) -> Self:
        if self.softening is None:
            raise Refused(
                (),
                "the softening of the friction is missing",
                "add softening [1/K], or give the coefficient as a number",
            )
        return self


class FrictionTable(Softening):
    """Coefficient of friction that depends on the sliding speed: linear between the rows, constant
    beyond.
    """

    speed: Annotated[tuple[Annotated[float, Field(ge=0.0, le=1e12)], ...], Strict(False)] = Field(
        min_length=1, max_length=1000, description="sliding speeds [m/s], ascending"
    )
    values: Annotated[tuple[Friction, ...], Strict(False)] = Field(
        min_length=1, max_length=1000, description="coefficient of friction at each speed"
    )

    @model_validator(mode="before")
    @classmethod
    def _no_temperatures(cls, data: Any) -> Any:
        if isinstance(data, dict) and "temperature" in data:
            raise Refused(
                ("temperature",),
                "friction is not a table of temperatures",
                (
                    "use { value = 0.5, softening = 1e-3, reference = 293.15 }: it falls by "
                    "softening per kelvin"
                ),
            )
        return data

    @field_validator("speed")
    @classmethod
    def _ascending(cls, speed: tuple[float, ...]) -> tuple[float, ...]:
        require_ascending(speed, "speeds")
        return speed

    @model_validator(mode="after")
    def _same_length(self) -> Self:
        if len(self.speed) != len(self.values):
            raise Refused(
                ("values",),
                f"{len(self.values)} values for {len(self.speed)} speeds",
                "give one coefficient of friction per speed",
            )
        return self


def _tag_friction(value: Any) -> str:
    """Tag in `AnyFriction`: a table of speeds unless only keys of a softening number stand."""
    if not isinstance(value, dict | BaseModel):
        return "<plain>"
    names = type(value).model_fields if isinstance(value, BaseModel) else value
    is_table = (
        "speed" in names or "values" in names or not ("value" in names or "softening" in names)
    )
    return "<speed>" if is_table else "<value>"


AnyFriction = Annotated[
    Annotated[Friction, Tag("<plain>")]
    | Annotated[SofteningFriction, Tag("<value>")]
    | Annotated[FrictionTable, Tag("<speed>")],
    Discriminator(_tag_friction),
]
MaterialOrAny = Annotated[str, Field(pattern=r"^([A-Za-z0-9_-]+|\*)$", max_length=64)]


class PairFriction(Table):
    """Friction between two materials; ``"*"`` stands for any material."""

    pair: Annotated[tuple[MaterialOrAny, MaterialOrAny], Strict(False)] = Field(
        description=(
            'the two materials, as ["glass", "steel"]; "*" stands for any; the more specific pair '
            "wins"
        )
    )
    friction: AnyFriction = Field(
        description=(
            "coefficient of friction (0 to 10), or a table: { speed = [...], values = [...] } of "
            "the sliding speed [m/s], { value = 0.5, softening = 1e-3 } of the temperature, or "
            "both: speed, values and softening"
        )
    )

    @property
    def coefficient(self) -> float:
        """Coefficient of friction at rest and at the reference temperature."""
        if isinstance(self.friction, SofteningFriction):
            return self.friction.value
        # A table begins with the value at the lowest speed.
        return (
            self.friction.values[0] if isinstance(self.friction, FrictionTable) else self.friction
        )

    @property
    def softening(self) -> Softening | None:
        """How the coefficient of friction depends on temperature, if it does."""
        law = self.friction
        return law if isinstance(law, Softening) and law.softening is not None else None

    @property
    def thermal_keys(self) -> Iterator[tuple[str, ...]]:
        """Keys that mean something only with heat."""
        if self.softening is not None:
            yield "friction", "softening"

    @property
    def specificity(self) -> int:
        """How many of the two materials are named: 0, 1 or 2."""
        return sum(name != "*" for name in self.pair)

    def covers(self, a: str, b: str) -> bool:
        """Whether this entry speaks of contacts between ``a`` and ``b`` (in either order)."""
        (p, q) = self.pair
        return (p in ("*", a) and q in ("*", b)) or (p in ("*", b) and q in ("*", a))


class ContactPair(PairFriction):
    """One entry of ``[[contacts]]``: the law between two materials; ``"*"`` stands for any
    material.
    """

    restitution: Fraction = Field(0.0, description="coefficient of normal restitution, 0 to 1")
    adhesion: Annotated[float, Field(ge=0.0, le=1e12)] | None = Field(
        None,
        description=(
            "tension that a contact bears F_a [N]; adhesion has no range, it acts while two "
            "bodies touch; default: none"
        ),
    )
    rolling_friction: Friction | None = Field(
        None,
        description=(
            "coefficient of rolling resistance (0 to 10): the couple of a contact is at most "
            "rolling_friction a* times its normal force, with a* = a_i a_j/(a_i + a_j), a_i at a "
            "smooth wall; default: none"
        ),
    )
    wear: Annotated[float, Field(ge=1e-15, le=1.0)] | None = Field(
        None,
        description=(
            "Archard's coefficient of wear K: volume = K force distance/hardness; needs [heat]; "
            "default: no wear"
        ),
    )

    @property
    def thermal_keys(self) -> Iterator[tuple[str, ...]]:
        """Keys that mean something only with heat."""
        yield from super().thermal_keys
        if self.wear is not None:
            yield ("wear",)

    @property
    def needs(self) -> Iterator[Need]:
        """What needs properties of the two materials, and which."""
        if self.wear is not None:
            yield "wear", ("hardness",)
