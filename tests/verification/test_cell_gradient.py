"""A cell under a mean gradient of temperature: closed forms, books, and what may not matter."""

from dataclasses import replace

import numpy as np
import pytest
from cells import compressed, loose_cell, make_cell, orders
from heat_parts import heat_book, make_heat_laws, with_heat
from scene_parts import book, continued, resume

from multicor_cli.engine import Engine
from multicor_cli.engine.heat.gas import CORE, Gas, parallel_conductance
from multicor_cli.engine.heat.radiation import (
    STEFAN_BOLTZMANN,
    Radiation,
    cylinder_view_factor,
    emission_factor,
)
from multicor_cli.engine.heat.settings import ContactForce, HeatSettings
from multicor_cli.engine.motion.cell import wrap_cell
from multicor_cli.model import HEAT_BOOK_NAMES
from multicor_cli.model.books import NAMES
from multicor_cli.model.state import State
from multicor_cli.post.conductivity import Network

START = 300.0
LAWS = make_heat_laws(emissivity=0.8)
ONE = ContactForce("prescribed", (1.0 / 30.0) ** 3 * 4.0 * LAWS.modulus[0, 0] / (3.0 * 0.25))
"""Makes H = 2 λ (3 F a*/4E*)^⅓ = 1 W/K of discs of diameter 1."""

WAYS = ("contacts", "gas", "radiation", "motion")


def with_gradient(model, gradient, *, capacity=None):
    """The model with heat, 1 J/K in grains of mass 1 if nothing else is said."""
    model = with_heat(model, START, capacity=capacity, specific=1.0, thickness=1.0)
    return replace(model, heat_gradient=tuple(map(float, gradient)))


def heated(model, state, gradient, order=None, *, capacity=None, **settings):
    """An engine of the places and velocities of a state; it stands still without orders."""
    model = with_gradient(model, gradient, capacity=capacity)
    warm = State.at_rest(model, state.position)
    warm.velocity[:], warm.wall_position[:] = state.velocity, state.wall_position
    heat = HeatSettings(LAWS, **{"friction": "none", **settings})
    engine = Engine(model, warm, threads=1, heat=heat)
    engine.begin(orders() if order is None else order)
    if order is None:
        resume(engine, is_frozen=True)
    return engine


def advance(engine, duration, steps):
    for k in range(steps):
        engine.step(duration / steps, k * duration / steps)
    return engine


def temperatures(engine):
    return engine.state.temperature(engine.model.thermal)


def flux(engine, duration):
    """Mean flux along x and y [W per length] in a time from the start, by what carries it."""
    rows = np.array(engine.state.gradient_books[1:]).reshape(2, 4).T / duration
    return dict(zip(WAYS, rows, strict=True))


def lattice(kind, columns=6, rows=8, *, spacing=1.0, tilt=0.0):
    """A triangular or a square lattice, in a cell that also has it a tilt away."""
    k, m = np.meshgrid(np.arange(columns), np.arange(rows))
    lean, height = (0.5, np.sqrt(0.75)) if kind == "triangular" else (0.0, 1.0)
    position = spacing * np.column_stack([(k + lean * m).ravel(), height * m.ravel()])
    size = spacing * columns, spacing * rows * height
    position[:, 0] %= size[0]
    whole = lean * rows + tilt
    assert whole % 1.0 == 0.0
    place = position + 0.25 * spacing
    return make_cell(place, np.full(len(place), 0.5), size, tilt=spacing * (tilt % columns))


# ---- Lattices: temperatures stay as they are


@pytest.mark.parametrize("tilt", [0.0, 1.0, -2.0])
@pytest.mark.parametrize(("kind", "square"), [("square", 1.0), ("triangular", np.sqrt(3.0))])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.1])
def test_lattices_conduct_alike_in_all_directions(kind, square, tilt, angle):
    """K = H of a square lattice and √3 H of a triangular one."""
    gradient = 5.0 * np.array([np.cos(angle), np.sin(angle)])
    engine = advance(heated(*lattice(kind, tilt=tilt), gradient, force=ONE), 30.0, 3)
    passed = flux(engine, 30.0)
    np.testing.assert_allclose(passed.pop("contacts"), -square * gradient, rtol=1e-9)
    assert not np.any([*passed.values()])
    np.testing.assert_allclose(temperatures(engine), START, rtol=1e-10)


