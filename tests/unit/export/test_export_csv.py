"""CSV files, read back with nothing but the standard library."""

from __future__ import annotations

import csv
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from store_support import make_model, run_whole

from multicor_cli.export import ExportError, ExportRefused, export_csv
from multicor_cli.store import Run, StorageError, open_run, schema

Table = dict[str, list[str]]


@pytest.fixture(scope="module", params=["double", "single"])
def directory(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("csv") / "run"
    run_whole(path, make_model(heat=True), precision=request.param)
    return path


@pytest.fixture
def run(directory: Path) -> Iterator[Run]:
    with open_run(directory) as opened:
        yield opened


def read(path: Path) -> Table:
    with path.open(encoding="utf-8", newline="") as file:
        headings, *rows = csv.reader(file)
    assert len(set(headings)) == len(headings)
    return {heading: [row[k] for row in rows] for k, heading in enumerate(headings)}


def numbers(column: list[str], like: np.ndarray) -> np.ndarray:
    return np.array([float(cell) if cell else np.nan for cell in column]).astype(like.dtype)


def check(table: Table, heading: str, values: np.ndarray) -> None:
    """The same bits."""
    np.testing.assert_array_equal(numbers(table[heading], values), values, strict=True)


def test_grains(run: Run, tmp_path: Path) -> None:
    assert export_csv(run, tmp_path / "out") == 9
    for frame in run.frames:
        table = read(tmp_path / "out" / f"grains-{frame.index:06d}.csv")
        assert table["grain"] == [str(k) for k in range(5)]
        assert table["group"] == ["grains"] * 5
        assert table["material"] == ["steel"] * 5
        check(table, "radius [m]", run.model.grains.radius)
        for k, axis in enumerate("xy"):
            check(table, f"{axis} [m]", frame.position[:, k])
            check(table, f"velocity_{axis} [m/s]", frame.velocity[:, k])
        check(table, "angle [rad]", frame.angle)
        check(table, "image", frame.image)
        check(table, "spin [rad/s]", frame.spin)
        check(table, "temperature [K]", frame.temperature)
        check(table, "generated [J]", frame.generated)


def test_contacts(run: Run, tmp_path: Path) -> None:
    export_csv(run, tmp_path / "out")
    for frame in run.frames:
        table, contacts = read(tmp_path / "out" / f"contacts-{frame.index:06d}.csv"), frame.contacts
        for name in ("i", "j", "kind"):
            check(table, name, getattr(contacts, name))
        check(table, "gap [m]", contacts.gap)
        check(table, "normal_x", contacts.normal[:, 0])
        check(table, "normal_impulse [N s]", contacts.impulse[:, 0])
        check(table, "tangential_impulse [N s]", contacts.impulse[:, 1])
        check(table, "conductance [W/K]", contacts.conductance)


def test_walls_and_nothing_for_nan(run: Run, tmp_path: Path) -> None:
    export_csv(run, tmp_path / "out")
    frame = run.frames[3]
    table = read(tmp_path / "out" / "walls-000003.csv")
    assert table["wall"] == ["bottom", "dessus-é"]
    assert table["temperature [K]"][1] == ""
    for k, heading in enumerate(("x [m]", "y [m]", "angle [rad]")):
        check(table, heading, frame.wall_position[:, k])
    check(table, "temperature [K]", frame.wall_temperature)
    check(table, "heat_received [J]", frame.wall_heat[:, 1])


def test_the_list_of_frames(run: Run, tmp_path: Path) -> None:
    assert export_csv(run, tmp_path / "out", slice(2, 9, 3)) == 3
    table = read(tmp_path / "out" / "frames.csv")
    assert table["frame"] == ["2", "5", "8"]
    assert table["stage_name"] == ["load"] * 3
    check(table, "time [s]", run.frames.time[[2, 5, 8]])
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    kinds = [f"{kind}-{k:06d}.csv" for kind in ("contacts", "grains", "walls") for k in (2, 5, 8)]
    assert names == sorted([*kinds, "frames.csv", "series.csv"])


def test_the_whole_series(run: Run, tmp_path: Path) -> None:
    export_csv(run, tmp_path / "out", slice(0, 1))
    table = read(tmp_path / "out" / "series.csv")
    rows = run.rows(schema.SERIES)
    columns = [1] * len(rows)
    for k, spec in enumerate(rows):
        per_wall = int(np.prod([d for d in spec.dims[1:] if isinstance(d, int)], dtype=int))
        columns[k] = per_wall * (2 if "wall" in spec.dims else 1)
    assert len(table) == sum(columns)
    check(table, "kinetic [J]", run.series["kinetic"])
    check(table, "virial_yx [N m]", run.series["virial_rate"][:, 1, 0])
    check(table, "dessus-é: torque [N m]", run.series["wall_force"][:, 1, 2])
    check(table, "heat_closure", run.series["heat_closure"])


def test_runs_without_walls_and_heat(tmp_path: Path) -> None:
    run_whole(tmp_path / "run", make_model(walls=False))
    with open_run(tmp_path / "run") as run:
        export_csv(run, tmp_path / "out", slice(-1, None))
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "contacts-000008.csv",
        "frames.csv",
        "grains-000008.csv",
        "series.csv",
    ]
    assert "temperature [K]" not in read(tmp_path / "out" / "grains-000008.csv")


def test_an_export_is_replaced_only_if_asked_for(run: Run, tmp_path: Path) -> None:
    export_csv(run, tmp_path / "out")
    before = sorted(path.name for path in (tmp_path / "out").iterdir())
    with pytest.raises(ExportRefused, match="--overwrite"):
        export_csv(run, tmp_path / "out", slice(0, 1))
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == before
    export_csv(run, tmp_path / "out", slice(0, 1), is_overwriting=True)
    assert len(list((tmp_path / "out").iterdir())) == 5
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


def test_foreign_files_are_never_removed(run: Run, directory: Path, tmp_path: Path) -> None:
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


def test_no_such_frames(run: Run, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="from 0 to 8"):
        export_csv(run, tmp_path / "out", slice(9, None))
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_what_was_there(run: Run, tmp_path: Path) -> None:
    export_csv(run, tmp_path / "out", slice(0, 1))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        with pytest.raises(StorageError):
            export_csv(run, tmp_path / "out", is_overwriting=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]
    assert len(list((tmp_path / "out").iterdir())) == 5
