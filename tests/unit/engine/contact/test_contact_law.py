"""The law of contacts, with adhesion and rolling resistance, against closed forms and independent
computations (theory §3)."""

import itertools

import numpy as np
import pytest
from scene_parts import (
    FLOOR,
    TIGHT,
    G,
    advance,
    book,
    copy_of,
    make_engine,
    make_model,
    resume,
    shear_engine,
    tally,
)

from multicor_cli.engine import Settings
from multicor_cli.engine.contact import law as law
from multicor_cli.engine.contact.patches import choose_patch, nothing_met, solve_patch
from multicor_cli.engine.contact.residual import measure_residual
from multicor_cli.engine.contact.sweep import add_impulses
from multicor_cli.engine.motion.drives import Constant, DofDrive, WallDrive
from multicor_cli.model import ShapeKind


@pytest.mark.parametrize(("tau_t", "tau_n", "expected"), [
    (0.1, 1.0, (0.1, 1.0)), (2.0, 1.0, (0.8, 1.6)), (0.5, -1.0, (0.0, 0.0)),
    (3.0, -0.5, (0.4, 0.8)),
])  # fmt: skip
def test_projection_on_the_cone(tau_t, tau_n, expected):
    n, t = law.project_on_cone(tau_n, tau_t, 0.5)
    assert (t, n) == pytest.approx(expected)


def test_bipotential_iteration_finds_the_sliding_disc():
    """Disc on a plane, u_t = 1, u_n = −0.1, μ = 0.5, W_nn = 1, W_tt = 3: p = (0.1, −0.05)."""
    p_n, p_t = 0.0, 0.0
    for _ in range(200):
        p_n, p_t = law.solve_bipotential(p_n, p_t, -0.1 + p_n, 1.0 + 3.0 * p_t, 1.0, 1.0 / 3.0, 0.5)
    assert (p_n, p_t) == pytest.approx((0.1, -0.05), abs=1e-12)
    assert p_n * (-0.1 + p_n) + p_t * (1.0 + 3.0 * p_t) + 0.5 * p_n * abs(
        1.0 + 3.0 * p_t
    ) == pytest.approx(0.0, abs=1e-12)
    # ρ < 2/W_tt for discs (W_tt = 3 W_nn) and spheres (3.5 W_nn)
    for ratio in (3.0, 3.5):
        assert 0.0 < law.bipotential_parameter(1.0, 1.0 / ratio) < 2.0 / ratio
    n, t = law.project_on_cone(1.0, 2.0, 0.3)
    assert law.project_on_cone(1.0, -2.0, 0.3) == (n, -t)


def _assert_law_holds(p_n, p_t, u_n, u_t, mu):
    assert p_n >= 0.0
    assert u_n >= -1e-12
    assert p_n * u_n == pytest.approx(0.0, abs=1e-12)
    assert abs(p_t) <= mu * p_n + 1e-12
    if abs(u_t) > 1e-9:
        assert p_t == pytest.approx(-mu * p_n * (1.0 if u_t > 0 else -1.0), abs=1e-9)


GRID = list(itertools.product((-1.0, -0.2, 0.3), (-2.0, -0.1, 0.0, 0.7), (0.0, 0.2, 0.9)))


@pytest.mark.parametrize(("q_n", "q_t", "mu"), GRID)
def test_exact_solution_satisfies_the_law_from_any_start(q_n, q_t, mu):
    w_n, w_t = 2.0, 6.0
    for start_n, start_t in ((0.0, 0.0), (0.4, -0.1)):
        p_n, p_t = law.solve_exact(
            start_n, start_t, q_n + w_n * start_n, q_t + w_t * start_t, 1 / w_n, 1 / w_t, mu
        )
        _assert_law_holds(p_n, p_t, q_n + w_n * p_n, q_t + w_t * p_t, mu)


