"""Loading stages: their length, what they wait for, and what they say of walls and gravity."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Discriminator, Field, Tag, model_validator

from multicor_cli.scenario.base import (
    CHANGEABLE,
    Array,
    Name,
    Number,
    Ratio,
    Table,
    Time,
    TwoWalls,
    one_of,
    optional,
    required,
)
from multicor_cli.scenario.drives import CellDrives, StageGravityTable, WallCondition, WallDrives
from multicor_cli.scenario.materials import PairFriction
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.settings import Output, StageSolver, TimeStep

# ---- `until`: what ends a loading stage before its duration is over

Axis = Literal["x", "y"]
AnyAxis = Literal["x", "y", "spin"]
Component = Literal["xx", "yy", "xy"]
Relation = Literal["at least", "at most"]

_WINDOW = (
    "windows of time [s] over which means are taken, one after the other from the start of the "
    "stage"
)
_HALVES = (
    "span of time whose two halves are compared [s]: long enough for a mean as sure as the "
    "tolerance"
)
_DRIFT = "largest drift between the halves over the mean, its uncertainty included, as 0.05"
_LEFT_OUT = "time since the start of the stage that is left out [s]"


def _tag_cell(value: Any) -> str:
    """Discriminator of ends that are told of walls or of a cell, by the key ``cell``."""
    if isinstance(value, BaseModel):
        value = type(value).model_fields
    return "<cell>" if isinstance(value, dict) and "cell" in value else "<plain>"


class StrainEnd(Table):
    """Shear strain at which a stage ends."""

    walls: TwoWalls = required("the two walls that shear the grains (or give cell)")
    value: float = required("shear strain of this stage at which it ends", ge=1e-12, le=1e9)


class _CellEnd(Table):
    """What ends a stage by the strain or stress of a cell."""

    @model_validator(mode="before")
    @classmethod
    def _names_no_wall(cls, data: Any) -> Any:
        for key in ("walls", "wall", "axis"):
            if isinstance(data, dict) and key in data:
                remedy = f"remove {key} where the domain is a cell, else cell"
                raise Refused((key,), f"both cell and {key} are given", remedy)
        return data


class CellStrainEnd(_CellEnd):
    """Strain of a cell at which a stage ends: of a component, ∫|L| dt since its start."""

    cell: Component = required("the component of the strain of the cell")
    value: float = required("strain of this stage at which it ends", ge=1e-12, le=1e9)


class BoundEnd(Table):
    """A quantity that ends a stage when it has come above or below a value."""

    above: Number | None = optional("the stage ends when the quantity is at least this")
    below: Number | None = optional("the stage ends when the quantity is at most this")

    def faults(self) -> Iterator[Refused]:
        if (self.above is None) == (self.below is None):
            has = "neither above nor below" if self.above is None else "both above and below"
            yield Refused((), f"has {has}", "give one of the two")

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

    walls: TwoWalls = required("the two walls")
    axis: Axis = optional("direction in which their distance is measured", "y")


class DisplacementEnd(BoundEnd):
    """Displacement of a wall at which a stage ends."""

    wall: Name = required("the wall")
    axis: AnyAxis = required(
        "x or y [m], or spin: the angle by which it has turned, counter-clockwise [rad]"
    )


class ForceEnd(BoundEnd):
    """Mean force of the grains on a wall at which a stage ends."""

    wall: Name = required("the wall")
    axis: AnyAxis = required("component of the force, x or y [N], or spin: the torque [N m]")
    window: Time = required(_WINDOW)


class StressEnd(BoundEnd):
    """Mean force of the grains on a wall over its length at which a stage ends."""

    wall: Name = required("the wall")
    axis: Axis = required("component of the force")
    window: Time = required(_WINDOW)


class CellStressEnd(BoundEnd, _CellEnd):
    """Mean stress of the grains in a cell at which a stage ends."""

    cell: Component = required(
        "component of the stress [N/m]: xx and yy positive in compression, xy where it resists a "
        "positive rate"
    )
    window: Time = required(_WINDOW)


class SteadyEnd(Table):
    """A quantity whose mean has to drift no longer for the stage to end."""

    of: Literal["kinetic_energy", "force", "stress", "friction"] = required(
        'what is watched: "kinetic_energy", or of a wall "force", "stress" or "friction": the '
        'force along axis over that across it; of a cell "stress" or "friction"'
    )
    wall: Name | None = optional("the wall, for all but the kinetic energy")
    axis: AnyAxis | None = optional(
        'component of the force: "x", "y", or for the force of a wall "spin", its torque'
    )
    window: Time = required(_HALVES)
    tolerance: Ratio = required(_DRIFT)
    after: Annotated[float, Field(ge=0.0, le=1e12)] = optional(_LEFT_OUT, 0.0)

    def faults(self) -> Iterator[Refused]:
        for key in ("wall", "axis"):
            is_given = getattr(self, key) is not None
            if self.of == "kinetic_energy" and is_given:
                what = f"{key} has no meaning for the kinetic energy, which is that of all grains"
                yield Refused((key,), what, "remove it")
            if self.of != "kinetic_energy" and not is_given:
                remedy = f"add {key}" if key == "axis" else 'add wall, or of a cell, cell = "xy"'
                yield Refused((), f'{key} is missing, which of = "{self.of}" needs', remedy)
        if self.axis == "spin" and self.of != "force":
            what = f'of = "{self.of}" has no component "spin"'
            yield Refused(("axis",), what, 'use "x" or "y", or of = "force"')


class CellSteadyEnd(_CellEnd):
    """Stress or friction of a cell whose mean has to drift no longer for the stage to end."""

    of: Literal["stress", "friction"] = required(
        'what is watched: "stress", or "friction": the stress in shear over the mean pressure'
    )
    cell: Component = required('component of the stress; "xy" for the friction')
    window: Time = required(_HALVES)
    tolerance: Ratio = required(_DRIFT)
    after: Annotated[float, Field(ge=0.0, le=1e12)] = optional(_LEFT_OUT, 0.0)

    def faults(self) -> Iterator[Refused]:
        if self.of == "friction" and self.cell != "xy":
            what = f'of = "friction" has no component "{self.cell}"'
            yield Refused(("cell",), what, 'use cell = "xy", or of = "stress"')


class UntilStrain(Table):
    """Ends at a shear strain: relative displacement of two walls in x over their distance in y; or
    at a strain of a cell.
    """

    strain: Annotated[
        Annotated[StrainEnd, Tag("<plain>")] | Annotated[CellStrainEnd, Tag("<cell>")],
        Discriminator(_tag_cell),
    ] = required('{ walls = ["bottom", "top"], value = 1.5 }, or { cell = "xy", value = 1.5 }')


class UntilRest(Table):
    """Ends when the grains have come to rest."""

    kinetic_energy_ratio: Ratio = required(
        "share of the stage's largest kinetic energy at which it ends, as 1e-6; where nothing "
        "ever moves, the stage ends with its duration"
    )


class UntilAxialStrain(Table):
    """Ends at an axial strain: distance of two walls over that at the start of the stage, less
    1.
    """

    axial_strain: AxialStrainEnd = required(
        '{ walls = ["bottom", "top"], axis = "y", below = -0.05 }: 5 % nearer'
    )


class UntilDisplacement(Table):
    """Ends at a displacement of a wall since the start of the stage."""

    displacement: DisplacementEnd = required('{ wall = "lid", axis = "y", below = -0.01 }')


class UntilForce(Table):
    """Ends when the mean force of the grains on a wall has reached a value."""

    force: ForceEnd = required('{ wall = "lid", axis = "y", above = 5.0, window = 0.01 }')


class UntilStress(Table):
    """Ends when the mean force of the grains on a wall over its length has reached a value, or
    the mean stress in a cell [N/m].
    """

    stress: Annotated[
        Annotated[StressEnd, Tag("<plain>")] | Annotated[CellStressEnd, Tag("<cell>")],
        Discriminator(_tag_cell),
    ] = required(
        '{ wall = "lid", axis = "y", above = 500.0, window = 0.01 }, or cell = "yy" in place of '
        "wall and axis"
    )


class UntilSteady(Table):
    """Ends when the mean of a quantity no longer drifts."""

    steady: Annotated[
        Annotated[SteadyEnd, Tag("<plain>")] | Annotated[CellSteadyEnd, Tag("<cell>")],
        Discriminator(_tag_cell),
    ] = required(
        '{ of = "friction", wall = "top", axis = "x", window = 0.5, tolerance = 0.05 }, or cell = '
        '"xy" in place of wall and axis'
    )


Until = Annotated[
    Annotated[UntilStrain, Tag("<strain>")]
    | Annotated[UntilRest, Tag("<kinetic_energy_ratio>")]
    | Annotated[UntilAxialStrain, Tag("<axial_strain>")]
    | Annotated[UntilDisplacement, Tag("<displacement>")]
    | Annotated[UntilForce, Tag("<force>")]
    | Annotated[UntilStress, Tag("<stress>")]
    | Annotated[UntilSteady, Tag("<steady>")],
    one_of(
        "until is a table with",
        "strain, kinetic_energy_ratio, axial_strain, displacement, force, stress, steady",
    ),
]


def window_of(until: Until | None) -> float | None:
    """Time after which the first window of a condition ends [s]; None if it has none."""
    _, end = next(iter(until)) if until is not None else ("", None)
    if isinstance(end, ForceEnd | StressEnd | SteadyEnd | CellStressEnd | CellSteadyEnd):
        return getattr(end, "after", 0.0) + end.window
    return None


def walls_of(until: Until | None) -> dict[tuple[str | int, ...], str]:
    """Walls that a condition names, by the keys inside ``until`` that name them."""
    key, end = next(iter(until)) if until is not None else ("", None)
    if isinstance(end, StrainEnd | AxialStrainEnd):
        return {(key, "walls", k): name for k, name in enumerate(end.walls)}
    wall = getattr(end, "wall", None)  # a few conditions are about all grains
    return {} if wall is None else {(key, "wall"): wall}


# ---- Stages


class Stage(Table):
    """One entry of ``[[loading]]``; the stages follow each other in time."""

    name: Name | None = optional("name of the stage")
    duration: Time | None = optional(
        "length of the stage [s], to which its last step is cut; with until: its upper bound"
    )
    until: Until | None = optional(
        "condition that ends the stage: strain, kinetic_energy_ratio, axial_strain, "
        "displacement, force, stress or steady"
    )
    on_timeout: Annotated[Literal["go on", "stop"], CHANGEABLE] = optional(
        'what happens if duration is over before until holds: "go on" with the next stage, or '
        '"stop" the run (exit code 4; "go on" continues it)',
        "go on",
    )
    dt: TimeStep | None = optional(
        'time step of this stage [s], or "auto"; default: that of [solver]. In a frozen stage: '
        "interval at which temperatures are evaluated [s], the least between frames and rows; "
        "default: the smaller interval of [output]"
    )
    solver: StageSolver | None = optional("tolerances of [solver] to override in this stage")
    drives: dict[Name, WallDrives] = optional(
        "drives.NAME = { x = ..., y = ..., spin = ..., surface = ... } for the wall NAME",
        default_factory=dict,
        max_length=1000,
    )
    cell: CellDrives | None = optional(
        "cell = { xx = ..., yy = ..., xy = ... }: what strains or loads a domain that is periodic "
        "in both directions"
    )
    contacts: Array[PairFriction] = optional(
        'friction from this stage on, as [{ pair = ["glass", "*"], friction = 0.0 }]; pairs '
        "that are not covered keep theirs, and so do restitution, adhesion and rolling_friction",
        (),
        max_length=1000,
    )
    gravity: StageGravityTable | None = optional(
        "gravity from this stage on: [gx, gy] [m/s²], each a number or a table with ramp, "
        "sine or times, or { angle = ..., magnitude = ... }, the angle in degrees from -y "
        "towards +x; default: as at the end of the stage before"
    )
    thermal: dict[Name, WallCondition] = optional(
        "thermal.NAME = { temperature = ... }, { flow = ... } or { insulated = true } for the "
        "wall NAME, from here on",
        default_factory=dict,
        max_length=1000,
    )
    frozen: bool = optional(
        "whether the grains and walls stand still while the heat goes on; needs [heat]", False
    )
    heat: bool | None = optional(
        "whether temperatures change in this stage; default: they do if there is a table [heat]"
    )

    def faults(self) -> Iterator[Refused]:
        if self.duration is None and self.until is None:
            yield Refused((), "the stage has no end", "give duration [s] or until")
        if self.duration is None and not isinstance(self.until, UntilStrain):
            what = "a stage that waits for this may never end"
            yield Refused(("until",), what, "give duration [s] too, as its upper bound")
        window = window_of(self.until)
        if window is not None and self.duration is not None and window > self.duration:
            what = f"no window of {window:g} s ends within the duration of {self.duration:g} s"
            yield Refused(("until",), what, "use shorter windows, or a longer duration")
        if self.on_timeout == "stop" and (self.until is None or self.duration is None):
            missing = "duration: it cannot run out of time"
            if self.until is None:
                missing = "until: its duration is no upper bound"
            what = f'on_timeout = "stop" has no effect without {missing}'
            yield Refused(("on_timeout",), what, "add it, or remove on_timeout")
        if self.frozen:
            yield from self._faults_of_frozen()

    def _faults_of_frozen(self) -> Iterator[Refused]:
        if self.dt == "auto":
            remedy = "give the interval at which temperatures are evaluated [s], or remove dt"
            yield Refused(("dt",), "there is no automatic time step with frozen = true", remedy)
        if self.heat is False:
            what = "nothing happens in a stage with frozen = true and heat = false"
            yield Refused(("heat",), what, "remove one of the two")
        for key in ("until", "drives", "cell", "contacts", "gravity", "solver"):
            if getattr(self, key):
                what = f"{key} has no meaning with frozen = true: nothing moves"
                yield Refused((key,), what, f"remove {key} or frozen")


def frozen_dt(stage: Stage, output: Output) -> float:
    """Interval at which temperatures are evaluated in a frozen stage [s].

    That of the stage, or the smaller interval of ``output``; shortened to divide the duration.
    """
    longest = stage.dt or min(output.series_interval, output.frame_interval)
    # A frozen stage has no other end than its duration, and no automatic time step
    assert stage.duration is not None
    assert longest != "auto"
    return stage.duration / max(1, math.ceil(stage.duration / longest * (1.0 - 1e-9)))
