"""Polygons of grains of any shape as the VTK library reads them, step by step, without a
warning."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from shaped_run import FRAME, PLACES, TURN, advance, shaped_model
from store_support import file_size_limit, run_whole

from multicor_cli.export import ExportError, ExportRefused, export_vtkhdf
from multicor_cli.export.vtkhdf_file import FINE
from multicor_cli.model import Presence, State
from multicor_cli.post.rings import rings_of
from multicor_cli.store import RunDirectory, Snapshot, StorageError, open_run

vtk = pytest.importorskip("vtk")
numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")

GRID = 1e-4 * 0.1
"""Places are rounded to this, a part of the smallest radius [m]."""


@pytest.fixture(autouse=True)
def no_warning():
    """VTK prints what it does not like; here it must print nothing."""
    window = vtk.vtkStringOutputWindow()
    vtk.vtkOutputWindow.SetInstance(window)
    yield
    vtk.vtkOutputWindow.SetInstance(None)
    assert window.GetOutput() == ""


def read_steps(file, order=None):
    """What VTK reads of each step: time, polygons as ``(p, 2)`` points, and cell data by name."""
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(file))
    assert reader.CanReadFile(str(file))
    reader.UpdateInformation()
    with h5py.File(file) as opened:  # of a single step the reader does not give the time
        times = opened["VTKHDF/Steps/Values"][...]
    for step in order or range(reader.GetNumberOfSteps()):
        reader.SetStep(step)
        reader.Modified()
        reader.Update()
        data = reader.GetOutput()
        at = numpy_support.vtk_to_numpy(data.GetPoints().GetData())
        cells = data.GetPolys()
        assert data.GetNumberOfCells() == cells.GetNumberOfCells()
        assert not at[:, 2].any()
        ids = numpy_support.vtk_to_numpy(cells.GetConnectivityArray())
        ends = numpy_support.vtk_to_numpy(cells.GetOffsetsArray())
        given = data.GetCellData()
        arrays = {
            given.GetArrayName(k): numpy_support.vtk_to_numpy(given.GetArray(k)).copy()
            for k in range(given.GetNumberOfArrays())
        }
        yield times[step], np.split(at[ids, :2].astype(float), ends[1:-1]), arrays


def check_step(found, frame, rings):
    """One step of the file against the frame of the run."""
    time, polygons, arrays = found
    assert time == frame.time
    placed = rings.of_grains(frame.number).placed(frame.position, frame.angle)
    assert len(polygons) == len(frame.number)
    for polygon, line in zip(polygons, placed, strict=True):
        assert polygon == pytest.approx(line, abs=GRID)
    np.testing.assert_array_equal(arrays["grain"], frame.number)
    np.testing.assert_array_equal(arrays["area"], frame.model.area)
    np.testing.assert_array_equal(arrays["radius"], frame.model.grains.radius)
    np.testing.assert_array_equal(arrays["velocity"][:, :2], frame.velocity)
    np.testing.assert_array_equal(arrays["temperature"], frame.temperature)
    for name in ("angle", "spin", "generated", "wear"):
        np.testing.assert_array_equal(arrays[name], getattr(frame, name))


def test_grains_are_polygons_that_move(shaped, tmp_path):
    with open_run(shaped) as run:
        rings = rings_of(run.model.outlines, FINE).single()
        assert export_vtkhdf(run, tmp_path / "a.vtkhdf") == 3
        for found, frame in zip(read_steps(tmp_path / "a.vtkhdf"), run.frames, strict=True):
            check_step(found, frame, rings)
        assert frame.angle[FRAME] == 2.0 * TURN
        assert export_vtkhdf(run, tmp_path / "b.vtkhdf", slice(1, 2)) == 1
        (found,) = read_steps(tmp_path / "b.vtkhdf")
        check_step(found, run.frames[1], rings)


def test_grains_come_and_go(tmp_path):
    """What polygons join is stored again when others are there, and steps are read in any order;
    frames without grains are left out."""
    model = replace(shaped_model(heat=True), outlets=("hole",))
    state = State.at_rest(model, PLACES)
    here = [(), (0, 1, 7), (0, 1, 7), (1, 6, 7, 8), (), (1, 6, 7, 8), (0, 1, 7)]
    with RunDirectory.create(tmp_path / "run", "", "", {"seed": 1}, stages=("a",)) as run:
        writer = run.writer(model)
        for which in here:
            state.presence[:] = Presence.WAITS
            state.presence[list(which)] = Presence.THERE
            writer.frame(Snapshot(state, model, None))
            writer.series_row(Snapshot(state, model))
            advance(state)
        run.checkpoint(state, writer)
        run.finish("finished")
    with open_run(tmp_path / "run") as run:
        rings = rings_of(model.outlines, FINE).single()
        assert export_vtkhdf(run, tmp_path / "a.vtkhdf") == 5
        frames = [run.frames[k] for k in (1, 2, 3, 5, 6)]
        order = [4, 2, 0, 3, 1]
        for step, found in zip(order, read_steps(tmp_path / "a.vtkhdf", order), strict=True):
            check_step(found, frames[step], rings)
        with pytest.raises(ExportError, match="no grain is there"):
            export_vtkhdf(run, tmp_path / "b.vtkhdf", slice(1))


def test_what_cannot_be_is_refused(shaped, tmp_path):
    run_whole(tmp_path / "discs")
    with open_run(tmp_path / "discs") as run, pytest.raises(ExportError, match="are discs"):
        export_vtkhdf(run, tmp_path / "a.vtkhdf")
    with open_run(shaped) as run:
        with pytest.raises(ExportError, match="from 0 to 2"):
            export_vtkhdf(run, tmp_path / "a.vtkhdf", slice(9, None))
        export_vtkhdf(run, tmp_path / "a.vtkhdf")
        before = (tmp_path / "a.vtkhdf").read_bytes()
        with pytest.raises(ExportRefused, match="--overwrite"):
            export_vtkhdf(run, tmp_path / "a.vtkhdf")
        with file_size_limit(20_000), pytest.raises(StorageError, match=r"a\.vtkhdf"):
            export_vtkhdf(run, tmp_path / "a.vtkhdf", is_overwriting=True)
    assert (tmp_path / "a.vtkhdf").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.vtkhdf", "discs"]
