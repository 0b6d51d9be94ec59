"""Loading stages: their length and ends, gravity, and how they drive and heat the walls."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import AfterValidator, Discriminator, Field, Strict, Tag, model_validator

from multicor_cli.scenario.base import (
    CHANGEABLE,
    Kelvin,
    Name,
    Number,
    Ratio,
    Table,
    Time,
    TwoWalls,
    check_kelvin,
    one_of,
    tag_table,
    true_only,
)
from multicor_cli.scenario.materials import PairFriction
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.settings import Output, StageSolver, TimeStep
from multicor_cli.scenario.signals import (
    AnySignal,
    RampSignal,
    Signal,
    SineSignal,
    TableSignal,
    first_level,
    levels,
)

# ---- `until`: what ends a loading stage before its duration is over

Axis = Literal["x", "y"]
AnyAxis = Literal["x", "y", "spin"]
Relation = Literal["at least", "at most"]

_WINDOW = (
    "windows of time [s] over which means are taken, one after the other from the start of the "
    "stage"
)


class StrainEnd(Table):
    """Shear strain at which a stage ends."""

    walls: TwoWalls = Field(description="the two walls that shear the grains")
    value: float = Field(
        ge=1e-12, le=1e9, description="shear strain of this stage at which it ends"
    )


class BoundEnd(Table):
    """A quantity that ends a stage when it has come above or below a value."""

    above: Number | None = Field(
        None, description="the stage ends when the quantity is at least this"
    )
    below: Number | None = Field(
        None, description="the stage ends when the quantity is at most this"
    )

    @model_validator(mode="after")
    def _one_bound(self) -> Self:
        if (self.above is None) == (self.below is None):
            has = "neither" if self.above is None else "both"
            raise Refused(
                (),
                f"has {has} above and below" if has == "both" else "has neither above nor below",
                "give one of the two",
            )
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
    axis: AnyAxis = Field(
        description="x or y [m], or spin: the angle by which it has turned, counter-clockwise [rad]"
    )


class ForceEnd(BoundEnd):
    """Mean force of the grains on a wall at which a stage ends."""

    wall: Name = Field(description="the wall")
    axis: AnyAxis = Field(
        description="component of the force, x or y [N], or spin: the torque [N m]"
    )
    window: Time = Field(description=_WINDOW)


class StressEnd(BoundEnd):
    """Mean force of the grains on a wall over its length at which a stage ends."""

    wall: Name = Field(description="the wall")
    axis: Axis = Field(description="component of the force")
    window: Time = Field(description=_WINDOW)


class SteadyEnd(Table):
    """A quantity whose mean has to drift no longer for the stage to end."""

    of: Literal["kinetic_energy", "force", "stress", "friction"] = Field(
        description=(
            'what is watched: "kinetic_energy", or of a wall "force", "stress" or "friction": the '
            "force along axis over that across it"
        )
    )
    wall: Name | None = Field(None, description="the wall, for all but the kinetic energy")
    axis: AnyAxis | None = Field(
        None,
        description=(
            'component of the force: "x", "y", or for the force of a wall "spin", its torque'
        ),
    )
    window: Time = Field(
        description=(
            "span of time whose two halves are compared [s]: long enough for a mean as sure as "
            "the tolerance"
        )
    )
    tolerance: Ratio = Field(
        description=(
            "largest drift between the halves over the mean, its uncertainty included, as 0.05"
        )
    )
    after: Annotated[float, Field(ge=0.0, le=1e12)] = Field(
        0.0, description="time since the start of the stage that is left out [s]"
    )

    @model_validator(mode="after")
    def _is_of_something(self) -> Self:
        given = {"wall": self.wall is not None, "axis": self.axis is not None}
        for key, is_given in given.items():
            if self.of == "kinetic_energy" and is_given:
                raise Refused(
                    (key,),
                    f"{key} has no meaning for the kinetic energy, which is that of all grains",
                    "remove it",
                )
            if self.of != "kinetic_energy" and not is_given:
                raise Refused((), f'{key} is missing, which of = "{self.of}" needs', f"add {key}")
        if self.axis == "spin" and self.of != "force":
            raise Refused(
                ("axis",),
                f'of = "{self.of}" has no component "spin"',
                'use "x" or "y", or of = "force"',
            )
        return self


class UntilStrain(Table):
    """Ends at a shear strain: relative displacement of two walls in x over their distance in y."""

    strain: StrainEnd = Field(description='{ walls = ["bottom", "top"], value = 1.5 }')


class UntilRest(Table):
    """Ends when the grains have come to rest."""

    kinetic_energy_ratio: Ratio = Field(
        description=(
            "share of the stage's largest kinetic energy at which it ends, as 1e-6; where nothing "
            "ever moves, the stage ends with its duration"
        )
    )


class UntilAxialStrain(Table):
    """Ends at an axial strain: distance of two walls over that at the start of the stage, less
    1.
    """

    axial_strain: AxialStrainEnd = Field(
        description='{ walls = ["bottom", "top"], axis = "y", below = -0.05 }: 5 % nearer'
    )


class UntilDisplacement(Table):
    """Ends at a displacement of a wall since the start of the stage."""

    displacement: DisplacementEnd = Field(description='{ wall = "lid", axis = "y", below = -0.01 }')


class UntilForce(Table):
    """Ends when the mean force of the grains on a wall has reached a value."""

    force: ForceEnd = Field(description='{ wall = "lid", axis = "y", above = 5.0, window = 0.01 }')


class UntilStress(Table):
    """Ends when the mean force of the grains on a wall over its length has reached a value
    [N/m].
    """

    stress: StressEnd = Field(
        description='{ wall = "lid", axis = "y", above = 500.0, window = 0.01 }'
    )


class UntilSteady(Table):
    """Ends when the mean of a quantity no longer drifts."""

    steady: SteadyEnd = Field(
        description='{ of = "friction", wall = "top", axis = "x", window = 0.5, tolerance = 0.05 }'
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
        "strain",
        "kinetic_energy_ratio",
        "axial_strain",
        "displacement",
        "force",
        "stress",
        "steady",
    ),
]
AnyUntil = (
    UntilStrain
    | UntilRest
    | UntilAxialStrain
    | UntilDisplacement
    | UntilForce
    | UntilStress
    | UntilSteady
)


def window_of(until: AnyUntil | None) -> float | None:
    """Time after which the first window of a condition ends [s]; None if it has none."""
    _, end = next(iter(until)) if until is not None else ("", None)
    return (
        getattr(end, "after", 0.0) + end.window
        if isinstance(end, ForceEnd | StressEnd | SteadyEnd)
        else None
    )


def walls_of(until: AnyUntil | None) -> dict[tuple[str | int, ...], str]:
    """Walls that a condition names, by the keys inside ``until`` that name them."""
    key, end = next(iter(until)) if until is not None else ("", None)
    if isinstance(end, StrainEnd | AxialStrainEnd):
        return {(key, "walls", k): name for k, name in enumerate(end.walls)}
    wall = getattr(end, "wall", None)  # a few conditions are about all grains
    return {} if wall is None else {(key, "wall"): wall}


# ---- What moves a degree of freedom of a wall: a table of `drives.NAME`

_FORMS = "a number, or a table with ramp, sine or times"
_NEARLY = 1e-9  # of the largest value of a signal, which counts as 0


class VelocityDof(Table):
    """A prescribed velocity."""

    velocity: Signal = Field(description=f"velocity [m/s], spin [rad/s]: {_FORMS}")


class PositionDof(Table):
    """A prescribed displacement."""

    position: Signal = Field(
        description=(
            "displacement since the start of the stage that says so [m], angle [rad] for the "
            "spin, 0 at first: a table with ramp, sine or times"
        )
    )

    @model_validator(mode="after")
    def _starts_at_zero(self) -> Self:
        signal = self.position
        first = first_level(signal)
        if abs(first) <= _NEARLY * max(map(abs, levels(signal))):
            return self
        if isinstance(signal, SineSignal):
            remedy = f"add mean = {signal.sine.mean - first:g} to the sine, or use phase = 0"
        else:
            remedy = f"begin with 0: subtract {first:g} from all values, or use a ramp from 0"
        raise Refused(
            ("position",),
            f"displacements count from the start of the stage, but this one begins with {first:g}",
            remedy,
        )


class Spring(Table):
    """A linear spring that is fixed to an anchor."""

    stiffness: float = Field(
        gt=0.0, le=1e15, description="stiffness k [N/m], [N m/rad] for the spin"
    )
    anchor: Signal = Field(
        0.0,
        description=(
            "displacement since the start of the stage that says so at which the spring exerts no "
            f"force [m], [rad] for the spin: {_FORMS}; one that varies pulls the wall along"
        ),
    )


class LoadDof(Table):
    """A degree of freedom that moves under loads, a spring and the grains' push."""

    force: Signal | None = Field(
        None, description=f"force [N], torque [N m] for the spin: {_FORMS}"
    )
    stress: Signal | None = Field(
        None,
        description=(
            f"force per length [N/m], positive along the axis like a force: {_FORMS}; the length "
            "is that of the wall"
        ),
    )
    between: TwoWalls | None = Field(
        None,
        description=(
            "two walls whose distance across the axis is, in each step, the length on which the "
            "stress acts, as "
            '["bottom", "top"] for a side wall that moves in x'
        ),
    )
    spring: Spring | None = Field(
        None, description="a spring, as { stiffness = 1e3 }; a force beside it is added"
    )
    damping: float = Field(
        0.0, ge=0.0, le=1e12, description="viscous damping [N s/m], [N m s] for the spin"
    )

    @model_validator(mode="after")
    def _fit_together(self) -> Self:
        if self.force is not None and self.stress is not None:
            raise Refused(("stress",), "both force and stress are given", "give one of them")
        if self.between is not None and self.stress is None:
            raise Refused(
                ("between",),
                "between has no meaning without stress",
                "add stress [N/m], or remove it",
            )
        if self.between is not None and self.between[0] == self.between[1]:
            raise Refused(
                ("between",), f"'{self.between[0]}' is named twice", "name two different walls"
            )
        return self


