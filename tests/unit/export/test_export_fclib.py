"""FCLib files: the problem that the run has solved, the matrix as FCLib wants it, and its
solution."""

from dataclasses import fields, replace

import h5py
import numpy as np
import pytest
from contact_problems import column_problem, dense_delassus, heap_problem, tilted
from scenes import SMALL, WARM, write_small
from store_support import file_size_limit

from multicor_cli import export, load_scenario
from multicor_cli import run as run_scenario
from multicor_cli.engine import ContactProblem, Engine, Settings, solve_contacts
from multicor_cli.export.fclib_file import LocalForm, local_form
from multicor_cli.store import DamagedRun, StoreError, open_run

TIGHT = Settings(tolerance_rms=1e-11, tolerance_max=1e-9, tolerance_energy=1e-9, max_sweeps=100_000)


def record(path, text):
    """Run a scenario; gives its directory, and the problem of every step by the number of steps
    before it."""
    solved = {}
    step = Engine.step

    def recording(engine, dt, t, *more):
        if not engine.orders.is_frozen:
            solved[engine.state.step] = engine.next_start(dt, t)
        return step(engine, dt, t, *more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Engine, "step", recording)
        run_scenario(load_scenario(write_small(path, text)), path / "run")
    return path / "run", solved


def read_local_form(path):
    """What other programs read: W, q and mu."""
    with h5py.File(path) as file:
        local = file["fclib_local"]
        return LocalForm(
            *(local[f"W/{name}"][...] for name in "pix"),
            local["vectors/q"][...],
            local["vectors/mu"][...],
        )


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Three stages with walls that a force moves, and a ramp that goes on from one stage into the
    next."""
    return record(tmp_path_factory.mktemp("small"), SMALL)


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Friction that depends on temperature, and a stage in which nothing moves."""
    return record(tmp_path_factory.mktemp("warm"), WARM)


@pytest.fixture
def run(small):
    with open_run(small[0]) as opened:
        yield opened


def assert_same(one, other):
    for field in fields(ContactProblem):
        np.testing.assert_array_equal(
            getattr(one, field.name), getattr(other, field.name), err_msg=field.name
        )


def test_the_problem_after_a_frame_is_the_one_that_the_run_has_solved(run, small):
    """To the bit, in every stage and where one ends."""
    stages = set()
    for frame in list(run.frames)[:-1]:
        found = export.frame_problem(run, frame.index)
        problem, start = small[1][frame.step]
        assert_same(found.problem, problem)
        differ = (found.start != start).any(axis=1)
        # To these the solve had found an impulse, to which that of an impact in flight was added
        assert (start[differ, 0] > 0.0).all()
        assert differ.sum() < 10
        assert not found.is_beyond
        stages.add((run.stages[frame.stage], found.stage))
    assert stages == {
        ("settle", "settle"), ("settle", "shear"), ("shear", "shear"), ("shear", "on"),
        ("on", "on"),
    }  # fmt: skip


def test_after_the_last_frame_the_last_stage_goes_on(run):
    found = export.frame_problem(run, -1)
    assert found.is_beyond
    assert found.stage == "on"
    assert found.start.any()


