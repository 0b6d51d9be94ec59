"""Refusing initial overlaps, and grains in solid matter or behind a row of glued grains."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.neighbors import classify, find_near, make_grids
from multicor_cli.engine.geometry.outlines import touch, true_gap
from multicor_cli.engine.geometry.pieces import Pieces, pieces_of, turned
from multicor_cli.engine.geometry.scene import Scene, from_first_end, gap_to_shape
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.engine.jit.threads import threads_for
from multicor_cli.model import Model
from multicor_cli.model.columns import RADIUS, TAIL_X, XX, XY, YY, X, Y
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.shapes import Room, ShapeKind
from multicor_cli.packing.initial_grains import NAMED
from multicor_cli.packing.walls import Front, Obstacles
from multicor_cli.scenario.particles import FilePacking, OutlinesPacking, ParticleGroup
from multicor_cli.scenario.problems import Refused
from multicor_cli.scenario.shapes import FileShape

# ---- How messages tell of grains: by what the packing of their group is made of

_APART = {
    "file": "move them apart in their file",
    "outlines": "move them apart in the file of their outlines",
    **dict.fromkeys(("run", "start"), "take another frame of the run that they are from"),
}
_AWAY = {
    "file": "move the grains by shift in their packing",
    "outlines": "move the grains by shift, or draw them smaller by scale, in their packing",
    **dict.fromkeys(("run", "start"), "take another frame of the run that the grains are from"),
}


@dataclass(frozen=True)
class Groups:
    """The groups of a scenario, and the number of that of each grain, ascending."""

    tables: Sequence[ParticleGroup]
    of_grain: Ints

    def name(self, grain: int) -> tuple[str, str]:
        """Number of a grain, in the file that places it if there is one, and of what it is."""
        k = self.of_grain[grain]
        table, number = self.tables[k], int(grain - np.searchsorted(self.of_grain, k))
        of = f" of '{table.name}'"
        if isinstance(table.packing, OutlinesPacking) and isinstance(table.shape, FileShape):
            return f"{list(dict.fromkeys(table.shape.grain))[number]:g}", of
        return (str(number + 1), of) if isinstance(table.packing, FilePacking) else (str(grain), "")

    def pair(self, one: int, other: int) -> str:
        """Names of two grains."""
        (first, of), (second, and_of) = self.name(one), self.name(other)
        return f"grains {first}{of if of != and_of else ''} and {second}{and_of}"

    def apart(self, one: int, other: int) -> str:
        """What parts two grains, as their later group is told."""
        k = max(self.of_grain[one], self.of_grain[other])
        if self.of_grain[one] != self.of_grain[other] and self._kind(k) in ("file", "outlines"):
            return "move the group by shift in its packing"
        default = "move them apart: a larger spacing or region, or fewer grains"
        return _APART.get(self._kind(k), default)

    def away(self, grain: int) -> str:
        """What takes a grain away from a wall."""
        default = "give the grains a region that keeps clear of it"
        return _AWAY.get(self._kind(self.of_grain[grain]), default)

    def _kind(self, k: int) -> str:
        packing = self.tables[k].packing
        return "" if packing is None else packing.kind


# ---- Pairs that are close at the start, of grains and obstacles: the engine's neighbor list


class DiscPairs(NamedTuple):
    """Partners of each grain, ascending: ``partner[row[i]:row[i+1]]``.

    Below n they are grains with a higher number, else n + obstacle; ``row`` has shape ``(n + 1,)``.
    """

    row: NDArray[np.int64]
    partner: Ints


def find_pairs(
    position: Floats, radius: Floats, obstacles: Obstacles, cutoff: float, period: float
) -> DiscPairs:
    """All pairs with a gap below ``cutoff`` [m]; below 0: pairs that overlap by more.

    Centers [m] have shape ``(n, 2)``; x is wrapped by the period [m], unless it is 0.
    """
    discs, count = obstacles.discs(), radius.size
    center = np.concatenate([position[:, :2], discs[:, :2]])
    if period > 0.0:
        center[:, X] = wrap(center[:, X], period)
    radii = np.concatenate([radius, discs[:, RADIUS]])
    grids = make_grids(classify(radii), center.min(axis=0), center.max(axis=0), period, cutoff)
    shape_of = (count + np.flatnonzero(obstacles.is_disc)).astype(np.int32)
    others = np.flatnonzero(~obstacles.is_disc).astype(np.int32)
    kind, world = obstacles.kind, obstacles.world
    with threads_for(count):
        return DiscPairs(
            *find_near(grids, count, center, radii, shape_of, others, kind, world, cutoff, period)
        )


def wrap(x: Floats, period: float) -> Floats:
    """Bring x into [0, period)."""
    inside = x - period * np.floor(x / period)
    # A tiny negative x gives exactly the period.
    return np.where(inside >= period, 0.0, inside)


# ---- What is refused

LARGEST_OVERLAP = 1e-3
"""Largest overlap that is accepted, over the smaller radius."""

CROWD = 32
"""A cell with more grains than this certainly contains overlaps.

