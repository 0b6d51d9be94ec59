"""A cell that is periodic in both directions: closed forms, books, and what may not matter."""

import numpy as np
import pytest
from cells import DT, FACES, compressed, flow, loose_cell, make_cell, orders, solid_fraction
from outline_brute import smallest_outline_gap
from scipy.linalg import expm

from multicor_cli.engine import Engine
from multicor_cli.engine.motion.cell import wrap_cell
from multicor_cli.engine.orders import PhysicsError, Settings
from multicor_cli.model.cell import mean_flow
from multicor_cli.model.state import State

SHARP = Settings(tolerance_rms=1e-10, tolerance_max=1e-8, tolerance_energy=1e-9, max_sweeps=100_000)
PRESSURE = "stress", 1.0


def lattice(columns, rows, *, spacing=1.0, **more):
    """A triangular lattice of discs, whose neighbors are ``spacing`` apart."""
    k, m = np.meshgrid(np.arange(columns), np.arange(rows))
    x = spacing * (k + 0.5 * (m % 2))
    y = spacing * np.sqrt(0.75) * m
    size = columns * spacing, rows * spacing * np.sqrt(0.75)
    position = np.column_stack([x.ravel(), y.ravel()])
    return make_cell(position, np.full(len(position), 0.5), size, **more)


def copy_of(state):
    return State.from_dict({name: np.array(value) for name, value in state.as_dict().items()})


def branches(model, state, of=slice(None)):
    """Vectors between the centers of all pairs, nearest images, shape ``(n, n, 2)``."""
    width, height, tilt = state.wall_position[0]
    r = state.position[of, :2]
    d = r[:, None] - r[None]
    up = np.round(d[..., 1] / height)
    d = d - up[..., None] * (tilt, height)
    d[..., 0] -= width * np.round(d[..., 0] / width)
    return d


# ---- Forces that are known


def test_a_chain_around_the_cell_carries_the_stress_over_the_height():
    """Eight discs in a row, each touching the next and the last the first: f = σ_xx times L_y."""
    position = np.column_stack([np.arange(8.0), np.full(8, 2.5)])
    model, state = make_cell(position, np.full(8, 0.5), (8.0, 5.0))
    engine, stress = flow(model, state, orders(("stress", 3.0), settings=SHARP), 2.0)
    impulse = engine.contacts().impulse
    np.testing.assert_allclose(impulse[:, 0], 3.0 * 5.0 * DT, rtol=1e-9)
    np.testing.assert_allclose(state.wall_position[0], (8.0, 5.0, 0.0), atol=1e-12)
    assert stress == pytest.approx([3.0, 0.0, 0.0], abs=1e-8)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_triangular_lattice_bears_an_isotropic_pressure(friction):
    """Its contacts bear P d/√3 in the mean: it has more of them than it needs."""
    model, state = lattice(8, 8, friction=friction)
    engine, stress = flow(model, state, orders(PRESSURE, PRESSURE, settings=SHARP), 4.0)
    table = engine.contacts()
    assert table.i.size == 3 * 64
    assert table.impulse[:, 0].mean() == pytest.approx(DT / np.sqrt(3.0), rel=1e-6)
    assert stress[:2] == pytest.approx([1.0, 1.0], abs=1e-6)


# ---- Motion that is known


def gas(count=30, speed=0.3, seed=4, **more):
    """Grains too small to meet, with velocities."""
    random = np.random.default_rng(seed)
    position = random.uniform(0.0, 20.0, (count, 2))
    model, state = make_cell(position, np.full(count, 1e-6), (20.0, 20.0), **more)
    state.velocity[:, :2] = speed * random.normal(size=(count, 2))
    return model, state


def distance_from(state, expected):
    """How far places are from where they should be, as nearest images."""
    width, height, tilt = state.wall_position[0]
    off = state.position[:, :2] - expected
    up = np.round(off[:, 1] / height)
    off -= up[:, None] * (tilt, height)
    off[:, 0] -= width * np.round(off[:, 0] / width)
    return np.abs(off).max()


def test_grains_that_meet_nothing_keep_their_velocity_in_simple_shear():
    """v = c + L r does not change: exact for any time step."""
    model, state = gas()
    velocity, start = state.velocity[:, :2].copy(), state.position[:, :2].copy()
    state.wall_velocity[0, 2] = 0.2
    state.velocity[:, :2] -= mean_flow(start, state.wall_velocity[0])
    flow(model, state, orders(None, None, ("velocity", 0.2)), 20.0, dt=0.4)
    assert distance_from(state, start + 20.0 * velocity) < 1e-12


