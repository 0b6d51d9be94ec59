"""GSD files as the library reads them back."""

import dataclasses
import logging
import os
import sys

import numpy as np
import pytest
from heat_run import GRAINS, column, contact_rows, heated_model
from shaped_run import (
    ANGLE,
    DISC,
    DUMBBELL,
    FRAME,
    LOWER,
    PENTAGON,
    ROD,
    TRIANGLE,
    UPPER,
    write_shaped_run,
)
from store_support import file_size_limit, make_model, run_whole

from multicor_cli.export import ExportError, ExportRefused, MissingLibrary, export_gsd
from multicor_cli.store import RunDirectory, Snapshot, StorageError, open_run

hoomd = pytest.importorskip("gsd.hoomd")


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    path = tmp_path_factory.mktemp("gsd") / "run"
    run_whole(path, make_model(heat=True))
    return path


@pytest.fixture
def run(directory):
    with open_run(directory) as opened:
        yield opened


@pytest.fixture
def frames(run, tmp_path):
    """Every frame of the run, and what the library reads of it."""
    assert export_gsd(run, tmp_path / "all.gsd") == 9
    with hoomd.open(str(tmp_path / "all.gsd")) as file:
        yield list(zip(run.frames, file, strict=True))


def test_every_frame_is_read_back(run, frames):
    model = run.model
    for ours, theirs in frames:
        grains, center = theirs.particles, theirs.log["box_center"]
        assert grains.types == ["grains"]
        assert grains.typeid.tolist() == [0] * 5
        assert theirs.configuration.step == ours.step
        assert theirs.configuration.dimensions == 2
        assert theirs.log["time"] == [ours.time]
        np.testing.assert_allclose(grains.position[:, :2] + center, ours.position, atol=1e-8)
        assert not grains.position[:, 2].any()
        np.testing.assert_array_equal(grains.image[:, 0], ours.image)
        np.testing.assert_allclose(grains.velocity[:, :2], ours.velocity, rtol=1e-6)
        np.testing.assert_allclose(grains.diameter, 2.0 * model.grains.radius, rtol=1e-6)
        np.testing.assert_allclose(grains.mass, model.grains.mass, rtol=1e-6)
        np.testing.assert_array_equal(theirs.log["particles/temperature"], ours.temperature)
        np.testing.assert_array_equal(theirs.log["particles/angular_velocity"], ours.spin)
        np.testing.assert_array_equal(theirs.log["particles/generated"], ours.generated)


def test_orientation_momentum_and_box(run, frames):
    """q = (cos ½α, 0, 0, sin ½α), and the momentum I ω is in the z component of ½ q* P."""
    ours, theirs = frames[-1]
    q, p = theirs.particles.orientation, theirs.particles.angmom
    np.testing.assert_allclose(2.0 * np.arctan2(q[:, 3], q[:, 0]), ours.angle, atol=1e-6)
    momentum, inertia = 0.5 * (q[:, 0] * p[:, 3] - q[:, 3] * p[:, 0]), run.model.grains.inertia
    np.testing.assert_allclose(momentum, inertia * ours.spin, rtol=1e-5)
    np.testing.assert_allclose(theirs.particles.moment_inertia[:, 2], inertia, rtol=1e-6)
    (box,) = {tuple(theirs.configuration.box.tolist()) for _, theirs in frames}
    size = box[:2]
    assert size[0] == np.float32(run.period)
    for _, theirs in frames:
        reach = np.abs(theirs.particles.position[:, :2])
        reach[:, 1] += 0.5 * theirs.particles.diameter
        assert (reach <= 0.5 * np.array(size) * (1.0 + 1e-6)).all()


def test_bonds_are_the_contacts_that_carry_a_force(frames):
    found = 0
    for ours, theirs in frames:
        contacts = ours.contacts
        shown = (contacts.j < 5) & (contacts.impulse[:, 0] != 0.0)
        found += shown.sum()
        assert shown.sum() == theirs.bonds.N
        if shown.any():
            pairs, force = np.column_stack([contacts.i, contacts.j]), contacts.force[shown]
            np.testing.assert_array_equal(theirs.bonds.group, pairs[shown])
            np.testing.assert_array_equal(theirs.log["bonds/normal_force"], force[:, 0])
            np.testing.assert_array_equal(theirs.log["bonds/tangential_force"], force[:, 1])
    assert found > 2


