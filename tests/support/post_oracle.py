"""Made-up runs with random grains, contacts and moving walls, and their tables, by plain loops.

Nothing of `multicor_cli.post` is used here: areas come from the primitive of the chord of a disc,
averages from loops over frames, grains, contacts and bins.
"""

from dataclasses import replace
from itertools import pairwise
from math import asin, pi, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scene_parts import make_model

from multicor_cli.model import Model, ShapeKind, State, Thermal
from multicor_cli.model.contacts import ContactTable
from multicor_cli.store import Frame, Run, RunDirectory, Snapshot, open_run

Floats = NDArray[np.float64]

FRAMES, GRAINS, PERIOD, LAPSE = 13, 70, 3.0, 0.3
FLOOR, LID = 0.4, 1.6  # heights of the walls in their own frames
BEFORE_FORCES = (0,)  # frames without a last step
WITHOUT_CONTACTS = (4,)  # frames in which nothing touches
RADII = (0.03, 0.05, 0.09)
GLUED = 0.04


def heights_of_walls(frame: int) -> tuple[float, float]:
    """The floor sinks slowly; the lid goes up and down."""
    return -0.01 * frame, 0.15 * np.sin(1.7 * frame)


def random_model(*, is_periodic: bool, seed: int) -> Model:
    """Grains of three sizes between rows of glued ones; masses and heat capacities differ."""
    rng = np.random.default_rng(seed)
    places = np.arange(0.0, PERIOD, 0.5)
    at = [(wall, y, x) for wall, y in enumerate((FLOOR, LID)) for x in places]
    shapes = [(ShapeKind.DISC, wall, (x, y, GLUED, 0.0)) for wall, y, x in at]
    shapes += [(ShapeKind.PLANE, 2, (0.0, 0.0, 1.0, 0.0))]
    shapes += [(ShapeKind.PLANE, 3, (PERIOD, 0.0, -1.0, 0.0))]
    names = ("floor", "lid", "left", "right")
    radii, period = rng.choice(RADII, GRAINS), PERIOD if is_periodic else 0.0
    model = make_model(radii, shapes, names, period=period)
    mass, capacity = model.grains.mass * rng.uniform(0.5, 1.5, GRAINS), rng.uniform(1, 2, GRAINS)
    thermal = Thermal(capacity, np.full(GRAINS, 300.0), np.full(GRAINS, 0.1))
    return replace(model, grains=replace(model.grains, mass=mass), thermal=thermal)


def random_contacts(state: State, model: Model, rng: np.random.Generator) -> ContactTable:
    """Random pairs, every fifth idle, a tenth on glued grains; branches stay between the walls."""
    n, count = model.grain_count, 90
    pairs = {(int(a), int(b)) for a, b in np.sort(rng.integers(0, n, (count, 2)), axis=1) if a < b}
    pairs |= {(int(k), n + int(rng.integers(0, 12))) for k in rng.integers(0, n, 10)}
    i, j = (np.array(column, np.int32) for column in zip(*sorted(pairs), strict=True))
    turn = rng.uniform(0.0, 2.0 * pi, i.size)
    normal = np.column_stack([np.cos(turn), np.sin(turn)])
    middle = state.wall_position[:2, 1].mean() + 0.5 * (FLOOR + LID)
    is_inwards = (state.position[i, 1] > middle) == (normal[:, 1] > 0.0)
    normal[:, 1] *= np.where(is_inwards, 1.0, -1.0)
    impulse = np.column_stack([rng.exponential(0.1, i.size), rng.normal(0.0, 0.03, i.size)])
    impulse[::5] = 0.0
    gap, sliding = rng.normal(0.0, 1e-4, i.size), rng.random(i.size) < 0.3
    return ContactTable(i, j, normal, gap, impulse, np.zeros(i.size), sliding)


