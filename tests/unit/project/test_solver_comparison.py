"""The comparison of solvers: all methods solve what has one solution, distances mean what they say,
and the quick run works."""

import json
from dataclasses import replace

import numpy as np
import pytest
from benchmark_modules import benchmark_modules
from places import DATA, ROOT

from multicor_cli import run
from multicor_cli.engine import ContactProblem, Settings, solve_contacts
from multicor_cli.engine.contact.problem import _disc_system, _general_system, free_velocity
from multicor_cli.engine.contact.system import flatten
from multicor_cli.model.columns import INVERSE_MASS

pytest.importorskip("scipy")

METHODS = [
    "gs", "gs-sym", "sor-1.5", "engine", "restart-2", "restart-1.5", "skip", "tiles-2", "tiles-3",
    "sym", "cpg", "apgd",
    "anderson-5", "levels", "newton",
]  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def solvers():
    with benchmark_modules("solvers") as modules:
        yield modules


def test_these_are_all_methods(solvers):
    assert list(solvers.methods.METHODS) == METHODS


def test_recorded_problems_are_those_of_their_steps_and_are_read_as_they_were(solvers, tmp_path):
    """Of a flow, whose next steps write into the same lanes, where pairs come late, too."""
    made, read = (solvers.problems.consecutive("shear", 1008, 1, 6, tmp_path) for _ in range(2))
    assert len(list(tmp_path.iterdir())) == 1
    for one, other in zip(made, read, strict=True):
        system = one.system
        filled = (system.slot >= 0).sum() + len(system.general_pair)
        assert filled == one.contacts
        assert one.scale == other.scale
        for name, value in zip(system._fields, system, strict=True):
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(value, getattr(other.system, name))
    assert len({one.system.frame.tobytes() for one in made}) == len(made)


# The others take a minute of compilation.
QUICK = ("gs", "engine", "newton")
SLOW = [pytest.param(name, marks=pytest.mark.validation) for name in METHODS if name not in QUICK]


@pytest.mark.parametrize("name", [*QUICK, *SLOW])
def test_every_method_finds_the_weights_in_a_column(solvers, name):
    problem = solvers.problems.column(12)
    error = solvers.study.exact_error(
        problem, solvers.reference.solve_closely(problem), solvers.methods.METHODS[name], 1e-6, 2000
    )
    assert error < 1e-4


def test_the_distance_falls_with_the_residual(solvers):
    DISTANCE, RMS = solvers.methods.operators.DISTANCE, solvers.methods.operators.RMS
    problem = solvers.problems.column(40)
    reference = solvers.reference.solve_closely(problem)
    history = solvers.comparison.trace(
        problem, reference, solvers.methods.METHODS["engine"], 1e-5, 2000
    )
    assert reference.rms <= 1e-6
    # Nothing moves in the solution, and everything by g dt at the start, which is what distances
    # are measured in.
    assert history[0, DISTANCE] == pytest.approx(1.0, rel=1e-4)
    assert history[-1, RMS] <= 1e-5
    assert history[-1, DISTANCE] < 1e-3
    middle = len(history) // 2
    assert history[middle:, DISTANCE].max() < history[:middle, DISTANCE].max()


def test_costs_are_read_off_the_right_rows(solvers):
    rows = [
        [1.0, 9, 9, 0.5, 0, 0], [5e-4, 9, 9, 0.05, 1, 0.1], [9e-4, 1e-2, 1e-3, 0.2, 2, 0.2],
        [1e-5, 1e-5, 1e-5, 0.09, 3, 0.3],
    ]  # fmt: skip
    curve = solvers.comparison.Curve("some", np.array(rows))
    assert curve.first(1e-3) == (2.0, 0.2, 0.2)  # the second row is below in one of three only
    assert curve.first(1e-6) is None
    assert curve.near(0.1) == 0.3  # it was below before, but did not stay
    assert curve.near(0.05) is None
    assert curve.near(1.0) == 0.0


def test_starts_keep_velocities_and_impulses_together(solvers):
    problem = solvers.problems.column(12)
    problem.system.impulse[:, 0] = 1.0
    changed = solvers.starts._started(problem, solvers.starts.STARTS["zero"](problem, None)).system
    # Impulses of 1 N s everywhere act on the lowest grain's contact with the floor, taken away they
    # move the top grain only.
    assert not changed.impulse.any()
    moved = changed.velocity[:12, 1] - problem.system.velocity[:12, 1]
    assert moved == pytest.approx([0.0] * 11 + [-1.0], abs=1e-12)


def test_impulses_by_contact_and_in_batches_are_the_same(solvers):
    system = solvers.problems.column(12).copy()
    free, impulse = system.velocity.copy(), np.random.default_rng(1).uniform(size=(12, 2))
    solvers.methods.operators.set_impulses(system, impulse)
    assert solvers.methods.operators.all_impulses(system).tolist() == impulse.tolist()
    assert flatten(system).impulse.tolist() == impulse.tolist()
    expected = free[:, :INVERSE_MASS] + solvers.methods.assembly.assemble(system).push(impulse)
    assert system.velocity[:, :INVERSE_MASS] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("is_diagonal", [True, False])
