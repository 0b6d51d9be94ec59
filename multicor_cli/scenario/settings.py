"""The single tables: ``[scenario]``, ``[domain]``, ``[solver]``, ``[output]``."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag

from multicor_cli.scenario.base import (
    CHANGEABLE,
    Array,
    Formerly,
    LengthPair,
    Number,
    Table,
    Time,
    Tolerance,
    Vector,
    optional,
    required,
    tag_word,
)
from multicor_cli.scenario.problems import Refused

MAX_SWEEPS = 10_000_000
Seed = Annotated[
    Annotated[int, Field(ge=0, le=2**63 - 1), Tag("<plain>")]
    | Annotated[Literal["random"], Tag("<word>")],
    Discriminator(tag_word),
]


TimeStep = Annotated[
    Annotated[Time, Tag("<plain>")] | Annotated[Literal["auto"], Tag("<word>")],
    Discriminator(tag_word),
]
"""A time step [s], or ``"auto"``: see `multicor_cli.running.time_step`."""

ACCURACIES = {"draft": 2.0, "normal": 1.0, "fine": 0.5}
"""Errors of an automatic time step over those of the default, by name."""

Accuracy = Annotated[
    Annotated[Annotated[float, Field(ge=0.01, le=4.0)], Tag("<plain>")]
    | Annotated[Literal["draft", "normal", "fine"], Tag("<word>")],
    Discriminator(tag_word),
]


class Header(Table):
    """``[scenario]``: what this is."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100)] = required(
        "name of the scenario and of its run directory: letters, digits and . _ -"
    )
    description: Annotated[str, CHANGEABLE] = optional(
        "what the scenario is about", "", max_length=10_000
    )
    seed: Seed = required('seed of all random numbers, or "random": drawn once and recorded')


def _check_axes(axes: bool | tuple[str, ...]) -> bool | tuple[str, ...]:
    """True or false, and ``("x", "y")`` of a cell: all that there is to say of directions."""
    if isinstance(axes, bool):
        return axes
    if len(set(axes)) < len(axes):
        raise Refused((), "a direction is named twice", "name each direction once")
    if axes == ("y",):
        what = '["y"]: a domain repeats in x, or in x and y, but not in y alone'
        raise Refused((), what, "turn the scenario by 90 degrees, walls and gravity included")
    return ("x", "y") if len(axes) == 2 else bool(axes)


def _tag_axes(value: Any) -> str:
    return "<array>" if isinstance(value, list | tuple) else "<plain>"


Periodic = Annotated[
    Annotated[bool, Tag("<plain>")]
    | Annotated[Annotated[Array[Literal["x", "y"]], Field(max_length=2)], Tag("<array>")],
    Discriminator(_tag_axes),
    AfterValidator(_check_axes),
]


class CellRates(Table):
    """The velocity gradient with which a cell begins."""

    xx: Number = optional("of the width [1/s]", 0.0)
    yy: Number = optional("of the height [1/s]", 0.0)
    xy: Number = optional("shear rate, of v_x along y [1/s]", 0.0)