def test_frames_without_contacts_do_not_repeat_those_of_the_first_one(tmp_path):
    """What a GSD frame lacks is that of the first one: a frame without bonds has to say so,
    recorded or not."""
    model = heated_model()
    state = column(model)
    with RunDirectory.create(tmp_path / "run", "", "", {"seed": 1}, stages=("a",)) as run:
        writer = run.writer(model)
        state.last_dt = 0.1
        loaded = contact_rows(state)
        fields = {field.name: getattr(loaded, field.name) for field in dataclasses.fields(loaded)}
        empty = dataclasses.replace(
            loaded,
            **{name: None if values is None else values[:0] for name, values in fields.items()},
        )
        for rows in (loaded, empty, None, loaded):
            writer.frame(Snapshot(state, model, rows))
            writer.series_row(Snapshot(state, model))
            state.step, state.time = state.step + 1, state.time + 0.1
        run.checkpoint(state, writer)
        run.finish("finished")
    with open_run(tmp_path / "run") as opened:
        export_gsd(opened, tmp_path / "a.gsd")
    with hoomd.open(str(tmp_path / "a.gsd")) as file:
        frames = list(file)
    assert [frame.bonds.N for frame in frames] == [GRAINS - 1, 0, 0, GRAINS - 1]
    for name in ("normal_force", "tangential_force", "heat"):
        assert [len(frame.log[f"bonds/{name}"]) for frame in frames] == [
            GRAINS - 1, 0, 0, GRAINS - 1,
        ]  # fmt: skip
    assert [frame.log["contacts_recorded"].tolist() for frame in frames] == [[1], [1], [0], [1]]


def test_runs_without_heat_and_with_single_precision(tmp_path, caplog):
    run_whole(tmp_path / "run", make_model(walls=False), precision="single")
    with caplog.at_level(logging.WARNING), open_run(tmp_path / "run") as run:
        export_gsd(run, tmp_path / "a.gsd", slice(None, None, 4))
    assert caplog.records == []
    with hoomd.open(str(tmp_path / "a.gsd")) as file:
        assert [frame.configuration.step for frame in file] == [0, 20, 40]
        assert "particles/temperature" not in file[2].log


def test_the_progress_is_told(run, tmp_path):
    told = []
    export_gsd(
        run,
        tmp_path / "a.gsd",
        slice(0, 3),
        progress=lambda done, total: told.append((done, total)),
    )
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_nothing_is_overwritten_unless_asked_for(run, tmp_path):
    path = tmp_path / "a.gsd"
    path.write_text("mine")
    with pytest.raises(ExportRefused, match="--overwrite"):
        export_gsd(run, path)
    assert path.read_text() == "mine"
    export_gsd(run, path, slice(0, 2), is_overwriting=True)
    with hoomd.open(str(path)) as file:
        assert len(file) == 2


def test_files_of_the_run_are_never_overwritten(run, directory):
    before = (directory / "results.h5").read_bytes()
    with pytest.raises(ExportRefused, match="a file of the run"):
        export_gsd(run, directory / "results.h5", is_overwriting=True)
    assert (directory / "results.h5").read_bytes() == before
    with pytest.raises(ExportRefused, match="directory"):
        export_gsd(run, directory, is_overwriting=True)


@pytest.mark.parametrize(
    "name",
    ["checkpoints/step-00000000040.h5", "checkpoints/new.gsd", "segments/a.gsd", "results.h5.tmp"],
)
def test_nothing_is_written_among_the_files_of_a_run(name, run, directory, tmp_path):
    """By its own name, and by that of a link to the directory."""
    before = sorted(path.name for path in directory.rglob("*"))
    (tmp_path / "link").symlink_to(directory)
    for place in (directory, tmp_path / "link"):
        with pytest.raises(ExportRefused, match="file of the run"):
            export_gsd(run, place / name, is_overwriting=True)
    assert sorted(path.name for path in directory.rglob("*")) == before


