"""Closed forms (theory §15.1, §15.2): equation in each test, tolerance from the scheme's order."""

import numpy as np
import pytest
from heat_parts import with_flash
from recorded import keep
from scene_parts import (
    FIXED,
    FLOOR,
    TIGHT,
    G,
    advance,
    book,
    make_engine,
    make_model,
    resume,
    tally,
)

from multicor_cli.engine import Settings
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind


@pytest.mark.parametrize(("factor", "rolls"), [(1.01, True), (0.99, False)])
@pytest.mark.parametrize(("shape", "threshold"), [("disc", 1.0 / 3.0), ("sphere", 2.0 / 7.0)])
def test_rolling_threshold_on_an_incline(shape, threshold, factor, rolls):
    """At 20° a disc rolls if μ ≥ tan θ/3 (a sphere 2 tan θ/7); then a = g sin θ/(1 + I/(m a²))."""
    slope = np.radians(20.0)
    gravity, friction = (G * np.sin(slope), -G * np.cos(slope)), factor * threshold * np.tan(slope)
    model = make_model([1.0], FLOOR, friction=friction, gravity=gravity, shape=shape)
    state = advance(make_engine(model, [[0.0, 1.0]], settings=TIGHT), 1e-3, 200)
    assert (abs(state.velocity[0, 0] + state.velocity[0, 2]) < 1e-10) == rolls
    sliding = G * (np.sin(slope) - friction * np.cos(slope))
    rate = G * np.sin(slope) / (1.0 + 1.0 / model.shape_factor) if rolls else sliding
    assert state.velocity[0, 0] == pytest.approx(rate * 0.2, rel=1e-10)


def _rebound_height(restitution, dt):
    """Largest height after the first impact of a ball dropped from 1 m, and the state by then."""
    model = make_model([0.05], FLOOR, restitution=restitution)
    engine = make_engine(model, [[0.0, 1.05]])
    best, hit = 0.0, False
    for k in range(int((np.sqrt(2.0 / G) * (1.0 + restitution) + 0.1) / dt)):
        engine.step(dt, k * dt)
        hit = hit or engine.state.velocity[0, 1] > 0.0
        if hit:
            best = max(best, engine.state.position[0, 1] - 0.05)
    return best, engine.state


@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_bouncing_ball_is_first_order(restitution):
    """h₁ = e² h₀; the impact is found at the end of a step: the error is of the order of Δt·v."""
    steps = np.array([6.4e-3, 3.2e-3, 1.6e-3, 8e-4, 4e-4])
    impact_speed = np.sqrt(2.0 * G)
    errors = np.array([_rebound_height(restitution, dt)[0] - restitution**2 for dt in steps])
    # First order; the constant depends on when in its step the impact falls: below a step of fall.
    assert (np.abs(errors) <= steps * impact_speed * (1.0 + restitution)).all()
    assert np.abs(errors[-1]) < 0.25 * steps[0] * impact_speed


def test_ball_without_restitution_stays_down_and_dissipates_its_fall():
    """e = 0: no rebound at any Δt; the impact takes m g h."""
    for dt in (3e-3, 1e-3, 3e-4):
        height, state = _rebound_height(0.0, dt)
        assert height <= 1e-12
        assert abs(state.position[0, 1] - 0.05) < 1e-12
        mass = np.pi * 0.05**2
        assert book(state, "impact_loss") == pytest.approx(mass * G * 1.0, rel=1e-9)


@pytest.mark.parametrize(("restitution", "pitch", "dt", "steps", "error", "ends"), [
    (1.0, 1.0, 1e-3, 1, 1e-12, [0.0, 0.0, 1.0]),
    (1.0, 1.0, 1e-3, 1, 1e-12, [0.0, 0.0, 0.0, 0.0, 1.0]),
    (1.0, 1.1, 1e-3, 500, 1e-12, [0.0, 0.0, 0.0, 1.0]),
    (0.0, 1.0, 1e-4, 50, 1e-9, [0.2] * 5),
], ids=["three that touch", "five that touch", "with gaps", "without restitution"])  # fmt: skip
def test_cradle(restitution, pitch, dt, steps, error, ends):
    """Balls of which the first moves: with e = 0 all move on with v0/n.

    With e = 1 the last one alone flies off: impacts come one after the other, however small the
    gaps are.
    """
    count = len(ends)
    model = make_model(
        np.full(count, 0.5), walls=(), restitution=restitution, gravity=(0.0, 0.0), friction=0.0
    )
    velocities = np.zeros((count, 3))
    velocities[0, 0] = 1.0
    places = [[pitch * k, 0.0] for k in range(count)]
    engine = make_engine(model, places, velocities, settings=TIGHT)
    v = advance(engine, dt, steps).velocity[:, 0]
    assert v == pytest.approx(ends, abs=error)
    assert (v**2).sum() == pytest.approx(1.0 if restitution else 0.2, abs=error)


