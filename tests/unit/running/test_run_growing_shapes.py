"""Runs of grains of other shapes that expand, wear and exchange heat in all ways."""

import h5py
import numpy as np
import pytest
from run_fakes import in_pieces
from scenarios import digests
from scenes import WARM, changed

import multicor_cli as multicor
from multicor_cli.export.vtkhdf_file import export_vtkhdf
from multicor_cli.post.grain_map import make_scene
from multicor_cli.store import run_info, verify

BED = changed(
    WARM, ('"sphere"', '{ kind = "polygon", sides = 5, rounding = 0.1 }\nthickness = 1e-3'),
    ("count = 150", "count = 60"), ('"deposited"', '"random"'),
    ("hardness = 2e9", "hardness = 2e9\nexpansion = 2e-4"), ("wear = 1e-4", "wear = 1.0"),
    ("coefficient = 5.0", "coefficient = 5e3"), ("temperature = 290.0", "temperature = 400.0"),
    ("[heat]\n", "[heat]\nwear_shrinks = true\ncollisional = true\n"),
)  # fmt: skip


@pytest.fixture(scope="module")
def bed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bed")
    (folder / "bed.toml").write_text(BED, encoding="utf-8")
    multicor.run(folder / "bed.toml", folder / "run", threads=1)
    return folder


def test_outlines_in_files_follow_the_radii(bed, tmp_path):
    """And so do what is drawn and exported."""
    with multicor.open_run(bed / "run") as run:
        last, initial = run.frames[-1], run.model.grains
        factor = last.radius / initial.radius
        assert (factor > 1.001).any()
        assert last.wear.max() > 0.0
        assert last.model.area == pytest.approx(run.model.area * factor**2, rel=1e-13)
        assert last.model.outlines.radius == pytest.approx(last.radius, rel=1e-13)
        left = 1.0 - last.wear / (1e-3 * run.model.area)
        assert last.model.grains.mass == pytest.approx(initial.mass * left, rel=1e-13)
        drawn = make_scene(run, last).rings.area
        assert drawn == pytest.approx(last.model.area, rel=3e-3)
        assert (drawn / factor**2) == pytest.approx(
            make_scene(run, run.frames[0]).rings.area, rel=1e-9
        )
        assert export_vtkhdf(run, tmp_path / "bed.vtkhdf") == len(run.frames)
        with h5py.File(tmp_path / "bed.vtkhdf") as file:
            root, n = file["VTKHDF"], initial.radius.size
            assert root["CellData/radius"][-n:].tolist() == last.radius.tolist()
    info = run_info(bed / "run")
    assert info["energy_closure"] < 1e-11
    assert info["heat_closure"] < 1e-11
    assert verify(bed / "run") == []


def test_stops_change_nothing(bed, tmp_path):
    assert in_pieces(bed / "bed.toml", tmp_path / "run", 7, 33) == digests(bed / "run")


def test_another_run_goes_on_with_the_outlines(bed, tmp_path):
    """As large as they are, where they no longer grow."""
    start, end = BED.index("[[particles]]"), BED.index("[[walls]]")
    more = f'[start]\nrun = "{(bed / "run").as_posix()}"\n[[loading]]\nduration = 0.002\n'
    loading, solver = BED.index("[[loading]]"), BED.index("[solver]")
    text = BED[:start] + BED[end:loading] + more + BED[solver:]
    text = text.replace("expansion = 2e-4\n", "").replace("wear_shrinks = true\n", "")
    (tmp_path / "more.toml").write_text(text, encoding="utf-8")
    multicor.run(tmp_path / "more.toml", tmp_path / "more", threads=1)
    with multicor.open_run(bed / "run") as run, multicor.open_run(tmp_path / "more") as other:
        last, first = run.frames[-1], other.frames[0]
        assert first.radius is None
        np.testing.assert_allclose(first.model.grains.radius, last.radius, rtol=1e-13)
        np.testing.assert_allclose(first.model.area, last.model.area, rtol=1e-12)
