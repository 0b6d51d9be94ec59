"""The mechanics of a step: contacts, their solve, and the motion of grains and walls with it."""

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from multicor_cli.engine.contact.contacts import Contacts
from multicor_cli.engine.contact.faces import closed_beyond, stop_rebounds
from multicor_cli.engine.contact.rolling import couples_of
from multicor_cli.engine.contact.selection import Selection, deepest_overlap
from multicor_cli.engine.contact.solve import Outcome, solve_system
from multicor_cli.engine.contact.system import Moved
from multicor_cli.engine.contact.vector_step import OVERLAP, SUMS
from multicor_cli.engine.energy.account import ContactSums, book_step, open_books
from multicor_cli.engine.geometry.pieces import Pieces, turned
from multicor_cli.engine.geometry.scene import Scene, scene_of
from multicor_cli.engine.jit.threads import use_threads
from multicor_cli.engine.motion.cell import carry, require_room, sides_at_end, wrap_cell
from multicor_cli.engine.motion.correction import ALLOWED, Correction, correct_positions, reach_of
from multicor_cli.engine.motion.drives import Gravity, WallDrive
from multicor_cli.engine.motion.layout import Layout
from multicor_cli.engine.motion.moves import are_sound, move, wrap
from multicor_cli.engine.motion.prediction import Prediction, Predictor, refuse_state
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.engine.orders import Orders, StepReport
from multicor_cli.engine.plain_step import PlainSteps
from multicor_cli.engine.step_contacts import StepContacts
from multicor_cli.model.cell import mean_flow
from multicor_cli.model.columns import SPIN
from multicor_cli.model.model import Floats, Ints, Model

PHASES = ("predict", "detect", "prepare", "solve", "account", "move", "correct")
_NOBODY, _NONE, _NO_FALL = np.empty(0, np.int64), np.empty(0), np.zeros(2)
_NOTHING_TO_SOLVE = Outcome(0.0, True, 0.0, 0.0, 0.0)
_NOTHING_TO_CORRECT = Correction(0.0, 0.0, 0.0, 0)


class Clock:
    """Seconds spent in each phase of the time step since the start."""

    def __init__(self, phases: Iterable[str]) -> None:
        self.seconds = dict.fromkeys(phases, 0.0)
        self._marked = 0.0

    def start(self) -> None:
        self._marked = time.perf_counter()

    def stop(self, phase: str) -> None:
        """Add the time since the last mark to a phase, and mark the beginning of the next."""
        now = time.perf_counter()
        self.seconds[phase] += now - self._marked
        self._marked = now


