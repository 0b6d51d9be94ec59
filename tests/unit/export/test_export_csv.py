"""CSV files, read back with nothing but the standard library."""

import csv

import numpy as np
import pytest
from store_support import file_size_limit, make_model, run_whole

from multicor_cli.export import ExportError, ExportRefused, export_csv
from multicor_cli.store import StorageError, open_run, schema


@pytest.fixture(scope="module", params=["double", "single"])
def directory(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("csv") / "run"
    run_whole(path, make_model(heat=True), precision=request.param)
    return path


@pytest.fixture
def run(directory):
    with open_run(directory) as opened:
        yield opened


def read(path):
    with path.open(encoding="utf-8", newline="") as file:
        headings, *rows = csv.reader(file)
    assert len(set(headings)) == len(headings)
    return {heading: [row[k] for row in rows] for k, heading in enumerate(headings)}


def numbers(column, like):
    return np.array([float(cell) if cell else np.nan for cell in column]).astype(like.dtype)


def check(table, heading, values):
    """The same bits."""
    np.testing.assert_array_equal(numbers(table[heading], values), values, strict=True)


@pytest.fixture
def out(run, tmp_path):
    assert export_csv(run, tmp_path / "out") == 9
    return tmp_path / "out"


def test_grains(run, out):
    for frame in run.frames:
        table = read(out / f"grains-{frame.index:06d}.csv")
        assert table["grain"] == [str(k) for k in range(5)]
        assert table["group"] == ["grains"] * 5
        assert table["material"] == ["steel"] * 5
        columns = {
            "radius [m]": run.model.grains.radius, "x [m]": frame.position[:, 0],
            "y [m]": frame.position[:, 1], "velocity_x [m/s]": frame.velocity[:, 0],
            "velocity_y [m/s]": frame.velocity[:, 1], "angle [rad]": frame.angle,
            "image": frame.image, "spin [rad/s]": frame.spin, "temperature [K]": frame.temperature,
            "generated [J]": frame.generated,
        }  # fmt: skip
        for heading, values in columns.items():
            check(table, heading, values)


def test_contacts(run, out):
    for frame in run.frames:
        table, contacts = read(out / f"contacts-{frame.index:06d}.csv"), frame.contacts
        columns = {
            **{name: getattr(contacts, name) for name in ("i", "j", "kind")},
            "gap [m]": contacts.gap,
            "normal_x": contacts.normal[:, 0],
            "normal_impulse [N s]": contacts.impulse[:, 0],
            "tangential_impulse [N s]": contacts.impulse[:, 1],
            "conductance [W/K]": contacts.conductance,
        }
        for heading, values in columns.items():
            check(table, heading, values)


def test_walls_and_the_series_with_nothing_for_nan(run, out):
    frame, table = run.frames[3], read(out / "walls-000003.csv")
    assert table["wall"] == ["bottom", "dessus-é"]
    assert table["temperature [K]"][1] == ""
    for k, heading in enumerate(("x [m]", "y [m]", "angle [rad]")):
        check(table, heading, frame.wall_position[:, k])
    check(table, "temperature [K]", frame.wall_temperature)
    check(table, "heat_received [J]", frame.wall_heat[:, 1])
    table = read(out / "series.csv")
    rows = run.rows(schema.SERIES)
    lengths = {"wall": 2}
    shapes = [[lengths.get(d, d) for d in spec.dims[1:]] for spec in rows]
    assert len(table) == sum(int(np.prod(shape, dtype=int)) for shape in shapes)
    check(table, "kinetic [J]", run.series["kinetic"])
    check(table, "virial_yx [N m]", run.series["virial_rate"][:, 1, 0])
    check(table, "dessus-é: torque [N m]", run.series["wall_force"][:, 1, 2])
    check(table, "heat_closure", run.series["heat_closure"])


def test_frames_are_a_slice(run, tmp_path):
    with pytest.raises(TypeError, match="frames is a slice"):
        export_csv(run, tmp_path / "out", 0)


def test_the_list_of_frames(run, tmp_path):
    assert export_csv(run, tmp_path / "out", slice(2, 9, 3)) == 3
    table = read(tmp_path / "out" / "frames.csv")
    assert table["frame"] == ["2", "5", "8"]
    assert table["stage_name"] == ["load"] * 3
    check(table, "time [s]", run.frames.time[[2, 5, 8]])
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    kinds = [f"{kind}-{k:06d}.csv" for kind in ("contacts", "grains", "walls") for k in (2, 5, 8)]
    assert names == sorted([*kinds, "frames.csv", "series.csv"])


def test_runs_without_walls_and_heat(tmp_path):
    run_whole(tmp_path / "run", make_model(walls=False))
    with open_run(tmp_path / "run") as run:
        export_csv(run, tmp_path / "out", slice(-1, None))
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "contacts-000008.csv", "frames.csv", "grains-000008.csv", "series.csv",
    ]  # fmt: skip
    assert "temperature [K]" not in read(tmp_path / "out" / "grains-000008.csv")


