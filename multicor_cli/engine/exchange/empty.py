"""A step without any grain: the walls move, and nothing meets them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.report import PhysicsError, StepReport
from multicor_cli.engine.contact.solve import Outcome, Settings
from multicor_cli.engine.energy import account
from multicor_cli.engine.energy.books import book_step, open_books, switch_wall_kinetic
from multicor_cli.engine.heat.books import book_undelivered
from multicor_cli.engine.heat.walls import WallHeat, WallValues, begin_bodies
from multicor_cli.engine.motion.correction import Correction
from multicor_cli.engine.motion.drives import WallDrive
from multicor_cli.engine.motion.gravity import AnyGravity, Gravity
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.faults import LARGEST, find_absurd_value
from multicor_cli.model.model import ContactLaws, Model
from multicor_cli.model.state import State

_NOTHING_TO_SOLVE = Outcome(0.0, True, 0.0, 0.0, 0.0)
_NOTHING_TO_CORRECT = Correction(0.0, 0.0, 0.0, 0)


class EmptyEngine:
    """Does for a model without grains what `CoupledEngine` does for others; it has the same methods."""

    threads = 1

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self.settings = Settings()
        self.timers: dict[str, float] = {}
        self._motion = WallMotion(model, [WallDrive()] * model.wall_count)
        self._gravity: AnyGravity = Gravity.constant(model.gravity)
        self._conditions: Sequence[WallHeat] = [WallHeat()] * model.wall_count
        self._is_on = model.thermal is not None
        self._is_frozen = False

    def set_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, at the start of a stage."""
        before = self._motion.kinetic(self.state.wall_velocity)
        self.resume_drives(drives)
        self.state.wall_origin = self._motion.origins(self.state)
        if self.state.step > 0:
            switch_wall_kinetic(self.state, self._motion.kinetic(self.state.wall_velocity) - before)
        else:
            open_books(self.state, self.model, self._motion)

    def resume_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, in the middle of a stage."""
        self._motion = WallMotion(self.model, drives)

    def set_laws(self, laws: ContactLaws) -> None:
        """Nothing rubs here."""

    def begin_heat(self, is_new: NDArray[np.bool_]) -> None:
        """As `CoupledEngine.begin_heat`."""
        if self.model.thermal is not None:
            begin_bodies(self._conditions, is_new, self.state.wall_temperature)

    def set_gravity(self, gravity: AnyGravity) -> None:
        """Choose gravity."""
        self._gravity = gravity

    def set_heat(self, conditions: list[WallHeat], *, is_on: bool, is_frozen: bool) -> None:
        """Choose what heat does in a stage."""
        self._conditions = conditions
        self._is_on, self._is_frozen = is_on and self.model.thermal is not None, is_frozen

    def step(self, dt: float, t: float, should_stop: Callable[[], bool] | None = None) -> StepReport:
        """Advance by one time step; arguments as `CoupledEngine.step`.

        Raises:
            PhysicsError: If the motion of a wall is not finite.
        """
        state = self.state
        if self._is_frozen:
            state.frozen_steps += 1
        else:
            self._move_walls(dt, t)
            state.last_dt = dt
        if self.model.thermal is not None:
            self._pass_heat(dt, t)
        state.step += 1
        state.stage_step += 1
        state.time = state.stage_start + state.stage_step * dt
        return StepReport(0.0, True, 0.0, 0.0, 0.0, 0, 0, 0.0, np.zeros((self.model.wall_count, 3)))

    def contacts(self) -> ContactTable:
        """No contacts."""
        return ContactTable.empty()

    def _move_walls(self, dt: float, t: float) -> None:
        state, motion = self.state, self._motion
        if state.step == 0:
            open_books(state, self.model, motion)
        after = motion.predict(state, self._gravity.value(t + 0.5 * dt), t, dt)
        if not (np.abs(after) <= LARGEST).all() or not (np.abs(motion.belt_before) <= LARGEST).all():
            raise PhysicsError(state.step, find_absurd_value(state, self.model) or "the velocity of a wall is not finite")
        state.wall_position = state.wall_position + 0.5 * dt * motion.before + 0.5 * dt * after
        state.wall_velocity, state.wall_surface = after, motion.surface_after(state)
        sums = account.ContactSums(np.zeros(account.SUMS), np.zeros((self.model.wall_count, 3)), np.zeros(self.model.wall_count))
        book_step(state, motion, sums, 0.0, 0.0, _NOTHING_TO_CORRECT, _NOTHING_TO_SOLVE, dt)

    def _pass_heat(self, dt: float, t: float) -> None:
        values = WallValues(self._conditions, t)
        self.state.wall_temperature = values.temperatures(dt, self.state.wall_temperature)
        if self._is_on:
            book_undelivered(self.state, values.undelivered(dt, np.zeros(0, np.int32)))
