"""Grains in flight: impacts one after the other, against an event-driven program of its own."""

import numpy as np
import pytest
from benchmark_modules import benchmark_modules
from scene_parts import FLOOR, TIGHT, advance, book, continued, make_engine, make_model

from multicor_cli.engine.contact.meetings import Air, discs_meet_soon, meets
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.motion.drives import Constant, DofDrive, Sine, WallDrive
from multicor_cli.model import ShapeKind

G = 9.81


@pytest.fixture(scope="module")
def gases():
    with benchmark_modules("gases") as modules:
        yield modules.cases


@pytest.mark.parametrize("way", [0.3, 0.1, 0.03])
@pytest.mark.parametrize(
    ("restitution", "friction", "fraction"),
    [(1.0, 0.0, 0.4), (0.95, 0.0, 0.4), (0.8, 0.3, 0.4), (0.5, 0.3, 0.25), (0.9, 0.5, 0.5)],
)
def test_gases_lose_what_their_impacts_lose(gases, restitution, friction, fraction, way):
    """Some five impacts of each disc; later on rounding alone leads to other impacts."""
    gas = gases.Gas(100, fraction, restitution, friction, seed=7)
    duration = 2.5e-3
    right, impacts = gases.energy_of_reference(gas, duration)
    assert impacts > 30
    assert gases.energy_of_multicor(gas, duration, way)[0] == pytest.approx(right, rel=1e-9)


@pytest.mark.parametrize("period", [0.0, 3.0])
def test_whether_two_meet_is_when_they_do(period):
    """The test without branches and the time of the event, for pairs apart, at touch and deep in
    each other, near and across the period."""
    rng = np.random.default_rng(3)
    nothing, ends = np.empty(0, np.int32), []
    for _ in range(3000):
        place, bodies = rng.uniform(0.0, 3.0, (2, 3)), rng.normal(size=(2, 4))
        scene = Scene(
            place, rng.uniform(0.1, 0.6, 2), np.zeros(2, np.int32), nothing, nothing,
            np.empty((0, 4)), np.empty((0, 3)), period,
        )  # fmt: skip
        air = Air(scene, np.zeros(3), None, None, None, 1.0, place, bodies, np.ones(2, np.bool_))
        end = float(rng.choice([0.02, 0.3, 2.0]))
        soon = discs_meet_soon(air, 0, 1, end)
        assert soon == (meets(air, 0, 1, 0.0, end) < np.inf)
        ends.append(soon)
    assert 300 < sum(ends) < 2700


