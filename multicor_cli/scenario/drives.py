"""What a stage says of walls and gravity: how they move, what pushes them, what heats them.

Whatever of it may vary with time is a signal.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import AfterValidator, Discriminator, Field, Tag, field_validator

from multicor_cli.arithmetic import sin
from multicor_cli.scenario.base import (
    NUMBER_BOUNDS,
    TIME_BOUNDS,
    Array,
    Column,
    Kelvin,
    Number,
    Pair,
    Table,
    Time,
    TwoWalls,
    Vector,
    ascending,
    check_kelvin,
    columns_of_file,
    exactly_one,
    one_of,
    optional,
    required,
    tag_table,
    true_only,
)
from multicor_cli.scenario.problems import Refused

# ---- Values that vary with time


class RampSignal(Table):
    """Linear from the first to the second value within ``duration``, then constant."""

    ramp: Vector = required("first and last value")
    duration: Time = required("time from the first to the last value [s]")


class SineWave(Table):
    """``mean + amplitude sin(2π t/period + phase)``."""

    mean: Number = optional("the constant part, in the unit of what follows the signal", 0.0)
    amplitude: Number = required(
        "what the sine adds to or takes from the mean at most, in the same unit"
    )
    period: Time | None = optional("time of one oscillation [s]; or give frequency")
    frequency: Time | None = optional("oscillations in a second [1/s]; or give period")
    phase: Annotated[float, Field(ge=-1e6, le=1e6)] = optional(
        "angle of the sine at the start of the stage [rad]", 0.0
    )

    def faults(self) -> Iterator[Refused]:
        remedy = "give one of them: period [s] or frequency [1/s]"
        yield from exactly_one(self, "period", "frequency", remedy)

    @property
    def cycle(self) -> float:
        """The period [s]."""
        return self.period if self.period is not None else 1.0 / self.frequency  # type: ignore[operator]


class SineSignal(Table):
    """A sine of the time since the start of the stage."""

    sine: SineWave = required(
        "{ mean = 0, amplitude, period or frequency, phase = 0 }, in s or 1/s, phase in rad"
    )


class TableSignal(Table):
    """Linear between the rows of a table, constant before the first and after the last."""

    file: str | None = optional(
        "CSV file with the columns time [s] and value, in place of the two arrays"
    )
    times: Array[Annotated[float, Field(ge=TIME_BOUNDS[0], le=TIME_BOUNDS[1])]] = optional(
        "times since the start of the stage [s], ascending", (), max_length=100_000
    )
    values: Array[Number] = optional("value at each of the times", (), max_length=100_000)

    _read = columns_of_file(
        times=Column({"time": 1.0}, TIME_BOUNDS), values=Column({"value": 1.0}, NUMBER_BOUNDS)
    )
    _ascending = field_validator("times")(ascending("times"))

    def faults(self) -> Iterator[Refused]:
        if not self.times:
            yield Refused((), "a table needs one row at least", "give times and values, or file")
        if len(self.times) != len(self.values):
            what = f"{len(self.values)} values for {len(self.times)} times"
            yield Refused(("values",), what, "give one value per time")


Signal = Annotated[
    Annotated[Number, Tag("<plain>")]
    | Annotated[RampSignal, Tag("<ramp>")]
    | Annotated[SineSignal, Tag("<sine>")]
    | Annotated[TableSignal, Tag("<times>")],
    one_of(
        "a signal is a number or a table with", "ramp, sine, times, file", tags={"file": "times"}
    ),
]


def first_level(signal: Signal) -> float:
    """Value of a signal at the time 0."""
    if isinstance(signal, SineSignal):
        return signal.sine.mean + signal.sine.amplitude * sin(signal.sine.phase)
    return levels(signal)[0]


def levels(signal: Signal) -> tuple[float, ...]:
    """Values that tell whether a signal is always zero; last the one where it ends, if it does."""
    if isinstance(signal, RampSignal):
        return signal.ramp
    if isinstance(signal, SineSignal):
        return signal.sine.mean, signal.sine.amplitude
    if isinstance(signal, TableSignal):
        return signal.values
    return (signal,)


# ---- What moves a degree of freedom of a wall: a table of `drives.NAME`

_FORMS = "a number, or a table with ramp, sine or times"
_NEARLY = 1e-9  # of the largest value of a signal, which counts as 0


class VelocityDof(Table):
    """A prescribed velocity."""

    velocity: Signal = required(f"velocity [m/s], spin [rad/s]: {_FORMS}")


class PositionDof(Table):
    """A prescribed displacement."""

    position: Signal = required(
        "displacement since the start of the stage that says so [m], angle [rad] for the "
        "spin, 0 at first: a table with ramp, sine or times"
    )

    def faults(self) -> Iterator[Refused]:
        first = first_level(self.position)
        if abs(first) > _NEARLY * max(map(abs, levels(self.position))):
            remedy = f"begin with 0: subtract {first:g} from all values, or use a ramp from 0"
            if isinstance(self.position, SineSignal):
                mean = self.position.sine.mean - first
                remedy = f"add mean = {mean:g} to the sine, or use phase = 0"
            what = "displacements count from the start of the stage, but this one begins with"
            yield Refused(("position",), f"{what} {first:g}", remedy)


class Spring(Table):
    """A linear spring that is fixed to an anchor."""

    stiffness: float = required("stiffness k [N/m], [N m/rad] for the spin", gt=0.0, le=1e15)
    anchor: Signal = optional(
        "displacement since the start of the stage that says so at which the spring exerts no "
        f"force [m], [rad] for the spin: {_FORMS}; one that varies pulls the wall along",
        0.0,
    )


class LoadDof(Table):
    """A degree of freedom that moves under loads, a spring and the grains' push."""

    force: Signal | None = optional(f"force [N], torque [N m] for the spin: {_FORMS}")
    stress: Signal | None = optional(
        f"force per length [N/m], positive along the axis like a force: {_FORMS}; the length "
        "is that of the wall"
    )
    between: TwoWalls | None = optional(
        "two walls whose distance across the axis is, in each step, the length on which the "
        'stress acts, as ["bottom", "top"] for a side wall that moves in x'
    )
    spring: Spring | None = optional("a spring, as { stiffness = 1e3 }; a force beside it is added")
    damping: float = optional("viscous damping [N s/m], [N m s] for the spin", 0.0, ge=0.0, le=1e12)

    def faults(self) -> Iterator[Refused]:
        if self.force is not None and self.stress is not None:
            yield Refused(("stress",), "both force and stress are given", "give one of them")
        if self.between is not None and self.stress is None:
            what = "between has no meaning without stress"
            yield Refused(("between",), what, "add stress [N/m], or remove it")
        if self.between is not None and self.between[0] == self.between[1]:
            what = f"'{self.between[0]}' is named twice"
            yield Refused(("between",), what, "name two different walls")