def test_a_link_is_not_replaced_unasked_and_a_device_never(run, tmp_path):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "link").symlink_to("mine")
    (tmp_path / "dangling").symlink_to("nowhere")
    os.mkfifo(tmp_path / "pipe")
    for name in ("link", "dangling", "pipe"):
        with pytest.raises(ExportRefused, match=name):
            export_gsd(run, tmp_path / name)
        assert not (tmp_path / name).is_file() or name == "link"
    with pytest.raises(ExportRefused, match="not an ordinary file"):
        export_gsd(run, tmp_path / "pipe", is_overwriting=True)
    assert (tmp_path / "pipe").is_fifo()
    export_gsd(run, tmp_path / "link", is_overwriting=True)
    assert (tmp_path / "mine").read_text() == "mine"


def test_no_such_frames(run, tmp_path):
    with pytest.raises(ExportError, match="from 0 to 8"):
        export_gsd(run, tmp_path / "a.gsd", slice(20, 30))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 0.99])
def test_a_full_disk_leaves_nothing(share, run, tmp_path):
    export_gsd(run, tmp_path / "a.gsd")
    size = (tmp_path / "a.gsd").stat().st_size
    (tmp_path / "a.gsd").unlink()
    with file_size_limit(int(share * size)), pytest.raises(StorageError):
        export_gsd(run, tmp_path / "a.gsd")
    assert list(tmp_path.iterdir()) == []


def test_without_the_library(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "gsd", None)
    monkeypatch.setitem(sys.modules, "gsd.hoomd", None)
    with pytest.raises(MissingLibrary, match="pip install"):
        export_gsd(run, tmp_path / "a.gsd")


def test_grains_of_any_shape_have_a_type_for_each_outline(shaped, tmp_path):
    """Two squares alike have one; corners are those at angle 0, from the center of mass."""
    with open_run(shaped) as run:
        outlines, frames = run.model.outlines, list(run.frames)
        export_gsd(run, tmp_path / "a.gsd")
    with hoomd.open(str(tmp_path / "a.gsd")) as file:
        found = list(file)
    for ours, theirs in zip(frames, found, strict=True):
        grains = theirs.particles
        assert grains.typeid.tolist() == [0, 1, 2, 3, 3, 4, 5, 6, 7]
        assert grains.types == [f"grains {k}" for k in range(8)]
        assert theirs.log["particles/group"].tolist() == [0] * 9
        assert (grains.diameter == 1.0).all()  # the default of the format, which is not stored
        turn = 2.0 * np.arctan2(grains.orientation[:, 3], grains.orientation[:, 0])
        np.testing.assert_allclose(turn, ours.angle, atol=1e-6)
        shapes = grains.type_shapes
        assert shapes[0] == {"type": "Sphere", "diameter": 0.2}
        for number, grain in ((2, PENTAGON), (3, LOWER), (4, TRIANGLE)):
            corners, rounding = outlines.pieces(grain)[0]
            assert shapes[number]["rounding_radius"] == rounding
            np.testing.assert_array_equal(shapes[number]["vertices"], corners)
        for number, grain in ((1, ROD), (5, ANGLE), (6, FRAME), (7, DUMBBELL)):
            x, y = np.array(shapes[number]["vertices"]).T
            area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
            assert area == pytest.approx(outlines.area[grain], rel=5e-3)


def test_shapes_are_as_large_as_grains_are_in_each_frame(tmp_path):
    """Then the two squares, of which one grows, have a type each."""
    write_shaped_run(tmp_path / "run", growth=0.25)
    with open_run(tmp_path / "run") as run:
        outlines = run.model.outlines
        export_gsd(run, tmp_path / "a.gsd")
    with hoomd.open(str(tmp_path / "a.gsd")) as file:
        for frame, theirs in enumerate(file):
            grains, factor = theirs.particles, 1.0 + 0.25 * frame
            assert grains.typeid.tolist() == list(range(9))
            assert grains.type_shapes[DISC]["diameter"] == pytest.approx(0.2)
            for grain, by in ((PENTAGON, factor), (UPPER, factor), (LOWER, 1.0)):
                corners, rounding = outlines.pieces(grain)[0]
                shape = grains.type_shapes[grain]
                assert shape["rounding_radius"] == pytest.approx(by * rounding, rel=1e-12)
                np.testing.assert_allclose(shape["vertices"], by * corners, rtol=1e-12)
