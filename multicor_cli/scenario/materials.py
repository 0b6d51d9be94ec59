"""Materials and the contact laws of pairs of materials."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Self

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

from multicor_cli.scenario.base import Fraction, Friction, Kelvin, Table, refuse, require_ascending
from multicor_cli.scenario.heat import ROOM_TEMPERATURE, Need

MAX_MATERIALS = 100
MAX_FRICTION = 10.0


@dataclass(frozen=True)
class _OfSolids:
    """A property of solids within bounds, as an annotation; below them it has probably been given in a larger unit.

    Attributes:
        name: What it is.
        unit: Its unit.
        low: Smallest value of a solid.
        high: Largest value.
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
            raise refuse(f"the {self.name} must be positive, is {value:g} {self.unit}", right)
        if not self.low <= value <= self.high:
            meant = f"{1000.0 * value:g}" if self.power == 3 else f"{value:g}e{self.power}"
            hint = f"did you mean {meant} (from {self.origin})?" if value < self.low else right
            raise refuse(f"{value:g} {self.unit} is not the {self.name} of a solid ({self.low:g} to {self.high:g})", hint)
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {**handler(schema), "minimum": self.low, "maximum": self.high}


Density = Annotated[float, _OfSolids("density", "kg/m³", 1.0, 30_000.0, "for steel 7800", 3, "g/cm³")]
Young = Annotated[float, _OfSolids("Young's modulus", "Pa", 1e3, 1e13, "for steel 193e9", 9, "GPa")]
HeatCapacity = Annotated[float, _OfSolids("heat capacity", "J/(kg K)", 10.0, 1e5, "for steel 500", 3, "J/(g K)")]
Hardness = Annotated[float, _OfSolids("hardness", "Pa", 1e5, 1e12, "for steel 2e9", 9, "GPa")]


class Material(Table):
    """``[materials.NAME]``: what grains and walls are made of."""

    density: Density = Field(description="density [kg/m³]")
    young: Young | None = Field(
        None, description="Young's modulus [Pa]; with poisson it gives the elastic deflection that rigid grains neglect"
    )
    poisson: Annotated[float, Field(gt=-1.0, lt=0.5)] | None = Field(None, description="Poisson's ratio, between -1 and 0.5")

    conductivity: Annotated[float, Field(ge=1e-4, le=1e5)] | None = Field(None, description="thermal conductivity [W/(m K)]")
    heat_capacity: HeatCapacity | None = Field(None, description="specific heat capacity [J/(kg K)]")
    melting: Kelvin | None = Field(
        None, description="temperature at which it melts or decays [K]; checks compare temperatures with it"
    )
    emissivity: Annotated[float, Field(gt=0.0, le=1.0)] | None = Field(None, description="emissivity, for radiation")
    roughness: Annotated[float, Field(ge=1e-10, le=1e-2)] | None = Field(
        None, description="rms roughness of the surface [m], for rough contacts"
    )
    asperity_slope: Annotated[float, Field(ge=1e-4, le=10.0)] | None = Field(
        None, description="mean absolute slope of the asperities, for rough contacts"
    )
    microhardness: Hardness | None = Field(None, description="microhardness [Pa], for rough contacts")
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
            raise refuse(f"{given} is given without {other}", f"give {other} too, or neither", given)
        return self


def _when_softening(value: float) -> Callable[[dict[str, Any]], float | None]:
    """A default that holds only where the friction softens."""
    return lambda data: value if data.get("softening") is not None else None


class Softening(Table):
    """How a coefficient of friction depends on temperature: times 1 - softening (T - reference), cut to [min, max]."""

    softening: Annotated[float, Field(ge=-1.0, le=1.0)] | None = Field(
        None, description="relative decrease of the coefficient of friction per kelvin [1/K]; needs [heat]"
    )
    reference: Kelvin | None = Field(
        default_factory=_when_softening(ROOM_TEMPERATURE),
        description="temperature at which the coefficient is as given [K]; default with softening: 293.15",
    )
    min: Friction | None = Field(
        default_factory=_when_softening(0.0), description="smallest coefficient of friction; default with softening: 0"
    )
    max: Friction | None = Field(
        default_factory=_when_softening(MAX_FRICTION), description="largest coefficient of friction; default with softening: 10"
    )

    @model_validator(mode="after")
    def _softens(self) -> Self:
        if self.softening is None:
            for key in ("reference", "min", "max"):
                if getattr(self, key) is not None:
                    raise refuse(f"{key} has no meaning without softening", "add softening [1/K], or remove it", key)
        elif self.min is not None and self.max is not None and self.max < self.min:
            raise refuse(f"max = {self.max:g} is below min = {self.min:g}", "swap the two", "max")
        return self


