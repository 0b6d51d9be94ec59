"""Adhesion, dry and by bridges of liquid, against closed forms (theory §3.1): its force, its work,
what it holds, at time steps over a factor of 30; bridges in states, on threads and on walls."""

from dataclasses import replace

import numpy as np
import pytest
from scene_parts import (
    FLOOR,
    TIGHT,
    G,
    advance,
    book,
    make_engine,
    make_model,
    resume,
    shear_engine,
    tally,
)
from shapes import box, shaped_engine, shaped_model, wall_line

from multicor_cli.engine.contact.adhesion import share_of_force
from multicor_cli.engine.motion.drives import Constant, DofDrive, Gravity, WallDrive
from multicor_cli.model import ShapeKind
from multicor_cli.model.model import RANGE

CEILING = [(ShapeKind.PLANE, 0, (0.0, 1.0, 0.0, -1.0))]
SIDE = [(ShapeKind.PLANE, 0, (0.0, 0.0, 1.0, 0.0))]
STEPS = [1e-3, 3e-4, 1e-4, 3e-5]
FORCE, REACH = 5.0, 0.01
KINDS = {"dry": 0.5 * FORCE * REACH, "wet": FORCE * REACH}
"""What it costs to part a pair [J]."""


def work(state):
    """Work of adhesion on the motion since the start [J]."""
    return float(state.adhesion_books[0])


def pair(kind, velocity, apart=0.0, **keys):
    """Two equal discs without weight, whose centers lie on the x axis; the second one moves."""
    given = {"gravity": (0.0, 0.0), "walls": (), "adhesion": FORCE, "reach": REACH, **keys}
    model = make_model([0.1, 0.1], wet=kind == "wet", **given)
    return make_engine(model, [[0.0, 0.0], [0.2 + apart, 0.0]], [[0.0] * 3, [velocity, 0.0, 0.0]])


def gap_of(state):
    """Gap of two discs of radius 0.1."""
    return float(np.hypot(*(state.position[1, :2] - state.position[0, :2]))) - 0.2


# ---- The force


@pytest.mark.parametrize("is_wet", [False, True])
@pytest.mark.parametrize(
    ("first", "last"),
    [(-0.3, 1.7), (1.4, 0.2), (0.2, 0.9), (-2.0, -1.0), (1.1, 3.0), (0.7, 0.7), (0.3, 0.3 + 1e-8)],
)
def test_the_mean_of_the_force_is_that_over_the_way(first, last, is_wet):
    """Against the sum over a million points."""
    gap = np.linspace(first, last, 1_000_001) * REACH
    force = np.where(gap < REACH, 1.0 if is_wet else 1.0 - np.maximum(gap, 0.0) / REACH, 0.0)
    mean = np.trapezoid(force) / (gap.size - 1)
    assert share_of_force(first * REACH, last * REACH, REACH, is_wet) == pytest.approx(
        mean, abs=2e-6
    )


# ---- What it costs to part, and what holds


