"""``/VTKHDF`` as the VTK library reads it back: every step, those without contacts included,
without a warning."""

import shutil
from dataclasses import fields, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scene_parts import make_shapes
from shaped_run import ANGLE, LOWER, PERIOD, PLACES, UPPER, contact_rows, shaped_model
from store_support import make_model, make_run, run_whole, start

from multicor_cli.model import State, Walls
from multicor_cli.model.contacts import ContactTable
from multicor_cli.store import Snapshot, open_run, verify
from multicor_cli.store.vtkhdf import NO_CONTACT

vtk = pytest.importorskip("vtk")
numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")

FIELDS = ("velocity", "angle", "spin", "temperature", "generated", "wear")


@pytest.fixture(autouse=True)
def no_warning():
    """VTK prints what it does not like; here it must print nothing."""
    window = vtk.vtkStringOutputWindow()
    vtk.vtkOutputWindow.SetInstance(window)
    yield
    vtk.vtkOutputWindow.SetInstance(None)
    assert window.GetOutput() == ""


def read_steps(file):
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(file))
    assert reader.CanReadFile(str(file))
    reader.UpdateInformation()
    for step in range(reader.GetNumberOfSteps()):
        reader.SetStep(step)
        reader.Modified()
        reader.Update()
        yield reader.GetOutput()


def array(data, name):
    found = data.GetArray(name)
    assert found is not None, name
    return numpy_support.vtk_to_numpy(found)


def joined(step):
    return numpy_support.vtk_to_numpy(step.GetLines().GetConnectivityArray()).reshape(-1, 2)


def points(step):
    return numpy_support.vtk_to_numpy(step.GetPoints().GetData())


def check_step(step, frame, radius):
    """One step of the view against the frame that the reader of the run gives."""
    n, contacts = len(radius), frame.contacts
    np.testing.assert_array_equal(points(step)[:n, :2], frame.position)
    assert array(step.GetPointData(), "is_grain").tolist() == [1] * n + [0] * (
        step.GetNumberOfPoints() - n
    )
    np.testing.assert_array_equal(array(step.GetPointData(), "radius")[:n], radius)
    assert not array(step.GetPointData(), "radius")[n:].any()
    for name in FIELDS:
        if name in ("temperature", "generated", "wear") and not frame.has_heat:
            assert step.GetPointData().GetArray(name) is None
            continue
        np.testing.assert_array_equal(
            array(step.GetPointData(), name)[:n], frame.column(f"particles/{name}")
        )
    assert array(step.GetFieldData(), "dt") == [frame.dt]
    assert array(step.GetFieldData(), "step") == [frame.step]
    check_contacts(step, contacts, n)


def check_contacts(step, contacts, n):
    cells = step.GetCellData()
    if not len(contacts):
        assert array(cells, "kind").tolist() == [NO_CONTACT]
        assert array(cells, "normal_impulse").tolist() == [0.0]
        assert joined(step).tolist() == [[0, 0]]
        return
    assert step.GetNumberOfCells() == len(contacts)
    np.testing.assert_array_equal(joined(step)[:, 0], contacts.i)
    inner = joined(step)[:, 1] < n
    np.testing.assert_array_equal(joined(step)[inner, 1], contacts.j[inner])
    assert joined(step)[~inner, 1].tolist() == list(range(n, step.GetNumberOfPoints()))
    for name in ("kind", "gap", "slip", "sliding"):
        np.testing.assert_array_equal(array(cells, name), getattr(contacts, name))
    np.testing.assert_array_equal(array(cells, "normal_impulse"), contacts.impulse[:, 0])
    np.testing.assert_array_equal(array(cells, "tangential_impulse"), contacts.impulse[:, 1])
    for name in ("heat", "conductance"):
        if getattr(contacts, name) is not None:
            np.testing.assert_array_equal(array(cells, name), getattr(contacts, name))


def check_run(directory):
    """Every step of a run; returns their number."""
    with open_run(directory) as run:
        radius = run.model.grains.radius
        steps = 0
        for step, frame in zip(read_steps(directory / "results.vtkhdf"), run.frames, strict=True):
            check_step(step, frame, radius)
            steps += 1
    assert verify(directory) == []
    return steps