class FixedDof(Table):
    """A degree of freedom that does not move."""

    fixed: Annotated[bool, true_only("fixed", "give velocity or force instead")] = Field(
        description="true: does not move", json_schema_extra={"const": True}
    )


Dof = Annotated[
    Annotated[VelocityDof, Tag("<velocity>")]
    | Annotated[PositionDof, Tag("<position>")]
    | Annotated[LoadDof, Tag("<load>")]
    | Annotated[FixedDof, Tag("<fixed>")],
    one_of(
        "a degree of freedom is a table with",
        "velocity",
        "position",
        "force",
        "stress",
        "spring",
        "fixed",
        more=" (a spring may have a force or stress beside it)",
        tags={"force": "load", "stress": "load", "spring": "load"},
    ),
]
AnyDof = VelocityDof | PositionDof | LoadDof | FixedDof


class WallDrives(Table):
    """``drives.NAME``: what a stage does to the wall NAME; what is left out keeps its drive."""

    x: Dof | None = Field(
        None,
        description=(
            "horizontal motion, as { velocity = 0.1 }, { force = -5.0 } or { fixed = true }"
        ),
    )
    y: Dof | None = Field(
        None,
        description="vertical motion, as { velocity = 0.1 }, { force = -5.0 } or { fixed = true }",
    )
    spin: Dof | None = Field(
        None, description="rotation about the wall's reference point, counter-clockwise"
    )
    surface: VelocityDof | None = Field(
        None,
        description=(
            "motion of the surface along itself while the shape stays, as { velocity = 0.1 } "
            "[m/s] of a conveyor: to the right for a grain that the wall carries, along the "
            "normal from wall to grain turned by -90 degrees; a disc turns clockwise, and so does "
            "each of the glued grains of a rough wall, in its place"
        ),
    )

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if self.x is None and self.y is None and self.spin is None and self.surface is None:
            remedy = (
                "name x, y, spin or surface, or remove it: a wall that is not named keeps its drive"
            )
            raise Refused((), "the table is empty", remedy)
        return self

    @model_validator(mode="after")
    def _no_stress_turns(self) -> Self:
        if isinstance(self.spin, LoadDof) and self.spin.stress is not None:
            raise Refused(
                ("spin",),
                "a stress acts along x or y, not on the spin",
                "give the torque [N m] as force",
            )
        return self