@pytest.mark.parametrize("speed", [1.2, 2.0])
@pytest.mark.parametrize("kind", KINDS)
def test_parting_two_grains_costs_the_area_under_the_force(kind, speed):
    """Two equal grains lose W of their relative energy ½ (m/2) u², in books that close, with an
    error of second order."""
    reduced = 0.5 * pair(kind, 0.0).model.grains.mass[0]
    start = speed * np.sqrt(2.0 * KINDS[kind] / reduced)
    errors = []
    for dt in STEPS:
        state = advance(pair(kind, start), dt, round(0.03 / dt))
        assert gap_of(state) > REACH
        apart = state.velocity[1, 0] - state.velocity[0, 0]
        assert 0.5 * reduced * (start**2 - apart**2) == pytest.approx(-work(state), rel=1e-9)
        assert book(state, "closure") < 1e-12
        assert book(state, "impact_loss") == 0.0
        assert state.bridge_i.size == 0
        errors.append(abs(-work(state) / KINDS[kind] - 1.0))
    assert errors[1] < 0.01  # Δt = 0.04 √(2 m ℓ/F_a)
    assert errors[-1] < 2e-4


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_too_slow_to_part_comes_back(kind, dt):
    """With 0.9 of the speed that parts: on the way back adhesion gives what it has taken, which is
    lost where they meet."""
    reduced = 0.5 * pair(kind, 0.0).model.grains.mass[0]
    start = 0.9 * np.sqrt(2.0 * KINDS[kind] / reduced)
    engine = pair(kind, start)
    farthest = max(gap_of(advance(engine, dt, 1, k)) for k in range(round(0.06 / dt)))
    # ½ (m/2) u² = W(g): F_a g, or F_a (g − g²/2ℓ)
    share = 0.81 if kind == "wet" else 1.0 - np.sqrt(0.19)
    assert farthest == pytest.approx(share * REACH, rel=0.1 if dt > 3e-4 else 0.03)
    state = engine.state
    assert abs(gap_of(state)) < 1e-9
    assert state.velocity[1, 0] - state.velocity[0, 0] == pytest.approx(0.0, abs=1e-9)
    lost = 0.5 * reduced * start**2
    assert book(state, "impact_loss") == pytest.approx(lost + work(state), rel=1e-9)
    assert abs(work(state)) < (0.03 if dt > 3e-4 else 0.01) * lost
    assert book(state, "closure") < 1e-12


def test_dry_grains_attract_each_other_within_the_range_and_wet_ones_after_touch():
    """At rest at half of the range; and as far as the range nothing acts."""
    dt = 1e-4
    dry, wet, far = (
        pair(kind, 0.0, apart) for kind, apart in (("dry", 0.5), ("wet", 0.5), ("dry", 1.001))
    )
    for engine, apart in ((dry, 0.5), (wet, 0.5), (far, 1.001)):
        engine.state.position[1, 0] = 0.2 + apart * REACH
        advance(engine, dt, 600)
    assert not wet.state.velocity.any()
    assert not far.state.velocity.any()
    assert abs(gap_of(dry.state)) < 1e-9
    # F_a (g − g²/2ℓ), all of which is lost at the touch
    assert work(dry.state) == pytest.approx(FORCE * REACH * (0.5 - 0.125), rel=2e-3)
    assert book(dry.state, "impact_loss") == pytest.approx(work(dry.state), rel=1e-9)
    engine = pair("wet", -0.05, 0.5 * REACH)  # touches, and holds then
    advance(engine, dt, 1100)
    assert engine.state.bridge_i.tolist() == [0]
    engine.state.velocity[1, 0] += 0.5  # too slow to part
    advance(engine, dt, 10)
    assert 0.0 < gap_of(engine.state) < REACH
    tension = engine.contacts().impulse[0, 0] / dt
    assert tension == pytest.approx(-FORCE, rel=1e-12)
    assert engine.contacts().carrying().i.size == 1
    advance(engine, dt, 500)
    assert abs(gap_of(engine.state)) < 1e-9


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_disc_leaves_a_ceiling_against_adhesion_below_its_weight(kind, dt):
    """F_a = 0.9 m g. Wet: ½ · 0.1 g t² as far as the range. Dry: m x″ = m g − F_a (1 − x/ℓ), a
    hyperbolic cosine. Beyond, a free fall; in all, ½ m v² = m g x − W."""
    weight = make_model([0.1], CEILING).grains.mass[0] * G
    force, mass = 0.9 * weight, weight / G
    model = make_model([0.1], CEILING, adhesion=force, reach=REACH, wet=kind == "wet")
    engine = make_engine(model, [[0.0, 0.9]], settings=TIGHT)
    rate = np.sqrt(force / (mass * REACH))
    span = np.arccosh(1.0 + force / (weight - force)) / rate
    if kind == "wet":
        span = np.sqrt(2.0 * REACH / (0.1 * G))
    early = round(0.6 * span / dt)
    time = early * dt
    down = 0.9 - advance(engine, dt, early).position[0, 1]
    expected = (weight / force - 1.0) * REACH * (np.cosh(rate * time) - 1.0)
    if kind == "wet":
        expected = 0.5 * 0.1 * G * time * time
    assert down == pytest.approx(expected, rel=0.2 * rate * dt)
    state = advance(engine, dt, round(1.2 * span / dt), early)
    down, paid = 0.9 - state.position[0, 1], KINDS[kind] / FORCE * force
    assert down > REACH
    assert work(state) == pytest.approx(-paid, rel=0.1 * rate * dt)
    fall = np.sqrt(2.0 * (weight * down - paid) / mass)
    assert state.velocity[0, 1] == pytest.approx(-fall, rel=0.1 * rate * dt)
    assert book(state, "closure") < 1e-12


