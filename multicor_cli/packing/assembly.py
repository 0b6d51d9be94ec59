"""From a scenario to the initial `Model` and `State`."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import mean, total
from multicor_cli.model import Grains, Model, Presence, ShapeKind, State, Thermal, Walls
from multicor_cli.model.cell import CELL
from multicor_cli.model.columns import ANGLE, RADIUS, SPIN, X, Y
from multicor_cli.model.model import LEAST_THROAT, SHAPE_FACTOR, Floats
from multicor_cli.model.outlines import Outlines
from multicor_cli.model.state import nudge, nudge_seed
from multicor_cli.packing import other_run
from multicor_cli.packing.groups import make_group
from multicor_cli.packing.initial_grains import InitialGrains, inertias, masses
from multicor_cli.packing.materials import (
    contact_laws,
    group_thermal,
    sizes_problems,
    touching_pairs,
)
from multicor_cli.packing.overlap import (
    Groups,
    behind_problem,
    overlap_problems,
    solid_problem,
    wrap,
)
from multicor_cli.packing.walls import BuiltWalls, build_walls
from multicor_cli.scenario import Scenario
from multicor_cli.scenario.checks.grains import fault_of_period
from multicor_cli.scenario.problems import Refused
from multicor_cli.store.documents import Origin


@dataclass(frozen=True)
class Placed:
    """What a run begins with.

    ``origin`` is the moment of another run from which it goes on; None: all start anew.
    """

    model: Model
    state: State
    origin: Origin | None = None


def build(scenario: Scenario) -> tuple[Model, State]:
    """The model and the initial state of a scenario; arguments and errors as `place`."""
    placed = place(scenario)
    return placed.model, placed.state


def place(scenario: Scenario) -> Placed:
    """Make walls and grains as they are at time zero, or take them from the run to go on from.

    Groups are placed in the order of the file; later ones keep clear of earlier ones or are piled
    upon them where their packing can. The same scenario gives the same bits.

    Raises:
        ScenarioError: A packing or a wall cannot be made, or bodies overlap by more than 10⁻³ of
            the smaller radius; there is no run to go on from, or it does not fit.
    """
    source = None
    try:
        if scenario.start is not None:
            source = other_run.read_source(scenario)
            problems = other_run.misfits(scenario, source)
            if problems:
                raise scenario.refuse(*problems)
            bodies = other_run.known_bodies(scenario, source)
            walls = other_run.placed_walls(build_walls(scenario, bodies), source)
        else:
            walls = build_walls(scenario)
    except Refused as error:
        raise scenario.refuse(error) from error
    if source is None:
        groups = _make_groups(scenario, walls)
    else:
        groups = other_run.grains_of(scenario, source)
    model = other_run.carry_masses(source, _model(scenario, walls, groups))
    if model.is_cell:
        model = _with_cell(scenario, model)
        if source is not None:  # of the size that it has there by now
            width, height = source.state.wall_position[0, :2].tolist()
            model = replace(model, period=width, height=height)
    _refuse_throats(scenario, model)
    _refuse_ranges(scenario, model)
    if source is not None and source.model.outlets is not None and model.outlets is None:
        model = replace(model, outlets=())  # grains that are not there stay away
    state = _state(scenario, model, walls, groups)
    sized = model
    if source is not None:
        if model.is_cell:
            state.wall_position[:] = source.state.wall_position
        other_run.carry_presence(source, model, state)
        sized = other_run.carry_sizes(source, model, state)
    _refuse_overlaps(scenario, sized, state, walls)
    if source is not None:
        model, state = other_run.carried_over(scenario, source, model, state)
        _refuse_unknown_forces(scenario, source, state)
    elif (seed := nudge_seed()) is not None:
        # A run that goes on is not nudged: what moved it by an ulp did so when it began
        state.position = nudge(state.position, model.period, seed, model.height)
    model = replace(model, start_speed=start_speed(scenario, model, state))
    return Placed(model, state, None if source is None else other_run.origin_of(source, model))


def _refuse_unknown_forces(scenario: Scenario, source: other_run.Source, state: State) -> None:
    """Spots of a frozen stage need forces: a start has none, nor a frame without contacts."""
    heat = scenario.heat
    if (
        heat is None
        or not scenario.loading[0].frozen
        or state.contact_i.size
        or not heat.needs_forces
    ):
        return
    text = (
        "the forces of the contacts are not known, and conduction needs them: the run "
        f"'{source.path}' holds none here"
    )
    remedy = (
        "go on from its end, or from a frame with contacts that carry something; or add a stage "
        "of at least one step before it"
    )
    raise scenario.refuse(Refused(("loading", 0, "frozen"), text, remedy))


def _make_groups(scenario: Scenario, walls: BuiltWalls) -> list[InitialGrains]:
    """The grains of all groups; problems of all groups are reported together."""
    groups: list[InitialGrains] = []
    errors, domain = [], scenario.domain
    placed: list[tuple[InitialGrains, Floats]] = []
    for k, table in enumerate(scenario.particles):
        obstacles = walls.obstacles(k)
        for earlier, discs in placed:
            if earlier.forms is None:
                obstacles = obstacles.with_discs(discs)
            else:
                angle = earlier.position[:, ANGLE]
                obstacles = obstacles.with_grains(discs, earlier.forms.outlines, angle)
        try:
            group = make_group(scenario, k, obstacles)
            if fault := fault_of_period(domain, 2.0 * float(group.radius.max(initial=0.0))):
                raise fault.within("sizes" if table.sizes is not None else "packing")
        except Refused as error:
            errors.append(error.within("particles", k))
            continue
        groups.append(group)
        if table.packing is not None:
            discs = np.column_stack([_wrapped(scenario, group.position), group.radius])
            placed.append((group, discs))
            if domain.is_cell:  # with the images in y; those in x are known from the period
                image = discs.copy()
                image[:, Y] += np.where(discs[:, Y] < 0.5 * domain.size[1], 1, -1) * domain.size[1]
                placed.append((group, image))
    if errors:
        raise scenario.refuse(*errors)
    return groups


def _wrapped(scenario: Scenario, position: Floats) -> Floats:
    center = position[:, :2].copy()
    for axis, period in enumerate(scenario.domain.periods):
        center[:, axis] = wrap(center[:, axis], period)
    return center


def _refuse_throats(scenario: Scenario, model: Model) -> None:
    """Refuse discs so wide that a grain meets one and its image: only the nearer is looked at."""
    if model.period <= 0.0 or model.is_cell:
        return
    mechanisms = scenario.heat.mechanisms.values() if scenario.heat is not None else ()
    diameters = max(
        [LEAST_THROAT, *(1.0 + (getattr(table, "reach", None) or 0.0) for table in mechanisms)]
    )
    shapes, problems = model.shapes, []
    for w, name in enumerate(model.walls.names):
        discs = shapes.geometry[(shapes.wall == w) & (shapes.kind == ShapeKind.DISC), RADIUS]
        meeting = model.grains.radius[_meets(model, w, np.arange(model.grain_count))]
        left = model.period - 2.0 * float(discs.max(initial=0.0))
        diameter = 2.0 * float(meeting.max(initial=0.0))
        if left < diameters * diameter:
            text = (
                f"a disc of the wall '{name}' and its image one period of {model.period:g} m away "
                f"leave {left:g} m between them, less than {diameters:g} times the largest "
                f"diameter of {diameter:g} m"
            )
            remedy = (
                "make the disc or the grains smaller, or the domain twice as wide with two such "
                "discs: the same throat"
            )
            problems.append(Refused(("walls", w, "geometry"), text, remedy))
    if problems:
        raise scenario.refuse(*problems)


def _refuse_ranges(scenario: Scenario, model: Model) -> None:
    """Refuse adhesion across more than a radius: grains would pull at others past neighbors."""
    grains, laws, problems = model.grains, model.laws, {}
    for a, b in touching_pairs(grains, model.shapes, model.walls):
        if not laws.adhesion.size or laws.adhesion[a, b] == 0.0:
            continue
        smallest = float(grains.radius[np.isin(grains.material, (a, b))].min())
        reach = float(laws.adhesion_range[a, b])
        law = scenario.law(model.materials[a], model.materials[b])
        if reach <= smallest:
            continue
        entry = next(k for k, each in enumerate(scenario.contacts) if each is law)
        is_given = law.attraction.range is not None
        key = ("adhesion", "range") if is_given else ("adhesion",)
        given = "" if is_given else ", a hundredth of the mean diameter,"
        text = (
            f"adhesion across {reach:g} m{given} reaches farther than the smallest radius, "
            f"{smallest:g} m"
        )
        remedy = "give a smaller range [m], as { force = 1e-5, range = 2e-6 }"
        problems[entry] = Refused(("contacts", entry, *key), text, remedy)
    if problems:
        raise scenario.refuse(*problems.values())


def _model(scenario: Scenario, walls: BuiltWalls, groups: list[InitialGrains]) -> Model:
    names, mass, inertia = list(scenario.materials), [], []
    for table, group in zip(scenario.particles, groups, strict=True):
        density = table.solid * scenario.materials[table.material].density
        mass.append(masses(group.radius, density, table.body, table.thickness, group.forms))
        inertia.append(inertias(group.radius, mass[-1], table.body, group.forms))
    counts = [group.radius.size for group in groups]
    material = np.array([names.index(table.material) for table in scenario.particles], np.int32)
    grains = Grains(
        radius=np.concatenate([group.radius for group in groups]),
        mass=np.concatenate(mass),
        inertia=np.concatenate(inertia),
        material=np.repeat(material, counts),
        group=np.repeat(np.arange(len(groups), dtype=np.int32), counts),
    )
    touching = touching_pairs(grains, walls.shapes, walls.walls)
    sheds = scenario.heat is not None and scenario.heat.wear_shrinks
    expansion = np.array([scenario.materials[name].expansion or 0.0 for name in names])
    if not sheds and not expansion[material].any():
        expansion = np.zeros(0)  # grains keep their size
    return Model(
        grains=grains,
        shapes=walls.shapes,
        walls=walls.walls,
        laws=contact_laws(names, touching, scenario.law, 2.0 * mean(grains.radius)),
        materials=tuple(names),
        groups=tuple(group.name for group in scenario.particles),
        period=scenario.domain.period,
        gravity=np.array(scenario.domain.gravity, float),
        shape_factor=SHAPE_FACTOR[scenario.particles[0].body],
        outlets=tuple(outlet.name for outlet in scenario.outlets) if scenario.is_open else None,
        thermal=_thermal(scenario, groups),
        height=scenario.domain.size[1] if scenario.domain.is_cell else 0.0,
        expansion=expansion,
        sheds=sheds,
        heat_gradient=(scenario.heat and scenario.heat.gradient) or (0.0, 0.0),
        outlines=_outlines(groups),
    )


def _outlines(groups: list[InitialGrains]) -> Outlines | None:
    """Outlines of all grains; None if all are discs or spheres."""
    if all(group.forms is None for group in groups):
        return None
    return Outlines.joined([
        Outlines.of_discs(group.radius) if group.forms is None else group.forms.outlines
        for group in groups
    ])  # fmt: skip


def _with_cell(scenario: Scenario, model: Model) -> Model:
    """The model with its cell, which is its one wall.

    Its inertia is that of the grains, Σ m d̄², times ``cell_inertia``, for all three components.
    """
    factor = 1.0 if scenario.domain.cell_inertia is None else scenario.domain.cell_inertia
    diameter = model.mean_diameter
    inertia = np.array([factor * total(model.grains.mass) * diameter * diameter])
    walls = Walls((CELL,), inertia, inertia.copy(), np.zeros(1, np.bool_), np.zeros(1))
    return replace(model, walls=walls)


def _thermal(scenario: Scenario, groups: list[InitialGrains]) -> Thermal | None:
    """Heat capacities and temperatures, if any; problems of all groups are reported together."""
    if scenario.heat is None:
        return None
    errors = sizes_problems(scenario, groups)
    parts = []
    for k, group in enumerate(groups):
        try:
            parts.append(group_thermal(scenario, k, group, _wrapped(scenario, group.position)))
        except Refused as error:
            errors.append(error.within("particles", k))
    if errors:
        raise scenario.refuse(*errors)
    columns = ([getattr(part, each.name) for part in parts] for each in fields(Thermal))
    return Thermal(*map(np.concatenate, columns))


def _state(
    scenario: Scenario, model: Model, walls: BuiltWalls, groups: list[InitialGrains]
) -> State:
    state = State.at_rest(model, np.concatenate([group.position for group in groups]))
    if model.period > 0.0:
        state.position[:, X] = wrap(state.position[:, X], model.period)
    if model.is_cell:
        state.position[:, Y] = wrap(state.position[:, Y], model.height)
        state.wall_position[0, :2] = scenario.domain.size
        if (rates := scenario.domain.cell_rates) is not None:
            state.wall_velocity[0] = rates.xx, rates.yy, rates.xy
    else:
        state.wall_position[:] = walls.position
    state.velocity = np.concatenate([group.velocity for group in groups])
    if state.presence.size:
        waiting = [k for k, table in enumerate(scenario.particles) if table.packing is None]
        state.presence[np.isin(model.grains.group, waiting)] = Presence.WAITS
        # Loads the solver, and few scenarios need it
        from multicor_cli.engine.inflow import note_presence

        note_presence(state, model, 0)
    return state


def _refuse_overlaps(scenario: Scenario, model: Model, state: State, walls: BuiltWalls) -> None:
    """Refuse overlaps, grains in solid matter, and grains on the wrong side of rough walls."""
    names, here = model.walls.names, np.arange(model.grain_count)[state.here]
    if not here.size:
        return
    groups = Groups(scenario.particles, model.grains.group)
    meeting = [here[_meets(model, w, here)] for w in range(model.wall_count)]
    within = (
        solid_problem(state.position, meeting[w], room, names[w], w, groups)
        for w, room in enumerate(walls.rooms)
    )
    problems = [problem for problem in within if problem is not None]
    told = {problem.where for problem in problems}
    cell = state.wall_position[0] if model.is_cell else None
    cut = overlap_problems(state.position, model, walls.obstacles(), here, groups, cell)
    problems += [problem for problem in cut if problem.where not in told]
    for w, front in enumerate(walls.fronts):
        if front is not None:
            found = behind_problem(
                state.position, meeting[w], front, names[w], w, model.period, groups
            )
            problems += [found] if found else []
    if problems:
        raise scenario.refuse(*problems)


def _meets(model: Model, wall: int, grains: NDArray[np.int64]) -> NDArray[np.bool_]:
    meets = model.walls.meets
    return meets[wall, model.grains.group[grains]] if meets.size else np.ones(grains.size, np.bool_)


# ---- The fastest motion with which a run starts, which the automatic time step has to follow


def start_speed(scenario: Scenario, model: Model, state: State) -> float:
    """Largest speed of a grain, of a grain's surface (a |ω|), and of a wall at the start [m/s].

    Between walls that shear a periodic domain, grains count relative to the linear profile between
    these walls, and the walls themselves do not count: neighbors pass each other no faster than the
    rate of shear says. In a cell grains count relative to its mean flow likewise.
    """
    here, radius = state.here, model.grains.radius
    spans = np.array([wall.geometry.spans_period(scenario.domain) for wall in scenario.walls], bool)
    # A cell is no wall of the scenario: its rates are no speeds
    velocity, walls = state.velocity[here], state.wall_velocity[: spans.size]
    along = velocity[:, X] - _imposed(scenario, model, state, spans, state.position[here, Y])
    of_walls = np.where(spans, 0.0, walls[:, X])
    speeds = (
        np.sqrt(along * along + velocity[:, Y] * velocity[:, Y]),
        radius[here] * np.abs(velocity[:, SPIN]),
        np.sqrt(of_walls * of_walls + walls[:, Y] * walls[:, Y]),
    )
    return max(float(values.max(initial=0.0)) for values in speeds)


def _imposed(
    scenario: Scenario, model: Model, state: State, spans: NDArray[np.bool_], height: Floats
) -> Floats:
    """Linear profile of u_x between the outer walls that span the period, at heights [m/s]."""
    walls = np.flatnonzero(spans)
    at = state.wall_position[walls, Y]
    if walls.size < 2 or at.min() == at.max():
        return np.zeros_like(height)
    drives = scenario.drives(model.walls.names)[0].walls
    speed = []
    for wall in (walls[at.argmin()], walls[at.argmax()]):
        prescribed = drives[wall].x.velocity
        speed.append(
            float(state.wall_velocity[wall, X]) if prescribed is None else prescribed.value(0.0)
        )
    return np.asarray(
        speed[0] + (speed[1] - speed[0]) * ((height - at.min()) / (at.max() - at.min()))
    )
