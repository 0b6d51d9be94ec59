"""Heat of one time step: what the contacts generate, and how it flows through the grains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from multicor_cli.engine.contact.adhesion import net_impulses, resting_attraction
from multicor_cli.engine.contact.contacts import warm_rows
from multicor_cli.engine.contact.system import Moved
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.places import met_before
from multicor_cli.engine.geometry.scene import Scene, scene_of
from multicor_cli.engine.heat.books import (
    book_flow,
    book_generated,
    book_undelivered,
    note_contacts,
    receive,
    strike_balance,
)
from multicor_cli.engine.heat.friction import (
    ENERGY,
    NO_FRICTION,
    SLIDING,
    collide,
    generated_heat,
    share_out,
)
from multicor_cli.engine.heat.integration import CannotIntegrate, integrate
from multicor_cli.engine.heat.network import Links, Pairs, kinds_of, links_of, network_of
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.engine.heat.spots import (
    TOUCHING,
    Spots,
    conducting_spots,
    forces_of_step,
    loaded_pairs,
    near_pairs,
    pairs_at_rest,
    resting_contacts,
)
from multicor_cli.engine.heat.walls import WallHeat, WallValues
from multicor_cli.engine.jit.sums import column_totals
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.columns import FRICTION, IMPACT
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.faults import LARGEST, find_absurd_value
from multicor_cli.model.model import ContactLaws, Floats, Model
from multicor_cli.model.state import State

_RULES = {"none": NO_FRICTION, "energy": ENERGY, "sliding": SLIDING}


class HeatStep:
    """The heat of the grains that are present, and of walls with a heat capacity, in an engine.

    Attributes:
        of_contacts: Heat generated [J] and conductance H_c [W/K] of the contacts of the last step,
            for frames; None before the first one of a stage.
    """

    def __init__(self, model: Model, state: State, settings: HeatSettings) -> None:
        """Set up with insulated walls; a `ValueError` if the model has no heat capacities."""
        if model.thermal is None:
            message = "the model has no heat capacities"
            raise ValueError(message)
        self._model, self._state, self._settings = model, state, settings
        self._thermal = model.thermal
        self.begin([WallHeat()] * model.wall_count)

    @cached_property
    def _list(self) -> NeighborList:
        return NeighborList(self._model)  # where no grain is present there is none

    def begin(self, conditions: Sequence[WallHeat]) -> None:
        """Take up the thermal conditions of walls; signals count from the start of the stage."""
        self.of_contacts: tuple[Floats, Floats] | None = None
        self._conditions = list(conditions)
        self._kind, self._node = kinds_of(conditions, self._model.grain_count)
        self._takes_heat = np.array(
            [condition.kind in ("temperature", "capacity") for condition in conditions], np.bool_
        )
        self._bodies = np.flatnonzero([condition.kind == "capacity" for condition in conditions])
        self._capacity = np.append(
            self._thermal.capacity, [self._conditions[w].capacity for w in self._bodies]
        )
        self._resting: tuple[Links, Spots] | None = None

    def shape_temperatures(self, t: float) -> Floats:
        """Temperatures of grains and wall shapes at ``t`` of a stage [K], ``(n + m,)``, or nan."""
        walls = WallValues(self._conditions, t).temperatures(0.0, self._state.wall_temperature)
        return np.concatenate(
            [self._state.temperature(self._thermal), walls[self._model.shapes.wall]]
        )

    def flow(self, moved: Moved, dt: float, t: float) -> None:
        """Heat of a step ``dt`` in which grains moved, from ``t`` after the start of the stage [s].

        Raises:
            PhysicsError: If a temperature is not finite, or cannot be integrated.
        """
        self._resting = None
        source, generated = self._generate(moved)
        spots = self._spots(moved, dt)
        links = links_of(moved.scene, spots, self._near(moved.scene), self._settings, self._model)
        self.of_contacts = generated, spots.conductance
        self._integrate(links, moved.scene, source, dt, t, is_frozen=False)

    def flow_at_rest(self, dt: float, t: float, should_stop: Callable[[], bool] | None) -> None:
        """Let heat flow while nothing moves; arguments and errors as `flow`.

        Raises:
            Interrupted: If ``should_stop``, asked now and then, says so; the state is that before.
        """
        scene = self._resting_scene()
        links, spots = self._rest(scene)
        self.of_contacts = np.zeros(spots.i.size), spots.conductance
        self._integrate(
            links,
            scene,
            np.zeros(self._capacity.size),
            dt,
            t,
            is_frozen=True,
            should_stop=should_stop,
        )

    def flow_nowhere(self, dt: float, t: float) -> None:
        """Without grains walls keep their heat; those of prescribed flow cannot deliver theirs."""
        self._note_walls(dt, t)
        book_undelivered(
            self._state, WallValues(self._conditions, t).undelivered(dt, np.zeros(0, np.int32))
        )

    def skip(self, dt: float, t: float) -> None:
        """Heat is off in this step: averages of forces are dropped, walls follow their signals."""
        state = self._state
        if state.mean_age > 0.0:
            none = np.zeros(0, np.int32)
            state.mean_i, state.mean_j, state.mean_force, state.mean_age = (
                none,
                none,
                np.zeros(0),
                0.0,
            )
        self._note_walls(dt, t)

    def _note_walls(self, dt: float, t: float) -> None:
        self._state.wall_temperature = WallValues(self._conditions, t).temperatures(
            dt, self._state.wall_temperature
        )

    def resting_table(self, laws: ContactLaws) -> ContactTable:
        """The contacts that conduct while nothing moves, with the impulses of the last step."""
        state, scene = self._state, self._resting_scene()
        spots = self._rest(scene)[1]
        i, j = spots.i, spots.j
        gap, normal = np.empty(i.size), np.empty((i.size, 2))
        resting_contacts(scene, i, j, gap, normal)
        none = np.zeros(i.size)
        impulse, couple = np.zeros((i.size, 2)), none
        if state.last_dt > 0.0:
            impulse = net_impulses(
                state.contact_impulse, resting_attraction(laws, scene, i, j, state.last_dt)
            )
            couple = state.contact_couple
        sticking = np.zeros(i.size, np.bool_)
        return ContactTable(
            i, j, normal, gap, impulse, none, sticking, couple=couple if laws.rolling.size else None
        )

    def _rest(self, scene: Scene) -> tuple[Links, Spots]:
        """Links and contacts of a frozen stage, found once."""
        if self._resting is None:
            near = self._near(scene)
            if self._state.last_dt > 0.0:
                pairs = loaded_pairs(self._state, scene, self._settings)
            else:  # no step has said which contacts carry a force
                pairs = pairs_at_rest(scene, self._pairs(scene, TOUCHING), self._settings)
            spots = conducting_spots(scene, *pairs, self._settings.laws, self._settings)
            self._resting = links_of(scene, spots, near, self._settings, self._model), spots
        return self._resting

    def _resting_scene(self) -> Scene:
        return scene_of(self._model, self._state.position, self._state.wall_position)

    def _generate(self, moved: Moved) -> tuple[Floats, Floats]:
        """Heat that grains and bodies receive, and of contacts [J]; enters the books, and wears."""
        state, contacts, model = self._state, moved.contacts, self._model
        count = contacts.size
        heat, rubbing = np.empty((count, 2)), np.empty(count)
        settings = self._settings
        generated_heat(
            moved.scene,
            contacts,
            moved.after,
            _RULES[settings.friction],
            settings.impact,
            heat,
            rubbing,
        )
        source, to_walls = np.zeros(model.grain_count), np.zeros(model.wall_count)
        share_out(
            moved.scene, moved.i, moved.j, heat, rubbing, self._settings.laws, self._takes_heat,
            source, to_walls, state.wear,
            state.wall_wear,
        )  # fmt: skip
        friction, impact = column_totals(heat).tolist()
        book_generated(state, friction, impact, to_walls)
        received = np.append(receive(state, source), to_walls[self._bodies])
        return received, heat[:, FRICTION] + heat[:, IMPACT]

    def _spots(self, moved: Moved, dt: float) -> Spots:
        contacts, settings = moved.contacts, self._settings
        force = forces_of_step(self._state, moved.scene, contacts, settings, dt)
        spots = conducting_spots(
            moved.scene, moved.i, moved.j, force, self._settings.laws, settings
        )
        if settings.collisional:
            row = warm_rows(self._model.grain_count, moved.loaded_i)
            is_known = met_before(moved.scene, row, moved.loaded_j, moved.i, moved.j)
            collide(
                moved.scene,
                self._model.grains.mass,
                contacts,
                spots.place,
                is_known,
                self._settings.laws,
                dt,
                spots.conductance,
            )
        return spots

    def _near(self, scene: Scene) -> Pairs | None:
        """Pairs within the reach of mechanisms; None if none crosses gaps."""
        reach = self._settings.reach
        return self._pairs(scene, reach) if reach > 0.0 else None

    def _pairs(self, scene: Scene, reach: float) -> Pairs:
        """Pairs whose gap is at most ``reach`` times the smaller radius."""
        self._list.update(
            scene.position, scene.world, reach * float(self._model.grains.radius.max())
        )
        return near_pairs(scene, self._list.row, self._list.partner, reach)

    def _integrate(
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
        state, settings = self._state, self._settings
        if not float(np.abs(state.heat).max()) <= LARGEST:
            raise PhysicsError(
                state.step, find_absurd_value(state, self._model) or "a temperature is not finite"
            )
        velocity = np.zeros((len(state.velocity), 2)) if is_frozen else state.velocity[:, :2]
        net = network_of(links, scene, self._kind, self._node, velocity, self._model, settings)
        walls, n = WallValues(self._conditions, t), self._model.grain_count
        temperature = np.append(
            state.temperature(self._thermal), state.wall_temperature[self._bodies]
        )
        try:
            flow = integrate(
                net,
                self._capacity,
                temperature,
                walls,
                source,
                dt,
                state.heat_dt,
                settings,
                should_stop,
                is_frozen=is_frozen,
            )
        except CannotIntegrate as error:
            what = find_absurd_value(state, self._model) or f"{self._name(error.node)} {error.why}"
            raise PhysicsError(state.step, what) from error
        if not np.isfinite(temperature).all():
            raise PhysicsError(
                state.step,
                (
                    f"the temperature of {self._name(int(np.argmin(np.isfinite(temperature))))} "
                    "is not finite"
                ),
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
        n = self._model.grain_count
        return (
            self._model.name_of(node)
            if node < n
            else f"wall {self._model.walls.names[self._bodies[node - n]]}"
        )