def _strength(engine_of, force, dt, steps):
    """Largest of some pulls, over a force, that holds for a time."""
    held = 0.0
    for factor in (0.97, 0.99, 1.01, 1.03):
        engine = engine_of(factor * force)
        advance(engine, dt, steps)
        if np.abs(engine.state.velocity[:, :2]).max() > 1e-6:
            return held
        held = factor
    return held


@pytest.mark.parametrize("dt", [3e-3, 1e-3, 1e-4])
@pytest.mark.parametrize("kind", KINDS)
def test_a_chain_bears_the_adhesion_of_its_weakest_contact(kind, dt):
    """Five discs between a ceiling that glues and a plate that pulls, F_a = 2 N."""
    planes = [*CEILING, (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, 1.0))]
    places = [[0.0, 0.9 - 0.2 * k] for k in range(5)]
    model = make_model(
        [0.1] * 5, planes, ("ceiling", "plate"), gravity=(0.0, 0.0), mass=0.5, adhesion=2.0
    )
    model = _glued(model, np.zeros(5, np.int32), [1, 1], strong=10.0, weak=2.0, kind=kind)

    def engine_of(pull):
        drives = [WallDrive(), WallDrive(y=DofDrive(force=Constant(-pull)))]
        return make_engine(model, places, settings=TIGHT, drives=drives)

    assert _strength(engine_of, 2.0, dt, 30) == 0.99


@pytest.mark.parametrize("dt", [3e-3, 1e-3])
@pytest.mark.parametrize("kind", KINDS)
def test_a_triangular_packing_bears_what_its_rows_do(kind, dt):
    """Between plates that glue, each disc hangs from two of the row above, at 30° from the pull:
    2 cos 30° F_a for each disc of a row."""
    columns, rows = 6, 4
    step = 0.2 * np.sqrt(3.0) / 2.0
    places = [
        [0.2 * (c + 0.5 * (r % 2)) + 0.05, 0.1 + r * step]
        for r in range(rows)
        for c in range(columns)
    ]
    top = 0.2 + (rows - 1) * step
    planes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0))]
    model = make_model(
        [0.1] * len(places), planes, ("floor", "lid"), gravity=(0.0, 0.0), mass=0.5, adhesion=2.0,
        period=0.2 * columns,
    )  # fmt: skip
    material = np.zeros(len(places), np.int32)
    model = _glued(model, material, [1, 1], strong=30.0, weak=2.0, kind=kind)

    def engine_of(pull):
        drives = [WallDrive(), WallDrive(y=DofDrive(force=Constant(pull)))]
        engine = make_engine(model, places, settings=TIGHT, drives=drives)
        engine.state.wall_position[1, 1] = top
        return engine

    force = columns * 2.0 * np.cos(np.pi / 6.0) * 2.0
    assert _strength(engine_of, force, dt, 30) == 0.99


def _glued(model, of_grains, of_shapes, *, strong, weak, kind):
    """Two materials: grains of the first hold each other weakly, and the second one strongly."""
    object.__setattr__(model.grains, "material", of_grains)
    object.__setattr__(model.shapes, "material", np.array(of_shapes, np.int32))
    object.__setattr__(model, "laws", _laws_of_two(weak, strong, kind))
    return model