class FixedDof(Table):
    """A degree of freedom that does not move."""

    fixed: Annotated[bool, true_only("fixed", "give velocity or force instead")] = required(
        "true: does not move", json_schema_extra={"const": True}
    )


Dof = Annotated[
    Annotated[VelocityDof, Tag("<velocity>")]
    | Annotated[PositionDof, Tag("<position>")]
    | Annotated[LoadDof, Tag("<load>")]
    | Annotated[FixedDof, Tag("<fixed>")],
    one_of(
        "a degree of freedom is a table with",
        "velocity, position, force, stress, spring, fixed",
        more=" (a spring may have a force or stress beside it)",
        tags={"force": "load", "stress": "load", "spring": "load"},
    ),
]


class WallDrives(Table):
    """``drives.NAME``: what a stage does to the wall NAME; what is left out keeps its drive."""

    x: Dof | None = optional(
        "horizontal motion, as { velocity = 0.1 }, { force = -5.0 } or { fixed = true }"
    )
    y: Dof | None = optional(
        "vertical motion, as { velocity = 0.1 }, { force = -5.0 } or { fixed = true }"
    )
    spin: Dof | None = optional("rotation about the wall's reference point, counter-clockwise")
    surface: VelocityDof | None = optional(
        "motion of the surface along itself while the shape stays, as { velocity = 0.1 } "
        "[m/s] of a conveyor: to the right for a grain that the wall carries, along the "
        "normal from wall to grain turned by -90 degrees; a disc turns clockwise, and so does "
        "each of the glued grains of a rough wall, in its place"
    )

    def faults(self) -> Iterator[Refused]:
        if self.x is None and self.y is None and self.spin is None and self.surface is None:
            remedy = (
                "name x, y, spin or surface, or remove it: a wall that is not named keeps its drive"
            )
            yield Refused((), "the table is empty", remedy)
        if isinstance(self.spin, LoadDof) and self.spin.stress is not None:
            what = "a stress acts along x or y, not on the spin"
            yield Refused(("spin",), what, "give the torque [N m] as force")


def moves(dof: Dof | CellDof) -> bool:
    """Whether a degree of freedom may move at all."""
    match dof:
        case VelocityDof(velocity=signal) | PositionDof(position=signal) | RateDof(rate=signal):
            return any(levels(signal))
    return isinstance(dof, LoadDof | StressDof)


