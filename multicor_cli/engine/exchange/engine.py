"""Mechanics and heat of the grains that are there, in a state that knows all of them; also where there is none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.solve import Interrupted, Outcome, Settings
from multicor_cli.engine.contact.step_report import PhysicsError, StepReport
from multicor_cli.engine.coupled import CoupledEngine
from multicor_cli.engine.energy import account
from multicor_cli.engine.energy.account import book_step, open_books, switch_wall_kinetic
from multicor_cli.engine.exchange.passage import pass_grains
from multicor_cli.engine.exchange.rules import ExchangeRules
from multicor_cli.engine.heat.books import book_undelivered
from multicor_cli.engine.heat.walls import WallHeat, WallValues, begin_bodies
from multicor_cli.engine.motion.drives import AnyGravity, Gravity, WallDrive
from multicor_cli.engine.motion.separation import Correction
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.books import stored_fields
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.faults import LARGEST, find_absurd_value
from multicor_cli.model.model import ContactLaws, Model
from multicor_cli.model.state import Presence, State

# ---- A step without any grain: the walls move, and nothing meets them

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


# ---- Mechanics and heat of the grains that are there, in a state that knows all of them

MakeEngine = Callable[[Model, State], CoupledEngine]
"""Makes the engine of a model and a state without exchange."""


def _fields_of(*dims: str) -> tuple[str, ...]:
    return tuple(name for name, about in stored_fields(State).items() if about.dims[0] in dims)


_OF_GRAINS = _fields_of("grain", "heat_grain")
_SHAPES = ("contact_i", "contact_j", "mean_i", "mean_j")
_SHARED = tuple(
    name for name in stored_fields(State) if name not in (*_OF_GRAINS, *_SHAPES, *_fields_of("exchange_grain", "exchange_group"))
)
"""What the state of the grains that are there has in common with that of all grains."""


class OpenEngine:
    """A `CoupledEngine` for the grains that are there, made anew whenever one comes or goes; it has the same methods.

    The engine inside knows nothing of grains that wait or have gone: they cost nothing, and no loop can meet one. Whatever it needs
    is in the state, as after a stop, but for who has come since the last step: being made anew changes no result.

    Attributes:
        model: All grains.
        state: The state of all grains, which checkpoints hold.
        rules: How grains come and go.
    """

    def __init__(self, model: Model, state: State, rules: ExchangeRules, make: MakeEngine) -> None:
        """Set up.

        Args:
            model: All grains.
            state: The state of all grains.
            rules: How grains come and go.
            make: Makes the engine for the grains that are there.

        Raises:
            ValueError: As `Engine`.
        """
        self.model, self.state, self.rules = model, state, rules
        self._make = make
        self._settings = Settings()
        self._drives: list[WallDrive] | None = None
        self._laws: ContactLaws | None = None
        self._gravity: AnyGravity | None = None
        self._heat: tuple[list[WallHeat], bool, bool] | None = None
        self._seconds: dict[str, float] = {}
        self._came: NDArray[np.int64] = np.empty(0, np.int64)
        self._before: State | None = None
        self._inner = self._made()

    @property
    def settings(self) -> Settings:
        """Choices of the contact solver."""
        return self._settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        self._settings = self._inner.settings = settings

    @property
    def threads(self) -> int:
        """Number of threads that may be used."""
        return self._inner.threads

    @property
    def timers(self) -> dict[str, float]:
        """Seconds spent in each phase of the time step."""
        inner = self._inner.timers
        return {name: self._seconds.get(name, 0.0) + inner.get(name, 0.0) for name in {**self._seconds, **inner}}

    def set_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, at the start of a stage."""
        self._drives = drives
        self._share(self.state, self._inner.state)
        self._inner.set_drives(drives)
        self._share(self._inner.state, self.state)

    def resume_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do, in the middle of a stage."""
        self._drives = drives
        self._inner.resume_drives(drives)

    def set_laws(self, laws: ContactLaws) -> None:
        """Choose the contact laws, at the start of a stage or in its middle."""
        self._laws = laws
        self._inner.set_laws(laws)

    def set_gravity(self, gravity: AnyGravity) -> None:
        """Choose gravity, at the start of a stage or in its middle."""
        self._gravity = gravity
        self._inner.set_gravity(gravity)

    def set_heat(self, conditions: list[WallHeat], *, is_on: bool, is_frozen: bool) -> None:
        """Choose what heat does in a stage."""
        self._heat = conditions, is_on, is_frozen
        self._inner.set_heat(conditions, is_on=is_on, is_frozen=is_frozen)

    def begin_heat(self, is_new: NDArray[np.bool_]) -> None:
        """Give walls with a heat capacity their first temperature, at the start of a stage."""
        self._share(self.state, self._inner.state)
        self._inner.begin_heat(is_new)
        self._share(self._inner.state, self.state)

    def exchange(self) -> None:
        """Let grains go and come before a step; nothing more happens if it is called twice.

        Raises:
            PhysicsError: If a grain is lost and that is to end the run.
        """
        came = pass_grains(self.rules, self.model, self.state, self._keep)
        if came is not None:
            self._came = came
            self._remake()

    def step(self, dt: float, t: float, should_stop: Callable[[], bool] | None = None) -> StepReport:
        """Advance by one time step; arguments and errors as `CoupledEngine.step`.

        If it is interrupted, the state is what it was before grains came and went: they have to be new to the step that follows.
        """
        self._share(self.state, self._inner.state)
        try:
            report = self._inner.step(dt, t, should_stop)
        except Interrupted:
            self._go_back()
            raise
        self._take_over()
        self._came, self._before = self._came[:0], None
        return report

    def contacts(self) -> ContactTable:
        """Contacts of the last step, by the numbers of all grains."""
        table = self._inner.contacts()
        return replace(table, i=self._number[table.i], j=self._number[table.j])

    def _keep(self) -> None:
        """Remember the state before grains come and go."""
        if self._before is None:
            self._before = State.from_dict({name: value.copy() for name, value in self.state.as_dict().items()})

    def _go_back(self) -> None:
        if self._before is not None:
            for name, value in vars(self._before).items():
                setattr(self.state, name, value)
            self._came, self._before = self._came[:0], None
            self._remake()

    def _remake(self) -> None:
        self._seconds = self.timers
        self._inner = self._made()

    def _made(self) -> CoupledEngine | EmptyEngine:
        """The engine of the grains that are there, told what has been chosen."""
        model, state = self.model, self.state
        here = np.flatnonzero(state.presence == Presence.THERE)
        self._here: NDArray[np.int64] = here
        shapes = np.arange(model.grain_count, model.grain_count + model.shape_count)
        self._number: NDArray[np.int32] = np.concatenate([here, shapes]).astype(np.int32)
        inner_model, inner_state = model.with_grains(here), self._state_of(here)
        engine = self._make(inner_model, inner_state) if here.size else EmptyEngine(inner_model, inner_state)
        if isinstance(engine, CoupledEngine):
            engine.welcome(np.searchsorted(here, self._came))
        engine.settings = self._settings
        if self._drives is not None:
            engine.resume_drives(self._drives)
        if self._laws is not None:
            engine.set_laws(self._laws)
        if self._gravity is not None:
            engine.set_gravity(self._gravity)
        if self._heat is not None:
            conditions, is_on, is_frozen = self._heat
            engine.set_heat(conditions, is_on=is_on, is_frozen=is_frozen)
        return engine

    def _state_of(self, here: NDArray[np.int64]) -> State:
        state, inner = self.state, State()
        self._share(state, inner)
        for name in _OF_GRAINS:
            values = getattr(state, name)
            setattr(inner, name, values[here] if values.size else values)
        place = np.full(self.model.grain_count + self.model.shape_count, -1, np.int32)
        place[self._number] = np.arange(self._number.size, dtype=np.int32)
        for name in _SHAPES:
            setattr(inner, name, place[getattr(state, name)])
        return inner

    def _take_over(self) -> None:
        """Enter into the state of all grains what has become of those that are there."""
        state, inner = self.state, self._inner.state
        self._share(inner, state)
        for name in _OF_GRAINS:
            values = getattr(state, name)
            if values.size:
                values[self._here] = getattr(inner, name)
        for name in _SHAPES:
            setattr(state, name, self._number[getattr(inner, name)])

    @staticmethod
    def _share(source: State, target: State) -> None:
        for name in _SHARED:
            setattr(target, name, getattr(source, name))
