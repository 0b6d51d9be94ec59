"""The automatic time step: the largest at which a flow still behaves as with small steps.

What a longer step does to a flow has been measured (``benchmarks/time_step``): friction and solid
fraction depend on two ratios, Δt to the time √(m̄/P) in which the pressure moves a grain by its own
size, and Δt to the time 1/γ̇ of one unit of strain. The second one is the sliding distance per step
over the diameter. It is also the angle by which contacts turn in a step, and so the curvature that
a step cuts off. The more friction, the shorter the step has to be, and where grains lose little in
impacts, so that many follow one another. Overlaps do not limit it: rigid
grains are kept apart at any step. What walls, loads and gravity are told to do is sampled once in a
step, so their periods limit it, too. A step that the scenario gives does not pass here.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, Decimal
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import hypot, power
from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.heat.walls import PRESCRIBED
from multicor_cli.engine.motion.drives import DofDrive, Gravity, Shifted, Signal, WallDrive
from multicor_cli.model import ContactLaws, Model, ShapeKind
from multicor_cli.model.cell import COMPONENTS
from multicor_cli.model.columns import RADIUS
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import TAIL, Tail
from multicor_cli.running.plan import RunPlan, StageGravity, StageHeat, StagePlan
from multicor_cli.scenario.scenario import Scenario
from multicor_cli.scenario.settings import Output
from multicor_cli.scenario.stage_drives import DOF_NAMES, StageDrives
from multicor_cli.scenario.stages import Stage

PRESSURE = 0.1
"""Largest Δt over √(m̄/P)."""

STRAIN = 0.005
"""Largest strain in a step, γ̇ Δt."""

HIGH_FRICTION = 0.5
"""Coefficient of friction above which these two fall, as its powers -5/2 and -2."""

ELASTIC, SHORTENED = 0.8, 0.25
"""Coefficient of restitution e above which they fall as 1 − e, and the least that is left."""

ADHESION = 0.1
"""Largest Δt over the time √(2 m ℓ/F_a) in which adhesion carries a grain across its range."""

PERIOD = 0.02
"""Largest Δt over the period of a signal that acts on the motion, or of a wall on its spring."""

OSCILLATIONS = 100.0
"""Most periods in a step of a signal for heat alone, followed in 16 pieces of each period."""

TRAVEL = 0.3
"""Largest distance in a step over d̄, at the largest speed that is known beforehand (`fastest`)."""

SLOWEST, BY_NUMBER, POWER = 0.2567, 0.775, 0.768
"""μ* of plane shear is the first plus the second times I to the third (theory §15.4)."""

LARGEST_NUMBER = 0.3
"""Inertial number up to which the automatic step has been measured."""


# ---- What goes up and down in a stage, and how fast: signals, and walls on their springs
#
# Signals have closed forms, so their periods are told from these, not by sampling, which would need
# to know beforehand how finely. Numbers after `=` are constants of the time.


class Cycle(NamedTuple):
    """The shortest period of something that goes up and down [s], and what it is, in words."""

    period: float
    of: str


class Window(NamedTuple):
    """How long a stage looks at signals [s]: at its own, and at those kept from earlier stages."""

    own: float
    kept: float

    def cycle(self, signal: Signal, of: str) -> Cycle:
        length = self.kept if isinstance(signal, Shifted) else self.own
        return Cycle(signal.shortest_period(0.0, length), of)


def wall_cycles(model: Model, drives: Sequence[WallDrive], window: Window) -> Iterator[Cycle]:
    """Cycles of the drives, one per wall: signals, and masses on their springs, 2π √(M/k)."""
    for w, (name, drive) in enumerate(zip(model.walls.names, drives, strict=True)):
        masses = (model.walls.mass[w], model.walls.mass[w], model.walls.inertia[w])
        ways = [f"of wall '{name}' in {axis}" for axis in DOF_NAMES]
        if model.is_cell:
            ways = [f"{component} of the cell" for component in COMPONENTS]
        for dof, mass, way in zip(drive.dofs(), masses, ways, strict=True):
            signals = {
                "rate" if model.is_cell else "velocity": dof.velocity,
                "position": dof.position,
                "force": dof.force,
                "stress": dof.stress,
                "anchor": None if dof.spring is None else dof.spring.anchor,
            }
            if dof.spring is not None:
                period = 2.0 * math.pi * math.sqrt(float(mass) / dof.spring.stiffness)
                yield Cycle(period, f"the spring {way}")
            for what, signal in signals.items():
                if signal is not None:
                    yield window.cycle(signal, f"the {what} {way}")
        if drive.surface is not None:
            yield window.cycle(drive.surface, f"the surface of wall '{name}'")


class Acting(NamedTuple):
    """What acts in a stage, as in `StagePlan`."""

    drives: StageDrives
    gravity: StageGravity | None
    heat: StageHeat | None
    laws: ContactLaws | None


def stage_cycles(
    loading: Sequence[Stage], number: int, model: Model, acting: Acting | StagePlan
) -> tuple[list[Cycle], list[Cycle]]:
    """What acts on the motion in a stage, and what walls do to the heat alone.

    Where friction depends on temperature, that acts on the motion, too.
    """
    before, duration = loading[:number], loading[number].duration or math.inf
    lengths = (0.0 if stage.until else stage.duration or 0.0 for stage in before)
    starts = [0.0, *itertools.accumulate(lengths)]
    window = Window(duration, math.inf if any(stage.until for stage in before) else duration)
    motion = list(wall_cycles(model, acting.drives.started(starts), window))
    # Gravity of an earlier stage keeps its last value.
    if acting.gravity is not None and acting.gravity.named_by == number:
        motion.append(Cycle(acting.gravity.gravity.shortest_period(0.0, duration), "gravity"))
    walls = [] if acting.heat is None else acting.heat.started(starts)
    of_heat = [
        window.cycle(
            wall.signal, f"the {'heat flow' if wall.kind == 'flow' else wall.kind} of wall '{name}'"
        )
        for name, wall in zip(model.walls.names, walls, strict=bool(walls))
        if wall.kind in PRESCRIBED
    ]
    if (acting.laws or model.laws).depends_on_temperature:
        motion += of_heat
    return motion, of_heat


# ---- The scales of a stage

LargestGravity = tuple[float, float, float]
"""Bounds of the magnitudes of gravity in x, in y and as a whole during a stage [m/s²]."""


@dataclass(frozen=True)
class Scales:
    """Times of a stage [s] that a step must resolve; infinite where nothing sets them.

    Attributes:
        pressure: √(m̄/P), where P is the larger of the weight of all grains over the side across
            gravity and the loads over their length. Of a cell P is the largest stress, and m̄ is
            less where the cell weighs less than its grains.
        strain: 1/γ̇, with γ̇ the largest of: the sum of the two largest wall speeds in x over the
            height of the domain, that of the two largest in y over its smaller side, and the
            fastest spin of a wall; a surface that runs counts as the motion of the wall that would
            carry grains along like it; that of a layer on a slope (`_sliding_number`); that of the
            layer that flows down in a drum (`_drum_rate`); and that of a bed that is shaken
            (`_shaken_rate`). Of a cell γ̇ is the largest rate.
        travel: d̄ over the largest speed that is known beforehand, that of ``fastest``.
        friction: Largest coefficient of friction between grains.
        period: Shortest period of what acts on the motion, that of ``cycle``: signals of walls and
            gravity, and walls on their springs.
        heat: Shortest period of the temperature or heat flow of a wall, that of ``heat_cycle``.
        adhesion: √(2 m ℓ/F_a), the shortest of two materials with the range ℓ of their adhesion; m
            is the smaller of the mean masses of their grains.
        errors: Errors that are asked for, over those of the default.
        strained_by: What sets the rate of strain.
        restitution: Largest coefficient of restitution between grains.
    """

    pressure: float
    strain: float
    travel: float
    friction: float = 0.0
    period: float = math.inf
    fastest: str = ""
    cycle: str = ""
    heat: float = math.inf
    heat_cycle: str = ""
    adhesion: float = math.inf
    errors: float = 1.0
    strained_by: str = "moving walls"
    restitution: float = 0.0

    @property
    def limit(self) -> float:
        """The largest time step that all of them allow [s]."""
        return min(self.limits.values())

    @property
    def set_by(self) -> str:
        return min(self.limits, key=self.limits.__getitem__)

    @property
    def limits(self) -> dict[str, float]:
        """The largest time step that each of them allows [s], by what sets it.

        Motion and periods are not followed worse for more errors, only better for fewer.
        """
        excess = max(1.0, self.friction / HIGH_FRICTION)
        square = excess * excess
        errors, at_most = self.errors, min(1.0, self.errors)
        of_flow = errors * max(SHORTENED, min(1.0, (1.0 - self.restitution) / (1.0 - ELASTIC)))
        return {
            "the pressure": of_flow * PRESSURE / (square * math.sqrt(excess)) * self.pressure,
            f"the strain of {self.strained_by}": of_flow * STRAIN / square * self.strain,
            self.fastest: at_most * TRAVEL * self.travel,
            f"the period of {self.cycle}": at_most * PERIOD * self.period,
            f"{OSCILLATIONS:g} periods of {self.heat_cycle}": OSCILLATIONS * self.heat,
            "the range of adhesion": at_most * ADHESION * self.adhesion,
        }


def scales_of_stage(
    scenario: Scenario, model: Model, number: int, acting: Acting | StagePlan
) -> Scales:
    """The scales of a stage in which this acts; gravity and laws that it lacks are the model's."""
    gravity, drives = largest_gravity(acting, model), acting.drives.started([0.0] * (number + 1))
    mean_mass = total(model.grains.mass) / model.grain_count
    if model.is_cell:  # the lighter of the two follows a stress: what M = Σ m d̄² moves has mass m
        mean_mass *= min(1.0, 1.0 if (f := scenario.domain.cell_inertia) is None else f)
    pressure = largest_pressure(scenario, model, drives, gravity)
    scale = math.sqrt(mean_mass / pressure) if pressure > 0.0 else math.inf
    rates = {
        "the cell" if model.is_cell else "moving walls": _largest_rate(scenario, model, drives),
        "a layer that slides down": _sliding_number(scenario, gravity) / scale,
        "the layer that flows down in a drum": _drum_rate(model, drives, gravity),
        "a bed that is shaken": _shaken_rate(model, drives, gravity),
    }
    strained_by = max(rates, key=rates.__getitem__)
    rate = rates[strained_by]
    speed, mover = fastest(scenario, model, drives, gravity)
    period, heat_period = (
        min(each, key=lambda cycle: cycle.period, default=Cycle(math.inf, "a signal"))
        for each in stage_cycles(scenario.loading, number, model, acting)
    )
    return Scales(
        scale,
        1.0 / rate if rate > 0.0 else math.inf,
        model.mean_diameter / speed if speed > 0.0 else math.inf,
        largest_friction(model, acting.laws or model.laws),
        period.period,
        f"{mover} at {speed:.3g} m/s",
        period.of,
        heat_period.period,
        heat_period.of,
        adhesion_time(model),
        scenario.stage_solver(number).error_factor,
        strained_by,
        largest_restitution(model),
    )


