"""Going on from another run: its last checkpoint or a frame, and what is taken over from there.

That is what the next step depends on, to the bit: grains with contacts and heat, walls by names.
Clocks, counters and books begin at zero.
"""

from __future__ import annotations

import hashlib
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.geometry.scene import scene_of
from multicor_cli.model import Model, Presence, State, Thermal, WallBody
from multicor_cli.model.cell import mean_flow
from multicor_cli.model.columns import NORMAL, Y
from multicor_cli.model.contacts import are_impacts
from multicor_cli.model.model import SHAPE_FACTOR, Floats, Ints
from multicor_cli.model.shapes import TAIL, Room, Tail
from multicor_cli.model.state import find_misfit
from multicor_cli.packing.groups import refuse_other_shapes, with_motion
from multicor_cli.packing.initial_grains import Forms, InitialGrains
from multicor_cli.packing.walls import BuiltWalls
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.particles import ParticleGroup
from multicor_cli.scenario.problems import Refused
from multicor_cli.store import StoreError, layout, open_run
from multicor_cli.store.atomic import is_regular
from multicor_cli.store.documents import Origin
from multicor_cli.store.errors import NoFrame
from multicor_cli.store.frames import Frame

_RUN, _FRAME = ("start", "run"), ("start", "frame")

# ---- The moment


@dataclass(frozen=True)
class Source:
    """A moment of another run: a frame, counted from 0, or the last checkpoint.

    Of a frame with heat the temperatures at the start of ``model`` are the frame's, unless grains
    expand from those that they had at first, or come again with them; of a frame the state is what
    it holds, without running averages of heat. ``size`` is that of the domain [m], None if the
    scenario does not tell; ``geometries`` are tables of the walls, by their names.
    """

    path: Path
    run_id: str
    frame: int | None
    model: Model
    state: State
    digest: str
    size: tuple[float, float] | None
    geometries: dict[str, Any]

    @property
    def temperature(self) -> Floats | None:
        """Temperatures of the grains [K], shape ``(n,)``; None if the run has no heat."""
        return None if self.model.thermal is None else self.state.temperature(self.model.thermal)


def read_source(scenario: Scenario) -> Source:
    """The moment that ``[start]`` names; the run may be going on, and is not changed.

    `Refused`, by a key from the top, if there is no such run or moment, or it is damaged.
    """
    start = scenario.start
    assert start is not None  # only then it is asked for
    path = scenario.resolve_path(start.run)
    verify = "check {} with multicor verify, {}".format
    try:
        if not is_regular(path / layout.RUN):
            what = f"'{path}' is not a run directory"
            raise Refused(_RUN, what, "give the directory of a run, relative to the scenario file")
        with open_run(path) as run:
            model, told = run.model, _told(run.scenario_resolved)
            if start.frame is None:
                state = run.state()
                if state is None:
                    what = (
                        f"the run '{path}' has no checkpoint: it stopped before its grains were "
                        "placed, or its checkpoints were removed"
                    )
                    raise Refused(_RUN, what, "let it run first, or go on from a frame")
                return Source(path, run.run_id, None, model, state, state.digest(), *told)
            frame = run.frames[start.frame]
            source = Source(path, run.run_id, frame.index, *_of_frame(frame, model), *told)
    except NoFrame as error:
        what = f"cannot go on from the run '{path}': {error}"
        raise Refused(_FRAME, what, "choose another frame") from None
    except Refused:
        raise
    except (StoreError, ValueError, RecursionError) as error:
        what = f"cannot go on from the run '{path}': {error}"
        raise Refused(_RUN, what, verify("it", "and whether it ever began")) from None
    misfit = find_misfit(source.state, source.model)
    if misfit is not None:
        what = f"frame {source.frame} of the run '{path}': {misfit}"
        raise Refused(_FRAME, what, verify("the run", "or go on from another frame"))
    return source


