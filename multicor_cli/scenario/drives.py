"""From the loading stages to the drives of the engine.

A wall that a stage does not name keeps its drive, and so does what is left out of a named wall;
at first everything is fixed. A signal counts from the start of the stage that names it: one that is
kept goes on where it is, one that is named again starts anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

from multicor_cli.engine.motion.drives import (
    Constant,
    DofDrive,
    Interpolated,
    Ramp,
    Shifted,
    Sine,
    Spring,
    WallDrive,
)
from multicor_cli.engine.motion.drives import Signal as EngineSignal
from multicor_cli.scenario.loading import AnyDof, FixedDof, LoadDof, PositionDof, Stage
from multicor_cli.scenario.signals import AnySignal, RampSignal, SineSignal, TableSignal

DOF_NAMES = ("x", "y", "spin")
NEVER = -1
Kept = TypeVar("Kept", bound=EngineSignal | None)


class KeptDrive(NamedTuple):
    """Drive of a degree of freedom or surface, and index of the stage that says so, or `NEVER`."""

    dof: AnyDof
    stage: int


WallDofs = tuple[KeptDrive, KeptDrive, KeptDrive, KeptDrive]
"""Of x, y, spin and the surface of a wall."""

_AT_FIRST = KeptDrive(FixedDof(fixed=True), NEVER)


def resolve_dofs(loading: Sequence[Stage], wall_names: Sequence[str]) -> list[list[WallDofs]]:
    """What drives each wall in each stage, by stage and wall."""
    current: list[WallDofs] = [(_AT_FIRST,) * 4] * len(wall_names)
    resolved = []
    for number, stage in enumerate(loading):
        current = [
            _named(stage, number, name, before)
            for name, before in zip(wall_names, current, strict=True)
        ]
        resolved.append(current)
    return resolved


def _named(stage: Stage, number: int, wall: str, before: WallDofs) -> WallDofs:
    drives = stage.drives.get(wall)
    if drives is None:
        return before
    named = (drives.x, drives.y, drives.spin, drives.surface)
    x, y, spin, surface = (
        kept if dof is None else KeptDrive(dof, number)
        for dof, kept in zip(named, before, strict=True)
    )
    return x, y, spin, surface


@dataclass(frozen=True)
class StageDrives:
    """The drives of one stage.

    Attributes:
        stage: Index of the stage.
        walls: One drive per wall; signals count from the start of the stage that named them.
        named_by: For each wall the index of the stage that named its x, y, spin and surface;
            `NEVER` if none has (then it is fixed).
    """

    stage: int
    walls: tuple[WallDrive, ...]
    named_by: tuple[tuple[int, int, int, int], ...]

    def started(self, stage_starts: Sequence[float]) -> list[WallDrive]:
        """The drives as functions of the time since the start of this stage.

        Args:
            stage_starts: Times at which the stages up to this one have begun [s].
        """
        return [
            self._wall_since(*wall, stage_starts)
            for wall in zip(self.walls, self.named_by, strict=True)
        ]

    def _wall_since(
        self, wall: WallDrive, named_by: tuple[int, int, int, int], starts: Sequence[float]
    ) -> WallDrive:
        x, y, spin = (
            self._since(dof, number, starts)
            for dof, number in zip(wall.dofs(), named_by[:3], strict=True)
        )
        return WallDrive(x, y, spin, kept_signal(wall.surface, named_by[3], self.stage, starts))

    def _since(self, dof: DofDrive, named_by: int, starts: Sequence[float]) -> DofDrive:
        def kept(signal: Kept) -> Kept | Shifted:
            return kept_signal(signal, named_by, self.stage, starts)

        return replace(
            dof,
            velocity=kept(dof.velocity),
            position=kept(dof.position),
            force=kept(dof.force),
            stress=kept(dof.stress),
            spring=None
            if dof.spring is None
            else replace(dof.spring, anchor=kept(dof.spring.anchor)),
            is_kept=dof.has_origin and named_by != self.stage,
        )


def stage_drives(loading: Sequence[Stage], wall_names: Sequence[str]) -> list[StageDrives]:
    """The drives of all stages.

    Args:
        loading: The stages in time order.
        wall_names: Names of the walls, in the order of the engine.
    """
    resolved = resolve_dofs(loading, wall_names)
    return [
        StageDrives(
            number,
            tuple(_engine_drive(dofs) for dofs in walls),
            tuple((x.stage, y.stage, spin.stage, surface.stage) for x, y, spin, surface in walls),
        )
        for number, walls in enumerate(resolved)
    ]


def _engine_drive(dofs: WallDofs) -> WallDrive:
    x, y, spin, surface = (_engine_dof(kept.dof) for kept in dofs)
    return WallDrive(x, y, spin, surface.velocity)


def _engine_dof(dof: AnyDof) -> DofDrive:
    if isinstance(dof, FixedDof):
        return DofDrive()
    if isinstance(dof, PositionDof):
        return DofDrive(position=engine_signal(dof.position))
    if isinstance(dof, LoadDof):
        return DofDrive(
            force=None if dof.force is None else engine_signal(dof.force),
            stress=None if dof.stress is None else engine_signal(dof.stress),
            between=dof.between,
            spring=None
            if dof.spring is None
            else Spring(dof.spring.stiffness, engine_signal(dof.spring.anchor)),
            damping=dof.damping,
        )
    return DofDrive(velocity=engine_signal(dof.velocity))


def engine_signal(signal: AnySignal) -> EngineSignal:
    """The engine's form of a signal."""
    if isinstance(signal, RampSignal):
        return Ramp(signal.ramp[0], signal.ramp[1], signal.duration)
    if isinstance(signal, SineSignal):
        wave = signal.sine
        return Sine(wave.mean, wave.amplitude, wave.cycle, wave.phase)
    if isinstance(signal, TableSignal):
        return Interpolated(signal.times, signal.values)
    return Constant(signal)


def kept_signal(signal: Kept, named_by: int, stage: int, starts: Sequence[float]) -> Kept | Shifted:
    """A signal of the stage ``named_by``, or None, by the time since the start of ``stage``.

    ``starts`` are the times at which the stages up to that have begun [s].
    """
    if named_by == stage or signal is None or isinstance(signal, Constant | Shifted):
        return signal
    return Shifted(signal, starts[stage] - starts[named_by])