def test_gas_and_radiation_of_a_lattice_have_shares_of_their_own():
    """Links of a triangular lattice with gaps of a tenth of a radius: what the gas conducts, and
    σ X 4T³ of parallel cylinders."""
    gradient, spacing = np.array([1.0, 2.0]), 1.05
    mechanisms = (Gas(0.03), Radiation(reach=0.4))
    engine = heated(*lattice("triangular", spacing=spacing), gradient, mechanisms=mechanisms)
    passed = flux(advance(engine, 1e-3, 1), 1e-3)
    core = 0.5 * min(CORE, 0.03 / 15.0)
    gas = parallel_conductance(0.03, 0.5, 0.5, core, spacing - 1.0)
    area = np.pi * cylinder_view_factor(0.5, 0.5, spacing - 1.0) * emission_factor(0.8, 0.8)
    radiation = 4.0 * STEFAN_BOLTZMANN * START**3 * area
    assert not passed["contacts"].any()
    np.testing.assert_allclose(passed["gas"], -np.sqrt(3.0) * gas * gradient, rtol=1e-9)
    np.testing.assert_allclose(passed["radiation"], -np.sqrt(3.0) * radiation * gradient, rtol=1e-9)


# ---- A packing at rest


@pytest.fixture(scope="module")
def packing():
    """Frictionless grains that have come to rest under a pressure."""
    return compressed(60, duration=60.0, seed=3)


def test_a_packing_comes_to_the_flux_of_its_network(packing):
    """Against a direct solve of the same links, H ∝ (a*)^⅓ under one force."""
    gradient = np.array([2.0, -1.0])
    engine = advance(heated(*packing, gradient, force=ONE), 3000.0, 30)
    table, state = engine.contacts(), engine.state
    branch = nearest(state.position[table.i, :2] - state.position[table.j, :2], state)
    area = np.prod(state.wall_position[0, :2])
    a, b = (engine.model.grains.radius[of] for of in (table.i, table.j))
    conductance = np.cbrt(a * b / (a + b) / 0.25)
    network = Network(table.i, table.j, conductance, branch, len(state.position), area)
    before = np.array(state.gradient_books)
    advance(engine, 100.0, 1)
    passed = (state.gradient_books - before)[1:].reshape(2, 4).sum(axis=1) / 100.0
    np.testing.assert_allclose(passed, -network.square() @ gradient, rtol=1e-6)
    assert np.ptp(temperatures(engine)) > 0.1
    assert abs(state.heat.sum()) < 1e-9
    assert state.heat_books[HEAT_BOOK_NAMES.index("closure")] < 1e-13


def nearest(branch, state):
    width, height, tilt = state.wall_position[0]
    up = np.rint(branch[:, 1] / height)
    branch = branch - up[:, np.newaxis] * (tilt, height)
    branch[:, 0] -= width * np.rint(branch[:, 0] / width)
    return branch


def test_the_sides_of_the_cell_do_not_matter(packing):
    """The same packing shifted, and described by another lattice vector."""
    model, state = packing
    fluxes = []
    for shift, turns in (((0.0, 0.0), 0), ((2.3, 4.1), 0), ((0.7, 1.9), 2)):
        other = State.at_rest(model, state.position)
        other.position[:, :2] += shift
        other.wall_position[:] = state.wall_position
        other.wall_position[0, 2] += turns * other.wall_position[0, 0]
        wrap_cell(other.position, other.wall_position[0])
        engine = advance(heated(model, other, (3.0, 1.0), force=ONE), 2.0, 4)
        fluxes.append([*flux(engine, 2.0)["contacts"], *temperatures(engine)])
    np.testing.assert_allclose(fluxes[1:], [fluxes[0]] * 2, rtol=1e-11, atol=1e-11)