def moves(dof: AnyDof) -> bool:
    """Whether a degree of freedom may move at all."""
    if isinstance(dof, VelocityDof | PositionDof):
        return any(value != 0.0 for value in levels(_signal(dof)))
    return isinstance(dof, LoadDof)


def keeps_moving(dof: AnyDof) -> bool:
    """Whether a degree of freedom moves for as long as one waits."""
    if isinstance(dof, PositionDof):
        return isinstance(dof.position, SineSignal) and dof.position.sine.amplitude != 0.0
    if isinstance(dof, VelocityDof):
        values = levels(dof.velocity)
        return any(values) if isinstance(dof.velocity, SineSignal) else values[-1] != 0.0
    return isinstance(dof, LoadDof)


def is_prescribed(dof: AnyDof) -> bool:
    """Whether a degree of freedom moves as it is told, whatever pushes it."""
    return isinstance(dof, VelocityDof | PositionDof)


def _signal(dof: VelocityDof | PositionDof) -> Signal:
    return dof.velocity if isinstance(dof, VelocityDof) else dof.position


# ---- `gravity` of a loading stage: a vector of signals, or a direction that tilts


class TiltedGravityTable(Table):
    """Gravity of a given magnitude whose direction is turned."""

    angle: Signal = Field(
        description=(
            "angle by which gravity is turned from -y, counter-clockwise, so that it points "
            "towards +x if positive [degrees]: a number, or a table with ramp, sine or times"
        )
    )
    magnitude: Signal | None = Field(
        None,
        description=(
            "acceleration [m/s²]: a number, or a table with ramp, sine or times; default: that of "
            "[domain] gravity"
        ),
    )


