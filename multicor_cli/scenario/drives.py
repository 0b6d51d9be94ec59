"""What a stage says of walls and gravity: how they move, what pushes them, what heats them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import AfterValidator, Discriminator, Field, Tag

from multicor_cli.scenario.base import (
    Kelvin,
    Pair,
    Table,
    TwoWalls,
    check_kelvin,
    one_of,
    optional,
    required,
    tag_table,
    true_only,
)
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.signals import Signal, SineSignal, first_level, levels

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


def moves(dof: Dof) -> bool:
    """Whether a degree of freedom may move at all."""
    if isinstance(dof, VelocityDof | PositionDof):
        return any(levels(dof.velocity if isinstance(dof, VelocityDof) else dof.position))
    return isinstance(dof, LoadDof)


def keeps_moving(dof: Dof) -> bool:
    """Whether a degree of freedom moves for as long as one waits."""
    if isinstance(dof, PositionDof):
        return isinstance(dof.position, SineSignal) and dof.position.sine.amplitude != 0.0
    if isinstance(dof, VelocityDof):
        values = levels(dof.velocity)
        return any(values) if isinstance(dof.velocity, SineSignal) else values[-1] != 0.0
    return isinstance(dof, LoadDof)


def is_prescribed(dof: Dof) -> bool:
    """Whether a degree of freedom moves as it is told, whatever pushes it."""
    return isinstance(dof, VelocityDof | PositionDof)


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