# ---- Grains that move take their heat along


@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_heat_that_nobody_conducts_goes_where_its_grain_goes(rate):
    """T falls by G·∫c dt, and the flux is Σ C (T − ⟨T⟩) c/A, for grains that never meet; those of
    a sheared cell are where they stray beside its mean flow."""
    random, count = np.random.default_rng(7), 30
    model, state = make_cell(random.uniform(0.0, 20.0, (count, 2)), np.full(count, 1e-6), (20, 20))
    state.velocity[:, :2] = random.normal(size=(count, 2))
    capacity, gradient = random.uniform(1.0, 3.0, count), np.array([0.7, -0.4])
    order = orders(xy=("velocity", rate))
    engine = heated(model, state, gradient, order, capacity=capacity, conduction="none")
    engine.state.wall_velocity[0, 2] = rate
    carried, dt = np.zeros(2), 0.01
    for k in range(200):
        before, start = temperatures(engine), np.array(engine.state.nonaffine)
        engine.step(dt, k * dt)
        warm = 0.5 * (before + temperatures(engine))
        warm = capacity * (warm - capacity @ warm / capacity.sum())
        carried += warm @ (engine.state.nonaffine - start)
    strayed = engine.state.nonaffine
    np.testing.assert_allclose(temperatures(engine), START - strayed @ gradient, rtol=1e-12)
    books = dict(zip(NAMES["gradient_books"], engine.state.gradient_books, strict=True))
    assert books["along_gradient"] == pytest.approx(-capacity @ (strayed @ gradient), rel=1e-12)
    found = np.array([books["motion_x"], books["motion_y"]])
    # Euler's rule takes the temperature at the start of each step
    np.testing.assert_allclose(found, carried / 400.0, rtol=0.02)
    assert engine.state.heat_books[HEAT_BOOK_NAMES.index("closure")] < 1e-13
    # dc/dt = −L c
    x, y = state.velocity[:, :2].T * 2.0
    expected = np.column_stack([x - 0.5 * rate * 2.0 * y, y])
    np.testing.assert_allclose(strayed, expected, rtol=1e-3, atol=1e-3)


def test_a_cell_that_only_strains_carries_nothing():
    """Grains that move with the mean flow do not stray, and the gradient moves with them."""
    model, state = lattice("square", spacing=1.2)
    order = orders(("velocity", 0.1), ("velocity", -0.05), ("velocity", 0.2))
    engine = heated(model, state, (1.0, 2.0), order, force=ONE)
    engine.state.wall_velocity[0] = 0.1, -0.05, 0.2
    advance(engine, 0.2, 20)
    assert np.abs(engine.state.nonaffine).max() < 1e-13
    assert np.abs(temperatures(engine) - START).max() < 1e-10


def test_a_flow_keeps_its_books_and_may_be_stopped_at_any_step():
    """Sheared under a pressure, with friction, its heat and conduction; the same bits after a copy
    of the state."""
    model, state = loose_cell(80, friction=0.4, seed=5)
    order = orders(("stress", 1.0), ("stress", 1.0), ("velocity", 0.2))
    engine = heated(model, state, (0.0, 4.0), order, friction="energy", force=ONE)
    advance(engine, 20.0, 400)
    other = continued(engine)
    for each in (engine, other):
        advance(each, 2.0, 40)
    assert engine.state.digest() == other.state.digest()
    assert engine.state.heat_books[HEAT_BOOK_NAMES.index("closure")] < 1e-12
    assert heat_book(engine.state, "friction") == pytest.approx(
        book(engine.state, "friction_loss"), rel=1e-12
    )
    passed = flux(engine, 22.0)
    assert passed["contacts"][1] < 0.0
    assert passed["motion"][1] < 0.0
