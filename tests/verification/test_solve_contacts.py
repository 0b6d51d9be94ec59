"""The contact solver alone: agreement of methods, budgets of sweeps, files, another solver."""

import os
import shutil
import subprocess

import numpy as np
import pytest
from contact_problems import column_problem, dense_delassus, heap_problem, tilted
from places import SUPPORT
from scene_parts import shear_engine

from multicor_cli.engine import ContactProblem, Settings, solve_contacts
from multicor_cli.engine.contact.acceleration import PATIENCE

TIGHT = {
    "tolerance_rms": 1e-11, "tolerance_max": 1e-9, "tolerance_energy": 1e-9, "max_sweeps": 100_000,
}  # fmt: skip
LOOSE = {"tolerance_max": 1.0, "tolerance_energy": 1e9}
METHODS = [
    (m, local) for m in ("gauss-seidel", "accelerated") for local in ("exact", "bipotential")
]


def test_column_from_a_cold_start_meets_the_budget():
    """116 layers: ≤ 500 sweep-equivalents to rms 10⁻⁴ g Δt, ≤ 700 to a force error of 10⁻⁴
    (benchmarks/README.md)."""
    problem = column_problem(116)
    solution, tight = (
        solve_contacts(problem, Settings(**LOOSE, tolerance_rms=rms), reference_velocity=9.81e-3)
        for rms in (1e-4, 1e-6)
    )
    assert solution.converged
    assert solution.sweeps <= 500
    exact = 9.81e-3 * np.arange(116, 0, -1)
    assert np.abs(tight.impulse[:, 0] - exact).max() / exact[0] < 1e-4
    assert tight.sweeps <= 700


def test_plain_sweeps_need_what_theory_says():
    """4 ln(10⁴)/π² n² sweeps for a column (theory §5.1), which the accelerated method must beat."""
    problem = column_problem(20)
    plain, fast = (
        solve_contacts(
            problem, Settings(method=method, tolerance_rms=1e-7, max_sweeps=100_000, **LOOSE),
            reference_velocity=9.81e-3,
        )
        for method in ("gauss-seidel", "accelerated")
    )  # fmt: skip
    assert plain.converged
    assert plain.sweeps > 1000
    assert fast.sweeps < 0.2 * plain.sweeps


@pytest.mark.parametrize(("restitution", "friction"), [(0.0, 0.5), (0.0, 0.0), (0.4, 0.3)])
def test_all_methods_agree(restitution, friction):
    """Plain, accelerated, exact, bipotential, disc or general: one velocity field.

    These problems have one; with friction not every problem does (`benchmarks/uniqueness`).
    """
    problem = heap_problem(friction=friction, restitution=restitution)
    assert len(problem.pair) > 30
    reference = solve_contacts(problem, Settings(method="gauss-seidel", **TIGHT))
    scale = np.abs(reference.velocity[:, :2]).max()
    for method, local in METHODS:
        for variant in (problem, tilted(problem)):
            settings = Settings(method=method, local=local, **TIGHT)
            solution = solve_contacts(variant, settings, start=0.9 * reference.impulse)
            assert solution.converged, (method, local)
            apart = np.abs(solution.velocity - reference.velocity)[:, :2].max()
            assert apart < 1e-7 * scale, (method, local)


def test_solution_satisfies_the_law_and_the_dynamics():
    problem = heap_problem()
    solution = solve_contacts(problem, Settings(**TIGHT))
    w, q = dense_delassus(problem)
    u = (w @ solution.impulse.ravel() + q).reshape(-1, 2)
    p_n, p_t = solution.impulse.T
    scale = np.abs(q).max()
    assert (p_n >= 0.0).all()
    assert (u[:, 0] > -1e-8 * scale).all()
    assert np.abs(p_n * u[:, 0]).max() < 1e-8 * scale * p_n.max()
    assert (np.abs(p_t) <= problem.friction * p_n * (1.0 + 1e-12)).all()
    sliding = np.abs(u[:, 1]) > 1e-6 * scale
    assert sliding.any()
    against = -(problem.friction * p_n * np.sign(u[:, 1]))[sliding]
    assert p_t[sliding] == pytest.approx(against, abs=1e-9 * p_n.max())
    # Momentum: M (v − v_free) = Hᵀ p, seen through the velocities of the contacts.
    recomputed = ContactProblem(
        problem.inverse_mass, solution.velocity, problem.pair, problem.normal, problem.lever,
        problem.bias, problem.friction,
    )  # fmt: skip
    assert dense_delassus(recomputed)[1] == pytest.approx(u.ravel(), abs=1e-9 * scale)


def test_problem_files_round_trip_and_are_checked(tmp_path):
    problem = heap_problem()
    problem.save(tmp_path / "heap.npz")
    again = ContactProblem.load(tmp_path / "heap.npz")
    assert np.array_equal(solve_contacts(problem).impulse, solve_contacts(again).impulse)
    with np.load(tmp_path / "heap.npz") as data:
        arrays = dict(data)
    short = arrays["friction"][:-1]
    for wrong, words in ((short, "has shape"), (np.append(short, np.nan), "holds a value that is")):
        np.savez(tmp_path / "bad.npz", **{**arrays, "friction": wrong})
        with pytest.raises(ValueError, match=f"friction {words}"):
            ContactProblem.load(tmp_path / "bad.npz")


def test_nothing_to_solve_costs_no_sweep():
    problem = column_problem(3, weight=0.0)
    solution = solve_contacts(problem)
    assert solution.converged
    assert solution.sweeps == 0
    assert not solution.impulse.any()


def _siconos_python():
    """The interpreter that can import Siconos, or None."""
    for name in (os.environ.get("SICONOS_PYTHON"), "/usr/bin/python3", "python3"):
        python = shutil.which(name or "")
        probe = [python, "-c", "import siconos.numerics"]
        if python and subprocess.run(probe, capture_output=True, check=False).returncode == 0:
            return python
    return None


@pytest.mark.siconos
@pytest.mark.parametrize(("seed", "friction"), [(0, 0.5), (1, 0.3), (2, 0.05)])
def test_siconos_finds_the_same_solution(tmp_path, seed, friction):
    """The same velocities by fc2d_nsgs here (with friction, these and forces may not be unique)."""
    python = _siconos_python()
    if python is None:
        pytest.skip("Siconos is not installed (set SICONOS_PYTHON to an interpreter that has it)")
    problem = heap_problem(seed, friction=friction)
    w, q = dense_delassus(problem)
    np.savez(tmp_path / "in.npz", W=w, q=q, mu=problem.friction, tolerance=1e-12)
    worker = SUPPORT / "siconos_worker.py"
    subprocess.run(
        [python, worker, tmp_path / "in.npz", tmp_path / "out.npz"], check=True, timeout=300
    )
    with np.load(tmp_path / "out.npz") as out:
        theirs, status = out["reaction"], int(out["status"])
    assert status == 0
    ours = solve_contacts(problem, Settings(**TIGHT)).impulse.ravel()
    scale = np.abs(q).max()
    assert np.abs(w @ (ours - theirs)).max() < 1e-6 * scale


def test_the_bipotential_solves_flows_before_there_are_patches():
    """With the momentum of exact local solves it cycled for ever."""
    engine = shear_engine(
        columns=24, rows=20, settings=Settings(local="bipotential", max_sweeps=int(PATIENCE))
    )
    reports = [engine.step(0.02, 0.02 * k) for k in range(60)]
    assert reports[-1].contacts > 10
    assert all(report.converged for report in reports)