@pytest.mark.parametrize(
    ("tangential", "p_n", "p_t", "u_t", "loss_n", "loss_t"),
    [(3.0, 0.75, -0.15, 2.1, 0.1875, 0.3825), (0.5, 0.75, -1.0 / 12.0, 0.0, 0.1875, 0.5**2 / 12.0)],
)
def test_oblique_impact(tangential, p_n, p_t, u_t, loss_n, loss_t):
    """Two equal discs of mass 1, u = (−1, u_t), e_n = 0.5, e_t = 0, μ = 0.2 (theory §15.1)."""
    model = make_model(
        [0.5, 0.5], walls=(), restitution=0.5, gravity=(0.0, 0.0), friction=0.2, density=4.0 / np.pi
    )
    # i = 0 to the right of j = 1: n = (1, 0), t = (0, 1); contact exactly at mid-step.
    dt = 1e-3
    positions = [[1.0 + 0.5 * dt, -0.5 * dt * tangential], [0.0, 0.0]]
    velocities = [[-1.0, tangential, 0.0], [0.0, 0.0, 0.0]]
    engine = make_engine(model, positions, velocities, settings=TIGHT)
    engine.step(dt, 0.0)
    contact = engine.contacts()
    assert contact.impulse[0] == pytest.approx([p_n, p_t], abs=1e-12)
    assert contact.slip[0] == pytest.approx(u_t, abs=1e-12)
    assert book(engine.state, "impact_loss") == pytest.approx(loss_n, abs=1e-12)
    assert book(engine.state, "friction_loss") == pytest.approx(loss_t, abs=1e-12)


def _pyramid(friction):
    radius = 0.01
    model = make_model(np.full(3, radius), FLOOR, friction=friction)
    positions = [[-radius, radius], [radius, radius], [0.0, radius * (1.0 + np.sqrt(3.0))]]
    return make_engine(model, positions), radius


def test_three_disc_pyramid_threshold():
    """Rests if μ ≥ tan 15° (theory §15.2), falls below; watched for 20 √(R/g)."""
    threshold = np.tan(np.radians(15.0))
    for factor, rests in ((1.01, True), (0.99, False)):
        engine, radius = _pyramid(factor * threshold)
        dt = 0.02 * np.sqrt(radius / G)
        top = engine.state.position[2, 1]
        state = advance(engine, dt, 1000)
        fallen = (top - state.position[2, 1]) / radius
        assert (fallen < 1e-3) == rests, f"μ = {factor} tan 15°: it sank by {fallen:.2e} R"


def test_frictionless_pyramid_accelerations():
    """μ = 0: the top disc falls with g/7, the base spreads with √3 g/7; the ground bears 20/21."""
    engine, _ = _pyramid(0.0)
    resume(engine, settings=TIGHT)
    dt = 1e-6
    engine.step(dt, 0.0)
    state = engine.state
    assert -state.velocity[2, 1] / dt == pytest.approx(G / 7.0, rel=1e-6)
    spread = np.abs(state.velocity[:2, 0]) / dt
    assert spread == pytest.approx([np.sqrt(3.0) * G / 7.0] * 2, rel=1e-6)
    weight = engine.model.grains.mass.sum() * G * dt
    assert -state.window_wall_impulse[0, 1] / weight == pytest.approx(20.0 / 21.0, rel=1e-6)