@pytest.mark.parametrize(("model", "precision"), [
    *((make_model(heat=heat), kind) for heat in (False, True) for kind in ("double", "single")),
    *((make_model(grains, walls=False), "double") for grains in (1, 5)),
])  # fmt: skip
def test_every_step_is_read_back(tmp_path, model, precision):
    run_whole(tmp_path / "run", model, precision=precision)
    assert check_run(tmp_path / "run") == 9


def write_contacts(path, sequence):
    """A run whose frames hold these contacts; the normals point from the middle of the period."""
    model = make_model()
    with make_run(path) as run:
        writer, state = run.writer(model), start(model)
        for pairs in sequence:
            writer.frame(Snapshot(state, model, None if pairs is None else rows_of(pairs)))
            writer.series_row(Snapshot(state, model))
            state.step += 1
            state.time += 0.1
            state.last_dt = 0.1
        run.checkpoint(state, writer)
        run.finish("finished")


def rows_of(pairs):
    i, j = np.array(pairs, np.int32).reshape(-1, 2).T
    c = len(pairs)
    impulse = 1.0 + np.arange(2.0 * c).reshape(c, 2)
    normal = np.tile([-0.6, 0.8], (c, 1))
    return ContactTable(
        i, j, normal, np.full(c, 1e-4), impulse, np.zeros(c), np.zeros(c, np.bool_), None, None
    )


@pytest.mark.parametrize(
    "counts",
    [(0, 2, 0, 0, 3, 1, 0), (2, 1), (3, 0), (0, 0, 0), (1,), (0,), (2, 0, 0, 0, 1, 0, 2, 3, 0, 0)],
)
def test_steps_without_contacts_anywhere(tmp_path, counts):
    """Several versions of VTK misread the step after one without cells."""
    possible = [(0, 1), (1, 2), (2, 6)]
    write_contacts(tmp_path / "run", [possible[:count] for count in counts])
    assert check_run(tmp_path / "run") == len(counts)


@pytest.mark.parametrize("rows", [1, 12, 13])
def test_frames_are_written_in_blocks(tmp_path, monkeypatch, rows):
    """Blocks of frames and chunks of rows end at different places."""
    monkeypatch.setattr("multicor_cli.store.vtkhdf.BLOCK_ROWS", rows)
    monkeypatch.setattr("multicor_cli.store.vtkhdf.CHUNK_ROWS", 5)
    run_whole(tmp_path / "run", make_model(heat=True))
    assert check_run(tmp_path / "run") == 9


def test_contacts_that_were_not_recorded(tmp_path):
    write_contacts(tmp_path / "run", [None, None])
    assert check_run(tmp_path / "run") == 2


def test_contacts_with_walls_and_across_the_period_end_in_a_point_of_their_own(tmp_path):
    write_contacts(tmp_path / "run", [[(0, 1), (0, 4), (3, 5)]])
    (step,) = read_steps(tmp_path / "run" / "results.vtkhdf")
    radius = make_model().grains.radius
    where = State.at_rest(make_model(), np.zeros((5, 2))).position  # grain 0 lies at the origin
    assert joined(step).tolist() == [[0, 1], [0, 5], [3, 6]]
    reach = radius[0] + radius[4] + 1e-4
    np.testing.assert_allclose(
        points(step)[5], where[0] + [0.6 * reach, -0.8 * reach, 0.0], rtol=1e-15
    )
    reach = radius[3] + 1e-4
    np.testing.assert_allclose(
        points(step)[6] - points(step)[3], [0.6 * reach, -0.8 * reach, 0.0], rtol=1e-12
    )
    assert np.isnan(array(step.GetPointData(), "spin")[5:]).all()


def test_the_view_holds_links_not_copies_and_follows_its_directory(heated, copy, tmp_path):
    with h5py.File(heated / "results.h5") as file:
        assert file["VTKHDF/Steps/Values"] == file["steps/time"]
        for name in ("Points", "PointData/temperature", "CellData/normal_impulse"):
            assert file[f"VTKHDF/{name}"].is_virtual
    shutil.move(copy, tmp_path / "elsewhere")
    assert check_run(tmp_path / "elsewhere") == 9


