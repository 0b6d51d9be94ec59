"""Small scenes built by hand."""

from dataclasses import replace

import numpy as np

from multicor_cli.engine import Engine, Orders, Settings
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import (
    BOOK_NAMES,
    TALLY_NAMES,
    ContactLaws,
    Grains,
    Model,
    ShapeKind,
    State,
    Walls,
    WallShapes,
)

G = 9.81
FLOOR = [(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0))]
TIGHT = Settings(
    tolerance_rms=1e-12, tolerance_max=1e-10, tolerance_energy=1e-12, max_sweeps=200_000
)
FIXED = DofDrive()
SPEED = 1.5
"""Of walls, and of surfaces that run along them [m/s]."""


def make_laws(
    friction=0.5, restitution=0.0, table=None, *, adhesion=0.0, rolling=0.0, reach=None, wet=False
):
    """Of one material; ``table`` are speeds and values of its friction, ``reach`` is the range of
    adhesion."""
    one, given = np.ones((1, 1)), {"adhesion": adhesion, "rolling": rolling}
    further = {name: value * one for name, value in given.items() if value}
    if reach is not None:
        further |= {"adhesion_range": reach * one, "is_wet": np.full((1, 1), wet, np.uint8)}
    number = np.full((1, 1), -1 if table is None else 0, np.int32)
    start = np.array([0] if table is None else [0, len(table[0])], np.int32)
    speed, values = np.array(table or ((), ()), float)
    return ContactLaws(friction * one, restitution * one, number, start, speed, values, **further)


def make_shapes(shapes):
    """Shapes of walls from (kind, wall, four numbers); corners have the numbers of their lines."""
    kind, wall, geometry = zip(*shapes, strict=True) if shapes else ((), (), ())
    for which, body, (_, y, *lines) in shapes:
        for end, line in zip((slice(2, 4), slice(0, 2)), lines, strict=True):
            if which == ShapeKind.VERTEX and line >= 0:
                assert wall[int(line)] == body
                assert kind[int(line)] in (ShapeKind.SEGMENT, ShapeKind.SIDE)
                assert geometry[int(line)][end][1] == y
    numbers = np.array(geometry, float).reshape(len(kind), 4)
    return WallShapes(
        np.array(kind, np.int32), np.array(wall, np.int32), numbers, np.zeros(len(kind), np.int32)
    )


def make_model(
    radius, shapes=(), walls=("floor",), *, friction=0.5, restitution=0.0, gravity=(0.0, -G),
    period=0.0, mass=np.nan, inertia=np.nan, length=1.0, shape="disc", density=1.0, table=None,
    wall_gravity=False, adhesion=0.0, rolling=0.0, reach=None, wet=False, height=0.0,
):  # fmt: skip
    """Model of one material; ``shapes`` are (kind, wall, four numbers)."""
    radius = np.asarray(radius, float)
    if shape == "disc":
        grain_mass, factor = density * np.pi * radius**2, 2.0
    else:
        grain_mass, factor = density * 4.0 / 3.0 * np.pi * radius**3, 2.5
    zero = np.zeros(radius.size, np.int32)
    grains = Grains(radius, grain_mass, grain_mass * radius**2 / factor, zero, zero.copy())
    values = (mass, float), (inertia, float), (wall_gravity, bool), (length, float)
    numbers = (np.full(len(walls), value, kind) for value, kind in values)
    adhesive = {"adhesion": adhesion, "reach": reach, "wet": wet}
    laws = make_laws(friction, restitution, table, rolling=rolling, **adhesive)
    return Model(
        grains, make_shapes(shapes), Walls(tuple(walls), *numbers), laws, ("steel",), ("grains",),
        period, np.array(gravity, float), factor, height=height,
    )  # fmt: skip


def floor_and_lid(height=0.0):
    """Planes of walls 0 and 1 that face each other."""
    return [*FLOOR, (ShapeKind.PLANE, 1, (0.0, float(height), 0.0, -1.0))]


def between_planes(radii=(0.1, 0.1)):
    """Model of grains between planes "bottom" (y = 0) and "top" (y = 1); the period is 4 m."""
    return make_model(radii, floor_and_lid(1.0), ("bottom", "top"), period=4.0)


def make_engine(model, positions, velocities=None, *, settings=None, drives=None, threads=1):
    state = State.at_rest(model, np.asarray(positions, float))
    if velocities is not None:
        state.velocity[:] = velocities
    engine = Engine(model, state, threads=threads)
    engine.begin(Orders(drives, settings or Settings()))
    return engine