def _told(resolved: str) -> tuple[tuple[float, float] | None, dict[str, Any]]:
    """Size of the domain, geometries of walls in a scenario from anywhere; raises `ValueError`."""
    tables = tomllib.loads(resolved)
    try:
        walls = {str(wall["name"]): wall["geometry"] for wall in tables.get("walls", [])}
        width, height = tables["domain"]["size"]
        return (float(width), float(height)), walls
    except (LookupError, TypeError, AttributeError):
        return None, {}


def _of_frame(frame: Frame, model: Model) -> tuple[Model, State, str]:
    """What a frame holds as a model with its temperatures, a state, and the digest of both.

    Positions and velocities are those at the end of the step, as in the state.
    """
    here = frame.number
    state = State.at_rest(model, np.zeros((model.grain_count, 3)))
    state.position[here] = np.column_stack([frame.position, frame.angle])
    state.velocity[here] = np.column_stack([frame.velocity, frame.spin])
    state.image[here] = frame.image
    if frame.is_open:
        state.presence = np.array(frame.column("particles/presence"), np.uint8)
    state.wall_position = np.array(frame.wall_position, float)
    state.wall_velocity = np.array(frame.wall_velocity, float)
    if frame.wall_surface is not None:
        state.wall_surface = np.array(frame.wall_surface, float)
    if model.is_cell:  # frames have real velocities, states those relative to the mean flow
        state.velocity[:, :2] -= mean_flow(state.position, state.wall_velocity[0])
    state.step, state.time, state.last_dt = frame.step, frame.time, frame.dt
    if frame.radius is not None and state.radius.size:
        state.radius[here] = frame.radius
        state.wear[here] = frame.wear
    _take_contacts(frame, model, state)
    digest = hashlib.blake2b(state.digest().encode(), digest_size=16)
    thermal, of_walls = model.thermal, frame.wall_temperature
    if thermal is not None and frame.temperature is not None and of_walls is not None:
        temperature = thermal.initial_temperature.copy()
        temperature[here] = frame.temperature
        # Radii count from the temperatures at the start, and grains come again with them
        if model.expansion.any() or frame.is_open:
            state.heat = thermal.capacity * (temperature - thermal.initial_temperature)
        else:
            model = replace(model, thermal=replace(thermal, initial_temperature=temperature))
        state.wall_temperature = np.array(of_walls, float)
        digest.update(temperature.tobytes())
    return model, state, digest.hexdigest()


_APART = 1e-4
"""Gap over the radius from which on a contact under tension does not touch."""


def _take_contacts(frame: Frame, model: Model, state: State) -> None:
    """Contacts of a frame that carry an impulse, and bridges, if any; q = p + F Δt (theory §3.1).

    What is pulled across a gap has q = 0.
    """
    from multicor_cli.engine.contact.adhesion import resting_attraction

    contacts = frame.contacts
    if not contacts.recorded or not len(contacts) or not state.last_dt:
        return
    shapes = model.grain_count + np.arange(model.shape_count)
    number = np.concatenate([frame.number, shapes]).astype(np.int32)
    i, j = number[contacts.i], number[contacts.j]
    impulse = np.array(contacts.impulse, float)
    is_loaded = impulse.any(axis=1) & ~are_impacts(np.asarray(contacts.gap))
    scene = scene_of(model, state.position, state.wall_position)
    laws = model.laws.with_ranges(model.mean_diameter)
    attraction = resting_attraction(laws, scene, i, j, state.last_dt, model.outlines)
    if attraction.size:
        is_apart = np.asarray(contacts.gap) > _APART * model.grains.radius[i]
        is_loaded &= ~(is_apart & (impulse[:, NORMAL] < 0.0))
        impulse[:, NORMAL] += attraction
        is_bridge = np.array(laws.is_wet[scene.material[i], scene.material[j]], bool)
        state.bridge_i, state.bridge_j = i[is_bridge], j[is_bridge]
    is_loaded &= impulse[:, NORMAL] > 0.0
    state.contact_i, state.contact_j = i[is_loaded], j[is_loaded]
    state.contact_impulse = impulse[is_loaded]
    if model.outlines is not None:  # which points they are is found by where these are
        state.contact_point = np.full(state.contact_i.size, -1, np.int32)
    if model.laws.rolling.size:
        couple = np.zeros(len(i)) if contacts.couple is None else contacts.couple
        state.contact_couple = np.array(couple, float)[is_loaded]


