"""What drives walls and grains: motion, loads, gravity over a stage; the distance of two walls."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multicor_cli.arithmetic import cos, hypot, sin
from multicor_cli.model.columns import Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.shapes import TAIL, ShapeKind, Tail
from multicor_cli.model.state import State

REVERSAL = 0.01
"""Share of its swing by which a table must turn back to oscillate: measured values are noisy."""


@dataclass(frozen=True)
class Constant:
    """The same value at all times."""

    level: float

    def value(self, t: float) -> float:
        return self.level

    def largest(self) -> float:
        """Largest magnitude at any time."""
        return abs(self.level)

    def steepest(self) -> float:
        """Largest magnitude of its rate of change [1/s]."""
        return 0.0

    def swing(self) -> float:
        """How far apart its values are at most."""
        return 0.0

    def shortest_period(self, start: float, end: float) -> float:
        """Shortest period between the times [s]; infinite if it does not go up and down."""
        return math.inf

    def corners(self, start: float, end: float) -> list[float]:
        """Times in between at which an integrator should begin a new step [s]."""
        return []


@dataclass(frozen=True)
class Sine:
    """``mean + amplitude · sin(2π t/period + phase)``, phase in radians."""

    mean: float
    amplitude: float
    period: float
    phase: float = 0.0

    def value(self, t: float) -> float:
        return self.mean + self.amplitude * sin(2.0 * math.pi * (t / self.period) + self.phase)

    def largest(self) -> float:
        return abs(self.mean) + abs(self.amplitude)

    def steepest(self) -> float:
        return 2.0 * math.pi * abs(self.amplitude) / self.period

    def swing(self) -> float:
        return 2.0 * abs(self.amplitude)

    def shortest_period(self, start: float, end: float) -> float:
        return self.period if self.amplitude else math.inf

    def corners(self, start: float, end: float) -> list[float]:
        """As for `Constant`: 16 in a period."""
        part = self.period / 16.0
        return [k * part for k in range(math.floor(start / part) + 1, math.ceil(end / part))]


@dataclass(frozen=True)
class Interpolated:
    """Linear interpolation between ``(times, values)``; constant before and after them."""

    times: tuple[float, ...]
    values: tuple[float, ...]

    def value(self, t: float) -> float:
        k = bisect.bisect_right(self.times, t)
        if k == 0:
            return self.values[0]
        if k == len(self.times):
            return self.values[-1]
        t0, t1 = self.times[k - 1], self.times[k]
        share = (t - t0) / (t1 - t0)
        return self.values[k - 1] + (self.values[k] - self.values[k - 1]) * share

    def largest(self) -> float:
        return max(abs(value) for value in self.values)

    def steepest(self) -> float:
        rows = list(zip(self.times, self.values, strict=True))
        return max(
            (abs((v1 - v0) / (t1 - t0)) for (t0, v0), (t1, v1) in itertools.pairwise(rows)),
            default=0.0,
        )

    def swing(self) -> float:
        return max(self.values) - min(self.values)

    def shortest_period(self, start: float, end: float) -> float:
        """Twice the shortest time from the middle of a rise to that of the next fall, or back.

        What turns back by no more than `REVERSAL` of the swing belongs to the rise or fall in which
        it lies.
        """
        times = [start, *self.corners(start, end), *([end] if end < math.inf else [])]
        middles = _middles(times, [self.value(t) for t in times], REVERSAL * self.swing())
        return 2.0 * min((b - a for a, b in itertools.pairwise(middles)), default=math.inf)

    def corners(self, start: float, end: float) -> list[float]:
        return list(
            self.times[bisect.bisect_right(self.times, start) : bisect.bisect_left(self.times, end)]
        )


class Ramp(Interpolated):
    """Linear from ``start`` to ``end`` within ``duration`` [s], then ``end``."""

    def __init__(self, start: float, end: float, duration: float) -> None:
        super().__init__((0.0, duration), (start, end))


@dataclass(frozen=True)
class Shifted:
    """A signal of the stage that began ``offset`` [s] before this one; bounds include the past."""

    signal: Constant | Sine | Interpolated
    offset: float

    def value(self, t: float) -> float:
        return self.signal.value(self.offset + t)

    def largest(self) -> float:
        return self.signal.largest()

    def steepest(self) -> float:
        return self.signal.steepest()

    def swing(self) -> float:
        return self.signal.swing()

    def shortest_period(self, start: float, end: float) -> float:
        return self.signal.shortest_period(self.offset + start, self.offset + end)

    def corners(self, start: float, end: float) -> list[float]:
        return [
            t - self.offset for t in self.signal.corners(self.offset + start, self.offset + end)
        ]


Signal = Constant | Sine | Interpolated | Shifted


def _middles(times: Sequence[float], values: Sequence[float], least: float) -> list[float]:
    """When rises and falls of a broken line by more than ``least`` are halfway, in order [s]."""
    turns, farthest, way = [0], 0, 0.0
    for k, value in enumerate(values):
        change = value - values[farthest]
        if way * change > 0.0 or (way and not change) or (not way and abs(change) > least):
            farthest, way = k, way or math.copysign(1.0, change)
        elif abs(change) > least:
            turns.append(farthest)
            farthest, way = k, -way
    ends = list(itertools.pairwise([*turns, farthest] if way else []))
    halves = [0.5 * (values[a] + values[b]) for a, b in ends]
    # The first and the last may be parts of longer ones: they take the level of those beside them.
    beside = [*halves[1:2], *halves[1:-1], *halves[-2:-1]] if len(ends) > 1 else halves
    return [
        _passing(times[a : b + 1], values[a : b + 1], half)
        for (a, b), half in zip(ends, beside, strict=True)
    ]


def _passing(times: Sequence[float], values: Sequence[float], level: float) -> float:
    """When a broken line last passes a level [s]; its start if it begins beyond, else its end."""
    sign = math.copysign(1.0, values[-1] - values[0])
    before = [k for k, value in enumerate(values) if sign * value <= sign * level]
    if not before:
        return times[0]
    k = before[-1]
    if k + 1 == len(times):
        return times[k]
    return times[k] + (times[k + 1] - times[k]) * (level - values[k]) / (values[k + 1] - values[k])


@dataclass(frozen=True)
class Spring:
    """A linear spring between a degree of freedom of a wall and an anchor: force −k (u − u₀).

    ``stiffness`` is k [N/m], or [N m/rad] for the spin; ``anchor`` u₀, where it exerts no force.
    """

    stiffness: float
    anchor: Signal


@dataclass(frozen=True)
class DofDrive:
    """What happens to one degree of freedom of a wall during a stage.

    Its motion is prescribed by ``velocity`` or ``position``, or it is driven by any of ``force``,
    ``stress`` and ``spring``, which add up; nothing means held fixed.

    Attributes:
        velocity: Prescribed velocity [m/s], or spin [rad/s].
        position: Prescribed displacement [m], or angle [rad], since the drive was named.
        force: Force [N], or torque [N m].
        stress: Force per length [N/m], of x or y.
        between: Names of the two walls whose distance across the axis is that length; None: the
            length of the wall itself.
        damping: Damping of a driven degree of freedom, at mid-step velocity [N s/m], or [N m s].
        is_kept: Whether displacements count from where they did in the stage before: the drive was
            named earlier.
    """

    velocity: Signal | None = None
    position: Signal | None = None
    force: Signal | None = None
    stress: Signal | None = None
    between: tuple[str, str] | None = None
    spring: Spring | None = None
    damping: float = 0.0
    is_kept: bool = False

    @property
    def is_driven(self) -> bool:
        return self.force is not None or self.stress is not None or self.spring is not None

    @property
    def has_origin(self) -> bool:
        return self.position is not None or self.spring is not None


@dataclass(frozen=True)
class WallDrive:
    """The three degrees of freedom of one wall in a stage, and its surface; default: held fixed.

    Attributes:
        surface: V_s, with which the material of the surface runs along it while the shape stays
            where it is: along the normal (wall → grain) turned by −90° [m/s]; None: it does not.
    """

    x: DofDrive = DofDrive()
    y: DofDrive = DofDrive()
    spin: DofDrive = DofDrive()
    surface: Signal | None = None

    def dofs(self) -> tuple[DofDrive, DofDrive, DofDrive]:
        return self.x, self.y, self.spin


# ---- Gravity as a function of the time since the start of a stage

DEGREE = math.pi / 180.0


@dataclass(frozen=True)
class Gravity:
    """Gravity by its components [m/s²]."""

    x: Signal
    y: Signal

    @classmethod
    def constant(cls, value: Floats) -> Gravity:
        x, y = value.tolist()
        return cls(Constant(x), Constant(y))

    def value(self, t: float) -> Floats:
        return np.array([self.x.value(t), self.y.value(t)])

    def largest(self) -> tuple[float, float, float]:
        """Bounds of the magnitudes of x, y and the whole at any time [m/s²]."""
        x, y = self.x.largest(), self.y.largest()
        return x, y, hypot(x, y)

    def shortest_period(self, start: float, end: float) -> float:
        """Shortest period of x or y between the times [s]; infinite if both are steady."""
        return min(self.x.shortest_period(start, end), self.y.shortest_period(start, end))


@dataclass(frozen=True)
class TiltedGravity:
    """Gravity by magnitude [m/s²] and angle [degrees], counter-clockwise from −y towards +x.

    g = (g sin θ, −g cos θ): what a floor feels that is tilted by θ so that it descends towards +x.
    """

    angle: Signal
    magnitude: Signal

    def value(self, t: float) -> Floats:
        angle, magnitude = DEGREE * self.angle.value(t), self.magnitude.value(t)
        return np.array([magnitude * sin(angle), -magnitude * cos(angle)])

    def largest(self) -> tuple[float, float, float]:
        largest = self.magnitude.largest()
        return largest * sin(min(DEGREE * self.angle.largest(), 0.5 * math.pi)), largest, largest

    def shortest_period(self, start: float, end: float) -> float:
        """As `Gravity.shortest_period`.

        An angle that sweeps over half a turn or more goes round as fast as its steepest part would.
        The frequencies of angle and magnitude add up, as those of factors do.
        """
        turn = 360.0 / self.angle.steepest() if self.angle.swing() >= 180.0 else math.inf
        angle = min(turn, self.angle.shortest_period(start, end))
        frequency = 1.0 / angle + 1.0 / self.magnitude.shortest_period(start, end)
        return 1.0 / frequency if frequency else math.inf


AnyGravity = Gravity | TiltedGravity


# ---- The distance of two walls: loads spread over it, strains are measured by it


@dataclass(frozen=True)
class Spacing:
    """The distance of two walls along an axis, positive if the second lies further along it.

    ``distance`` is what the places of their shapes add to the distance of their frames [m].
    """

    lower: int
    upper: int
    axis: int
    distance: float

    @classmethod
    def between(cls, model: Model, lower: str, upper: str, axis: int = Y) -> Spacing:
        """The spacing of two named walls; raises `ValueError` for an unknown one, or the same."""
        for name in (lower, upper):
            if name not in model.walls.names:
                message = f"there is no wall '{name}'"
                raise ValueError(message)
        if lower == upper:
            message = f"there is no strain between '{lower}' and itself"
            raise ValueError(message)
        first, second = model.walls.names.index(lower), model.walls.names.index(upper)
        places = wall_places(model, axis)
        return cls(first, second, axis, float(places[second] - places[first]))

    def of(self, state: State) -> float:
        return self.distance + float(
            state.wall_position[self.upper, self.axis] - state.wall_position[self.lower, self.axis]
        )


def wall_places(model: Model, axis: int) -> Floats:
    """Mean place of the shapes of each wall in its frame [m], shape ``(w,)``; 0 without any."""
    shapes = model.shapes
    place = shapes.geometry[:, axis].copy()
    has_end = TAIL[shapes.kind] == Tail.POINT
    place[has_end] = 0.5 * (shapes.geometry[has_end, axis] + shapes.geometry[has_end, axis + 2])
    counted = shapes.kind != ShapeKind.VERTEX
    total = np.bincount(shapes.wall[counted], weights=place[counted], minlength=model.wall_count)
    number = np.bincount(shapes.wall[counted], minlength=model.wall_count)
    return np.asarray(total / np.maximum(number, 1))
