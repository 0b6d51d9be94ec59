"""The commands ``export …``: files, messages, exit codes."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import call
from scenes import write_small
from store_support import make_model, run_whole

from multicor_cli.engine import solve_contacts
from multicor_cli.export import read_fclib


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a run in it."""
    path = tmp_path_factory.mktemp("export")
    run_whole(path / "run", make_model(heat=True))
    return path


def test_gsd(place: Path, tmp_path: Path) -> None:
    hoomd = pytest.importorskip("gsd.hoomd")
    done = call("export", "gsd", "run", "-o", tmp_path / "new" / "a.gsd", "--frames", "-3:", cwd=place)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert "3 frames" in done.stderr
    with hoomd.open(str(tmp_path / "new" / "a.gsd")) as file:
        assert [frame.configuration.step for frame in file] == [30, 35, 40]
    again = call("export", "gsd", "run", "-o", tmp_path / "new" / "a.gsd", cwd=place)
    assert again.returncode == 6
    assert "--overwrite" in again.stderr
    assert call("export", "gsd", "run", "-o", tmp_path / "new" / "a.gsd", "--overwrite", cwd=place).returncode == 0


def test_csv(place: Path, tmp_path: Path) -> None:
    done = call("export", "csv", place / "run" / "results.h5", "-o", tmp_path / "out", "--frames", "0:9:4", cwd=place)
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "out").glob("grains-*.csv"))) == 3
    wrong = call("export", "csv", "run", "-o", tmp_path / "more", "--frames", "100:", cwd=place)
    assert wrong.returncode == 2
    assert "from 0 to 8" in wrong.stderr
    assert call("export", "csv", "nothing", "-o", tmp_path / "more", cwd=place).returncode == 6
    assert call("export", "csv", "run", "-o", tmp_path / "more", "--frames", "x", cwd=place).returncode == 2
    assert not (tmp_path / "more").exists()


def test_fclib(tmp_path: Path) -> None:
    assert call("run", write_small(tmp_path), "-o", "run", cwd=tmp_path).returncode == 0
    done = call("export", "fclib", "run", "-o", "a.hdf5", "--frame", "5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "step after frame 5" in done.stderr
    problem, start = read_fclib(tmp_path / "a.hdf5")
    assert solve_contacts(problem, start=start).converged
    wrong = call("export", "fclib", "run", "-o", "b.hdf5", "--frame", "500", cwd=tmp_path)
    assert (wrong.returncode, (tmp_path / "b.hdf5").exists()) == (2, False)
