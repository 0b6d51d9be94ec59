"""Thermal conditions of walls, and which of them holds in which stage.

A wall that a stage does not name keeps its condition; at first it has that of its ``[[walls]]`` table, or is insulated. A signal
is a function of the time since the start of the stage that names it: one that is kept goes on where it is, one that is named
again starts anew. That of the ``[[walls]]`` table counts from the start of the run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, NamedTuple

from pydantic import AfterValidator, Field, Tag

from multicor_cli.scenario.base import Kelvin, Table, check_kelvin, one_of, true_only
from multicor_cli.scenario.signals import AnySignal, RampSignal, Signal, SineSignal, TableSignal

if TYPE_CHECKING:
    from multicor_cli.scenario.loading import Stage


def _check_kelvin_signal(signal: AnySignal) -> AnySignal:
    """Every value that the signal takes is a temperature in kelvin."""
    for value in _extremes(signal):
        check_kelvin(value)
    return signal


def _extremes(signal: AnySignal) -> tuple[float, ...]:
    if isinstance(signal, RampSignal):
        return signal.ramp
    if isinstance(signal, SineSignal):
        return signal.sine.mean - abs(signal.sine.amplitude), signal.sine.mean + abs(signal.sine.amplitude)
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
        description="heat flow from the wall into the grains that touch it, shared in proportion to their conductances [W]: "
        "a number, or a table with ramp, sine or times"
    )


class CapacityCondition(Table):
    """A wall that is a body with a temperature of its own, which heat and friction change."""

    capacity: Annotated[float, Field(ge=1e-18, le=1e18)] = Field(
        description="heat capacity of the wall [J/K]: it has one temperature, which what it exchanges with grains changes"
    )
    initial: Kelvin | None = Field(
        None,
        description="its temperature when this condition begins [K]; default: that before, if it had one, else that of [heat]",
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
    """The thermal condition of a wall, and the index of the stage from whose start its signal counts."""

    condition: AnyCondition
    stage: int


def resolve_conditions(
    loading: Sequence[Stage], first: Mapping[str, AnyCondition | None], wall_names: Sequence[str]
) -> list[list[KeptCondition]]:
    """The thermal condition of each wall in each stage, by stage and wall.

    Args:
        loading: The stages in time order.
        first: What the table of each wall says, by name; None: insulated.
        wall_names: Names of the walls in the order wanted.
    """
    current = [KeptCondition(first[name] or InsulatedCondition(insulated=True), 0) for name in wall_names]
    resolved = []
    for number, stage in enumerate(loading):
        current = [
            KeptCondition(stage.thermal[name], number) if name in stage.thermal else before
            for name, before in zip(wall_names, current, strict=True)
        ]
        resolved.append(current)
    return resolved
