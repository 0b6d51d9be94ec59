"""What must not change: momentum, energy, and trajectories under scaling, threads, resume."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scene_parts import (
    FLOOR,
    SPEED,
    TIGHT,
    advance,
    begin,
    book,
    continued,
    make_engine,
    make_model,
    resume,
    shear_engine,
    surface_engine,
    tally,
)

from multicor_cli.engine import Interrupted, PhysicsError, Settings
from multicor_cli.engine.contact import solve
from multicor_cli.engine.motion import layout
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind


def _cluster(restitution):
    rng = np.random.default_rng(3)
    radius = rng.uniform(0.3, 0.7, 60)
    model = make_model(radius, walls=(), gravity=(0.0, 0.0), restitution=restitution, friction=0.4)
    k = np.arange(60)
    positions = np.column_stack([(k % 8) * 1.45, (k // 8) * 1.45])
    velocities = rng.normal(size=(60, 3))
    velocities[:, :2] -= 0.4 * (positions - positions.mean(axis=0))  # falling together
    return make_engine(model, positions, velocities)


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_isolated_cluster_keeps_momentum_and_angular_momentum(restitution):
    engine = _cluster(restitution)
    state, grains = engine.state, engine.model.grains

    def moments():
        x, y, (vx, vy, spin) = *state.position[:, :2].T, state.velocity.T
        turning = grains.mass * (x * vy - y * vx) + grains.inertia * spin
        return grains.mass @ vx, grains.mass @ vy, turning.sum()

    before = moments()
    advance(engine, 2e-3, 1000)
    scale = (grains.mass * np.hypot(*state.velocity[:, :2].T)).sum()
    assert tally(state, "sweeps") > 0 or book(state, "impact_loss") > 0.0
    assert moments()[:2] == pytest.approx(before[:2], abs=1e-12 * scale)
    # A contact with a gap or overlap acts at one point of each grain; the couple vanishes with Δt
    # (measured: 8e-3, 1.3e-3, 4e-4 for Δt = 4, 2, 1 ms, where the scale is about 15).
    assert moments()[2] == pytest.approx(before[2], abs=1e-3 * scale)


@pytest.mark.parametrize(
    ("restitution", "gravity", "damping"), [(0.0, 0.0, 0.0), (0.5, -0.05, 0.0), (0.2, -0.05, 3.0)]
)
def test_energy_books_close(restitution, gravity, damping):
    """Kinetic change = works − losses, to round-off, converged or not (theory §8)."""
    engine = shear_engine(restitution=restitution, gravity=(0.0, gravity))
    model = engine.model
    load = DofDrive(force=Constant(-model.period), damping=damping)
    begin(engine, drives=[WallDrive(), WallDrive(x=DofDrive(velocity=Constant(1.5)), y=load)])
    # Deliberately unconverged
    resume(engine, settings=replace(engine.orders.settings, max_sweeps=15))
    state = advance(engine, 0.1, 300)
    assert tally(state, "unconverged_steps") > 0
    assert book(state, "closure") < 1e-12
    assert book(state, "friction_loss") > 0
    assert book(state, "impact_loss") > 0
    if damping:
        assert book(state, "damping_loss") > 0


def test_gravity_work_is_the_change_of_potential_energy():
    """The books' gravity work against −Δ(Σ m g y) from the positions themselves."""
    engine = shear_engine(gravity=(0.0, -0.05))
    weight = engine.model.grains.mass * 0.05
    before = (weight * engine.state.position[:, 1]).sum()
    state = advance(engine, 0.1, 300)
    after = (weight * state.position[:, 1]).sum()
    assert book(state, "gravity_work") == pytest.approx(before - after, rel=1e-11)


def test_switching_a_moving_wall_from_prescribed_to_driven_is_booked():
    engine = shear_engine()
    advance(engine, 0.1, 20)
    free, load = (DofDrive(force=Constant(force)) for force in (0.0, -engine.model.period))
    begin(engine, drives=[WallDrive(), WallDrive(x=free, y=load)])
    state = advance(engine, 0.1, 50)
    assert book(state, "closure") < 1e-12