def _sliding_number(scenario: Scenario, gravity: LargestGravity) -> float:
    """Inertial number of a layer that slides along the period: tan θ = μ*(I), and no wall stops it.

    0 where it rests, or where nothing lets it slide for ever.
    """
    domain, (along, across, _) = scenario.domain, gravity
    if domain.period == 0.0 or domain.is_cell or along <= SLOWEST * across:
        return 0.0
    if across == 0.0:
        return LARGEST_NUMBER
    excess = (along / across - SLOWEST) / BY_NUMBER
    return min(LARGEST_NUMBER, power(excess, 1.0 / POWER))


def _drum_rate(model: Model, drives: Sequence[WallDrive], gravity: LargestGravity) -> float:
    """Rate of shear of the layer that flows down in a drum [1/s]; 0 where none turns.

    ½ √(g/d̄) however fast that is: GDR MiDi, Eur. Phys. J. E 14, 341 (2004).
    """
    drums = set(model.shapes.wall[model.shapes.kind == ShapeKind.CIRCLE].tolist())
    if model.is_cell or not any(_largest_velocity(drives[w].spin) > 0.0 for w in drums):
        return 0.0
    return 0.5 * math.sqrt(gravity[2] / model.mean_diameter)


def _shaken_rate(model: Model, drives: Sequence[WallDrive], gravity: LargestGravity) -> float:
    """Rate of shear of a bed that a wall throws up [1/s]; 0 where none does: √(g/d̄).

    Twice that of the layer in a drum, as it rebounds (``benchmarks/time_step/others.py``). A wall
    throws if 2π v/T > g, with the largest speed v of its motion to and fro, and the shortest period
    T.
    """
    weight = gravity[2]
    if model.is_cell or weight == 0.0:
        return 0.0
    for drive in drives:
        for dof in (drive.x, drive.y):
            signal = dof.position or dof.velocity
            if signal is None:
                continue
            speed = signal.steepest() if dof.position else 0.5 * signal.swing()
            if 2.0 * math.pi * speed > weight * signal.shortest_period(0.0, math.inf):
                return math.sqrt(weight / model.mean_diameter)
    return 0.0


