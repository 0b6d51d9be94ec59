"""Mechanics and heat as one: what the run controller advances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import net_impulses, resting_attraction
from multicor_cli.engine.contact.problem import ContactProblem
from multicor_cli.engine.contact.solve import Settings
from multicor_cli.engine.contact.step_report import StepReport
from multicor_cli.engine.heat.spots import resting_contacts
from multicor_cli.engine.heat.step import HeatEngine, MovedContacts
from multicor_cli.engine.heat.walls import WallHeat
from multicor_cli.engine.motion.drives import AnyGravity, WallDrive
from multicor_cli.engine.step import Engine
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import ContactLaws, Floats
from multicor_cli.model.state import State


class CoupledEngine:
    """Takes the mechanical step, then lets its heat flow; in frozen stages only heat flows.

    Heat acts back on the mechanics through the coefficient of friction alone (where it depends on temperature), with the
    temperatures at the start of the step.
    """

    def __init__(self, mechanics: Engine, heat: HeatEngine | None) -> None:
        """Join the two; without ``heat`` this is the mechanics alone."""
        self.mechanics = mechanics
        self.heat = heat
        self._is_on = heat is not None
        self._is_frozen = False

    @property
    def state(self) -> State:
        """The state of both."""
        return self.mechanics.state

    @property
    def settings(self) -> Settings:
        """Choices of the contact solver."""
        return self.mechanics.settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        self.mechanics.settings = settings

    def set_laws(self, laws: ContactLaws) -> None:
        """Choose the contact laws, at the start of a stage or in its middle: those of the model, but for friction."""
        self.mechanics.laws = laws

    @property
    def timers(self) -> dict[str, float]:
        """Seconds spent in each phase of the time step."""
        heat = {} if self.heat is None else {"heat": self.heat.seconds}
        return {**self.mechanics.timers, **heat}

    @property
    def threads(self) -> int:
        """Number of threads that may be used."""
        return self.mechanics.threads

    def exchange(self) -> None:
        """Let grains go and come before a step: none does here, see `multicor_cli.engine.exchange`."""

    def welcome(self, grains: NDArray[np.int64]) -> None:
        """Say which grains have come since the last step."""
        self.mechanics.newcomers = grains

    def set_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, at the start of a stage."""
        self.mechanics.set_drives(drives)

    def resume_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, in the middle of a stage."""
        self.mechanics.resume_drives(drives)

    def set_gravity(self, gravity: AnyGravity) -> None:
        """Choose gravity, at the start of a stage or in its middle."""
        self.mechanics.set_gravity(gravity)

    def set_heat(self, conditions: list[WallHeat], *, is_on: bool, is_frozen: bool) -> None:
        """Choose what heat does in a stage; the state is not touched, so this also serves a resumed stage.

        Args:
            conditions: Thermal conditions of the walls.
            is_on: Whether temperatures change.
            is_frozen: Whether grains and walls stand still.
        """
        self._is_on, self._is_frozen = is_on and self.heat is not None, is_frozen
        if self.heat is not None:
            self.heat.set_conditions(conditions)
            self.heat.last = None

    def begin_heat(self, is_new: NDArray[np.bool_]) -> None:
        """At the start of a stage: walls with a heat capacity and a new condition, shape ``(w,)``, get their first temperature."""
        if self.heat is not None:
            self.heat.begin_conditions(is_new)

    def step(self, dt: float, t: float, should_stop: Callable[[], bool] | None = None) -> StepReport:
        """Advance by one time step; arguments and errors as `Engine.step` and `HeatEngine.step`."""
        if self._is_frozen and self.heat is not None:
            return self._advance(self.heat, dt, t, should_stop)
        state, mechanics = self.state, self.mechanics
        loaded_i, loaded_j = state.contact_i, state.contact_j
        self._soften(t)
        report = mechanics.step(dt, t, should_stop)
        moved = mechanics.moved
        if self.heat is not None and not self._is_on:
            self.heat.forget_averages()
            self.heat.note_walls(dt, t)
        elif self.heat is not None and moved is not None:
            self.heat.step(MovedContacts(*moved, loaded_i, loaded_j), dt, t)
        return report

    def next_start(self, dt: float, t: float) -> tuple[ContactProblem, Floats]:
        """As `Engine.next_start`."""
        self._soften(t)
        return self.mechanics.next_start(dt, t)

    def _soften(self, t: float) -> None:
        """Tell the mechanics the temperatures at the start of a step, where friction depends on them."""
        if self.heat is not None and self.mechanics.laws.depends_on_temperature:
            self.mechanics.shape_temperature = self.heat.shape_temperatures(t)

    def contacts(self) -> ContactTable:
        """Contacts of the last step with their heat; in frozen stages those that stand still."""
        if self.heat is None:
            return self.mechanics.contacts()
        table = self._resting_table(self.heat) if self._is_frozen else self.mechanics.contacts()
        last, count = self.heat.last, table.i.size
        if last is None or last.conductance.size != count:
            return replace(table, heat=np.zeros(count), conductance=np.zeros(count))
        return replace(table, heat=last.generated, conductance=last.conductance)

    def _advance(self, heat: HeatEngine, dt: float, t: float, should_stop: Callable[[], bool] | None) -> StepReport:
        """A step in which nothing moves."""
        state = self.state
        heat.advance(dt, t, should_stop)
        state.step += 1
        state.stage_step += 1
        state.frozen_steps += 1
        state.time = state.stage_start + state.stage_step * dt
        count = state.contact_i.size
        return StepReport(0.0, True, 0.0, 0.0, 0.0, count, count, 0.0)

    def _resting_table(self, heat: HeatEngine) -> ContactTable:
        """The contacts through which heat flows in a frozen stage, with the impulses of the last step."""
        state, scene = self.state, heat.resting_scene()
        i, j = heat.resting_contacts()
        gap, normal = np.empty(i.size), np.empty((i.size, 2))
        resting_contacts(scene, i, j, gap, normal)
        none = np.zeros(i.size)
        impulse, couple = np.zeros((i.size, 2)), none
        laws = self.mechanics.laws
        if state.last_dt > 0.0:
            impulse = net_impulses(state.contact_impulse, resting_attraction(laws, scene, i, j, state.last_dt))
            couple = state.contact_couple
        sticking = np.zeros(i.size, np.bool_)
        return ContactTable(i, j, normal, gap, impulse, none, sticking, couple=couple if laws.rolling.size else None)
