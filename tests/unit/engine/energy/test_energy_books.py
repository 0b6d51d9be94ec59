"""What the closure of the energy books measures: rounding where nothing is wrong, and every term
that is."""

import numpy as np
import pytest
from scene_parts import FLOOR, G, advance, begin, book, make_engine, make_model, shear_engine

from multicor_cli.checks.books import CLOSURE_LIMIT
from multicor_cli.engine import Engine
from multicor_cli.engine.energy import account
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import BOOK_NAMES, ShapeKind, State

FAULT = 1e-7
"""By which part of itself a term is wrong."""

WORKS = ("gravity_work", "wall_work", "load_work", "friction_loss", "impact_loss", "damping_loss")


def spoil(monkeypatch, name, fault=FAULT):
    """Let a book grow by a little too much in every step."""
    k, before, close = BOOK_NAMES.index(name), [0.0], account._close

    def close_spoiled(books, *more):
        books[k] += fault * (books[k] - before[0])
        before[0] = books[k]
        close(books, *more)

    monkeypatch.setattr(account, "_close", close_spoiled)


def sheared(fast=0.0):
    """Discs of mass 1 that are sheared under a damped load, in oblique gravity; one far above them
    moves, if it is to be fast."""
    engine = shear_engine(restitution=0.2, gravity=(0.05, -0.05))
    model, state = engine.model, engine.state
    load = DofDrive(force=Constant(-model.period), damping=3.0)
    if fast:
        state.position[-1, 1], state.velocity[-1, 0] = 1e6, fast
    begin(engine, drives=[WallDrive(), WallDrive(x=DofDrive(velocity=Constant(1.5)), y=load)])
    return engine


def overlapping():
    """A grain that is lifted out of the floor by the position correction alone."""
    return make_engine(make_model([0.1], FLOOR), [[0.0, 0.1 * (1.0 - 9e-4)]])


@pytest.mark.parametrize("steps", [20, 600])
@pytest.mark.parametrize("name", [*WORKS, "kinetic"])
def test_a_term_that_is_wrong_by_a_little_is_found(name, steps, monkeypatch):
    assert book(advance(sheared(), 0.1, steps), "closure") < 1e-13
    spoil(monkeypatch, name)
    assert book(advance(sheared(), 0.1, steps), "closure") > CLOSURE_LIMIT


def test_work_of_corrections_that_is_wrong_by_a_little_is_found(monkeypatch):
    assert book(advance(overlapping(), 1e-3, 5), "closure") < 1e-13
    spoil(monkeypatch, "correction_work")
    assert book(advance(overlapping(), 1e-3, 5), "closure") > CLOSURE_LIMIT


@pytest.mark.parametrize("name", ["wall_work", "friction_loss", "impact_loss"])
def test_one_fast_grain_does_not_hide_what_is_wrong_among_slow_ones(name, monkeypatch):
    """Its kinetic energy is a thousand times what the others exchange: rounding of it alone is
    10⁻¹³ of that."""
    slow = book(advance(sheared(), 0.1, 100), "terms")
    fast = float(np.sqrt(2e3 * slow))
    assert book(advance(sheared(fast), 0.1, 100), "closure") < 1e-11
    spoil(monkeypatch, name)
    assert book(advance(sheared(fast), 0.1, 100), "closure") > CLOSURE_LIMIT


def test_a_fault_of_late_steps_is_found(monkeypatch):
    engine = sheared()
    advance(engine, 0.1, 600)
    spoil(monkeypatch, "friction_loss", 1e-6)
    state = engine.state
    for k in range(600, 1200):
        engine.step(0.1, k * 0.1)
    assert book(state, "closure") > CLOSURE_LIMIT


V_SHAPE = [
    (ShapeKind.PLANE, 0, (0.0, 0.0, 0.6, 0.8)),
    (ShapeKind.PLANE, 0, (0.0, 0.0, -0.28, 0.96)),
]
NONE = (0.0, 0.0)