class Domain(Table):
    """``[domain]``: the rectangle [0, w] × [0, h] and what acts everywhere in it."""

    size: LengthPair = required(
        "width and height [m]: where grains are placed; the width is the period if periodic; of a "
        "cell the size at the start"
    )
    periodic: Periodic = optional(
        'directions in which the domain repeats: true or ["x"], false, or ["x", "y"]: a cell '
        "without walls, which stages strain or load with cell = { ... }",
        False,
    )
    cell_inertia: float | None = optional(
        "of a cell: its inertia over that of the grains, the sum of m d² with the mean diameter d; "
        "the larger, the slower it follows a stress; default: 1",
        ge=1e-3,
        le=1e3,
    )
    cell_rates: CellRates | None = optional(
        "of a cell: the rates with which it begins, as { xy = 10.0 }: those of the mean flow that "
        "velocities of [[particles]] hold; default: none"
    )
    gravity: Vector = optional("acceleration of gravity [m/s²]", (0.0, -9.81))

    lost: Literal["ignore", "stop", "remove"] = optional(
        "what happens to a grain whose center is more than the largest diameter outside of "
        'this rectangle (in x only if it is not periodic): "ignore": nothing; "stop": the run '
        'ends (exit code 4); "remove": it is taken out and counted',
        "ignore",
    )

    @property
    def is_periodic(self) -> bool:
        """Whether it repeats in x; in a cell in y, too."""
        return self.periodic is not False

    @property
    def is_cell(self) -> bool:
        """Whether it repeats in both directions."""
        return isinstance(self.periodic, tuple)

    @property
    def period(self) -> float:
        """Period in x [m]; 0 if the domain is not periodic."""
        return self.size[0] if self.is_periodic else 0.0

    @property
    def periods(self) -> tuple[float, ...]:
        """Periods in x and, of a cell, in y [m]."""
        return self.size if self.is_cell else self.size[:1] if self.is_periodic else ()

    def around(self, margin: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Corners of the domain with a ``margin`` [m]; without limits along a period."""
        x, y = (margin if k >= len(self.periods) else math.inf for k in range(2))
        return (-x, -y), (self.size[0] + x, self.size[1] + y)

    def is_spanned(self, low: float, high: float, axis: int = 0) -> bool:
        """Whether an interval of x (0) or y (1) is the period (to 1e-9); never without one."""
        period = self.periods[axis] if axis < len(self.periods) else 0.0
        return period > 0.0 and abs(high - low - period) <= 1e-9 * period


class Solver(Table):
    """``[solver]``: time step and contact solver."""

    dt: TimeStep = optional(
        'time step [s], or "auto": the largest that resolves the pressure, the shear, the '
        "motion and the periods of signals of each stage",
        "auto",
    )
    accuracy: Accuracy = optional(
        "errors of an automatic time step over those of the default, and its length: a number, "
        'or "draft" (2), "normal" (1) or "fine" (0.5)',
        "normal",
    )
    method: Literal["accelerated", "gauss-seidel"] = optional(
        "global solution of the contacts", "accelerated"
    )
    local: Literal["exact", "bipotential"] = optional("local solution of one contact", "exact")
    tolerance_rms: Annotated[Tolerance, Formerly(1e-3)] = optional(
        "rms of the velocity corrections over the reference velocity", 2e-3
    )
    tolerance_max: Annotated[Tolerance, Formerly(5e-2)] = optional(
        "largest velocity correction over the reference velocity", 0.1
    )
    tolerance_energy: Annotated[Tolerance, Formerly(5e-3)] = optional(
        "energy error over the reference energy", 1e-2
    )
    max_sweeps: Annotated[int, Formerly(10_000)] = optional(
        "largest number of sweeps in a step", 50_000, ge=1, le=MAX_SWEEPS
    )
    on_failure: Literal["warn", "error"] = optional(
        'what to do if a step does not converge: "warn" or "error" (stop)', "warn"
    )
    threads: Annotated[int, CHANGEABLE] = optional(
        "number of threads; 0: all cores", 0, ge=0, le=1024
    )

    @property
    def error_factor(self) -> float:
        """``accuracy`` as a number."""
        return ACCURACIES[self.accuracy] if isinstance(self.accuracy, str) else self.accuracy


class StageSolver(Table):
    """Settings of ``[solver]`` that a stage overrides."""

    accuracy: Accuracy | None = optional(
        "errors of an automatic time step over those of the default"
    )
    tolerance_rms: Tolerance | None = optional(
        "rms of the velocity corrections over the reference velocity"
    )
    tolerance_max: Tolerance | None = optional(
        "largest velocity correction over the reference velocity"
    )
    tolerance_energy: Tolerance | None = optional("energy error over the reference energy")
    max_sweeps: int | None = optional("largest number of sweeps in a step", ge=1, le=MAX_SWEEPS)
    on_failure: Literal["warn", "error"] | None = optional(
        'what to do if a step does not converge: "warn" or "error" (stop)'
    )


def _series_interval(data: dict[str, Any]) -> float:
    """Default time between rows of the time series [s]: ten per frame, one per step at most."""
    return float(data["frame_interval"]) / 10.0


class Output(Table):
    """``[output]``: what is written, and how often."""

    frame_interval: Time = required(
        "time between frames [s]: each comes after the step nearest to its time"
    )
    series_interval: float = optional(
        "time between rows of the time series [s]; default: frame_interval/10, in whole steps",
        default_factory=_series_interval,
        ge=1e-14,
        le=1e12,
    )
    contacts: bool = optional("whether frames hold the contact network", True)
    checkpoint_interval: Annotated[float, CHANGEABLE] = optional(
        "wall-clock time between checkpoints [s]; while the run goes on, what is older than "
        "the last one can be read",
        60.0,
        ge=1e-3,
        le=1e9,
    )
    precision: Literal["double", "single"] = optional("precision of the frames", "double")

    @property
    def has_default_series(self) -> bool:
        """Whether the time between rows is what it would be if the scenario did not give it."""
        return self.series_interval == _series_interval({"frame_interval": self.frame_interval})
