"""Loading stages name walls that exist and can do what is asked of them."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.checks.grains import double_names
from multicor_cli.scenario.drives import DOF_NAMES, WallDofs, resolve_dofs
from multicor_cli.scenario.loading import AnyDof, ForceDof, Stage, UntilStrain, VelocityDof
from multicor_cli.scenario.problems import Finding, KeyPath, name_list, show
from multicor_cli.scenario.signals import AnySignal, RampSignal, SineSignal, TableSignal
from multicor_cli.scenario.translate import did_you_mean
from multicor_cli.scenario.walls import Wall


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about the loading stages."""
    yield from double_names([stage.name if stage else None for stage in draft.loading], "loading")
    if len(set(draft.wall_names) - {None}) < len(draft.wall_names):
        return  # a name is missing or double, and may be the one that is meant below
    unknown = [finding for k, stage in _stages(draft) for finding in _unknown_walls(("loading", k), stage, draft)]
    yield from unknown
    if not unknown:
        for index, wall in enumerate(draft.walls):
            if wall is not None:
                yield from _check_inertia(("walls", index), wall, draft)
                yield from _check_turning(wall, draft)
        yield from _check_strains(draft)


def _stages(draft: Draft) -> Iterator[tuple[int, Stage]]:
    return ((k, stage) for k, stage in enumerate(draft.loading) if stage)


def _unknown_walls(path: KeyPath, stage: Stage, draft: Draft) -> Iterator[Finding]:
    known = [name for name in draft.wall_names if name]
    used: list[tuple[KeyPath, str]] = [((*path, "drives", name), name) for name in stage.drives]
    used += [((*path, "thermal", name), name) for name in stage.thermal]
    if isinstance(stage.until, UntilStrain):
        used += [((*path, "until", "strain", "walls", k), name) for k, name in enumerate(stage.until.strain.walls)]
    for place, name in used:
        if name not in known:
            remedy = did_you_mean(name, known) or f"the walls are {name_list(known) or 'none'}"
            yield Finding(place, f"there is no wall {show(name)}", remedy)


def _check_turning(wall: Wall, draft: Draft) -> Iterator[Finding]:
    """A wall that reaches from one period to the next has no center to turn about."""
    if draft.domain is None or not draft.domain.periodic or not wall.geometry.spans_period:
        return
    for k, stage in _stages(draft):
        drives = stage.drives.get(wall.name)
        if drives is not None and drives.spin is not None and _moves(drives.spin):
            what = f"the wall '{wall.name}' of a periodic domain cannot turn: it has no center"
            yield Finding(("loading", k, "drives", wall.name, "spin"), what, "remove spin, or use periodic = false")


def _check_inertia(path: KeyPath, wall: Wall, draft: Draft) -> Iterator[Finding]:
    """A wall that forces drive has a mass; gravity acts only on such walls."""
    driven: dict[str, int] = {}
    has_glued_grains = wall.geometry.glued() is not None
    for k, stage in _stages(draft):
        drives = stage.drives.get(wall.name)
        for dof in DOF_NAMES:
            if drives is not None and isinstance(getattr(drives, dof), ForceDof):
                driven.setdefault(dof, k)
    moved = [dof for dof in ("x", "y") if dof in driven]
    if moved and wall.mass is None and not has_glued_grains:
        what = f"the wall '{wall.name}' has no mass, but a force drives its {moved[0]} in loading.{driven[moved[0]]}"
        yield Finding((*path, "mass"), what, "add mass [kg]")
    if "spin" in driven and wall.inertia is None and not has_glued_grains:
        what = f"the wall '{wall.name}' has no moment of inertia, but a torque drives its spin in loading.{driven['spin']}"
        yield Finding((*path, "inertia"), what, "add inertia [kg m²]")
    if wall.gravity and not moved and None not in draft.loading:
        what = f"no force drives the wall '{wall.name}' in any stage, so that gravity cannot act on it"
        yield Finding((*path, "gravity"), what, "remove gravity = true, or drive x or y by a force (which may be 0)")


def _check_strains(draft: Draft) -> Iterator[Finding]:
    """A stage that ends at a strain has two walls that can reach it."""
    stages = [stage for stage in draft.loading if stage]
    walls = [wall for wall in draft.walls if wall]
    if len(stages) < len(draft.loading) or len(walls) < len(draft.walls):
        return
    by_name = {wall.name: wall for wall in walls}
    names = list(by_name)
    for k, (stage, dofs) in enumerate(zip(stages, resolve_dofs(stages, names), strict=True)):
        if isinstance(stage.until, UntilStrain) and all(name in by_name for name in stage.until.strain.walls):
            moved = dict(zip(names, dofs, strict=True))
            yield from _check_strain(("loading", k, "until", "strain"), stage, stage.until, by_name, moved)


def _check_strain(
    path: KeyPath, stage: Stage, until: UntilStrain, walls: dict[str, Wall], dofs: dict[str, WallDofs]
) -> Iterator[Finding]:
    lower, upper = until.strain.walls
    if lower == upper:
        yield Finding((*path, "walls"), f"'{lower}' is named twice", "name two different walls")
        return
    heights = [walls[name].geometry.height for name in (lower, upper)]
    if heights[0] is not None and heights[0] == heights[1]:
        what = f"'{lower}' and '{upper}' both lie at y = {heights[0]:g}: there is no strain between them"
        yield Finding((*path, "walls"), what, "name two walls at different heights")
    drives = [dofs[name][0].dof for name in (lower, upper)]
    if not any(_moves(drive) for drive in drives) or (drives[0] == drives[1] and isinstance(drives[0], VelocityDof)):
        what = f"neither '{lower}' nor '{upper}' moves in x relative to the other in this stage"
        yield Finding(path, what, f"drive one of them, as drives.{upper}.x = {{ velocity = 0.1 }}")
    elif stage.duration is None and not any(_keeps_moving(drive) for drive in drives):
        what = f"'{lower}' and '{upper}' come to a stop, so that the stage may never end"
        yield Finding(path, what, "give duration [s] too, as its upper bound")


def _moves(dof: AnyDof) -> bool:
    if isinstance(dof, VelocityDof):
        return any(value != 0.0 for value in _levels(dof.velocity))
    return isinstance(dof, ForceDof)


def _levels(signal: AnySignal) -> tuple[float, ...]:
    """Values that tell whether a signal is always zero."""
    if isinstance(signal, RampSignal):
        return signal.ramp
    if isinstance(signal, SineSignal):
        return signal.sine.mean, signal.sine.amplitude
    if isinstance(signal, TableSignal):
        return signal.values
    return (signal,)


def _keeps_moving(dof: AnyDof) -> bool:
    if isinstance(dof, VelocityDof):
        levels = _levels(dof.velocity)
        return any(levels) if isinstance(dof.velocity, SineSignal) else levels[-1] != 0.0
    return isinstance(dof, ForceDof)