@pytest.mark.parametrize(("make", "load", "dt", "laws"), [
    (shear_engine, 1.0, 0.1, {}),
    (surface_engine, 120.0, 2e-3, {"friction": 0.5, "rolling": 0.1}),
])  # fmt: skip
def test_scaling_of_gravity_free_shear_is_exact(make, load, dt, laws):
    """V/2, loads/4, 2Δt: same bits at equal strain (rigid grains know the inertial number only)."""
    first = make(load=load, speed=SPEED, restitution=0.25, **laws)
    second = make(load=0.25 * load, speed=0.5 * SPEED, restitution=0.25, **laws)
    for _ in range(4):
        one, two = advance(first, dt, 60), advance(second, 2.0 * dt, 60)
        assert np.array_equal(one.position, two.position)
        assert np.array_equal(one.wall_position, two.wall_position)
        assert np.array_equal(one.velocity, 2.0 * two.velocity)
        assert np.array_equal(one.wall_surface, 2.0 * two.wall_surface)
    assert book(one, "friction_loss") > 0.0
    assert len(one.contact_i) > (100 if make is shear_engine else 0)


def test_reflection_gives_the_mirror_image():
    """Mirrored in x, a collapse runs the same until rounding grows; spins change sign."""
    rng = np.random.default_rng(5)
    radius = rng.uniform(0.4, 0.6, 30)
    k = np.arange(30)
    x, y = (k % 5) * 1.21 - 2.4 + 0.05 * rng.random(30), 0.7 + (k // 5) * 1.21
    model = make_model(radius, FLOOR, gravity=(0.0, -1.0))
    left, right = (
        advance(make_engine(model, np.column_stack([way * x, y]), settings=TIGHT), 0.01, 150)
        for way in (1.0, -1.0)
    )
    assert left.position[:, 0] == pytest.approx(-right.position[:, 0], abs=1e-7)
    assert left.position[:, 1] == pytest.approx(right.position[:, 1], abs=1e-7)
    assert left.velocity[:, 2] == pytest.approx(-right.velocity[:, 2], abs=1e-5)


STICKY = partial(shear_engine, adhesion=1.0, rolling=0.3, reach=0.05, wet=True)


@pytest.mark.parametrize(("make", "dt", "columns", "rows"), [
    (shear_engine, 0.1, 40, 36), (STICKY, 0.02, 40, 36), (surface_engine, 2e-3, 40, 20),
])  # fmt: skip
def test_neither_threads_nor_a_new_engine_change_a_bit(make, dt, columns, rows, monkeypatch):
    """Tiled sweeps, chunked sums: one digest for 1 and 2 threads, parallel and serial, resumed."""
    monkeypatch.setattr(layout, "PARALLEL_GRAINS", 1)
    digests = set()
    for threads, parallel_from in ((1, 1), (2, 1), (2, 10**9)):
        monkeypatch.setattr(solve, "PARALLEL_FROM", parallel_from)
        engine = make(threads=threads, columns=columns, rows=rows)
        advance(engine, dt, 20)
        other = continued(engine)
        digests |= {advance(each, dt, 20, first=20).digest() for each in (engine, other)}
    assert len(digests) == 1
    state = engine.state
    assert make is not STICKY or (state.bridge_i.size > 20 and state.contact_couple.any())


def test_overlaps_stay_small_in_a_long_shear():
    engine = shear_engine(load=4.0, speed=2.0)
    state = advance(engine, 0.1, 600)
    assert 0.0 < tally(state, "max_overlap") <= 5e-4


def test_over_compaction_between_prescribed_walls_stops_and_names_the_grains():
    shapes = [*FLOOR, (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0))]
    model = make_model([0.5, 0.5], shapes, ("floor", "lid"), gravity=(0.0, 0.0))
    drives = [WallDrive(), WallDrive(y=DofDrive(velocity=Constant(-0.1)))]
    places, few = [[0.0, 0.5], [0.0, 1.5]], Settings(max_sweeps=50)
    engine = make_engine(model, places, drives=drives, settings=few)
    engine.state.wall_position[1, 1] = 2.01
    with pytest.raises(PhysicsError, match=r"grain \d.*overlap"):
        advance(engine, 1e-2, 100)


def test_interrupted_step_leaves_the_state_alone():
    engine = shear_engine()
    advance(engine, 0.1, 30)
    before = engine.state.digest()
    with pytest.raises(Interrupted):
        engine.step(0.1, 3.0, should_stop=lambda: True)
    assert engine.state.digest() == before