# ---- What is taken over


def misfits(scenario: Scenario, source: Source) -> list[Refused]:
    """What of a scenario does not fit to the run that it goes on from."""
    what, before = f"the run '{source.path}'", source.model
    verify = "check {} with multicor verify".format
    if not scenario.particles:
        return [Refused(_RUN, f"the scenario of {what} cannot be read", verify("the run"))]
    found, domain = [], scenario.domain
    groups = tuple(group.name for group in scenario.particles)
    if groups != before.groups:
        text = f"{what} has the groups {', '.join(before.groups)}, the scenario {', '.join(groups)}"
        remedy = "remove [[particles]], or name the groups of the run in their order"
        found.append(Refused(("particles",), text, remedy))
    shape = scenario.particles[0].body
    if SHAPE_FACTOR[shape] != before.shape_factor:
        remedy = "remove [[particles]], or use the shape that they have in the run"
        text = f"{what} has other grains than {shape}s"
        found.append(Refused(("particles", 0, "shape"), text, remedy))
    if (np.diff(before.grains.group) < 0).any():
        text = f"{what} has grains that are not in the order of its groups"
        found.append(Refused(_RUN, text, verify("it")))
    if domain.is_cell != before.is_cell:
        text = f"{what} is {'a' if before.is_cell else 'no'} cell, periodic in x and y"
        found.append(Refused(("domain", "periodic"), text, "use the size and periodic of that run"))
    elif domain.is_cell:
        if source.size not in (None, domain.size):
            size, there = (f"{w:g} × {h:g} m" for w, h in (domain.size, source.size or (0.0, 0.0)))
            text = f"the cell is {size} at first, that of {what} {there}"
            remedy = "use the size of that run: the cell goes on as large as it is there by now"
            found.append(Refused(("domain", "size"), text, remedy))
        return found
    elif domain.period != before.period:
        text = f"the period is {domain.period:g} m, that of {what} {before.period:g} m (0: none)"
        found.append(Refused(("domain", "size"), text, "use the size and periodic of that run"))
    # Grains beyond a domain other than the run's; what has left its own may stay outside
    if source.size is not None and source.size != domain.size:
        center = source.state.position[source.state.here, :2]
        is_outside = (center < 0.0) | (center > np.array(domain.size))
        if before.period > 0.0:
            is_outside = is_outside[:, Y:]
        count = int(np.count_nonzero(is_outside.any(axis=1)))
        room, there = (f"{width:g} × {height:g} m" for width, height in (domain.size, source.size))
        text = f"{count} grains of {what} lie outside {room} (there: {there})"
        remedy = "enlarge the domain, or use that of the run"
        found += [Refused(("domain", "size"), text, remedy)] if count else []
    return found


def grains_of(scenario: Scenario, source: Source) -> list[InitialGrains]:
    """The grains of each group where the run has them, moving as there and as the scenario adds."""
    state, grains, temperature = source.state, source.model.grains, source.temperature
    groups = []
    for k, group in enumerate(scenario.particles):
        mine = np.flatnonzero(grains.group == k)
        warmth = None if temperature is None else temperature[mine]
        place, motion = state.position[mine], state.velocity[mine]
        radius = _initial_radius(scenario, group, source, mine)
        forms = _forms_of(source, mine)
        if forms is not None:
            forms = forms.scaled(radius / grains.radius[mine])
        found = InitialGrains(radius, place, motion, warmth, forms=forms)
        try:
            refuse_other_shapes(group, found, f"the run '{source.path}'")
        except Refused as error:
            raise scenario.refuse(error.within("particles", k)) from error
        has_more = any((*group.velocity, group.spin, group.shear_rate))
        # Else -0 would become 0
        groups.append(with_motion(scenario, group, found) if has_more else found)
    return groups


