"""One time step of rigid grains with Coulomb friction: the phases of Moreau–Jean time stepping, in order."""

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
from multicor_cli.arithmetic.sums import column_totals, total
from multicor_cli.engine.contact.contacts import (
    StepContacts,
    WarmStart,
    attract,
    closing_distance,
    find_missed,
    gather_contacts,
    measure_pairs,
    warm_rows,
)
from multicor_cli.engine.contact.ordering import Scheduler
from multicor_cli.engine.contact.problem import ContactProblem, problem_of_step
from multicor_cli.engine.contact.solve import Outcome, ResidualScale, Settings, ThreadChoice, solve_system
from multicor_cli.engine.contact.step_report import PhysicsError, StepReport
from multicor_cli.engine.contact.system import OrderedSystem, assemble, tabulate_contacts
from multicor_cli.engine.energy import account
from multicor_cli.engine.energy.account import book_step, open_books, switch_wall_kinetic
from multicor_cli.engine.geometry.drift import fit_drift
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.scene import Scene, scene_of
from multicor_cli.engine.jit.chunks import chunks_for
from multicor_cli.engine.jit.threads import PARALLEL_GRAINS
from multicor_cli.engine.motion.drives import AnyGravity, Gravity, WallDrive
from multicor_cli.engine.motion.moves import move, predict, wrap
from multicor_cli.engine.motion.separation import correct_positions
from multicor_cli.engine.motion.unseen import find_unseen, stop_unseen
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.columns import BELT, COUPLE
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.faults import LARGEST, find_absurd_value
from multicor_cli.model.model import LEAST_DIAMETERS, Floats, Model
from multicor_cli.model.state import State

SLIPS_RMS, SLIPS = 50.0, 10.0
"""Scales of the rms and of the largest velocity correction over the mean slip between grains: by default 5 % and half of it."""
PHASES = ("predict", "detect", "prepare", "solve", "account", "move", "correct")


