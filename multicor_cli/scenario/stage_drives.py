"""What drives and heats each wall in each stage, and from the tables to the drives of the engine.

A wall that a stage does not name keeps its drive and thermal condition, and so does what is left
out of a named wall. At first everything is fixed, and the condition is that of the wall's table, or
insulated. A signal counts from the start of the stage that names it (that of a wall's table from
the start of the run): one that is kept goes on where it is, one that is named again starts again.
While a stage is frozen, what drives walls waits; their thermal conditions go on.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

from multicor_cli.engine.motion import drives as engine
from multicor_cli.model.cell import COMPONENTS
from multicor_cli.scenario.drives import (
    CellDof,
    Dof,
    FixedDof,
    InsulatedCondition,
    PositionDof,
    RampSignal,
    RateDof,
    Signal,
    SineSignal,
    StressDof,
    TableSignal,
    VelocityDof,
    WallCondition,
)
from multicor_cli.scenario.stages import Stage

DOF_NAMES = ("x", "y", "spin")
WAYS = (*DOF_NAMES, "surface")
NEVER = -1

Signals = TypeVar("Signals", bound=engine.Signal | None)
Key = TypeVar("Key")
Said = TypeVar("Said")


class KeptCondition(NamedTuple):
    """A wall's thermal condition, and index of the stage from whose start its signal counts."""

    condition: WallCondition
    stage: int


def _resolved(
    first: Mapping[Key, tuple[Said, int]], said: Iterable[Mapping[Key, Said | None]]
) -> Iterator[dict[Key, tuple[Said, int]]]:
    """What holds in each stage, by keys of ``first``, and index of the stage that has said so."""
    current = dict(first)
    for number, named in enumerate(said):
        new = {
            key: (each, number)
            for key, each in named.items()
            if each is not None and key in current
        }
        current = current | new
        yield current


def resolve_cell(loading: Sequence[Stage]) -> Iterator[dict[str, tuple[CellDof, int]]]:
    """What drives xx, yy and xy of a cell in each stage; at first their rate is 0."""
    first: tuple[CellDof, int] = RateDof(rate=0.0), NEVER
    said = ({} if stage.cell is None else dict(stage.cell) for stage in loading)
    return _resolved(dict.fromkeys(COMPONENTS, first), said)


def resolve_dofs(
    loading: Sequence[Stage], wall_names: Sequence[str]
) -> Iterator[dict[tuple[str, str], tuple[Dof, int]]]:
    """What drives x, y, spin and surface of each wall in each stage; at first all are fixed."""
    first: tuple[Dof, int] = FixedDof(fixed=True), NEVER
    said = (
        {(name, way): getattr(drives, way) for name, drives in stage.drives.items() for way in WAYS}
        for stage in loading
    )
    return _resolved(dict.fromkeys(itertools.product(wall_names, WAYS), first), said)


def resolve_conditions(
    loading: Sequence[Stage], first: Mapping[str, WallCondition | None], wall_names: Sequence[str]
) -> list[list[KeptCondition]]:
    """Thermal conditions by stage and wall; ``first``: that of a wall's table, None: insulated."""
    at_first = {name: (first[name] or InsulatedCondition(insulated=True), 0) for name in wall_names}
    found = _resolved(at_first, (stage.thermal for stage in loading))
    return [[KeptCondition(*kept) for kept in stage.values()] for stage in found]