@pytest.mark.parametrize(("q_n", "q_t", "mu"), GRID)
@pytest.mark.parametrize("w_nt", [0.0, 0.6, -0.8])
def test_full_solution_satisfies_the_law(q_n, q_t, mu, w_nt):
    w_nn, w_tt, start_n, start_t = 2.0, 3.0, 0.3, 0.05
    u_n, u_t = q_n + w_nn * start_n + w_nt * start_t, q_t + w_nt * start_n + w_tt * start_t
    p_n, p_t = law.solve_full(start_n, start_t, u_n, u_t, w_nn, w_nt, w_tt, mu)
    _assert_law_holds(p_n, p_t, q_n + w_nn * p_n + w_nt * p_t, q_t + w_nt * p_n + w_tt * p_t, mu)


def test_each_of_several_solutions_stays_what_it_is():
    """W_nn < μ |W_nt|: what is not approached may be open, or wedged, or in between."""
    w_nn, w_nt, w_tt, mu, several = 1.0, 0.8, 1.0, 1.5, 0
    rng = np.random.default_rng(2)
    for q_n, q_t in rng.normal(0.0, 1.0, (1600, 2)):
        stick = -np.linalg.solve([[w_nn, w_nt], [w_nt, w_tt]], [q_n, q_t])
        slips = [-q_n / (w_nn + mu * w_nt), -q_n / (w_nn - mu * w_nt)]
        right = [np.zeros(2)] if q_n >= 0.0 else []
        right += [stick] if stick[0] >= 0.0 and abs(stick[1]) <= mu * stick[0] else []
        for p_n, sign in zip(slips, (1.0, -1.0), strict=True):
            slip = np.array([p_n, sign * mu * p_n])
            if p_n > 0.0 and sign * (q_t + w_nt * p_n + w_tt * slip[1]) <= 0.0:
                right.append(slip)
        several += len(right) > 1
        for p_n, p_t in right:
            _assert_law_holds(
                p_n, p_t, q_n + w_nn * p_n + w_nt * p_t, q_t + w_nt * p_n + w_tt * p_t, mu
            )
            u_n, u_t = q_n + w_nn * p_n + w_nt * p_t, q_t + w_nt * p_n + w_tt * p_t
            found = law.solve_full(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu)
            assert found == pytest.approx((p_n, p_t), abs=1e-12)
    assert several > 30


def test_full_solution_equals_the_exact_one_for_a_diagonal_matrix():
    for q_n, q_t, mu in GRID:
        full = law.solve_full(0.0, 0.0, q_n, q_t, 2.0, 0.0, 6.0, mu)
        assert full == pytest.approx(
            law.solve_exact(0.0, 0.0, q_n, q_t, 0.5, 1.0 / 6.0, mu), abs=1e-14
        )


def test_the_plane_between_two_discs_keeps_them_apart():
    """Whatever the velocities become that it allows; where they pass, it leaves those they have."""
    rng = np.random.default_rng(8)
    dt, radii, graze, passed = 0.1, 1.0, 5e-4, 0
    for _ in range(2000):
        angle, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1.0, 1.3)
        d, u = away * np.array([np.cos(angle), np.sin(angle)]), rng.normal(0.0, 4.0, 2)
        gap, room, *normal = law.guard_plane(*d, *u, radii, graze, dt)
        n = np.array(normal)
        assert gap == pytest.approx(away - radii, abs=1e-15)
        assert room == pytest.approx(d @ n - radii, abs=1e-15)
        path = d + np.linspace(0.0, dt, 2001)[:, None] * u
        closest = np.hypot(*path.T).min()
        if closest >= radii + 1e-6:
            passed += 1
            assert room + dt * (u @ n) >= 0.0
        elif closest < radii - graze:
            assert n == pytest.approx(d / away, abs=1e-15)
            assert room + dt * (u @ n) < 0.0
        for v in rng.normal(0.0, 4.0, (20, 2)):  # at worst they end on the plane
            v = v - min(0.0, v @ n + max(room, 0.0) / dt) * n
            assert np.hypot(*(d + dt * v)) >= radii - graze
    assert 500 < passed < 1900