def test_column_forces():
    """A resting column: contact k below the top carries k m g."""
    count = 12
    model = make_model(np.full(count, 0.5), FLOOR)
    engine = make_engine(model, [[0.0, 0.5 + k] for k in range(count)], settings=TIGHT)
    dt = 1e-3
    advance(engine, dt, 2)
    contacts = engine.contacts()
    above = count - np.where(contacts.j >= count, 0, contacts.j)
    weight = model.grains.mass[0] * G * dt
    assert contacts.impulse[:, 0] == pytest.approx(above * weight, rel=1e-8)


def test_lattice_forces_between_rows():
    """Lattice: row k from the top presses each inclined contact with k m g/√3 (theory §15.2)."""
    columns, rows, radius = 8, 7, 0.5
    model = make_model(np.full(columns * rows, radius), FLOOR, period=2.0 * radius * columns)
    pitch = np.sqrt(3.0) * radius
    positions = [
        [2 * radius * (c + 0.5 * (r % 2)), radius + r * pitch]
        for r in range(rows)
        for c in range(columns)
    ]
    settings = Settings(tolerance_rms=1e-10, tolerance_max=1e-8, tolerance_energy=1e-8)
    engine = make_engine(model, positions, settings=settings)
    dt = 1e-3
    advance(engine, dt, 2)
    contacts = engine.contacts()
    weight = model.grains.mass[0] * G * dt
    # The vertical force between rows, two contacts a grain, whatever the horizontal ones carry.
    n = model.grain_count
    between = contacts.j < n
    i, j = contacts.i[between] // columns, contacts.j[between] // columns
    # The tangent is the normal turned by a right angle: (n_y, n_x) are the vertical parts
    vertical = (contacts.impulse[between] * contacts.normal[between, ::-1]).sum(axis=1)
    for row in range(rows - 1):
        mask = (np.minimum(i, j) == row) & (np.maximum(i, j) == row + 1)
        total = (np.where(i > j, 1.0, -1.0) * vertical)[mask].sum()
        assert total == pytest.approx((rows - 1 - row) * columns * weight, rel=1e-6)
    floor = contacts.impulse[contacts.j >= n, 0].sum()
    assert floor == pytest.approx(rows * columns * weight, rel=1e-6)


def test_loaded_wall_reaches_its_terminal_velocity(record_property):
    """M V̇ = F − c V: V = F/c (1 − exp(−c t/M)); second order in Δt."""
    lid = [(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, -1.0))]
    model = make_model([0.1], lid, ("lid",), gravity=(0.0, 0.0), mass=2.0)
    drive = WallDrive(y=DofDrive(force=Constant(3.0), damping=4.0))
    errors = []
    for dt in (0.02, 0.01, 0.005):
        engine = make_engine(model, [[0.0, -5.0]], drives=[drive])
        state = advance(engine, dt, round(1.0 / dt))
        errors.append(abs(state.wall_velocity[0, 1] - 0.75 * (1.0 - np.exp(-2.0))))
        assert book(state, "closure") < 1e-12
        assert state.wall_velocity[0, 0] == 0.0
    keep(record_property, steps=(50, 100, 200), error=np.array(errors) / 0.75, order=2)
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2.0, 2.0], abs=0.05)


def test_loaded_lid_presses_with_its_load_and_weight():
    """At rest the floor carries the grains, the lid and its load."""
    shapes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0))]
    model = make_model([0.5, 0.5], shapes, ("floor", "lid"), mass=1.5, wall_gravity=True)
    drives = [WallDrive(), WallDrive(y=DofDrive(force=Constant(-2.0)))]
    engine = make_engine(model, [[0.0, 0.5], [0.0, 1.5]], drives=drives, settings=TIGHT)
    engine.state.wall_position[1, 1] = 2.0
    dt = 1e-3
    advance(engine, dt, 3)
    engine.state.window_wall_impulse[:] = 0.0
    engine.step(dt, 0.0)
    force = -engine.state.window_wall_impulse[0, 1] / dt
    assert force == pytest.approx(model.grains.mass.sum() * G + 1.5 * G + 2.0, rel=1e-8)


@pytest.mark.parametrize(("speed", "mu"), [(0.0, 0.5), (0.5, 0.4), (2.0, 0.2), (9.0, 0.1)])
def test_friction_that_depends_on_speed(speed, mu):
    """A disc held from spinning slides with μ(v) of the table: an impulse is μ(|u_t⁻|) m g Δt."""
    model = make_model([1.0], FLOOR, table=([0.0, 1.0, 3.0], [0.5, 0.3, 0.1]))
    engine = make_engine(model, [[0.0, 1.0]], [[speed, 0.0, 0.0]], settings=TIGHT)
    slowed = speed - advance(engine, 1e-3, 1).velocity[0, 0]
    assert slowed == pytest.approx(min(mu * G * 1e-3, speed / 3.0), rel=1e-9)