class SofteningFriction(Softening):
    """Coefficient of friction that depends on temperature."""

    value: Friction = Field(description="coefficient of friction at the reference temperature")

    @model_validator(mode="after")
    def _is_softening(self) -> Self:
        if self.softening is None:
            raise refuse("the softening of the friction is missing", "add softening [1/K], or give the coefficient as a number")
        return self


class FrictionTable(Softening):
    """Coefficient of friction that depends on the sliding speed: linear between the rows, constant beyond."""

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
            raise refuse(
                "friction is not a table of temperatures",
                "use { value = 0.5, softening = 1e-3, reference = 293.15 }: it falls by softening per kelvin",
                "temperature",
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
            raise refuse(
                f"{len(self.values)} values for {len(self.speed)} speeds",
                "give one coefficient of friction per speed",
                "values",
            )
        return self


def _tag_friction(value: Any) -> str:
    """Discriminator of `AnyFriction`: a table of speeds unless it has the keys of a softening number and none of speeds."""
    if not isinstance(value, dict | BaseModel):
        return "<plain>"
    names = type(value).model_fields if isinstance(value, BaseModel) else value
    is_table = "speed" in names or "values" in names or not ("value" in names or "softening" in names)
    return "<speed>" if is_table else "<value>"


AnyFriction = Annotated[
    Annotated[Friction, Tag("<plain>")] | Annotated[SofteningFriction, Tag("<value>")] | Annotated[FrictionTable, Tag("<speed>")],
    Discriminator(_tag_friction),
]
MaterialOrAny = Annotated[str, Field(pattern=r"^([A-Za-z0-9_-]+|\*)$", max_length=64)]


class PairFriction(Table):
    """Friction between two materials; ``"*"`` stands for any material."""

    pair: Annotated[tuple[MaterialOrAny, MaterialOrAny], Strict(False)] = Field(
        description='the two materials, as ["glass", "steel"]; "*" stands for any; the more specific pair wins'
    )
    friction: AnyFriction = Field(
        description="coefficient of friction (0 to 10), or a table: { speed = [...], values = [...] } of the sliding speed [m/s], "
        "{ value = 0.5, softening = 1e-3 } of the temperature, or both: speed, values and softening"
    )

    @property
    def coefficient(self) -> float:
        """Coefficient of friction at rest and at the reference temperature."""
        if isinstance(self.friction, SofteningFriction):
            return self.friction.value
        # A table begins with the value at the lowest speed.
        return self.friction.values[0] if isinstance(self.friction, FrictionTable) else self.friction

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
        """Whether this entry speaks of contacts between the materials ``a`` and ``b`` (in either order)."""
        (p, q) = self.pair
        return (p in ("*", a) and q in ("*", b)) or (p in ("*", b) and q in ("*", a))


class ContactPair(PairFriction):
    """One entry of ``[[contacts]]``: the law between two materials; ``"*"`` stands for any material."""

    restitution: Fraction = Field(0.0, description="coefficient of normal restitution, 0 to 1")
    adhesion: Annotated[float, Field(ge=0.0, le=1e12)] | None = Field(
        None,
        description="tension that a contact bears F_a [N]; adhesion has no range, it acts while two bodies touch; default: none",
    )
    rolling_friction: Friction | None = Field(
        None,
        description="coefficient of rolling resistance (0 to 10): the couple of a contact is at most rolling_friction a* times its "
        "normal force, with a* = a_i a_j/(a_i + a_j), a_i at a smooth wall; default: none",
    )
    wear: Annotated[float, Field(ge=1e-15, le=1.0)] | None = Field(
        None, description="Archard's coefficient of wear K: volume = K force distance/hardness; needs [heat]; default: no wear"
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
