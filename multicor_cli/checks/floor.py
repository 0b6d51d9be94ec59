"""Whether grains stay where they belong: floors under them, lids that press on them, grains lost.

The plane is covered with cells. A cell is free if the smallest grain fits in it, with its center in
the middle, beside all walls. From a free cell a grain can get into free cells beside and below,
"below" being along the larger component of gravity. From where it so gets to the lower edge of
everything it can fall for ever. Rows are gone through from the lowest to the highest, so this takes
as long as there are cells. Walls stand where they are at the start; grains that heap up above the
rim of a wall are not foreseen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.checks.check import Measured, Prepared, Recorded, Rule, moments_of
from multicor_cli.model import Model
from multicor_cli.model.model import Floats
from multicor_cli.model.shapes import Outline
from multicor_cli.post.rings import spans
from multicor_cli.post.source import placed_walls

# ---- Whether grains can fall out of what holds them

_MOST_CELLS = 1500
_MARGIN = 3
_DIRECTIONS = 36  # in which grains that are no discs are measured

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class _Grid:
    """Cells in rows and columns; ``low`` is the center of the first one [m]."""

    low: Floats
    size: float
    rows: int
    columns: int

    def centers(self, first: NDArray[np.int64], last: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Centers x and y of cells from ``first`` (column, row) to ``last``, which is left out."""
        x = self.low[0] + self.size * np.arange(first[0], last[0])
        y = self.low[1] + self.size * np.arange(first[1], last[1])
        return x[np.newaxis, :], y[:, np.newaxis]

    def block(self, low: Floats, high: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        limits = np.array([self.columns, self.rows])
        first = np.clip(np.floor((low - self.low) / self.size), 0, limits)
        last = np.clip(np.ceil((high - self.low) / self.size) + 1, 0, limits)
        return first.astype(np.int64), last.astype(np.int64)


def escape_share(
    model: Model, position: Floats, wall_position: Floats, gravity: Floats
) -> float | None:
    """The part of the grains that can get out of all walls that they meet along gravity.

    None without gravity. ``position`` has x and y first [m], shape ``(n, ≥ 2)``; poses of walls
    have shape ``(w, 3)``.
    """
    if not np.any(gravity):
        return None
    escaped = 0
    for which, walls in _meeting(model, wall_position):
        center = np.array(position[which, :2], float)
        found = _escape(model.with_grains(which), center, walls, gravity)
        escaped += int(np.count_nonzero(found))
    return escaped / model.grain_count


def _meeting(
    model: Model, wall_position: Floats
) -> Iterator[tuple[NDArray[np.int64], list[Outline]]]:
    """Numbers of grains with the walls that they meet, for all that meet the same."""
    for which, is_met in model.meeting_alike():
        yield which, [outline for _, outline in placed_walls(model, wall_position, is_met)]


def _escape(model: Model, center: Floats, walls: list[Outline], gravity: Floats) -> Flags:
    """Whether grains get out of walls along gravity, as `escape_share`; **modifies** ``center``."""
    axis = _larger(gravity)
    if model.period > 0.0:
        center[:, 0] %= model.period
    grid = _make_grid(model, center, walls)
    free = ~_blocked(model, grid, walls)
    is_down = gravity[axis] < 0.0
    upright = free if axis == 1 else free.T
    upright = upright if is_down else upright[::-1]
    open_ = _reaches_bottom(upright, is_periodic=axis == 1 and model.period > 0.0)
    open_ = open_ if is_down else open_[::-1]
    return _at_grains(grid, free, open_ if axis == 1 else open_.T, center)


def _larger(gravity: Floats) -> int:
    return 1 if abs(gravity[1]) >= abs(gravity[0]) else 0


def _smallest(model: Model) -> float:
    """The smallest radius, of grains that are no discs the least half width [m]."""
    if model.outlines is None:
        return float(model.grains.radius.min())
    turns = np.linspace(0.0, np.pi, _DIRECTIONS, endpoint=False)
    ends = [spans(model, np.full(model.grain_count, turn))[..., 0] for turn in turns]
    return 0.5 * float(min((right - left).min() for left, right in ends))


def _make_grid(model: Model, center: Floats, walls: list[Outline]) -> _Grid:
    radius = _smallest(model)
    ends = [corners for outline in walls for corners in outline.corners()]
    points = np.concatenate([center, *ends])
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(radius, float((high - low).max()) / _MOST_CELLS)
    low, high = low - _MARGIN * (size + 2.0 * radius), high + _MARGIN * (size + 2.0 * radius)
    if model.period > 0.0:
        low[0], high[0] = 0.0, model.period
    columns, rows = (max(1, math.ceil(length / size)) for length in high - low)
    return _Grid(low, size, rows, columns)


def _blocked(model: Model, grid: _Grid, walls: list[Outline]) -> Flags:
    """Cells in which the smallest grain would touch a wall."""
    reach = max(_smallest(model), 0.75 * grid.size)
    found = np.zeros((grid.rows, grid.columns), np.bool_)
    for outline in walls:
        left, right = outline.corners()[:, :, 0]
        for k in range(len(outline.points)):
            images = range(1)
            if model.period > 0.0 and outline.normal is None:  # those that reach into the period
                images = range(
                    math.ceil(-(right[k] + reach) / model.period),
                    math.floor(1.0 + (reach - left[k]) / model.period) + 1,
                )
            for image in images:
                _block_shape(grid, outline, k, np.array([image * model.period, 0.0]), reach, found)
    return found


def _block_shape(
    grid: _Grid, outline: Outline, k: int, shift: Floats, reach: float, found: Flags
) -> None:
    points = outline.points[k] + shift
    if outline.normal is not None:
        x, y = grid.centers(np.zeros(2, np.int64), np.array([grid.columns, grid.rows]))
        n = outline.normal[k]
        found |= (x - points[0, 0]) * n[0] + (y - points[0, 1]) * n[1] < reach
        return
    radius = 0.0 if outline.radius is None else float(outline.radius[k])
    low, high = points.min(axis=0) - radius - reach, points.max(axis=0) + radius + reach
    first, last = grid.block(low, high)
    if (last <= first).any():
        return
    distance = _distance(*grid.centers(first, last), points) - radius
    if radius > 0.0 and not outline.is_grain:
        distance = np.abs(distance)  # the inside of a circle holds grains; glued grains are solid
    found[first[1] : last[1], first[0] : last[0]] |= distance < reach


def _distance(x: Floats, y: Floats, points: Floats) -> Floats:
    """Distance of cells from a point or a straight line between two [m]."""
    dx, dy = x - points[0, 0], y - points[0, 1]
    if len(points) == 1:
        return np.asarray(np.hypot(dx, dy))
    way = points[1] - points[0]
    along = np.clip((dx * way[0] + dy * way[1]) / float(way @ way), 0.0, 1.0)
    return np.asarray(np.hypot(dx - along * way[0], dy - along * way[1]))


def _reaches_bottom(free: Flags, *, is_periodic: bool) -> Flags:
    """Free cells from which the first row can be reached by going down and sideways."""
    found = np.zeros_like(free)
    below = np.ones(free.shape[1], np.bool_)
    for row in range(len(free)):
        below = found[row] = _spread(free[row], below & free[row], is_periodic=is_periodic)
    return found


def _spread(free: Flags, reached: Flags, *, is_periodic: bool) -> Flags:
    """What is reached from cells of a row by going sideways through free ones."""
    run = np.cumsum(~free)
    if is_periodic and free[0] and free[-1]:
        run[run == run[-1]] = run[0]
    hit = np.zeros(int(run.max(initial=0)) + 1, np.bool_)
    hit[run[reached]] = True
    return np.asarray(hit[run] & free)


def _at_grains(grid: _Grid, free: Flags, open_: Flags, center: Floats) -> Flags:
    """Whether grains are in open cells, or beside one if a wall blocks their own."""
    column, row = np.rint((center - grid.low) / grid.size).astype(np.int64).T
    column, row = np.clip(column, 0, grid.columns - 1), np.clip(row, 0, grid.rows - 1)
    found = open_[row, column]
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        beside = np.clip(row + dy, 0, grid.rows - 1), np.clip(column + dx, 0, grid.columns - 1)
        found |= ~free[row, column] & open_[beside]
    return np.asarray(found)


def _escapes(run: Prepared) -> Iterator[Measured]:
    seen = set()
    for stage, gravity in zip(run.plan.stages, run.gravity, strict=True):
        down = _larger(gravity), gravity[_larger(gravity)] < 0.0
        if down in seen:
            continue
        share = escape_share(run.model, run.state.position, run.state.wall_position, gravity)
        if share is not None:
            seen.add(down)
            count = run.model.grain_count
            about = f"{round(share * count)} of {count}"
            about += f", gravity of stage {stage.name}" if len(run.plan.stages) > 1 else ""
            yield Measured(share, about)


def _beyond(run: Prepared) -> Iterator[Measured]:
    domain, margin = run.scenario.domain, 2.0 * float(run.model.grains.radius.max(initial=0.0))
    if domain.is_cell:
        return
    low, high = domain.around(margin)
    place = run.state.position[run.state.here, :2]
    count = int(np.count_nonzero(((place < low) | (place > high)).any(axis=1)))
    share = count / max(1, run.model.grain_count)
    yield Measured(share, f"{count} of {run.model.grain_count}")


RULES: tuple[Rule[Prepared], ...] = (
    Rule(
        "grains beyond the domain", _beyond, unit="of the grains", warning=0.0,
        meaning="Centers of these grains lie more than the largest diameter outside of the domain "
            "when the run begins.",
        remedy="Check the unit of the file that they come from (meters) and its shift, or enlarge "
            "the domain.",
    ),
    Rule(
        "grains without a floor", _escapes, unit="of the grains", warning=0.0,
        meaning="These grains can fall or roll out of all walls along gravity, and then fall for "
            "ever. Told from the walls as they stand at the start.",
        remedy="Close the gaps, or put a plane below, which has no ends; if grains are to leave "
            "(a hopper), nothing.",
    ),
)  # fmt: skip


# ---- Walls under a load that pulls them off the grains

_STRAY = 0.1
"""A wall lies beyond the grains if no more than this part of their centers lies beyond it."""


def _wall_spans(run: Prepared) -> tuple[Floats, Floats]:
    """Lowest, highest points of walls in x and y [m], ``(w, 2)``; of planes the given point."""
    low = np.full((run.model.wall_count, 2), np.inf)
    high = -low
    for which, outline in placed_walls(run.model, run.state.wall_position):
        wall, corners = run.model.shapes.wall[which], outline.corners()
        if outline.normal is not None:  # a plane has a side in the direction of its normal only
            is_side = np.abs(outline.normal) > math.sqrt(0.5)
            corners = np.where(is_side, corners, np.array([[[-np.inf]], [[np.inf]]]))
        np.minimum.at(low, wall, corners[0])
        np.maximum.at(high, wall, corners[1])
    return low, high


def _outward(run: Prepared) -> Floats:
    """Direction away from the grains in x and y: 1, -1, or 0 of walls among them, ``(w, 2)``."""
    low, high = _wall_spans(run)
    meets = run.model.walls.meets
    if not meets.size:
        meets = np.ones((1, len(run.model.groups)), np.bool_)
    # Lowest, highest x and y of the grains that a wall meets, but for a few; infinite if none
    spans = np.full((len(meets), 2, 2), [[-np.inf], [np.inf]])
    for span, is_met in zip(spans, meets, strict=True):
        center = run.state.position[is_met[run.model.grains.group], :2]
        if len(center):
            span[:] = np.quantile(center, (_STRAY, 1.0 - _STRAY), axis=0)
    return np.where(low >= spans[:, 1], 1.0, np.where(high <= spans[:, 0], -1.0, 0.0))


def _pulls(run: Prepared) -> Iterator[Measured]:
    if run.model.is_cell:
        return  # there is nothing beside the grains
    walls, outward = run.model.walls, _outward(run)
    for stage, drives, gravity in zip(run.plan.stages, run.drives, run.gravity, strict=True):
        times = moments_of(stage)
        for w, drive in enumerate(drives):
            for axis, dof in enumerate((drive.x, drive.y)):
                load = dof.stress if dof.force is None else dof.force
                if load is None or dof.spring is not None or outward[w, axis] == 0.0:
                    continue
                force = math.fsum(map(load.value, times)) / len(times)
                # `between` two walls is a length like this one
                force *= float(walls.length[w]) if dof.force is None else 1.0
                force += float(walls.mass[w] * gravity[axis]) if walls.has_gravity[w] else 0.0
                about = f"wall {walls.names[w]} in stage {stage.name}"
                yield Measured(max(0.0, force * float(outward[w, axis])), about)


LIDS: tuple[Rule[Prepared], ...] = (
    Rule(
        "load off the grains", _pulls, unit="N", warning=0.0,
        meaning="The mean load of the wall, its weight included, pulls it away from the grains, "
            "and nothing holds it.",
        remedy="Turn the sign of the force: a lid above the grains presses with a negative force "
            "in y.",
    ),
)  # fmt: skip


# ---- Grains that have left everything and fall for ever


def lost_grains(
    model: Model, position: Floats, velocity: Floats, wall_position: Floats, gravity: Floats
) -> int:
    """Number of grains below all walls that they meet along gravity that go on falling.

    Planes have no end, and nothing is below them. Arguments as `escape_share`, velocities [m/s].
    """
    if not np.any(gravity):
        return 0
    down, count = gravity / np.hypot(*gravity), 0
    for which, walls in _meeting(model, wall_position):
        radius = model.grains.radius[which]
        is_lost = _is_lost(position[which], velocity[which], radius, walls, down)
        count += int(np.count_nonzero(is_lost))
    return count


def _is_lost(
    position: Floats, velocity: Floats, radius: Floats, walls: Sequence[Outline], down: Floats
) -> NDArray[np.bool_]:
    """Which of some grains are lost; ``down`` is the unit vector along gravity."""
    ends = [corners for outline in walls if outline.normal is None for corners in outline.corners()]
    depth = position[:, :2] @ down
    is_falling = velocity[:, :2] @ down > 0.0
    lowest = float((np.concatenate(ends) @ down).max()) if ends else -np.inf
    is_free = np.ones(len(position), np.bool_)
    for outline in walls:
        for k in range(len(outline.points) if outline.normal is not None else 0):
            assert outline.normal is not None
            if outline.normal[k] @ down < 0.0:  # a floor without ends
                is_free &= (position[:, :2] - outline.points[k, 0]) @ outline.normal[k] < 0.0
    return np.asarray(is_free & is_falling & (depth > lowest + 2.0 * radius))


def _lost(run: Recorded) -> Iterator[Measured]:
    if not len(run.run.frames):
        return
    frame = run.run.frames[-1]
    model = frame.model
    position, velocity = np.asarray(frame.position, float), np.asarray(frame.velocity, float)
    count = lost_grains(model, position, velocity, frame.wall_position, run.gravity)
    if model.grain_count:
        yield Measured(count / model.grain_count, f"{count} of {model.grain_count}")


def _removed(run: Recorded) -> Iterator[Measured]:
    books, count = run.info["exchange"], run.run.model.grain_count
    if books is not None:
        yield Measured(books["lost"] / count, f"{books['lost']} of {count}")


LOST: tuple[Rule[Recorded], ...] = (
    Rule(
        "lost grains", _lost, unit="of the grains", warning=0.0, bad=0.1,
        meaning="Grains that lie below all walls and fall on for ever; they count in all means, "
            "with ever more kinetic energy.",
        remedy='Put a plane below, which has no ends; let them go, with [[outlets]] or [domain] '
            'lost = "remove"; or end the stage '
            "earlier.",
    ),
    Rule(
        "removed grains", _removed, unit="of the grains", warning=0.0, bad=0.1,
        meaning='Grains that left the domain elsewhere than through an outlet, and were removed '
            'as [domain] lost = "remove" asks.',
        remedy="Close the walls, or put an outlet where they leave.",
    ),
    Rule(
        "late releases", lambda run: run.noted("exchange", "behind"), unit="grains", warning=0.0,
        meaning="Grains that are due and have found no room in the region of their release: "
            "fewer come than the rate asks for.",
        remedy="Lower the rate, or enlarge the region of the release; if the container is to be "
            "full, nothing.",
    ),
)  # fmt: skip
