"""Contact problems with friction can have several solutions: two recorded ones, two by hand, one
without friction."""

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from benchmark_modules import benchmark_modules
from places import DATA

from multicor_cli.engine import ContactProblem, Settings, solve_contacts

RECORDED = DATA / "two-solutions.npz"
# of the largest approach velocity: round-off and the tolerance they were solved to, with room
EXACT = 1e-9


@pytest.fixture(scope="module", autouse=True)
def _on_path():
    with benchmark_modules("uniqueness"):
        yield


@pytest.fixture(scope="module")
def recorded():
    """The problem, and impulses and velocities of its two solutions."""
    with np.load(RECORDED, allow_pickle=False) as stored:
        pairs = [(stored[f"impulse{k}"], stored[f"velocity{k}"]) for k in (0, 1)]
    return ContactProblem.load(RECORDED), pairs


def test_a_recorded_problem_has_two_solutions(recorded):
    """Both obey all laws to 1e-9 of the largest approach velocity, and contacts differ by more than
    a twentieth of it."""
    from law import approach_velocity, contact_velocity, pushed, violations

    problem, pairs = recorded
    for impulse, velocity in pairs:
        assert violations(problem, impulse, velocity).worst < EXACT
        assert violations(problem, impulse, pushed(problem, impulse)).worst < EXACT
    one, other = (
        contact_velocity(problem, velocity) / approach_velocity(problem) for _, velocity in pairs
    )
    apart = np.linalg.norm(one - other, axis=1)
    assert apart.max() > 0.05
    assert (apart > 0.01).sum() >= 3


def test_the_solver_accepts_both(recorded):
    """From either solution it does not move: both pass its own residuals, far below what is asked
    for in a run."""
    from law import approach_velocity, contact_velocity

    problem, pairs = recorded
    for impulse, velocity in pairs:
        for method in ("gauss-seidel", "accelerated"):
            settings = Settings(method=method, tolerance_rms=1e-8)
            found = solve_contacts(problem, settings, start=impulse)
            assert found.converged
            moved = contact_velocity(problem, found.velocity) - contact_velocity(problem, velocity)
            assert np.abs(moved).max() < 1e-6 * approach_velocity(problem)


def test_without_friction_the_same_problem_has_one(recorded):
    from law import approach_velocity, contact_velocity, violations

    problem, pairs = recorded
    control = replace(problem, friction=np.zeros_like(problem.friction))
    settings = Settings(
        tolerance_rms=1e-12, tolerance_max=1e-10, tolerance_energy=1e-9, max_sweeps=50_000
    )
    starts = [np.zeros_like(pairs[0][0]), *(impulse * [1.0, 0.0] for impulse, _ in pairs)]
    velocities = []
    for method in ("gauss-seidel", "accelerated"):
        for start in starts:
            found = solve_contacts(control, replace(settings, method=method), start=start)
            assert violations(control, found.impulse, found.velocity).worst < EXACT
            velocities.append(contact_velocity(control, found.velocity))
    assert np.ptp(velocities, axis=0).max() < 1e-8 * approach_velocity(control)


def test_the_check_sees_every_violation(recorded):
    """Each condition broken on purpose is named by its own number."""
    from law import approach_velocity, violations

    problem, pairs = recorded
    impulse, velocity = pairs[0]
    scale = approach_velocity(problem)
    unit = scale / problem.inverse_mass[problem.pair, 0].sum(axis=1)
    sticks = np.abs(impulse[:, 1]) < 0.4 * problem.friction * impulse[:, 0]
    sticking = np.flatnonzero((impulse[:, 0] > 0.1 * unit) & sticks)[0]
    broken = impulse.copy()
    broken[sticking, 0] = -0.1 * unit[sticking]
    assert violations(problem, broken, velocity).pull == pytest.approx(0.1)
    broken = impulse.copy()
    broken[sticking, 1] = problem.friction[sticking] * impulse[sticking, 0] + 0.1 * unit[sticking]
    assert violations(problem, broken, velocity).cone == pytest.approx(0.1)
    assert violations(problem, broken, velocity).momentum > 0.01
    assert violations(problem, impulse, problem.velocity).approach == pytest.approx(1.0)
    turned = impulse * [1.0, -1.0]
    assert violations(problem, turned, velocity).driving > 0.001
    assert violations(problem, 1e3 * np.abs(impulse) * [1.0, 0.0], velocity).slip > 0.01
    parted = velocity + np.where(problem.inverse_mass > 0.0, 10.0 * scale, 0.0) * [0.0, 1.0, 0.0]
    assert violations(problem, impulse, parted).both > 0.05