def _initial_radius(
    scenario: Scenario, group: ParticleGroup, source: Source, mine: NDArray[np.int64]
) -> Floats:
    """Radii of grains of a group from which their sizes count in the new run [m], shape ``(k,)``.

    Those of the run while they grow and wear off as there, a = a₀ √(1 − worn) [1 + α (T − T₀)] or
    its cube root; else those that make them as large with the new α, of all of which nothing is
    worn. The temperatures T₀ stay, but where the scenario tells others: grains then have their size
    at these.
    """
    model, state, first = source.model, source.state, source.model.grains.radius[mine]
    sheds = scenario.heat is not None and scenario.heat.wear_shrinks
    materials = [scenario.materials[each.material] for each in scenario.particles]
    if not (sheds or any(material.expansion for material in materials)):
        return state.radius[mine] if state.radius.size else first
    before, now = np.zeros(mine.size), scenario.materials[group.material].expansion or 0.0
    if model.expansion.size:
        before = model.expansion[model.grains.material[mine]]
    rise = np.zeros(mine.size)
    if source.temperature is not None and model.thermal is not None:
        rise = (source.temperature - model.thermal.initial_temperature)[mine]
    grown, grows = before * rise, now * rise if group.temperature is None else np.zeros(mine.size)
    size = first * (1.0 + grown) / (1.0 + grows)
    if model.sheds:
        from multicor_cli.engine.motion.growth import worn_sizes

        size = size * worn_sizes(model.worn_share(state.wear)[mine], model.dimension)
    return np.where((before == now) & (grown == grows) & (model.sheds == sheds), first, size)


def _forms_of(source: Source, grains: NDArray[np.int64]) -> Forms | None:
    """Outlines of some grains; None if these are all discs."""
    if source.model.outlines is None:
        return None
    outlines = source.model.outlines.of_grains(grains)
    if outlines.is_disc.all():
        return None
    of_all = source.model.grains
    return Forms(outlines, of_all.inertia[grains] / of_all.mass[grains])


def known_bodies(scenario: Scenario, source: Source) -> dict[str, WallBody]:
    """Walls whose geometry is that in the run: rough ones keep their grains, at any seed."""
    known = {}
    for table in tomllib.loads(scenario.resolved_toml()).get("walls", []):
        name, walls = table["name"], source.model.walls
        if name in walls.names and table["geometry"] == source.geometries.get(name):
            wall = walls.names.index(name)
            origin, length = source.state.wall_position[wall, :2], float(walls.length[wall])
            known[name] = WallBody(origin, *_shapes_of(source.model, wall), length)
    return known


def _shapes_of(model: Model, wall: int) -> tuple[Ints, Floats]:
    """Kinds and geometry of a wall's shapes, which refer to each other from its first one on."""
    mine = np.flatnonzero(model.shapes.wall == wall)
    kind, geometry = model.shapes.kind[mine], model.shapes.geometry[mine].copy()
    refers = (TAIL[kind] == Tail.SHAPES)[:, None] & (geometry[:, 2:] >= 0.0)
    geometry[:, 2:] -= np.where(refers, mine[0] if mine.size else 0, 0)
    return kind, geometry


def placed_walls(walls: BuiltWalls, source: Source) -> BuiltWalls:
    """Walls that are in the run, put where they are there: no grain is then behind or in these."""
    position, fronts, rooms = walls.position.copy(), list(walls.fronts), list(walls.rooms)
    for new, old in _same_walls(walls.walls.names, source).items():
        position[new] = source.state.wall_position[old]
        fronts[new], rooms[new] = None, Room()
    return walls._replace(position=position, fronts=fronts, rooms=rooms)


def _same_walls(names: tuple[str, ...], source: Source) -> dict[int, int]:
    """Index of each wall that is in the run, and its index there."""
    before = source.model.walls.names
    return {new: before.index(name) for new, name in enumerate(names) if name in before}


def carry_presence(source: Source, model: Model, state: State) -> None:
    """Who is there, waits or has gone, where grains come and go; counts begin at zero."""
    from multicor_cli.engine.inflow import note_presence

    if state.presence.size:
        there = np.full(state.presence.size, Presence.THERE, np.uint8)
        state.presence = source.state.presence.copy() if source.state.presence.size else there
        note_presence(state, model, 0)