class Engine:
    """Advances a `State` step by step. Knows nothing of files, scenarios or terminals.

    Attributes:
        model: What does not change.
        state: What does; updated in place by `step`, untouched by a step that is interrupted.
        settings: Choices of the contact solver; may be replaced between steps.
        laws: Contact laws, those of the model at first; others of their friction may take their place between steps.
        timers: Seconds spent in each phase of the time step since the start.
        shape_temperature: Temperatures of all shapes [K], for friction that depends on them; nan where a wall has none.
        newcomers: Grains that have come since the last step.
    """

    def __init__(self, model: Model, state: State, settings: Settings | None = None, threads: int = 0) -> None:
        """Set up the engine.

        Args:
            model: The model.
            state: The state to advance.
            settings: Choices of the contact solver.
            threads: Number of threads; 0 takes all that are available.

        Raises:
            ValueError: If the period is too short for the grains.
        """
        self.model = model
        self.state = state
        self.settings = settings or Settings()
        self.laws = model.laws
        self.timers = dict.fromkeys(PHASES, 0.0)
        available = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
        wanted = min(threads, available) if threads > 0 else available
        self.threads = wanted if model.grain_count >= PARALLEL_GRAINS else 1
        largest = float(model.grains.radius.max())
        if 0.0 < model.period < 2.0 * LEAST_DIAMETERS * largest:
            message = f"the period {model.period:g} m is less than four times the largest diameter {2.0 * largest:g} m"
            raise ValueError(message)
        n, w = model.grain_count, model.wall_count
        self._list = NeighborList(model)
        self._motion = WallMotion(model, [WallDrive()] * w)
        self._gravity: AnyGravity = Gravity.constant(model.gravity)
        self._gravity_now: Floats = model.gravity  # what acts in the step: gravity at its middle
        self._middle = np.empty((n, 3))
        self._stopped: Floats | None = None  # how far grains are from where they would be at q_m, if something stopped them
        self._start = np.zeros((n + w, 4))
        self._free = np.zeros((n + w, 4))
        self._flagged = np.zeros(n, np.bool_)
        self._mass = total(model.grains.mass)
        self.shape_temperature: Floats = np.empty(0)
        self.newcomers: NDArray[np.int64] = np.empty(0, np.int64)
        self._threading = ThreadChoice(self.threads)
        self._scheduler = Scheduler()
        self._contacts: StepContacts | None = None
        self._after: Floats = np.empty((0, 4))
        self._last_scene: Scene | None = None

    def set_drives(self, drives: list[WallDrive]) -> None:
        """Choose what the walls do from now on, one `WallDrive` per wall (at the start of a stage, and after a resume)."""
        before = self._motion.kinetic(self.state.wall_velocity)
        self._motion = WallMotion(self.model, drives)
        self.state.wall_origin = self._motion.origins(self.state)
        if self.state.step > 0:
            switch_wall_kinetic(self.state, self._motion.kinetic(self.state.wall_velocity) - before)
        else:
            open_books(self.state, self.model, self._motion)

    def resume_drives(self, drives: list[WallDrive]) -> None:
        """As `set_drives` in the middle of a stage: the books already know the kinetic energy of the walls."""
        self._motion = WallMotion(self.model, drives)

    def set_gravity(self, gravity: AnyGravity) -> None:
        """Choose gravity from now on, instead of that of the model (at the start of a stage, and after a resume)."""
        self._gravity = gravity

    def step(self, dt: float, t: float, should_stop: Callable[[], bool] | None = None) -> StepReport:
        """Advance by one time step.

        Args:
            dt: Time step [s].
            t: Time since the start of the stage at the beginning of the step [s].
            should_stop: Asked now and then during a long solve.

        Raises:
            Interrupted: If ``should_stop`` says so; the state is that before the step.
            PhysicsError: If the state is not finite, the solver fails and ``on_failure`` is "error", or no admissible positions
                exist.
        """
        numba.set_num_threads(self._threading.favorite)
        self._contacts = self._last_scene = None  # free the contacts of the last step before there are new ones
        state, model, motion = self.state, self.model, self._motion
        if state.step == 0:
            open_books(state, model, motion)
        with self._timed("predict"):
            scene, reach = self._predict(dt, t)
        margin = -1.0
        while True:
            with self._timed("detect"):
                self._list.update(self._middle, scene.world, reach)
                lists = self._list
                if margin < 0.0:
                    margin = self._margin(scene, reach, dt)
            contacts, after, outcome = self._solve(scene, margin, dt, should_stop)
            with self._timed("detect"):
                reach = max(reach, self._reach_after(scene, after, dt))
                if reach > lists.complete:
                    lists.update(self._middle, scene.world, reach)
                    self._measure_pairs(scene, reach)
                worst = chunks_for(model.grain_count)
                find_missed(scene, lists.row, lists.partner, lists.gap, lists.normal, margin, reach, after, dt, worst)
                missed = float(worst.max())
            if missed == 0.0:
                break
            margin = max(2.0 * margin, 1.5 * dt * missed)
        outcome.require_convergence(self.settings, state.step)
        return self._finish(scene, contacts, after, outcome, reach, dt)

    @property
    def moved(self) -> tuple[Scene, StepContacts, Floats] | None:
        """Shapes at q_m, contacts and velocities v⁺ of the last step, valid until the next; None if there is none."""
        if self._last_scene is None or self._contacts is None:
            return None
        return self._last_scene, self._contacts, self._after

    def contacts(self) -> ContactTable:
        """Contacts of the last step, sorted by (i, j): those within reach, loaded or not.

        Empty before the first step and after an interrupted one.
        """
        return tabulate_contacts(self._last_scene, self._contacts, self._after)

    def next_start(self, dt: float, t: float) -> tuple[ContactProblem, Floats]:
        """The contact problem of the next step, without taking it: to save, compare and study. Arguments as `step`.

        Returns:
            The problem, and the impulses from which the solver would start [N s], shape ``(c, 2)``. With adhesion free velocities
            hold the attraction, and normal impulses are q_n = p_n + F_a Δt (theory §3.1).

        Raises:
            ValueError: If there is rolling resistance, which a `ContactProblem` does not know.
        """
        scene, contacts = self._next_contacts(dt, t)
        inverse = self._motion.inverse
        problem = problem_of_step(scene, contacts, attract(scene, contacts, self._free, inverse), inverse, self.model.shape_factor)
        return problem, contacts.impulse

    def next_system(self, dt: float, t: float) -> OrderedSystem:
        """The contact problem of the next step as the sweep sees it, without taking the step. Arguments as `step`."""
        return self._assemble(*self._next_contacts(dt, t))

    def _next_contacts(self, dt: float, t: float) -> tuple[Scene, StepContacts]:
        """Shapes and contacts of the next step, as `step` finds them at first."""
        scene, reach = self._predict(dt, t)
        self._list.update(self._middle, scene.world, reach)
        contacts, _ = self._gather(scene, self._margin(scene, reach, dt), dt)
        return scene, contacts

    def _predict(self, dt: float, t: float) -> tuple[Scene, float]:
        """Fill mid-step positions and free velocities; returns the shapes at q_m, and a gap that no pair closes in the step [m]."""
        state, model = self.state, self.model
        n = model.grain_count
        speeds = chunks_for(n)
        self._gravity_now = self._gravity.value(t + 0.5 * dt)
        predict(
            state.position, state.velocity, model.grains.radius, model.grains.mass, self._gravity_now, dt,
            self._middle, self._start, self._free, speeds,
        )  # fmt: skip
        walls = self._motion.predict(state, self._gravity_now, t, dt)
        before = self._motion.before
        self._start[n:, :3] = before
        self._free[n:, :3] = walls
        self._start[n:, BELT], self._free[n:, BELT] = self._motion.belt_before, self._motion.belt
        of_walls = np.concatenate([walls, before, state.wall_position], axis=None)
        of_walls = np.append(of_walls, self._motion.belt_before)
        if not np.isfinite(speeds).all() or not (np.abs(of_walls) <= LARGEST).all():
            raise PhysicsError(state.step, _name_absurd(state, model))
        scene = scene_of(model, self._middle, state.wall_position + 0.5 * dt * before, self.shape_temperature)
        reach = self._reach_before(scene, walls, dt)
        self._stopped = None
        unseen = find_unseen(state, self.newcomers, model, self._motion, dt)
        if unseen is not None:
            self._list.update(self._middle, scene.world, reach)
            self._stopped = stop_unseen(state, model, self._motion, unseen, self._list, dt, self._middle)
            if self._stopped is not None:
                reach = self._reach_before(scene, walls, dt)
        return scene, reach

    def _reach_before(self, scene: Scene, walls: Floats, dt: float) -> float:
        """A gap that no pair closes in the step, as far as velocities before the solve tell [m]; ``walls`` are those of walls."""
        drift = fit_drift(self._free, self._middle, self.model.period)
        fall = dt * np.abs(self._gravity_now)  # between the velocities at the start and the free ones
        drift = replace(drift, rest=drift.rest + hypot(*fall.tolist()), largest=drift.largest + fall)
        reach = self._motion.closing(drift, scene, self._motion.before, walls).reach(dt, self._list.largest)
        return max(reach, closing_distance(self.laws, self.model.grains, dt))

    def _margin(self, scene: Scene, reach: float, dt: float) -> float:
        """Largest gap of the contacts of the step, as far as velocities before the solve tell [m]; measures the listed pairs."""
        return max(dt * self._measure_pairs(scene, reach), closing_distance(self.laws, self.model.grains, dt))

    def _measure_pairs(self, scene: Scene, reach: float) -> float:
        """Gaps of the listed pairs into the list; returns the largest approach speed of a pair nearer than ``reach`` [m/s]."""
        lists, fastest = self._list, chunks_for(self.model.grain_count)
        measure_pairs(scene, lists.row, lists.partner, self._start, self._free, reach, lists.gap, lists.normal, fastest)
        return float(fastest.max())

    def _reach_after(self, scene: Scene, after: Floats, dt: float) -> float:
        """A gap that no pair closes in the step with the velocities v⁺ [m]."""
        drift = fit_drift(after, self._middle, self.model.period)
        return self._motion.closing(drift, scene, after[self.model.grain_count :, :3].copy()).reach(dt, self._list.largest)

    def _solve(
        self, scene: Scene, margin: float, dt: float, should_stop: Callable[[], bool] | None
    ) -> tuple[StepContacts, Floats, Outcome]:
        """Contacts with a gap up to ``margin``, their impulses and the velocities v⁺."""
        with self._timed("prepare"):
            contacts, scale = self._gather(scene, margin, dt)
            ordered = self._assemble(scene, contacts)
        with self._timed("solve"):
            outcome = solve_system(ordered.system, scale, self.settings, self._threading, should_stop)
        return contacts, ordered.collect(contacts), outcome

    def _assemble(self, scene: Scene, contacts: StepContacts) -> OrderedSystem:
        model, motion = self.model, self._motion
        schedule = self._scheduler.schedule(scene, contacts, motion.is_free, model.mean_diameter)
        free = attract(scene, contacts, self._free, motion.inverse)
        return assemble(scene, contacts, schedule, free, motion.inverse, model.shape_factor)

    def _gather(self, scene: Scene, margin: float, dt: float) -> tuple[StepContacts, ResidualScale]:
        """Contacts with a gap up to ``margin``, with their warm start, and the scale of the residuals."""
        state, model, lists = self.state, self.model, self._list
        row = warm_rows(model.grain_count, state.contact_i)
        warm = WarmStart(row, state.contact_j, state.contact_impulse, state.contact_couple)
        ratio = dt / state.last_dt if state.last_dt > 0.0 else 0.0
        contacts, speeds = gather_contacts(scene, lists, margin, self.laws, self._start, dt, warm, ratio)
        scale = self._scale(dt, float(contacts.attraction.max(initial=0.0)), *speeds)
        if scale.velocity == 0.0:
            # Nothing closes and nothing pushes: the impulses of the step before must not act once more.
            contacts.impulse[:] = 0.0
            contacts.rolling[:, COUPLE] = 0.0
        return contacts, scale

    def _scale(self, dt: float, attraction: float, squares: float, closing: float, slip: float, loaded: float) -> ResidualScale:
        """What residuals are measured against (theory §5.3).

        Velocities: u_ref = max(u_load, 10 times the mean slip), and u_rms = max(u_load, 50 times the mean slip), with u_load =
        max(Δt |g|, Δt P d̄/m̄, rms of the closing velocities). Energies: ½ M u_load u_ref, or ½ M u_ref² where nothing loads. Where
        there is neither weight nor load, Δt F_a/m̄ stands in for them; ``attraction`` is the largest F_a Δt of a contact [N s].
        """
        model = self.model
        mean_mass = self._mass / model.grain_count
        weight = dt * hypot(*self._gravity_now.tolist())
        pressure = dt * self._motion.pressure() * model.mean_diameter / mean_mass
        load = max(
            max(weight, pressure) or attraction / mean_mass,
            math.sqrt(squares / closing) if closing else 0.0,
        )
        mean_slip = slip / loaded if loaded else 0.0
        reference = max(load, SLIPS * mean_slip)
        return ResidualScale(
            max(load, SLIPS_RMS * mean_slip), reference, 0.5 * self._mass * ((load or reference) * reference)
        )  # fmt: skip

    def _finish(self, scene: Scene, contacts: StepContacts, after: Floats, outcome: Outcome, reach: float, dt: float) -> StepReport:
        """Books, motion and position correction; from here on the state changes."""
        state, model = self.state, self.model
        n = model.grain_count
        with self._timed("account"):
            sums = account.account_contacts(scene, contacts, after)
        with self._timed("move"):
            wall_after = np.where(self._motion.driven, after[n:, :3], self._free[n:, :3])
            grain_sums = chunks_for(n, 2)
            move(
                self._middle, self._start, after, model.grains.radius, model.grains.mass, self._gravity_now,
                model.shape_factor, dt, state.position, state.velocity, grain_sums,
            )  # fmt: skip
            kinetic, gravity_work = column_totals(grain_sums).tolist()
            if not np.isfinite(kinetic):
                raise PhysicsError(state.step, _name_absurd(state, model))
            state.wall_velocity, state.wall_surface = wall_after, self._motion.surface_after(state)
            state.wall_position = scene.wall_position + 0.5 * dt * wall_after
        with self._timed("correct"):
            # Not that of q_m with other positions: heat still looks at it.
            end = scene_of(model, state.position, state.wall_position)
            correction = correct_positions(
                end, model, self._gravity_now, self._motion, self._list, reach, self._flagged, state.step
            )
            if self._stopped is not None:
                pull = model.grains.mass[:, np.newaxis] * self._gravity_now
                correction = replace(correction, gravity_work=correction.gravity_work + total(pull * self._stopped))
            if model.period > 0.0:
                wrap(state.position, state.image, model.period)
        with self._timed("account"):
            book_step(state, self._motion, sums, kinetic, gravity_work, correction, outcome, dt)
            state.contact_i, state.contact_j, state.contact_impulse, state.contact_couple = account.warm_start_of(contacts)
            state.last_dt = dt
            self.newcomers = self.newcomers[:0]
            state.step += 1
            state.stage_step += 1
            state.time = state.stage_start + state.stage_step * dt
        # A copy of the mid-step scene: frames are those of q_m.
        self._last_scene = scene._replace(position=self._middle)
        self._contacts, self._after = contacts, after
        return StepReport(
            outcome.sweeps, outcome.converged, outcome.rms, outcome.maximum, outcome.energy, int(state.contact_i.size),
            int(contacts.i.size), correction.overlap, sums.wall_impulse,
        )  # fmt: skip

    @contextmanager
    def _timed(self, phase: str) -> Iterator[None]:
        started = time.perf_counter()
        yield
        self.timers[phase] += time.perf_counter() - started


def _name_absurd(state: State, model: Model) -> str:
    return find_absurd_value(state, model) or "a velocity is not finite"
