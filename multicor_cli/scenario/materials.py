"""Materials and the contact laws of pairs of materials."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, Discriminator, Field, Strict, Tag, field_validator, model_validator

from multicor_cli.scenario.base import Fraction, Friction, Table, refuse, require_ascending, tag_table

MAX_MATERIALS = 100
DENSITY_BOUNDS = (1.0, 30_000.0)
YOUNG_BOUNDS = (1e3, 1e13)


def _check_density(value: float) -> float:
    low, high = DENSITY_BOUNDS
    if value <= 0.0:
        raise refuse(f"the density must be positive, is {value:g} kg/m³", "give the density of the grains' solid in kg/m³")
    if not low <= value <= high:
        hint = f"did you mean {value * 1000.0:g} (from g/cm³)?" if value < low else "is it in kg/m³?"
        raise refuse(f"{value:g} kg/m³ is no density of a solid ({low:g} to {high:g})", hint)
    return value


def _check_young(value: float) -> float:
    low, high = YOUNG_BOUNDS
    if value <= 0.0:
        raise refuse(f"Young's modulus must be positive, is {value:g} Pa", "give it in Pa, for steel 193e9")
    if value < low:
        raise refuse(f"{value:g} Pa is no Young's modulus of a solid", f"did you mean {value:g}e9?")
    if value > high:
        raise refuse(f"{value:g} Pa is stiffer than any solid", "give it in Pa, for steel 193e9")
    return value


class Material(Table):
    """``[materials.NAME]``: what grains and walls are made of."""

    density: Annotated[float, AfterValidator(_check_density)] = Field(
        description="density [kg/m³]", json_schema_extra={"minimum": DENSITY_BOUNDS[0], "maximum": DENSITY_BOUNDS[1]}
    )
    young: Annotated[float, AfterValidator(_check_young)] | None = Field(
        None,
        description="Young's modulus [Pa]; with poisson it tells how far grains of this material would deflect",
        json_schema_extra={"minimum": YOUNG_BOUNDS[0], "maximum": YOUNG_BOUNDS[1]},
    )
    poisson: Annotated[float, Field(gt=-1.0, lt=0.5)] | None = Field(None, description="Poisson's ratio, between -1 and 0.5")

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.young is None) != (self.poisson is None):
            given, other = ("young", "poisson") if self.poisson is None else ("poisson", "young")
            raise refuse(f"{given} is given without {other}", f"give {other} too, or neither", given)
        return self


class FrictionTable(Table):
    """Coefficient of friction that depends on the sliding speed: linear between the rows, constant beyond."""

    speed: Annotated[tuple[Annotated[float, Field(ge=0.0, le=1e12)], ...], Strict(False)] = Field(
        min_length=1, max_length=1000, description="sliding speeds [m/s], ascending"
    )
    values: Annotated[tuple[Friction, ...], Strict(False)] = Field(
        min_length=1, max_length=1000, description="coefficient of friction at each speed"
    )

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


AnyFriction = Annotated[
    Annotated[Friction, Tag("<plain>")] | Annotated[FrictionTable, Tag("<table>")],
    Discriminator(tag_table),
]
MaterialOrAny = Annotated[str, Field(pattern=r"^([A-Za-z0-9_-]+|\*)$", max_length=64)]


class ContactPair(Table):
    """One entry of ``[[contacts]]``: the law between two materials; ``"*"`` stands for any material."""

    pair: Annotated[tuple[MaterialOrAny, MaterialOrAny], Strict(False)] = Field(
        description='the two materials, as ["glass", "steel"]; "*" stands for any; the more specific pair wins'
    )
    friction: AnyFriction = Field(
        description="coefficient of friction (0 to 10), or a table { speed = [...], values = [...] } of the sliding speed [m/s]"
    )
    restitution: Fraction = Field(0.0, description="coefficient of normal restitution, 0 to 1")

    @property
    def specificity(self) -> int:
        """How many of the two materials are named: 0, 1 or 2."""
        return sum(name != "*" for name in self.pair)

    def covers(self, a: str, b: str) -> bool:
        """Whether this entry speaks of contacts between the materials ``a`` and ``b`` (in either order)."""
        (p, q) = self.pair
        return (p in ("*", a) and q in ("*", b)) or (p in ("*", b) and q in ("*", a))
