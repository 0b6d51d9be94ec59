"""Loading stages name walls that exist and can do what is asked of them."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.bodies import prism_height
from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.checks.grains import double_names
from multicor_cli.scenario.dofs import LoadDof, moves
from multicor_cli.scenario.drives import DOF_NAMES
from multicor_cli.scenario.gravity import TiltedGravityTable
from multicor_cli.scenario.loading import Stage
from multicor_cli.scenario.problems import Finding, KeyPath, name_list, show
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.scenario.until import walls_of
from multicor_cli.scenario.walls import Wall

_LEVEL = 1e-9  # distance over the size of the domain that counts as none


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about the loading stages."""
    yield from double_names([stage.name if stage else None for stage in draft.loading], "loading")
    yield from _nothing_to_tilt(draft)
    if len(set(draft.wall_names) - {None}) < len(draft.wall_names):
        return  # a name is missing or double, and may be the one that is meant below
    unknown = [finding for k, stage in _stages(draft) for finding in _unknown_walls(("loading", k), stage, draft)]
    yield from unknown
    if not unknown:
        for index, wall in enumerate(draft.walls):
            if wall is not None:
                yield from _check_inertia(("walls", index), wall, draft)
                yield from _check_turning(wall, draft)
                yield from _check_lengths(wall, draft)


def _stages(draft: Draft) -> Iterator[tuple[int, Stage]]:
    return ((k, stage) for k, stage in enumerate(draft.loading) if stage)


def _unknown_walls(path: KeyPath, stage: Stage, draft: Draft) -> Iterator[Finding]:
    known = [name for name in draft.wall_names if name]
    used: list[tuple[KeyPath, str]] = [((*path, "drives", name), name) for name in stage.drives]
    used += [((*path, "thermal", name), name) for name in stage.thermal]
    used += [((*path, "until", *keys), name) for keys, name in walls_of(stage.until).items()]
    for wall, dof, table in _loads(stage):
        used += [((*path, "drives", wall, dof, "between", e), name) for e, name in enumerate(table.between or ())]
    for place, name in used:
        if name not in known:
            remedy = did_you_mean(name, known) or f"the walls are {name_list(known) or 'none'}"
            yield Finding(place, f"there is no wall {show(name)}", remedy)


def _loads(stage: Stage) -> Iterator[tuple[str, str, LoadDof]]:
    """Walls and degrees of freedom that loads drive, with what they say."""
    for name, drives in stage.drives.items():
        for dof in DOF_NAMES:
            table = getattr(drives, dof)
            if isinstance(table, LoadDof):
                yield name, dof, table


def _check_lengths(wall: Wall, draft: Draft) -> Iterator[Finding]:
    """A stress acts between two other walls that lie apart across its axis."""
    if draft.domain is None:
        return
    origins = {other.name: other.geometry.body(draft.domain).origin for other in draft.walls if other}
    for k, stage in _stages(draft):
        for name, dof, load in _loads(stage):
            if name != wall.name or load.between is None or not set(load.between) <= origins.keys():
                continue
            path, across = ("loading", k, "drives", name, dof, "between"), "y" if dof == "x" else "x"
            first, second = (float(origins[other]["xy".index(across)]) for other in load.between)
            if name in load.between:
                yield Finding(
                    path, f"the stress on '{name}' cannot act between '{name}' and another wall", "name its two neighbors"
                )
            elif abs(first - second) <= _LEVEL * max(draft.domain.size):
                what = f"there is no length between '{load.between[0]}' and '{load.between[1]}': both lie at {across} = {first:g}"
                yield Finding(path, what, f"name two walls apart in {across}, or remove it: the length is then that of '{name}'")


def _nothing_to_tilt(draft: Draft) -> Iterator[Finding]:
    """Gravity of the magnitude of the domain's, where there is none."""
    for k, stage in _stages(draft):
        gravity = stage.gravity
        if isinstance(gravity, TiltedGravityTable) and gravity.magnitude is None and draft.domain and not any(draft.domain.gravity):
            what = "[domain] has gravity = [0, 0], which no angle turns"
            yield Finding(("loading", k, "gravity"), what, "add magnitude [m/s²], as magnitude = 9.81")


def _check_turning(wall: Wall, draft: Draft) -> Iterator[Finding]:
    """A wall that reaches from one period to the next has no center to turn about."""
    geometry = wall.geometry
    if draft.domain is None or any(geometry.misfits(draft.domain)) or not geometry.spans_period(draft.domain):
        return
    for k, stage in _stages(draft):
        drives = stage.drives.get(wall.name)
        if drives is not None and drives.spin is not None and moves(drives.spin):
            what = f"the wall '{wall.name}' cannot turn: it reaches from one period to the next"
            remedy = "remove spin, make it narrower than the period in all directions, or use periodic = false"
            yield Finding(("loading", k, "drives", wall.name, "spin"), what, remedy)


def _check_inertia(path: KeyPath, wall: Wall, draft: Draft) -> Iterator[Finding]:
    """A wall that forces drive has a mass; gravity acts only on such walls."""
    driven: dict[str, int] = {}
    weighs = _weighs(wall, draft)
    for k, stage in _stages(draft):
        drives = stage.drives.get(wall.name)
        for dof in DOF_NAMES:
            if drives is not None and isinstance(getattr(drives, dof), LoadDof):
                driven.setdefault(dof, k)
    moved = [dof for dof in ("x", "y") if dof in driven]
    if moved and wall.mass is None and not weighs:
        what = f"the wall '{wall.name}' has no mass, but a force drives its {moved[0]} in loading.{driven[moved[0]]}"
        yield Finding((*path, "mass"), what, "add mass [kg]")
    if "spin" in driven and wall.inertia is None and not weighs:
        what = f"the wall '{wall.name}' has no moment of inertia, but a torque drives its spin in loading.{driven['spin']}"
        yield Finding((*path, "inertia"), what, "add inertia [kg m²]")
    if wall.gravity and not moved and None not in draft.loading:
        what = f"no force drives the wall '{wall.name}' in any stage, so that gravity cannot act on it"
        yield Finding((*path, "gravity"), what, "remove gravity = true, or drive x or y by a force (which may be 0)")


def _weighs(wall: Wall, draft: Draft) -> bool:
    """Whether mass and inertia of a wall follow from its geometry and material."""
    if wall.geometry.substance == "prism":
        first = draft.particles[0] if draft.particles else None
        return first is None or prism_height(first) is not None
    return wall.geometry.substance is not None