def carry_masses(source: Source | None, model: Model) -> Model:
    """The model with grains as heavy as they are there, if anywhere, but for another density.

    Masses follow from radii at the start, and of some grains these are others now
    (`_initial_radius`).
    """
    if source is None or np.array_equal(model.grains.radius, source.model.grains.radius):
        return model
    before = source.model
    ratio = before.grains.radius / model.grains.radius
    share = ratio * ratio * (ratio if model.dimension > 2.0 else 1.0)
    if before.sheds:
        share = np.where(ratio == 1.0, 1.0, share * (1.0 - before.worn_share(source.state.wear)))
    grains, thermal = model.grains, model.thermal
    grains = replace(grains, mass=grains.mass * share, inertia=grains.inertia * share)
    if thermal is not None:
        thermal = replace(thermal, capacity=thermal.capacity * share)
    return replace(model, grains=grains, thermal=thermal)


def carry_sizes(source: Source, model: Model, state: State) -> Model:
    """Radii and what has worn off; returns the model with grains as large as they are there.

    Grains that grow and wear off as there go on with what has worn off them, from the same radius
    at the start (`_initial_radius`); others have no wear yet.
    """
    old = source.state
    if not state.radius.size:
        return model
    state.radius = (old.radius if old.radius.size else source.model.grains.radius).copy()
    if model.sheds and source.model.sheds:
        goes_on = model.grains.radius == source.model.grains.radius
        state.wear = np.where(goes_on, old.wear, 0.0)
    return model.with_radius(state.radius, model.worn_share(state.wear))


def carried_over(
    scenario: Scenario, source: Source, model: Model, state: State
) -> tuple[Model, State]:
    """A model and state with all that the next step of the run would have depended on.

    Both begin as those of the new run, bodies and walls in their places; ``state`` is **modified**.
    """
    if model.outlines is not None:  # else rounding would change what a mass times a length makes
        grains, known = model.grains, source.model.grains
        inertia = np.where(grains.mass == known.mass, known.inertia, grains.inertia)
        model = replace(model, grains=replace(grains, inertia=inertia))
    old, same = source.state, _same_walls(model.walls.names, source)
    state.position, state.image, state.last_dt = old.position.copy(), old.image.copy(), old.last_dt
    for new, before in same.items():
        state.wall_velocity[new] = old.wall_velocity[before]
    if old.wall_surface.size:
        state.wall_surface = np.zeros(model.wall_count)
        state.wall_surface[list(same)] = old.wall_surface[list(same.values())]
    _carry_contacts(source, model, state, same)
    if model.thermal is not None and source.model.thermal is not None:
        thermal = _carry_heat(scenario, source, model.thermal, state)
        # Running averages of contact forces; used only where the new run averages too
        kept, state.mean_i, state.mean_j = _renumbered(source, model, old.mean_i, old.mean_j, same)
        state.mean_force, state.mean_age = old.mean_force[kept], old.mean_age
        for new, before in same.items():
            state.wall_temperature[new] = old.wall_temperature[before]
        if old.wall_ahead.size:
            state.wall_ahead = np.zeros(model.wall_count)
            state.wall_ahead[list(same)] = old.wall_ahead[list(same.values())]
        model = replace(model, thermal=thermal)
    return model, state