@pytest.mark.parametrize(("speed", "mu"), [(0.1, 0.5), (0.2, 0.5), (0.4, 0.3), (2.0, 0.14)])
def test_friction_that_weakens_by_flash_heating(speed, mu):
    """An impulse is [f_w + (f_0 − f_w) V_w/V] m g Δt above V_w (Rice 2006), f_0 m g Δt below."""
    model = with_flash(make_model([1.0], FLOOR, friction=0.5), 0.1, 0.2)
    engine = make_engine(model, [[0.0, 1.0]], [[speed, 0.0, 0.0]], settings=TIGHT)
    slowed = speed - advance(engine, 1e-4, 1).velocity[0, 0]
    assert slowed == pytest.approx(mu * G * 1e-4, rel=1e-9)


@pytest.mark.parametrize("dt", [1e-3, 1e-4])
def test_weakened_sliding_follows_its_closed_form(dt):
    """Without f_w a sphere slows as v² = v₀² − 2·(7/2) f_0 V_w g t at its surface, of first order."""
    model = with_flash(make_model([1.0], FLOOR, friction=0.5, shape="sphere"), 0.0, 0.2)
    engine = make_engine(model, [[0.0, 1.0]], [[3.0, 0.0, 0.0]], settings=TIGHT)
    velocity = advance(engine, dt, round(0.5 / dt)).velocity[0]
    surface = np.sqrt(9.0 - 7.0 * 0.5 * 0.2 * G * 0.5)
    assert velocity[0] + velocity[2] == pytest.approx(surface, rel=0.5 * dt)
    assert book(engine.state, "closure") < 1e-12


def test_ball_on_the_end_of_a_segment_sees_a_point():
    """A vertex pushes along the line to the center; the segment next to it stays silent."""
    segment = ShapeKind.SEGMENT, 0, (-1.0, 0.0, 0.0, 0.0)
    vertex = ShapeKind.VERTEX, 0, (0.0, 0.0, 0.0, -1.0)
    model = make_model([1.0], [segment, vertex], friction=0.0, gravity=(0.0, 0.0))
    direction = np.array([np.sin(0.5), np.cos(0.5)])
    engine = make_engine(model, [direction], [[*-direction, 0.0]], settings=TIGHT)
    engine.step(1e-6, 0.0)
    contacts = engine.contacts()
    assert contacts.i.size == 1
    assert contacts.normal[0] == pytest.approx(direction, abs=1e-5)
    assert np.hypot(*engine.state.velocity[0, :2]) < 1e-5


def test_drum_carries_its_grain_up():
    """A disc in a turning drum rolls without slip, as a pendulum, and stays on the drum."""
    shapes = [(ShapeKind.CIRCLE, 0, (0.0, 0.0, 1.0, 0.0))]
    model = make_model([0.1], shapes, ("drum",), friction=0.8)
    drive = WallDrive(spin=DofDrive(velocity=Constant(0.2)))
    engine = make_engine(model, [[0.0, -0.9]], drives=[drive])
    state = advance(engine, 1e-3, 4000)
    assert abs(engine.contacts().slip[0]) < 1e-4
    mean_spin = 0.2 * 1.0 / 0.1
    assert abs(state.velocity[0, 2] - mean_spin) < 0.5 * mean_spin
    assert book(state, "closure") < 1e-12
    # The overlap that is left alone
    assert np.hypot(*state.position[0, :2]) == pytest.approx(0.9, abs=5e-4 * 0.1)
    assert tally(state, "max_overlap") < 1e-3


def test_fixed_walls_do_not_move():
    model = make_model([0.5], FLOOR)
    engine = make_engine(model, [[0.0, 0.5]], drives=[WallDrive(x=FIXED, y=FIXED, spin=FIXED)])
    state = advance(engine, 1e-3, 10)
    assert not state.wall_position.any()
    assert not state.wall_velocity.any()