def test_a_disc_in_a_wedge_by_hand():
    """It may leave or stay: both without rounding. Without friction, or with too little, it
    leaves."""
    from wedge import CHANGEABLE, FRICTION, as_problem, holding, is_solution, velocity_after

    assert velocity_after(CHANGEABLE) == (1, 0, 0)
    assert is_solution(CHANGEABLE)
    for share in (FRICTION, Fraction(2, 5), Fraction(3, 10)):
        assert velocity_after(holding(share)) == (0, 0, 0)
        assert is_solution(holding(share))
        assert not is_solution(holding(share), friction=Fraction(0))
    assert not is_solution(holding(FRICTION), friction=Fraction(1, 4))
    assert is_solution(CHANGEABLE, friction=Fraction(0))
    problem = as_problem()
    for impulses, speed in ((CHANGEABLE, 1.0), (holding(FRICTION), 0.0)):
        for method in ("gauss-seidel", "accelerated"):
            start, settings = np.array(impulses, float), Settings(method=method, tolerance_rms=1e-9)
            found = solve_contacts(problem, settings, reference_velocity=1.0, start=start)
            assert found.converged
            assert found.velocity[0] == pytest.approx([speed, 0.0, 0.0], abs=1e-9)


def test_chances_and_forces_are_compared_contact_by_contact():
    """All signs equal: two choices in 2ⁿ. Differences that cancel: every choice."""
    from samples import chance, shift

    assert chance(np.array([1.0, 1.0, 1.0, 1.0])) == 2 / 16
    assert chance(np.array([1.0, -1.0])) == 1.0
    assert shift([2.0, 4.0], [1.0, 1.0]).mean == 2.0
    assert shift([2.0, 4.0], [1.0, 1.0]).error == pytest.approx(1.0)
    assert chance(np.ones(20)) < 0.01
    from rest import apart

    one = {(0, 1): np.array([3.0, 0.0])}
    other = one | {(1, 2): np.array([0.0, 4.0])}
    assert apart(one, one) == 0.0
    assert apart(one, other) == pytest.approx(4.0 / np.sqrt(0.5 * (9.0 + 25.0)))


def test_a_nudge_is_taken_back(monkeypatch):
    import os

    from driving import begin, nudging
    from scenes import bed

    monkeypatch.delenv("MULTICOR_NUDGE", raising=False)
    plain = begin(bed(12, 1, 0.01)).state.position
    with nudging(3):
        assert os.environ["MULTICOR_NUDGE"] == "3"
    assert "MULTICOR_NUDGE" not in os.environ
    assert 0.0 < np.abs(begin(bed(12, 1, 0.01), nudge=3).state.position - plain).max() < 1e-12


def test_small_parts_of_every_kind(tmp_path):
    """The real parts on something small: problems, a flow, rest, the tables and the figure."""
    pytest.importorskip("matplotlib")
    import flows
    from figure import draw
    from report import as_text
    from scenes import DIAMETER
    from study import Plan, run_study

    kinds, steps = [flows.shear_flow(60, 0.1, 0.3, 0.3, 1e-3)], 6
    rests = (30, 0.15), (30, 0.08, 0.2), steps
    plan = Plan(1, [30], {30: [0.03]}, 3_000, 1, kinds, *rests, siconos=False)
    results = run_study(plan, ["problems", "flows", "rest"], lambda _: None)
    (problem,) = results.problems
    assert problem.row.solves == 8
    assert problem.control.solved > 0
    assert problem.control.distinct == 1
    (flow,) = results.flows
    assert set(flow.values) == {"μ*", "solid fraction", "δv_y²/(γ̇d)²", "spin/γ̇"}
    assert all(0 <= flow.unconverged[way] < 0.1 * flow.steps[way] for way in flows.WAYS)
    assert 0.1 < flow.sample("μ*", "plain").mean < 1.0
    assert [one.scene for one in results.rests] == ["bed in a box", "pile"]
    for one in results.rests:
        duration = steps * 2e-4
        # The fastest grain may still be on its way: it goes on, or comes to a stop on the floor
        for row in one.rows:
            assert abs(row.floor) < 0.02 + 2.0 * one.speed / (9.81 * duration)
            assert row.moved < 0.02 + 2.0 * one.speed * duration / DIAMETER
            assert 1.0 / row.contacts <= row.participation <= 1.0
    json.dumps(results.as_dict())
    assert "bed in a box: 30 grains" in as_text(results)
    assert draw(results, tmp_path / "out.png").stat().st_size > 10_000


def test_a_recorded_solution_is_one_of_a_family(recorded):
    """Impulses may change along a line, either way: every point of it is a solution, and velocities
    differ."""
    from family import undetermined
    from law import approach_velocity, contact_velocity, pushed, violations

    problem, (_, (impulse, velocity)) = recorded
    (change,) = undetermined(problem, impulse)
    for step in (-0.005, 0.005):
        moved = impulse + step * change
        after = pushed(problem, moved)
        assert violations(problem, moved, after).worst < EXACT
        apart = contact_velocity(problem, after) - contact_velocity(problem, velocity)
        assert np.abs(apart).max() == pytest.approx(0.005 * approach_velocity(problem), rel=1e-3)