GravityVector = Annotated[tuple[Signal, Signal], Strict(False)]
StageGravityTable = Annotated[
    Annotated[GravityVector, Tag("<plain>")] | Annotated[TiltedGravityTable, Tag("<table>")],
    Discriminator(tag_table),
]
AnyStageGravity = GravityVector | TiltedGravityTable


# ---- Thermal conditions of walls, and which of them holds in which stage.
#
# A wall that a stage does not name keeps its condition, at first that of its `[[walls]]` table, or
# insulated. A signal counts from the start of the stage that names it (that of the `[[walls]]`
# table from the start of the run): kept it goes on where it is, named again it starts anew.


def _check_kelvin_signal(signal: AnySignal) -> AnySignal:
    for value in _extremes(signal):
        check_kelvin(value)
    return signal


def _extremes(signal: AnySignal) -> tuple[float, ...]:
    if isinstance(signal, RampSignal):
        return signal.ramp
    if isinstance(signal, SineSignal):
        return signal.sine.mean - abs(signal.sine.amplitude), signal.sine.mean + abs(
            signal.sine.amplitude
        )
    if isinstance(signal, TableSignal):
        return signal.values
    return (signal,)


class TemperatureCondition(Table):
    """A wall of prescribed temperature."""

    temperature: Annotated[Signal, AfterValidator(_check_kelvin_signal)] = Field(
        description="temperature [K]: a number, or a table with ramp, sine or times"
    )


class FlowCondition(Table):
    """A wall that gives a prescribed heat flow to the grains that touch it."""

    flow: Signal = Field(
        description=(
            "heat flow from the wall into the grains that touch it, shared in proportion to their "
            "conductances [W]: a number, or a table with ramp, sine or times"
        )
    )


class CapacityCondition(Table):
    """A wall that is a body with a temperature of its own, which heat and friction change."""

    capacity: Annotated[float, Field(ge=1e-18, le=1e18)] = Field(
        description=(
            "heat capacity of the wall [J/K]: it has one temperature, which what it exchanges "
            "with grains changes"
        )
    )
    initial: Kelvin | None = Field(
        None,
        description=(
            "its temperature when this condition begins [K]; default: that before, if it had one, "
            "else that of [heat]"
        ),
    )


class InsulatedCondition(Table):
    """A wall that exchanges no heat; a grain that rubs on it gets all the heat of friction."""

    insulated: Annotated[bool, true_only("insulated", "give temperature or flow instead")] = Field(
        description="true: no heat passes", json_schema_extra={"const": True}
    )


WallCondition = Annotated[
    Annotated[TemperatureCondition, Tag("<temperature>")]
    | Annotated[FlowCondition, Tag("<flow>")]
    | Annotated[CapacityCondition, Tag("<capacity>")]
    | Annotated[InsulatedCondition, Tag("<insulated>")],
    one_of("a thermal condition is a table with", "temperature", "flow", "capacity", "insulated"),
]
AnyCondition = TemperatureCondition | FlowCondition | CapacityCondition | InsulatedCondition


class KeptCondition(NamedTuple):
    """A wall's thermal condition, and index of the stage from whose start its signal counts."""

    condition: AnyCondition
    stage: int


def resolve_conditions(
    loading: Sequence[Stage], first: Mapping[str, AnyCondition | None], wall_names: Sequence[str]
) -> list[list[KeptCondition]]:
    """Thermal conditions by stage and wall; ``first``: that of a wall's table, None: insulated."""
    current = [
        KeptCondition(first[name] or InsulatedCondition(insulated=True), 0) for name in wall_names
    ]
    resolved = []
    for number, stage in enumerate(loading):
        current = [
            KeptCondition(stage.thermal[name], number) if name in stage.thermal else before
            for name, before in zip(wall_names, current, strict=True)
        ]
        resolved.append(current)
    return resolved


# ---- Stages