def chest(side, **laws):
    """Discs that are thrown about in a box under gravity."""
    rng = np.random.default_rng(5)
    radius = rng.uniform(0.03, 0.05, 36)
    places = np.array([[0.12 * (k % 6 + 1), 0.12 * (k // 6 + 1)] for k in range(36)])
    velocities = np.column_stack([rng.normal(size=(36, 2)), rng.normal(size=36)])
    planes = [(0.0, 0.0, 0.0, 1.0), (side, 0.0, -1.0, 0.0), (0.0, 0.0, 1.0, 0.0)]
    shapes = [(ShapeKind.PLANE, 0, plane) for plane in planes]
    return make_engine(make_model(radius, shapes, **laws), places, velocities)


def energy(engine):
    grains, (u, v, spin) = engine.model.grains, engine.state.velocity.T
    height = engine.state.position[:, 1]
    kinetic = 0.5 * grains.mass * (u * u + v * v) + 0.5 * grains.inertia * spin * spin
    return (kinetic + grains.mass * G * height).sum()


@pytest.mark.parametrize("dt", [8e-3, 2e-3])
def test_elastic_discs_under_gravity_never_rest(dt):
    engine = chest(0.84, friction=0.0, restitution=1.0)
    before = energy(engine)
    advance(engine, dt, round(5.0 / dt))
    assert energy(engine) == pytest.approx(before, rel=1e-10)
    assert book(engine.state, "closure") < 1e-12


@pytest.mark.parametrize("restitution", [0.9, 0.5])
def test_a_ball_rises_to_what_restitution_leaves(restitution):
    """Heights e²h, e⁴h, e⁶h at any step, wherever in it the impacts are."""
    for dt in np.geomspace(6e-4, 3e-3, 8):
        engine = make_engine(make_model([0.05], FLOOR, restitution=restitution), [[0.0, 1.05]])
        heights, fastest, t = [], np.sqrt(2.0 * G), np.sqrt(2.0 / G)
        for bounce in range(1, 4):
            rebound = fastest * restitution**bounce
            top = t + rebound / G
            while engine.state.time < top - dt:
                engine.step(dt, engine.state.time)
            # A parabola: how high it is at its top
            state = engine.state
            height = state.position[0, 1] - 0.05 + state.velocity[0, 1] ** 2 / (2.0 * G)
            heights.append(height)
            t += 2.0 * rebound / G
        assert heights == pytest.approx([restitution ** (2 * k) for k in (1, 2, 3)], rel=1e-9)


@pytest.mark.parametrize("dt", [1e-2, 2.5e-3])
def test_what_rests_far_away_changes_no_flight(dt):
    """Balls that bounce and pairs that meet high above the floor, with a disc on it in the solve."""
    rng = np.random.default_rng(1)
    balls = np.column_stack([3.0 * np.arange(20.0), rng.uniform(0.3, 2.0, 20)])
    first = np.column_stack([100.0 + 3.0 * np.arange(20.0), rng.uniform(20.0, 30.0, 20)])
    way = rng.normal(size=(20, 2))
    way *= rng.uniform(0.22, 0.4, (20, 1)) / np.hypot(*way.T)[:, None]
    places = np.concatenate([balls, first, first + way, [[-10.0, 0.1]]])
    velocities = np.zeros((61, 3))
    velocities[20:40, :2], velocities[40:60, :2] = 3.0 * way, -2.0 * way
    ends = []
    for count in (60, 61):
        model = make_model(np.full(count, 0.1), FLOOR, friction=0.3, restitution=0.9)
        engine = make_engine(model, places[:count], velocities[:count])
        ends.append(advance(engine, dt, round(1.0 / dt)).position[:60])
    assert (ends[0] == ends[1]).all()
    ways = ends[0][20:60, :2] - places[20:60] - velocities[20:60, :2]
    assert (np.abs(ways[:, 0]) > 1e-2).all()  # all pairs have met


def test_a_stack_without_losses_keeps_what_hits_it():
    """Two discs that stand on each other, and one that is dropped on them: twenty impacts."""
    places = [[0.5, 0.01], [0.5, 0.03], [0.5, 0.3]]
    model = make_model([0.01] * 3, FLOOR, friction=0.0, restitution=1.0)
    engine = make_engine(model, places)
    before = energy(engine)
    state = advance(engine, 1e-3, 10_000)
    assert energy(engine) - before == pytest.approx(0.0, abs=1e-3 * model.grains.mass[0] * G * 0.25)
    assert state.position[2, 1] < 0.301


@pytest.mark.parametrize("shape", ["circle", "disc", "line", "turning line"])
def test_walls_of_all_kinds_give_back_what_they_get(shape):
    """Without friction and losses: speeds against a wall that stands, or the books of one that
    turns; in a circle the angular momentum about its center too."""
    line = [
        (ShapeKind.SEGMENT, 0, (-3.0, 0.0, 3.0, 0.0)),
        (ShapeKind.VERTEX, 0, (-3.0, 0.0, -1.0, 0.0)),
        (ShapeKind.VERTEX, 0, (3.0, 0.0, 0.0, -1.0)),
    ]
    inner = [(ShapeKind.DISC, 0, (0.0, 0.0, 1.0, 0.0))] if shape == "disc" else []
    inner = line if "line" in shape else inner
    around = [(ShapeKind.CIRCLE, 1, (0.0, 0.0, 4.0, 0.0))]
    model = make_model(
        [0.2, 0.3], inner + around, ("inner", "outer"), friction=0.0, restitution=1.0,
        gravity=(0.0, 0.0),
    )  # fmt: skip
    turning = WallDrive(spin=DofDrive(velocity=Constant(0.7)))
    drives = [turning if shape == "turning line" else WallDrive(), WallDrive()]
    places, velocities = [[-2.0, 1.5], [2.0, -1.4]], [[0.9, 0.4, 0.0], [-0.3, 1.1, 0.0]]
    engine = make_engine(model, places, velocities, drives=drives)
    mass = model.grains.mass

    def turning_of(state):
        (x, y), (u, v) = state.position[:, :2].T, state.velocity[:, :2].T
        return (mass * (x * v - y * u)).sum()

    kinetic, around_center = book(engine.state, "kinetic"), turning_of(engine.state)
    state = advance(engine, 0.05, 2000)
    kinetic = 0.5 * (mass * (np.array(velocities)[:, :2] ** 2).sum(axis=1)).sum()
    assert book(state, "closure") < 1e-12
    assert book(state, "impact_loss") == pytest.approx(0.0, abs=1e-11 * kinetic)
    if shape != "turning line":
        assert book(state, "kinetic") == pytest.approx(kinetic, rel=1e-10)
    if shape in ("circle", "disc"):
        assert turning_of(state) == pytest.approx(around_center, rel=1e-9)


def test_a_wall_that_comes_gives_twice_its_speed():
    """u⁺ − V = −(u⁻ − V) with the mean velocity V of a wall in the step; a piston does work."""
    planes = [(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0))]
    model = make_model([0.1], planes, restitution=1.0, gravity=(0.0, 0.0))
    drives = [WallDrive(y=DofDrive(velocity=Constant(0.5)))]
    engine = make_engine(model, [[0.0, 1.0]], [[0.0, -2.0, 0.0]], drives=drives)
    state = advance(engine, 0.03, 40)
    assert state.velocity[0, 1] == pytest.approx(3.0, rel=1e-12)
    assert book(state, "wall_work") == pytest.approx(0.5 * model.grains.mass[0] * 5.0, rel=1e-12)


def shaken(**laws):
    """Discs on a floor that goes up and down: flights, landings, and what lies there."""
    rng = np.random.default_rng(2)
    k = np.arange(60)
    radius = rng.uniform(0.3, 0.45, 60)
    model = make_model(radius, FLOOR, period=10.0, gravity=(0.0, -10.0), **laws)
    places = np.column_stack([k % 10 + 0.5 + 0.02 * rng.random(60), 0.47 + 0.95 * (k // 10)])
    drives = [WallDrive(y=DofDrive(velocity=Sine(0.0, 3.0, 1.0)))]
    return make_engine(model, places, drives=drives)


@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_flights_among_grains_that_rest(restitution):
    """Books close, a stop changes no bit, and grains stay apart."""
    engine = shaken(restitution=restitution, friction=0.4)
    advance(engine, 0.01, 150)
    other = continued(engine)
    advance(engine, 0.01, 50, 150)
    advance(other, 0.01, 50, 150)
    assert engine.state.digest() == other.state.digest()
    assert book(engine.state, "closure") < 1e-11
    x, radius = engine.state.position[:, :2], engine.model.grains.radius
    apart = x[:, None] - x[None]
    apart[..., 0] -= 10.0 * np.round(apart[..., 0] / 10.0)
    gap = np.hypot(*apart.transpose(2, 0, 1)) - radius - radius[:, None] + 10.0 * np.eye(60)
    assert (gap >= -1e-3 * np.minimum(radius, radius[:, None])).all()


@pytest.mark.parametrize("gap", np.linspace(9.6, 14.0, 12))
def test_what_has_flown_passes_nothing_where_it_flies_no_more(gap):
    """A fast disc meets a slow one just after a step, in the next of which that meets a third, with
    e = 0, and flies no more: at mid-step the first would already be on its other side."""
    model = make_model([0.5] * 3, walls=(), friction=0.0, gravity=(0.0, 0.0))
    two = {"restitution": np.array([[0.5, 0.0], [0.0, 0.5]]), "friction": np.zeros((2, 2))}
    laws = model.laws._replace(table=np.full((2, 2), -1, np.int32), **two)
    object.__setattr__(model.grains, "material", np.array([0, 0, 1], np.int32))
    object.__setattr__(model, "laws", laws)
    places = [[0.0, 0.0], [1.0 + gap, 0.0], [1.0 + gap, 2.0]]
    engine = make_engine(model, places, [[10.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, -0.5, 0.0]])
    for _ in range(4):
        x = advance(engine, 1.0, 1).position[:, 0]
        assert x[0] < x[1]


def test_impacts_are_contacts_of_their_step():
    """What tables, maps and heat see: impulse, normal at the touch, and the loss."""
    model = make_model([0.5, 0.5], walls=(), restitution=0.5, friction=0.2, gravity=(0.0, 0.0),
                       density=4.0 / np.pi)  # fmt: skip
    engine = make_engine(
        model, [[1.03, 0.0], [0.0, 0.0]], [[-1.0, 0.3, 0.0], [0.0, 0.0, 0.0]], settings=TIGHT
    )
    state = advance(engine, 0.1, 1)
    contact = engine.contacts()
    assert contact.i.tolist() == [0]
    assert contact.normal[0] == pytest.approx([1.0, 0.009], abs=1e-3)
    assert np.hypot(*contact.normal[0]) == pytest.approx(1.0, rel=1e-12)
    impulse = contact.impulse[0, 0] * contact.normal[0]
    impulse += contact.impulse[0, 1] * np.array([-contact.normal[0, 1], contact.normal[0, 0]])
    assert impulse == pytest.approx(state.velocity[0, :2] - [-1.0, 0.3], rel=1e-12)
    assert contact.gap[0] == 0.0
    assert state.contact_i.size == 0  # nothing that a next step would begin with