def write_random_run(
    path: Path, *, is_periodic: bool = True, seed: int = 0, is_finished: bool = True
) -> Run:
    """Write a run with frames at uneven times, and two rows of the series for each."""
    rng = np.random.default_rng(seed)
    model = random_model(is_periodic=is_periodic, seed=seed)
    with RunDirectory.create(path, "", "", {"seed": seed}, stages=("shear",)) as run:
        writer = run.writer(model)
        state = State.at_rest(model, random_places(model, 0, rng))
        for frame in range(FRAMES):
            if frame:
                advance(state, model, frame, rng, writer)
            contacts = ContactTable.empty()
            if frame not in WITHOUT_CONTACTS:
                contacts = random_contacts(state, model, rng)
            writer.frame(Snapshot(state, model, contacts))
            if frame % 4 == 0:
                run.checkpoint(state, writer)
        run.checkpoint(state, writer)
        if is_finished:
            run.finish("finished")
    return open_run(path)


def random_places(model: Model, frame: int, rng: np.random.Generator) -> Floats:
    """Anywhere between the walls, whole."""
    low, high = heights_of_walls(frame)
    radius = model.grains.radius
    room = model.period or PERIOD
    bottom, top = FLOOR + low + radius, LID + high - radius
    return np.column_stack([rng.uniform(0.0, room, GRAINS), rng.uniform(bottom, top)])


def advance(state: State, model: Model, frame: int, rng: np.random.Generator, writer: Any) -> None:
    """Grains go anywhere, and across the period; what they hold grows by random amounts."""
    lapse = LAPSE * (1.0 + 0.5 * (frame % 3))
    for _ in range(2):
        state.time += 0.5 * lapse
        state.step += 1
        state.window[0] = 0.5 * lapse
        state.window_wall_impulse[:] = rng.normal([0.3, 0.0, 0.0], 0.1, (4, 3)) * 0.5 * lapse
        state.window_wall_impulse[0, 1] = -lapse
        state.window_wall_impulse[1] = [-0.3 * lapse, 1.1 * lapse, 0.0]
        writer.series_row(Snapshot(state, model))
    state.last_dt = 0.01
    state.position[:, :2] = random_places(model, frame, rng)
    state.position[:, 2] += rng.normal(-0.2, 0.1, GRAINS)
    if model.period:
        state.image += rng.integers(-1, 3, GRAINS)
    state.wall_position[:2, 1] = heights_of_walls(frame)
    state.wall_velocity[:2, 0] = 0.1, 2.0
    state.velocity[:] = rng.normal(0.0, 0.5, (GRAINS, 3))
    state.velocity[:, 0] += 3.0 * state.position[:, 1]
    state.heat = rng.uniform(0.0, 30.0, GRAINS)
    state.generated = state.generated + rng.exponential(0.2, GRAINS)
    state.wall_temperature[:] = [310.0, 350.0 if frame != 7 else np.nan, np.nan, np.nan]


# --- what must come out


class Layer(NamedTuple):
    """The bins in a frame: edges, and the width of the plane."""

    edges: Floats
    plane: float


def layer(run: Run, frame: Frame, count: int, left_out: float = 0.0) -> Layer:
    """Equal bins from the glued row below to the one above, less what is left out."""
    low, high = FLOOR + frame.wall_position[0, 1], LID + frame.wall_position[1, 1]
    x, a = frame.position[:, 0], run.model.grains.radius
    plane = run.period or float((x + a).max() - (x - a).min())
    return Layer(np.linspace(low + left_out, high - left_out, count + 1), plane)


def area_between(low: float, high: float, radius: float) -> float:
    """Area of a disc between two heights above its center: integral of the chord 2√(a² − u²)."""

    def primitive(u: float) -> float:
        u = min(max(u, -radius), radius)
        return u * sqrt(radius * radius - u * u) + radius * radius * asin(u / radius)

    return primitive(high) - primitive(low)


def areas(y: Floats, radius: Floats, edges: Floats) -> Floats:
    """Area of each grain in each bin, shape ``(n, b)``."""
    bins, grains = list(pairwise(edges)), zip(y, radius, strict=True)
    return np.array([[area_between(a - h, b - h, r) for a, b in bins] for h, r in grains])