def test_bias():
    dt = 0.1
    assert law.bias(0.02, -1.0, 0.5, dt) == -0.5  # closes within the step: Newton's rebound alone
    assert law.bias(0.2, -1.0, 0.5, dt) == pytest.approx(2.0)  # does not: the gap may be used up
    assert law.bias(0.02, -1.0, 0.0, dt) == pytest.approx(0.2)  # no restitution: land exactly
    assert law.bias(-0.01, 1.0, 0.5, dt) == 0.0  # separating overlap: no push


# ---- Rolling resistance against closed forms and independent computations (theory §3.2)


@pytest.mark.parametrize("shape", ["disc", "sphere"])
@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_body_rests_on_a_slope_up_to_the_coefficient_of_rolling_resistance(shape, factor):
    """m g a sin α = μ_r a m g cos α at a plane: rests if tan α ≤ μ_r, else g (sin α − μ_r cos α)
    β/(1 + β)."""
    mu_r, dt, steps = 0.2, 1e-3, 200
    slope = np.arctan(factor * mu_r)
    gravity = (G * np.sin(slope), -G * np.cos(slope))
    model = make_model([0.3], FLOOR, friction=5.0, gravity=gravity, shape=shape, rolling=mu_r)
    state = advance(make_engine(model, [[0.0, 0.3]], settings=TIGHT), dt, steps)
    beta = model.shape_factor
    rate = G * (np.sin(slope) - mu_r * np.cos(slope)) * beta / (1.0 + beta)
    assert state.velocity[0, 0] == pytest.approx(max(rate, 0.0) * dt * steps, abs=1e-10)
    assert state.velocity[0, 0] == pytest.approx(-0.3 * state.velocity[0, 2], abs=1e-10)
    # at rest there is nothing but rounding to compare
    assert rate < 0.0 or book(state, "closure") < 1e-12


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_the_couple_between_unequal_radii_goes_with_their_effective_radius(factor):
    """A disc a on top of a held one R, at an angle α from the top: rests if tan α ≤ μ_r a*/a = μ_r
    R/(a + R)."""
    a, big, mu_r = 0.1, 0.3, 0.2
    angle = np.arctan(factor * mu_r * big / (a + big))
    model = make_model([a], [(ShapeKind.DISC, 0, (0.0, 0.0, big, 0.0))], friction=5.0, rolling=mu_r)
    engine = make_engine(
        model, [[(a + big) * np.sin(angle), (a + big) * np.cos(angle)]], settings=TIGHT
    )
    state = advance(engine, 1e-4, 50)
    assert (abs(state.velocity[0, 2]) < 1e-9) == (factor < 1.0)


@pytest.mark.parametrize("shape", ["disc", "sphere"])
def test_a_rolling_body_slows_down_at_the_rate_of_its_couple(shape):
    """v = v₀ − μ_r g β/(1 + β) t on a plane, and what is lost is booked as friction, to
    round-off."""
    model = make_model([0.3], FLOOR, friction=5.0, shape=shape, rolling=0.1)
    state = advance(
        make_engine(model, [[0.0, 0.3]], [[1.0, 0.0, -1.0 / 0.3]], settings=TIGHT), 1e-3, 400
    )
    beta = model.shape_factor
    speed = 1.0 - 0.1 * G * beta / (1.0 + beta) * 0.4
    assert state.velocity[0, 0] == pytest.approx(speed, rel=1e-10)
    energy = 0.5 * model.grains.mass[0] * (1.0 + 1.0 / beta) * (1.0 - speed * speed)
    assert book(state, "friction_loss") == pytest.approx(energy, rel=1e-10)
    assert book(state, "closure") < 1e-12


def test_a_rolling_body_comes_to_rest_and_stays():
    model = make_model([0.3], FLOOR, friction=5.0, rolling=0.1)
    state = advance(
        make_engine(model, [[0.0, 0.3]], [[0.1, 0.0, -0.1 / 0.3]], settings=TIGHT), 1e-3, 400
    )
    assert np.abs(state.velocity).max() < 1e-10


