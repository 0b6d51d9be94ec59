"""Stages name walls that exist, wait for what can come, and have steps that fit intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from multicor_cli.scenario.checks.grains import double_names
from multicor_cli.scenario.drives import (
    Dof,
    LoadDof,
    TiltedGravityTable,
    is_prescribed,
    keeps_moving,
    moves,
)
from multicor_cli.scenario.problems import KeyPath, Refused, name_list, show
from multicor_cli.scenario.stage_drives import DOF_NAMES, resolve_dofs
from multicor_cli.scenario.stages import (
    Stage,
    StrainEnd,
    UntilAxialStrain,
    UntilDisplacement,
    UntilStrain,
    frozen_dt,
    walls_of,
)
from multicor_cli.scenario.tables import PartialScenario, given
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.scenario.walls import Wall, prism_height

# ---- Loading stages name walls that exist and can do what is asked of them

_LEVEL = 1e-9  # distance over the size of the domain that counts as none


def check(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about the loading stages."""
    yield from double_names([stage.name if stage else None for stage in tables.loading], "loading")
    if tables.is_cell:
        return  # no walls, no gravity
    yield from _nothing_to_tilt(tables)
    if len(set(tables.wall_names) - {None}) < len(tables.wall_names):
        return  # a name is missing or double, and may be the one that is meant below
    unknown = list(_unknown_walls(tables))
    yield from unknown
    if not unknown:
        for k, wall in given(tables.walls):
            yield from _check_inertia(("walls", k), wall, tables)
            yield from _check_turning(wall, tables)
            yield from _check_lengths(wall, tables)


def _unknown_walls(tables: PartialScenario) -> Iterator[Refused]:
    known = [name for name in tables.wall_names if name]
    for k, stage in given(tables.loading):
        used: list[tuple[KeyPath, str]] = [(("drives", name), name) for name in stage.drives]
        used += [(("thermal", name), name) for name in stage.thermal]
        used += [(("until", *keys), name) for keys, name in walls_of(stage.until).items()]
        for wall, dof, load in _loads(stage):
            between = enumerate(load.between or ())
            used += [(("drives", wall, dof, "between", e), name) for e, name in between]
        for place, name in used:
            if name not in known:
                remedy = did_you_mean(name, known) or f"the walls are {name_list(known) or 'none'}"
                yield Refused(("loading", k, *place), f"there is no wall {show(name)}", remedy)


def _loads(stage: Stage) -> Iterator[tuple[str, str, LoadDof]]:
    """Walls and degrees of freedom that loads drive, with what they say."""
    for name, drives in stage.drives.items():
        for dof in DOF_NAMES:
            table = getattr(drives, dof)
            if isinstance(table, LoadDof):
                yield name, dof, table


def _check_lengths(wall: Wall, tables: PartialScenario) -> Iterator[Refused]:
    """A stress acts between two other walls that lie apart across its axis."""
    if tables.domain is None:
        return
    origins = {
        wall.name: wall.geometry.body(tables.domain).origin for _, wall in given(tables.walls)
    }
    for k, stage in given(tables.loading):
        for name, dof, load in _loads(stage):
            if name != wall.name or load.between is None or not set(load.between) <= origins.keys():
                continue
            path = ("loading", k, "drives", name, dof, "between")
            across = "y" if dof == "x" else "x"
            first, second = (float(origins[other]["xy".index(across)]) for other in load.between)
            if name in load.between:
                what = f"the stress on '{name}' cannot act between '{name}' and another wall"
                yield Refused(path, what, "name its two neighbors")
            elif abs(first - second) <= _LEVEL * max(tables.domain.size):
                what = (
                    f"there is no length between '{load.between[0]}' and '{load.between[1]}': "
                    f"both lie at {across} = {first:g}"
                )
                remedy = (
                    f"name two walls apart in {across}, or remove it: the length is then that of "
                    f"'{name}'"
                )
                yield Refused(path, what, remedy)


def _nothing_to_tilt(tables: PartialScenario) -> Iterator[Refused]:
    """Gravity of the magnitude of the domain's, where there is none."""
    if tables.domain is None or any(tables.domain.gravity):
        return
    for k, stage in given(tables.loading):
        gravity = stage.gravity
        if isinstance(gravity, TiltedGravityTable) and gravity.magnitude is None:
            what = "[domain] has gravity = [0, 0], which no angle turns"
            remedy = "add magnitude [m/s²], as magnitude = 9.81"
            yield Refused(("loading", k, "gravity"), what, remedy)


