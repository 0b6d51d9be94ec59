"""One time step of rigid grains with friction and heat: the phases of Moreau–Jean, in order."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numba
import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import hypot
from multicor_cli.engine.contact.adhesion import (
    attract,
    begin_attraction,
    bridge_rows,
    keep_bridges,
    longest_reach,
)
from multicor_cli.engine.contact.contacts import (
    Contacts,
    Speeds,
    begin_walls,
    scatter_impulses,
    vary_friction,
    warm_rows,
)
from multicor_cli.engine.contact.faces import (
    account_faces,
    begin_faces,
    closed_beyond,
    stop_rebounds,
)
from multicor_cli.engine.contact.flight import leave_flights_out
from multicor_cli.engine.contact.impacts import are_contacts
from multicor_cli.engine.contact.problem import ContactProblem, problem_of_step
from multicor_cli.engine.contact.rolling import begin_rolling, couples_of
from multicor_cli.engine.contact.selection import AHEAD, LASTS, SKIN, Selection
from multicor_cli.engine.contact.solve import Outcome, ResidualScale, solve_system
from multicor_cli.engine.contact.system import (
    Moved,
    OrderedSystem,
    assemble,
    begin_grains,
    pack_bodies,
    tabulate_contacts,
)
from multicor_cli.engine.contact.vector_step import OVERLAP, SUMS, VIRIAL
from multicor_cli.engine.energy.account import (
    ContactSums,
    account_contacts,
    account_grains,
    book_step,
    book_worn,
    open_books,
    switch_wall_kinetic,
)
from multicor_cli.engine.geometry.drift import cutoff_of_velocities
from multicor_cli.engine.geometry.pieces import Pieces, turned
from multicor_cli.engine.geometry.scene import Scene, scene_of
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.step import HeatStep
from multicor_cli.engine.heat.walls import WallHeat, begin_bodies
from multicor_cli.engine.inflow.population import Population
from multicor_cli.engine.inflow.rules import InflowRules
from multicor_cli.engine.jit.threads import use_threads
from multicor_cli.engine.motion.cell import carry, sides_at_end, wrap_cell
from multicor_cli.engine.motion.correction import ALLOWED, Correction, correct_positions, reach_of
from multicor_cli.engine.motion.drives import Gravity, WallDrive
from multicor_cli.engine.motion.layout import Layout
from multicor_cli.engine.motion.moves import are_sound, move, wrap
from multicor_cli.engine.motion.prediction import Prediction, Predictor, refuse_state
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.engine.orders import Interrupted, Orders, StepReport
from multicor_cli.engine.plain_step import PlainSteps
from multicor_cli.model.cell import mean_flow
from multicor_cli.model.columns import SPIN, SURFACE
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import LEAST_DIAMETERS, Floats, Ints, Model
from multicor_cli.model.state import State

NEAREST = 0.01
"""Gap up to which points of pairs with corners always count, over the mean diameter."""
PHASES = ("predict", "detect", "prepare", "solve", "account", "move", "correct")
_NOBODY, _NONE, _NO_FALL = np.empty(0, np.int64), np.empty(0), np.zeros(2)
_NOTHING_TO_SOLVE = Outcome(0.0, True, 0.0, 0.0, 0.0)
_NOTHING_TO_CORRECT = Correction(0.0, 0.0, 0.0, 0)


class Engine:
    """Advances a `State` step by step. Knows nothing of files, scenarios or terminals.

    What it works with is of three kinds: the state, which checkpoints hold and a step changes; the
    orders, which hold for a stage; and a `Layout`, which can be thrown away after any step.

    Attributes:
        model: What does not change, with all grains.
        state: What does; updated in place by `step`, untouched by a step that is interrupted.
        heat: Choices about heat, or None if there is none.
        orders: What the present stage orders; `begin` or `resume` replaces it.
        timers: Seconds spent in each phase of the time step since the start.
        moved: What the last step of the mechanics left, of the grains that are present, until the
            next; None if there is none.
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
        self.timers = dict.fromkeys(PHASES if heat is None else (*PHASES, "heat"), 0.0)
        self._marked = 0.0
        self._has_table = False
        self.moved: Moved | None = None
        self._available = min(threads, available) if threads > 0 else available
        self.heat = heat
        self._population = None if inflow is None else Population(model, state, inflow)
        self.orders = Orders()
        self._plain = PlainSteps()
        self._lay_out()
        self.resume(self.orders)

    @property
    def threads(self) -> int:
        """Number of threads that may be used."""
        return self._layout.threads

    def begin(self, orders: Orders) -> None:
        """Take up the orders of a stage, before its first step.

        Displacements of walls and their heat count from here. Energy books are opened before the
        first step of a run; later they go on, and the kinetic energy of walls that are driven in
        another way is booked.
        """
        state, before = self._gathered(), self._motion.kinetic(self.state.wall_velocity)
        self.resume(orders)
        self.state.wall_origin = self._motion.origins(state)
        if state.step > 0:
            switch_wall_kinetic(state, self._motion.kinetic(state.wall_velocity) - before)
        else:
            open_books(state, self._layout.model, self._motion)
        if orders.conditions is not None and orders.is_new is not None and self._heat is not None:
            begin_bodies(orders.conditions, orders.is_new, state.wall_temperature)

    def resume(self, orders: Orders) -> None:
        """As `begin`, in the middle of a stage: the state knows what began, and is not touched.

        Raises:
            ValueError: If there is rolling resistance, but none in the laws of the model.
        """
        laws = self.model.laws if orders.laws is None else orders.laws
        if laws.rolling.size > self.model.laws.rolling.size:
            raise ValueError("a state holds couples only if the laws of its model have them")
        still = [WallDrive()] * self.model.wall_count
        self._motion = WallMotion(
            self.model, still if orders.drives is None else list(orders.drives)
        )
        self._gravity = (
            Gravity.constant(self.model.gravity) if orders.gravity is None else orders.gravity
        )
        self.orders = orders
        self._laws = laws.with_ranges(self.model.mean_diameter)
        self._restitution = float(laws.restitution.max(initial=0.0))
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
            report = self._stand_still() if is_frozen else self._move(dt, t, should_stop)
            self._pass_heat(dt, t, should_stop)
            if self.model.sheds:
                book_worn(state, self._layout.shed())
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
        heat, is_frozen = self._heat, self.orders.is_frozen and self._layout.model.grain_count > 0
        table = (
            heat.resting_table(self._laws)
            if heat is not None and is_frozen
            else tabulate_contacts(
                self._with_table(), self._has_couples, self.model.outlines is not None
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
            ValueError: If there is rolling resistance or a cell, of which a `ContactProblem` does
                not know.
        """
        if self.model.is_cell:
            raise ValueError(
                "contact problems of a cell that is periodic in both directions cannot be written: "
                "all contacts share its velocity gradient"
            )
        with self._next_contacts(dt, t) as (scene, contacts):
            self._tabulate()
            start = np.column_stack([contacts["p_n"], contacts["p_t"]])
        inverse, free = self._motion.inverse, self._layout.free
        if self._laws.adhesion.size:
            free = free.copy()
            everyone = np.arange(self._layout.model.grain_count, dtype=np.int32)
            attract(scene, contacts, everyone, inverse, self.model.shape_factor, free)
        return problem_of_step(scene, contacts, free, inverse, self.model.shape_factor), start

    def next_system(self, dt: float, t: float) -> OrderedSystem:
        """The contact problem of the next step as the sweep sees it, not taken; as `next_start`."""
        with self._next_contacts(dt, t) as (scene, contacts):
            return self._assemble(scene, contacts)

    @contextmanager
    def _next_contacts(self, dt: float, t: float) -> Iterator[tuple[Scene, Contacts]]:
        """Contacts of the next step, sought at its q_m: a function of places and velocities."""
        layout = self._layout
        step, kept = self._predict(dt, t), layout.selection
        layout.pairs.update(step.scene, step.cutoff)
        layout.selection = Selection(layout.model, layout.pairs, layout.pieces)
        try:
            layout.selection.seek(step.scene, step.pieces, self._margin(step))
            stopped = np.zeros(layout.model.grain_count, np.bool_)
            yield step.scene, self._gather(step, self._least_gap(), stopped)[0]
        finally:
            layout.selection = kept

    # ---- Parts that an engine may have

    def _lay_out(self) -> None:
        population, (model, state), newcomers = self._population, (self.model, self.state), _NOBODY
        if population is not None:
            model, state = population.present_model, population.present
            newcomers = population.newcomers
        layout = self._layout = Layout(model, state, newcomers, self._available)
        model = layout.model
        self._heat = (
            None
            if self.heat is None
            else HeatStep(model, state, self.heat, layout.unworn, layout.pieces)
        )
        self._begin_heat()
        self.moved = None

    def _begin_heat(self) -> None:
        conditions = self.orders.conditions
        if self._heat is not None:
            self._heat.begin(
                [WallHeat()] * self.model.wall_count if conditions is None else conditions
            )

    def _gathered(self) -> State:
        if self._population is not None:
            self._population.gather()
        return self._layout.state

    def _with_table(self) -> Moved | None:
        """What the last step left, contacts of two grains in the table."""
        if self.moved is not None and not self._has_table:
            self._tabulate()
            self._has_table = True
        return self.moved

    @property
    def _has_couples(self) -> bool:
        return self._laws.rolling.size > 0

    # ---- The mechanics of a step

    def _stand_still(self) -> StepReport:
        count = self._layout.state.contact_i.size
        return StepReport(0.0, True, 0.0, 0.0, 0.0, count, count, 0.0)

    def _move(self, dt: float, t: float, should_stop: Callable[[], bool] | None) -> StepReport:
        """The mechanics of a step. Until the contacts are solved nothing of the state changes."""
        layout, state = self._layout, self._layout.state
        use_threads(layout.threading.favorite)
        self.moved = None  # free the contacts of the last step before there are new ones
        if state.step == 0:
            open_books(state, layout.model, self._motion)
        if layout.model.grain_count == 0:
            return self._move_walls_alone(dt, t)
        selection = layout.selection
        self._marked = time.perf_counter()

        step = self._predict(dt, t)
        self._clock("predict")

        if self._is_plain(step):
            return self._move_plainly(step, should_stop)
        loaded = state.contact_i, state.contact_j, state.contact_point

        # Contacts serve until another pair may close in a step; where the solved velocities carry
        # one that far, all are solved once more with it.
        self._select(step)
        self._clock("detect")
        margin, is_missing, least = 0.0, True, self._least_gap()
        stopped = np.zeros(layout.model.grain_count, np.bool_)
        while is_missing:
            contacts, scale, is_solved, lacking, beyond = self._gather(step, least, stopped)
            if lacking > 0.0:
                selection.seek(step.scene, step.pieces, max(self._margin(step), lacking))
                continue
            ordered = self._assemble(step.scene, contacts)
            self._clock("prepare")
            outcome = _NOTHING_TO_SOLVE
            if is_solved:
                outcome = solve_system(
                    ordered.system, scale, self.orders.settings, layout.threading, should_stop
                )
            self._clock("solve")
            after = ordered.collect(contacts)
            if step.pieces is not None and self._restitution > 0.0 and stop_rebounds(
                step.scene, step.pieces, layout.before, layout.free, after,
                layout.model.grains.mass, selection.faces, contacts, stopped,
            ):  # fmt: skip
                contacts["p_n"], contacts["p_t"], selection.lanes.impulse[:] = 0.0, 0.0, 0.0
                continue
            cutoff = self._cutoff_after(step, after)
            self._list_up_to(cutoff, step)
            is_missing, fastest = selection.closing(
                step.scene, step.pieces, after, after, self._far(step, cutoff, after), dt, -math.inf
            )
            if is_missing:
                margin = max(2.0 * margin, 1.5 * dt * fastest, self._margin(step))
                selection.seek(step.scene, step.pieces, margin)
                self._select_impacts(step)
            elif step.pieces is not None:
                closed = closed_beyond(
                    step.scene, step.pieces, layout.before, after, dt, selection.faces, beyond,
                )  # fmt: skip
                if closed > 0.0:  # points that were too far may meet with these velocities
                    least, is_missing = 2.0 * closed, True
            self._clock("detect")
        outcome.require_convergence(self.orders.settings, state.step)
        return self._end(step, contacts, after, outcome, cutoff, loaded)

    # ---- The same of discs, where nothing happens but contacts: in two calls and a solve

    def _is_plain(self, step: Prediction) -> bool:
        """Whether `_move_plainly` takes the step: with the same bits."""
        is_rare = step.growth is not None or step.pieces is not None or self.model.is_cell
        if is_rare or self._layout.threads > 1 or not self._laws.are_plain:
            return False
        return self._plain.knows(rebounds=self._restitution > 0.0)

    def _move_plainly(self, step: Prediction, should_stop: Callable[[], bool] | None) -> StepReport:
        layout, state, motion, settings = (
            self._layout, self._layout.state, self._motion, self.orders.settings,
        )  # fmt: skip
        selection, plain, n = layout.selection, self._plain, layout.model.grain_count
        loaded = state.contact_i, state.contact_j, state.contact_point
        weight = step.dt * hypot(*step.gravity.tolist())
        thrust = step.dt * motion.pressure() * layout.model.mean_diameter
        is_loaded = weight > 0.0 or thrust > 0.0

        begun = plain.begin(layout, step, motion, self._laws, is_loaded=is_loaded)
        if begun is None:
            self._select(step)
            self._clock("detect")
        struck = _NOBODY if step.flight is None else step.flight.struck
        began, margin, ended = state.position[struck], 0.0, None
        while ended is None:
            if begun is None:
                selection.schedule(step.scene, motion.is_free, self._laws, layout.before, state)
                begun = plain.begin(
                    layout, step, motion, self._laws, is_loaded=is_loaded, are_sought=True
                )
                assert begun is not None  # the list and the contacts are those that are needed
            speeds, is_solved = begun
            scale = ResidualScale.of(
                speeds, layout.mass, n, weight, thrust, 0.0, self._restitution, step.rounding
            )
            self._clock("prepare")
            outcome = _NOTHING_TO_SOLVE
            if is_solved:
                outcome = solve_system(
                    selection.system(layout.model.shape_factor), scale, settings, layout.threading,
                    should_stop,
                )  # fmt: skip
            self._clock("solve")
            is_enough = outcome.converged or settings.on_failure == "warn"
            ended, fastest = plain.end(layout, step, motion, is_enough=is_enough)
            if fastest > 0.0:
                margin = max(2.0 * margin, 1.5 * step.dt * fastest, self._margin(step))
                selection.seek(step.scene, None, margin)
                self._select_impacts(step)
                begun = None
            else:
                outcome.require_convergence(settings, state.step)
        if not math.isfinite(ended.kinetic):
            refuse_state(layout)
        state.wall_surface = motion.surface_after(state)
        strayed = _NONE
        if self._heat is not None:
            strayed = 0.5 * step.dt * (layout.before[:n, :2] + ended.after[:n, :2])
            strayed[struck] = (state.position[struck] - began)[:, :2]
        layout.middle[struck] = 0.5 * (began + state.position[struck])
        gravity_work = ended.gravity_work
        if step.flight is not None:
            gravity_work += step.flight.gravity_work
        self._clock("move")
        overlap = float(ended.sums.total[OVERLAP])
        correction = self._correct(
            step, ended.end, None, _NONE, ended.cutoff, overlap, ended.beside
        )
        self._clock("correct")
        book_step(
            state, motion, ended.sums, ended.kinetic, gravity_work, correction, outcome, step.dt,
        )  # fmt: skip
        return self._report(
            step, selection.contacts, ended.after, outcome, correction, ended.sums, loaded, strayed
        )

    def _predict(self, dt: float, t: float) -> Prediction:
        temperature = np.empty(0)
        if self._heat is not None and self._laws.depends_on_temperature:
            temperature = self._heat.shape_temperatures(t)
        return Predictor(self._layout, self._motion, self._laws, self._restitution > 0.0).predict(
            self._gravity.value(t + 0.5 * dt), temperature, dt, t
        )

    def _end(
        self, step: Prediction, contacts: Contacts, after: Floats, outcome: Outcome, cutoff: float,
        loaded: tuple[Ints, Ints, Ints],
    ) -> StepReport:  # fmt: skip
        """The step with the velocities that were found: motion, books, and what comes next."""
        layout, state, selection = self._layout, self._layout.state, self._layout.selection
        n, grains, dt = layout.model.grain_count, layout.model.grains, step.dt
        struck = _NOBODY if step.flight is None else step.flight.struck
        began = state.position[struck]
        gradient = state.wall_velocity[0] if self.model.is_cell else _NONE
        strayed = 0.5 * dt * (state.velocity[:, :2] + after[:n, :2])
        growth, expansion_work = step.growth, 0.0
        if growth is not None:
            state.radius[:], state.velocity[:, SPIN] = grains.radius, growth.velocity[:, SPIN]
            expansion_work = growth.spun + layout.work_of_growth(growth.rate, dt, contacts)
        kinetic, gravity_work = move(
            layout.middle, layout.before, after, layout.model.spin_radius, grains.mass,
            step.gravity, self.model.shape_factor, dt, state.position, state.velocity,
        )  # fmt: skip
        if self.model.is_cell:
            carry(layout.middle, after[n, :3], 0.5 * dt, state.position)
            if struck.size:  # the way to q_m is not theirs
                way, half_way = state.position[struck] - began, began + state.position[struck]
                way[:, :2] -= 0.25 * dt * mean_flow(half_way, gradient + after[n, :3])
                strayed[struck] = way[:, :2]
            state.nonaffine += strayed
        elif struck.size:
            strayed[struck] = (state.position[struck] - began)[:, :2]
        if not math.isfinite(kinetic):
            refuse_state(layout)
        wall_after = np.where(self._motion.driven, after[n:, :3], layout.free[n:, :3])
        self._move_walls(step.scene.wall_position, wall_after, dt)
        self._clock("move")
        # Beside the scene at q_m, which heat still looks at
        end = scene_of(layout.model, state.position, state.wall_position)
        pieces = None if layout.pieces is None else turned(layout.pieces, end)
        selection.give(state)
        virial = np.zeros(4)
        if step.flight is not None:
            # Impulses of impacts do not last: no later step begins with them
            virial = selection.enter(step.flight.impacts, step.scene, after)
            gravity_work += step.flight.gravity_work
        sums, overlaps = self._account(step, end, pieces, contacts, after, virial)
        if struck.size:
            # The way to q_m is not theirs: heat looks at them half-way
            layout.middle[struck] = 0.5 * (began + state.position[struck])
        self._clock("account")
        beside = selection.overlap_beside(end, pieces)
        overlap = float(sums.total[OVERLAP])
        correction = self._correct(step, end, pieces, overlaps, cutoff, overlap, beside)
        self._clock("correct")
        book_step(
            state, self._motion, sums, kinetic, gravity_work, correction, outcome, dt,
            expansion_work,
        )  # fmt: skip
        if layout.pieces is None:
            self._plain.learn(layout, step, self._motion, rebounds=self._restitution > 0.0)
        return self._report(step, contacts, after, outcome, correction, sums, loaded, strayed)

    def _report(
        self, step: Prediction, contacts: Contacts, after: Floats, outcome: Outcome,
        correction: Correction, sums: ContactSums, loaded: tuple[Ints, Ints, Ints], strayed: Floats,
    ) -> StepReport:  # fmt: skip
        """What the next step, heat and observers are to know of this one."""
        layout, state, selection = self._layout, self._layout.state, self._layout.selection
        if self._has_couples:
            state.contact_couple = couples_of(contacts)[contacts["p_n"] > 0.0]
        elif layout.model.laws.rolling.size:
            state.contact_couple = np.zeros(state.contact_i.size)
        state.last_dt = step.dt
        layout.newcomers = _NOBODY
        self.moved = Moved(step.scene, contacts, after, selection.i, selection.j, *loaded, strayed)
        self._has_table = False
        self._clock("account")
        return StepReport(
            outcome.sweeps, outcome.converged, outcome.rms, outcome.maximum, outcome.energy,
            int(state.contact_i.size),
            contacts.size, correction.overlap, sums.wall_impulse,
        )  # fmt: skip

    def _move_walls_alone(self, dt: float, t: float) -> StepReport:
        layout, motion, w = self._layout, self._motion, self.model.wall_count
        state = layout.state
        walls = motion.predict(state, self._gravity.value(t + 0.5 * dt), t, dt)
        if not are_sound(walls, motion.before, state.wall_position, motion.belt_before):
            refuse_state(layout)
        self._move_walls(state.wall_position + 0.5 * dt * motion.before, walls, dt)
        sums = ContactSums(np.zeros(SUMS), np.zeros((w, 3)), np.zeros(w), 0.0)
        book_step(state, motion, sums, 0.0, 0.0, _NOTHING_TO_CORRECT, _NOTHING_TO_SOLVE, dt)
        state.last_dt = dt
        return StepReport(0.0, True, 0.0, 0.0, 0.0, 0, 0, 0.0, sums.wall_impulse)

    def _cutoff_after(self, step: Prediction, after: Floats) -> float:
        """A gap that no pair closes in the step with the velocities v⁺ [m]."""
        layout = self._layout
        walls = after[layout.model.grain_count :, :3].copy()
        return cutoff_of_velocities(
            step.scene, after, _NO_FALL, walls, walls, self._motion.extent, step.dt,
            layout.pairs.largest,
        )  # fmt: skip

    def _far(self, step: Prediction, cutoff: float, bodies: Floats) -> float:
        """A gap that no points of a pair close [m], with spins too.

        ``cutoff`` is one that no pair closes by moving on, with the velocities of ``bodies``.
        """
        model, pieces = self._layout.model, self._layout.pieces
        if pieces is None or not pieces.is_face.any():
            return cutoff
        count, reach = model.grain_count, model.grains.radius / model.spin_radius
        turning = float(np.abs(bodies[:count, SURFACE] * reach).max(initial=0.0))
        return cutoff + 2.0 * AHEAD * step.dt * turning

    def _least_gap(self) -> float:
        """Gap up to which all points of pairs with corners count [m]."""
        return max(NEAREST * self._layout.model.mean_diameter, longest_reach(self._laws))

    # ---- Its contacts

    def _select(self, step: Prediction) -> None:
        """The contacts of the state, or others if a pair that is none of them may close."""
        layout, scene = self._layout, step.scene
        reach = longest_reach(self._laws)
        layout.selection.take(layout.state)
        layout.pairs.update(scene, step.cutoff)
        cutoff = self._far(step, step.cutoff, layout.before)
        if layout.selection.closing(
            scene, step.pieces, layout.before, layout.free, cutoff, AHEAD * step.dt, reach
        )[0]:
            layout.selection.seek(scene, step.pieces, self._margin(step))
        self._select_impacts(step)

    def _select_impacts(self, step: Prediction) -> None:
        """All pairs that have had an impact are contacts."""
        selection = self._layout.selection
        if step.flight is not None and not are_contacts(
            step.flight.impacts, selection.i, selection.j
        ):
            selection.add(step.scene, step.flight.impacts)

    def _margin(self, step: Prediction) -> float:
        """Gap up to which contacts are sought [m]."""
        layout = self._layout
        margin = layout.selection.margin(
            step.scene, layout.before, layout.free, step.cutoff, step.dt
        )
        reach = longest_reach(self._laws)
        return reach + max(margin, SKIN * self.model.mean_diameter) if reach > 0.0 else margin

    def _list_up_to(self, gap: float, step: Prediction) -> None:
        """Let the list be complete up to a gap at q_m, where it has been looked at before."""
        layout = self._layout
        if gap > layout.pairs.complete:
            layout.pairs.update(step.scene, gap)

    def _gather(
        self, step: Prediction, least: float, stopped: NDArray[np.bool_]
    ) -> tuple[Contacts, ResidualScale, bool, float, Floats]:
        """The contacts, warm-started, the scale of the residuals, and if any is to be solved.

        Last what `begin_faces` returns, with ``least`` and ``stopped``: up to where room was
        lacking, and how far points are that do not count.
        """
        layout, state, laws, dt = self._layout, self._layout.state, self._laws, step.dt
        selection, scene, start = layout.selection, step.scene, layout.before
        contacts, i, j = selection.contacts, selection.i, selection.j
        lanes = selection.schedule(scene, self._motion.is_free, laws, start, state)
        ratio = dt / state.last_dt if state.last_dt > 0.0 else 0.0
        pack_bodies(
            scene, start, layout.free, lanes.place, lanes.velocity, lanes.start, lanes.middle
        )
        grains = begin_grains(
            lanes.middle, lanes.start, lanes.pair, lanes.about, lanes.frame, lanes.impulse,
            lanes.before, lanes.gap, lanes.branch, dt, ratio, scene.period, scene.height,
            scene.tilt, *self._gradient(start),
        )  # fmt: skip
        walls = begin_walls(scene, laws, start, dt, ratio, lanes.of_walls, contacts)
        faces, beyond, lacking = None, _NONE, 0.0
        if selection.faces.first.size:
            assert step.pieces is not None
            faces, lacking, beyond = begin_faces(
                scene, step.pieces, laws, start, layout.free, dt, ratio, least, LASTS * dt,
                selection.faces, selection.faces.most, stopped, contacts,
            )  # fmt: skip
        opening = None
        if step.growth is not None:
            opening = layout.push(step.growth.rate, dt, contacts)
        if laws.softening_rate.size or laws.table_speed.size or laws.flash_speed.size:
            vary_friction(scene, laws, i, j, lanes.slot, lanes.before, lanes.frame)
        if laws.adhesion.size or laws.rolling.size:
            self._tabulate()
        attraction = self._begin_adhesion(scene, step.pieces, dt) if laws.adhesion.size else 0.0
        if laws.rolling.size:
            row = warm_rows(layout.model.grain_count, state.contact_i)
            begin_rolling(
                scene, laws, start, row, state.contact_j, state.contact_couple, ratio, contacts
            )
            contacts["mu_r"][selection.faces.rows] = 0.0  # which is for discs to have
        speeds, is_solved = [grains, walls], True
        closing = grains.closing or walls.closing or (faces is not None and faces.closing)
        if opening is not None and not closing:
            speeds.append(opening)
        if faces is not None:
            speeds.append(faces)
        if step.flight is not None:
            left = leave_flights_out(
                scene, step.flight.flying, self._motion.is_free, i, j, lanes.lane, lanes.frame,
                lanes.before, contacts,
            )  # fmt: skip
            speeds.append(step.flight.speeds)
            is_solved = left > 0
        model = layout.model
        scale = ResidualScale.of(
            Speeds(*map(sum, zip(*speeds, strict=True))), layout.mass, model.grain_count,
            dt * hypot(*step.gravity.tolist()),
            dt * self._motion.pressure() * model.mean_diameter, attraction, self._restitution,
            step.rounding,
        )  # fmt: skip
        if scale.velocity == 0.0 or not is_solved:
            # Nothing closes and nothing pushes: the last impulses must not act once more.
            lanes.impulse[:] = 0.0
            contacts["p_n"], contacts["p_t"], contacts["p_r"] = 0.0, 0.0, 0.0
        return contacts, scale, is_solved, lacking, beyond

    def _begin_adhesion(self, scene: Scene, pieces: Pieces | None, dt: float) -> float:
        """Attraction into all contacts and free velocities; returns the largest F Δt [N s]."""
        layout, selection = self._layout, self._layout.selection
        contacts, lanes = selection.contacts, selection.lanes
        bridges = bridge_rows(layout.state, layout.model.grain_count)
        begin_attraction(
            scene, pieces, self._laws, contacts, selection.i, selection.j, layout.before,
            *bridges, dt, selection.faces, layout.state.contact_i.size == 0,
        )  # fmt: skip
        scatter_impulses(contacts, lanes.slot, lanes.impulse)
        attract(
            scene, contacts, lanes.place, self._motion.inverse, layout.model.shape_factor,
            lanes.velocity,
        )  # fmt: skip
        return float(contacts["attraction"].max(initial=0.0))

    def _assemble(self, scene: Scene, contacts: Contacts) -> OrderedSystem:
        layout, motion = self._layout, self._motion
        return assemble(
            scene, contacts, layout.selection.lanes, motion.belt, motion.inverse,
            layout.model.shape_factor, self._has_couples, layout.pieces is not None,
        )  # fmt: skip

    def _tabulate(self) -> None:
        """Contacts of two grains into the table: for laws and results that look at it."""
        self._layout.selection.tabulate()

    def _gradient(self, bodies: Floats) -> tuple[float, float, float]:
        """That of a cell, by the velocities of all bodies; else zeros."""
        if not self.model.is_cell:
            return 0.0, 0.0, 0.0
        xx, yy, xy = bodies[self._layout.model.grain_count, :3].tolist()
        return xx, yy, xy

    def _account(
        self, step: Prediction, end: Scene, pieces: Pieces | None, contacts: Contacts,
        after: Floats, virial: Floats,
    ) -> tuple[ContactSums, Floats]:  # fmt: skip
        """What the contacts lose and exert; bridges that are left go into the state.

        ``virial`` is what that of contacts lacks in a cell, by impacts. Also returns what pairs
        with corners overlap, over their smaller radii, as `account_faces` finds it.
        """
        laws, selection = self._laws, self._layout.selection
        lanes = selection.lanes
        if laws.adhesion.size or laws.rolling.size:
            self._tabulate()
            keep_bridges(end, pieces, laws, contacts, self._layout.state)
            of_discs = np.ones(contacts.size, np.bool_)
            of_discs[selection.faces.rows] = False
            which, of_grains = np.flatnonzero(of_discs).astype(np.int32), np.zeros(SUMS)
        else:
            which, of_grains = lanes.of_walls, account_grains(
                lanes.middle, lanes.velocity, lanes.pair, lanes.about, lanes.frame, lanes.impulse,
                lanes.before, lanes.gap, lanes.branch, step.dt, step.scene.period,
                *self._gradient(after),
            )  # fmt: skip
        sums = account_contacts(step.scene, end, contacts, after, which, of_grains)
        overlaps = np.zeros(selection.faces.first.size)
        if pieces is not None:
            attracted = account_faces(
                step.scene, end, pieces, contacts, after, selection.faces, step.dt, sums.total,
                sums.wall_impulse, sums.belt_impulse, overlaps,
            )  # fmt: skip
            sums = sums._replace(adhesion_work=sums.adhesion_work + attracted)
        if self.model.is_cell:
            sums.total[VIRIAL : VIRIAL + 4] += virial
            of_contacts = sums.total[[VIRIAL, VIRIAL + 3, VIRIAL + 1]]
            sums.wall_impulse[0] = of_contacts + step.convected
        return sums, overlaps

    def _move_walls(self, middle: Floats, after: Floats, dt: float) -> None:
        state = self._layout.state
        state.wall_velocity, state.wall_surface = after, self._motion.surface_after(state)
        state.wall_position = middle + 0.5 * dt * after
        if self.model.is_cell:
            state.wall_position = sides_at_end(middle[0], after[0], 0.5 * dt)[np.newaxis]

    def _correct(
        self, step: Prediction, end: Scene, pieces: Pieces | None, overlaps: Floats, cutoff: float,
        overlap: float, beside: float,
    ) -> Correction:  # fmt: skip
        layout, state, model = self._layout, self._layout.state, self._layout.model
        selection = layout.selection
        correction = Correction(max(overlap, beside), 0.0, 0.0, 0)
        if correction.overlap > ALLOWED:
            # What is near must not depend on the age of the list
            near = reach_of(correction.overlap, model)
            self._list_up_to(cutoff + near, step)
            i, j, below = selection.pair_i, selection.pair_j, 0.0
            if overlaps.size:
                is_deep = overlaps > ALLOWED
                i, j = selection.pairs_with(is_deep)
                below = float(overlaps[~is_deep].max(initial=0.0))
            if beside > ALLOWED:
                i, j = selection.with_walls()
            correction = correct_positions(
                end, pieces, model, step.gravity, self._motion, layout.pairs, i, j, near, below,
                layout.marked, state.step,
            )  # fmt: skip
        if step.shift_work != 0.0:
            work = correction.gravity_work + step.shift_work
            correction = correction._replace(gravity_work=work)
        if model.is_cell:
            wrap_cell(state.position, state.wall_position[0])
        elif model.period > 0.0:
            wrap(state.position, state.image, model.period)
        return correction

    # ---- The heat of a step

    def _pass_heat(self, dt: float, t: float, should_stop: Callable[[], bool] | None) -> None:
        heat = self._heat
        if heat is None:
            return
        self._marked = time.perf_counter()
        if not self.orders.is_heat_on:
            heat.skip(dt, t)
        elif self._layout.model.grain_count == 0:
            heat.flow_nowhere(dt, t)
        elif self.orders.is_frozen or self.moved is None:
            heat.flow_at_rest(dt, t, should_stop)
        else:
            laws = self._laws
            is_plain = not (laws.adhesion.size or laws.rolling.size)
            if heat.reads_table or not is_plain:
                self._with_table()
            heat.flow(self.moved, self._layout.selection.lanes, dt, t, is_plain=is_plain)
        self._clock("heat")

    def _clock(self, phase: str) -> None:
        """Add the time since the last mark to a phase."""
        now = time.perf_counter()
        self.timers[phase] += now - self._marked
        self._marked = now
