"""report, export, animate: files that appear whole, or not at all, and are never overwritten
unasked."""

import re

import pytest

from multicor_cli.engine import solve_contacts
from multicor_cli.export import read_fclib


def written_again(typed, line, target, more=""):
    """Refused the second time, done if asked to overwrite."""
    before = target.read_bytes()
    assert "--overwrite" in typed(line, 6).stderr
    assert target.read_bytes() == before
    typed(f"{line} --overwrite {more}")


def test_report_of_a_real_run(typed, tmp_path):
    target, line = tmp_path / "small.html", "report RUN -o small.html"
    done = typed(f"{line} --frames 7")
    assert done.stdout == ""
    assert re.search(r"wrote .*small\.html: .* kB, 7 of \d+ frames", done.stderr)
    text = target.read_text(encoding="utf-8")
    assert '<h1 dir="auto">small</h1>' in text
    assert "Horizontal velocity over the height" in text
    assert re.search(r"7 of \d+ frames of the run\.", text)
    written_again(typed, line, target)


def test_report_goes_beside_the_run(typed, heated):
    typed("report HEATED")
    assert (heated.parent / "run-report.html").is_file()


def test_animate_writes_a_gif(typed, tmp_path):
    image = pytest.importorskip("PIL.Image")
    target, line = tmp_path / "film.gif", "post animate HEATED --of heat -o film.gif --fps 4"
    assert "4 frames, without 1 that lack this quantity" in typed(line).stderr
    with image.open(target) as film:
        assert (film.n_frames, film.info["duration"]) == (4, 250)
    assert [file.name for file in tmp_path.iterdir()] == ["film.gif"]
    written_again(typed, line, target, "--frames -2:")
    with image.open(target) as film:
        assert film.n_frames == 2


def test_animate_without_ffmpeg_writes_a_gif_and_says_so(typed, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    done = typed("post animate HEATED --of temperature -o a.mp4")
    assert "ffmpeg is not installed" in done.stderr
    assert (tmp_path / "a.gif").read_bytes().startswith(b"GIF89a")
    assert not (tmp_path / "a.mp4").exists()


@pytest.mark.parametrize(("line", "words"), [
    ("profile RUN", "velocity [m/s]"),
    ("theta-eta HEATED --wall top --bins 5", "theta [–]"),
    ("structure RUN --margin 0", "pair correlation g [–]"),
    ("avalanches RUN --of kinetic --threshold 1e-12", "kinetic [J]"),
    ("fabric RUN --from 0", "anisotropy [–]"),
    ("correlation RUN --margin 0", "correlation C [–]"),
    ("heat-network HEATED", "heat flow, mean"),
    ("energy RUN", "lost to friction [J]"),
    ("forces RUN", "normal force, mean"),
])  # fmt: skip
def test_plots_in_the_terminal(line, words, typed, tmp_path):
    done = typed(f"post {line} --plot term")
    assert words in done.stderr
    if line == "profile RUN":
        assert "*" in done.stderr
        assert "*" not in done.stdout
    assert not (tmp_path / "term").exists()


def test_gsd(typed, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    line, target = "export gsd HEATED -o new/a.gsd", tmp_path / "new" / "a.gsd"
    done = typed(f"{line} --frames -3:")
    assert done.stdout == ""
    assert "3 frames" in done.stderr
    with hoomd.open(str(target)) as file:
        assert [frame.configuration.step for frame in file] == [2, 3, 4]
    written_again(typed, line, target)


def test_vtkhdf(typed, tmp_path):
    line, target = "export vtkhdf SHAPED -o new/a.vtkhdf", tmp_path / "new" / "a.vtkhdf"
    assert "2 frames" in typed(f"{line} --frames 1:").stderr
    written_again(typed, line, target)
    assert "end in .vtkhdf" in typed("export vtkhdf SHAPED -o a.h5", 2).stderr
    assert "all grains are discs" in typed("export vtkhdf HEATED -o b.vtkhdf", 2).stderr


def test_tables_and_problems_are_exported(typed, tmp_path):
    typed("export csv HEATED/results.h5 -o out --frames 0:5:2")
    assert len(list((tmp_path / "out").glob("grains-*.csv"))) == 3
    done = typed("export fclib RUN -o a.hdf5 --frame 5")
    assert "step after frame 5" in done.stderr
    problem, start = read_fclib(tmp_path / "a.hdf5")
    assert solve_contacts(problem, start=start).converged
