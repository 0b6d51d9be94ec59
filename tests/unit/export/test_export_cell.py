"""A run of a cell in the formats of other programs, and as the report draws it."""

import csv

import numpy as np
import pytest

import multicor_cli as multicor
from multicor_cli.export import ExportError, export_csv, export_fclib, export_gsd
from multicor_cli.post.lattice import relative_velocity
from multicor_cli.report.pack import view_of


@pytest.fixture
def run(sheared):
    with multicor.open_run(sheared) as opened:
        yield opened


def nearest(away, width, height, tilt):
    """Distances of the nearest images, from all images."""
    ways = [(a * width + b * tilt, b * height) for a in range(-2, 3) for b in range(-2, 3)]
    return np.min([np.hypot(*(away + way).T) for way in ways], axis=0)


def test_the_box_of_gsd_leans_as_the_cell(run, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    export_gsd(run, tmp_path / "cell.gsd")
    with hoomd.open(str(tmp_path / "cell.gsd")) as file:
        for frame, read in zip(run.frames, file, strict=True):
            width, height, tilt = frame.wall_position[0]
            box, at = read.configuration.box, read.particles.position.astype(float)
            assert box[:2] == pytest.approx([width, height])
            assert box[3:] == pytest.approx([tilt / height, 0.0, 0.0], abs=1e-7)
            part = np.column_stack([at[:, 0] - box[3] * at[:, 1], at[:, 1]]) / box[:2]
            assert np.abs(part).max() < 0.5 + 1e-6
            # nearest images in that box are those in the run
            group = read.bonds.group
            found, expected = (
                nearest(p[group[:, 0]] - p[group[:, 1]], width, height, tilt)
                for p in (at[:, :2], frame.position)
            )
            assert found == pytest.approx(expected, rel=1e-5)
            assert found.max(initial=0.0) < 1.3e-3
    assert abs(tilt) > 0.1 * height


def test_csv_names_what_the_cell_has(run, tmp_path):
    export_csv(run, tmp_path / "csv")
    with (tmp_path / "csv" / "walls-000003.csv").open() as file:
        (row,) = csv.DictReader(file)
    width, height, tilt = run.frames[3].wall_position[0].tolist()
    assert [float(row[f"{name} [m]"]) for name in ("width", "height", "tilt")] == [
        width, height, tilt,
    ]  # fmt: skip
    assert float(row["rate_xy [1/s]"]) == run.frames[3].wall_velocity[0, 2]
    columns = {column.name: column for column in run.series_columns}
    sides, force = (run.series[f"wall_{name}"][:, 0] for name in ("position", "force"))
    area = sides[:, 0] * sides[:, 1]
    mean = 0.5 * (area[1:] + area[:-1])
    assert columns["cell: stress_xy"].unit == "N/m"
    assert columns["cell: stress_xy"].values[1:] == pytest.approx(force[1:, 2] / mean)


def test_what_needs_a_number_of_crossings_is_refused(run, tmp_path):
    with pytest.raises(ValueError, match="how often grains have crossed"):
        _ = run.frames[3].unwrapped
    with pytest.raises(ExportError, match="images in a cell"):
        export_fclib(run, tmp_path / "problem.h5")


def test_the_report_has_the_sides_and_places_between_them(run):
    view = view_of(run, 8)
    width, height, tilt = view.walls[0]
    part = view.center[:, 0] - tilt / height * view.center[:, 1]
    assert (part > -1e-8).all()
    assert (part < width * (1.0 + 1e-6)).all()
    # Real velocities in x where the picture has the grains
    frame, (x, y) = run.frames[8], view.center.T
    xx, _, xy = frame.wall_velocity[0]
    flow = view.values["velocity"] - relative_velocity(frame)[:, 0]
    assert flow == pytest.approx(xx * x + xy * y, rel=1e-5, abs=1e-6)
    assert xy == pytest.approx(40.0)