def _laws_of_two(within, between, kind="dry"):
    """Adhesion within the first of two materials, and between the two."""
    plain, two = make_model([1.0]).laws, np.full((2, 2), 0.5)
    return plain._replace(
        friction=two, restitution=0.0 * two, table=np.full((2, 2), -1, np.int32),
        adhesion=np.array([[within, between], [between, 0.0]]), adhesion_range=0.02 * two,
        is_wet=np.full((2, 2), kind == "wet", np.uint8),
    )  # fmt: skip


def test_two_discs_come_apart_in_the_first_step_in_which_the_pull_exceeds_adhesion():
    """The upper disc sticks to the ceiling; the weight of the lower one rises by m δ per step and
    parts them at m g > F_a."""
    model = make_model([0.1, 0.15], CEILING, gravity=(0.0, 0.0))
    mass, rise, last = model.grains.mass[1], 0.1, 37
    object.__setattr__(model.grains, "material", np.array([0, 1], np.int32))
    object.__setattr__(model, "laws", _laws_of_two(1e3 * mass, (last + 0.5) * rise * mass))
    engine = make_engine(model, [[0.0, 0.9], [0.0, 0.65]], settings=TIGHT)
    for k in range(60):
        resume(engine, gravity=Gravity.constant(np.array([0.0, -k * rise])))
        engine.step(1e-3, k * 1e-3)
        assert (abs(engine.state.velocity[1, 1]) < 1e-12) == (k <= last)
        assert abs(engine.state.velocity[0, 1]) < 1e-12


@pytest.mark.parametrize("settings", [TIGHT, None])
@pytest.mark.parametrize("kind", KINDS)
def test_a_disc_hangs_from_a_ceiling_by_an_adhesion_above_its_weight(kind, settings):
    weight, dt = make_model([0.1], CEILING).grains.mass[0] * G, 1e-3
    held = make_model([0.1], CEILING, adhesion=1.01 * weight, reach=REACH, wet=kind == "wet")
    engine = make_engine(held, [[0.0, 0.9]], settings=settings)
    state = advance(engine, dt, 300)
    assert state.position[0, 1] == pytest.approx(0.9, abs=1e-12)
    # tension, by the sign of p_n
    assert engine.contacts().impulse[0] == pytest.approx([-weight * dt, 0.0], rel=1e-9)


@pytest.mark.parametrize(("factor", "rolls"), [(1.01, True), (0.99, False)])
def test_adhesion_widens_the_cone_of_friction(factor, rolls):
    """A disc on an upright wall, p_n = 0: rolls down with g β/(1 + β) if μ F_a ≥ m g/(1 + β),
    slides with g − μ F_a/m below."""
    mass = make_model([0.1]).grains.mass[0]
    adhesion, friction = 7.0 * mass * G, factor / 21.0
    model = make_model([0.1], SIDE, friction=friction, adhesion=adhesion)
    state = advance(make_engine(model, [[0.1, 0.0]], settings=TIGHT), 1e-3, 100)
    expected = G * 2.0 / 3.0 if rolls else G - friction * adhesion / mass
    assert state.velocity[0, 1] == pytest.approx(-0.1 * expected, rel=1e-9)
    assert (abs(state.velocity[0, 1] - 0.1 * state.velocity[0, 2]) < 1e-10) == rolls
    assert book(state, "closure") < 1e-12


@pytest.mark.parametrize(("factor", "holds"), [(0.99, True), (1.01, False)])
def test_a_loaded_plate_is_held_up_to_its_adhesion(factor, holds):
    """A plate that a force pulls off a disc, which sticks to the floor: contacts of a body with a
    driven degree of freedom."""
    planes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.2, 0.0, -1.0))]
    model = make_model(
        [0.1], planes, ("floor", "plate"), gravity=(0.0, 0.0), mass=0.5, adhesion=3.0
    )
    drives = [WallDrive(), WallDrive(y=DofDrive(force=Constant(factor * 3.0)))]
    engine = make_engine(model, [[0.0, 0.1]], settings=TIGHT, drives=drives)
    state = advance(engine, 1e-3, 50)
    assert (abs(state.wall_velocity[1, 1]) < 1e-12) == holds
    # at rest there is nothing but rounding to compare
    assert holds or book(state, "closure") < 1e-12


