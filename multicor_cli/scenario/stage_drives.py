"""What drives and heats each wall in each stage, and from the tables to the drives of the engine.

A wall that a stage does not name keeps its drive and thermal condition, and so does what is left
out of a named wall. At first everything is fixed, and the condition is that of the wall's table, or
insulated. A signal counts from the start of the stage that names it (that of a wall's table from
the start of the run): one that is kept goes on where it is, one that is named again starts again.
While a stage is frozen, what drives walls waits; their thermal conditions go on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

from multicor_cli.engine.motion import drives as engine
from multicor_cli.model.cell import COMPONENTS
from multicor_cli.scenario.drives import (
    CellDof,
    Dof,
    FixedDof,
    InsulatedCondition,
    LoadDof,
    PositionDof,
    RampSignal,
    RateDof,
    Signal,
    SineSignal,
    StressDof,
    TableSignal,
    WallCondition,
)
from multicor_cli.scenario.stages import Stage

DOF_NAMES = ("x", "y", "spin")
NEVER = -1
Kept = TypeVar("Kept", bound=engine.Signal | None)


class KeptDrive(NamedTuple):
    """Drive of a degree of freedom or surface, and index of the stage that says so, or `NEVER`."""

    dof: Dof
    stage: int


class KeptCondition(NamedTuple):
    """A wall's thermal condition, and index of the stage from whose start its signal counts."""

    condition: WallCondition
    stage: int


WallDofs = tuple[KeptDrive, KeptDrive, KeptDrive, KeptDrive]
"""Of x, y, spin and the surface of a wall."""


class KeptComponent(NamedTuple):
    """Drive of a component of a cell, and index of the stage that says so, or `NEVER`."""

    dof: CellDof
    stage: int


def resolve_cell(loading: Sequence[Stage]) -> list[dict[str, KeptComponent]]:
    """What drives xx, yy and xy of a cell in each stage; at first their rate is 0."""
    current = dict.fromkeys(COMPONENTS, KeptComponent(RateDof(rate=0.0), NEVER))
    resolved = []
    for number, stage in enumerate(loading):
        named = {} if stage.cell is None else dict(stage.cell)
        current = current | {
            name: KeptComponent(dof, number) for name, dof in named.items() if dof is not None
        }
        resolved.append(current)
    return resolved


def resolve_dofs(loading: Sequence[Stage], wall_names: Sequence[str]) -> list[list[WallDofs]]:
    """What drives each wall in each stage, by stage and wall."""
    current: list[WallDofs] = [(KeptDrive(FixedDof(fixed=True), NEVER),) * 4] * len(wall_names)
    resolved = []
    for number, stage in enumerate(loading):
        current = current.copy()
        for wall, name in enumerate(wall_names):
            if (drives := stage.drives.get(name)) is not None:
                named = (drives.x, drives.y, drives.spin, drives.surface)
                x, y, spin, surface = (
                    before if dof is None else KeptDrive(dof, number)
                    for dof, before in zip(named, current[wall], strict=True)
                )
                current[wall] = x, y, spin, surface
        resolved.append(current)
    return resolved


def resolve_conditions(
    loading: Sequence[Stage], first: Mapping[str, WallCondition | None], wall_names: Sequence[str]
) -> list[list[KeptCondition]]:
    """Thermal conditions by stage and wall; ``first``: that of a wall's table, None: insulated."""
    current = [
        KeptCondition(first[name] or InsulatedCondition(insulated=True), 0) for name in wall_names
    ]
    resolved = []
    for number, stage in enumerate(loading):
        current = [
            KeptCondition(stage.thermal[name], number) if name in stage.thermal else before
            for name, before in zip(wall_names, current, strict=True)
        ]
        resolved.append(current)
    return resolved


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
    named_by: tuple[tuple[int, int, int, int], ...]
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
            def kept(signal: Kept) -> Kept | engine.Shifted:
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
    drives = []
    for number, walls in enumerate(resolve_dofs(loading, wall_names)):
        engine_drives = []
        for dofs in walls:
            x, y, spin, surface = (_engine_dof(kept.dof) for kept in dofs)
            engine_drives.append(engine.WallDrive(x, y, spin, surface.velocity))
        named_by = tuple((x.stage, y.stage, spin.stage, s.stage) for x, y, spin, s in walls)
        drives.append(
            StageDrives(number, tuple(engine_drives), named_by, _frozen_before(loading, number))
        )
    return drives


def _frozen_before(loading: Sequence[Stage], number: int) -> tuple[int, ...]:
    return tuple(k for k, stage in enumerate(loading[:number]) if stage.frozen)


def cell_drives(loading: Sequence[Stage]) -> list[StageDrives]:
    """The drives of all stages of a cell, which is the one wall of its run."""
    return [
        StageDrives(
            number,
            (engine.WallDrive(_component(xx.dof), _component(yy.dof), _component(xy.dof)),),
            ((xx.stage, yy.stage, xy.stage, NEVER),),
            _frozen_before(loading, number),
        )
        for number, (xx, yy, xy) in enumerate(cell.values() for cell in resolve_cell(loading))
    ]


def _component(dof: CellDof) -> engine.DofDrive:
    if isinstance(dof, StressDof):
        return engine.DofDrive(stress=engine_signal(dof.stress))
    return engine.DofDrive(velocity=engine_signal(dof.rate))


def _engine_dof(dof: Dof) -> engine.DofDrive:
    if isinstance(dof, FixedDof):
        return engine.DofDrive()
    if isinstance(dof, PositionDof):
        return engine.DofDrive(position=engine_signal(dof.position))
    if isinstance(dof, LoadDof):
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
    return engine.DofDrive(velocity=engine_signal(dof.velocity))


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
    signal: Kept, named_by: int, stage: int, starts: Sequence[float]
) -> Kept | engine.Shifted:
    """A signal of the stage ``named_by``, or None, by the time since the start of ``stage``.

    ``starts`` are the times at which the stages up to that have begun [s].
    """
    if named_by == stage or signal is None or isinstance(signal, engine.Constant | engine.Shifted):
        return signal
    return engine.Shifted(signal, starts[stage] - starts[named_by])
