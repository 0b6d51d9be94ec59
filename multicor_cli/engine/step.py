"""One time step of grains: who comes and goes, the mechanics, and heat, in this order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numba
import numpy as np

from multicor_cli.engine.contact.adhesion import attract
from multicor_cli.engine.contact.problem import ContactProblem, problem_of_step
from multicor_cli.engine.contact.system import OrderedSystem, tabulate_contacts
from multicor_cli.engine.energy.account import book_worn, open_books, switch_wall_kinetic
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.step import HeatStep
from multicor_cli.engine.heat.walls import WallHeat, WallValues, begin_bodies
from multicor_cli.engine.inflow import Population
from multicor_cli.engine.mechanics import PHASES, Clock, Mechanics
from multicor_cli.engine.motion.layout import Layout
from multicor_cli.engine.orders import InflowRules, Interrupted, Orders, StepReport
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import LEAST_DIAMETERS, Floats, Model
from multicor_cli.model.state import State

_NOBODY, _NO_TEMPERATURE = np.empty(0, np.int64), np.empty(0)


class Engine:
    """Advances a `State` step by step. Knows nothing of files, scenarios or terminals.

    What it works with is of three kinds: the state, which checkpoints hold and a step changes; the
    orders, which hold for a stage; and a `Layout`, which can be thrown away after any step.

    Attributes:
        model: What does not change, with all grains.
        state: What does; updated in place by `step`, untouched by a step that is interrupted.
        heat: Choices about heat, or None if there is none.
        timers: Seconds spent in each phase of the time step since the start.
        mechanics: How grains and walls move in a step.
        orders: What the present stage orders; `begin` or `resume` replaces it.
    """

    def __init__(
        self,
        model: Model,
        state: State,
        *,
        threads: int = 0,
        heat: HeatSettings | None = None,
        inflow: InflowRules | None = None,
    ) -> None:
        """Set up the engine; until it is told otherwise, walls stand still and are insulated.

        Args:
            model: The model.
            state: The state to advance.
            threads: Number of threads; 0 takes all that are available.
            heat: Choices about heat; None: there is none.
            inflow: How grains come and go; None: none does.

        Raises:
            ValueError: If the period is too short for the grains, or the model has no heat
                capacities for the heat.
        """
        available = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
        largest = float(model.grains.radius.max(initial=0.0))
        for period in (model.period, model.height):
            if 0.0 < period < 2.0 * LEAST_DIAMETERS * largest:
                message = (
                    f"the period {period:g} m is less than four times the largest diameter "
                    f"{2.0 * largest:g} m"
                )
                raise ValueError(message)
        self.model, self.state = model, state
        self._clock = Clock(PHASES if heat is None else (*PHASES, "heat"))
        self.timers = self._clock.seconds
        self._available = min(threads, available) if threads > 0 else available
        self.heat = heat
        self._population = None if inflow is None else Population(model, state, inflow)
        self.orders = Orders()
        self.mechanics = Mechanics(model, self._clock, has_heat=heat is not None)
        self._lay_out()

    @property
    def threads(self) -> int:
        """Number of threads that may be used."""
        return self.mechanics.layout.threads

    def begin(self, orders: Orders) -> None:
        """Take up the orders of a stage, before its first step.

        Displacements of walls and their heat count from here. Energy books are opened before the
        first step of a run; later they go on, and the kinetic energy of walls that are driven in
        another way is booked.
        """
        state, before = self._gathered(), self.mechanics.motion.kinetic(self.state.wall_velocity)
        self.resume(orders)
        motion = self.mechanics.motion
        self.state.wall_origin = motion.origins(state)
        if state.step > 0:
            switch_wall_kinetic(state, motion.kinetic(state.wall_velocity) - before)
        else:
            open_books(state, self.mechanics.layout.model, motion)
        if orders.conditions is not None and orders.is_new is not None and self._heat is not None:
            begin_bodies(orders.conditions, orders.is_new, state.wall_temperature)
            if state.step == 0:  # the first frame knows what walls are told, not what they were
                values = WallValues(orders.conditions, 0.0)
                state.wall_temperature[:] = values.temperatures(0.0, state.wall_temperature)

    def resume(self, orders: Orders) -> None:
        """As `begin`, in the middle of a stage: the state knows what began, and is not touched.

        Raises:
            ValueError: If there is rolling resistance, but none in the laws of the model.
        """
        self.mechanics.take_up(orders)
        self.orders = orders
        self._begin_heat()

    def pass_grains(self) -> None:
        """Let grains go and come, once before each step.

        `step` does, unless it has been done to begin a stage with those present.

        Raises:
            PhysicsError: If a grain is lost and that is to end the run.
        """
        if self._population is not None and self._population.pass_grains():
            self._lay_out()

    def step(
        self, dt: float, t: float, should_stop: Callable[[], bool] | None = None
    ) -> StepReport:
        """Advance by one time step.

        Args:
            dt: Time step [s].
            t: Time since the start of the stage at the beginning of the step [s].
            should_stop: Asked now and then during a long solve.

        Raises:
            Interrupted: If ``should_stop`` says so; the state is that before the step, and before
                grains came or went.
            PhysicsError: If the state is not finite, the solver fails and ``on_failure`` is
                "error", no admissible positions exist, a temperature cannot be integrated, or a
                grain is lost and that is to end the run.
        """
        is_frozen = self.orders.is_frozen
        if not is_frozen:
            self.pass_grains()
        state = self._gathered()
        try:
            if is_frozen:
                count = state.contact_i.size
                report = StepReport(0.0, True, 0.0, 0.0, 0.0, count, count, 0.0)
            else:
                report = self.mechanics.advance(dt, t, self._temperature(t), should_stop)
            self._pass_heat(dt, t, should_stop)
            if self.model.sheds:
                book_worn(state, self.mechanics.layout.shed())
        except Interrupted:
            if self._population is not None and self._population.go_back():
                self._lay_out()
            raise
        state.step += 1
        state.stage_step += 1
        state.frozen_steps += is_frozen
        state.time = state.stage_start + state.stage_step * dt
        if self._population is not None:
            self._population.scatter()
        return report

    def contacts(self) -> ContactTable:
        """Contacts of the last step, sorted by (i, j): those within reach, loaded or not.

        In frozen stages those that stand still. Empty before the first step and after an
        interrupted one.
        """
        heat, mechanics = self._heat, self.mechanics
        is_frozen = self.orders.is_frozen and mechanics.layout.model.grain_count > 0
        table = (
            heat.resting_table(mechanics.laws)
            if heat is not None and is_frozen
            else tabulate_contacts(
                mechanics.with_table(), mechanics.has_couples, self.model.outlines is not None
            )
        )
        if heat is not None:
            none, known = np.zeros(table.i.size), heat.of_contacts
            generated, conductance = (
                (none, none) if known is None or known[0].size != none.size else known
            )
            table = replace(table, heat=generated, conductance=conductance)
        if self._population is not None:
            number = self._population.number
            table = replace(table, i=number[table.i], j=number[table.j])
        return table

    def next_start(self, dt: float, t: float) -> tuple[ContactProblem, Floats]:
        """The contact problem of the next step, without taking it: to save, compare and study.

        Arguments as `step`.

        Returns:
            The problem, and the impulses from which the solver would start [N s], shape ``(c, 2)``.
            With adhesion free velocities hold the attraction, and normal impulses are q_n = p_n +
            F Δt (theory §3.1).

        Raises:
            ValueError: If there is rolling resistance, a cell, or a grain that is no disc, of which
                a `ContactProblem` does not know.
        """
        if self.model.outlines is not None:
            raise ValueError("contact problems of grains that are no discs cannot be written")
        if self.model.is_cell:
            raise ValueError(
                "contact problems of a cell that is periodic in both directions cannot be written: "
                "all contacts share its velocity gradient"
            )
        mechanics = self.mechanics
        with mechanics.next_contacts(dt, t, self._temperature(t)) as (scene, contacts):
            mechanics.layout.selection.tabulate()
            start = np.column_stack([contacts["p_n"], contacts["p_t"]])
        inverse, free = mechanics.motion.inverse, mechanics.layout.free
        if mechanics.laws.adhesion.size:
            free = free.copy()
            everyone = np.arange(mechanics.layout.model.grain_count, dtype=np.int32)
            attract(scene, contacts, everyone, inverse, self.model.shape_factor, free)
        return problem_of_step(scene, contacts, free, inverse, self.model.shape_factor), start

    def next_system(self, dt: float, t: float) -> OrderedSystem:
        """The contact problem of the next step as the sweep sees it, not taken; as `next_start`."""
        with self.mechanics.next_contacts(dt, t, self._temperature(t)) as (scene, contacts):
            return self.mechanics.contacts.assemble(scene, contacts)

    # ---- Parts that an engine may have

    def _lay_out(self) -> None:
        population, (model, state), newcomers = self._population, (self.model, self.state), _NOBODY
        if population is not None:
            model, state = population.present_model, population.present
            newcomers = population.newcomers
        layout = Layout(model, state, newcomers, self._available)
        self.mechanics.lay_out(layout)
        model = layout.model
        self._heat = (
            None
            if self.heat is None
            else HeatStep(model, state, self.heat, layout.unworn, layout.pieces)
        )
        self._begin_heat()

    def _begin_heat(self) -> None:
        conditions = self.orders.conditions
        if self._heat is not None:
            self._heat.begin(
                [WallHeat()] * self.model.wall_count if conditions is None else conditions
            )

    def _gathered(self) -> State:
        if self._population is not None:
            self._population.gather()
        return self.mechanics.layout.state

    # ---- Phases of a step

    def _temperature(self, t: float) -> Floats:
        """Temperatures of all shapes [K], if laws of contact depend on them; else of size 0."""
        if self._heat is None or not self.mechanics.laws.depends_on_temperature:
            return _NO_TEMPERATURE
        return self._heat.shape_temperatures(t)

    def _pass_heat(self, dt: float, t: float, should_stop: Callable[[], bool] | None) -> None:
        heat, mechanics = self._heat, self.mechanics
        if heat is None:
            return
        self._clock.start()
        if not self.orders.is_heat_on:
            heat.skip(dt, t)
        elif mechanics.layout.model.grain_count == 0:
            heat.flow_nowhere(dt, t)
        elif self.orders.is_frozen or mechanics.moved is None:
            heat.flow_at_rest(dt, t, should_stop)
        else:
            laws = mechanics.laws
            is_plain = not (laws.adhesion.size or laws.rolling.size)
            if heat.reads_table or not is_plain:
                mechanics.with_table()
            heat.flow(mechanics.moved, mechanics.layout.selection.lanes, dt, t, is_plain=is_plain)
        self._clock.stop("heat")