def test_a_file_system_without_links_does_no_harm(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(1, "no links here")

    monkeypatch.setattr(Path, "symlink_to", refuse)
    monkeypatch.setattr("os.link", refuse)
    run_whole(tmp_path / "run")
    assert not (tmp_path / "run" / "results.vtkhdf").exists()
    assert verify(tmp_path / "run") == []


def bent_lines(step):
    """The three points of each line [m], shape ``(c, 3, 2)``."""
    ids = numpy_support.vtk_to_numpy(step.GetLines().GetConnectivityArray()).reshape(-1, 3)
    return points(step)[ids, :2]


def test_lines_lead_through_points_where_grains_of_any_shape_touch(shaped):
    """To walls, they end there; their second point is halfway."""
    arms = 0.08 * np.array([[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [0.0, -1.375]])
    first = PLACES[[LOWER, LOWER, LOWER, LOWER, ANGLE]]
    touch = first + arms
    second = np.concatenate([touch[:2], 0.5 * (first + touch)[2:]])
    third = np.concatenate([PLACES[[UPPER, UPPER]], touch[2:]])
    for step in read_steps(shaped / "results.vtkhdf"):
        np.testing.assert_allclose(bent_lines(step), np.stack([first, second, third], axis=1))
        assert array(step.GetPointData(), "is_grain").sum() == len(PLACES)
        assert array(step.GetCellData(), "kind").tolist() == [0, 0, 1, 1, 1]
    assert verify(shaped) == []


@pytest.mark.parametrize("is_cell", [False, True])
def test_bent_lines_do_not_cross_the_domain(tmp_path, is_cell):
    """Across a side they end at the image of a grain that is nearest; frames without contacts have
    a line of no length."""
    model = shaped_model()
    if is_cell:
        walls = Walls(("cell",), np.ones(1), np.ones(1), np.zeros(1, np.bool_), np.ones(1))
        none = make_shapes([])
        model = replace(model, height=1.0, shapes=none, walls=walls)
    state = State.at_rest(model, PLACES)
    if is_cell:
        state.wall_position[0] = [PERIOD, 1.0, 0.25]
    rows = replace(
        contact_rows(state), i=np.array([2, 2], np.int32), j=np.array([6, 8], np.int32),
        **{name: getattr(contact_rows(state), name)[:2]
           for name in ("normal", "gap", "impulse", "slip", "sliding", "arm")},
    )  # fmt: skip
    none = replace(rows, **{f.name: v[:0] for f in fields(rows)
                            if (v := getattr(rows, f.name)) is not None})  # fmt: skip
    with make_run(tmp_path / "run") as run:
        writer = run.writer(model)
        for table in (none, rows, none, rows):
            writer.frame(Snapshot(state, model, table))
            writer.series_row(Snapshot(state, model))
            state.step, state.time = state.step + 1, state.time + 0.1
        run.checkpoint(state, writer)
        run.finish("finished")
    image = PLACES[[6, 8]] - np.array([[0.0, 0.0], [PERIOD, 0.0]])
    if is_cell:
        ways = PLACES[[6, 8]] - PLACES[2]
        images = [
            [w - [k * PERIOD + m * 0.25, m] for k in (-1, 0, 1) for m in (-1, 0, 1)] for w in ways
        ]
        image = PLACES[2] + np.array([min(found, key=lambda w: np.hypot(*w)) for found in images])
    for number, step in enumerate(read_steps(tmp_path / "run" / "results.vtkhdf")):
        lines = bent_lines(step)
        if number % 2:
            np.testing.assert_allclose(lines[:, 0], PLACES[[2, 2]])
            np.testing.assert_allclose(lines[:, 1], PLACES[2] + rows.arm)
            np.testing.assert_allclose(lines[:, 2], image)
        else:
            np.testing.assert_array_equal(lines, np.tile(PLACES[0], (1, 3, 1)))