def test_matrices_give_the_velocities_of_surfaces_that_run(solvers, is_diagonal):
    """Two grains lie on a belt and against each other: u = Hᵀ v less the speed of the belt,
    whatever form the contacts have."""
    rng = np.random.default_rng(5)
    pair, angles = np.array([[0, 1], [0, 2], [1, 2]]), rng.uniform(0.0, 6.0, 3)
    normal = np.column_stack([np.cos(angles), np.sin(angles)])
    inverse = np.array([[2.0, 2.0, 5.0], [3.0, 3.0, 7.5 if is_diagonal else 9.0], [0.0, 0.0, 0.0]])
    lever = np.stack([-normal, normal], axis=1)
    slide, velocity = np.array([0.0, 0.7, -0.4]), rng.uniform(-1.0, 1.0, (3, 3))
    problem = ContactProblem(
        inverse, velocity, pair, normal, lever, rng.uniform(size=3), np.full(3, 0.5), slide=slide
    )
    discs = _disc_system(problem, np.zeros((3, 2)))
    system = _general_system(problem, np.zeros((3, 2))) if discs is None else discs[0]
    assert (discs is not None) == is_diagonal
    u_n, u_t = solvers.methods.assembly.assemble(system).relative(system.velocity[:, :INVERSE_MASS])
    rows = np.column_stack([u_n - problem.bias, u_t])
    slots = system.slot[system.slot >= 0] if is_diagonal else np.arange(3)
    assert rows[np.argsort(slots)] == pytest.approx(free_velocity(problem), abs=1e-12)


def test_the_engine_does_the_same_when_it_is_watched(solvers):
    problem = solvers.problems.column(12)
    ends = []
    for rows in (0, 30):
        system = problem.copy()
        log = solvers.methods.operators.Log(
            np.zeros((rows, solvers.methods.operators.COLUMNS)),
            np.zeros(3),
            np.zeros((13, 4)),
            solvers.reference.mass_shares(system),
        )
        assert solvers.methods.METHODS["engine"](system, 30, log) == 30
        ends.append([system.velocity.tolist(), system.impulse.tolist()])
    assert ends[0] == ends[1]


def test_the_folder_of_a_run_is_a_source(solvers, tmp_path):
    """Its next step: the impulses of the last one to start from, and none when it is cold."""
    from scenes import SMALL

    scenario = tmp_path / "small.toml"
    scenario.write_text(SMALL, encoding="utf-8")
    run(scenario, tmp_path / "some run")
    source = str(tmp_path / "some run")
    assert solvers.problems.is_run(source)
    assert not solvers.problems.is_run(str(tmp_path))
    (problem,) = solvers.problems.consecutive(source, 0, 1, 1, tmp_path / "kept")
    assert problem.name == "some run"
    assert problem.system.impulse.any()
    assert not problem.cold().system.impulse.any()
    assert not (tmp_path / "kept").exists()


# Problems on file, solved from a cold start: in a flow computed here their sweeps would be luck,
# fivefold from step to step. They are Engine.next_start of the `multicor bench` scenes of 1,008
# grains where these are measured. Given are u_ref [m/s] (None: default) and the sweeps, plain and
# accelerated; velocities moved by 10⁻⁶ of themselves change these by a thousandth.
RECORDED = {"bed": (9.81 * 2e-4, 4304, 135), "shear": (None, 6165, 567)}


@pytest.mark.parametrize("name", RECORDED)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_accelerated_method_needs_far_fewer_sweeps(name, seed):
    reference, plain, accelerated = RECORDED[name]
    problem = ContactProblem.load(DATA / f"{name}-1008.npz")
    rng, size = np.random.default_rng(seed), 1e-9 if seed else 0.0
    move = size * rng.uniform(-1.0, 1.0, problem.velocity.shape)
    problem = replace(problem, velocity=problem.velocity * (1.0 + move))
    found = {}
    for method in ("gauss-seidel", "accelerated"):
        solution = solve_contacts(problem, Settings(method=method), reference_velocity=reference)
        assert solution.converged
        found[method] = solution.sweeps
    assert found["accelerated"] < 0.2 * found["gauss-seidel"]  # measured: 0.05 and 0.09
    assert found["accelerated"] == pytest.approx(accelerated, rel=0.3)
    assert found["gauss-seidel"] == pytest.approx(plain, rel=0.3)


def test_quick_run(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    from runpy import run_path

    main = run_path(str(ROOT / "benchmarks" / "solvers" / "__main__.py"))["main"]
    out = {
        f"--{key}": str(tmp_path / f"out.{end}") for key, end in (("json", "json"), ("plot", "png"))
    }
    files = ["--work", str(tmp_path / "kept"), *(word for pair in out.items() for word in pair)]
    assert main(["--quick", "--methods", "gs", "engine", "--starts", *files]) == 0
    text = capsys.readouterr().out
    assert "shear-1000, warm" in text
    assert "engine, started from" in text
    found = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    column, cold, warm = found["single"]
    assert column["methods"]["engine"]["reached"]["0.0001"] is not None
    assert column["exact_error"]["engine"] < 1e-2
    assert cold["apart"] == warm["apart"]
    assert all(warm["methods"][name]["reached"]["0.001"][0] > 0 for name in ("gs", "engine"))
    distances = np.array(warm["methods"]["engine"]["distance"])
    assert distances[-1] < distances[0]
    costs = found["sequences"][0]["costs"]
    assert [cost["method"] for cost in costs] == ["program", "gs", "engine"]
    assert (tmp_path / "out.png").stat().st_size > 10_000