Cells are one largest diameter wide, and radii of a class differ by a factor of two at most: about
10 such grains fit.
"""

_FAR = 2.0**62
"""Cells this far out count as one: for radii above 1e-13 m no coordinate is so far out."""
_DISC, _SEGMENT, _SIDE = int(ShapeKind.DISC), int(ShapeKind.SEGMENT), int(ShapeKind.SIDE)


@kernel
def _relative_gaps(
    position: Floats,
    radius: Floats,
    i: Ints,
    j: Ints,
    kind: Ints,
    world: Floats,
    period: float,
    out: Floats,
) -> None:
    """Gap of each pair over its smaller radius into ``out``; from n on ``j`` is a wall shape."""
    count = radius.size
    for p in range(i.size):
        a, b = i[p], j[p]
        x, y, r = position[a, X], position[a, Y], radius[a]
        if b >= count:
            small = min(r, world[b - count, RADIUS]) if kind[b - count] == _DISC else r
            out[p] = gap_to_shape(x, y, r, b - count, kind, world, period)[0] / small
            continue
        dx, dy = x - position[b, X], y - position[b, Y]
        if period > 0.0:
            dx -= period * np.floor(dx / period + 0.5)
        out[p] = (np.sqrt(dx * dx + dy * dy) - r - radius[b]) / min(r, radius[b])


def thin_crowds(position: Floats, radius: Floats, most: float = CROWD) -> NDArray[np.int64]:
    """Grains but those beyond the first ``most`` in a cell: coincident ones have n² pairs."""
    level, largest = classify(radius)
    width = 2.0 * largest[level]
    cell = np.clip(np.floor(position[:, :2] / width[:, None]), -_FAR, _FAR).astype(np.int64)
    order = np.lexsort((cell[:, Y], cell[:, X], level))
    is_new = np.ones(radius.size, bool)
    is_new[1:] = (np.diff(cell[order], axis=0) != 0).any(axis=1) | (np.diff(level[order]) != 0)
    first = np.flatnonzero(is_new)
    rank = np.arange(radius.size) - first[np.cumsum(is_new) - 1]
    return np.sort(order[rank < most])


def overlap_problems(
    position: Floats,
    model: Model,
    shapes: Obstacles,
    here: NDArray[np.int64],
    groups: Groups,
    cell: Floats | None = None,
) -> list[Refused]:
    """One problem for all grains that overlap each other and one for each wall that cuts grains.

    ``shapes`` are those of the model, in the world; only the grains ``here``, ascending, count.
    ``cell`` are width, height and tilt of a cell [m].
    """
    radius, group, wall = model.grains.radius, model.grains.group, model.shapes.wall
    outlines, most = model.outlines, float(CROWD)
    if outlines is not None:  # more of them may lie side by side
        most *= float((math.pi * (radius * radius) / outlines.area).max())
    kept = here[thin_crowds(position[here], radius[here], most)].astype(np.int32)
    solid, period, low = shapes, model.period, np.zeros(0, np.int64)
    if cell is not None:  # without walls, but with images of the lowest grains above
        period, low = float(cell[XX]), np.flatnonzero(position[kept, Y] < 2.0 * radius[kept].max())
        above = position[kept[low], :2] + np.array([cell[XY], cell[YY]])
        solid = Obstacles.none().with_discs(np.column_stack([above, radius[kept[low]]]))
    least = -0.999 * LARGEST_OVERLAP * float(radius[kept].min())
    pairs = find_pairs(position[kept], radius[kept], solid, least, period)
    i = np.repeat(np.arange(kept.size, dtype=np.int32), np.diff(pairs.row))
    j, gap = pairs.partner, np.empty(i.size)
    if outlines is None:
        _relative_gaps(position[kept], radius[kept], i, j, solid.kind, solid.world, period, gap)
    if low.size:
        j = np.concatenate([np.arange(kept.size), low])[j].astype(np.int32)
    if outlines is not None:  # of pairs whose circles overlap
        gap = _gaps_of_outlines(model, position, shapes, cell, kept, i, j)
    order = np.flatnonzero(gap < -LARGEST_OVERLAP)
    order = order[np.lexsort((j[order], i[order], gap[order]))]
    i, j, overlap = i[order], j[order], -gap[order]
    among, problems = j < kept.size, []
    if among.any():
        a, b = kept[i[among]], kept[j[among]]
        smaller = np.minimum(radius[a], radius[b])
        amounts = _amounts(overlap[among], smaller)
        items = [f"{groups.pair(*pair)} by {by}" for *pair, by in zip(a, b, amounts, strict=False)]
        what = "pairs" if kept.size == here.size else "pairs at least"
        text = f"grains overlap at the start: {_listing(items, a.size, what)}"
        remedy = groups.apart(a[0], b[0])
        key = ("particles", int(max(group[a[0]], group[b[0]])))
        problems.append(Refused(key, text, remedy))
    grain, shape, overlap = kept[i[~among]], j[~among] - kept.size, overlap[~among]
    met = model.is_met(grain, shape)
    grain, shape, overlap = grain[met], shape[met], overlap[met]
    for w in np.unique(wall[shape]):
        mine = np.flatnonzero(wall[shape] == w)
        _, first = np.unique(grain[mine], return_index=True)
        mine = mine[np.sort(first)]
        amounts = _amounts(overlap[mine], radius[grain[mine]])
        cuts = zip(grain[mine], amounts, strict=False)
        items = [f"grain {''.join(groups.name(g))} by {by}" for g, by in cuts]
        cut = _listing(items, mine.size, "grains")
        text = f"the wall '{model.walls.names[w]}' cuts grains at the start: {cut}"
        remedy = f"move the wall, or {groups.away(grain[mine[0]])}"
        problems.append(Refused(("walls", int(w)), text, remedy))
    return problems


def _gaps_of_outlines(
    model: Model, position: Floats, shapes: Obstacles, cell: Floats | None, kept: Ints, i: Ints,
    j: Ints,
) -> Floats:  # fmt: skip
    """Gap of each pair by its outlines over the smaller radius.

    Pairs are numbered among the grains ``kept``, then come wall shapes.
    """
    n, is_wall = model.grain_count, j >= kept.size
    periods = (model.period, 0.0, 0.0) if cell is None else cell.tolist()
    scene = Scene(
        position, model.grains.radius, model.material, shapes.kind, model.shapes.wall, shapes.world,
        np.zeros((model.wall_count, 3)), periods[0], height=periods[1], tilt=periods[2],
    )  # fmt: skip
    local = pieces_of(model)
    assert local is not None  # only then it is asked for
    radius = np.concatenate([
        model.grains.radius, np.where(shapes.is_disc, shapes.world[:, RADIUS], math.inf)
    ])  # fmt: skip
    first, second = kept[i], np.where(is_wall, j + n - kept.size, kept[np.where(is_wall, 0, j)])
    gap = np.empty(i.size)
    _true_gaps(scene, turned(local, scene), first, second.astype(np.int32), gap)
    return np.asarray(gap / np.minimum(radius[first], radius[second]))


@kernel
def _true_gaps(scene: Scene, pieces: Pieces, i: Ints, j: Ints, out: Floats) -> None:
    for p in range(i.size):
        shape = j[p] - scene.radius.size
        if shape >= 0 and (scene.kind[shape] == _SEGMENT or scene.kind[shape] == _SIDE):
            out[p] = _gap_to_line(scene, pieces, i[p], shape)
        else:
            out[p] = true_gap(scene, pieces, i[p], j[p])[0]


@subroutine
def _gap_to_line(scene: Scene, pieces: Pieces, i: int, shape: int) -> float:
    """Gap of a grain and a line with its ends [m], however deep one is in the other."""
    x, y, line = scene.position[i, X], scene.position[i, Y], scene.world[shape]
    dx = line[X] + from_first_end(x, line[X], line[TAIL_X], scene.period)
    least, b = math.inf, pieces.piece[scene.radius.size + shape]
    for a in range(pieces.piece[i], pieces.piece[i + 1]):
        least = min(least, touch(pieces, a, b, dx, y)[0].gap)
    return least


def behind_problem(
    position: Floats, here: NDArray[np.int64], front: Front, name: str, w: int, period: float,
    groups: Groups,
) -> Refused | None:  # fmt: skip
    """The problem of grains behind a row of glued grains, where no flow is; None without any."""
    offset = position[here, :2] - front.start
    if period > 0.0 and math.isfinite(front.depth):
        middle = 0.5 * front.length * front.along[0]
        offset[:, X] -= period * np.floor((offset[:, X] - middle) / period + 0.5)
    across, along = (
        offset[:, X] * direction[X] + offset[:, Y] * direction[Y]
        for direction in (front.normal, front.along)
    )
    is_behind = (across < 0.0) & (across > -front.depth)
    if math.isfinite(front.depth):
        is_behind &= (along > front.depth) & (along < front.length - front.depth)
    found = np.flatnonzero(is_behind)
    if not found.size:
        return None
    found = found[np.lexsort((found, across[found]))]
    items = [f"grain {''.join(groups.name(here[g]))} by {-across[g]:.3g} m" for g in found[:NAMED]]
    text = f"grains lie behind the rough wall '{name}', whose flow side is the other: "
    remedy = f"choose the other side of the wall, or {groups.away(here[found[0]])}"
    return Refused(("walls", w), text + _listing(items, found.size, "grains"), remedy)


def solid_problem(
    position: Floats, here: NDArray[np.int64], room: Room, name: str, w: int, groups: Groups
) -> Refused | None:
    """The problem of grains with centers in solid matter, off its outline too; None without any."""
    found = here[room.clearance(position[here, :2]) < 0.0] if not room.is_open else here[:0]
    if not found.size:
        return None
    items = [
        f"grain {''.join(groups.name(g))} at ({position[g, X]:g}, {position[g, Y]:g}) m"
        for g in found[:NAMED]
    ]
    text = f"grains lie in the solid matter of the wall '{name}': "
    remedy = f"move the wall, or {groups.away(found[0])}"
    return Refused(("walls", w), text + _listing(items, found.size, "grains"), remedy)


def _amounts(relative: Floats, smaller: Floats) -> list[str]:
    """The first overlaps, over the smaller radii [m]."""
    return [
        f"{share * radius:.3g} m ({100.0 * share:.3g} % of the smaller radius)"
        for share, radius in zip(relative[:NAMED], smaller, strict=False)
    ]


def _listing(items: list[str], total: int, what: str) -> str:
    more = f", and {total - len(items)} more {what}" if total > len(items) else ""
    return ", ".join(items) + more
