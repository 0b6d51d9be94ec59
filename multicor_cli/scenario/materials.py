"""Materials and the contact laws of pairs of materials."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from multicor_cli.scenario.base import (
    ROOM_TEMPERATURE,
    Array,
    Fraction,
    Friction,
    Kelvin,
    Pair,
    Table,
    ascending,
    optional,
    required,
    tag_table,
)
from multicor_cli.scenario.problems import Refused

Need = tuple[str, tuple[str, ...]]
"""What needs properties of a material, in the words of the scenario, and which."""

MAX_MATERIALS = 100


def _of_solids(
    name: str, unit: str, low: float, high: float, example: str, power: int, origin: str
) -> tuple[AfterValidator, WithJsonSchema]:
    """What annotates a property of solids between bounds; too small values suggest a larger unit.

    ``example`` is a right value, and of what; ten to the ``power`` (3 or 9) leads from the unit
    that was probably meant, ``origin``, to ``unit``.
    """

    def check(value: float) -> float:
        remedy = f"give it in {unit}, {example}"
        if value <= 0.0:
            raise Refused((), f"the {name} must be positive, is {value:g} {unit}", remedy)
        if not low <= value <= high:
            if value < low:
                meant = f"{1000.0 * value:g}" if power == 3 else f"{value:g}e{power}"
                remedy = f"did you mean {meant} (from {origin})?"
            what = f"{value:g} {unit} is not the {name} of a solid ({low:g} to {high:g})"
            raise Refused((), what, remedy)
        return value

    schema = {"type": "number", "minimum": low, "maximum": high}
    return AfterValidator(check), WithJsonSchema(schema)


Density = Annotated[
    float, *_of_solids("density", "kg/m³", 1.0, 30_000.0, "for steel 7800", 3, "g/cm³")
]
Young = Annotated[
    float, *_of_solids("Young's modulus", "Pa", 1e3, 1e13, "for steel 193e9", 9, "GPa")
]
HeatCapacity = Annotated[
    float, *_of_solids("heat capacity", "J/(kg K)", 10.0, 1e5, "for steel 500", 3, "J/(g K)")
]
Hardness = Annotated[float, *_of_solids("hardness", "Pa", 1e5, 1e12, "for steel 2e9", 9, "GPa")]


class Material(Table):
    """``[materials.NAME]``: what grains and walls are made of."""

    density: Density = required("density [kg/m³]")
    young: Young | None = optional(
        "Young's modulus [Pa]; with poisson it gives the elastic deflection that rigid grains "
        "neglect"
    )
    poisson: Annotated[float, Field(gt=-1.0, lt=0.5)] | None = optional(
        "Poisson's ratio, between -1 and 0.5"
    )

    conductivity: Annotated[float, Field(ge=1e-4, le=1e5)] | None = optional(
        "thermal conductivity [W/(m K)]"
    )
    heat_capacity: HeatCapacity | None = optional("specific heat capacity [J/(kg K)]")
    melting: Kelvin | None = optional(
        "temperature at which it melts or decays [K]; checks compare temperatures with it"
    )
    ignition: Kelvin | None = optional(
        "temperature at which it ignites or explodes [K]; a check compares the hottest contact "
        "spot with it, or with melting if that is lower"
    )
    expansion: Annotated[float, Field(ge=-1e-2, le=1e-2)] | None = optional(
        "coefficient of linear thermal expansion [1/K]: grains have the radius a (1 + expansion "
        "(T - T_0)), with their temperature T_0 at the start; needs [heat]; default: none expands"
    )
    emissivity: Annotated[float, Field(gt=0.0, le=1.0)] | None = optional(
        "emissivity, for radiation"
    )
    roughness: Annotated[float, Field(ge=1e-10, le=1e-2)] | None = optional(
        "rms roughness of the surface [m], for rough contacts"
    )
    asperity_slope: Annotated[float, Field(ge=1e-4, le=10.0)] | None = optional(
        "mean absolute slope of the asperities, for rough contacts"
    )
    microhardness: Hardness | None = optional("microhardness [Pa], for rough contacts")
    hardness: Hardness | None = optional("hardness [Pa], for wear")
    resistivity: Annotated[float, Field(ge=1e-10, le=1e20)] | None = optional(
        'electrical resistivity [Ω m], for partition = "electrothermal"'
    )

    @classmethod
    def with_unit(cls, key: str) -> str:
        """A property with its unit, as its description has it: ``conductivity [W/(m K)]``."""
        unit = re.search(r"\[.*?\]", cls.model_fields[key].description or "")
        return f"{key} {unit[0]}" if unit else key

    def faults(self) -> Iterator[Refused]:
        if (self.young is None) != (self.poisson is None):
            given, other = ("young", "poisson") if self.poisson is None else ("poisson", "young")
            what = f"{given} is given without {other}"
            yield Refused((given,), what, f"give {other} too, or neither")


def _when_softening(value: float) -> Callable[[dict[str, Any]], float | None]:
    """A default that holds only where the friction softens."""
    return lambda data: value if data.get("softening") is not None else None


class Softening(Table):
    """How a coefficient of friction depends on temperature: times 1 - softening (T - reference),
    cut to [min, max].
    """

    softening: Annotated[float, Field(ge=-1.0, le=1.0)] | None = optional(
        "relative decrease of the coefficient of friction per kelvin [1/K]; needs [heat]"
    )
    reference: Kelvin | None = optional(
        "temperature at which the coefficient is as given [K]; default with softening: 293.15",
        default_factory=_when_softening(ROOM_TEMPERATURE),
    )
    min: Friction | None = optional(
        "smallest coefficient of friction; default with softening: 0",
        default_factory=_when_softening(0.0),
    )
    max: Friction | None = optional(
        "largest coefficient of friction; default with softening: 10",
        default_factory=_when_softening(10.0),
    )

    def faults(self) -> Iterator[Refused]:
        for key in ("reference", "min", "max"):
            if self.softening is None and getattr(self, key) is not None:
                what = f"{key} has no meaning without softening"
                yield Refused((key,), what, "add softening [1/K], or remove it")
        if self.min is not None and self.max is not None and self.max < self.min:
            what = f"max = {self.max:g} is below min = {self.min:g}"
            yield Refused(("max",), what, "swap the two")


class SofteningFriction(Softening):
    """Coefficient of friction that depends on temperature."""

    value: Friction = required("coefficient of friction at the reference temperature")

    def faults(self) -> Iterator[Refused]:
        yield from super().faults()
        if self.softening is None:
            remedy = "add softening [1/K], or give the coefficient as a number"
            yield Refused((), "the softening of the friction is missing", remedy)


class FrictionTable(Softening):
    """Coefficient of friction that depends on the sliding speed: linear between the rows, constant
    beyond.
    """

    speed: Array[Annotated[float, Field(ge=0.0, le=1e12)]] = required(
        "sliding speeds [m/s], ascending", min_length=1, max_length=1000
    )
    values: Array[Friction] = required(
        "coefficient of friction at each speed", min_length=1, max_length=1000
    )

    @model_validator(mode="before")
    @classmethod
    def _no_temperatures(cls, data: Any) -> Any:
        if isinstance(data, dict) and "temperature" in data:
            remedy = (
                "use { value = 0.5, softening = 1e-3, reference = 293.15 }: it falls by softening "
                "per kelvin"
            )
            what = "friction is not a table of temperatures"
            raise Refused(("temperature",), what, remedy)
        return data

    _ascending = field_validator("speed")(ascending("speeds"))

    def faults(self) -> Iterator[Refused]:
        yield from super().faults()
        if len(self.speed) != len(self.values):
            what = f"{len(self.values)} values for {len(self.speed)} speeds"
            yield Refused(("values",), what, "give one coefficient of friction per speed")


class FlashFriction(Table):
    """Coefficient of friction that weakens by flash heating of the asperities: above the weakening
    speed V_w it is weakened + (value - weakened) V_w/speed (Rice 2006).
    """

    value: Friction = required("coefficient of friction up to the weakening speed")
    weakened: Friction = required("coefficient of friction to which it falls")
    weakening_speed: Annotated[float, Field(gt=0.0, le=1e12)] = required(
        "sliding speed above which it weakens V_w [m/s]"
    )
    weakening_temperature: Kelvin | None = optional(
        "temperature at which asperities are weak at any speed T_w [K]: V_w falls with the "
        "temperature T of the bodies as (T_w - T)^2; needs [heat]; default: V_w is constant"
    )
    reference: Kelvin = optional(
        "temperature to which weakening_speed belongs [K]", ROOM_TEMPERATURE
    )

    def faults(self) -> Iterator[Refused]:
        if self.weakened > self.value:
            what = f"weakened = {self.weakened:g} is above value = {self.value:g}"
            yield Refused(("weakened",), what, "swap the two")
        limit = self.weakening_temperature
        if limit is not None and limit <= self.reference:
            what = (
                f"weakening_temperature = {limit:g} K is not above reference = {self.reference:g} K"
            )
            remedy = "give weakening_speed at a lower temperature, and that as reference"
            yield Refused(("weakening_temperature",), what, remedy)


def _tag_friction(value: Any) -> str:
    """Tag in `AnyFriction`: by the keys that only one of them has, else a table of speeds."""
    if not isinstance(value, dict | BaseModel):
        return "<plain>"
    names = value if isinstance(value, dict) else type(value).model_fields
    if any(name.startswith("weaken") for name in names):
        return "<flash>"
    is_value = "speed" not in names and "values" not in names
    return "<value>" if is_value and ("value" in names or "softening" in names) else "<speed>"


AnyFriction = Annotated[
    Annotated[Friction, Tag("<plain>")]
    | Annotated[SofteningFriction, Tag("<value>")]
    | Annotated[FrictionTable, Tag("<speed>")]
    | Annotated[FlashFriction, Tag("<flash>")],
    Discriminator(_tag_friction),
]
MaterialOrAny = Annotated[str, Field(pattern=r"^([A-Za-z0-9_-]+|\*)$", max_length=64)]


class Adhesion(Table):
    """How two materials attract each other."""

    force: Annotated[float, Field(ge=0.0, le=1e12)] = required(
        "tension that a contact bears F_a [N]"
    )
    range: Annotated[float, Field(gt=0.0, le=1e3)] | None = optional(
        "gap across which adhesion ends [m]; at most the smallest radius; default: a hundredth "
        "of the mean diameter of the grains"
    )
    kind: Literal["dry", "wet"] = optional(
        '"dry": the force of a gap g is force (1 - g/range), whoever comes near; "wet": a '
        "bridge of liquid begins when two bodies touch, pulls with the whole force and breaks "
        "at the range",
        "dry",
    )


AnyAdhesion = Annotated[
    Annotated[float, Field(ge=0.0, le=1e12), Tag("<plain>")] | Annotated[Adhesion, Tag("<table>")],
    Discriminator(tag_table),
]


class PairFriction(Table):
    """Friction between two materials; ``"*"`` stands for any material."""

    pair: Pair[MaterialOrAny] = required(
        'the two materials, as ["glass", "steel"]; "*" stands for any; the more specific pair wins'
    )
    friction: AnyFriction = required(
        "coefficient of friction (0 to 10), or a table: { speed = [...], values = [...] } of "
        "the sliding speed [m/s], { value = 0.5, softening = 1e-3 } of the temperature, "
        "both: speed, values and softening, or { value = 0.7, weakened = 0.1, weakening_speed = "
        "0.1 } by flash heating"
    )

    @property
    def coefficient(self) -> float:
        """Coefficient of friction at rest and at the reference temperature."""
        if isinstance(self.friction, float):
            return self.friction
        # A table begins with the value at the lowest speed.
        law = self.friction
        return law.values[0] if isinstance(law, FrictionTable) else law.value

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
        law = self.friction
        if isinstance(law, FlashFriction) and law.weakening_temperature is not None:
            yield "friction", "weakening_temperature"

    @property
    def specificity(self) -> int:
        """How many of the two materials are named: 0, 1 or 2."""
        return sum(name != "*" for name in self.pair)

    def covers(self, a: str, b: str) -> bool:
        """Whether this entry speaks of contacts between ``a`` and ``b`` (in either order)."""
        p, q = self.pair
        return (p in ("*", a) and q in ("*", b)) or (p in ("*", b) and q in ("*", a))


class ContactPair(PairFriction):
    """One entry of ``[[contacts]]``: the law between two materials; ``"*"`` stands for any
    material.
    """

    restitution: Fraction = optional("coefficient of normal restitution, 0 to 1", 0.0)
    adhesion: AnyAdhesion | None = optional(
        "tension that a contact bears F_a [N], or { force = 1e-5, range = 2e-6, kind = "
        '"wet" }; it ends across a gap, the range; default: none'
    )
    rolling_friction: Friction | None = optional(
        "coefficient of rolling resistance (0 to 10): the couple of a contact is at most "
        "rolling_friction a* times its normal force, with a* = a_i a_j/(a_i + a_j), a_i at a "
        "smooth wall; default: none"
    )
    wear: Annotated[float, Field(ge=1e-15, le=1.0)] | None = optional(
        "Archard's coefficient of wear K: volume = K force distance/hardness; needs [heat]; "
        "default: no wear"
    )

    @property
    def attraction(self) -> Adhesion:
        """Adhesion, of force 0 where there is none."""
        value = 0.0 if self.adhesion is None else self.adhesion
        return value if isinstance(value, Adhesion) else Adhesion(force=value)

    @property
    def thermal_keys(self) -> Iterator[tuple[str, ...]]:
        yield from super().thermal_keys
        if self.wear is not None:
            yield ("wear",)

    @property
    def needs(self) -> Iterator[Need]:
        """What needs properties of the two materials, and which."""
        if self.wear is not None:
            yield "wear", ("hardness",)