class Mechanics:
    """The mechanics of the steps of an engine.

    Attributes:
        model: What does not change, with all grains.
        layout: What steps work on, made for the grains that are present.
        motion: How walls move in the present stage; ``laws`` and ``settings`` are its laws of
            contacts and the settings of its solver.
        moved: What the last step left, of the grains that are present, until the next; None if
            there is none.
        clock: Adds up the time of each phase.
    """

    layout: Layout
    moved: Moved | None

    def __init__(self, model: Model, clock: Clock, *, has_heat: bool) -> None:
        """Let walls stand still until something else is ordered; `lay_out` has to follow."""
        self.model, self.clock, self._has_heat = model, clock, has_heat
        self._plain = PlainSteps()
        self.take_up(Orders())

    def lay_out(self, layout: Layout) -> None:
        """Work on these grains from now on."""
        self.layout, self.moved, self._has_table = layout, None, False

    def take_up(self, orders: Orders) -> None:
        """Take up the orders of a stage; the state is not touched.

        Raises:
            ValueError: If there is rolling resistance, but none in the laws of the model.
        """
        laws = self.model.laws if orders.laws is None else orders.laws
        if laws.rolling.size > self.model.laws.rolling.size:
            raise ValueError("a state holds couples only if the laws of its model have them")
        still = [WallDrive()] * self.model.wall_count
        self.motion = WallMotion(
            self.model, still if orders.drives is None else list(orders.drives)
        )
        self._gravity = (
            Gravity.constant(self.model.gravity) if orders.gravity is None else orders.gravity
        )
        self.settings = orders.settings
        self.laws = laws.with_ranges(self.model.mean_diameter)
        self._restitution = float(laws.restitution.max(initial=0.0))

    @property
    def contacts(self) -> StepContacts:
        """Of steps with the present orders."""
        return StepContacts(self.model, self.layout, self.motion, self.laws, self._restitution)

    @property
    def has_couples(self) -> bool:
        """Whether contacts resist rolling."""
        return self.laws.rolling.size > 0

    def with_table(self) -> Moved | None:
        """What the last step left, contacts of two grains in the table."""
        if self.moved is not None and not self._has_table:
            self.layout.selection.tabulate()
            self._has_table = True
        return self.moved

    @contextmanager
    def next_contacts(
        self, dt: float, t: float, temperature: Floats
    ) -> Iterator[tuple[Scene, Contacts]]:
        """Contacts of the next step, sought at its q_m: a function of places and velocities."""
        layout = self.layout
        step, kept = self._predict(dt, t, temperature), layout.selection
        layout.pairs.update(step.scene, step.cutoff)
        layout.selection = Selection(layout.model, layout.pairs, layout.pieces)
        try:
            self.contacts.seek(step)
            stopped = np.zeros(layout.model.grain_count, np.bool_)
            yield step.scene, self.contacts.gather(step, self.contacts.least_gap(), stopped)[0]
        finally:
            layout.selection = kept

    # ---- A step

    def advance(
        self, dt: float, t: float, temperature: Floats, should_stop: Callable[[], bool] | None
    ) -> StepReport:
        """The mechanics of a step. Until the contacts are solved nothing of the state changes.

        ``temperature`` is that of all shapes, of size 0 if no law depends on it; other arguments
        and what is raised as `Engine.step`.
        """
        layout, state = self.layout, self.layout.state
        use_threads(layout.threading.favorite)
        self.moved = None  # free the contacts of the last step before there are new ones
        if state.step == 0:
            open_books(state, layout.model, self.motion)
        if layout.model.grain_count == 0:
            return self._move_walls_alone(dt, t)
        selection = layout.selection
        self.clock.start()

        step = self._predict(dt, t, temperature)
        self.clock.stop("predict")

        if self._is_plain(step):
            return self._move_plainly(step, should_stop)
        loaded = state.contact_i, state.contact_j, state.contact_point
        step_contacts = self.contacts

        # Contacts serve until another pair may close in a step; where the solved velocities carry
        # one that far, all are solved once more with it.
        step_contacts.select(step)
        self.clock.stop("detect")
        margin, is_missing, least = 0.0, True, step_contacts.least_gap()
        stopped = np.zeros(layout.model.grain_count, np.bool_)
        while is_missing:
            contacts, scale, is_solved, lacking, beyond = step_contacts.gather(step, least, stopped)
            if lacking > 0.0:
                step_contacts.seek(step, lacking)
                continue
            ordered = step_contacts.assemble(step.scene, contacts)
            self.clock.stop("prepare")
            outcome = _NOTHING_TO_SOLVE
            if is_solved:
                outcome = solve_system(
                    ordered.system, scale, self.settings, layout.threading, should_stop
                )
            self.clock.stop("solve")
            after = ordered.collect(contacts)
            if step.pieces is not None and self._restitution > 0.0 and stop_rebounds(
                step.scene, step.pieces, layout.before, layout.free, after,
                layout.model.grains.mass, selection.faces, contacts, stopped,
            ):  # fmt: skip
                contacts["p_n"], contacts["p_t"], selection.lanes.impulse[:] = 0.0, 0.0, 0.0
                continue
            cutoff = step_contacts.cutoff_after(step, after)
            step_contacts.list_up_to(cutoff, step)
            far = step_contacts.far(step, cutoff, after)
            is_missing, fastest = selection.closing(
                step.scene, step.pieces, after, after, far, dt, -math.inf
            )
            if is_missing:
                margin = step_contacts.seek(step, max(2.0 * margin, 1.5 * dt * fastest))
                step_contacts.select_impacts(step)
            elif step.pieces is not None:
                closed = closed_beyond(
                    step.scene, step.pieces, layout.before, after, dt, selection.faces, beyond,
                )  # fmt: skip
                if closed > 0.0:  # points that were too far may meet with these velocities
                    least, is_missing = 2.0 * closed, True
            self.clock.stop("detect")
        outcome.require_convergence(self.settings, state.step)
        return self._end(step, contacts, after, outcome, cutoff, loaded)

    # ---- The same of discs, where nothing happens but contacts: in two calls and a solve

    def _is_plain(self, step: Prediction) -> bool:
        """Whether `_move_plainly` takes the step: with the same bits."""
        is_rare = step.growth is not None or step.pieces is not None or self.model.is_cell
        if is_rare or self.layout.threads > 1 or not self.laws.are_plain:
            return False
        return self._plain.knows(rebounds=self._restitution > 0.0)

    def _move_plainly(self, step: Prediction, should_stop: Callable[[], bool] | None) -> StepReport:
        layout, state, motion, settings = (
            self.layout, self.layout.state, self.motion, self.settings,
        )  # fmt: skip
        selection, contacts, plain = layout.selection, self.contacts, self._plain
        n = layout.model.grain_count
        loaded = state.contact_i, state.contact_j, state.contact_point
        pushes = contacts.pushes(step)
        begun, closes = plain.begin(layout, step, motion, self.laws, is_loaded=any(pushes))
        if begun is None:
            contacts.select(step, closes=closes)
            self.clock.stop("detect")
        struck = _NOBODY if step.flight is None else step.flight.struck
        began, margin, ended = state.position[struck] if struck.size else _NONE, 0.0, None
        while ended is None:
            if begun is None:
                selection.schedule(step.scene, motion.is_free, self.laws, layout.before, state)
                begun, _ = plain.begin(
                    layout, step, motion, self.laws, is_loaded=any(pushes), are_sought=True
                )
                assert begun is not None  # the list and the contacts are those that are needed
            speeds, is_solved = begun
            scale = contacts.scale(step, speeds, pushes)
            self.clock.stop("prepare")
            outcome = _NOTHING_TO_SOLVE
            if is_solved:
                outcome = solve_system(
                    selection.system(layout.model.shape_factor), scale, settings, layout.threading,
                    should_stop,
                )  # fmt: skip
            self.clock.stop("solve")
            is_enough = outcome.converged or settings.on_failure == "warn"
            ended, fastest = plain.end(layout, step, motion, is_enough=is_enough)
            if fastest > 0.0:
                margin = contacts.seek(step, max(2.0 * margin, 1.5 * step.dt * fastest))
                contacts.select_impacts(step)
                begun = None
            else:
                outcome.require_convergence(settings, state.step)
        if not math.isfinite(ended.kinetic):
            refuse_state(layout)
        state.wall_surface = motion.surface_after(state)
        strayed = _NONE
        if self._has_heat:
            strayed = 0.5 * step.dt * (layout.before[:n, :2] + ended.after[:n, :2])
        if struck.size:  # the way to q_m is not theirs
            if self._has_heat:
                strayed[struck] = (state.position[struck] - began)[:, :2]
            layout.middle[struck] = 0.5 * (began + state.position[struck])
        gravity_work = ended.gravity_work
        if step.flight is not None:
            gravity_work += step.flight.gravity_work
        self.clock.stop("move")
        overlap = float(ended.sums.total[OVERLAP])
        correction = self._correct(
            step, ended.end, None, _NONE, ended.cutoff, overlap, ended.beside
        )
        self.clock.stop("correct")
        book_step(
            state, motion, ended.sums, ended.kinetic, gravity_work, correction, outcome, step.dt,
        )  # fmt: skip
        return self._report(
            step, selection.contacts, ended.after, outcome, correction, ended.sums, loaded, strayed
        )

    def _predict(self, dt: float, t: float, temperature: Floats) -> Prediction:
        return Predictor(self.layout, self.motion, self.laws, self._restitution > 0.0).predict(
            self._gravity.value(t + 0.5 * dt), temperature, dt, t
        )

    def _end(
        self, step: Prediction, contacts: Contacts, after: Floats, outcome: Outcome, cutoff: float,
        loaded: tuple[Ints, Ints, Ints],
    ) -> StepReport:  # fmt: skip
        """The step with the velocities that were found: motion, books, and what comes next."""
        layout, state, selection = self.layout, self.layout.state, self.layout.selection
        n, grains, dt = layout.model.grain_count, layout.model.grains, step.dt
        struck = _NOBODY if step.flight is None else step.flight.struck
        began = state.position[struck]
        gradient = _NONE
        if self.model.is_cell:
            gradient, sides = state.wall_velocity[0], step.scene.wall_position[0]
            require_room(
                sides_at_end(sides, after[n, :3], 0.5 * dt), layout.pairs.largest, state.step
            )
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
        wall_after = np.where(self.motion.driven, after[n:, :3], layout.free[n:, :3])
        self._move_walls(step.scene.wall_position, wall_after, dt)
        self.clock.stop("move")
        # Beside the scene at q_m, which heat still looks at
        end = scene_of(layout.model, state.position, state.wall_position)
        pieces = None if layout.pieces is None else turned(layout.pieces, end)
        selection.give(state)
        virial = np.zeros(4)
        if step.flight is not None:
            # Impulses of impacts do not last: no later step begins with them
            virial = selection.enter(step.flight.impacts, step.scene, after)
            gravity_work += step.flight.gravity_work
        sums, overlaps = self.contacts.account(step, end, pieces, contacts, after, virial)
        if struck.size:
            # The way to q_m is not theirs: heat looks at them half-way
            layout.middle[struck] = 0.5 * (began + state.position[struck])
        self.clock.stop("account")
        # Others did not close: on a straight way a gap between discs is convex, so they are apart.
        # But pieces of walls may turn or curve
        beside = deepest_overlap(end, pieces, *selection.walls_beside)
        overlap = float(sums.total[OVERLAP])
        correction = self._correct(step, end, pieces, overlaps, cutoff, overlap, beside)
        self.clock.stop("correct")
        book_step(
            state, self.motion, sums, kinetic, gravity_work, correction, outcome, dt,
            expansion_work,
        )  # fmt: skip
        if layout.pieces is None:
            self._plain.learn(layout, step, self.motion, rebounds=self._restitution > 0.0)
        return self._report(step, contacts, after, outcome, correction, sums, loaded, strayed)

    def _report(
        self, step: Prediction, contacts: Contacts, after: Floats, outcome: Outcome,
        correction: Correction, sums: ContactSums, loaded: tuple[Ints, Ints, Ints], strayed: Floats,
    ) -> StepReport:  # fmt: skip
        """What the next step, heat and observers are to know of this one."""
        layout, state, selection = self.layout, self.layout.state, self.layout.selection
        if self.has_couples:
            state.contact_couple = couples_of(contacts)[contacts["p_n"] > 0.0]
        elif layout.model.laws.rolling.size:
            state.contact_couple = np.zeros(state.contact_i.size)
        state.last_dt = step.dt
        layout.newcomers = _NOBODY
        self.moved = Moved(
            step.scene, contacts, after, selection.i, selection.j, *loaded, strayed,
            self.motion.mobility, None if step.flight is None else step.flight.impacts,
        )  # fmt: skip
        self._has_table = False
        self.clock.stop("account")
        return StepReport(
            outcome.sweeps, outcome.converged, outcome.rms, outcome.maximum, outcome.energy,
            int(state.contact_i.size),
            contacts.size, correction.overlap, sums.wall_impulse,
        )  # fmt: skip

    def _move_walls_alone(self, dt: float, t: float) -> StepReport:
        layout, motion, w = self.layout, self.motion, self.model.wall_count
        state = layout.state
        walls = motion.predict(state, self._gravity.value(t + 0.5 * dt), t, dt)
        if not are_sound(walls, motion.before, state.wall_position, motion.belt_before):
            refuse_state(layout)
        self._move_walls(state.wall_position + 0.5 * dt * motion.before, walls, dt)
        sums = ContactSums(np.zeros(SUMS), np.zeros((w, 3)), np.zeros(w), 0.0)
        book_step(state, motion, sums, 0.0, 0.0, _NOTHING_TO_CORRECT, _NOTHING_TO_SOLVE, dt)
        state.last_dt = dt
        return StepReport(0.0, True, 0.0, 0.0, 0.0, 0, 0, 0.0, sums.wall_impulse)

    def _move_walls(self, middle: Floats, after: Floats, dt: float) -> None:
        state = self.layout.state
        state.wall_velocity, state.wall_surface = after, self.motion.surface_after(state)
        state.wall_position = middle + 0.5 * dt * after
        if self.model.is_cell:
            state.wall_position = sides_at_end(middle[0], after[0], 0.5 * dt)[np.newaxis]

    def _correct(
        self, step: Prediction, end: Scene, pieces: Pieces | None, overlaps: Floats, cutoff: float,
        overlap: float, beside: float,
    ) -> Correction:  # fmt: skip
        layout, state, model = self.layout, self.layout.state, self.layout.model
        selection = layout.selection
        correction = Correction(max(overlap, beside), 0.0, 0.0, 0)
        if correction.overlap > ALLOWED:
            # What is near must not depend on the age of the list
            near = reach_of(correction.overlap, model)
            self.contacts.list_up_to(cutoff + near, step)
            if overlaps.size:
                is_deep = overlaps > ALLOWED
                i, j = selection.pairs_with(is_deep)
                below = float(overlaps[~is_deep].max(initial=0.0))
            else:
                i, j, below = self.contacts.deep_pairs(ALLOWED)
            if beside > ALLOWED:
                i, j = selection.with_walls()
            correction = correct_positions(
                end, pieces, model, step.gravity, self.motion, layout.pairs, i, j, near, below,
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