ALONE = {
    "free flight": ([], NONE, (0.5, 1.0), (0.37, 0.11, 1.3), {}),
    "flight in gravity": ([], (0.0, -G), (0.5, 1.0), (0.37, 0.11, 1.3), {}),
    "oblique gravity": ([], (1.0, -G), (0.5, 1.0), (0.37, 0.11, 1.3), {}),
    "spin": ([], NONE, (0.5, 1.0), (0.0, 0.0, 77.7), {}),
    "fast in weak gravity": ([], (0.0, -1e-3), (0.5, 1.0), (123.0, 456.0, 0.0), {}),
    "rolling": (FLOOR, (0.0, -G), (0.0, 0.1), (0.37, 0.0, -3.7), {}),
    "rolling without gravity": (FLOOR, NONE, (0.0, 0.1), (0.37, 0.0, -3.7), {}),
    "rolling downhill": (FLOOR, (1.3, -G), (0.0, 0.1), (0.37, 0.0, -3.7), {}),
    "sliding, then rolling": (FLOOR, (0.0, -G), (0.0, 0.1), (0.37, 0.0, 5.0), {}),
    "at rest": (FLOOR, (0.0, -G), (0.0, 0.1), (0.0, 0.0, 0.0), {}),
    "at rest without gravity": (FLOOR, NONE, (0.0, 0.1), (0.0, 0.0, 0.0), {}),
    "held by friction": (FLOOR, (1.0, -G), (0.0, 0.1), (0.0, 0.0, 0.0), {"rolling": 0.3}),
    "in a notch": (V_SHAPE, (0.0, -G), (0.02, 0.5), (0.0, 0.0, 0.0), {}),
    "adhesive, at rest": (FLOOR, (0.0, -G), (0.0, 0.1), (0.0, 0.0, 0.0), {"adhesion": 50.0}),
    "bouncing": (FLOOR, (0.0, -G), (0.0, 0.5), (0.2, 0.0, 3.0), {"restitution": 1.0}),
}
"""Shapes of the wall, gravity, place and velocity of one grain, and what else there is to say."""


def alone(shapes, gravity, place, velocity, more):
    return make_engine(make_model([0.1], shapes, gravity=gravity, **more), [place], [velocity])


@pytest.mark.parametrize("case", ALONE)
def test_books_of_one_grain_close(case):
    engine = alone(*ALONE[case])
    for steps in (1, 2, 17, 1000):
        for k in range(steps):
            engine.step(1e-3, k * 1e-3)
        assert book(engine.state, "closure") < 0.1 * CLOSURE_LIMIT
    assert book(engine.state, "kinetic_start") == pytest.approx(
        0.5
        * float(engine.model.grains.mass[0])
        * (np.square(ALONE[case][3][:2]).sum() + 0.5 * (0.1 * ALONE[case][3][2]) ** 2)
    )


@pytest.mark.parametrize(
    "drive", [DofDrive(velocity=Constant(3.0)), DofDrive(force=Constant(2.0)), DofDrive()]
)
def test_books_close_where_a_wall_touches_nothing(drive):
    lid = [(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, -1.0))]
    for velocity in ((0.0, 0.0, 0.0), (0.37, 0.0, 1.3)):
        model = make_model([0.1], lid, ("lid",), gravity=NONE, mass=0.3)
        engine = make_engine(model, [[0.0, -5.0]], [velocity], drives=[WallDrive(y=drive)])
        assert book(advance(engine, 1e-3, 500), "closure") < 0.01 * CLOSURE_LIMIT


@pytest.mark.parametrize("restitution", [0.0, 0.9, 1.0])
def test_books_of_a_gas_close(restitution):
    rng = np.random.default_rng(8)
    radius, k = rng.uniform(0.3, 0.5, 600), np.arange(600)
    box = [
        (ShapeKind.PLANE, 0, g)
        for g in ((-1, 0, 1, 0), (0, -1, 0, 1), (30, 0, -1, 0), (0, 26, 0, -1))
    ]
    model = make_model(radius, box, gravity=NONE, restitution=restitution, friction=0.3)
    engine = make_engine(
        model, np.column_stack([(k % 25) * 1.15, (k // 25) * 1.05]), rng.normal(size=(600, 3))
    )
    assert book(advance(engine, 5e-3, 400), "closure") < 0.01 * CLOSURE_LIMIT


def test_the_closure_does_not_depend_on_units_that_are_powers_of_two():
    """Lengths four times as large, times twice as large: the same bits."""
    found = []
    for length, time in ((1.0, 1.0), (4.0, 2.0)):
        model = make_model(
            [0.1 * length, 0.07 * length], FLOOR, gravity=(0.0, -G * length / time**2),
            restitution=0.5,
        )  # fmt: skip
        speed = length / time
        velocities = [(0.3 * speed, 0.0, 4.0 / time), (-0.2 * speed, 0.1 * speed, -1.0 / time)]
        engine = make_engine(
            model, [[0.0, 0.3 * length], [0.25 * length, 0.35 * length]], velocities
        )
        found.append(book(advance(engine, 2e-3 * time, 500), "closure"))
    assert found[0] == found[1] > 0.0


def test_an_opened_book_says_how_the_first_step_will_begin():
    """The kinetic energy is that of the step, but for the order in which it is summed."""
    rng = np.random.default_rng(4)
    model = make_model(rng.uniform(0.1, 0.2, 1300), (), (), gravity=NONE)
    state = State.at_rest(model, np.column_stack([np.arange(1300.0), np.zeros(1300)]))
    state.velocity[:] = [0.5, -0.25, 0.0]
    state.velocity[:, 2] = rng.normal(size=1300)
    engine = Engine(model, state)
    begin(engine, drives=[])
    opened = book(state, "kinetic")
    engine.step(1e-3, 0.0)
    assert book(state, "kinetic") == pytest.approx(opened, rel=1e-14)
    assert book(state, "kinetic_start") == opened
    assert book(state, "closure") < 1e-12
