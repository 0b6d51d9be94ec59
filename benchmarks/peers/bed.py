"""A bed that falls and comes to rest: time per simulated second and to rest, and what the bed is
like.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from case import Bed, BedFrames, soft_contact
from measure import fraction_between, near_pairs
from ours import Start, loosened
from peers import GranPeer
from scene import DENSITY, DIAMETER, FRICTION, bed_scene
from table import draw, spread

RESTITUTION = 0.1
"""Restitution of the soft contacts; ours is 0."""

REST = 1e-6
"""Kinetic energy of a grain over m g d at which the bed is at rest, mean over the grains."""

_STIFF = 3e5
_SHORT = 0.1  # share of the duration that stiff codes get


@dataclass(frozen=True)
class BedWanted:
    """What the comparison is about.

    Attributes:
        grains: Number of grains.
        kappas: Stiffnesses k_n over the pressure at the floor.
        rounds: Number of rounds.
        frames: Frames of a run.
        dt: Our time step [s].
        tolerance: Our tolerance of the rms velocity correction; None: the default.
        cores: Threads and ranks.
    """

    grains: int
    kappas: tuple[float, ...]
    rounds: int
    frames: int
    dt: float
    tolerance: float | None
    cores: int


@dataclass(frozen=True)
class BedState:
    """What a bed was like at the end; nan for rest that was not reached.

    Attributes:
        rest: Time from the start to rest [s].
        solid: Solid fraction away from floor and surface.
        floor: Mean force on the floor between the last two frames, over the weight.
        max_overlap: Largest overlap over the smaller radius in any frame.
        final_overlap: The same in the last frame.
        kinetic: Kinetic energy of a grain over m g d, mean over the grains, in the last frame.
    """

    rest: float
    solid: float
    floor: float
    max_overlap: float
    final_overlap: float
    kinetic: float


@dataclass
class BedColumn:
    """One code with one setting: name, simulated time between frames [s], runs by round."""

    name: str
    between: float
    runs: list[BedFrames]

    def per_second(self, frames: int) -> list[float]:
        """Time per simulated second of each round [s], over the first frames."""
        return [float(run.seconds[:frames].sum()) / (frames * self.between) for run in self.runs]

    def to_rest(self, bed: Bed) -> list[float]:
        """Time until the bed is at rest in each round [s]; nan where it did not come to rest."""
        return [
            float(run.seconds[: k + 1].sum())
            if (k := rest_frame(bed, run)) is not None
            else math.nan
            for run in self.runs
        ]


def compare_bed(
    wanted: BedWanted, peers: Sequence[GranPeer], folder: Path, say: Callable[[str], None]
) -> tuple[Bed, list[BedColumn], list[str]]:
    """Run the comparison; returns the bed, the codes (ours first) and notes."""
    start = Start(bed_scene(wanted.dt), wanted.grains, threads=wanted.cores)
    bed = bed_of(start)
    height = bed.layers * bed.diameter
    between = 4.0 * math.sqrt(height / bed.gravity) / wanted.frames
    settings = loosened(wanted.tolerance)
    say("compiling")
    drop_ours(start, bed, settings, wanted.dt, wanted.dt, 2)
    name = f"multicor Δt = {wanted.dt:g} s, rms {settings.tolerance_rms:g}"
    columns = [BedColumn(name, between, [])]
    run_one: list[Callable[[], BedFrames]] = [
        lambda: drop_ours(start, bed, settings, wanted.dt, between, wanted.frames)
    ]
    notes = []
    for kappa in wanted.kappas:
        contact = soft_contact(kappa * bed.pressure, bed.friction, bed.mass, RESTITUTION)
        frames = max(2, round(_SHORT * wanted.frames)) if kappa > _STIFF else wanted.frames
        for peer in peers:
            place = folder / f"bed-{peer.name}-{kappa:g}"
            place.mkdir(parents=True, exist_ok=True)
            columns.append(
                BedColumn(f"{peer.name} κ = {kappa:.0e}".replace("e+0", "e"), between, [])
            )
            run_one.append(peer.prepare_bed(bed, contact, between, frames, place))
            if kappa > _STIFF:
                short = f"only the first {frames * between:.3g} s, in which the grains still fall"
                notes.append(f"{columns[-1].name}: {short}; the ratio is that to ours in this time")
    for round_ in range(wanted.rounds):
        for column, run in zip(columns, run_one, strict=True):
            say(f"round {round_ + 1}: {column.name}")
            column.runs.append(run())
    return bed, columns, notes


def bed_of(start: Start) -> Bed:
    """The grains as the others see them."""
    radius, period = start.model.grains.radius, start.model.period
    layers = float((math.pi * radius**2).sum()) / (0.82 * period * DIAMETER)
    gravity = float(np.hypot(*start.model.gravity))
    return Bed(
        start.state.position[:, :2].copy(), radius, DENSITY, FRICTION, period, gravity, layers
    )


def drop_ours(
    start: Start, bed: Bed, settings: Any, dt: float, between: float, frames: int
) -> BedFrames:
    """Let the grains fall in the program; the steps alone are timed."""
    engine = start.engine(settings)
    steps = math.ceil(between / dt * (1.0 - 1e-9))
    dt = between / steps
    weight = float(bed.mass.sum()) * bed.gravity
    seconds, places, velocities, forces = [], [], [], []
    for _ in range(frames):
        begin = time.perf_counter()
        for _ in range(steps):
            engine.step(dt, 0.0)
        seconds.append(time.perf_counter() - begin)
        places.append(engine.state.position[:, :2].copy())
        velocities.append(engine.state.velocity[:, :2].copy())
        forces.append(-engine.state.window_wall_impulse[0, 1] / (between * weight))
        engine.state.window_wall_impulse[:] = 0.0
    return BedFrames(
        np.array(seconds), np.array(places), np.array(velocities), np.array(forces), steps, dt
    )


def kinetic_of(bed: Bed, run: BedFrames) -> list[float]:
    """Kinetic energy of a grain over m g d, mean over the grains, of each frame."""
    energy = 0.5 * ((run.velocity**2).sum(axis=2) * bed.mass).mean(axis=1)
    return [float(e) for e in energy / (float(bed.mass.mean()) * bed.gravity * bed.diameter)]


def rest_frame(bed: Bed, run: BedFrames) -> int | None:
    """The first frame from which on the bed stays at rest; None if it does not come to rest."""
    moving = np.flatnonzero(np.array(kinetic_of(bed, run)) > REST)
    first = int(moving[-1]) + 1 if moving.size else 0
    return first if first < len(run.seconds) else None


def describe(bed: Bed, column: BedColumn) -> BedState:
    """What the bed of the first round was like."""
    run = column.runs[0]
    rest = rest_frame(bed, run)
    last = run.position[-1]
    surface = float(np.sort(last[:, 1])[-max(1, round(bed.period / bed.diameter)) :].mean())
    solid = fraction_between(
        last[:, 1], bed.radius, 5.0 * bed.diameter, surface - 5.0 * bed.diameter, bed.period
    )
    overlaps = [_largest_overlap(bed, position) for position in run.position]
    return BedState(
        math.nan if rest is None else (rest + 1) * column.between, solid,
        float(run.floor_force[-1]), max(overlaps), overlaps[-1],
        kinetic_of(bed, run)[-1],
    )  # fmt: skip


def _largest_overlap(bed: Bed, position: Any) -> float:
    """Over the smaller radius, among grains and with the floor."""
    pair, gap = near_pairs(position, bed.radius, bed.period, 0.0)
    smaller = np.minimum(bed.radius[pair[:, 0]], bed.radius[pair[:, 1]])
    return float(max((-gap / smaller).max(initial=0.0), (1.0 - position[:, 1] / bed.radius).max()))


def as_text(bed: Bed, columns: list[BedColumn], notes: list[str]) -> str:
    """The result as a table with notes."""
    headings = (
        "code", "s per simulated s", "ratio", "s to rest", "ratio", "steps", "Δt [s]",
        "rest at [s]", "ν", "floor/weight",
        "max overlap", "at the end", "kinetic",
    )  # fmt: skip
    rows = [_row(bed, columns[0], column) for column in columns]
    return "\n".join(
        [f"{len(bed.radius)} grains, {bed.layers:.0f} layers", "", draw(headings, rows), "", *notes]
    )


def _row(bed: Bed, ours: BedColumn, column: BedColumn) -> list[str]:
    state, run = describe(bed, column), column.runs[0]
    frames = len(run.seconds)
    is_whole = frames == len(ours.runs[0].seconds)  # else the bed is still falling
    rest = [t for t in column.to_rest(bed) if not math.isnan(t)]
    return [
        column.name,
        spread(column.per_second(frames)),
        spread(_ratios(ours.per_second(frames), column.per_second(frames))),
        spread(rest) if rest else "",
        spread(ratios) if (ratios := _ratios(ours.to_rest(bed), column.to_rest(bed))) else "",
        f"{run.steps * frames}",
        f"{run.dt:.2g}",
        "" if math.isnan(state.rest) else f"{state.rest:.3f}",
        f"{state.solid:.4f}" if is_whole else "",
        f"{state.floor:.4f}" if is_whole else "",
        f"{state.max_overlap:.1e}",
        f"{state.final_overlap:.1e}",
        f"{state.kinetic:.0e}",
    ]


def _ratios(ours: list[float], theirs: list[float]) -> list[float]:
    """Those that are known."""
    return [b / a for a, b in zip(ours, theirs, strict=True) if math.isfinite(b / a)]


def as_json(bed: Bed, columns: list[BedColumn], notes: list[str]) -> dict[str, Any]:
    """The result as JSON types."""
    codes = []
    for column in columns:
        state = {
            key: value if math.isfinite(value) else None
            for key, value in asdict(describe(bed, column)).items()
        }
        codes.append(
            {
                "name": column.name,
                "seconds_per_simulated_second": column.per_second(len(column.runs[0].seconds)),
                "seconds_to_rest": [t if math.isfinite(t) else None for t in column.to_rest(bed)],
                "dt": column.runs[0].dt,
                **state,
            }
        )
    return {"grains": len(bed.radius), "layers": bed.layers, "codes": codes, "notes": notes}
