"""Beginning a loading stage, or going on with one: what an engine is told, whoever carries the stage out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.solve import Settings
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import AnyGravity, WallDrive
from multicor_cli.model import ContactLaws, State
from multicor_cli.running.conditions import KINETIC
from multicor_cli.running.plan import StagePlan


class Staged(Protocol):
    """What a stage needs of `multicor_cli.engine.coupled.CoupledEngine`."""

    settings: Settings

    @property
    def state(self) -> State:
        """What is advanced."""

    def set_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, at the start of a stage."""

    def resume_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, in the middle of a stage."""

    def set_laws(self, laws: ContactLaws) -> None:
        """Choose the contact laws, at the start of a stage or in its middle."""

    def set_gravity(self, gravity: AnyGravity) -> None:
        """Choose gravity, at the start of a stage or in its middle."""

    def set_heat(self, conditions: list[WallHeat], *, is_on: bool, is_frozen: bool) -> None:
        """Choose what heat does, at the start of a stage or in its middle."""

    def begin_heat(self, is_new: NDArray[np.bool_]) -> None:
        """Give walls with a heat capacity whose condition is new, shape ``(w,)``, the temperature with which they begin."""


def begin_stage(engine: Staged, stage: StagePlan, starts: Sequence[float]) -> None:
    """Tell an engine what a stage asks for, before its first step.

    Args:
        engine: What carries the stage out.
        stage: The stage.
        starts: Times at which the stages up to this one have begun [s].
    """
    _choose(engine, stage, starts)
    engine.set_drives(stage.drives.started(starts))
    if stage.heat is not None:
        engine.begin_heat(stage.heat.conditions.beginning())
    state = engine.state
    state.stage_peak = float(state.books[KINETIC]) if state.step > 0 else 0.0
    if stage.until is not None:
        state.stage_notes = stage.until.first_notes(state)


def resume_stage(engine: Staged, stage: StagePlan, starts: Sequence[float]) -> None:
    """As `begin_stage`, somewhere in the stage: the books and the peak are those of its steps so far."""
    _choose(engine, stage, starts)
    engine.resume_drives(stage.drives.started(starts))


def _choose(engine: Staged, stage: StagePlan, starts: Sequence[float]) -> None:
    engine.settings = stage.settings
    if stage.laws is not None:
        engine.set_laws(stage.laws)
    if stage.gravity is not None:
        engine.set_gravity(stage.gravity.started(starts))
    if stage.heat is not None:
        engine.set_heat(stage.heat.conditions.started(starts), is_on=stage.heat.is_on, is_frozen=stage.heat.is_frozen)
