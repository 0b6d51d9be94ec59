"""Heat of one time step: what the contacts generate, and how it flows through the grains."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import column_totals
from multicor_cli.engine.contact.contacts import StepContacts, warm_rows
from multicor_cli.engine.contact.step_report import PhysicsError
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.places import find_places, met_before
from multicor_cli.engine.geometry.scene import Scene, scene_of
from multicor_cli.engine.heat.books import book_flow, book_generated, note_contacts, strike_balance
from multicor_cli.engine.heat.friction import ENERGY, NO_FRICTION, SLIDING, collide, generated_heat, share_out
from multicor_cli.engine.heat.integration import CannotIntegrate, integrate
from multicor_cli.engine.heat.network import Links, Pairs, links_of, network_of
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.spots import (
    TOUCHING,
    Spots,
    conducting_spots,
    forces_of_step,
    loaded_pairs,
    near_pairs,
    pairs_at_rest,
)
from multicor_cli.engine.heat.walls import WallHeat, WallValues, begin_bodies
from multicor_cli.model.columns import FRICTION, IMPACT
from multicor_cli.model.faults import LARGEST, find_absurd_value
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.state import State

_RULES = {"none": NO_FRICTION, "energy": ENERGY, "sliding": SLIDING}


@dataclass(frozen=True)
class MovedContacts:
    """The contacts of a step of the mechanics.

    Attributes:
        scene: Shapes at q_m.
        contacts: Contacts with their impulses.
        after: Body velocities v⁺, shape ``(bodies, 4)``.
        loaded_i: First shapes of the contacts that carried an impulse in the step before, ascending.
        loaded_j: Their second shapes.
    """

    scene: Scene
    contacts: StepContacts
    after: Floats
    loaded_i: Ints
    loaded_j: Ints


@dataclass(frozen=True)
class StepHeat:
    """Heat of the contacts of the last step, for frames; ``c`` contacts.

    Attributes:
        generated: Heat generated [J], shape ``(c,)``.
        conductance: H_c [W/K], shape ``(c,)``.
    """

    generated: Floats
    conductance: Floats


class HeatEngine:
    """Advances the heat content of the grains. Knows nothing of files, scenarios or terminals.

    Attributes:
        model: What does not change.
        state: What does.
        settings: Choices about heat.
        seconds: Time spent since the start.
        last: Heat of the contacts of the last step, or None.
    """

    def __init__(self, model: Model, state: State, settings: HeatSettings) -> None:
        """Set up.

        Raises:
            ValueError: If the model has no heat capacities.
        """
        if model.thermal is None:
            message = "the model has no heat capacities"
            raise ValueError(message)
        self.model, self.state, self.settings = model, state, settings
        self.seconds = 0.0
        self.last: StepHeat | None = None
        self._thermal = model.thermal
        self._laws = settings.laws
        self.set_conditions([WallHeat()] * model.wall_count)
        self._list = NeighborList(model)
        self._frozen: tuple[Links, Spots] | None = None

    def set_conditions(self, conditions: list[WallHeat]) -> None:
        """Choose the thermal conditions of the walls, one per wall; their signals count from the start of the stage."""
        self._conditions = conditions
        self._bodies = np.flatnonzero([condition.kind == "capacity" for condition in conditions])
        self._capacity = np.append(self._thermal.capacity, [conditions[w].capacity for w in self._bodies])
        self._frozen = None

    def begin_conditions(self, is_new: NDArray[np.bool_]) -> None:
        """Give bodies whose condition is new, shape ``(w,)``, the temperature with which they begin."""
        begin_bodies(self._conditions, is_new, self.state.wall_temperature)

    def shape_temperatures(self, t: float) -> Floats:
        """Temperatures of grains and wall shapes [K]; nan for walls that have none, shape ``(n + m,)``.

        Args:
            t: Time since the start of the stage [s].
        """
        walls = WallValues(self._conditions, t).temperatures(0.0, self.state.wall_temperature)
        return np.concatenate([self.state.temperature(self._thermal), walls[self.model.shapes.wall]])

    def step(self, moved: MovedContacts, dt: float, t: float) -> None:
        """Heat of a step of the mechanics, which has been taken already.

        Args:
            moved: Its contacts.
            dt: Time step [s].
            t: Time since the start of the stage at the beginning of the step [s].

        Raises:
            PhysicsError: If a temperature is not finite, or cannot be integrated.
        """
        with self._timed():
            self._frozen = None
            source, generated = self._generate(moved)
            spots = self._spots(moved, dt)
            links = links_of(moved.scene, spots, self._near(moved.scene), self.settings, self.model)
            self.last = StepHeat(generated, spots.conductance)
            self._flow(links, moved.scene, source, dt, t, is_frozen=False)

    def advance(self, dt: float, t: float, should_stop: Callable[[], bool] | None = None) -> None:
        """Let heat flow for ``dt`` [s] while nothing moves; arguments and errors as `step`.

        Raises:
            Interrupted: If ``should_stop``, asked now and then, says so; the state is that before.
        """
        with self._timed():
            scene = self.resting_scene()
            links, spots = self._rest(scene)
            self.last = StepHeat(np.zeros(spots.i.size), spots.conductance)
            source = np.zeros(self._capacity.size)
            self._flow(links, scene, source, dt, t, is_frozen=True, should_stop=should_stop)

    def forget_averages(self) -> None:
        """Drop the running averages of forces: the grains move on, and the averages are not kept up to date."""
        state = self.state
        if state.mean_age > 0.0:
            none = np.zeros(0, np.int32)
            state.mean_i, state.mean_j, state.mean_force, state.mean_age = none, none, np.zeros(0), 0.0

    def note_walls(self, dt: float, t: float) -> None:
        """Let the state know the walls' temperatures after a step in which heat is off; arguments as `step`."""
        self.state.wall_temperature = WallValues(self._conditions, t).temperatures(dt, self.state.wall_temperature)

    def resting_contacts(self) -> tuple[Ints, Ints]:
        """The contacts that conduct while nothing moves: first and second shapes, sorted."""
        spots = self._rest(self.resting_scene())[1]
        return spots.i, spots.j

    def _rest(self, scene: Scene) -> tuple[Links, Spots]:
        """Links and contacts of a frozen stage, found once."""
        if self._frozen is None:
            near = self._near(scene)
            if self.state.last_dt > 0.0:
                pairs = loaded_pairs(self.state, scene, self.settings)
            else:  # no step has said which contacts carry a force
                pairs = pairs_at_rest(scene, self._pairs(scene, TOUCHING), self.settings)
            spots = conducting_spots(scene, *pairs, self._laws, self.settings)
            self._frozen = links_of(scene, spots, near, self.settings, self.model), spots
        return self._frozen

    def resting_scene(self) -> Scene:
        """Shapes where the state has them."""
        return scene_of(self.model, self.state.position, self.state.wall_position)

    def _generate(self, moved: MovedContacts) -> tuple[Floats, Floats]:
        """Heat generated: by grain and body, and by contact [J]; enters the books, and wears."""
        state, contacts, model = self.state, moved.contacts, self.model
        count = contacts.i.size
        heat, rubbing = np.empty((count, 2)), np.empty(count)
        settings = self.settings
        generated_heat(moved.scene, contacts, moved.after, _RULES[settings.friction], settings.impact, heat, rubbing)
        source, to_walls = np.zeros(model.grain_count), np.zeros(model.wall_count)
        takes_heat = np.array([c.kind in ("temperature", "capacity") for c in self._conditions], np.bool_)
        share_out(
            moved.scene, contacts.i, contacts.j, heat, rubbing, self._laws, takes_heat, source, to_walls, state.wear,
            state.wall_wear,
        )  # fmt: skip
        state.generated += source
        friction, impact = column_totals(heat).tolist()
        book_generated(state, friction, impact, to_walls)
        return np.append(source, to_walls[self._bodies]), heat[:, FRICTION] + heat[:, IMPACT]

    def _spots(self, moved: MovedContacts, dt: float) -> Spots:
        contacts, settings = moved.contacts, self.settings
        force = forces_of_step(self.state, moved.scene, contacts, settings, dt)
        spots = conducting_spots(moved.scene, contacts.i, contacts.j, force, self._laws, settings)
        if settings.collisional:
            row = warm_rows(self.model.grain_count, moved.loaded_i)
            is_known = met_before(moved.scene, row, moved.loaded_j, contacts.i, contacts.j)
            place, _ = find_places(moved.scene, contacts.i, contacts.j)
            collide(moved.scene, self.model.grains.mass, contacts, place, is_known, self._laws, dt, spots.conductance)
        return spots

    def _near(self, scene: Scene) -> Pairs | None:
        """Pairs within the reach of mechanisms; None if none crosses gaps."""
        reach = self.settings.reach
        return self._pairs(scene, reach) if reach > 0.0 else None

    def _pairs(self, scene: Scene, reach: float) -> Pairs:
        """Pairs whose gap is at most ``reach`` times the smaller radius."""
        self._list.update(scene.position, scene.world, reach * float(self.model.grains.radius.max()))
        return near_pairs(scene, self._list.row, self._list.partner, reach)

    def _flow(
        self,
        links: Links,
        scene: Scene,
        source: Floats,
        dt: float,
        t: float,
        *,
        is_frozen: bool,
        should_stop: Callable[[], bool] | None = None,
    ) -> None:
        """Advance the temperatures and close the books."""
        state, settings = self.state, self.settings
        if not float(np.abs(state.heat).max()) <= LARGEST:
            raise PhysicsError(state.step, find_absurd_value(state, self.model) or "a temperature is not finite")
        velocity = np.zeros((len(state.velocity), 2)) if is_frozen else state.velocity[:, :2]
        net = network_of(links, scene, self._conditions, velocity, self.model, settings)
        walls, n = WallValues(self._conditions, t), self.model.grain_count
        temperature = np.append(state.temperature(self._thermal), state.wall_temperature[self._bodies])
        try:
            flow = integrate(
                net, self._capacity, temperature, walls, source, dt, state.heat_dt, settings, should_stop, is_frozen=is_frozen
            )
        except CannotIntegrate as error:
            what = find_absurd_value(state, self.model) or f"{self._name(error.node)} {error.why}"
            raise PhysicsError(state.step, what) from error
        if not np.isfinite(temperature).all():
            raise PhysicsError(
                state.step, f"the temperature of {self._name(int(np.argmin(np.isfinite(temperature))))} is not finite"
            )
        state.heat += flow.received[:n]
        state.heat_dt = flow.next_step
        state.wall_temperature[self._bodies] += flow.received[n:] / self._capacity[n:]
        state.wall_temperature = walls.temperatures(dt, state.wall_temperature)
        flow.walls[self._bodies] += source[n:] - flow.received[n:]
        book_flow(state, flow, walls.undelivered(dt, net.flow_wall))
        note_contacts(state, links.biot, links.gas_ratio)
        strike_balance(state)

    def _name(self, node: int) -> str:
        n = self.model.grain_count
        return self.model.name_of(node) if node < n else f"wall {self.model.walls.names[self._bodies[node - n]]}"

    @contextmanager
    def _timed(self) -> Iterator[None]:
        started = time.perf_counter()
        yield
        self.seconds += time.perf_counter() - started
