"""``until``: what ends a loading stage before its duration is over."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from multicor_cli.scenario.base import Name, Number, Ratio, Table, Time, TwoWalls, one_of, refuse

Axis = Literal["x", "y"]
AnyAxis = Literal["x", "y", "spin"]
Relation = Literal["at least", "at most"]

_WINDOW = "windows of time [s] over which means are taken, one after the other from the start of the stage"


class StrainEnd(Table):
    """Shear strain at which a stage ends."""

    walls: TwoWalls = Field(description="the two walls that shear the grains")
    value: float = Field(ge=1e-12, le=1e9, description="shear strain of this stage at which it ends")


class BoundEnd(Table):
    """A quantity that ends a stage when it has come above or below a value."""

    above: Number | None = Field(None, description="the stage ends when the quantity is at least this")
    below: Number | None = Field(None, description="the stage ends when the quantity is at most this")

    @model_validator(mode="after")
    def _one_bound(self) -> Self:
        if (self.above is None) == (self.below is None):
            has = "neither" if self.above is None else "both"
            raise refuse(f"has {has} above and below" if has == "both" else "has neither above nor below", "give one of the two")
        return self

    @property
    def relation(self) -> Relation:
        """How the quantity has to be."""
        return "at most" if self.above is None else "at least"

    @property
    def goal(self) -> float:
        """To what it is compared."""
        bound = self.below if self.above is None else self.above
        assert bound is not None  # as has been checked
        return bound


class AxialStrainEnd(BoundEnd):
    """Relative change of the distance of two walls at which a stage ends."""

    walls: TwoWalls = Field(description="the two walls")
    axis: Axis = Field("y", description="direction in which their distance is measured")


class DisplacementEnd(BoundEnd):
    """Displacement of a wall at which a stage ends."""

    wall: Name = Field(description="the wall")
    axis: AnyAxis = Field(description="x or y [m], or spin: the angle by which it has turned, counter-clockwise [rad]")


class ForceEnd(BoundEnd):
    """Mean force of the grains on a wall at which a stage ends."""

    wall: Name = Field(description="the wall")
    axis: AnyAxis = Field(description="component of the force, x or y [N], or spin: the torque [N m]")
    window: Time = Field(description=_WINDOW)


class StressEnd(BoundEnd):
    """Mean force of the grains on a wall over its length at which a stage ends."""

    wall: Name = Field(description="the wall")
    axis: Axis = Field(description="component of the force")
    window: Time = Field(description=_WINDOW)


class SteadyEnd(Table):
    """A quantity whose mean has to drift no longer for the stage to end."""

    of: Literal["kinetic_energy", "force", "stress", "friction"] = Field(
        description='what is watched: "kinetic_energy", or of a wall "force", "stress" or "friction": the force along axis over '
        "that across it"
    )
    wall: Name | None = Field(None, description="the wall, for all but the kinetic energy")
    axis: AnyAxis | None = Field(
        None, description='component of the force: "x", "y", or for the force of a wall "spin", its torque'
    )
    window: Time = Field(
        description="span of time whose two halves are compared [s]: long enough for a mean as sure as the tolerance"
    )
    tolerance: Ratio = Field(description="largest drift between the halves over the mean, its uncertainty included, as 0.05")
    after: Annotated[float, Field(ge=0.0, le=1e12)] = Field(
        0.0, description="time since the start of the stage that is left out [s]"
    )

    @model_validator(mode="after")
    def _is_of_something(self) -> Self:
        given = {"wall": self.wall is not None, "axis": self.axis is not None}
        for key, is_given in given.items():
            if self.of == "kinetic_energy" and is_given:
                raise refuse(f"{key} has no meaning for the kinetic energy, which is that of all grains", "remove it", key)
            if self.of != "kinetic_energy" and not is_given:
                raise refuse(f'{key} is missing, which of = "{self.of}" needs', f"add {key}")
        if self.axis == "spin" and self.of != "force":
            raise refuse(f'of = "{self.of}" has no component "spin"', 'use "x" or "y", or of = "force"', "axis")
        return self


class UntilStrain(Table):
    """Ends at a shear strain: relative displacement of two walls in x over their distance in y."""

    strain: StrainEnd = Field(description='{ walls = ["bottom", "top"], value = 1.5 }')


class UntilRest(Table):
    """Ends when the grains have come to rest."""

    kinetic_energy_ratio: Ratio = Field(
        description="share of the stage's largest kinetic energy at which it ends, as 1e-6; where nothing ever moves, "
        "the stage ends with its duration"
    )


class UntilAxialStrain(Table):
    """Ends at an axial strain: distance of two walls over that at the start of the stage, less 1."""

    axial_strain: AxialStrainEnd = Field(description='{ walls = ["bottom", "top"], axis = "y", below = -0.05 }: 5 % nearer')


class UntilDisplacement(Table):
    """Ends at a displacement of a wall since the start of the stage."""

    displacement: DisplacementEnd = Field(description='{ wall = "lid", axis = "y", below = -0.01 }')


class UntilForce(Table):
    """Ends when the mean force of the grains on a wall has reached a value."""

    force: ForceEnd = Field(description='{ wall = "lid", axis = "y", above = 5.0, window = 0.01 }')


class UntilStress(Table):
    """Ends when the mean force of the grains on a wall over its length has reached a value [N/m]."""

    stress: StressEnd = Field(description='{ wall = "lid", axis = "y", above = 500.0, window = 0.01 }')


class UntilSteady(Table):
    """Ends when the mean of a quantity no longer drifts."""

    steady: SteadyEnd = Field(description='{ of = "friction", wall = "top", axis = "x", window = 0.5, tolerance = 0.05 }')


Until = Annotated[
    Annotated[UntilStrain, Tag("<strain>")]
    | Annotated[UntilRest, Tag("<kinetic_energy_ratio>")]
    | Annotated[UntilAxialStrain, Tag("<axial_strain>")]
    | Annotated[UntilDisplacement, Tag("<displacement>")]
    | Annotated[UntilForce, Tag("<force>")]
    | Annotated[UntilStress, Tag("<stress>")]
    | Annotated[UntilSteady, Tag("<steady>")],
    one_of("until is a table with", "strain", "kinetic_energy_ratio", "axial_strain", "displacement", "force", "stress", "steady"),
]
AnyUntil = UntilStrain | UntilRest | UntilAxialStrain | UntilDisplacement | UntilForce | UntilStress | UntilSteady


def window_of(until: AnyUntil | None) -> float | None:
    """Time after which the first window of a condition ends [s]; None if it has none."""
    if isinstance(until, UntilForce):
        return until.force.window
    if isinstance(until, UntilSteady):
        return until.steady.after + until.steady.window
    return until.stress.window if isinstance(until, UntilStress) else None


def walls_of(until: AnyUntil | None) -> dict[tuple[str | int, ...], str]:
    """Walls that a condition names, by the keys inside ``until`` that name them."""
    if isinstance(until, UntilStrain):
        return {("strain", "walls", k): name for k, name in enumerate(until.strain.walls)}
    if isinstance(until, UntilAxialStrain):
        return {("axial_strain", "walls", k): name for k, name in enumerate(until.axial_strain.walls)}
    if isinstance(until, UntilDisplacement):
        return {("displacement", "wall"): until.displacement.wall}
    if isinstance(until, UntilForce):
        return {("force", "wall"): until.force.wall}
    if isinstance(until, UntilSteady):
        return {} if until.steady.wall is None else {("steady", "wall"): until.steady.wall}
    return {("stress", "wall"): until.stress.wall} if isinstance(until, UntilStress) else {}
