"""Values that vary with time."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, Strict, Tag, field_validator, model_validator

from multicor_cli.scenario.base import Number, Table, Time, Vector, one_of, refuse, require_ascending


class RampSignal(Table):
    """Linear from the first to the second value within ``duration``, then constant."""

    ramp: Vector = Field(description="first and last value")
    duration: Time = Field(description="time from the first to the last value [s]")


class SineWave(Table):
    """``mean + amplitude sin(2π t/period + phase)``."""

    mean: Number = Field(0.0, description="mean value")
    amplitude: Number = Field(description="amplitude")
    period: Time = Field(description="period [s]")
    phase: Annotated[float, Field(ge=-1e6, le=1e6)] = Field(0.0, description="phase [rad]")


class SineSignal(Table):
    """A sine of the time since the start of the stage."""

    sine: SineWave = Field(description="{ mean = 0, amplitude, period, phase = 0 }, period in s, phase in rad")


class TableSignal(Table):
    """Linear between the rows of a table, constant before the first and after the last."""

    times: Annotated[tuple[Annotated[float, Field(ge=0.0, le=1e12)], ...], Strict(False)] = Field(
        min_length=1, max_length=100_000, description="times since the start of the stage [s], ascending"
    )
    values: Annotated[tuple[Number, ...], Strict(False)] = Field(
        min_length=1, max_length=100_000, description="value at each of the times"
    )

    @field_validator("times")
    @classmethod
    def _ascending(cls, times: tuple[float, ...]) -> tuple[float, ...]:
        require_ascending(times, "times")
        return times

    @model_validator(mode="after")
    def _same_length(self) -> Self:
        if len(self.times) != len(self.values):
            raise refuse(f"{len(self.values)} values for {len(self.times)} times", "give one value per time", "values")
        return self


Signal = Annotated[
    Annotated[Number, Tag("<plain>")]
    | Annotated[RampSignal, Tag("<ramp>")]
    | Annotated[SineSignal, Tag("<sine>")]
    | Annotated[TableSignal, Tag("<times>")],
    one_of("a signal is a number or a table with", "ramp", "sine", "times"),
]
AnySignal = float | RampSignal | SineSignal | TableSignal


def levels(signal: AnySignal) -> tuple[float, ...]:
    """Values that tell whether a signal is always zero; the last one is where a ramp or a table ends."""
    if isinstance(signal, RampSignal):
        return signal.ramp
    if isinstance(signal, SineSignal):
        return signal.sine.mean, signal.sine.amplitude
    if isinstance(signal, TableSignal):
        return signal.values
    return (signal,)