def _carry_contacts(source: Source, model: Model, state: State, same: Mapping[int, int]) -> None:
    """Contacts of the last step, their impulses and couples, and bridges.

    q_n = p_n + F Δt with the new F (theory §3.1).
    """
    from multicor_cli.engine.contact.adhesion import resting_attraction

    old, before = source.state, source.model
    i, j = old.contact_i, old.contact_j
    kept, state.contact_i, state.contact_j = _renumbered(source, model, i, j, same)
    impulse = old.contact_impulse[kept]

    def attraction(m: Model, s: State, i: Ints, j: Ints) -> Floats:
        laws, scene = m.laws.with_ranges(m.mean_diameter), scene_of(m, s.position, s.wall_position)
        return resting_attraction(laws, scene, i, j, old.last_dt, m.outlines)

    was = attraction(before, old, i[kept], j[kept])
    now = attraction(model, state, state.contact_i, state.contact_j)
    change = (now if now.size else 0.0) - (was if was.size else np.zeros(len(kept)))
    impulse[:, NORMAL] = np.maximum(impulse[:, NORMAL] + change, 0.0)
    state.contact_impulse = impulse
    near, state.near_i, state.near_j = _renumbered(source, model, old.near_i, old.near_j, same)
    if old.near_late.size:
        state.near_late = old.near_late[near]
    if model.outlines is not None:
        state.contact_point = old.contact_point[kept]
        state.near_points = old.near_points[near]
    if model.laws.is_wet.any():
        i, j = old.bridge_i, old.bridge_j
        _, state.bridge_i, state.bridge_j = _renumbered(source, model, i, j, same)
    state.tile = old.tile.copy()
    if model.laws.rolling.size:
        couple, none = old.contact_couple, np.zeros(len(kept))
        state.contact_couple = couple[kept] if couple.size else none


def _carry_heat(scenario: Scenario, source: Source, thermal: Thermal, state: State) -> Thermal:
    """Heat contents with the temperatures from which they count: T = T₀ + Q/C has the same bits.

    Grains whose heat capacity or temperature the scenario changes begin anew, at their temperature
    with Q = 0. Where grains expand, or come again as they came first, T₀ means more than where heat
    counts from: with another capacity it stays, and Q = C (T − T₀).
    """
    before = source.model.thermal
    assert before is not None  # only then there is something to carry
    is_told = np.array([group.temperature is not None for group in scenario.particles])
    is_kept = ~is_told[source.model.grains.group]
    goes_on = is_kept & (thermal.capacity == before.capacity)
    materials = (scenario.materials[group.material] for group in scenario.particles)
    has_start = bool(source.model.expansion.any() or source.state.presence.size)
    is_kept &= goes_on | (has_start or any(material.expansion for material in materials))
    other = source.state.heat / before.capacity * thermal.capacity
    state.heat = np.where(goes_on, source.state.heat, np.where(is_kept, other, 0.0))
    state.heat_ahead = np.where(goes_on, source.state.heat_ahead, 0.0)
    state.heat_dt = source.state.heat_dt
    if state.heat.any():
        state.heat_before = np.array([total(state.heat[state.here])])
    start = np.where(is_kept, before.initial_temperature, thermal.initial_temperature)
    return replace(thermal, initial_temperature=start)


def _renumbered(
    source: Source, model: Model, i: Ints, j: Ints, same: Mapping[int, int]
) -> tuple[Ints, Ints, Ints]:
    """Contacts by shapes of a new model, without walls that are gone or have other shapes.

    Returns which of them, ascending by both shapes as contacts are, and these shapes.
    """
    n = model.grain_count
    number = np.concatenate([np.arange(n), np.full(source.model.shape_count, -1)])
    for new, old in same.items():
        (kind, geometry), before = _shapes_of(model, new), _shapes_of(source.model, old)
        if np.array_equal(kind, before[0]) and np.array_equal(geometry, before[1]):
            mine = np.flatnonzero(model.shapes.wall == new)
            number[n + np.flatnonzero(source.model.shapes.wall == old)] = n + mine
    second = number[j].astype(np.int32)
    is_kept, of_walls = second >= 0, np.flatnonzero(second >= n)
    is_kept[of_walls] &= model.is_met(i[of_walls], second[of_walls] - n)
    kept = np.flatnonzero(is_kept)
    kept = kept[np.lexsort((second[kept], i[kept]))]
    return kept.astype(np.int32), i[kept], second[kept]


def origin_of(source: Source, model: Model) -> Origin:
    """What the run keeps of where it goes on from."""
    names, before = model.walls.names, source.model.walls.names
    return Origin(
        run=os.path.realpath(source.path).encode(errors="backslashreplace").decode(),
        run_id=source.run_id,
        frame=source.frame,
        step=source.state.step,
        time=source.state.time,
        digest=source.digest,
        walls=tuple(name for name in names if name in before),
        new_walls=tuple(name for name in names if name not in before),
        lost_walls=tuple(name for name in before if name not in names),
    )
