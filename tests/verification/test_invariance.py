"""What must not change: momentum, the energy balance, and trajectories under scaling, reflection, threads and resume."""

from dataclasses import replace

import numpy as np
import pytest
from scene_parts import TIGHT, advance, begin, book, continued, make_engine, make_model, resume, shear_engine, tally

from multicor_cli.engine import PhysicsError, Settings
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
        linear = (grains.mass[:, None] * state.velocity[:, :2]).sum(axis=0)
        x, y, vx, vy = *state.position[:, :2].T, *state.velocity[:, :2].T
        return *linear, (grains.mass * (x * vy - y * vx) + grains.inertia * state.velocity[:, 2]).sum()

    before = moments()
    advance(engine, 2e-3, 1000)
    scale = (grains.mass * np.hypot(*state.velocity[:, :2].T)).sum()
    assert tally(state, "sweeps") > 0
    assert moments()[:2] == pytest.approx(before[:2], abs=1e-12 * scale)
    # A contact with a small gap or overlap acts at one point of each grain; the couple of that gap vanishes with Δt
    # (measured: 8e-3, 1.3e-3, 4e-4 for Δt = 4, 2, 1 ms, where the scale is about 15).
    assert moments()[2] == pytest.approx(before[2], abs=1e-3 * scale)


@pytest.mark.parametrize(("restitution", "gravity", "damping"), [(0.0, 0.0, 0.0), (0.5, -0.05, 0.0), (0.2, -0.05, 3.0)])
def test_energy_books_close(restitution, gravity, damping):
    """Kinetic change = works − losses, to round-off, converged or not (theory §8)."""
    engine = shear_engine(restitution=restitution, gravity=(0.0, gravity))
    model = engine.model
    load = DofDrive(force=Constant(-model.period), damping=damping)
    begin(engine, drives=[WallDrive(), WallDrive(x=DofDrive(velocity=Constant(1.5)), y=load)])
    resume(engine, settings=replace(engine.orders.settings, max_sweeps=15))  # deliberately unconverged
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
    load = DofDrive(force=Constant(0.0))
    begin(engine, drives=[WallDrive(), WallDrive(x=load, y=DofDrive(force=Constant(-engine.model.period)))])
    state = advance(engine, 0.1, 50)
    assert book(state, "closure") < 1e-12


def test_scaling_of_gravity_free_shear_is_exact():
    """V/2, loads/4, 2Δt: the same positions to the bit at equal strain (rigid grains know the inertial number alone)."""
    first, second = (
        shear_engine(load=1.0, speed=1.5, restitution=0.25),
        shear_engine(load=0.25, speed=0.75, restitution=0.25),
    )
    for _ in range(4):
        advance(first, 0.1, 60)
        advance(second, 0.2, 60)
        assert np.array_equal(first.state.position, second.state.position)
        assert np.array_equal(first.state.wall_position, second.state.wall_position)
        assert np.array_equal(first.state.velocity, 2.0 * second.state.velocity)
    assert len(first.state.contact_i) > 100


def test_reflection_gives_the_mirror_image():
    """Mirrored in x, a collapse runs the same until rounding grows; spins change sign."""
    rng = np.random.default_rng(5)
    radius = rng.uniform(0.4, 0.6, 30)
    k = np.arange(30)
    positions = np.column_stack([(k % 5) * 1.21 - 2.4 + 0.05 * rng.random(30), 0.7 + (k // 5) * 1.21])
    engines = []
    for sign in (1.0, -1.0):
        model = make_model(radius, [(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0))], gravity=(0.0, -1.0))
        engines.append(make_engine(model, positions * [sign, 1.0], settings=TIGHT))
    for engine in engines:
        advance(engine, 0.01, 150)
    left, right = (engine.state for engine in engines)
    assert left.position[:, 0] == pytest.approx(-right.position[:, 0], abs=1e-7)
    assert left.position[:, 1] == pytest.approx(right.position[:, 1], abs=1e-7)
    assert left.velocity[:, 2] == pytest.approx(-right.velocity[:, 2], abs=1e-5)


def test_thread_count_does_not_change_a_bit(monkeypatch):
    """Tiled sweeps, chunked sums: one digest for 1, 2 and more threads, and for the parallel and the serial sweep."""
    from multicor_cli.engine import step as engine_module
    from multicor_cli.engine.contact import solve

    monkeypatch.setattr(engine_module, "PARALLEL_GRAINS", 1)
    digests = set()
    for threads, parallel_from in ((1, 1), (2, 1), (2, 10**9)):
        monkeypatch.setattr(solve, "PARALLEL_FROM", parallel_from)
        engine = shear_engine(threads=threads, columns=40, rows=36)
        digests.add(advance(engine, 0.1, 40).digest())
    assert len(digests) == 1


def test_age_of_the_neighbor_list_does_not_matter():
    """A new engine on a copied state (a resume) goes on bit for bit."""
    engine = shear_engine(restitution=0.3)
    advance(engine, 0.1, 57)
    other = continued(engine)
    for k in range(57, 120):
        engine.step(0.1, k * 0.1)
        other.step(0.1, k * 0.1)
    assert engine.state.digest() == other.state.digest()


def test_overlaps_stay_small_in_a_long_shear():
    engine = shear_engine(load=4.0, speed=2.0)
    state = advance(engine, 0.1, 600)
    assert 0.0 < tally(state, "max_overlap") <= 5e-4


def test_over_compaction_between_prescribed_walls_stops_and_names_the_grains():
    shapes = [(ShapeKind.PLANE, 0, (0.0, 0.0, 0.0, 1.0)), (ShapeKind.PLANE, 1, (0.0, 0.0, 0.0, -1.0))]
    model = make_model([0.5, 0.5], shapes, ("floor", "lid"), gravity=(0.0, 0.0))
    drives = [WallDrive(), WallDrive(y=DofDrive(velocity=Constant(-0.1)))]
    engine = make_engine(model, [[0.0, 0.5], [0.0, 1.5]], drives=drives, settings=Settings(max_sweeps=50))
    engine.state.wall_position[1, 1] = 2.01
    with pytest.raises(PhysicsError, match=r"grain \d.*overlap"):
        advance(engine, 1e-2, 100)


def test_non_finite_state_is_named():
    engine = shear_engine()
    advance(engine, 0.1, 3)
    engine.state.velocity[17, 0] = np.nan
    with pytest.raises(PhysicsError, match="velocity of grain 17"):
        engine.step(0.1, 0.3)


def test_solver_failure_is_an_error_only_on_request():
    engine = shear_engine(settings=Settings(max_sweeps=2))
    advance(engine, 0.1, 40)
    assert tally(engine.state, "unconverged_steps") > 0
    resume(engine, settings=replace(engine.orders.settings, on_failure="error"))
    with pytest.raises(PhysicsError, match="did not converge"):
        advance(engine, 0.1, 40)


def test_interrupted_step_leaves_the_state_alone():
    from multicor_cli.engine import Interrupted

    engine = shear_engine()
    advance(engine, 0.1, 30)
    before = engine.state.digest()
    with pytest.raises(Interrupted):
        engine.step(0.1, 3.0, should_stop=lambda: True)
    assert engine.state.digest() == before
