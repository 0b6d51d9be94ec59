"""How a step begins: positions at its middle, free velocities, impacts of what flies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, NoReturn

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.adhesion import longest_reach
from multicor_cli.engine.contact.flight import SOLVED, Flight, fly
from multicor_cli.engine.contact.impacts import convected_by
from multicor_cli.engine.contact.meetings import Walls
from multicor_cli.engine.contact.selection import AHEAD
from multicor_cli.engine.geometry.drift import cutoff_of_velocities
from multicor_cli.engine.geometry.pieces import Pieces, turned
from multicor_cli.engine.geometry.scene import Scene, scene_of
from multicor_cli.engine.motion.cell import (
    carry_to_middle,
    convect,
    require_slowness,
    sides_at_middle,
)
from multicor_cli.engine.motion.layout import Growth, Layout
from multicor_cli.engine.motion.moves import are_sound, predict
from multicor_cli.engine.motion.unseen import find_unseen, stop_unseen
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.cell import mean_flow
from multicor_cli.model.columns import BELT
from multicor_cli.model.model import ContactLaws, Floats
from multicor_cli.model.state import find_absurd_value

_ROUNDING = 2.0**-52
_NO_FALL, _NO_FLOW = np.zeros(2), np.zeros(3)


class Prediction(NamedTuple):
    """A step before its contacts are known.

    Attributes:
        gravity: Acceleration of gravity in the middle of the step [m/s²], shape ``(2,)``.
        scene: Shapes at q_m.
        cutoff: A gap that no pair closes, as far as velocities before the solve tell [m].
        shift_work: Of gravity, where grains that something stopped are not where they would be at
            q_m [J].
        flight: Flights, and impacts before the solve; or None.
        convected: Δt Σ m c⊗c of the grains of a cell: xx, yy, xy [J s]; else of size 0.
        growth: Grains that expand or shrink; or None.
        pieces: Pieces of grains that are no discs, as they lie at q_m; or None.
        rounding: A velocity that moves no grain by more than positions are rounded [m/s].
    """

    dt: float
    gravity: Floats
    scene: Scene
    cutoff: float
    shift_work: float = 0.0
    flight: Flight | None = None
    convected: Floats = np.empty(0)
    growth: Growth | None = None
    pieces: Pieces | None = None
    rounding: float = 0.0


def refuse_state(layout: Layout) -> NoReturn:
    """Raise `PhysicsError` about a state in which a number is absurd or not finite."""
    state = layout.state
    what = find_absurd_value(state, layout.model) or "a velocity is not finite"
    raise PhysicsError(state.step, what)


@dataclass(frozen=True)
class Predictor:
    """Predicts steps with these grains, motions of walls and contact laws."""

    layout: Layout
    motion: WallMotion
    laws: ContactLaws
    rebounds: bool  # whether any pair of materials does

    def predict(self, gravity: Floats, temperature: Floats, dt: float, t: float) -> Prediction:
        """Mid-step positions and free velocities, into the layout.

        Args:
            gravity: Acceleration of gravity in the middle of the step [m/s²], shape ``(2,)``.
            temperature: Temperatures of all shapes [K]; of size 0 if no law depends on them.
            dt: Time step [s].
            t: Time since the start of the stage at the beginning of the step [s].

        Raises:
            PhysicsError: If a number of the state is absurd or not finite.
        """
        layout, motion = self.layout, self.motion
        state, model = layout.state, layout.model
        n, grains = model.grain_count, model.grains
        growth = layout.grow(dt) if state.radius.size else None
        largest = predict(
            state.position, state.velocity if growth is None else growth.velocity,
            model.spin_radius, grains.mass, gravity, dt, layout.middle, layout.before, layout.free,
        )  # fmt: skip
        walls = motion.predict(state, gravity, t, dt)
        middle = state.wall_position + 0.5 * dt * motion.before
        convected, flight = np.empty(0), None
        if model.is_cell:
            gradient = state.wall_velocity[0]
            carry_to_middle(layout.middle, gradient, 0.5 * dt)
            middle = sides_at_middle(state.wall_position[0], gradient, 0.5 * dt)[np.newaxis]
            flight = self._fly_in_cell(middle, temperature, walls, dt)
            gained, convected = convect(
                grains.mass, motion.before[0], walls[0], motion.inverse[0], dt, layout.before,
                layout.free,
            )  # fmt: skip
            walls += gained - motion.before
            motion.before[0] = gained
            if flight is not None:
                convected += convected_by(flight.impacts, 0.5 * (walls[0] - motion.before[0]))
        layout.before[n:, :3], layout.free[n:, :3] = motion.before, walls
        layout.before[n:, BELT], layout.free[n:, BELT] = motion.belt_before, motion.belt
        is_sound = are_sound(walls, motion.before, state.wall_position, motion.belt_before)
        if not (is_sound and largest < math.inf):
            refuse_state(layout)
        scene = scene_of(model, layout.middle, middle, temperature)
        step = Prediction(
            dt, gravity, scene, self._cutoff(scene, gravity, walls, dt), 0.0, flight, convected,
            growth, None if layout.pieces is None else turned(layout.pieces, scene),
            _ROUNDING * largest / dt,
        )  # fmt: skip
        if model.is_cell:  # in which nothing moves by itself
            return step
        return self._stop(self._fly(step, walls), walls)

    def _cutoff(self, scene: Scene, gravity: Floats, walls: Floats, dt: float) -> float:
        """A gap that no pair closes in `AHEAD` steps [m], as velocities before the solve tell."""
        layout, motion = self.layout, self.motion
        fall = dt * np.abs(gravity)  # between the velocities at the start and the free ones
        cutoff = cutoff_of_velocities(
            scene, layout.free, fall, motion.before, walls, motion.extent, AHEAD * dt,
            layout.pairs.largest,
        )  # fmt: skip
        return require_slowness(max(cutoff, longest_reach(self.laws)), layout.state.step)

    def _stop(self, step: Prediction, walls: Floats) -> Prediction:
        """Grains that no step before has kept apart from others do not go through them to q_m."""
        layout, motion, dt = self.layout, self.motion, step.dt
        state, model = layout.state, layout.model
        seen = 0.0 if state.step == state.frozen_steps else state.last_dt
        strangers = layout.newcomers
        if step.flight is not None and step.flight.unseen.size:
            strangers = np.concatenate((strangers, step.flight.unseen))
        unseen = find_unseen(state, strangers, model, motion, dt, seen)
        if unseen is None:
            return step
        layout.pairs.update(step.scene, step.cutoff)
        flying = None if step.flight is None else step.flight.flying
        stopped = stop_unseen(layout, motion, unseen, flying, dt)
        if stopped is None:
            return step
        work = step.shift_work + total(model.grains.mass[:, np.newaxis] * step.gravity * stopped)
        cutoff = self._cutoff(step.scene, step.gravity, walls, dt)
        return step._replace(shift_work=work, cutoff=cutoff)

    # ---- Flights

    @property
    def _may_fly(self) -> bool:
        laws = self.laws
        stays = laws.adhesion.size or laws.rolling.size or self.layout.model.outlines is not None
        return self.rebounds and not stays

    def _fly(self, step: Prediction, walls: Floats) -> Prediction:
        """Impacts of what flies: other starts of these grains, in the layout too."""
        flight = self._find_flights(step, walls, _NO_FLOW) if self._may_fly else None
        if flight is not None and (flight.flying.any() or flight.unseen.size):
            step = step._replace(flight=flight)
            if flight.impacts.i.size:
                cutoff = self._cutoff(step.scene, step.gravity, walls, step.dt)
                step = step._replace(cutoff=cutoff)
        return step

    def _fly_in_cell(
        self, middle: Floats, temperature: Floats, walls: Floats, dt: float
    ) -> Flight | None:
        """As `_fly`, of a cell, before convection: with real velocities grains fly straight.

        What a stress drives gives way to all impacts at once: there nobody flies.
        """
        layout, state = self.layout, self.layout.state
        if not self._may_fly or self.motion.is_free[0]:
            return None
        scene = scene_of(layout.model, layout.middle, middle, temperature)
        step = Prediction(dt, _NO_FALL, scene, self._cutoff(scene, _NO_FALL, walls, dt))
        gradient, grains = state.wall_velocity[0], layout.before[: layout.model.grain_count, :2]
        peculiar = grains.copy()
        grains += mean_flow(state.position, gradient)
        flight = self._find_flights(step, walls, gradient)
        struck = flight.struck
        real, grains[:] = grains[struck], peculiar
        if struck.size:
            place = layout.middle[struck, :2] - 0.5 * dt * real
            grains[struck] = real - mean_flow(place, gradient)
            place += 0.5 * dt * grains[struck]
            carry_to_middle(place, gradient, 0.5 * dt)
            layout.middle[struck, :2] = place
        return flight if flight.flying.any() else None

    def _find_flights(self, step: Prediction, walls: Floats, flow: Floats) -> Flight:
        """Flights, whose grains have other starts in the layout after impacts."""
        layout, motion = self.layout, self.motion
        state, model = layout.state, layout.model
        dt, gravity = step.dt, step.gravity
        start = scene_of(model, state.position, state.wall_position, step.scene.temperature)
        # As the cutoff, while a solve would count a contact
        moved = SOLVED / AHEAD * step.cutoff + dt * dt * hypot(*gravity.tolist())
        layout.pairs.update(start, moved)
        mean = Walls(
            model.shapes.geometry, state.wall_position, 0.5 * (motion.before + walls),
            0.5 * (motion.belt_before + motion.belt), motion.is_free,
        )  # fmt: skip
        while True:
            flight = fly(
                start, flow, self.laws, mean, state.contact_i, state.contact_j, layout.pairs.row,
                layout.pairs.partner, layout.pairs.around, gravity, dt, model.shape_factor, moved,
                layout.pairs.complete, layout.middle, layout.before, layout.free,
            )  # fmt: skip
            if flight.reach <= layout.pairs.complete:
                return flight
            # What impacts have made faster may reach farther
            layout.pairs.update(start, 1.2 * flight.reach)