def keeps_moving(dof: Dof | CellDof) -> bool:
    """Whether a degree of freedom moves for as long as one waits."""
    match dof:
        case PositionDof(position=signal):
            return isinstance(signal, SineSignal) and signal.sine.amplitude != 0.0
        case VelocityDof(velocity=signal) | RateDof(rate=signal):
            values = levels(signal)
            return any(values) if isinstance(signal, SineSignal) else values[-1] != 0.0
    return isinstance(dof, LoadDof | StressDof)


def is_prescribed(dof: Dof) -> bool:
    """Whether a degree of freedom moves as it is told, whatever pushes it."""
    return isinstance(dof, VelocityDof | PositionDof)


# ---- What strains or loads a cell: the table `cell`


class RateDof(Table):
    """A prescribed rate of strain."""

    rate: Signal = required(f"rate of strain [1/s], positive where the cell grows: {_FORMS}")


class StressDof(Table):
    """A component that changes under a stress and the grains' own."""

    stress: Signal = required(
        "stress, a force per length [N/m]: of xx and yy positive in compression, of xy positive "
        f"where it shears towards positive rates: {_FORMS}"
    )


CellDof = Annotated[
    Annotated[RateDof, Tag("<rate>")] | Annotated[StressDof, Tag("<stress>")],
    one_of("a component of the cell is a table with", "rate, stress"),
]
_OF_CELL = "as { stress = 100.0 } or { rate = 0.0 }; at first its rate is 0"


class CellDrives(Table):
    """``cell``: what a stage does to a cell; components that are left out keep their drive."""

    xx: CellDof | None = optional(f"strain of the width, {_OF_CELL}")
    yy: CellDof | None = optional(f"strain of the height, {_OF_CELL}")
    xy: CellDof | None = optional(f"shear dvx/dy, {_OF_CELL}")

    def faults(self) -> Iterator[Refused]:
        if self.xx is None and self.yy is None and self.xy is None:
            remedy = "name xx, yy or xy, or remove it: what is not named keeps its drive"
            yield Refused((), "the table is empty", remedy)


# ---- `gravity` of a loading stage: a vector of signals, or a direction that tilts


class TiltedGravityTable(Table):
    """Gravity of a given magnitude whose direction is turned."""

    angle: Signal = required(
        "angle by which gravity is turned from -y, counter-clockwise, so that it points "
        "towards +x if positive [degrees]: a number, or a table with ramp, sine or times"
    )
    magnitude: Signal | None = optional(
        "acceleration [m/s²]: a number, or a table with ramp, sine or times; default: that of "
        "[domain] gravity"
    )


GravityVector = Pair[Signal]
StageGravityTable = Annotated[
    Annotated[GravityVector, Tag("<plain>")] | Annotated[TiltedGravityTable, Tag("<table>")],
    Discriminator(tag_table),
]


# ---- Thermal conditions of walls


def _check_kelvin_signal(signal: Signal) -> Signal:
    extremes = levels(signal)
    if isinstance(signal, SineSignal):
        mean, amplitude = signal.sine.mean, abs(signal.sine.amplitude)
        extremes = mean - amplitude, mean + amplitude
    for value in extremes:
        check_kelvin(value)
    return signal


class TemperatureCondition(Table):
    """A wall of prescribed temperature."""

    temperature: Annotated[Signal, AfterValidator(_check_kelvin_signal)] = required(
        "temperature [K]: a number, or a table with ramp, sine or times"
    )


class FlowCondition(Table):
    """A wall that gives a prescribed heat flow to the grains that touch it."""

    flow: Signal = required(
        "heat flow from the wall into the grains that touch it, shared in proportion to their "
        "conductances [W]: a number, or a table with ramp, sine or times"
    )


class CapacityCondition(Table):
    """A wall that is a body with a temperature of its own, which heat and friction change."""

    capacity: Annotated[float, Field(ge=1e-18, le=1e18)] = required(
        "heat capacity of the wall [J/K]: it has one temperature, which what it exchanges "
        "with grains changes"
    )
    initial: Kelvin | None = optional(
        "its temperature when this condition begins [K]; default: that before, if it had one, "
        "else that of [heat]"
    )


class InsulatedCondition(Table):
    """A wall that exchanges no heat; a grain that rubs on it gets all the heat of friction."""

    insulated: Annotated[bool, true_only("insulated", "give temperature or flow instead")] = (
        required("true: no heat passes", json_schema_extra={"const": True})
    )


WallCondition = Annotated[
    Annotated[TemperatureCondition, Tag("<temperature>")]
    | Annotated[FlowCondition, Tag("<flow>")]
    | Annotated[CapacityCondition, Tag("<capacity>")]
    | Annotated[InsulatedCondition, Tag("<insulated>")],
    one_of("a thermal condition is a table with", "temperature, flow, capacity, insulated"),
]