def largest_pressure(
    scenario: Scenario, model: Model, drives: Sequence[WallDrive], gravity: LargestGravity
) -> float:
    """The larger of the weight of all grains over the side across gravity, and wall loads [N/m].

    Of a cell the largest magnitude of its prescribed stresses, that in shear included.
    """
    across = scenario.domain.size[0] if gravity[1] >= gravity[0] else scenario.domain.size[1]
    weight = total(model.grains.mass) * gravity[2] / across
    loads = [
        _largest_load(dof, float(length))
        for drive, length in zip(drives, model.walls.length, strict=True)
        for dof in (drive.dofs() if model.is_cell else (drive.x, drive.y))
    ]
    return max([weight, *loads])


def largest_gravity(stage: Acting | StagePlan, model: Model) -> LargestGravity:
    """The largest gravity of a stage."""
    constant = Gravity.constant(model.gravity)
    return (constant if stage.gravity is None else stage.gravity.gravity).largest()


def largest_friction(model: Model, laws: ContactLaws) -> float:
    """Largest coefficient of friction between grains at any speed, at the reference temperature."""
    materials = set(model.grains.material.tolist())
    return max(pair_friction(laws, a, b) for a in materials for b in materials)


def largest_restitution(model: Model) -> float:
    """Largest coefficient of restitution between grains."""
    materials = set(model.grains.material.tolist())
    return max(float(model.laws.restitution[a, b]) for a in materials for b in materials)