def test_touching_bodies_at_rest_stay_and_remember_their_contact():
    """Without weight or load: what is at rest together stays together, and is stretched by
    nothing."""
    model = make_model([0.1, 0.1], gravity=(0.0, 0.0), walls=(), adhesion=5.0)
    engine = make_engine(model, [[0.0, 0.0], [0.2, 0.0]])
    state = advance(engine, 1e-3, 50)
    assert np.abs(state.velocity).max() < 1e-12
    assert state.contact_impulse[0] == pytest.approx([5e-3, 0.0])  # F_a Δt on top of p = 0
    assert abs(engine.contacts().impulse[0, 0]) < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_a_rebound_pays_for_its_parting(kind):
    """½ m v² = ½ m (e u)² − W, u² = u₀² + 2 W/m where dry grains are drawn to the floor before;
    to first order in Δt, as impacts count for their step."""
    for dt in (1e-4, 1e-5):
        model = make_model(
            [0.1], FLOOR, gravity=(0.0, 0.0), restitution=0.5, adhesion=2.0, reach=REACH,
            wet=kind == "wet",
        )  # fmt: skip
        state = advance(
            make_engine(model, [[0.0, 0.115]], [[0.0, -4.0, 0.0]]), dt, round(0.02 / dt)
        )
        mass, paid = model.grains.mass[0], 2.0 * REACH * (1.0 if kind == "wet" else 0.5)
        drawn = paid if kind == "dry" else 0.0
        left = 0.25 * (16.0 + 2.0 * drawn / mass) - 2.0 * paid / mass
        assert state.velocity[0, 1] == pytest.approx(np.sqrt(left), rel=200.0 * dt)
        assert book(state, "closure") < 1e-12


def test_laws_without_a_range_have_a_hundredth_of_the_mean_diameter():
    """As runs of older file formats, which count the work among the losses to impacts."""
    for reach in (None, RANGE * 0.2):
        engine = pair("dry", 1.2, 0.0, reach=reach)
        state = advance(engine, 1e-4, 300)
        loss = book(state, "impact_loss") if reach is None else -work(state)
        assert loss == pytest.approx(0.5 * FORCE * RANGE * 0.2, rel=2e-3)
        assert book(state, "closure") < 1e-12


# ---- In flows


@pytest.mark.parametrize("kind", KINDS)
def test_work_of_adhesion_is_in_the_books_of_a_flow(kind):
    """Plane shear with F_a ten times the load of a grain: tension exists, also across gaps, books
    close, and every step converges."""
    engine = shear_engine(adhesion=10.0, reach=0.02, wet=kind == "wet")
    state = advance(engine, 0.02, 200)
    table = engine.contacts()
    forces = table.impulse[:, 0]
    assert forces.min() < 0.0 < forces.max()
    assert forces.min() >= -10.0 * 0.02 * (1.0 + 1e-12)
    assert (forces[table.gap > 1e-3] < 0.0).any()
    assert book(state, "closure") < 1e-12
    assert tally(state, "unconverged_steps") == 0


# ---- Points of grains that are no discs

SQUARE = [(box(0.2, 0.2), 0.0)]


@pytest.mark.parametrize("factor", [0.98, 1.02])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("joints", [None, 0, 1, 4])
def test_a_side_holds_at_both_ends(joints, kind, factor):
    """A square below a ceiling bears 2 F_a, wherever that is put together."""
    ceiling = CEILING
    if joints is not None:
        x = [2.0, *np.linspace(0.1, -0.05, joints), -2.0]
        ceiling = wall_line(np.column_stack([x, np.ones(len(x))]))
    model = shaped_model(
        [SQUARE], ceiling, ("ceiling",), adhesion=1.0, reach=REACH, wet=kind == "wet"
    )
    load = factor * 2.0 / model.grains.mass[0]
    model = replace(model, gravity=np.array([0.0, -load]))
    high = 0.9
    state = advance(shaped_engine(model, [[0.03, high]]), 4e-4, 500)
    assert (state.position[0, 1] < high - REACH) == (factor > 1.0)
    assert book(state, "closure") < 1e-12