def test_an_export_is_replaced_only_if_asked_for(run, tmp_path):
    export_csv(run, tmp_path / "out")
    before = sorted(path.name for path in (tmp_path / "out").iterdir())
    with pytest.raises(ExportRefused, match="--overwrite"):
        export_csv(run, tmp_path / "out", slice(0, 1))
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == before
    export_csv(run, tmp_path / "out", slice(0, 1), is_overwriting=True)
    assert len(list((tmp_path / "out").iterdir())) == 5
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


def test_foreign_files_are_never_removed(run, directory, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("years of work")
    with pytest.raises(ExportRefused, match=r"thesis\.tex"):
        export_csv(run, tmp_path / "out", is_overwriting=True)
    assert (tmp_path / "out" / "thesis.tex").read_text() == "years of work"
    with pytest.raises(ExportRefused):
        export_csv(run, directory, is_overwriting=True)
    with pytest.raises(ExportRefused, match="file of the run"):
        export_csv(run, directory / "segments")
    assert not (directory / "segments").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportRefused, match="not a directory"):
        export_csv(run, tmp_path / "file", is_overwriting=True)


def test_no_such_frames(run, tmp_path):
    with pytest.raises(ExportError, match="from 0 to 8"):
        export_csv(run, tmp_path / "out", slice(9, None))
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_what_was_there(run, tmp_path):
    export_csv(run, tmp_path / "out", slice(0, 1))
    with file_size_limit(2000), pytest.raises(StorageError):
        export_csv(run, tmp_path / "out", is_overwriting=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]
    assert len(list((tmp_path / "out").iterdir())) == 5


def test_grains_of_any_shape_have_areas_and_outlines(shaped, tmp_path):
    with open_run(shaped) as run:
        outlines, frame = run.model.outlines, run.frames[1]
        export_csv(run, tmp_path / "out")
        contacts = frame.contacts.arm
    grains = read(tmp_path / "out" / "grains-000001.csv")
    check(grains, "area [m2]", outlines.area)
    check(grains, "radius [m]", outlines.radius)
    rows = read(tmp_path / "out" / "contacts-000001.csv")
    for axis, name in enumerate("xy"):
        check(rows, f"arm_{name} [m]", contacts[:, axis])
    table = read(tmp_path / "out" / "outlines.csv")
    for axis, name in enumerate("xy"):
        check(table, f"{name} [m]", outlines.corner[:, axis])
    places = zip(table["grain"], table["piece"], table["rounding [m]"], strict=True)
    assert [(int(g), int(p), float(r)) for g, p, r in places] == [
        (grain, piece, rounding)
        for grain in range(9)
        for piece, (corners, rounding) in enumerate(outlines.pieces(grain))
        for _ in corners
    ]
    with open_run(shaped) as run:
        export_csv(run, tmp_path / "out", is_overwriting=True)  # it is known as a file of an export


def test_discs_have_no_outlines(out):
    assert not (out / "outlines.csv").exists()
    assert "area [m2]" not in read(out / "grains-000000.csv")