def test_exported_and_read_again_the_solution_is_the_same(run, small, tmp_path):
    """Of the first frame from the middle on whose problem sweeps can solve so closely: with
    friction not every one can be."""
    for number in range(len(run.frames) // 2, len(run.frames) - 1):
        ours, our_start = small[1][run.frames[number].step]
        expected = solve_contacts(ours, TIGHT, start=our_start)
        if expected.converged:
            break
    assert expected.converged
    export.export_fclib(run, tmp_path / "a.hdf5", number)
    problem, start = export.read_fclib(tmp_path / "a.hdf5")
    theirs = solve_contacts(problem, TIGHT, start=start)
    assert theirs.converged
    scale = np.abs(expected.velocity).max()
    assert np.abs(theirs.velocity - expected.velocity).max() <= 1e-7 * scale
    assert np.abs(theirs.impulse - expected.impulse).max() <= 1e-7 * np.abs(expected.impulse).max()


@pytest.mark.parametrize("name", ["heap", "run"])
def test_our_solution_solves_the_problem_in_the_file(name, run, tmp_path):
    """With W, q and mu of the file alone: complementarity, Coulomb's cone, and friction against the
    slip."""
    problem = heap_problem() if name == "heap" else export.frame_problem(run, -2).problem
    export.write_fclib(problem, tmp_path / "a.hdf5", is_overwriting=True)
    form = read_local_form(tmp_path / "a.hdf5")
    impulse = solve_contacts(problem, TIGHT).impulse
    u_n, u_t = form.velocity(impulse).reshape(-1, 2).T
    p_n, p_t = impulse.T
    speed, push = np.abs(form.q).max(), p_n.max()
    assert u_n.min() >= -1e-7 * speed
    assert p_n.min() >= 0.0
    assert np.abs(u_n * p_n).max() <= 1e-7 * speed * push
    assert (np.abs(p_t) - form.friction * p_n).max() <= 1e-12 * push
    assert np.abs(u_t * p_t + form.friction * p_n * np.abs(u_t)).max() <= 1e-7 * speed * push


PROBLEMS = {
    "column": lambda: column_problem(5),
    "heap": lambda: heap_problem(restitution=0.4),
    "tilted": lambda: tilted(heap_problem(seed=1)),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_matrix_is_that_of_the_problem(name):
    problem = PROBLEMS[name]()
    form = local_form(problem)
    expected, q = dense_delassus(problem)
    dense = np.zeros_like(expected)
    dense[np.repeat(np.arange(len(q)), np.diff(form.start)), form.column] = form.value
    np.testing.assert_allclose(dense, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(dense, dense.T)
    np.testing.assert_allclose(form.q, q, rtol=1e-12, atol=1e-14)
    for row in range(len(q)):
        columns = form.column[form.start[row] : form.start[row + 1]]
        assert (np.diff(columns) > 0).all()


def test_two_contacts_of_the_same_two_bodies_share_both():
    """A grain in the corner of a wall that a force moves."""
    lever = np.array([[[-0.5, 0.0], [0.5, 0.2]], [[0.0, -0.5], [1.0, -0.3]]])
    problem = ContactProblem(
        np.array([[1.0, 1.0, 8.0], [0.5, 0.25, 2.0]]),
        np.array([[0.1, -1.0, 3.0], [0.2, 0.0, 0.0]]), np.array([[0, 1], [0, 1]], np.int32),
        np.array([[1.0, 0.0], [0.0, 1.0]]), lever, np.zeros(2), np.full(2, 0.3),
    )  # fmt: skip
    form = local_form(problem)
    assert form.start.tolist() == [0, 4, 8, 12, 16]
    np.testing.assert_allclose(form.value.reshape(4, 4), dense_delassus(problem)[0], atol=1e-14)


def test_the_layout_is_that_of_fclib(run, tmp_path):
    """Names, types and shapes of fclib.h; integers of the C library have 32 bits."""
    export.export_fclib(run, tmp_path / "a.hdf5", 10)
    with h5py.File(tmp_path / "a.hdf5") as file:
        local = file["fclib_local"]
        c = len(local["vectors/mu"])
        sizes = {name: local[f"W/{name}"][...].tolist() for name in ("m", "n", "nz", "nzmax")}
        assert sizes == {"m": [2 * c], "n": [2 * c], "nz": [-2], "nzmax": [len(local["W/x"])]}
        assert local["spacedim"][...].tolist() == [2]
        for name in ("spacedim", "W/m", "W/n", "W/nz", "W/nzmax", "W/p", "W/i"):
            assert local[name].dtype == np.dtype("<i4"), name
            assert local[name].ndim == 1
        for name in ("W/x", "vectors/q", "vectors/mu"):
            assert local[name].dtype == np.dtype("<f8")
        assert local["W/p"].shape == (2 * c + 1,)
        assert local["vectors/q"].shape == (2 * c,)
        assert local["W/p"][-1] == len(local["W/i"]) == len(local["W/x"])
        assert file["guesses/number_of_guesses"][...].tolist() == [1]
        assert file["guesses/1/r"].shape == file["guesses/1/u"].shape == (2 * c,)
        for name in ("title", "description", "math_info"):
            text = local[f"info/{name}"]
            assert text.shape == ()
            kind = h5py.check_string_dtype(text.dtype)
            assert len(text[()]) < kind.length  # a zero ends it
        assert b"small, step after frame 10" in local["info/title"][()]


def test_the_guess_is_a_velocity_of_the_local_form(run, tmp_path):
    export.export_fclib(run, tmp_path / "a.hdf5", 10)
    form = read_local_form(tmp_path / "a.hdf5")
    with h5py.File(tmp_path / "a.hdf5") as file:
        assert file["guesses/1/r"][...].any()
        np.testing.assert_allclose(
            file["guesses/1/u"][...], form.velocity(file["guesses/1/r"][...]), rtol=1e-12
        )


def test_problems_are_saved_and_loaded(tmp_path):
    problem = heap_problem()
    export.write_fclib(
        problem, tmp_path / "a.hdf5", start=np.ones((len(problem.pair), 2)), is_overwriting=True
    )
    assert_same(export.read_fclib(tmp_path / "a.hdf5")[0], problem)
    assert export.read_fclib(tmp_path / "a.hdf5")[1].tolist() == [[1.0, 1.0]] * len(problem.pair)
    export.write_fclib(problem, tmp_path / "a.hdf5", is_overwriting=True)
    assert export.read_fclib(tmp_path / "a.hdf5")[1] is None


def test_other_files_are_refused_by_name(tmp_path):
    export.write_fclib(heap_problem(), tmp_path / "a.hdf5", is_overwriting=True)
    with h5py.File(tmp_path / "a.hdf5", "r+") as file:
        del file["multicor"]
    with pytest.raises(export.ExportError, match="another program"):
        export.read_fclib(tmp_path / "a.hdf5")
    (tmp_path / "b.hdf5").write_text("no")
    for name in ("b.hdf5", "c.hdf5"):
        with pytest.raises(DamagedRun, match=name):
            export.read_fclib(tmp_path / name)


def test_a_guess_of_another_problem_is_refused(tmp_path):
    export.write_fclib(
        column_problem(3), tmp_path / "a.hdf5", start=np.zeros((3, 2)), is_overwriting=True
    )
    with h5py.File(tmp_path / "a.hdf5", "r+") as file:
        del file["guesses/1/r"]
        file["guesses/1/r"] = np.zeros(8)
    with pytest.raises(DamagedRun, match=r"a\.hdf5"):
        export.read_fclib(tmp_path / "a.hdf5")


def test_grains_of_any_shape_are_refused(shaped, tmp_path):
    with open_run(shaped) as run, pytest.raises(export.ExportError, match="discs alone"):
        export.export_fclib(run, tmp_path / "a.hdf5")
    assert list(tmp_path.iterdir()) == []


def test_without_contacts_there_is_no_problem(tmp_path):
    none = np.empty((0, 2))
    problem = ContactProblem(
        np.ones((1, 3)), np.zeros((1, 3)), none.astype(np.int32), none, np.empty((0, 2, 2)),
        np.empty(0), np.empty(0),
    )  # fmt: skip
    with pytest.raises(export.ExportError, match="no contact"):
        export.write_fclib(problem, tmp_path / "a.hdf5")
    assert list(tmp_path.iterdir()) == []


def test_runs_with_heat_that_softens_friction(warm):
    """Temperatures are stored as such, the engine computes with heat contents: friction agrees to
    rounding, the rest exactly."""
    steps = 0
    with open_run(warm[0]) as run:
        for frame in list(run.frames)[:-1]:
            if frame.step not in warm[1]:
                with pytest.raises(export.ExportError, match="nothing moves in stage 'wait'"):
                    export.frame_problem(run, frame.index)
                continue
            found, problem = export.frame_problem(run, frame.index).problem, warm[1][frame.step][0]
            np.testing.assert_allclose(found.friction, problem.friction, rtol=1e-12)
            assert_same(replace(found, friction=problem.friction), problem)
            steps += 1
            last = problem
    assert steps >= 6
    assert np.unique(last.friction).size > 10


def test_nothing_is_overwritten_unless_asked_for_nor_left_of_no_frame(run, tmp_path):
    (tmp_path / "a.hdf5").write_text("mine")
    with pytest.raises(export.ExportRefused, match="--overwrite"):
        export.export_fclib(run, tmp_path / "a.hdf5")
    assert (tmp_path / "a.hdf5").read_text() == "mine"
    export.export_fclib(run, tmp_path / "a.hdf5", is_overwriting=True)
    export.read_fclib(tmp_path / "a.hdf5")
    with pytest.raises(export.ExportError, match="no frame 1000"):
        export.export_fclib(run, tmp_path / "b.hdf5", 1000)
    assert [path.name for path in tmp_path.iterdir()] == ["a.hdf5"]


def test_a_file_that_may_not_grow_leaves_nothing(run, tmp_path):
    with file_size_limit(4096), pytest.raises(StoreError, match="larger than files may be here"):
        export.export_fclib(run, tmp_path / "a.hdf5")
    assert list(tmp_path.iterdir()) == []