@pytest.mark.parametrize("factor", [0.98, 1.02])
@pytest.mark.parametrize("beyond", [2.0, 20.0, 500.0])
def test_a_side_holds_at_the_edge_of_a_ledge(beyond, factor):
    """At its corner and at the edge, wherever the ceiling goes on beyond the range."""
    reach = 0.1 * REACH
    ceiling = wall_line(
        [[2.0, 1.0 + beyond * reach], [0.0, 1.0 + beyond * reach], [0.0, 1.0], [-2.0, 1.0]]
    )
    model = shaped_model([SQUARE], ceiling, ("ceiling",), adhesion=1.0, reach=reach)
    load = factor * 1.5 / model.grains.mass[0]  # two thirds of it at the edge
    model = replace(model, gravity=np.array([0.0, -load]))
    state = advance(shaped_engine(model, [[-0.05, 0.9]]), 4e-4, 300)
    assert (state.position[0, 1] < 0.9 - reach) == (factor > 1.0)


@pytest.mark.parametrize("factor", [0.98, 1.02])
@pytest.mark.parametrize("is_line", [False, True])
def test_a_wall_beside_a_side_takes_nothing_of_what_holds_it(is_line, factor):
    """A square that touches a wall with its side bears 2 F_a below a ceiling, too."""
    shapes = [*CEILING, (ShapeKind.PLANE, 1, (-0.1, 0.0, 1.0, 0.0))]
    walls = ("ceiling", "wall")
    if is_line:
        shapes, walls = wall_line([[2.0, 1.0], [-0.1, 1.0], [-0.1, -2.0]]), ("both",)
    model = shaped_model([SQUARE], shapes, walls, adhesion=1.0, reach=REACH, friction=0.0)
    load = factor * 2.0 / model.grains.mass[0]
    model = replace(model, gravity=np.array([0.0, -load]))
    state = advance(shaped_engine(model, [[0.0, 0.9]]), 4e-4, 300)
    assert (state.position[0, 1] < 0.9 - REACH) == (factor > 1.0)


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_bracket_tips_off_a_wall_when_its_weight_exceeds_the_upper_point(factor):
    """Around its lower corner: m g b/2 against F_a h."""
    width, height = 0.3, 0.2
    model = shaped_model(
        [[(box(width, height), 0.0)]], SIDE, friction=100.0, adhesion=1.0, reach=REACH
    )
    weight = factor * 2.0 * height / width
    model = replace(model, gravity=np.array([0.0, -weight / model.grains.mass[0]]))
    state = advance(shaped_engine(model, [[0.5 * width, 0.0]]), 1e-4, 3000)
    assert (abs(state.position[0, 2]) > REACH / height) == (factor > 1.0)


@pytest.mark.parametrize("kind", KINDS)
def test_parting_two_sides_costs_twice_what_parting_two_discs_does(kind):
    model = shaped_model(
        [SQUARE, SQUARE], (), (), gravity=(0.0, 0.0), adhesion=FORCE, reach=REACH, wet=kind == "wet"
    )
    reduced = 0.5 * model.grains.mass[0]
    start = 1.2 * np.sqrt(4.0 * KINDS[kind] / reduced)
    places, velocities = [[0.0, 0.0], [0.2, 0.0]], [[0.0] * 3, [start, 0.0, 0.0]]
    errors = []
    for dt in STEPS:
        state = advance(shaped_engine(model, places, velocities), dt, round(0.03 / dt))
        apart = state.velocity[1, 0] - state.velocity[0, 0]
        assert 0.5 * reduced * (start**2 - apart**2) == pytest.approx(-work(state), rel=1e-9)
        assert book(state, "closure") < 1e-12
        assert state.bridge_i.size == 0
        errors.append(abs(-0.5 * work(state) / KINDS[kind] - 1.0))
    assert errors[0] < 0.1
    assert errors[-1] < errors[0] / 10.0
    assert errors[-1] < 2e-3