def test_grains_that_meet_nothing_follow_their_cell():
    """ċ = −L c and ṙ = c + L r have a closed form; of second order in the time step."""
    rate, errors = np.array([0.02, -0.03, 0.05]), []
    gradient = np.array([[rate[0], rate[2]], [0.0, rate[1]]])
    grow = expm(5.0 * gradient)
    spread = grow @ np.linalg.solve(2.0 * gradient, np.eye(2) - expm(-10.0 * gradient))
    for dt in (0.2, 0.1, 0.05):
        model, state = gas()
        state.wall_velocity[0] = rate
        velocity, start = state.velocity[:, :2].copy(), state.position[:, :2].copy()
        flow(model, state, orders(*[("velocity", value) for value in rate]), 5.0, dt=dt)
        errors.append(distance_from(state, start @ grow.T + velocity @ spread.T))
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05)


def test_a_gas_pushes_its_cell_apart():
    """Without stress Σ ½ m c² turns into ½ M L², and their sum stays to rounding."""
    model, state = gas(inertia=1e12)
    before = 0.5 * (model.grains.mass[:, None] * state.velocity[:, :2] ** 2).sum()
    flow(model, state, orders(*[("stress", 0.0)] * 3), 20.0)
    grains = 0.5 * (model.grains.mass[:, None] * state.velocity[:, :2] ** 2).sum()
    cell = 0.5 * (model.walls.mass[0] * state.wall_velocity[0] ** 2).sum()
    assert cell > 0.05 * before
    assert grains + cell == pytest.approx(before, rel=1e-12)


@pytest.mark.parametrize("across", [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)])
@pytest.mark.parametrize("tilt", [0.0, 3.0])
def test_two_discs_meet_across_a_side_as_anywhere(across, tilt):
    """The same in the middle of the cell and over its corner: to rounding."""
    found = []
    for middle in ((10.0, 10.0), (0.0, 0.0)):
        at = np.array(middle) + np.outer([-0.53, 0.53], across)
        model, state = make_cell(
            at, np.full(2, 0.5), (20.0, 20.0), restitution=0.5, friction=0.3, tilt=tilt
        )
        wrap_cell(state.position, state.wall_position[0])
        state.velocity[:, :2] = np.outer([1.0, -1.0], across)
        state.velocity[0, 1] += 0.1
        flow(model, state, orders(settings=SHARP), 1.0)
        found.append(state.velocity)
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)
    along = found[0][:, :2] @ across
    assert along[1] - along[0] == pytest.approx(0.5 * (2.0 + 0.1 * across[1]), rel=1e-3)


# ---- Energy


@pytest.mark.parametrize(
    "order",
    [
        (PRESSURE, PRESSURE, None),
        (("velocity", 0.0), PRESSURE, ("velocity", 0.2)),
        (PRESSURE, ("stress", 1.5), ("stress", 0.3)),
        (("velocity", 0.01), ("velocity", -0.02), ("velocity", 0.3)),
    ],
)
@pytest.mark.parametrize(
    "laws",
    [{}, {"restitution": 0.7}, {"rolling": 0.2, "adhesion": 0.5},
     {"shapes": FACES}, {"shapes": FACES, "restitution": 0.5}, {"shapes": FACES, "adhesion": 0.5, "wet": True, "rolling": 0.2}],
)  # fmt: skip
def test_energy_is_accounted_for(order, laws):
    """Of cells that never jam: rigid grains in one that shrinks all the same have no solution."""
    model, state = loose_cell(80, solid_fraction=0.6, **laws)
    state.velocity[:, :2] = np.random.default_rng(2).normal(size=(80, 2))
    flow(model, state, orders(*order), 8.0)
    books = state.named("books")
    assert books["closure"] < 1e-12
    assert abs(books["load_work"]) + abs(books["wall_work"]) > 1.0
    assert books["friction_loss"] > 0.0


# ---- What does not matter


@pytest.mark.parametrize("laws", [{}, {"shapes": FACES, "friction": 0.0}])
def test_it_does_not_matter_where_the_sides_are(laws):
    """The same packing shifted, or told by other lattice vectors, flows alike.

    Of sides on sides friction is not unique: where round-off decides they are without.
    """
    model, state = compressed(200, **laws)
    shear = orders(("velocity", 0.0), PRESSURE, ("velocity", 0.1), SHARP)
    flow(model, state, shear, 3.0)
    found = []
    for shift, turns in (((0.0, 0.0), 0), ((4.3, 7.1), 0), ((0.0, 0.0), 1), ((-3.0, 2.0), 0)):
        other = copy_of(state)
        other.position[:, :2] += shift
        other.near_i = other.near_j = other.near_points = np.empty(0, np.int32)
        if turns:
            other.wall_position[0, 2] += other.wall_position[0, 0]
        else:
            wrap_cell(other.position, other.wall_position[0])
        flow(model, other, shear, 1.0)
        found.append((branches(model, other), other.wall_position, other.wall_velocity))
    for distances, sides, gradient in found[1:]:
        np.testing.assert_allclose(sides, found[0][1], atol=1e-8)
        np.testing.assert_allclose(gradient, found[0][2], atol=1e-8)
        near = np.hypot(*np.moveaxis(found[0][0], -1, 0)) < 4.0
        np.testing.assert_allclose(distances[near], found[0][0][near], atol=1e-8)


