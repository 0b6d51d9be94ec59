"""A cell has no walls, no gravity and no way out; what strains or loads it needs a cell."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from multicor_cli.scenario.drives import (
    CellDof,
    SineSignal,
    StressDof,
    TiltedGravityTable,
    keeps_moving,
    levels,
    moves,
)
from multicor_cli.scenario.particles import CompactedPacking, DepositedPacking, TilePacking
from multicor_cli.scenario.problems import KeyPath, Refused, name_list
from multicor_cli.scenario.settings import Domain
from multicor_cli.scenario.stage_drives import resolve_cell
from multicor_cli.scenario.stages import (
    CellStrainEnd,
    Stage,
    SteadyEnd,
    StrainEnd,
    StressEnd,
    Until,
    walls_of,
)
from multicor_cli.scenario.tables import PartialScenario, given


def check(tables: PartialScenario) -> Iterator[Refused]:
    """Findings about a cell, or about what only a cell can do."""
    if tables.domain is None:
        return
    if not tables.is_cell:
        yield from _needs_cell(tables.domain, tables)
        return
    yield from _has_no_gravity(tables.domain, tables)
    yield from _has_no_walls(tables)
    yield from _holds_its_grains(tables.domain, tables)
    if None not in tables.loading:
        may_adhere = None in tables.contacts or any(
            entry.attraction.force > 0.0 for _, entry in given(tables.contacts)
        )
        stages = [stage for _, stage in given(tables.loading)]
        for k, (stage, cell) in enumerate(zip(stages, resolve_cell(stages), strict=True)):
            yield from _strains(("loading", k), stage, cell)
            if not may_adhere:
                yield from _pulls_apart(("loading", k), stage)


def _end_of(until: Until | None) -> tuple[str, Any]:
    """The key of a condition, and its table."""
    return ("", None) if until is None else next(iter(until))


def _needs_cell(domain: Domain, tables: PartialScenario) -> Iterator[Refused]:
    remedy = 'use periodic = ["x", "y"] in [domain] without walls, or remove it'
    what = "{} has no meaning in a domain that is not periodic in both directions"
    for key in ("cell_inertia", "cell_rates"):
        if getattr(domain, key) is not None:
            yield Refused(("domain", key), what.format(key), remedy)
    if tables.heat is not None and tables.heat.gradient is not None:
        told = f"{remedy}; between walls their temperatures make the gradient"
        yield Refused(("heat", "gradient"), what.format("a mean gradient"), told)
    for k, stage in given(tables.loading):
        if stage.cell is not None:
            yield Refused(("loading", k, "cell"), what.format("cell"), remedy)
        key, end = _end_of(stage.until)
        if hasattr(end, "cell"):
            told = 'name walls, or use periodic = ["x", "y"] in [domain]'
            yield Refused(("loading", k, "until", key, "cell"), what.format("cell"), told)


def _has_no_gravity(domain: Domain, tables: PartialScenario) -> Iterator[Refused]:
    if any(domain.gravity):
        what = f"{list(domain.gravity)} m/s²: nothing bears the weight of the grains in a cell"
        yield Refused(("domain", "gravity"), what, "give gravity = [0.0, 0.0]")
    for k, stage in given(tables.loading):
        gravity = stage.gravity
        if gravity is None:
            continue
        if isinstance(gravity, TiltedGravityTable) or any(any(levels(each)) for each in gravity):
            what = "nothing bears the weight of the grains in a cell"
            yield Refused(("loading", k, "gravity"), what, "remove gravity")


def _has_no_walls(tables: PartialScenario) -> Iterator[Refused]:
    names = [name for name in tables.wall_names if name]
    if tables.wall_names:
        what = "a domain that is periodic in both directions has no walls"
        if names:
            what += f", but here are {name_list(names)}"
        remedy = "remove [[walls]], or use periodic = true, which repeats it in x alone"
        yield Refused(("walls",), what, remedy)
    for k, stage in given(tables.loading):
        for key, remedy in (
            ("drives", "use cell = { xx = ..., yy = ..., xy = ... }, or remove it"),
            ("thermal", "remove it: the grains of a cell have no wall to exchange heat with"),
        ):
            if named := getattr(stage, key):
                what = f"names {name_list(named)}, but a cell has no walls"
                yield Refused(("loading", k, key), what, remedy)
        if walls := walls_of(stage.until):
            key, end = _end_of(stage.until)
            remedy = "use until = { strain, stress or steady } with cell"
            if isinstance(end, StrainEnd | StressEnd | SteadyEnd):
                component = "yy" if isinstance(end, StressEnd) else "xy"
                remedy = f'name a component of the cell, as cell = "{component}"'
            what = f"names {name_list(dict.fromkeys(walls.values()))}, but a cell has no walls"
            yield Refused(("loading", k, "until", key), what, remedy)


def _holds_its_grains(domain: Domain, tables: PartialScenario) -> Iterator[Refused]:
    if domain.lost != "ignore":
        what = f'"{domain.lost}" has no effect in a cell, which no grain can leave'
        yield Refused(("domain", "lost"), what, "remove it")
    if domain.cell_rates is not None and tables.has_start:
        what = "the cell goes on with the rates that it has in the run of [start]"
        yield Refused(("domain", "cell_rates"), what, "remove it, or [start]")
    if tables.outlets:
        what = "grains neither come nor go in a cell"
        yield Refused(("outlets",), what, "remove [[outlets]]")
    for k, group in given(tables.particles):
        if group.release is not None:
            what = "grains neither come nor go in a cell"
            remedy = 'place them at the start, as packing = { kind = "random" }'
            yield Refused(("particles", k, "release"), what, remedy)
        packing: Any = group.packing
        path: KeyPath = ("particles", k, "packing")
        if isinstance(packing, TilePacking):
            packing, path = packing.source, (*path, "source")
        if isinstance(packing, CompactedPacking | DepositedPacking):
            what = f'kind = "{packing.kind}" needs a floor, which a cell has not'
            remedy = 'use kind = "random", and compress the cell: cell = { xx = { stress = ... } }'
            yield Refused(path, what, remedy)


def _strains(
    path: KeyPath, stage: Stage, cell: dict[str, tuple[CellDof, int]]
) -> Iterator[Refused]:
    """What a stage waits for may come: a component that does not move is not strained."""
    _, end = _end_of(stage.until)
    if not isinstance(end, CellStrainEnd):
        return
    path, name, dof = (*path, "until", "strain"), end.cell, cell[end.cell][0]
    if not moves(dof):
        remedy = f"strain it, as cell = {{ {name} = {{ rate = 1.0 }} }}"
        yield Refused(path, f"the rate of {name} is 0 in this stage", remedy)
    elif stage.duration is None and not keeps_moving(dof):
        what = f"the rate of {name} comes to 0, so that the stage may never end"
        yield Refused(path, what, "give duration [s] too, as its upper bound")


def _pulls_apart(path: KeyPath, stage: Stage) -> Iterator[Refused]:
    """A tension on grains that do not adhere only ever parts them."""
    for name in ("xx", "yy"):
        dof = None if stage.cell is None else getattr(stage.cell, name)
        if isinstance(dof, StressDof) and (highest := _highest(dof.stress)) < 0.0:
            what = (
                f"{highest:g} N/m pulls the cell apart, and no grains adhere: stresses of xx and "
                "yy are positive in compression"
            )
            remedy = f"use {name} = {{ stress = {-highest:g} }}, or a rate"
            yield Refused((*path, "cell", name, "stress"), what, remedy)


def _highest(signal: Any) -> float:
    if isinstance(signal, SineSignal):
        return signal.sine.mean + abs(signal.sine.amplitude)
    return max(levels(signal))