def _check_turning(wall: Wall, tables: PartialScenario) -> Iterator[Refused]:
    """A wall that reaches from one period to the next has no center to turn about."""
    geometry, domain = wall.geometry, tables.domain
    if domain is None or any(geometry.misfits(domain)) or not geometry.spans_period(domain):
        return
    for k, stage in given(tables.loading):
        drives = stage.drives.get(wall.name)
        if drives is not None and drives.spin is not None and moves(drives.spin):
            what = f"the wall '{wall.name}' cannot turn: it reaches from one period to the next"
            remedy = (
                "remove spin, make it narrower than the period in all directions, or use periodic "
                "= false"
            )
            yield Refused(("loading", k, "drives", wall.name, "spin"), what, remedy)


def _check_inertia(path: KeyPath, wall: Wall, tables: PartialScenario) -> Iterator[Refused]:
    """A wall that forces drive has a mass; gravity acts only on such walls."""
    driven: dict[str, int] = {}
    for k, stage in given(tables.loading):
        for name, dof, _ in _loads(stage):
            if name == wall.name:
                driven.setdefault(dof, k)
    substance, groups = wall.geometry.substance, tables.particles
    # Whether mass and inertia follow from the geometry and the material
    weighs = substance is not None
    if substance == "prism" and groups and groups[0]:
        weighs = prism_height(groups[0]) is not None
    moved = [dof for dof in ("x", "y") if dof in driven]
    if moved and wall.mass is None and not weighs:
        stage_key = f"loading.{driven[moved[0]]}"
        what = f"the wall '{wall.name}' has no mass, but a force drives its {moved[0]} in"
        yield Refused((*path, "mass"), f"{what} {stage_key}", "add mass [kg]")
    if "spin" in driven and wall.inertia is None and not weighs:
        stage_key = f"loading.{driven['spin']}"
        what = f"the wall '{wall.name}' has no moment of inertia, but a torque drives its spin in"
        yield Refused((*path, "inertia"), f"{what} {stage_key}", "add inertia [kg m²]")
    if wall.gravity and not moved and None not in tables.loading:
        what = (
            f"no force drives the wall '{wall.name}' in any stage, so that gravity cannot act on it"
        )
        remedy = "remove gravity = true, or drive x or y by a force (which may be 0)"
        yield Refused((*path, "gravity"), what, remedy)


# ---- Stages that wait for something of walls wait for what can come


