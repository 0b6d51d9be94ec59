"""Heat of one time step: what the contacts generate, and how it flows through the grains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.adhesion import net_impulses, resting_attraction
from multicor_cli.engine.contact.contacts import warm_rows
from multicor_cli.engine.contact.ordering import Schedule
from multicor_cli.engine.contact.system import Moved
from multicor_cli.engine.geometry.neighbors import NeighborList
from multicor_cli.engine.geometry.pieces import Pieces, pieces_of, turned
from multicor_cli.engine.geometry.places import met_before
from multicor_cli.engine.geometry.scene import Scene, scene_of
from multicor_cli.engine.heat.books import (
    book_along,
    book_flow,
    book_generated,
    book_undelivered,
    hottest_so_far,
    note_contacts,
    note_hottest,
    receive,
    receive_walls,
    strike_balance,
    warm,
)
from multicor_cli.engine.heat.faces import FacePoints, corners_of, points_at_rest
from multicor_cli.engine.heat.flux import branches, look_ahead, passed, take_along
from multicor_cli.engine.heat.friction import (
    ENERGY,
    NO_FRICTION,
    SLIDING,
    Solved,
    generate,
    sliding_heat,
)
from multicor_cli.engine.heat.impacts import collide, hit, known_points, strike
from multicor_cli.engine.heat.integration import CannotIntegrate, integrate
from multicor_cli.engine.heat.network import (
    Ends,
    Links,
    Outlined,
    contact_links,
    ends_of,
    near_links,
    network_of,
    shapes_of,
)
from multicor_cli.engine.heat.settings import HeatSettings, knows_flash
from multicor_cli.engine.heat.spots import (
    TOUCHING,
    Spots,
    Touching,
    conducting_spots,
    forces_at_rest,
    forces_of_step,
    hottest_spot,
    near_pairs,
    resting_contacts,
)
from multicor_cli.engine.heat.views import hulls_of
from multicor_cli.engine.heat.walls import WallHeat, WallValues
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.columns import FRICTION
from multicor_cli.model.contacts import ContactTable
from multicor_cli.model.model import ContactLaws, Floats, Ints, Model
from multicor_cli.model.state import State, find_absurd_value

_RULES = {"none": NO_FRICTION, "energy": ENERGY, "sliding": SLIDING}


class _Rubbed(NamedTuple):
    """What ``c`` contacts have generated in a step.

    Attributes:
        received: Heat that grains and walls with a heat capacity receive [J].
        generated: All heat of each contact [J], shape ``(c,)``.
        normal: Normal impulses q_n [N s], likewise.
        sliding: Heat of friction without that of couples [J], likewise.
        rubbing: Normal force times slipped distance [N m], likewise; unknown where q_n is 0.
    """

    received: Floats
    generated: Floats
    normal: Floats
    sliding: Floats
    rubbing: Floats


class HeatStep:
    """The heat of the grains that are present, and of walls with a heat capacity, in an engine.

    Attributes:
        of_contacts: Heat generated [J] and conductance H_c [W/K] of the contacts of the last step,
            for frames; None before the first one of a stage.
    """

    def __init__(
        self, model: Model, state: State, settings: HeatSettings, at_start: Model | None = None,
        pieces: Pieces | None = None,
    ) -> None:  # fmt: skip
        """Set up with insulated walls.

        Where grains grow or shrink ``at_start`` is the model before, and ``pieces`` follow them.

        Raises:
            ValueError: If the model has no heat capacities.
        """
        if model.thermal is None:
            message = "the model has no heat capacities"
            raise ValueError(message)
        self._model, self._state, self._settings = model, state, settings
        self._thermal = model.thermal
        self._gradient = np.array(model.heat_gradient)
        self._knows_flash = knows_flash(settings.laws)
        self._at_start = at_start = at_start or model
        initial = pieces_of(at_start)
        self._outlined: Outlined | None = None
        if initial is not None:
            self._at_start_corners = corners_of(at_start, initial)
            hulls = hulls_of(initial, at_start.grains.radius)
            self._outlined = Outlined(pieces or initial, self._at_start_corners, hulls)
        self.begin([WallHeat()] * model.wall_count)

    @property
    def _pieces(self) -> Pieces | None:
        return None if self._outlined is None else self._outlined.pieces

    @cached_property
    def _list(self) -> NeighborList:
        return NeighborList(self._model)  # where no grain is present there is none

    def begin(self, conditions: Sequence[WallHeat]) -> None:
        """Take up the thermal conditions of walls; signals count from the start of the stage."""
        self.of_contacts: tuple[Floats, Floats] | None = None
        self._conditions = list(conditions)
        self._shapes = shapes_of(conditions, self._model, self._settings)
        kinds = [condition.kind for condition in conditions]
        self._takes_heat = np.array(
            [kind in ("temperature", "capacity") for kind in kinds], np.bool_
        )
        self._bodies = np.flatnonzero([kind == "capacity" for kind in kinds])
        self._capacity = np.append(
            self._thermal.capacity, [self._conditions[w].capacity for w in self._bodies]
        )
        self._lasting: tuple[Touching, Ends] | None = None
        self._resting: tuple[Links, Spots] | None = None

    @property
    def reads_table(self) -> bool:
        """Whether `flow` looks at contacts of two grains in the table."""
        return self._settings.collisional or self._settings.force.kind == "average"

    def shape_temperatures(self, t: float) -> Floats:
        """Temperatures of grains and wall shapes at ``t`` of a stage [K], ``(n + m,)``, or nan."""
        walls = WallValues(self._conditions, t).temperatures(0.0, self._state.wall_temperature)
        return np.concatenate(
            [self._state.temperature(self._thermal), walls[self._model.shapes.wall]]
        )

    def flow(self, moved: Moved, lanes: Schedule, dt: float, t: float, *, is_plain: bool) -> None:
        """Heat of a step ``dt`` in which grains moved, from ``t`` after the start of the stage [s].

        Contacts of two grains are looked up in their ``lanes``; in the table as well if any adheres
        or resists rolling (not ``is_plain``), or if `reads_table`.

        Raises:
            PhysicsError: If a temperature is not finite, or cannot be integrated.
        """
        self._resting = None
        touching, ends = self._lasting_of(moved.scene, moved.i, moved.j)
        if self._pieces is not None:
            touching = self._at(touching, moved.scene, moved.contacts["key"].copy())
        solved = Solved(
            moved.i, moved.j, moved.contacts, lanes.lane, lanes.frame, lanes.impulse, lanes.before,
            lanes.branch, moved.after, is_plain,
        )  # fmt: skip
        rubbed = self._generate(moved.scene, solved, touching.share)
        spots = self._spots(moved, rubbed.normal, touching, dt)
        self._note_hottest(moved.scene, spots, rubbed, dt, t)
        links = self._links(moved.scene, spots, ends)
        self.of_contacts = rubbed.generated, spots.conductance
        if self._pieces is not None:  # there is room for more
            is_there = moved.contacts["gap"] < np.inf
            self.of_contacts = rubbed.generated[is_there], spots.conductance[is_there]
        self._integrate(links, rubbed.received, moved.scene, moved.strayed, dt, t, is_frozen=False)

    def flow_at_rest(self, dt: float, t: float, should_stop: Callable[[], bool] | None) -> None:
        """Let heat flow while nothing moves; arguments and errors as `flow`.

        Raises:
            Interrupted: If ``should_stop``, asked now and then, says so; the state is that before.
        """
        scene = self._resting_scene()
        links, spots = self._rest(scene)
        self.of_contacts = np.zeros(spots.conductance.size), spots.conductance
        source = np.zeros(self._capacity.size)
        strayed = np.zeros((self._model.grain_count, 2))
        self._integrate(
            links, source, scene, strayed, dt, t, is_frozen=True, should_stop=should_stop
        )
        note_hottest(self._state, 0.0)

    def flow_nowhere(self, dt: float, t: float) -> None:
        """Without grains walls keep their heat; those of prescribed flow cannot deliver theirs."""
        self._note_walls(dt, t)
        note_hottest(self._state, 0.0)
        book_undelivered(
            self._state, WallValues(self._conditions, t).undelivered(dt, np.zeros(0, np.int32))
        )

    def skip(self, dt: float, t: float) -> None:
        """Heat is off in this step: averages of forces are dropped, walls follow their signals."""
        state = self._state
        note_hottest(state, 0.0)
        if state.mean_age > 0.0:
            none = np.zeros(0, np.int32)
            state.mean_i, state.mean_j, state.mean_force = none, none, np.zeros(0)
            state.mean_age = 0.0
        self._note_walls(dt, t)

    def _note_walls(self, dt: float, t: float) -> None:
        self._state.wall_temperature = WallValues(self._conditions, t).temperatures(
            dt, self._state.wall_temperature
        )

    def resting_table(self, laws: ContactLaws) -> ContactTable:
        """The contacts that conduct while nothing moves, with the impulses of the last step."""
        state, scene = self._state, self._resting_scene()
        touching = self._rest(scene)[1].touching
        i, j = touching.i, touching.j
        gap, normal = np.empty(i.size), np.empty((i.size, 2))
        resting_contacts(scene, i, j, gap, normal)
        arm = None
        if touching.points is not None:
            gap, normal, arm = touching.points.or_of_discs(scene, i, gap, normal)
        none = np.zeros(i.size)
        impulse, couple = np.zeros((i.size, 2)), none
        if state.last_dt > 0.0:
            impulse = net_impulses(
                state.contact_impulse,
                resting_attraction(laws, scene, i, j, state.last_dt, self._model.outlines),
            )
            couple = state.contact_couple
        sticking = np.zeros(i.size, np.bool_)
        return ContactTable(
            i, j, normal, gap, impulse, none, sticking, arm=arm,
            couple=couple if laws.rolling.size else None,
        )  # fmt: skip

    def _rest(self, scene: Scene) -> tuple[Links, Spots]:
        """Links and contacts of a frozen stage, found once."""
        if self._resting is None:
            state, pieces = self._state, self._pieces
            i, j, key = state.contact_i, state.contact_j, state.contact_point
            if state.last_dt <= 0.0:  # no step has said which contacts carry a force
                i, j, _ = self._pairs(scene, TOUCHING)
                if pieces is not None:
                    i, j, key = points_at_rest(scene, turned(pieces, scene), i, j, TOUCHING)
            touching, ends = self._lasting_of(scene, i, j)
            if pieces is not None:
                touching = self._at(touching, scene, key)
            force = forces_at_rest(state, scene, touching, self._settings)
            spots = conducting_spots(scene, touching, force, self._settings)
            self._resting = self._links(scene, spots, ends), spots
        return self._resting

    def _resting_scene(self) -> Scene:
        return scene_of(self._model, self._state.position, self._state.wall_position)

    def _lasting_of(self, scene: Scene, i: Ints, j: Ints) -> tuple[Touching, Ends]:
        """What lasts with the contacts, if grains do not grow; found for others than before."""
        if self._state.radius.size:
            self._lasting = None
            self._shapes = shapes_of(self._conditions, self._model, self._settings)
            if self._outlined is not None:
                corners = self._at_start_corners.resized(
                    self._outlined.pieces, self._model.grains.radius / self._at_start.grains.radius
                )
                self._outlined = self._outlined._replace(corners=corners)
        if self._lasting is None or self._lasting[0].i is not i:
            self._lasting = (
                Touching.of(scene, i, j, self._settings, self._pieces),
                ends_of(self._shapes, i, j),
            )
        return self._lasting

    def _at(self, touching: Touching, scene: Scene, key: Ints) -> Touching:
        """Contacts with their points in a scene, of grains that are no discs."""
        assert self._outlined is not None
        pieces, corners, _ = self._outlined
        points = FacePoints.of(
            scene, turned(pieces, scene), corners, self._settings.laws.conductivity, touching.i,
            touching.j, key, touching.radius,
        )  # fmt: skip
        return replace(touching, points=points)

    def _generate(self, scene: Scene, solved: Solved, share: Floats) -> _Rubbed:
        """Heat that contacts generate; enters the books, and wears."""
        state, model, settings = self._state, self._model, self._settings
        rule, count = _RULES[settings.friction], solved.i.size
        heat, rubbing, generated = np.zeros((count, 2)), np.empty(count), np.zeros(count)
        carried = np.empty(count)
        source, to_walls = np.zeros(model.grain_count), np.zeros(model.wall_count)
        friction, impact = generate(
            scene, solved, rule, settings.impact, settings.laws, share, self._takes_heat,
            carried, heat, rubbing, generated, source, to_walls, state.wear, state.wall_wear,
        ).tolist()  # fmt: skip
        receive_walls(state, to_walls, self._bodies)
        book_generated(state, friction, impact, to_walls)
        received = np.concatenate([receive(state, source), to_walls[self._bodies]])
        sliding = heat[:, FRICTION]
        if self._knows_flash and not solved.is_plain and rule != NO_FRICTION:
            sliding = sliding_heat(scene, solved, rule, heat)
        return _Rubbed(received, generated, carried, sliding, rubbing)

    def _note_hottest(
        self, scene: Scene, spots: Spots, rubbed: _Rubbed, dt: float, t: float
    ) -> None:
        """The hottest spot of a step, by temperatures at its start."""
        state, touching = self._state, spots.touching
        hottest = hottest_so_far(state)
        if self._knows_flash:
            force, radius = spots.places.totals(rubbed.normal) / dt, touching.radius
            if touching.points is not None:
                radius = touching.points.flash_radii(rubbed.normal / dt, force, touching.modulus)
            power = spots.places.totals(np.maximum(rubbed.sliding, 0.0)) / dt
            hottest = hottest_spot(
                scene, touching.i, touching.j, radius, touching.modulus, force, power,
                rubbed.rubbing, rubbed.normal, self.shape_temperatures(t), self._settings.laws,
                hottest,
            )  # fmt: skip
        note_hottest(state, hottest)

    def _spots(self, moved: Moved, carried: Floats, touching: Touching, dt: float) -> Spots:
        scene, contacts, settings = moved.scene, moved.contacts, self._settings
        force = forces_of_step(self._state, scene, carried, contacts, touching, settings, dt)
        spots = conducting_spots(scene, touching, force, settings)
        if settings.collisional:
            row = warm_rows(self._model.grain_count, moved.loaded_i)
            is_known = met_before(scene, row, moved.loaded_j, moved.i, moved.j)
            totals, points = spots.places.totals(carried), touching.points
            if points is not None:
                is_known |= points.key >= 0
                self._hit(moved, points, carried, totals, row, dt, spots.conductance)
            if moved.impacts is not None and moved.impacts.i.size:
                strike(
                    scene, self._model.grains.mass, moved.impacts, moved.i, moved.j, settings.laws,
                    dt, is_known, spots.conductance,
                )  # fmt: skip
            collide(
                scene, self._model.grains.mass, moved.mobility, contacts, totals, is_known,
                settings.laws, dt, spots.conductance,
            )  # fmt: skip
        return spots

    def _hit(
        self, moved: Moved, points: FacePoints, carried: Floats, totals: Floats,
        row: NDArray[np.int64], dt: float, conductance: Floats,
    ) -> None:  # fmt: skip
        """Impacts of grains that are no discs; arguments as of `hit`."""
        model = self._model
        is_known = known_points(
            row, moved.loaded_j, moved.loaded_point, moved.i, moved.j, points.key, points.head
        )
        hit(
            moved.scene, model.grains.mass, moved.mobility, model.shape_factor, moved.contacts,
            points.key, points.head, points.spot_radii(carried, totals),
            points.pressed_areas(carried), carried, totals, is_known, self._settings.laws, dt,
            conductance,
        )  # fmt: skip

    def _links(self, scene: Scene, spots: Spots, ends: Ends) -> Links:
        """Contacts with their ``ends``, and pairs within the reach of mechanisms, if any is."""
        settings, reach = self._settings, self._settings.reach
        if reach <= 0.0:
            return contact_links(spots, ends)
        near = self._pairs(scene, reach)
        return near_links(scene, spots, near, self._shapes, settings, self._model, self._outlined)

    def _pairs(self, scene: Scene, reach: float) -> tuple[Ints, Ints, Floats]:
        """Pairs whose gap is at most ``reach`` times the smaller radius."""
        if self._state.radius.size:
            self._list.note_radii(self._model.grains.radius)
        self._list.update(scene, reach * float(self._model.grains.radius.max()))
        has_points = self._pieces is not None
        return near_pairs(scene, has_points, self._list.row, self._list.partner, reach)

    def _integrate(
        self, links: Links, source: Floats, scene: Scene, strayed: Floats, dt: float, t: float, *,
        is_frozen: bool, should_stop: Callable[[], bool] | None = None,
    ) -> None:  # fmt: skip
        state, settings, bodies = self._state, self._settings, self._bodies
        temperature, n = np.empty(self._capacity.size), self._model.grain_count
        if not warm(self._thermal.initial_temperature, state.heat, self._capacity, temperature):
            raise PhysicsError(
                state.step, find_absurd_value(state, self._model) or "a temperature is not finite"
            )
        temperature[n:] = state.wall_temperature[bodies]
        velocity = np.zeros((n, 2)) if is_frozen else state.velocity[:, :2]
        ahead, branch = np.empty(0), np.empty((0, 2))
        if state.flux_books.size:
            branch = branches(scene, links.i, links.j)
            if links.points is not None:
                links.points.lead_to_walls(links.j >= n, branch)
        if self._gradient.any():
            branch, ahead = look_ahead(scene, links.ends.i, links.ends.j, self._gradient)
            gained = take_along(self._capacity, strayed, self._gradient)
            source = source + gained
        net = network_of(links, temperature.size, velocity, self._model, settings, ahead)
        walls = WallValues(self._conditions, t)
        try:
            flow = integrate(
                net, self._capacity, temperature, walls, source, dt, state.heat_dt, settings,
                should_stop, is_frozen=is_frozen,
            )  # fmt: skip
        except CannotIntegrate as error:
            what = find_absurd_value(state, self._model) or f"{self._name(error.node)} {error.why}"
            raise PhysicsError(state.step, what) from error
        if not np.isfinite(temperature).all():
            what = self._name(int(np.argmin(np.isfinite(temperature))))
            raise PhysicsError(state.step, f"the temperature of {what} is not finite")
        state.heat_dt = flow.next_step
        if bodies.size:
            state.wall_temperature[bodies] += flow.received[n:] / self._capacity[n:]
            flow.walls[bodies] += source[n:] - flow.received[n:]
        state.wall_temperature = walls.temperatures(dt, state.wall_temperature)
        book_flow(state, flow, walls.undelivered(dt, net.flow_wall[net.flow_share > 0.0]))
        if state.flux_books.size or self._gradient.any():
            heat = passed(
                net, links.ends, links.conductance, links.of_contacts, branch, self._capacity,
                strayed, flow.lasted, walls.lasting(dt), dt,
            )  # fmt: skip
            if state.flux_books.size:
                state.flux_books += heat.ravel()
            else:
                book_along(state, total(gained), heat / (scene.period * scene.height))
        note_contacts(state, links.biot, links.gas_ratio)
        strike_balance(state, flow.received)

    def _name(self, node: int) -> str:
        n = self._model.grain_count
        return (
            self._model.name_of(node)
            if node < n
            else f"wall {self._model.walls.names[self._bodies[node - n]]}"
        )
