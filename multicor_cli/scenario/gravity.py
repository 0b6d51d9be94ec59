"""``gravity`` of a loading stage: a vector of signals, or a direction that tilts."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Strict, Tag

from multicor_cli.scenario.base import Table, tag_table
from multicor_cli.scenario.signals import Signal


class TiltedGravityTable(Table):
    """Gravity of a given magnitude whose direction is turned."""

    angle: Signal = Field(
        description="angle by which gravity is turned from -y, counter-clockwise, so that it points towards +x if positive "
        "[degrees]: a number, or a table with ramp, sine or times"
    )
    magnitude: Signal | None = Field(
        None, description="acceleration [m/s²]: a number, or a table with ramp, sine or times; default: that of [domain] gravity"
    )


GravityVector = Annotated[tuple[Signal, Signal], Strict(False)]
StageGravityTable = Annotated[
    Annotated[GravityVector, Tag("<plain>")] | Annotated[TiltedGravityTable, Tag("<table>")], Discriminator(tag_table)
]
AnyStageGravity = GravityVector | TiltedGravityTable
