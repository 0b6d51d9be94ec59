"""Values that vary with time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field, Tag, field_validator

from multicor_cli.arithmetic import sin
from multicor_cli.scenario.base import (
    NUMBER_BOUNDS,
    TIME_BOUNDS,
    Array,
    Column,
    Number,
    Table,
    Time,
    Vector,
    ascending,
    columns_of_file,
    exactly_one,
    one_of,
    optional,
    required,
)
from multicor_cli.scenario.problems import Refused


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