@dataclass(frozen=True)
class StageDrives:
    """The drives of one stage.

    Attributes:
        stage: Index of the stage.
        walls: One drive per wall; signals count from the start of the stage that named them.
        named_by: For each wall the index of the stage that named its x, y, spin and surface;
            `NEVER` if none has (then it is fixed).
        frozen: Stages before in which nothing moves.
    """

    stage: int
    walls: tuple[engine.WallDrive, ...]
    named_by: tuple[tuple[int, ...], ...]
    frozen: tuple[int, ...] = ()

    def started(self, stage_starts: Sequence[float]) -> list[engine.WallDrive]:
        """The drives as functions of the time since the start of this stage.

        ``stage_starts`` are the times at which the stages up to this one have begun [s].
        """
        stood = [
            math.fsum(stage_starts[k + 1] - stage_starts[k] for k in self.frozen if k < stage)
            for stage in range(len(stage_starts))
        ]
        moving = [start - still for start, still in zip(stage_starts, stood, strict=True)]

        def since(dof: engine.DofDrive, named_by: int) -> engine.DofDrive:
            def kept(signal: Signals) -> Signals | engine.Shifted:
                return kept_signal(signal, named_by, self.stage, moving)

            spring = dof.spring and replace(dof.spring, anchor=kept(dof.spring.anchor))
            return replace(
                dof,
                velocity=kept(dof.velocity),
                position=kept(dof.position),
                force=kept(dof.force),
                stress=kept(dof.stress),
                spring=spring,
                is_kept=dof.has_origin and named_by != self.stage,
            )

        started = []
        for wall, named_by in zip(self.walls, self.named_by, strict=True):
            x, y, spin = (since(*dof) for dof in zip(wall.dofs(), named_by[:3], strict=True))
            surface = kept_signal(wall.surface, named_by[3], self.stage, moving)
            started.append(engine.WallDrive(x, y, spin, surface))
        return started


def stage_drives(loading: Sequence[Stage], wall_names: Sequence[str]) -> list[StageDrives]:
    """The drives of all stages, which are in time order; walls in the order of their names."""
    found = resolve_dofs(loading, wall_names)
    return _drives(
        loading, ([[kept[n, way] for way in WAYS] for n in wall_names] for kept in found)
    )


def cell_drives(loading: Sequence[Stage]) -> list[StageDrives]:
    """The drives of all stages of a cell, which is the one wall of its run."""
    surface = FixedDof(fixed=True), NEVER
    return _drives(loading, ([[*kept.values(), surface]] for kept in resolve_cell(loading)))


def _drives(
    loading: Sequence[Stage], found: Iterable[list[list[tuple[Dof | CellDof, int]]]]
) -> list[StageDrives]:
    """The drives of stages, of each wall those of x, y, spin and surface."""
    drives = []
    for number, walls in enumerate(found):
        made = []
        for kept in walls:
            x, y, spin, surface = (_engine_dof(dof) for dof, _ in kept)
            made.append(engine.WallDrive(x, y, spin, surface.velocity))
        named_by = tuple(tuple(stage for _, stage in kept) for kept in walls)
        frozen = tuple(k for k, stage in enumerate(loading[:number]) if stage.frozen)
        drives.append(StageDrives(number, tuple(made), named_by, frozen))
    return drives


def _engine_dof(dof: Dof | CellDof) -> engine.DofDrive:
    match dof:
        case VelocityDof(velocity=signal) | RateDof(rate=signal):
            return engine.DofDrive(velocity=engine_signal(signal))
        case PositionDof(position=signal):
            return engine.DofDrive(position=engine_signal(signal))
        case StressDof(stress=signal):
            return engine.DofDrive(stress=engine_signal(signal))
        case FixedDof():
            return engine.DofDrive()
    spring = None
    if dof.spring is not None:
        spring = engine.Spring(dof.spring.stiffness, engine_signal(dof.spring.anchor))
    return engine.DofDrive(
        force=None if dof.force is None else engine_signal(dof.force),
        stress=None if dof.stress is None else engine_signal(dof.stress),
        between=dof.between,
        spring=spring,
        damping=dof.damping,
    )


def engine_signal(signal: Signal) -> engine.Signal:
    """The engine's form of a signal."""
    if isinstance(signal, RampSignal):
        return engine.Ramp(signal.ramp[0], signal.ramp[1], signal.duration)
    if isinstance(signal, SineSignal):
        wave = signal.sine
        return engine.Sine(wave.mean, wave.amplitude, wave.cycle, wave.phase)
    if isinstance(signal, TableSignal):
        return engine.Interpolated(signal.times, signal.values)
    return engine.Constant(signal)


def kept_signal(
    signal: Signals, named_by: int, stage: int, starts: Sequence[float]
) -> Signals | engine.Shifted:
    """A signal of the stage ``named_by``, or None, by the time since the start of ``stage``.

    ``starts`` are the times at which the stages up to that have begun [s].
    """
    if named_by == stage or signal is None or isinstance(signal, engine.Constant | engine.Shifted):
        return signal
    return engine.Shifted(signal, starts[stage] - starts[named_by])