def begin(engine, **orders):
    """Begin a stage with some other orders."""
    engine.begin(replace(engine.orders, **orders))


def resume(engine, **orders):
    """Change some orders in the middle of a stage."""
    engine.resume(replace(engine.orders, **orders))


def copy_of(state):
    return State.from_dict({name: np.array(value) for name, value in state.as_dict().items()})


def continued(engine):
    """Another engine that goes on from a copy of the state, as after a stop."""
    other = Engine(engine.model, copy_of(engine.state), threads=1, heat=engine.heat)
    other.resume(engine.orders)
    return other


def advance(engine, dt, steps, first=0):
    """Do steps ``first`` to ``first + steps``; the state after them."""
    for k in range(first, first + steps):
        engine.step(dt, k * dt)
    return engine.state


def book(state, name):
    return state.books[BOOK_NAMES.index(name)]


def tally(state, name):
    return state.tallies[TALLY_NAMES.index(name)]


def shear_scene(
    columns=16, rows=14, *, seed=0, friction=0.4, restitution=0.0, spread=0.2, gravity=(0.0, 0.0),
    load=1.0, speed=SPEED,
    adhesion=0.0, rolling=0.0, reach=None, wet=False,
):  # fmt: skip
    """Loose discs of mean mass and diameter 1 between rough walls, the upper sheared under a load.

    Returns the model, positions (with the walls' reference points) and drives.
    """
    rng = np.random.default_rng(seed)
    n = columns * rows
    radius = 0.5 * (1.0 + spread * (2.0 * rng.random(n) - 1.0))
    period = 1.25 * columns
    k = np.arange(n)
    positions = np.column_stack(
        [(k % columns + 0.5 * (k // columns % 2) + 0.25) * 1.25, 1.15 + (k // columns) * 1.1]
    )
    glued = round(period)
    width = period / glued
    line = [((m + 0.5) * width - 0.5 * period, 0.0, 0.5 * width, 0.0) for m in range(glued)]
    shapes = [(ShapeKind.DISC, 0, g) for g in line] + [(ShapeKind.DISC, 1, g) for g in line]
    model = make_model(
        radius, shapes, ("bottom", "top"), friction=friction, restitution=restitution,
        gravity=gravity, period=period,
        mass=20.0, length=period, density=4.0 / np.pi, adhesion=adhesion, rolling=rolling,
        reach=reach, wet=wet,
    )  # fmt: skip
    height = 1.15 + rows * 1.1
    origins = np.array([[0.5 * period, 0.0, 0.0], [0.5 * period, height, 0.0]])
    drives = [WallDrive(), WallDrive(
        x=DofDrive(velocity=Constant(speed)),
        y=DofDrive(force=Constant(-load * period), damping=0.0),
    )]  # fmt: skip
    return model, positions, origins, drives


def shear_engine(settings=None, threads=1, **kwargs):
    model, positions, origins, drives = shear_scene(**kwargs)
    engine = make_engine(model, positions, settings=settings, drives=drives, threads=threads)
    engine.state.wall_position[:] = origins
    return engine


def running(speed=SPEED, **dofs):
    """The drive of a wall whose surface runs: with a speed [m/s], or as a signal says."""
    return WallDrive(surface=Constant(speed) if isinstance(speed, float) else speed, **dofs)


def bed(seed=1, columns=8, rows=3, **keys):
    """Grains of several sizes that fall onto a floor, periodic in x."""
    rng = np.random.default_rng(seed)
    n = columns * rows
    k = np.arange(n)
    radius = rng.uniform(0.3, 0.45, n)
    positions = np.column_stack(
        [k % columns + 0.5 + 0.02 * rng.random(n), 0.47 + 0.95 * (k // columns)]
    )
    return make_model(radius, FLOOR, period=float(columns), **keys), positions


def surface_engine(settings=None, threads=1, columns=8, rows=3, load=120.0, speed=SPEED, **laws):
    """A bed between a running floor and a lid under a load whose surface runs too."""
    model, positions = bed(columns=columns, rows=rows)
    given = {"period": model.period, "mass": 2.0, "gravity": (0.0, 0.0), **laws}
    model = make_model(model.grains.radius, floor_and_lid(), ("floor", "lid"), **given)
    drives = [running(speed), running(-0.5 * speed, y=DofDrive(force=Constant(-load)))]
    engine = make_engine(model, positions, settings=settings, drives=drives, threads=threads)
    engine.state.wall_position[1, 1] = 0.95 * rows + 0.1
    return engine