@pytest.mark.parametrize("shapes", [(), FACES])
def test_a_cell_that_has_been_tilted_back_goes_on_as_before(shapes):
    """Its tilt is kept within half of its width, without a trace in the flow."""
    model, state = compressed(100, shapes=shapes)
    shear = orders(("velocity", 0.0), PRESSURE, ("velocity", 0.5))
    tilts, way = [], 0.0
    engine = Engine(model, state, threads=1)
    engine.begin(shear)
    for k in range(200):
        engine.step(DT, k * DT)
        way += 0.5 * DT * state.wall_position[0, 1] / state.wall_position[0, 0]
        tilts.append(state.wall_position[0, 2] / state.wall_position[0, 0])
        if shapes and k % 20:
            continue
        assert smallest_outline_gap(model, state, relative=True) > -1.001e-3
    assert max(tilts) < 0.5
    assert min(tilts) >= -0.5
    assert (np.diff(tilts) < -0.9).sum() == round(way)
    assert way > 4.0
    # Of shapes, which begin far apart, rounding in the first steps is compared with hardly anything
    assert state.named("books")["closure"] < (1e-12 if shapes else 1e-13)


@pytest.mark.parametrize("shapes", [(), FACES])
@pytest.mark.parametrize("stop", [1, 17])
def test_a_state_goes_on_to_the_same_bits(stop, shapes):
    model, whole = compressed(150, duration=5.0, shapes=shapes)
    parts = copy_of(whole)
    order = orders(("velocity", 0.0), PRESSURE, ("velocity", 0.3))
    engine = Engine(model, whole, threads=1)
    engine.begin(order)
    for k in range(40):
        engine.step(DT, k * DT)
    first = Engine(model, parts, threads=1)
    first.begin(order)
    for k in range(stop):
        first.step(DT, k * DT)
    parts = copy_of(parts)
    second = Engine(model, parts, threads=1)
    second.resume(order)
    for k in range(stop, 40):
        second.step(DT, k * DT)
    assert parts.digest() == whole.digest()


@pytest.mark.parametrize("shapes", [(), FACES])
def test_threads_do_not_matter(shapes):
    digests = set()
    for threads in (1, 2):
        model, state = loose_cell(6000, solid_fraction=0.84, spread=0.1, shapes=shapes)
        engine, _ = flow(
            model, state, orders(PRESSURE, PRESSURE, ("velocity", 0.1)), 1.0, threads=threads
        )
        assert engine.contacts().i.size > 6000
        digests.add(state.digest())
    assert len(digests) == 1


def test_the_inertia_of_the_cell_does_not_matter():
    """The mean of a flow is that of any other inertia."""
    found = []
    for inertia in (0.1, 1.0, 10.0):
        model, state = compressed(150, inertia=inertia, duration=10.0)
        shear = orders(("velocity", 0.0), PRESSURE, ("velocity", 0.2))
        flow(model, state, shear, 10.0)
        _, stress = flow(model, state, shear, 60.0)
        found.append([stress[1], -stress[2], solid_fraction(model, state)])
    found = np.array(found)
    np.testing.assert_allclose(found[:, 0], 1.0, atol=0.01)
    np.testing.assert_allclose(found[:, 1], found[1, 1], atol=0.04)
    np.testing.assert_allclose(found[:, 2], found[1, 2], atol=0.02)


def test_overlaps_are_corrected_by_the_cell_where_a_stress_drives_it():
    """A chain that overlaps everywhere has no other way than a longer cell, as its mass allows."""
    position = np.column_stack([0.998 * np.arange(8.0), np.full(8, 2.5)])
    model, state = make_cell(position, np.full(8, 0.5), (8 * 0.998, 5.0))
    flow(model, state, orders(PRESSURE, PRESSURE), DT)
    overlap = 2.0 * (1.0 - state.wall_position[0, 0] / 8.0)
    assert overlap == pytest.approx(2.5e-4, rel=0.2)


# ---- Where there is nothing to compute


@pytest.mark.parametrize("dt", [0.5, 5.0])
def test_a_cell_that_strains_too_fast_is_refused(dt):
    """By more than itself in a step; lists of what is near would reach to anywhere."""
    model, state = loose_cell(30)
    with pytest.raises(PhysicsError, match="strains by as much as its size in a step"):
        flow(model, state, orders(("stress", 1e3), ("stress", 1e3)), 200.0 * dt, dt=dt)


@pytest.mark.parametrize("drive", [("velocity", -1.0), ("stress", 0.3)])
def test_a_cell_that_nothing_holds_is_refused_before_grains_meet_their_images(drive):
    model, state = make_cell([[1.0, 1.0], [5.0, 4.0]], [0.4, 0.6], (8.0, 8.0))
    with pytest.raises(
        PhysicsError, match=r"the cell would be .* where the largest grain is 1\.2 m"
    ):
        flow(model, state, orders(drive, drive), 500.0 * DT)
    assert state.wall_position[0, :2].min() >= 2.4
