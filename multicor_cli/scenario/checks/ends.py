"""Stages that wait for something of walls wait for what can come."""

from __future__ import annotations

from collections.abc import Iterator

from multicor_cli.scenario.checks.draft import Draft
from multicor_cli.scenario.dofs import is_prescribed, keeps_moving, moves
from multicor_cli.scenario.drives import DOF_NAMES, WallDofs, resolve_dofs
from multicor_cli.scenario.loading import Stage
from multicor_cli.scenario.problems import Finding, KeyPath
from multicor_cli.scenario.until import UntilAxialStrain, UntilDisplacement, UntilStrain, walls_of
from multicor_cli.scenario.walls import Wall


def check(draft: Draft) -> Iterator[Finding]:
    """Findings about the conditions that end stages."""
    stages = [stage for stage in draft.loading if stage]
    walls = [wall for wall in draft.walls if wall]
    if len(stages) < len(draft.loading) or len(walls) < len(draft.walls):
        return
    by_name = {wall.name: wall for wall in walls}
    names = list(by_name)
    if len(names) < len(walls):
        return  # a name is double
    for k, (stage, dofs) in enumerate(zip(stages, resolve_dofs(stages, names), strict=True)):
        if set(walls_of(stage.until).values()) <= by_name.keys():
            yield from _check_stage(("loading", k, "until"), stage, by_name, dict(zip(names, dofs, strict=True)))


def _check_stage(path: KeyPath, stage: Stage, walls: dict[str, Wall], dofs: dict[str, WallDofs]) -> Iterator[Finding]:
    until = stage.until
    if isinstance(until, UntilStrain):
        yield from _check_pair((*path, "strain"), until.strain.walls, "x", "y", walls, dofs)
        drives = [dofs[name][0].dof for name in until.strain.walls]
        if stage.duration is None and any(map(moves, drives)) and not any(map(keeps_moving, drives)):
            lower, upper = until.strain.walls
            what = f"'{lower}' and '{upper}' come to a stop, so that the stage may never end"
            yield Finding((*path, "strain"), what, "give duration [s] too, as its upper bound")
    elif isinstance(until, UntilAxialStrain):
        axis = until.axial_strain.axis
        yield from _check_pair((*path, "axial_strain"), until.axial_strain.walls, axis, axis, walls, dofs)
    elif isinstance(until, UntilDisplacement):
        end = until.displacement
        if not moves(dofs[end.wall][DOF_NAMES.index(end.axis)].dof):
            doing = "turn" if end.axis == "spin" else f"move in {end.axis}"
            remedy = f"drive it, as drives.{end.wall}.{end.axis} = {{ velocity = 0.1 }}"
            yield Finding((*path, "displacement"), f"'{end.wall}' does not {doing} in this stage", remedy)


def _check_pair(
    path: KeyPath, pair: tuple[str, str], moved: str, apart: str, walls: dict[str, Wall], dofs: dict[str, WallDofs]
) -> Iterator[Finding]:
    """Two walls that move relative to each other along one axis and lie apart along another."""
    lower, upper = pair
    if lower == upper:
        yield Finding((*path, "walls"), f"'{lower}' is named twice", "name two different walls")
        return
    heights = [walls[name].geometry.height for name in pair]
    if apart == "y" and heights[0] is not None and heights[0] == heights[1]:
        what = f"'{lower}' and '{upper}' both lie at y = {heights[0]:g}: there is no strain between them"
        yield Finding((*path, "walls"), what, "name two walls at different heights")
    drives = [dofs[name][DOF_NAMES.index(moved)].dof for name in pair]
    if not any(map(moves, drives)) or (drives[0] == drives[1] and is_prescribed(drives[0])):
        what = f"neither '{lower}' nor '{upper}' moves in {moved} relative to the other in this stage"
        yield Finding(path, what, f"drive one of them, as drives.{upper}.{moved} = {{ velocity = 0.1 }}")