def branches(run: Run, frame: Frame) -> list[tuple[int, int, Floats, Floats]]:
    """Of each contact with a force: i, j, the force on i, and the way from j's center to i's."""
    model, contacts, found = run.model, frame.contacts, []
    n = model.grain_count
    for c in range(contacts.count):
        i, j = int(contacts.i[c]), int(contacts.j[c])
        p, q = contacts.impulse[c] / frame.dt if frame.dt > 0.0 else (0.0, 0.0)
        if not p > 0.0:
            continue
        across = model.grains.radius[j] if j < n else model.shapes.geometry[j - n, 2]
        x, y = contacts.normal[c]
        way = (model.grains.radius[i] + across + contacts.gap[c]) * np.array([x, y])
        found.append((i, j, np.array([p * x - q * y, p * y + q * x]), way))
    return found


def counts(run: Run, frame: Frame) -> Floats:
    """Contacts with a force of each grain, those with walls included."""
    found = np.zeros(run.model.grain_count)
    for i, j, _, _ in branches(run, frame):
        found[[i] if j >= found.size else [i, j]] += 1
    return found


def parts(start: float, end: float, edges: Floats) -> Floats:
    """Part of a line in each bin."""
    low, high = min(start, end), max(start, end)
    inside = np.minimum(high, edges[1:]) - np.maximum(low, edges[:-1])
    return np.maximum(inside, 0.0) / (high - low)


def hats(y: Floats, edges: Floats) -> Floats:
    """Piecewise linear functions, 1 at a knot and 0 at the others, shape ``(n, knots)``."""
    return np.column_stack([np.interp(y, edges, row) for row in np.eye(edges.size)])


def fluctuations(run: Run, chosen: list[int], bin_width: float | None = None) -> list[Floats]:
    """Velocities about lines between knots with least weighted squares, over all frames.

    Knots are as far apart as bins are wide, by default about a mean diameter, but no farther.
    """
    mean = np.mean([np.ptp(layer(run, run.frames[k], 1).edges) for k in chosen])
    diameter = run.model.mean_diameter
    bin_width = bin_width or mean / round(mean / diameter)
    knots = max(round(mean / min(bin_width, diameter)), 1)
    radius = run.model.grains.radius
    frames = [run.frames[k] for k in chosen]
    bases = [hats(frame.position[:, 1], layer(run, frame, knots).edges) for frame in frames]
    speeds = [frame.velocity[:, :2] for frame in frames]
    weight = np.tile(radius, len(chosen))[:, np.newaxis]
    sides = (weight * np.concatenate(rows) for rows in (bases, speeds))
    fit = np.linalg.lstsq(*sides, rcond=None)[0]
    return [speed - base @ fit for speed, base in zip(speeds, bases, strict=True)]


def remembering_error(values: list[tuple[Floats, Floats]]) -> Floats:
    """Standard errors of ratios of sums over rows, which may remember each other; plain loops.

    What a row adds to the ratio is n times the ratio less n − 1 times that without the row; nan
    where one of these is not there.
    """
    n, errors = len(values), []
    for b in range(values[0][0].size):
        above, below = ([row[part][b] for row in values] for part in (0, 1))
        rest = [(sum(above) - a, sum(below) - c) for a, c in zip(above, below, strict=True)]
        if n < 2 or sum(below) <= 0.0 or any(c <= 0.0 for _, c in rest):
            errors.append(np.nan)
            continue
        added = [n * sum(above) / sum(below) - (n - 1) * a / c for a, c in rest]
        errors.append(error_of_mean(np.array(added)))
    return np.array(errors)


def error_of_mean(x: Floats) -> float:
    """As `multicor_cli.post.sums.spread`, in plain loops."""
    n, away = x.size, x - x.mean()
    if np.abs(away).max() <= 1e-14 * n * np.abs(x).max():
        return 0.0
    rho = [sum(away[t] * away[t + k] for t in range(n - k)) / sum(away**2) for k in range(n)]
    pairs, least = 0.0, np.inf
    for k in range(0, n - 1, 2):
        least = min(least, rho[k] + rho[k + 1])
        if least <= 0.0:
            break
        pairs += least
    phi = min(rho[1] + (1.0 + 3.0 * rho[1]) / n, 1.0 - 1.0 / n**2)
    g = max(1.0, 2.0 * pairs - 1.0, (1.0 + phi) / (1.0 - phi))
    return float(np.sqrt(away.var() * g / (n - g))) if n >= 2.0 * g else np.nan
