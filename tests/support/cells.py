"""Cells that are periodic in both directions, by hand: discs of mean diameter and mass 1."""

import numpy as np
from heat_parts import with_heat
from made_up_frames import contacts_of, frame_of, source_of
from scene_parts import make_model
from shapes import POINT, box, regular, rod, shaped_model

from multicor_cli.engine import Engine
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.engine.orders import Orders, Settings
from multicor_cli.model.state import State

DT = 0.05
"""√(m/P) is 1 under the pressure 1."""

FACES = [
    [(regular(5), 0.0)],
    [(0.7 * box(1.2, 0.9), 0.05)],
    [(rod(1.2), 0.3)],
    [(np.array([[0.5, 0.0]]), 0.4), (np.array([[-0.5, 0.0]]), 0.4), (rod(1.0), 0.2)],
    [(POINT, 1.0)],
]
"""Grains of all kinds with a reach of 1 or less: sharp, rounded, a rod, a clump, a disc."""


def make_cell(position, radius, size, *, inertia=1.0, tilt=0.0, grains=None, **laws):
    """Model and state of discs at rest in a cell of this size, ``(2,)``; the rest as `make_model`.

    ``inertia`` is that of the cell over Σ m d̄². With ``grains`` of pieces they are not discs, and
    of density 1.
    """
    radius = np.asarray(radius, float)
    mass = 4.0 * radius**2
    of_cell = inertia * mass.sum() * (2.0 * radius.mean()) ** 2
    keys = {
        "walls": ("cell",), "gravity": (0.0, 0.0), "period": size[0], "height": size[1],
        "mass": of_cell, "inertia": of_cell, "length": 0.0, **laws,
    }  # fmt: skip
    if grains:
        model = shaped_model(grains, (), **keys)
    else:
        model = make_model(radius, density=4.0 / np.pi, **keys)
    state = State.at_rest(model, np.asarray(position, float))
    state.wall_position[0] = *size, tilt
    return model, state


def loose_cell(
    count, *, spread=0.2, solid_fraction=0.6, seed=1, shift=(0.0, 0.0), shapes=(), **more
):
    """Discs of sizes ± ``spread``, loosely on the places of a grid that is not quite straight.

    Grains of ``shapes``, outlines of a reach of 1, lie within these discs, at any angle.
    """
    random = np.random.default_rng(seed)
    radius = 0.5 * (1.0 + spread * random.uniform(-1.0, 1.0, count))
    side = np.sqrt(np.pi * (radius**2).sum() / solid_fraction)
    columns = int(np.ceil(np.sqrt(count)))
    places = (np.arange(columns) + 0.5) * side / columns
    position = np.stack(np.meshgrid(places, places), axis=-1).reshape(-1, 2)
    position = random.permutation(position)[:count]
    free = 0.5 * max(side / columns - 2.0 * radius.max(), 0.0)
    position = position + random.uniform(-free, free, (count, 2)) + shift
    if shapes:
        of = random.integers(0, len(shapes), count)
        more["grains"] = [
            [(a * corners, a * rounding) for corners, rounding in shapes[k]]
            for k, a in zip(of, radius, strict=True)
        ]
    model, state = make_cell(position % side, radius, (side, side), **more)
    if shapes:
        state.position[:, 2] = random.uniform(0.0, 2.0 * np.pi, count)
    return model, state


def orders(xx=None, yy=None, xy=None, settings=None):
    """Orders of a stage: ("stress", value) or ("velocity", value) of each component, or held."""
    dofs = (
        DofDrive() if one is None else DofDrive(**{one[0]: Constant(one[1])})
        for one in (xx, yy, xy)
    )
    return Orders(drives=[WallDrive(*dofs)], settings=settings or Settings())


def flow(model, state, order, duration, *, dt=DT, threads=1):
    """Advance a state; returns the engine and the mean stress, xx, yy and xy."""
    engine = Engine(model, state, threads=threads)
    engine.begin(order)
    state.window_wall_impulse[:] = 0.0
    area = 0.0
    for k in range(round(duration / dt)):
        engine.step(dt, k * dt)
        area += dt * state.wall_position[0, 0] * state.wall_position[0, 1]
    return engine, state.window_wall_impulse[0] / area


def compressed(count, *, duration=30.0, **more):
    """A cell that has come to rest under an isotropic pressure of 1."""
    model, state = loose_cell(count, **more)
    pressure = ("stress", 1.0)
    flow(model, state, orders(pressure, pressure), duration)
    return model, state


def solid_fraction(model, state):
    width, height, _ = state.wall_position[0]
    return float(model.area.sum() / (width * height))


THICKNESS = 0.25


def square_of_discs(conductances, *, heat=True, thickness=THICKNESS, **said):
    """Frames of four discs of radius 0.5 in a cell of 2 by 2, and one that touches none.

    All contacts of a frame have one conductance and the normal force 1.
    """
    places = [(0.5, 0.5), (1.5, 0.5), (0.5, 1.5), (1.5, 1.5), (1.0, 1.0)]
    radius = np.array([0.5, 0.5, 0.5, 0.5, 0.1])
    model, _ = make_cell(places, radius, (2.0, 2.0))
    if heat:
        model = with_heat(model, capacity=1.0, thickness=thickness)
    i, j = [0, 0, 2, 2, 0, 0, 1, 1], [1, 1, 3, 3, 2, 2, 3, 3]
    normal = [(-1.0, 0.0), (1.0, 0.0)] * 2 + [(0.0, -1.0), (0.0, 1.0)] * 2
    frames = []
    for k, conductance in enumerate(conductances):
        contacts = contacts_of(i, j, normal, (1.0, 0.0))
        contacts.conductance = np.full(8, conductance) if heat else None
        frame = frame_of(places, walls=1, contacts=contacts, step=k + 1)
        frame.wall_position = np.array([[2.0, 2.0, 0.0]])
        frames.append(frame)
    return source_of(model, frames, **{"scenario_resolved": "", **said})


def strained(sides, gradient, times):
    """The time series of a cell that begins with these sides and is strained at a constant gradient
    (xx, yy, xy), as far as tables look at it; the tilt goes around.
    """
    (width, height, tilt), (xx, yy, xy), times = sides, gradient, np.asarray(times, float)
    wide, high = np.exp(xx * times), np.exp(yy * times)
    mean = times * wide if xx == yy else (high - wide) / (yy - xx)
    tilts = wide * tilt + xy * height * mean
    tilts -= width * wide * np.round(tilts / (width * wide))
    return {
        "time": times, "window_duration": np.diff(times, prepend=times[0]),
        "wall_position": np.column_stack([width * wide, height * high, tilts])[:, np.newaxis],
        "wall_velocity": np.tile(np.asarray(gradient, float), (times.size, 1, 1)),
    }  # fmt: skip