def pair_friction(laws: ContactLaws, a: int, b: int) -> float:
    """As `largest_friction`, of two materials."""
    table, starts = int(laws.table[a, b]), laws.table_start
    if table < 0:
        return float(laws.friction[a, b])
    return float(laws.table_friction[starts[table] : starts[table + 1]].max())


def adhesion_time(model: Model) -> float:
    """Shortest time in which adhesion at its full force carries a grain across its range [s]."""
    grains, laws = model.grains, model.laws
    masses = {
        material: total(grains.mass[grains.material == material])
        / np.count_nonzero(grains.material == material)
        for material in set(grains.material.tolist())
    }
    times = [
        math.sqrt(2.0 * mass * float(laws.adhesion_range[a, b] / laws.adhesion[a, b]))
        for a, mass in masses.items()
        for b in np.flatnonzero(laws.adhesion[a] if laws.adhesion_range.size else [])
    ]
    return min(times, default=math.inf)


def _largest_load(dof: DofDrive, length: float) -> float:
    """Largest load per length [N/m]; what a spring exerts depends on the motion."""
    if dof.stress is not None:
        return dof.stress.largest()
    return dof.force.largest() / length if dof.force is not None else 0.0


def _largest_velocity(dof: DofDrive) -> float:
    """Largest speed that is prescribed, or with which a spring is pulled."""
    if dof.velocity is not None:
        return dof.velocity.largest()
    if dof.position is not None:
        return dof.position.steepest()
    return dof.spring.anchor.steepest() if dof.spring is not None else 0.0


