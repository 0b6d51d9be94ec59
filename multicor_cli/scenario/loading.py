"""Loading stages: how long they last and how they drive the walls."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, Strict, model_validator

from multicor_cli.scenario.base import FREE, Name, Table, Time, refuse
from multicor_cli.scenario.dofs import WallDrives
from multicor_cli.scenario.gravity import StageGravityTable
from multicor_cli.scenario.materials import PairFriction
from multicor_cli.scenario.settings import Output, StageSolver, TimeStep
from multicor_cli.scenario.until import Until, UntilStrain, window_of
from multicor_cli.scenario.wall_heat import WallCondition


class Stage(Table):
    """One entry of ``[[loading]]``; the stages follow each other in time."""

    name: Name | None = Field(None, description="name of the stage")
    duration: Time | None = Field(
        None, description="length of the stage [s], to which its last step is cut; with until: its upper bound"
    )
    until: Until | None = Field(
        None,
        description="condition that ends the stage: strain, kinetic_energy_ratio, axial_strain, displacement, force, stress or "
        "steady",
    )
    on_timeout: Annotated[Literal["go on", "stop"], FREE] = Field(
        "go on",
        description='what happens if duration is over before until holds: "go on" with the next stage, or "stop" the run (exit '
        'code 4; "go on" continues it)',
    )
    dt: TimeStep | None = Field(
        None,
        description='time step of this stage [s], or "auto"; default: that of [solver]. In a frozen stage: interval at which '
        "temperatures are evaluated [s], the least between frames and rows; default: the smaller interval of [output]",
    )
    solver: StageSolver | None = Field(None, description="tolerances of [solver] to override in this stage")
    drives: dict[Name, WallDrives] = Field(
        default_factory=dict,
        max_length=1000,
        description="drives.NAME = { x = ..., y = ..., spin = ..., surface = ... } for the wall NAME",
    )
    contacts: Annotated[tuple[PairFriction, ...], Strict(False)] = Field(
        (),
        max_length=1000,
        description='friction from this stage on, as [{ pair = ["glass", "*"], friction = 0.0 }]; pairs that are not covered keep '
        "theirs, and so do restitution, adhesion and rolling_friction",
    )
    gravity: StageGravityTable | None = Field(
        None,
        description="gravity from this stage on: [gx, gy] [m/s²], each a number or a table with ramp, sine or times, or "
        "{ angle = ..., magnitude = ... }, the angle in degrees from -y towards +x; default: as at the end of the stage before",
    )
    thermal: dict[Name, WallCondition] = Field(
        default_factory=dict,
        max_length=1000,
        description="thermal.NAME = { temperature = ... }, { flow = ... } or { insulated = true } for the wall NAME, from here on",
    )
    frozen: bool = Field(False, description="whether the grains and walls stand still while the heat goes on; needs [heat]")
    heat: bool | None = Field(
        None, description="whether temperatures change in this stage; default: they do if there is a table [heat]"
    )

    @model_validator(mode="after")
    def _ends(self) -> Self:
        if self.duration is None and self.until is None:
            raise refuse("the stage has no end", "give duration [s] or until")
        if self.duration is None and not isinstance(self.until, UntilStrain):
            raise refuse("a stage that waits for this may never end", "give duration [s] too, as its upper bound", "until")
        window = window_of(self.until)
        if window is not None and self.duration is not None and window > self.duration:
            what = f"no window of {window:g} s ends within the duration of {self.duration:g} s"
            raise refuse(what, "use shorter windows, or a longer duration", "until")
        return self

    @model_validator(mode="after")
    def _may_time_out(self) -> Self:
        if self.on_timeout == "stop" and (self.until is None or self.duration is None):
            missing = "until: its duration is no upper bound" if self.until is None else "duration: it cannot run out of time"
            raise refuse(f'on_timeout = "stop" has no effect without {missing}', "add it, or remove on_timeout", "on_timeout")
        return self

    @model_validator(mode="after")
    def _still(self) -> Self:
        if not self.frozen:
            return self
        if self.dt == "auto":
            raise refuse(
                "there is no automatic time step with frozen = true",
                "give the interval at which temperatures are evaluated [s], or remove dt",
                "dt",
            )
        if self.heat is False:
            raise refuse("nothing happens in a stage with frozen = true and heat = false", "remove one of the two", "heat")
        for key in ("until", "drives", "contacts", "gravity", "solver"):
            if getattr(self, key):
                raise refuse(f"{key} has no meaning with frozen = true: nothing moves", f"remove {key} or frozen", key)
        return self


def frozen_dt(stage: Stage, output: Output) -> float:
    """Interval at which temperatures are evaluated in a frozen stage [s].

    That of the stage, or the smaller interval of ``output``; shortened so that the duration is a whole number of intervals.
    """
    assert stage.duration is not None  # a frozen stage has no other end
    assert stage.dt != "auto"  # nor an automatic time step
    longest = stage.dt if stage.dt is not None else min(output.series_interval, output.frame_interval)
    return stage.duration / max(1, math.ceil(stage.duration / longest * (1.0 - 1e-9)))