def check_ends(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about the conditions that end stages."""
    stages = [stage for stage in tables.loading if stage]
    walls = {wall.name: wall for wall in tables.walls if wall}
    if len(stages) < len(tables.loading) or len(walls) < len(tables.walls) or tables.is_cell:
        return  # one is wrong, a name is double, or there are to be none
    for k, (stage, dofs) in enumerate(zip(stages, resolve_dofs(stages, [*walls]), strict=True)):
        if set(walls_of(stage.until).values()) <= walls.keys():
            yield from _check_end(("loading", k, "until"), stage, walls, dofs)


Dofs = Mapping[tuple[str, str], tuple[Dof, int]]
"""What drives each wall in each way, and since which stage."""


def _check_end(
    path: KeyPath, stage: Stage, walls: dict[str, Wall], dofs: Dofs
) -> Iterator[Refused]:
    until = stage.until
    if isinstance(until, UntilStrain) and isinstance(until.strain, StrainEnd):
        path, (lower, upper) = (*path, "strain"), until.strain.walls
        yield from _check_pair(path, (lower, upper), "x", "y", walls, dofs)
        drives = [dofs[name, "x"][0] for name in (lower, upper)]
        stalls = any(map(moves, drives)) and not any(map(keeps_moving, drives))
        if stage.duration is None and stalls:
            what = f"'{lower}' and '{upper}' come to a stop, so that the stage may never end"
            yield Refused(path, what, "give duration [s] too, as its upper bound")
    elif isinstance(until, UntilAxialStrain):
        path, end = (*path, "axial_strain"), until.axial_strain
        yield from _check_pair(path, end.walls, end.axis, end.axis, walls, dofs)
    elif isinstance(until, UntilDisplacement):
        wall, axis = until.displacement.wall, until.displacement.axis
        if not moves(dofs[wall, axis][0]):
            doing = "turn" if axis == "spin" else f"move in {axis}"
            remedy = f"drive it, as drives.{wall}.{axis} = {{ velocity = 0.1 }}"
            what = f"'{wall}' does not {doing} in this stage"
            yield Refused((*path, "displacement"), what, remedy)


def _check_pair(
    path: KeyPath,
    pair: tuple[str, str],
    moved: str,
    apart: str,
    walls: dict[str, Wall],
    dofs: Dofs,
) -> Iterator[Refused]:
    """Two walls that move relative to each other along one axis and lie apart along another."""
    lower, upper = pair
    if lower == upper:
        yield Refused((*path, "walls"), f"'{lower}' is named twice", "name two different walls")
        return
    height, other = (walls[name].geometry.height for name in pair)
    if apart == "y" and height is not None and height == other:
        both = f"'{lower}' and '{upper}' both lie at y = {height:g}"
        what = f"{both}: there is no strain between them"
        yield Refused((*path, "walls"), what, "name two walls at different heights")
    drives = [dofs[name, moved][0] for name in pair]
    if not any(map(moves, drives)) or (drives[0] == drives[1] and is_prescribed(drives[0])):
        what = (
            f"neither '{lower}' nor '{upper}' moves in {moved} relative to the other in this stage"
        )
        remedy = f"drive one of them, as drives.{upper}.{moved} = {{ velocity = 0.1 }}"
        yield Refused(path, what, remedy)


# ---- Time steps, durations and intervals of output go together

MAX_STEPS = 1e10
MAX_FRAMES = 1e6
MAX_ROWS = 1e8
_SLACK = 1e-9


def check_timing(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about times."""
    durations = list(_check_durations(tables))
    yield from durations
    yield from _check_accuracies(tables)
    yield from _check_intervals(tables)
    if not durations:
        yield from _check_amounts(tables)


def _time_step(tables: PartialScenario, stage: Stage) -> float | None:
    """Time step of a stage; None if not known yet: an automatic one suits the output."""
    dt = stage.dt
    if dt is None:
        if stage.frozen:
            return frozen_dt(stage, tables.output) if tables.output else None
        dt = tables.solver.dt if tables.solver else None
    return None if dt == "auto" else dt


def _check_accuracies(tables: PartialScenario) -> Iterator[Refused]:
    what, remedy = "no time step here is automatic", 'remove it, or give dt = "auto"'
    fixed = [stage and (stage.frozen or _time_step(tables, stage)) for stage in tables.loading]
    for k, stage in given(tables.loading):
        if stage.solver and stage.solver.accuracy and fixed[k]:
            yield Refused(("loading", k, "solver", "accuracy"), what, remedy)
    if tables.solver and tables.solver.accuracy != "normal" and fixed and all(fixed):
        yield Refused(("solver", "accuracy"), what, remedy)


def _check_durations(tables: PartialScenario) -> Iterator[Refused]:
    for k, stage in given(tables.loading):
        dt = _time_step(tables, stage)
        if stage.duration is None or dt is None:
            continue
        path = ("loading", k, "duration")
        if stage.duration < dt * (1.0 - _SLACK):
            what = f"{stage.duration:g} s is shorter than the time step dt = {dt:g} s"
            yield Refused(path, what, "lower dt")
        elif stage.duration > MAX_STEPS * dt:
            what = f"{stage.duration:g} s are {stage.duration / dt:.2g} steps of dt = {dt:g} s"
            yield Refused(path, what, f"stay below {MAX_STEPS:g} steps; times are in seconds")


def _check_intervals(tables: PartialScenario) -> Iterator[Refused]:
    output = tables.output
    # That of a frozen stage is the interval at which temperatures are evaluated: output waits
    steps = [_time_step(tables, stage) for _, stage in given(tables.loading) if not stage.frozen]
    longest = max((dt for dt in steps if dt is not None), default=0.0)
    if output is None:
        return
    if output.frame_interval < longest * (1.0 - _SLACK):
        what = f"{output.frame_interval:g} s is less than the time step dt = {longest:g} s"
        yield Refused(("output", "frame_interval"), what, "make it at least dt")
    # Else there is one row per step
    elif output.series_interval < longest * (1.0 - _SLACK) and not output.has_default_series:
        what = f"{output.series_interval:g} s is less than the time step dt = {longest:g} s"
        yield Refused(("output", "series_interval"), what, "make it at least dt, or remove it")


def _check_amounts(tables: PartialScenario) -> Iterator[Refused]:
    """A mistaken interval must not fill the disk."""
    output = tables.output
    if output is None:
        return
    stages = [(stage, stage.duration or 0.0) for _, stage in given(tables.loading)]
    for key, interval, most in (
        ("frame_interval", output.frame_interval, MAX_FRAMES),
        ("series_interval", output.series_interval, MAX_ROWS),
    ):
        # A frozen stage writes no more often than it evaluates temperatures
        times = math.fsum(
            duration / (max(interval, s.dt) if s.frozen and isinstance(s.dt, float) else interval)
            for s, duration in stages
        )
        if times > most:
            total = math.fsum(duration for _, duration in stages)
            what = (
                f"{total:g} s of loading at intervals of {interval:g} s are written {times:.2g} "
                "times"
            )
            yield Refused(("output", key), what, f"stay below {most:g}; times are in seconds")
            return