def _largest_rate(scenario: Scenario, model: Model, drives: Sequence[WallDrive]) -> float:
    """Rate of shear or compression by the walls, or the fastest spin of one if larger [1/s].

    Of a cell the largest prescribed rate.
    """
    if model.is_cell:
        return max(_largest_velocity(dof) for dof in drives[0].dofs())
    width, height = scenario.domain.size
    speeds: tuple[list[float], ...] = ([0.0], [0.0], [0.0])
    for w, drive in enumerate(drives):
        surface = _surface_motion(model, w, drive)
        for speed, dof, of_surface in zip(speeds, drive.dofs(), surface, strict=True):
            speed.append(_largest_velocity(dof) + of_surface)
    # Two walls may move against each other: their speeds add up.
    x, y = (math.fsum(sorted(speed)[-2:]) for speed in speeds[:2])
    return max(*speeds[2], x / height, y / min(width, height))


def _surface_motion(model: Model, w: int, drive: WallDrive) -> tuple[float, float, float]:
    """Motion of a wall that would carry grains as its surface does: x, y [m/s], spin [rad/s].

    Straight shapes as a motion along them, round ones as a spin.
    """
    if drive.surface is None:
        return 0.0, 0.0, 0.0
    speed, mine = drive.surface.largest(), model.shapes.wall == w
    kind, geometry = model.shapes.kind[mine], model.shapes.geometry[mine]
    is_round = (kind == ShapeKind.DISC) | (kind == ShapeKind.CIRCLE)
    normal = geometry[kind == ShapeKind.PLANE, 2:]
    way = geometry[TAIL[kind] == Tail.POINT]
    way = way[:, 2:] - way[:, :2]
    length = np.sqrt(way[:, [0]] * way[:, [0]] + way[:, [1]] * way[:, [1]])
    along = np.abs(np.concatenate([normal[:, ::-1], way / length]))
    x, y = along.max(axis=0, initial=0.0).tolist()
    return speed * x, speed * y, float((speed / geometry[is_round, RADIUS]).max(initial=0.0))


def largest_speed(
    scenario: Scenario, model: Model, drives: Sequence[WallDrive], gravity: LargestGravity
) -> float:
    """Largest of the speeds of `fastest`, of the walls in x and y, and of their surfaces [m/s].

    A cell has rates, but no speed.
    """
    if model.is_cell:
        return fastest(scenario, model, drives, gravity)[0]
    walls = [max(_largest_velocity(drive.x), _largest_velocity(drive.y)) for drive in drives]
    surfaces = [drive.surface.largest() for drive in drives if drive.surface is not None]
    return max([fastest(scenario, model, drives, gravity)[0], *walls, *surfaces])


def fastest(
    scenario: Scenario, model: Model, drives: Sequence[WallDrive], gravity: LargestGravity
) -> tuple[float, str]:
    """The largest speed that is known beforehand [m/s], and what has it.

    That is a free fall through the domain; what moves at the start; a group of grains relative to
    another, and grains that are released; and the surfaces of walls, as stages move and turn them.
    Walls from one period to the next that move along it do not come nearer to anything: they shear,
    and their rate of shear limits the step.
    """
    groups, far = scenario.particles, hypot(*scenario.domain.size)
    falls = (
        math.sqrt(2.0 * g * length)
        for g, length in zip(gravity[:2], scenario.domain.size, strict=True)
    )
    apart = (
        hypot(a.velocity[0] - b.velocity[0], a.velocity[1] - b.velocity[1])
        for a in groups
        for b in groups
    )
    found = [
        (max(falls), "a free fall through the domain"),
        (model.start_speed, "motion at the start"),
        (max(apart, default=0.0), "groups of grains relative to each other"),
    ]
    for number, group in enumerate(groups):
        if group.release is not None:
            largest = float(model.grains.radius[model.grains.group == number].max(initial=0.0))
            speed = max(hypot(*group.velocity), largest * abs(group.spin))
            found.append((speed, f"released grains of group '{group.name}'"))
    arms, names = _reach_of_walls(model, far).tolist(), model.walls.names
    walls = () if model.is_cell else zip(names, drives, arms, scenario.walls, strict=True)
    for name, drive, arm, wall in walls:
        is_along = wall.geometry.spans_period(scenario.domain)
        along = 0.0 if is_along else _largest_velocity(drive.x)
        speed = hypot(along, _largest_velocity(drive.y)) + arm * _largest_velocity(drive.spin)
        found.append((speed, f"wall '{name}'"))
        if drive.surface is not None and not is_along:
            found.append((drive.surface.largest(), f"the surface of wall '{name}'"))
    return max(found, key=lambda pair: pair[0])


