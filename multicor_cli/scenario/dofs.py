"""What moves a degree of freedom of a wall: a table of ``drives.NAME``."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, Tag, model_validator

from multicor_cli.scenario.base import Table, TwoWalls, one_of, refuse, true_only
from multicor_cli.scenario.signals import Signal, SineSignal, first_level, levels

_FORMS = "a number, or a table with ramp, sine or times"
_NEARLY = 1e-9  # of the largest value of a signal, which counts as 0


class VelocityDof(Table):
    """A prescribed velocity."""

    velocity: Signal = Field(description=f"velocity [m/s], spin [rad/s]: {_FORMS}")


class PositionDof(Table):
    """A prescribed displacement."""

    position: Signal = Field(
        description="displacement since the start of the stage that says so [m], angle [rad] for the spin, 0 at first: a table "
        "with ramp, sine or times"
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
        raise refuse(f"displacements count from the start of the stage, but this one begins with {first:g}", remedy, "position")


class Spring(Table):
    """A linear spring that is fixed to an anchor."""

    stiffness: float = Field(gt=0.0, le=1e15, description="stiffness k [N/m], [N m/rad] for the spin")
    anchor: Signal = Field(
        0.0,
        description="displacement since the start of the stage that says so at which the spring exerts no force [m], [rad] for the "
        f"spin: {_FORMS}; one that varies pulls the wall along",
    )


class LoadDof(Table):
    """A degree of freedom that moves under loads, a spring and the grains' push."""

    force: Signal | None = Field(None, description=f"force [N], torque [N m] for the spin: {_FORMS}")
    stress: Signal | None = Field(
        None, description=f"force per length [N/m], positive along the axis like a force: {_FORMS}; the length is that of the wall"
    )
    between: TwoWalls | None = Field(
        None,
        description="two walls whose distance across the axis is, in each step, the length on which the stress acts, as "
        '["bottom", "top"] for a side wall that moves in x',
    )
    spring: Spring | None = Field(None, description="a spring, as { stiffness = 1e3 }; a force beside it is added")
    damping: float = Field(0.0, ge=0.0, le=1e12, description="viscous damping [N s/m], [N m s] for the spin")

    @model_validator(mode="after")
    def _fit_together(self) -> Self:
        if self.force is not None and self.stress is not None:
            raise refuse("both force and stress are given", "give one of them", "stress")
        if self.between is not None and self.stress is None:
            raise refuse("between has no meaning without stress", "add stress [N/m], or remove it", "between")
        if self.between is not None and self.between[0] == self.between[1]:
            raise refuse(f"'{self.between[0]}' is named twice", "name two different walls", "between")
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

    x: Dof | None = Field(None, description="horizontal motion, as { velocity = 0.1 }, { force = -5.0 } or { fixed = true }")
    y: Dof | None = Field(None, description="vertical motion, as { velocity = 0.1 }, { force = -5.0 } or { fixed = true }")
    spin: Dof | None = Field(None, description="rotation about the wall's reference point, counter-clockwise")
    surface: VelocityDof | None = Field(
        None,
        description="motion of the surface along itself while the shape stays, as { velocity = 0.1 } [m/s] of a conveyor: to the "
        "right for a grain that the wall carries, along the normal from wall to grain turned by -90 degrees; a disc turns "
        "clockwise, and so does each of the glued grains of a rough wall, in its place",
    )

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if self.x is None and self.y is None and self.spin is None and self.surface is None:
            remedy = "name x, y, spin or surface, or remove it: a wall that is not named keeps its drive"
            raise refuse("the table is empty", remedy)
        return self

    @model_validator(mode="after")
    def _no_stress_turns(self) -> Self:
        if isinstance(self.spin, LoadDof) and self.spin.stress is not None:
            raise refuse("a stress acts along x or y, not on the spin", "give the torque [N m] as force", "spin")
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