@pytest.mark.parametrize("is_wall", [False, True])
def test_relative_spin_of_bodies_that_stick_together_decays_and_angular_momentum_stays(is_wall):
    """Pressed by adhesion alone, q_n = F_a Δt, without friction: I dω/dt = ∓ μ_r a* F_a; a free
    wall turns too."""
    adhesion, mu_r, dt, steps = 2.0, 0.1, 1e-3, 40
    laws = {"friction": 0.0, "gravity": (0.0, 0.0), "adhesion": adhesion, "rolling": mu_r}
    if is_wall:
        model = make_model([0.1], FLOOR, mass=1.0, inertia=2e4, **laws)
        free = WallDrive(spin=DofDrive(force=Constant(0.0)))
        engine = make_engine(model, [[0.0, 0.1]], [[0.0, 0.0, 40.0]], settings=TIGHT, drives=[free])
        arm, other = 0.1, 2e4  # so heavy that it hardly tilts
    else:
        model = make_model([0.1, 0.2], walls=(), **laws)
        engine = make_engine(
            model, [[0.0, 0.0], [0.3, 0.0]], [[0.0, 0.0, 40.0], [0.0, 0.0, 0.0]], settings=TIGHT
        )
        arm, other = 0.1 * 0.2 / 0.3, model.grains.inertia[1]
    state = advance(engine, dt, steps)
    first, second = (
        state.velocity[0, 2],
        state.wall_velocity[0, 2] if is_wall else state.velocity[1, 2],
    )
    inertia = model.grains.inertia[0]
    moment = mu_r * arm * adhesion * dt * steps
    assert first == pytest.approx(40.0 - moment / inertia, rel=1e-9)
    assert second == pytest.approx(moment / other, rel=1e-9)
    assert engine.contacts().couple[0] == pytest.approx(-mu_r * arm * adhesion * dt, rel=1e-9)
    assert book(state, "closure") < 1e-12


def test_a_common_rotation_is_not_resisted():
    """Objectivity: a pair that turns as one body about its center of mass keeps its spin; adhesion
    holds it together."""
    model = make_model(
        [0.1, 0.1], gravity=(0.0, 0.0), walls=(), friction=1.0, adhesion=50.0, rolling=0.5
    )
    spin = 0.5
    engine = make_engine(model, [[-0.1, 0.0], [0.1, 0.0]], settings=TIGHT)
    engine.step(1e-3, 0.0)
    engine.state.velocity[:] = [[0.0, -0.1 * spin, spin], [0.0, 0.1 * spin, spin]]
    state = advance(engine, 1e-3, 200)
    # The frame turns by Δt ω within a step
    assert state.velocity[:, 2] == pytest.approx([spin, spin], rel=1e-4)
    assert np.hypot(*(state.position[0] - state.position[1])[:2]) == pytest.approx(0.2, rel=1e-6)


@pytest.fixture(scope="module", params=["exact", "bipotential"])
def sheared(request):
    """Plane shear with both laws under a loaded lid; the state before the last step, and the engine
    after it."""
    tight = Settings(
        tolerance_rms=1e-9, tolerance_max=1e-8, tolerance_energy=1e-9, max_sweeps=50_000,
        local=request.param,
    )  # fmt: skip
    engine = shear_engine(columns=8, rows=8, adhesion=1.0, rolling=0.3)
    advance(engine, 0.02, 150)
    before = copy_of(engine.state)
    resume(engine, settings=tight)
    engine.step(0.02, 0.0)
    return before, engine


def _bodies(engine, before, after):
    """Grain i, grain or -1 - wall j, lever of j, and both spins before and after of each contact,
    in plain Python."""
    scene, contacts, *_ = engine.mechanics.moved
    n = engine.model.grain_count
    for c, (i, j) in enumerate(zip(contacts["i"], contacts["j"], strict=True)):
        wall = int(scene.wall[j - n]) if j >= n else -1
        spins = [
            (s.velocity[i, 2], s.wall_velocity[wall, 2] if j >= n else s.velocity[j, 2])
            for s in (before, after)
        ]
        other = scene.radius[j] if j < n else (engine.model.shapes.geometry[j - n, 2])
        yield (
            c,
            int(i),
            int(j) if j < n else -1 - wall,
            scene.radius[i] * other / (scene.radius[i] + other),
            spins,
        )