class Stage(Table):
    """One entry of ``[[loading]]``; the stages follow each other in time."""

    name: Name | None = Field(None, description="name of the stage")
    duration: Time | None = Field(
        None,
        description=(
            "length of the stage [s], to which its last step is cut; with until: its upper bound"
        ),
    )
    until: Until | None = Field(
        None,
        description=(
            "condition that ends the stage: strain, kinetic_energy_ratio, axial_strain, "
            "displacement, force, stress or steady"
        ),
    )
    on_timeout: Annotated[Literal["go on", "stop"], CHANGEABLE] = Field(
        "go on",
        description=(
            'what happens if duration is over before until holds: "go on" with the next stage, or '
            '"stop" the run (exit code 4; "go on" continues it)'
        ),
    )
    dt: TimeStep | None = Field(
        None,
        description=(
            'time step of this stage [s], or "auto"; default: that of [solver]. In a frozen '
            "stage: interval at which "
            "temperatures are evaluated [s], the least between frames and rows; default: the "
            "smaller interval of [output]"
        ),
    )
    solver: StageSolver | None = Field(
        None, description="tolerances of [solver] to override in this stage"
    )
    drives: dict[Name, WallDrives] = Field(
        default_factory=dict,
        max_length=1000,
        description=(
            "drives.NAME = { x = ..., y = ..., spin = ..., surface = ... } for the wall NAME"
        ),
    )
    contacts: Annotated[tuple[PairFriction, ...], Strict(False)] = Field(
        (),
        max_length=1000,
        description=(
            'friction from this stage on, as [{ pair = ["glass", "*"], friction = 0.0 }]; pairs '
            "that are not covered keep theirs, and so do restitution, adhesion and rolling_friction"
        ),
    )
    gravity: StageGravityTable | None = Field(
        None,
        description=(
            "gravity from this stage on: [gx, gy] [m/s²], each a number or a table with ramp, "
            "sine or times, or { angle = ..., magnitude = ... }, the angle in degrees from -y "
            "towards +x; default: as at the end of the stage before"
        ),
    )
    thermal: dict[Name, WallCondition] = Field(
        default_factory=dict,
        max_length=1000,
        description=(
            "thermal.NAME = { temperature = ... }, { flow = ... } or { insulated = true } for the "
            "wall NAME, from here on"
        ),
    )
    frozen: bool = Field(
        False,
        description="whether the grains and walls stand still while the heat goes on; needs [heat]",
    )
    heat: bool | None = Field(
        None,
        description=(
            "whether temperatures change in this stage; default: they do if there is a table [heat]"
        ),
    )

    @model_validator(mode="after")
    def _ends(self) -> Self:
        if self.duration is None and self.until is None:
            raise Refused((), "the stage has no end", "give duration [s] or until")
        if self.duration is None and not isinstance(self.until, UntilStrain):
            raise Refused(
                ("until",),
                "a stage that waits for this may never end",
                "give duration [s] too, as its upper bound",
            )
        window = window_of(self.until)
        if window is not None and self.duration is not None and window > self.duration:
            what = f"no window of {window:g} s ends within the duration of {self.duration:g} s"
            raise Refused(("until",), what, "use shorter windows, or a longer duration")
        return self

    @model_validator(mode="after")
    def _may_time_out(self) -> Self:
        if self.on_timeout == "stop" and (self.until is None or self.duration is None):
            missing = (
                "until: its duration is no upper bound"
                if self.until is None
                else "duration: it cannot run out of time"
            )
            raise Refused(
                ("on_timeout",),
                f'on_timeout = "stop" has no effect without {missing}',
                "add it, or remove on_timeout",
            )
        return self

    @model_validator(mode="after")
    def _still(self) -> Self:
        if not self.frozen:
            return self
        if self.dt == "auto":
            raise Refused(
                ("dt",),
                "there is no automatic time step with frozen = true",
                "give the interval at which temperatures are evaluated [s], or remove dt",
            )
        if self.heat is False:
            raise Refused(
                ("heat",),
                "nothing happens in a stage with frozen = true and heat = false",
                "remove one of the two",
            )
        for key in ("until", "drives", "contacts", "gravity", "solver"):
            if getattr(self, key):
                raise Refused(
                    (key,),
                    f"{key} has no meaning with frozen = true: nothing moves",
                    f"remove {key} or frozen",
                )
        return self


def frozen_dt(stage: Stage, output: Output) -> float:
    """Interval at which temperatures are evaluated in a frozen stage [s].

    That of the stage, or the smaller interval of ``output``; shortened to divide the duration.
    """
    assert stage.duration is not None  # a frozen stage has no other end
    assert stage.dt != "auto"  # nor an automatic time step
    longest = (
        stage.dt if stage.dt is not None else min(output.series_interval, output.frame_interval)
    )
    return stage.duration / max(1, math.ceil(stage.duration / longest * (1.0 - 1e-9)))
