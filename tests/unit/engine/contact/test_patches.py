"""Clusters of contacts as linear complementarity problems."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from places import DATA
from scene_parts import advance, shear_engine
from shapes import rod, shaped_engine, shaped_model

from multicor_cli.engine.contact import patches, solve, sweep
from multicor_cli.engine.contact.acceleration import NEVER, iterate, start_loop, start_momentum
from multicor_cli.engine.contact.complementarity import solve_complementarity
from multicor_cli.engine.contact.law import solve_full
from multicor_cli.engine.contact.patches import (
    choose_patch,
    nothing_met,
    solve_patch,
)
from multicor_cli.engine.contact.problem import ContactProblem, _general_system
from multicor_cli.engine.contact.residual import measure_residual
from multicor_cli.engine.contact.solve import ResidualScale, ThreadChoice, solve_system
from multicor_cli.engine.contact.vector_sweep import TANGENTIAL_, impulse_place
from multicor_cli.engine.jit.arrays import aligned
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.orders import Settings
from multicor_cli.model import ShapeKind
from multicor_cli.model.columns import NX, NY


def solved(matrix, vector):
    z = np.empty(len(vector))
    found = solve_complementarity(np.asarray(matrix, float), np.asarray(vector, float), 100, z)
    return z if found else None


def complementary_solutions(matrix, vector):
    """All solutions with regular bases, by trying every choice of what vanishes."""
    n = len(vector)
    for is_basic in itertools.product([False, True], repeat=n):
        chosen = [k for k in range(n) if is_basic[k]]
        z = np.zeros(n)
        if chosen:
            block = matrix[np.ix_(chosen, chosen)]
            if abs(np.linalg.det(block)) < 1e-12:
                continue
            z[chosen] = np.linalg.solve(block, -vector[chosen])
        if (z >= -1e-9).all() and (vector + matrix @ z >= -1e-9).all():
            yield z


@pytest.mark.parametrize("seed", range(20))
def test_complementarity_with_a_positive_matrix_has_its_one_solution(seed):
    random = np.random.default_rng(seed)
    root = random.normal(size=(6, 6))
    matrix, vector = root @ root.T + 0.1 * np.eye(6), random.normal(size=6)
    (expected,) = complementary_solutions(matrix, vector)
    assert solved(matrix, vector) == pytest.approx(expected, abs=1e-9)


def test_complementarity_without_solution_is_told():
    assert solved([[-1.0]], [-1.0]) is None  # w = −1 − z
    assert solved([[0.0]], [-1.0]) is None
    assert solved([[1.0]], [2.0]).tolist() == [0.0]
    random = np.random.default_rng(1)
    root = random.normal(size=(8, 8))
    assert not solve_complementarity(root @ root.T, -np.ones(8), 1, np.empty(8))


def on_the_ground(bias, tangential, friction):
    """A body on the ground, with a lever that couples the normal and the tangent."""
    return ContactProblem(
        inverse_mass=np.array([[2.0, 2.0, 3.0], [0.0, 0.0, 0.0]]),
        velocity=np.array([[tangential, -1.0, 0.3], [0.0, 0.0, 0.0]]),
        pair=np.array([[0, 1]], np.int32),
        normal=np.array([[0.0, 1.0]]),
        lever=np.array([[[0.1, -1.0], [0.0, 0.0]]]),
        bias=np.array([bias]),
        friction=np.array([friction]),
    )


ONE = list(itertools.product([0.0, 0.4, 2.0], [-3.0, -0.2, 0.1, 5.0], [0.0, 0.3, 0.9]))


@pytest.mark.parametrize(("bias", "tangential", "friction"), ONE)
def test_one_contact_is_solved_as_by_enumeration(bias, tangential, friction):
    problem = on_the_ground(bias, tangential, friction)
    system = _general_system(problem, np.zeros((1, 2)))
    w_nn, w_nt, w_tt = problem.delassus()[0]
    u_n, u_t = (
        -1.0 + bias + 0.3 * problem.levers()[0, 0, 0],
        -tangential + 0.3 * problem.levers()[0, 0, 1],
    )
    assert solve_patch(system, choose_patch(system, 5, nothing_met(system)))
    expected = solve_full(0.0, 0.0, u_n, u_t, w_nn, w_nt, w_tt, friction)
    assert system.general_impulse[0] == pytest.approx(expected, abs=1e-12)


SHARP = Settings(tolerance_rms=1e-3, tolerance_max=5e-2)


def layer(columns):
    engine = shear_engine(columns=columns, rows=6)
    advance(engine, 0.02, 60)
    system = engine.next_system(0.02, 0.0).system
    return system._replace(velocity=system.velocity.copy(), impulse=system.impulse.copy())


def test_a_patch_of_all_contacts_is_the_solution():
    system = layer(8)
    assert measure_residual(system, False)[1] > 1e-9
    for _ in range(3):  # contacts that were open may have closed
        assert solve_patch(system, choose_patch(system, 10_000, nothing_met(system)))
    rms, largest, energy, _ = measure_residual(system, False)
    assert largest < 1e-12 * abs(system.velocity[:, :3]).max()
    assert rms <= largest
    assert energy < 1e-12


def test_a_patch_mends_the_worst_contact_and_leaves_the_rest():
    system = layer(300)
    active, square = patches._measure(system)
    worst = int(square.argmax())
    chosen = patches._around(worst, 6, active, square, system).tolist()
    assert chosen[0] == worst
    loaded = int(system.impulse[:, 0].argmax())
    for first in (worst, loaded):
        around = patches._around(first, 6, active, square, system).tolist()
        assert len(set(around)) == len(around) <= 6
    assert len(around) == 6
    before = system.impulse.copy()
    assert solve_patch(system, choose_patch(system, 6, nothing_met(system)))
    contacts = (system.impulse != before).any(axis=1).reshape(-1)
    assert np.count_nonzero(contacts) > 0
    assert set(np.flatnonzero(contacts).tolist()) <= set(chosen)
    assert int(patches._measure(system)[1].argmax()) not in chosen


def test_clusters_are_told_from_errors_that_are_spread():
    system = layer(300)
    bodies = system.inverse.shape[0]
    system.velocity[:bodies, :3] += np.random.default_rng(1).normal(size=(bodies, 3))
    assert not patches.has_clusters(system)
    loaded = int(system.impulse[:, 0].argmax())
    body = system.pair[loaded // 4, 0, loaded % 4] // 4
    system.velocity[body, 0] += 1e4
    assert patches.has_clusters(system)


def test_a_patch_keeps_velocities_and_impulses_together():
    """What the impulses have pushed is what the velocities have gained."""
    system = layer(30)
    free = system._replace(velocity=system.velocity.copy())
    sweep.add_impulses(
        free._replace(impulse=-system.impulse, general_impulse=-system.general_impulse)
    )
    assert solve_patch(system, choose_patch(system, 60, nothing_met(system)))
    sweep.add_impulses(
        free._replace(impulse=system.impulse, general_impulse=system.general_impulse)
    )
    assert free.velocity == pytest.approx(
        system.velocity, rel=1e-9, abs=1e-9 * abs(system.velocity).max()
    )


def test_held_contacts_stay_as_they_are():
    system = layer(30)
    chosen = choose_patch(system, 60, nothing_met(system))
    frame, kept = system.frame.copy(), system.impulse.copy()
    mass = patches.hold(system, chosen)
    loop, momentum = start_loop(system.contacts), start_momentum(system)
    iterate(
        system, momentum, sweep.EXACT, True, False, 10, False, NEVER, loop,
        np.empty((system.tile_start.size - 1, 2)),
    )  # fmt: skip
    changed = np.flatnonzero((system.impulse != kept).any(axis=1).reshape(-1))
    assert changed.size > 0
    assert not set(changed.tolist()) & set(chosen.tolist())
    patches.release(system, chosen, mass)
    assert np.array_equal(system.frame, frame)


def hard_step(name="hard-step"):
    """A step of plane shear at μ = 0.8, I = 0.003, that sweeps and patches which are swept over
    again do not solve."""
    with np.load(DATA / f"{name}.npz") as file:
        stored = {name: file[name] for name in file.files}
    arrays = {}
    for name in sweep.System._fields[:12]:
        arrays[name] = stored[name].copy()
        if stored[name].dtype == float:
            arrays[name] = aligned(stored[name].shape)
            arrays[name][...] = stored[name]
    scale = ResidualScale(*stored["scale"].tolist())
    return sweep.System(
        **arrays, spin_factor=float(stored["spin"][0]), contacts=int(stored["contacts"][0]),
    ), scale  # fmt: skip


def test_a_cluster_that_sweeps_leave_is_solved_by_turns(monkeypatch):
    system, scale = hard_step()
    found = solve_system(system, scale, SHARP, ThreadChoice())
    assert found.converged
    assert found.sweeps < 10_000
    monkeypatch.setattr(solve, "TURNS", 0)
    system, scale = hard_step()
    few = replace(SHARP, max_sweeps=10_000)
    assert not solve_system(system, scale, few, ThreadChoice()).converged


def test_what_fresh_momentum_does_not_help_is_patched_though_many_are_wrong():
    """A step of a biaxial test of 297 contacts, of which no few have half of the errors."""
    system, scale = hard_step("stuck-step")
    found = solve_system(
        system, scale, Settings(tolerance_rms=2e-4, max_sweeps=20_000), ThreadChoice()
    )
    assert found.converged


def test_a_cluster_that_only_the_largest_correction_sees_is_solved():
    # Among 10⁵ contacts it keeps neither the rms nor the change per sweep above their tolerances;
    # loose ones do the same to few.
    system, scale = hard_step()
    few_see_it = Settings(
        tolerance_rms=1.0, tolerance_energy=1.0, tolerance_max=0.01, max_sweeps=10_000
    )
    found = solve_system(system, scale, few_see_it, ThreadChoice())
    assert found.converged
    assert found.sweeps < 5_000


def test_impulses_that_velocities_hardly_feel_are_no_solution():
    # A rod in a wedge that friction just does not lock: what a jam has left fades by 10⁻¹⁰ a sweep.
    c, s = np.cos(np.arctan(0.6)), np.sin(np.arctan(0.6))
    planes = [(ShapeKind.PLANE, 0, (0.0, 0.0, side * c, s)) for side in (1.0, -1.0)]
    model = shaped_model([[(rod(0.2), 0.1)]], planes, friction=0.6 * (1.0 - 1e-10))
    mass, speed, height = model.grains.mass[0], 0.1, (0.1 + 0.1 * c) / s
    system = shaped_engine(model, [[0.0, height, 0.0]]).next_system(0.01, 0.0).system
    system.velocity[0, :3] = 0.0
    nx, ny = system.general_frame[:, [NX, NY]].T
    points, left = np.flatnonzero(nx), 1e6 * mass * speed  # in lanes, of which others are empty
    system.general_impulse[points] = left * np.column_stack([nx, -ny])[points] / nx[points, None]
    scale = ResidualScale(speed, speed, 0.5 * mass * speed * speed)
    found = solve_system(system, scale, SHARP, ThreadChoice())
    assert found.converged
    assert found.sweeps < 1_000
    assert system.general_impulse[:, 0].max() < mass * speed


def test_plain_sweeps_solve_no_patch(monkeypatch):
    monkeypatch.setattr(solve, "solve_patch", lambda *_: pytest.fail("a patch"))
    system, scale = hard_step()
    few_see_it = Settings(
        "gauss-seidel", tolerance_rms=1.0, tolerance_energy=1.0, tolerance_max=1e-6,
        max_sweeps=2_000,
    )  # fmt: skip
    assert not solve_system(system, scale, few_see_it, ThreadChoice()).converged


@kernel
def pushed(s, velocity, impulse, general):
    """Velocities after the impulses have changed from those given to those of the system."""
    lanes, pair, frame = s.slot.size, s.pair.reshape(-1), s.frame.reshape(-1)
    now, before = s.impulse.reshape(-1), impulse.reshape(-1)
    for k in range(lanes):
        n = impulse_place(np.uint64(k))
        t = n + TANGENTIAL_
        sweep.push_lane(
            np.uint64(k), now[n] - before[n], now[t] - before[t], velocity.reshape(-1), pair, frame,
            s.spin_factor,
        )  # fmt: skip
    for g in range(s.general_pair.shape[0]):
        d_n, d_t = s.general_impulse[g, 0] - general[g, 0], s.general_impulse[g, 1] - general[g, 1]
        sweep.push_general(
            g,
            d_n,
            d_t,
            velocity,
            s.inverse,
            s.general_pair,
            s.general_frame,
            s.general_lever,
            s.cell,
        )


@pytest.mark.parametrize("turns", [1, 3, 40])
def test_velocities_after_turns_are_those_that_the_impulses_make(monkeypatch, turns):
    # Velocities run ahead of the impulses between two accelerated sweeps: whatever is done there
    # would stay in no book.
    monkeypatch.setattr(solve, "TURNS", turns)
    system, scale = hard_step()
    velocity, impulse, general = (
        system.velocity.copy(), system.impulse.copy(), system.general_impulse.copy(),
    )  # fmt: skip
    solve_system(system, scale, Settings(max_sweeps=6_000), ThreadChoice())
    pushed(system, velocity, impulse, general)
    assert np.abs(system.velocity - velocity)[:, :3].max() < 1e-10 * np.abs(velocity[:, :3]).max()


def test_turns_give_the_same_bits_for_any_number_of_threads(monkeypatch):
    found = []
    for parallel in (False, True):
        monkeypatch.setattr(ThreadChoice, "choose", lambda _, contacts, parallel=parallel: parallel)
        system, scale = hard_step()
        solve_system(system, scale, Settings(), ThreadChoice(2))
        found.append(system.impulse.tobytes() + system.velocity.tobytes())
    assert found[0] == found[1]