def test_couples_of_a_flow_obey_their_law(sheared):
    """|M| ≤ μ_r a* q_n, and equal to it, against the relative spin, where contacts roll."""
    before, engine = sheared
    contacts, count = engine.mechanics.moved.contacts, 0
    for c, _, _, arm, (_, (first, second)) in _bodies(engine, before, engine.state):
        contact = contacts[c]
        bound, couple = 0.3 * arm * contact.p_n, contact.arm * contact.p_r
        assert abs(couple) <= bound * (1.0 + 1e-12)
        if abs(arm * (first - second)) > 1e-6 and contact.p_n > 1e-6:
            assert couple == pytest.approx(-np.sign(first - second) * bound, rel=1e-9)
            count += 1
    assert count > 10


def test_impulses_and_couples_are_what_changes_velocities(sheared):
    """M (v⁺ − v⁻) = Δt F + H p, body by body, with p_n of the table (tension is negative) and its
    couples."""
    before, engine = sheared
    table, model, after = engine.contacts(), engine.model, engine.state
    change = model.grains.mass[:, None] * (after.velocity[:, :2] - before.velocity[:, :2])
    spin = model.grains.inertia * (after.velocity[:, 2] - before.velocity[:, 2])
    radius = model.grains.radius
    for c, i, j, _, _ in _bodies(engine, before, after):
        (nx, ny), (p_n, p_t) = table.normal[c], table.impulse[c]
        force = np.array([p_n * nx - p_t * ny, p_n * ny + p_t * nx])
        change[i] -= force
        spin[i] -= -radius[i] * p_t + table.couple[c]
        if j >= 0:
            change[j] += force
            spin[j] -= -radius[j] * p_t - table.couple[c]
    scale = np.abs(table.impulse).max()
    assert np.abs(change).max() < 1e-10 * scale
    assert np.abs(spin).max() < 1e-10 * scale


def test_books_close_and_steps_converge_in_flows():
    engine = shear_engine(adhesion=1.0, rolling=0.3)
    state = advance(engine, 0.02, 200)
    assert book(state, "closure") < 1e-12
    assert tally(state, "unconverged_steps") == 0


def test_a_patch_of_all_contacts_and_couples_is_the_solution():
    engine = shear_engine(columns=8, rows=8, rolling=0.3)
    advance(engine, 0.02, 150)
    system = engine.next_system(0.02, 0.0).system
    couples = system.couples.impulse.copy()
    assert measure_residual(system, False)[1] > 1e-9
    # Clusters that do not touch one another have a patch each, and contacts that were open may have
    # closed
    for _ in range(20):
        assert solve_patch(system, choose_patch(system, 10_000, nothing_met(system)))
    rms, largest, energy, active = measure_residual(system, False)
    assert largest < 1e-12 * abs(system.velocity[:, :3]).max()
    assert rms <= largest
    assert energy < 1e-12
    assert active > np.count_nonzero(system.impulse[:, 0])
    assert (system.couples.impulse != couples).any()


def test_patches_change_only_their_couples_and_keep_the_equation_of_motion():
    engine = shear_engine(columns=8, rows=8, rolling=0.3)
    advance(engine, 0.02, 150)
    system = engine.next_system(0.02, 0.0).system
    couples, impulse = system.couples.impulse.copy(), system.impulse.copy()
    assert np.count_nonzero(couples)
    assert solve_patch(system, choose_patch(system, 30, nothing_met(system)))
    assert 0 < np.count_nonzero(system.couples.impulse != couples) <= 30
    assert (system.impulse != impulse).any()
    fresh = engine.next_system(0.02, 0.0).system
    assert np.abs(_free(system) - _free(fresh)).max() < 1e-12


def _free(system):
    """Velocities of a system without its impulses and couples."""
    bare = system._replace(
        velocity=system.velocity.copy(), impulse=-system.impulse,
        general_impulse=-system.general_impulse,
        couples=system.couples._replace(impulse=-system.couples.impulse),
    )  # fmt: skip
    add_impulses(bare)
    return bare.velocity
