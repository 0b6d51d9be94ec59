"""report, post animate, --plot term: files that appear whole, or not at all, and are never overwritten unasked."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from heat_run import write_heated_run
from typer.testing import CliRunner

from multicor_cli.cli.app import app

runner = CliRunner()


@pytest.fixture(scope="module")
def heated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("heated") / "run"
    write_heated_run(path)
    return path


def test_report_of_a_real_run(finished: Path, tmp_path: Path) -> None:
    target = tmp_path / "small.html"
    done = runner.invoke(app, ["report", str(finished), "-o", str(target), "--frames", "7"])
    assert done.exit_code == 0, done.stderr
    assert done.stdout == ""
    assert re.search(r"wrote .*small\.html: .* kB, 7 of \d+ frames", done.stderr)
    text = target.read_text(encoding="utf-8")
    assert '<h1 dir="auto">small</h1>' in text
    assert "Velocity over the height" in text
    assert re.search(r"7 of \d+ frames of the run\.", text)
    again = runner.invoke(app, ["report", str(finished), "-o", str(target)])
    assert again.exit_code == 6
    assert "--overwrite" in again.stderr
    assert target.read_text(encoding="utf-8") == text
    assert runner.invoke(app, ["report", str(finished), "-o", str(target), "--overwrite"]).exit_code == 0


def test_report_goes_beside_the_run(heated: Path) -> None:
    done = runner.invoke(app, ["report", str(heated)])
    assert done.exit_code == 0, done.stderr
    assert (heated.parent / "run-report.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "code"), [(["-o", "page.txt"], 2), (["--frames", "0"], 2), (["-o", "no/such/folder/page.html"], 5)]
)
def test_report_refuses_what_cannot_be(arguments: list[str], code: int, heated: Path) -> None:
    done = runner.invoke(app, ["report", str(heated), *arguments])
    assert done.exit_code == code
    assert done.stdout == ""
    assert "internal error" not in done.stderr


def test_report_of_no_run_is_code_6(tmp_path: Path) -> None:
    done = runner.invoke(app, ["report", str(tmp_path), "-o", str(tmp_path / "page.html")])
    assert done.exit_code == 6
    assert list(tmp_path.iterdir()) == []


def test_animate_writes_a_gif(heated: Path, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    target = tmp_path / "film.gif"
    words = ["post", "animate", str(heated), "--of", "heat", "-o", str(target), "--fps", "4"]
    done = runner.invoke(app, words)
    assert done.exit_code == 0, done.stderr
    assert "4 frames, without 1 that lack this quantity" in done.stderr
    with image.open(target) as film:
        assert (film.n_frames, film.info["duration"]) == (4, 250)
    assert [file.name for file in tmp_path.iterdir()] == ["film.gif"]
    before = target.read_bytes()
    again = runner.invoke(app, words)
    assert again.exit_code == 6
    assert "--overwrite" in again.stderr
    assert target.read_bytes() == before
    assert runner.invoke(app, [*words, "--overwrite", "--frames", "-2:"]).exit_code == 0
    with image.open(target) as film:
        assert film.n_frames == 2


def test_animate_without_ffmpeg_writes_a_gif_and_says_so(heated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    done = runner.invoke(app, ["post", "animate", str(heated), "--of", "temperature", "-o", str(tmp_path / "a.mp4")])
    assert done.exit_code == 0, done.stderr
    assert "ffmpeg is not installed" in done.stderr
    assert (tmp_path / "a.gif").read_bytes().startswith(b"GIF89a")
    assert not (tmp_path / "a.mp4").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--of", "heat", "-o", "a.gif"], 2, "has no heat"), (["--of", "wetness", "-o", "a.gif"], 2, "wetness"),
        (["-o", "a.avi"], 2, ".mp4 or .gif"), (["--frames", "99:", "-o", "a.gif"], 2, "no frame is selected"),
        (["-o", "no/such/folder/a.gif"], 5, "No such file"),
    ],
)  # fmt: skip
def test_animate_refuses_what_cannot_be(
    arguments: list[str], code: int, message: str, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = runner.invoke(app, ["post", "animate", str(finished), *arguments])
    assert done.exit_code == code
    assert message in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_plots_in_the_terminal(finished: Path, heated: Path) -> None:
    done = runner.invoke(app, ["post", "profile", str(finished), "--plot", "term"])
    assert done.exit_code == 0, done.stderr
    assert "velocity [m/s]" in done.stderr
    assert "*" in done.stderr
    assert "*" not in done.stdout
    theta = runner.invoke(app, ["post", "theta-eta", str(heated), "--wall", "top", "--bins", "5", "--plot", "term"])
    assert "theta [–]" in theta.stderr
    energy = runner.invoke(app, ["post", "energy", str(finished), "--plot", "term"])
    assert "lost to friction [J]" in energy.stderr
    assert not Path("term").exists()


def test_grains_in_the_terminal(finished: Path) -> None:
    done = runner.invoke(app, ["post", "forces", str(finished), "--plot", "term"])
    assert done.exit_code == 0, done.stderr
    assert "normal force, mean" in done.stderr