def _reach_of_walls(model: Model, far: float) -> Floats:
    """Farthest surface of each wall from its pivot [m], shape ``(w,)``; ``far`` for planes."""
    kind, (x, y, u, v) = model.shapes.kind, model.shapes.geometry.T
    reach = np.sqrt(x * x + y * y)
    reach = np.where(TAIL[kind] == Tail.POINT, np.maximum(reach, np.sqrt(u * u + v * v)), reach)
    reach = np.where((kind == ShapeKind.DISC) | (kind == ShapeKind.CIRCLE), reach + u, reach)
    farthest = np.zeros(model.wall_count)
    np.maximum.at(farthest, model.shapes.wall, np.where(kind == ShapeKind.PLANE, far, reach))
    return farthest


def automatic_step(scales: Scales, output: Output) -> float | None:
    """The automatic time step of a stage [s]; None if no weight, load, wall or motion sets a scale.

    Rounded down to two digits, so that it is the same on every machine, and then so that a whole
    number of steps makes up the interval between frames, or between rows if one was asked for.
    """
    if scales.limit == math.inf:
        return None
    interval = output.frame_interval
    if not output.has_default_series:
        interval = min(interval, output.series_interval)
    exact = Decimal(scales.limit * (1.0 + 1e-9))
    second_digit = Decimal((0, (1,), exact.adjusted() - 1))
    step = min(float(exact.quantize(second_digit, rounding=ROUND_DOWN)), interval)
    return interval / math.ceil(interval / step * (1.0 - 1e-9))


@dataclass(frozen=True)
class StepReview:
    """A time step over the `Scales` of its stage; ratios are None where nothing sets their scale.

    Attributes:
        of_pressure: Δt over √(m̄/P).
        strain: Strain in a step, γ̇ Δt: sliding over the diameter, and the angle contacts turn by.
        travel: Distance in a step over d̄.
        of_period: Δt over the period.
        of_adhesion: Δt over the time in which adhesion crosses its range.
        automatic: What the automatic time step would be [s]; ``set_by`` says what sets it.
    """

    is_automatic: bool
    of_pressure: float | None
    strain: float | None
    travel: float | None
    of_period: float | None
    of_adhesion: float | None
    automatic: float | None
    set_by: str
    fastest: str
    cycle: str

    def text(self) -> str:
        shares = {
            "√(m̄/P)": self.of_pressure,
            "of strain": self.strain,
            f"diameters per step of {self.fastest}": self.travel,
            f"of the period of {self.cycle}": self.of_period,
            "of the time in which adhesion crosses its range": self.of_adhesion,
        }
        texts = [f"{share:.2g} {text}" for text, share in shares.items() if share is not None]
        return ", ".join(["automatic", *texts] if self.is_automatic else texts)


def review_steps(scenario: Scenario, model: Model, plan: RunPlan) -> list[StepReview | None]:
    """For each stage, how its time step compares with its scales; None for frozen stages."""
    reviews: list[StepReview | None] = []
    for number, stage in enumerate(plan.stages):
        if stage.is_frozen:
            reviews.append(None)
            continue
        scales = scales_of_stage(scenario, model, number, stage)
        times = scales.pressure, scales.strain, scales.travel, scales.period, scales.adhesion
        pressure, strain, travel, period, adhesion = (
            None if time == math.inf else stage.dt / time for time in times
        )
        automatic = automatic_step(scales, scenario.output)
        is_automatic = scenario.stage_solver(number).dt == "auto"
        words = scales.set_by, scales.fastest, scales.cycle
        reviews.append(
            StepReview(is_automatic, pressure, strain, travel, period, adhesion, automatic, *words)
        )
    return reviews
