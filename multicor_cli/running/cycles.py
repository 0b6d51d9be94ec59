"""What goes up and down in a stage, and how fast: signals of all kinds, and walls on their springs.

Signals have closed forms, so their periods are told from these, not by sampling, which would need to know beforehand how finely.
Numbers after ``=`` are constants of the time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from multicor_cli.engine.heat.walls import PRESCRIBED, WallHeat
from multicor_cli.engine.motion.drives import DofDrive, Shifted, Signal, WallDrive
from multicor_cli.model import ContactLaws, Model
from multicor_cli.running.plan import StageGravity, StageHeat
from multicor_cli.scenario.drives import DOF_NAMES, StageDrives
from multicor_cli.scenario.loading import Stage


class Cycle(NamedTuple):
    """The period of something that goes up and down.

    Attributes:
        period: Its shortest period [s].
        of: What it is, in words.
    """

    period: float
    of: str


class Window(NamedTuple):
    """How long a stage looks at its signals [s].

    Attributes:
        own: At those that it has named: as long as it lasts.
        kept: At those of earlier stages, from where these are at the earliest when it begins.
    """

    own: float = math.inf
    kept: float = math.inf

    def cycle(self, signal: Signal, of: str) -> Cycle:
        """What a signal does within it."""
        return Cycle(signal.shortest_period(0.0, self.kept if isinstance(signal, Shifted) else self.own), of)


def wall_cycles(model: Model, drives: Sequence[WallDrive], window: Window | None = None) -> Iterator[Cycle]:
    """Those of the drives of the walls, one per wall: signals, and masses on their springs, 2π √(M/k)."""
    window = window or Window()
    for w, (name, drive) in enumerate(zip(model.walls.names, drives, strict=True)):
        masses = (model.walls.mass[w], model.walls.mass[w], model.walls.inertia[w])
        for dof, mass, axis in zip(drive.dofs(), masses, DOF_NAMES, strict=True):
            way = f"of wall '{name}' in {axis}"
            if dof.spring is not None:
                yield Cycle(2.0 * math.pi * math.sqrt(float(mass) / dof.spring.stiffness), f"the spring {way}")
            for what, signal in _signals(dof).items():
                if signal is not None:
                    yield window.cycle(signal, f"the {what} {way}")
        if drive.surface is not None:
            yield window.cycle(drive.surface, f"the surface of wall '{name}'")


def _signals(dof: DofDrive) -> dict[str, Signal | None]:
    anchor = None if dof.spring is None else dof.spring.anchor
    return {"velocity": dof.velocity, "position": dof.position, "force": dof.force, "stress": dof.stress, "anchor": anchor}


class Acting(NamedTuple):
    """What acts in a stage, as in `multicor_cli.running.plan.StagePlan`."""

    drives: StageDrives
    gravity: StageGravity | None
    heat: StageHeat | None
    laws: ContactLaws | None


class StageCycles(NamedTuple):
    """All of a stage.

    Attributes:
        motion: Those of what acts on the motion.
        heat: Those of what walls do to the heat alone.
    """

    motion: list[Cycle]
    heat: list[Cycle]


def stage_cycles(loading: Sequence[Stage], number: int, model: Model, acting: Acting) -> StageCycles:
    """Those of a stage.

    Args:
        loading: All stages.
        number: Index of the stage.
        model: Grains and walls.
        acting: What acts in the stage. Where friction depends on temperature, temperatures of walls act on the motion.
    """
    before = loading[:number]
    starts = [0.0, *itertools.accumulate((0.0 if stage.until else stage.duration or 0.0) for stage in before)]
    duration = loading[number].duration or math.inf
    window = Window(duration, math.inf if any(stage.until for stage in before) else duration)
    motion = list(wall_cycles(model, acting.drives.started(starts), window))
    if acting.gravity is not None and acting.gravity.named_by == number:  # of an earlier stage's, the last value is kept
        motion.append(Cycle(acting.gravity.gravity.shortest_period(0.0, duration), "gravity"))
    of_heat = [] if acting.heat is None else list(_heat_cycles(model, acting.heat.conditions.started(starts), window))
    if (model.laws if acting.laws is None else acting.laws).depends_on_temperature:
        motion += of_heat
    return StageCycles(motion, of_heat)


def _heat_cycles(model: Model, conditions: Sequence[WallHeat], window: Window) -> Iterator[Cycle]:
    for name, wall in zip(model.walls.names, conditions, strict=True):
        if wall.kind in PRESCRIBED:
            quantity = "heat flow" if wall.kind == "flow" else "temperature"
            yield window.cycle(wall.signal, f"the {quantity} of wall '{name}'")
